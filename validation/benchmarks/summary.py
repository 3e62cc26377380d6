"""Table of the main figures at the head of docs/validation/performance.md."""

from collections.abc import Iterable
from types import ModuleType

from common import Record, figures


def head(parts: Iterable[tuple[ModuleType, Record]]) -> str:
    """Return the table of `highlights(record)` of all benchmarks that define it."""
    rows: list[tuple[str, str]] = []
    for module, record in parts:
        if not hasattr(module, "highlights"):
            continue
        try:
            rows += module.highlights(record)
        except KeyError:
            rows.append((module.TITLE, "to be measured again"))
    return figures(rows)
