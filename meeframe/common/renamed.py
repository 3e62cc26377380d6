"""Names of earlier versions and their present names."""

from typing import Final

RENAMED: Final = {
    "counter_body": "second_body",
    "counter": "second_body",
    "reaches_edge": "contact_at_zone_boundary",
    "closed": "contact_fraction",
    "covered": "area_fraction",
}
"""Keys of case files, quantities, fields, and attributes of increments."""


def renaming(name: str) -> str:
    """Return the present name of a renamed quantity in words, "" for any other name."""
    return now_called(RENAMED[name]) if name in RENAMED else ""


def now_called(name: str) -> str:
    """Return in words that something has this name at present."""
    return f"it is now called {name!r}"
