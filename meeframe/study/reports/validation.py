"""Records of a validation: checks, claims and plots of its cases, and their outcomes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from numbers import Real
from typing import Any, Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import Array


class Verdict(StrEnum):
    """Outcome of a check or claim.

    DIFFERS: an explained difference from a publication; NOT_RESOLVED: the mesh is too coarse to decide; SKIPPED: a
    package is missing or the check does not apply; ERROR: the case raised an error.
    """

    PASS = "pass"
    FAIL = "fail"
    DIFFERS = "differs"
    NOT_RESOLVED = "not resolved"
    SKIPPED = "skipped"
    ERROR = "error"


FAILING_VERDICTS: Final = (Verdict.FAIL, Verdict.ERROR)
"""Outcomes that make a validation fail."""


@dataclass(frozen=True)
class Check:
    """Comparison of a number with a reference.

    Attributes
    ----------
    name : str
        Name of the check.
    computed, reference : float
        Values in the unit.
    tolerance : float
        Bound of |computed/reference - 1|, or of |computed - reference| if absolute.
    unit : str
        Unit of the values.
    absolute : bool
        Whether the difference is absolute.
    explained : str
        Reason for a known difference from a published number.
    explained_up_to : float
        Largest difference that the reason accounts for, greater than the tolerance.

    Raises
    ------
    CaseError
        For a value of the wrong type, a reference or tolerance that does not allow a comparison, or an explanation
        without its bound.
    """

    name: str
    computed: float
    reference: float
    tolerance: float
    unit: str = ""
    absolute: bool = False
    explained: str = ""
    explained_up_to: float = 0.0

    def __post_init__(self) -> None:
        what = f"check {self.name!r}"
        _check_texts(what, name=self.name, unit=self.unit, explained=self.explained)
        for key in ("computed", "reference", "tolerance", "explained_up_to"):
            value = getattr(self, key)
            if not isinstance(value, Real):
                raise CaseError(f"{what}: {key} = {value!r}; allowed: a real number")
        if not math.isfinite(self.reference) or not 0.0 <= self.tolerance < math.inf:
            raise CaseError(
                f"{what}: reference = {self.reference}, tolerance = {self.tolerance}; allowed: a finite reference and "
                "a finite tolerance >= 0"
            )
        if not (self.absolute or self.reference):
            raise CaseError(f"{what}: reference = 0 has no relative difference; allowed: absolute = True")
        if self.explained and not self.tolerance < self.explained_up_to < math.inf:
            raise CaseError(
                f"{what}: explained_up_to = {self.explained_up_to}; allowed: finite numbers above the tolerance "
                f"{self.tolerance}, as nothing explains every difference"
            )

    @property
    def difference(self) -> float:
        """Relative difference, or absolute difference in the unit."""
        return self.computed - self.reference if self.absolute else self.computed / self.reference - 1.0

    @property
    def verdict(self) -> Verdict:
        """Outcome that follows from the numbers; PASS requires a finite value within the tolerance."""
        size = abs(self.difference)
        if size <= self.tolerance:
            return Verdict.PASS
        return Verdict.DIFFERS if self.explained and size <= self.explained_up_to else Verdict.FAIL


@dataclass(frozen=True)
class Claim:
    """A published statement without a number.

    Attributes
    ----------
    name : str
        The statement.
    observed : str
        Computed values, in words.
    criterion : str
        Criterion for the values.
    holds : bool or None
        Whether the criterion is met; None if the mesh is too coarse to decide.
    explained : str
        Reason if the statement is known not to hold.
    as_explained : bool
        Whether the values agree with this reason.

    Raises
    ------
    CaseError
        For values of the wrong type.
    """

    name: str
    observed: str
    criterion: str
    holds: bool | None
    explained: str = ""
    as_explained: bool = False

    def __post_init__(self) -> None:
        what = f"claim {self.name!r}"
        _check_texts(what, name=self.name, observed=self.observed, criterion=self.criterion, explained=self.explained)
        for key, allowed in (("holds", "True, False or None"), ("as_explained", "True or False")):
            value = getattr(self, key)
            if not (isinstance(value, bool | np.bool_) or (key == "holds" and value is None)):
                raise CaseError(f"{what}: {key} = {value!r}; allowed: {allowed}")

    @property
    def verdict(self) -> Verdict:
        """Outcome that follows from the numbers."""
        if self.holds is None:
            return Verdict.NOT_RESOLVED
        known = self.explained and self.as_explained
        return Verdict.PASS if self.holds else Verdict.DIFFERS if known else Verdict.FAIL


@dataclass(frozen=True)
class Skip:
    """A check that cannot run here.

    Attributes
    ----------
    name : str
        Name of the check.
    reason : str
        The missing requirement and how to install it.
    """

    name: str
    reason: str

    def __post_init__(self) -> None:
        _check_texts("a skipped check", name=self.name, reason=self.reason)

    @property
    def verdict(self) -> Verdict:
        """Outcome SKIPPED."""
        return Verdict.SKIPPED


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of a plot.

    Attributes
    ----------
    label : str
        Label in the legend.
    x, y : Array
        Coordinates (m,) in the units of the labels of the plot.
    points : bool
        Whether to draw markers instead of a line.
    joined : bool
        Whether to draw both.

    Raises
    ------
    CaseError
        If x and y are not real numbers of equal count.
    """

    label: str
    x: Array
    y: Array
    points: bool = False
    joined: bool = False

    def __post_init__(self) -> None:
        _check_texts("a curve", label=self.label)
        _check_shape(f"curve {self.label!r}", "y", self.y, (_check_line(f"curve {self.label!r}", "x", self.x),))


@dataclass(frozen=True, eq=False)
class Plot:
    """Curves in one coordinate system.

    Attributes
    ----------
    title : str
        Title.
    x_label, y_label : str
        Labels of the axes, with units.
    curves : tuple of Curve
        The curves, at least one.
    log_x, log_y : bool
        Whether the axes are logarithmic.
    note : str
        Caption of one or two sentences.

    Raises
    ------
    CaseError
        If there are no curves.
    """

    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    log_x: bool = False
    log_y: bool = False
    note: str = ""

    def __post_init__(self) -> None:
        _check_texts("a plot", title=self.title, x_label=self.x_label, y_label=self.y_label, note=self.note)
        if not (isinstance(self.curves, tuple) and self.curves and all(isinstance(c, Curve) for c in self.curves)):
            raise CaseError(f"plot {self.title!r}: curves = {self.curves!r}; allowed: a tuple of at least one Curve")


@dataclass(frozen=True, eq=False)
class Map:
    """Fields on one regular grid, selected by label.

    Attributes
    ----------
    title : str
        Title.
    x_label, y_label, value_label : str
        Labels of the axes and of the values, with units.
    x, y : Array
        Coordinates, (nx,) and (ny,).
    fields : dict of str to Array
        Values by label, (ny, nx) each.
    note : str
        Caption of one or two sentences.

    Raises
    ------
    CaseError
        For other shapes and if there is no finite value.
    """

    title: str
    x_label: str
    y_label: str
    value_label: str
    x: Array
    y: Array
    fields: Mapping[str, Array]
    note: str = ""

    def __post_init__(self) -> None:
        texts = {key: getattr(self, key) for key in ("title", "x_label", "y_label", "value_label", "note")}
        _check_texts("a map", **texts)
        what = f"map {self.title!r}"
        shape = _check_line(what, "y", self.y), _check_line(what, "x", self.x)
        for label, values in self.fields.items():
            _check_shape(what, f"field {label!r}", values, shape)
        if not any(np.isfinite(values).any() for values in self.fields.values()):
            raise CaseError(f"{what}: no finite value in its fields; allowed: at least one")


Item = Check | Claim | Skip | Plot | Map
"""Items that the `run` of a case yields."""


def _check_texts(what: str, **texts: Any) -> None:
    """Raise CaseError unless all values are texts."""
    for key, text in texts.items():
        if not isinstance(text, str):
            raise CaseError(f"{what}: {key} = {text!r}; allowed: a text")


def _check_line(what: str, name: str, values: Any) -> int:
    """Return the number of values. Raises CaseError unless they are real numbers in one dimension."""
    count = np.size(values)
    _check_shape(what, name, values, (count,))
    return count


def _check_shape(what: str, name: str, values: Any, shape: tuple[int, ...]) -> None:
    """Raise CaseError unless the values are real numbers of that shape, at least one."""
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        array = np.asarray(values, object)
    if array.shape != shape or array.dtype.kind not in "fiub" or not array.size:
        raise CaseError(
            f"{what}: {name} is {array.dtype} {array.shape}; allowed: real numbers {shape}, at least one of them"
        )


@dataclass(frozen=True)
class Row:
    """Outcome in a validation.

    Attributes
    ----------
    item : Check, Claim or Skip
        The outcome.
    seconds : float
        Time since the previous item [s].
    """

    item: Check | Claim | Skip
    seconds: float


@dataclass(frozen=True, eq=False)
class CaseReport:
    """Report of a case so far.

    Attributes
    ----------
    name, title, source : str
        Folder, title and publication of the case.
    rows : tuple of Row
        Outcomes.
    figures : tuple of Plot or Map
        Plots and maps.
    seconds : float
        Total time.
    error : str
        Traceback or message if the case failed.
    finished : bool
        Whether it has yielded all items.
    """

    name: str
    title: str
    source: str
    rows: tuple[Row, ...] = ()
    figures: tuple[Plot | Map, ...] = ()
    seconds: float = 0.0
    error: str = ""
    finished: bool = field(default=False, kw_only=True)

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Outcomes of the rows, and ERROR if the case failed."""
        return (*(row.item.verdict for row in self.rows), *([Verdict.ERROR] if self.error else []))


@dataclass(frozen=True, eq=False)
class Validation:
    """Validation of all cases so far.

    Attributes
    ----------
    quick : bool
        Whether coarser grids are used.
    versions : dict of str to str
        Versions of the software.
    cases : tuple of CaseReport
        Reports of the cases.
    planned : int
        Number of cases to run.
    """

    quick: bool
    versions: Mapping[str, str]
    cases: tuple[CaseReport, ...] = ()
    planned: int = field(default=0, kw_only=True)

    @property
    def finished(self) -> tuple[CaseReport, ...]:
        """Cases that have ended or failed."""
        return tuple(case for case in self.cases if case.finished)

    @property
    def failed(self) -> bool:
        """True if any check or case has failed so far."""
        return any(verdict in FAILING_VERDICTS for case in self.cases for verdict in case.verdicts)

    @property
    def passed(self) -> bool:
        """True if all planned cases are finished and nothing has failed."""
        return len(self.finished) == self.planned and not self.failed

    def count(self, verdict: Verdict) -> int:
        """Return the number of checks with an outcome.

        Parameters
        ----------
        verdict : Verdict
            The outcome.

        Returns
        -------
        int
            The number.
        """
        return sum(case.verdicts.count(verdict) for case in self.cases)

    @property
    def headline(self) -> str:
        """Numbers of outcomes and total time in one line."""
        shown = (v for v in Verdict if self.count(v) or v in (Verdict.PASS, Verdict.FAIL))
        counts = ", ".join(f"{self.count(v)} {v}" for v in shown)
        seconds = sum(case.seconds for case in self.cases)
        kind = "quick" if self.quick else "full"
        return f"{kind} validation, {len(self.finished)} of {self.planned} cases: {counts}; {seconds:.0f} s"
