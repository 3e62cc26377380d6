"""Runs of one case by several formulations on several meshes, and whether their limits agree within their errors."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import combinations
from typing import Final

from meeframe.contact.problem import Status
from meeframe.study.reports.extrapolation import SECOND, Extrapolation, richardson

_CANCELLED: Final = 0.01
"""Of the scale: quantities below are sums of parts that cancel, by symmetry for instance, and are not compared."""
_ITERATION: Final = 1e-5
"""Of the value: what is left to the iteration."""
_RESOLVED: Final = 0.05
"""Of the value: formulations whose errors add up to more have not been told apart."""


class Verdict(StrEnum):
    """Verdict on two formulations in one quantity, or on a verification as a whole."""

    AGREE = "agree"
    DISAGREE = "disagree"
    UNRESOLVED = "unresolved"
    NOT_CONVERGED = "not-converged"
    UNFINISHED = "unfinished"


@dataclass(frozen=True)
class Measured:
    """value: SI; scale: what it would be if its parts had one sign; noise: what the mesh leaves in doubt without any
    order, as of an area that is counted by elements."""

    value: float
    scale: float
    noise: float = 0.0


@dataclass(frozen=True, eq=False)
class VerifiedRun:
    """A formulation on a mesh. size: of the elements, as part of the contact zone's width; elements: of the surface;
    status: of the iteration, or 'refused'; message: why, if it did not converge; steps: quantities by name at the end
    of load steps, by their number from 1; seconds: in all."""

    formulation: str
    size: float
    elements: int
    status: str = ""
    message: str = ""
    steps: Mapping[int, Mapping[str, Measured]] = field(default_factory=dict)
    seconds: float = 0.0


@dataclass(frozen=True)
class Estimate:
    """A quantity of a formulation. sizes, values: on its meshes, from coarse to fine."""

    step: int
    quantity: str
    formulation: str
    sizes: tuple[float, ...]
    values: tuple[float, ...]
    limit: Extrapolation


@dataclass(frozen=True)
class Agreement:
    """Two estimates of one quantity."""

    first: Estimate
    second: Estimate

    @property
    def scale(self) -> float:
        """Mean modulus of the extrapolated values."""
        return (abs(self.first.limit.value) + abs(self.second.limit.value)) / 2

    @property
    def difference(self) -> float:
        """Second less first, extrapolated."""
        return self.second.limit.value - self.first.limit.value

    @property
    def finest(self) -> float:
        """Second less first, on the finest meshes."""
        return self.second.limit.finest - self.first.limit.finest

    @property
    def allowed(self) -> float:
        """Sum of the errors of both."""
        return self.first.limit.error + self.second.limit.error + _ITERATION * self.scale

    @property
    def verdict(self) -> Verdict:
        """DISAGREE if the difference is more than allowed; UNRESOLVED if so much is allowed that it says little."""
        if abs(self.difference) > self.allowed:
            return Verdict.DISAGREE
        return Verdict.AGREE if self.allowed <= _RESOLVED * self.scale else Verdict.UNRESOLVED


@dataclass(frozen=True, eq=False)
class Verification:
    """title, text: of the case; versions: of the software; refusals: of formulations that do not take it; order: the
    theoretical one; planned: how many runs; runs: those done."""

    title: str
    text: str
    versions: Mapping[str, str]
    refusals: Mapping[str, str]
    order: float = SECOND
    planned: int = 0
    runs: tuple[VerifiedRun, ...] = ()

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Estimates of all quantities that do not cancel, from formulations that converged on all their meshes."""
        return tuple(self._estimates())

    @property
    def agreements(self) -> tuple[Agreement, ...]:
        """Agreement of each two formulations, quantity by quantity."""
        pairs = combinations(self.estimates, 2)
        return tuple(Agreement(a, b) for a, b in pairs if (a.step, a.quantity) == (b.step, b.quantity))

    @property
    def verdict(self) -> Verdict:
        """Of the whole: of its runs, else DISAGREE if any two do, UNRESOLVED if no two are found to agree."""
        verdicts = [agreement.verdict for agreement in self.agreements]
        for verdict, holds in (
            (Verdict.NOT_CONVERGED, any(run.status != Status.CONVERGED for run in self.runs)),
            (Verdict.UNFINISHED, len(self.runs) < self.planned or not verdicts),
            (Verdict.DISAGREE, Verdict.DISAGREE in verdicts),
            (Verdict.UNRESOLVED, Verdict.AGREE not in verdicts),
        ):
            if holds:
                return verdict
        return Verdict.AGREE

    def _estimates(self) -> Iterator[Estimate]:
        done = self._complete()
        steps = next(iter(done.values()))[0].steps if done else {}
        for step, quantities in steps.items():
            for quantity in quantities:
                found = {name: [run.steps[step][quantity] for run in runs] for name, runs in done.items()}
                if _cancelled([values[-1] for values in found.values()]):
                    continue
                for name, values in found.items():
                    sizes = tuple(run.size for run in done[name])
                    numbers = tuple(measured.value for measured in values)
                    limit = richardson(sizes, numbers, self.order, values[-1].noise)
                    yield Estimate(step, quantity, name, sizes, numbers, limit)

    def _complete(self) -> dict[str, list[VerifiedRun]]:
        """Run of the formulations that converged on all meshes."""
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


def _cancelled(values: Sequence[Measured]) -> bool:
    """Return whether hardly anything is left of a quantity, or nothing at all."""
    return max(abs(each.value) for each in values) <= _CANCELLED * max(each.scale for each in values)
