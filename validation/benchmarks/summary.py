"""The table at the head of docs/performance.md: every demand, what was found, those that are not met first."""

from collections.abc import Iterable
from types import ModuleType

from common import Record, table, verdict

GPU = ("GPU, optional: half spaces and kernels on a CUDA device", "not done: no such device could be had for it", "")


def head(parts: Iterable[tuple[ModuleType, Record]]) -> str:
    """The table of the parts that have demands: module, which then has `verdicts`, and record."""
    rows: list[tuple[str, str, bool]] = []
    older = []
    for module, record in parts:
        if not hasattr(module, "verdicts"):
            continue
        try:
            rows += module.verdicts(record)
        except KeyError:
            older.append((module.TITLE, "to be measured again", ""))
    rows.sort(key=lambda row: row[2])
    told = [(asked, found, verdict(met)) for asked, found, met in rows]
    return table(("demand", "found", "verdict"), [*told, *older, GPU])
