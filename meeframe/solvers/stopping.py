"""Stopping criteria of contact solvers, and the status that follows from them."""

from dataclasses import dataclass
from typing import Annotated, Final, Literal

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.contact.problem import ContactState, Status
from meeframe.fields import MECHANICAL, POTENTIALS
from meeframe.fields.units import Quantity, check_quantities

Criterion = Literal["residual", "paper"]

MAX_GROWTH: Final = 1e8
"""Growth of the monitored quantity over its first value beyond which an iteration has diverged."""
MIN_FALL: Final = 0.9
"""Factor by which the monitored quantity must fall within a stall window."""
GIGA: Final = 1e9


@dataclass(frozen=True)
class StoppingCriteria:
    """Criteria that end an iteration.

    Attributes
    ----------
    tolerance : float
        Value of the monitored quantity at which the iteration has converged.
    max_iterations : int
        Largest number of solver steps.
    criterion : {'residual', 'paper'}
        Monitored quantity. 'residual' is the dimensionless violation of the laws (meeframe.contact.residual). 'paper'
        is the largest of the Euclidean norms of the changes of displacement, potentials and tractions over the contact
        nodes in one step (section 6), in the paper's units: m, GV, GA, GPa, which are coherent with its Tables 1
        and 3. A short step changes little wherever it is made: with this criterion the residual must be small as well.
    stall_window : int, optional
        Steps within which the monitored quantity must fall to nine tenths; None for that of the solver.

    Raises
    ------
    CaseError
        If a value is out of bounds.
    """

    tolerance: Annotated[float, Quantity("", gt=0, lt=1)] = 1e-10
    max_iterations: int = 50_000
    criterion: Criterion = "residual"
    stall_window: int | None = None

    def __post_init__(self) -> None:
        check_quantities(self)
        for name in ("max_iterations", "stall_window"):
            value = getattr(self, name)
            unset = name == "stall_window" and value is None
            if not unset and (not isinstance(value, int) or value < 1):
                raise CaseError(f"StoppingCriteria: {name} = {value!r}: allowed: whole numbers from 1")

    @property
    def by_residual(self) -> bool:
        """True if the residual is monitored."""
        return self.criterion == "residual"


@dataclass(frozen=True)
class Progression:
    """Development of a monitored quantity.

    Attributes
    ----------
    first, last, best : (int, float)
        Iteration and value of the first and the last entry, and of the last notable fall.
    """

    first: tuple[int, float]
    last: tuple[int, float]
    best: tuple[int, float]

    @classmethod
    def start(cls, entry: tuple[int, float]) -> "Progression":
        """Return the development after its first entry."""
        return cls(entry, entry, entry)

    def add(self, entry: tuple[int, float]) -> "Progression":
        """Return the development after one more entry."""
        return Progression(self.first, entry, entry if entry[1] < MIN_FALL * self.best[1] else self.best)

    @property
    def stalled_for(self) -> int:
        """Iterations since the last notable fall."""
        return self.last[0] - self.best[0]

    def fraction(self, tolerance: float) -> float:
        """Return how much of the way from the first value to the tolerance is done, in decades."""
        decades = np.log(self.first[1] / tolerance)
        done = np.log(self.first[1] / max(self.best[1], tolerance))  # a residual may be zero
        return float(np.clip(done / decades, 0.0, 1.0)) if decades > 0.0 else 1.0


def status_of(
    progression: Progression, criteria: StoppingCriteria, window: int, cycles: bool
) -> tuple[Status, str] | None:
    """Return the status of an iteration and its reason in words; None to continue.

    Parameters
    ----------
    progression : Progression
        Development of the monitored quantity.
    criteria : StoppingCriteria
        Criteria in force.
    window : int
        Steps without a notable fall after which the iteration has stalled.
    cycles : bool
        True if the same loads return again and again.
    """
    (_, first), (iteration, value), (since, best) = progression.first, progression.last, progression.best
    name = "residual" if criteria.by_residual else "change"
    if value <= criteria.tolerance:
        return Status.CONVERGED, f"{name} {value:.2e} is within the tolerance {criteria.tolerance:.1e}"
    if not np.isfinite(value):
        return Status.DIVERGED, f"not a finite number at iteration {iteration}"
    if value > MAX_GROWTH * max(first, criteria.tolerance):
        return Status.DIVERGED, f"{name} grew from {first:.2e} to {value:.2e} at iteration {iteration}"
    if cycles:
        return Status.CYCLING, f"the same loads return at iteration {iteration}, with {name} {value:.2e}"
    if iteration >= criteria.max_iterations:
        return Status.ITERATION_LIMIT, f"{name} {value:.2e} after {iteration} iterations"
    if iteration - since >= window:
        return Status.STALLED, f"{name} has stayed near {best:.2e} since iteration {since}"
    return None


def paper_change(previous: ContactState, state: ContactState) -> float:
    """Return the largest Euclidean norm of the changes of u [m], the potentials [GV, GA] and p [GPa] (section 6)."""
    change = state.displacement - previous.displacement
    tractions = (state.load - previous.load)[:, MECHANICAL]
    changes = (change[:, MECHANICAL], *change.T[POTENTIALS] / GIGA, tractions / GIGA)
    return max(float(np.linalg.norm(each)) for each in changes)
