"""The examples of docs/reference/materials.md run, and its table agrees with the library."""

import re
import tomllib
from pathlib import Path

import pytest

from meeframe.material import Material, library, material_from_table

PAGE = (Path(__file__).parents[3] / "docs" / "reference" / "materials.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", PAGE, re.DOTALL)


@pytest.mark.parametrize("text", [text for kind, text in BLOCKS if kind == "toml"])
def test_tables_are_accepted(text: str) -> None:
    assert isinstance(material_from_table(tomllib.loads(text)["material"]), Material)


def test_python_example_runs() -> None:
    for text in (text for kind, text in BLOCKS if kind == "python"):
        names: dict[str, object] = {}
        exec(text, names)
        assert isinstance(names["composite"], Material)


def test_table_lists_the_library_with_options_and_sources() -> None:
    rows = {row[1]: row[0] for row in re.findall(r"(\| `([\w-]+)` \|.*)", PAGE.split("## In a case file")[0])}
    assert set(rows) == {entry.name for entry in library()}
    for entry in library():
        assert all(f"`{option}`" in rows[entry.name] for option in entry.options)
        authors = re.match(r"[\w ,]+", entry.source)
        assert authors is not None
        assert authors[0].split(",")[0] in rows[entry.name] or "as for `batio3`" in rows[entry.name]
