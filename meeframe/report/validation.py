"""What a validation says: checks, claims and plots of its cases, the verdicts, table and JSON."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from textwrap import shorten
from typing import Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from meeframe.core.fields import Array
from meeframe.report.canvas import prefixed

__all__ = [
    "BAD",
    "CaseReport",
    "Check",
    "Claim",
    "Curve",
    "Item",
    "Map",
    "Plot",
    "Row",
    "Skip",
    "Validation",
    "Verdict",
    "validation_json",
    "validation_table",
]


class Verdict(StrEnum):
    """Of a check or claim. DIFFERS: a difference to the published that the case explains; NOT_RESOLVED: the mesh is too
    coarse to tell; SKIPPED: what it needs is not there; ERROR: the case broke off."""

    PASS = "pass"
    FAIL = "fail"
    DIFFERS = "differs"
    NOT_RESOLVED = "not resolved"
    SKIPPED = "skipped"
    ERROR = "error"


BAD: Final = (Verdict.FAIL, Verdict.ERROR)
"""Verdicts that make a validation fail."""


@dataclass(frozen=True)
class Check:
    """A number against a reference.

    computed, reference: in the unit; tolerance: bound of |computed/reference - 1|, or if absolute of
    |computed - reference|; explained: why it is known to differ from a published number, if it is.
    """

    name: str
    computed: float
    reference: float
    tolerance: float
    unit: str = ""
    absolute: bool = False
    explained: str = ""

    @property
    def difference(self) -> float:
        """Relative, or absolute in the unit."""
        if self.absolute:
            return self.computed - self.reference
        return self.computed / self.reference - 1.0 if self.reference else math.inf

    @property
    def verdict(self) -> Verdict:
        """PASS within the tolerance; a number that is not finite never is."""
        if abs(self.difference) <= self.tolerance:
            return Verdict.PASS
        return Verdict.DIFFERS if self.explained and math.isfinite(self.computed) else Verdict.FAIL


@dataclass(frozen=True)
class Claim:
    """A published statement without a number of its own: what is said, what is found, what decides.

    holds: None if the mesh is too coarse to tell; explained: why it is known not to hold, if it is.
    """

    name: str
    found: str
    judged: str
    holds: bool | None
    explained: str = ""

    @property
    def verdict(self) -> Verdict:
        """What the numbers say of it."""
        if self.holds is None:
            return Verdict.NOT_RESOLVED
        return Verdict.PASS if self.holds else Verdict.DIFFERS if self.explained else Verdict.FAIL


@dataclass(frozen=True)
class Skip:
    """A check that cannot be made here. reason: what is missing and how to get it."""

    name: str
    reason: str

    @property
    def verdict(self) -> Verdict:
        """SKIPPED."""
        return Verdict.SKIPPED


@dataclass(frozen=True, eq=False)
class Curve:
    """x, y (m,) in the units of the plot's labels; points: drawn as markers, else as a line; joined: as both."""

    label: str
    x: Array
    y: Array
    points: bool = False
    joined: bool = False


@dataclass(frozen=True, eq=False)
class Plot:
    """Curves in one pair of axes. note: what is seen, in a sentence or two."""

    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    log_x: bool = False
    log_y: bool = False
    note: str = ""


@dataclass(frozen=True, eq=False)
class Map:
    """Fields on one regular grid, to be chosen by their labels: each (ny, nx) at x (nx,), y (ny,)."""

    title: str
    x_label: str
    y_label: str
    value_label: str
    x: Array
    y: Array
    fields: Mapping[str, Array]
    note: str = ""


Item = Check | Claim | Skip | Plot | Map
"""What the `run` of a case yields."""


@dataclass(frozen=True)
class Row:
    """What was found, and the seconds since the item before."""

    found: Check | Claim | Skip
    seconds: float


@dataclass(frozen=True, eq=False)
class CaseReport:
    """A case so far. error: traceback, if it broke off; seconds: of all."""

    name: str
    title: str
    source: str
    rows: tuple[Row, ...] = ()
    figures: tuple[Plot | Map, ...] = ()
    seconds: float = 0.0
    error: str = ""

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Of the rows, and of a breakdown."""
        return (*(row.found.verdict for row in self.rows), *([Verdict.ERROR] if self.error else []))


@dataclass(frozen=True, eq=False)
class Validation:
    """All cases so far. versions: of the software that made it."""

    quick: bool
    versions: Mapping[str, str]
    cases: tuple[CaseReport, ...] = ()
    planned: int = field(default=0, kw_only=True)

    @property
    def passed(self) -> bool:
        """Whether nothing failed or broke off."""
        return not any(verdict in BAD for case in self.cases for verdict in case.verdicts)

    def count(self, verdict: Verdict) -> int:
        """How many have this verdict."""
        return sum(case.verdicts.count(verdict) for case in self.cases)

    @property
    def headline(self) -> str:
        """Verdicts and times in one line."""
        shown = (v for v in Verdict if self.count(v) or v in (Verdict.PASS, Verdict.FAIL))
        counts = ", ".join(f"{self.count(v)} {v}" for v in shown)
        seconds = sum(case.seconds for case in self.cases)
        kind = "quick" if self.quick else "full"
        return f"{kind} validation, {len(self.cases)} of {self.planned} cases: {counts}; {seconds:.0f} s"


def cells(row: Row) -> tuple[str, str, str, str, str, str]:
    """Name, computed, reference, difference, tolerance, seconds of a row, as words."""
    found, seconds = row.found, f"{row.seconds:.1f}"
    match found:
        case Claim():
            return found.name, found.found, "", "", found.judged, seconds
        case Skip():
            return found.name, found.reason, "", "", "", seconds
    unit, scale = found.unit, 1.0
    if found.unit and not found.absolute and "^" not in found.unit:
        scale, unit = prefixed(np.array([found.reference]), found.unit)
    values = (f"{value / scale:.6g} {unit}".strip() for value in (found.computed, found.reference))
    if found.absolute:
        bounds = tuple(f"{value:.3g} {found.unit}".strip() for value in (found.difference, found.tolerance))
        values = (f"{value:.6g} {found.unit}".strip() for value in (found.computed, found.reference))
    else:
        bounds = (f"{100 * found.difference:+.3g} %", f"{100 * found.tolerance:.3g} %")
    return (found.name, *values, *bounds, seconds)  # type: ignore[return-value]


_WIDEST: Final = 80
"""Letters in a cell of the terminal's table; the report has all."""
_STYLES: Final = {
    Verdict.PASS: "green",
    Verdict.FAIL: "bold red",
    Verdict.ERROR: "bold red",
    Verdict.DIFFERS: "yellow",
}


def validation_table(validation: Validation) -> RenderableType:
    """The table for the terminal, the reasons of what did not pass, and the headline."""
    table = Table()
    for heading in ("case", "check", "computed", "reference", "difference", "tolerance", "time [s]", ""):
        table.add_column(heading, justify="left" if heading in ("case", "check", "") else "right")
    remarks = []
    for case in validation.cases:
        for number, row in enumerate(case.rows):
            verdict = row.found.verdict
            name = "" if number else case.name
            words = (shorten(word, _WIDEST, placeholder=" ...") for word in cells(row))
            table.add_row(name, *words, Text(str(verdict), style=_STYLES.get(verdict, "")))
            if verdict is Verdict.DIFFERS and not isinstance(row.found, Skip):
                remarks.append(Text(f"{case.name}, {row.found.name}: {row.found.explained}"))
        if case.error:
            last = shorten(case.error.strip().splitlines()[-1], _WIDEST, placeholder=" ...")
            table.add_row("" if case.rows else case.name, "", last, *[""] * 4, Text("error", style="bold red"))
        table.add_section()
    headline = Text(validation.headline, style="green" if validation.passed else "bold red")
    return Group(table, *remarks, headline)


def validation_json(validation: Validation) -> str:
    """Everything but the figures; numbers that are not finite become null."""
    data = {
        "quick": validation.quick,
        "passed": validation.passed,
        "planned_cases": validation.planned,
        "versions": dict(validation.versions),
        "cases": [
            {
                "name": case.name,
                "title": case.title,
                "source": case.source,
                "seconds": round(case.seconds, 3),
                "error": case.error,
                "checks": list(_rows(case)),
            }
            for case in validation.cases
        ],
    }
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _rows(case: CaseReport) -> Iterator[dict[str, Any]]:
    for row in case.rows:
        found = row.found
        values = vars(found) | ({"difference": found.difference} if isinstance(found, Check) else {})
        plain = {key: _plain(value) for key, value in values.items() if value != ""}
        yield {"kind": type(found).__name__.lower(), **plain, "verdict": str(found.verdict), "seconds": row.seconds}


def _plain(value: Any) -> Any:
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return bool(value) if isinstance(value, np.bool_) else value
