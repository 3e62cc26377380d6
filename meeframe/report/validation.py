"""What a validation says: checks, claims and plots of its cases, and their verdicts."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from meeframe.core.errors import CaseError
from meeframe.core.fields import Array


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
    Raises CaseError for a reference or tolerance with which nothing can be compared.
    """

    name: str
    computed: float
    reference: float
    tolerance: float
    unit: str = ""
    absolute: bool = False
    explained: str = ""

    def __post_init__(self) -> None:
        if not math.isfinite(self.reference) or not 0.0 <= self.tolerance < math.inf:
            raise CaseError(
                f"check {self.name!r}: reference = {self.reference}, tolerance = {self.tolerance}; allowed: a finite "
                "reference and a finite tolerance >= 0"
            )
        if not (self.absolute or self.reference):
            raise CaseError(f"check {self.name!r}: reference = 0 has no relative difference; allowed: absolute = True")

    @property
    def difference(self) -> float:
        """Relative, or absolute in the unit."""
        return self.computed - self.reference if self.absolute else self.computed / self.reference - 1.0

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
