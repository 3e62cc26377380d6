"""Records of a verification: runs by several formulations on several meshes, their limits and agreement."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import combinations
from typing import Final

from meeframe.contact.problem import Status
from meeframe.fields import MEE, FieldSet
from meeframe.study.reports.extrapolation import SECOND, Extrapolation, richardson

_CANCELLATION_RATIO: Final = 0.01
"""Quantities below this fraction of their scale are sums that cancel, as by symmetry, and are not compared."""
_NEGLIGIBLE: Final = 1e-6
"""Quantities below this fraction of their physical scale are noise in uncoupled fields, and are not compared."""
_ITERATION: Final = 1e-5
"""Relative error of the iteration."""
_MAX_ERROR_SUM: Final = 0.05
"""Relative sum of errors up to which two formulations count as resolved."""


class Verdict(StrEnum):
    """Outcome for two formulations in one quantity, or for a verification as a whole."""

    AGREE = "agree"
    DISAGREE = "disagree"
    UNRESOLVED = "unresolved"
    NOT_CONVERGED = "not-converged"
    UNFINISHED = "unfinished"


@dataclass(frozen=True)
class MeasuredQuantity:
    """A measured quantity.

    Attributes
    ----------
    value : float
        Value in SI units.
    scale : float
        Value without cancellation, if all contributions had one sign.
    noise : float
        Uncertainty due to the mesh that follows no order, as of an area that is counted by elements.
    physical : float
        Value that loads of this size could cause if all fields were fully coupled; 0 if unknown.
    """

    value: float
    scale: float
    noise: float = 0.0
    physical: float = 0.0


@dataclass(frozen=True, eq=False)
class VerifiedRun:
    """A formulation on a mesh.

    Attributes
    ----------
    formulation : str
        Label of the formulation.
    size : float
        Element size relative to the width of the contact zone.
    elements : int
        Number of elements of the surface.
    status : str
        Status of the iteration, or 'refused'.
    message : str
        Reason if it did not converge.
    steps : dict of int to dict of str to MeasuredQuantity
        Quantities by name at the end of load steps, by the number of the step from 1.
    seconds : float
        Total time.
    """

    formulation: str
    size: float
    elements: int
    status: str = ""
    message: str = ""
    steps: Mapping[int, Mapping[str, MeasuredQuantity]] = field(default_factory=dict)
    seconds: float = 0.0


@dataclass(frozen=True)
class Estimate:
    """A quantity of a formulation.

    Attributes
    ----------
    step : int
        Number of the load step, from 1.
    quantity : str
        Name of the quantity.
    formulation : str
        Label of the formulation.
    sizes, values : tuple of float
        Element sizes and values, from coarse to fine.
    limit : Extrapolation
        Extrapolated value.
    """

    step: int
    quantity: str
    formulation: str
    sizes: tuple[float, ...]
    values: tuple[float, ...]
    limit: Extrapolation


@dataclass(frozen=True)
class Agreement:
    """Comparison of two estimates of one quantity.

    Attributes
    ----------
    first, second : Estimate
        The estimates, by two formulations.
    """

    first: Estimate
    second: Estimate

    @property
    def scale(self) -> float:
        """Mean modulus of the extrapolated values."""
        return (abs(self.first.limit.value) + abs(self.second.limit.value)) / 2

    @property
    def difference(self) -> float:
        """Difference of the extrapolated values, second minus first."""
        return self.second.limit.value - self.first.limit.value

    @property
    def finest(self) -> float:
        """Difference of the values on the finest meshes, second minus first."""
        return self.second.limit.finest - self.first.limit.finest

    @property
    def allowed(self) -> float:
        """Sum of the errors of both estimates."""
        return self.first.limit.error + self.second.limit.error + _ITERATION * self.scale

    @property
    def verdict(self) -> Verdict:
        """DISAGREE if the difference exceeds the errors; UNRESOLVED if the errors are too large for a conclusion."""
        if abs(self.difference) > self.allowed:
            return Verdict.DISAGREE
        return Verdict.AGREE if self.allowed <= _MAX_ERROR_SUM * self.scale else Verdict.UNRESOLVED


@dataclass(frozen=True, eq=False)
class Verification:
    """A verification.

    Attributes
    ----------
    title, text : str
        Title and text of the case.
    versions : dict of str to str
        Versions of the software.
    refusals : dict of str to str
        Reasons of formulations that refuse the case.
    order : float
        Theoretical order.
    planned : int
        Number of planned runs.
    runs : tuple of VerifiedRun
        Finished runs.
    fields : FieldSet
        Field set of the case.
    """

    title: str
    text: str
    versions: Mapping[str, str]
    refusals: Mapping[str, str]
    order: float = SECOND
    planned: int = 0
    runs: tuple[VerifiedRun, ...] = ()
    fields: FieldSet = MEE

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Estimates of all quantities that are not negligible, from formulations that converged on all their meshes."""
        return tuple(self._estimates())

    @property
    def agreements(self) -> tuple[Agreement, ...]:
        """Comparisons of every two formulations, quantity by quantity."""
        estimate_pairs = combinations(self.estimates, 2)
        return tuple(Agreement(a, b) for a, b in estimate_pairs if (a.step, a.quantity) == (b.step, b.quantity))

    @property
    def verdict(self) -> Verdict:
        """Outcome of the verification: that of the runs, else DISAGREE if any two do, UNRESOLVED if no two agree."""
        verdicts = [agreement.verdict for agreement in self.agreements]
        for verdict, applies in (
            (Verdict.NOT_CONVERGED, any(run.status != Status.CONVERGED for run in self.runs)),
            (Verdict.UNFINISHED, len(self.runs) < self.planned),
            (Verdict.DISAGREE, Verdict.DISAGREE in verdicts),
            (Verdict.UNRESOLVED, Verdict.AGREE not in verdicts),
        ):
            if applies:
                return verdict
        return Verdict.AGREE

    def _estimates(self) -> Iterator[Estimate]:
        done = self._complete()
        steps = next(iter(done.values()))[0].steps if done else {}
        for step, quantities in steps.items():
            for quantity in quantities:
                measured_values = {name: [run.steps[step][quantity] for run in runs] for name, runs in done.items()}
                if _is_cancelled([values[-1] for values in measured_values.values()]):
                    continue
                for name, values in measured_values.items():
                    sizes = tuple(run.size for run in done[name])
                    numbers = tuple(measured.value for measured in values)
                    limit = richardson(sizes, numbers, self.order, values[-1].noise)
                    yield Estimate(step, quantity, name, sizes, numbers, limit)

    def _complete(self) -> dict[str, list[VerifiedRun]]:
        """Return the runs of the formulations that converged on all meshes."""
        sizes = {run.size for run in self.runs}
        done: dict[str, list[VerifiedRun]] = {}
        for run in self.runs:
            done.setdefault(run.formulation, []).append(run)
        return {
            name: runs
            for name, runs in done.items()
            if len(self.runs) == self.planned
            and len(runs) == len(sizes)
            and all(run.status == Status.CONVERGED for run in runs)
        }


def _is_cancelled(values: Sequence[MeasuredQuantity]) -> bool:
    """Return whether a quantity cancels almost entirely, or is negligible on its physical scale."""
    largest = max(abs(value.value) for value in values)
    cancelled = _CANCELLATION_RATIO * max(value.scale for value in values)
    return largest <= max(cancelled, _NEGLIGIBLE * max(value.physical for value in values))
