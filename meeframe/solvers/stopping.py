"""Stopping criteria of contact solvers, and the convergence monitor that applies them."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Final, Literal

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import CaseError
from meeframe.contact.conduction import conducting
from meeframe.contact.feasibility import beyond_bound, beyond_conduction, beyond_friction, infeasibility
from meeframe.contact.problem import ContactProblem, ContactSolution, ContactState, Iterate, Solver, Status, unbalance
from meeframe.contact.residual import essential_fields, evaluate, law_residual
from meeframe.contact.scales import largest, motion_scales, problem_scales
from meeframe.fields import MECHANICAL, POTENTIALS, Array
from meeframe.fields.units import Quantity, check_quantities

Criterion = Literal["residual", "paper"]

MAX_GROWTH: Final = 1e8
"""Growth of the monitored quantity over its first value beyond which an iteration has diverged."""
MIN_FALL: Final = 0.9
"""Factor by which the monitored quantity must fall within a stall window."""
GIGA: Final = 1e9


@checked_arguments
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


MAX_RETURN_DISTANCE: Final = 1e-9
"""Distance at which loads count as returned, as a fraction of how far they moved in between."""
MAX_RETURNS: Final = 2
"""Returns to the same loads that make a cycle: a solver may return once and then continue elsewhere."""
MAX_RESIDUAL: Final = 1e-3
"""Residual above which a converged change is no solution: the step was too short."""
INFEASIBLE_WINDOW: Final = 3
"""Stall window where no state has the prescribed resultants, or none under the pressures found."""
MAX_FOLLOWED_NODES: Final = 2**20
"""Largest number of nodes whose loads are compared with earlier ones."""
ESTIMATED_INTERVALS: Final = 10
"""Check intervals between two checks of a solver that estimates its residual itself."""


@dataclass(frozen=True, eq=False)
class LoadCycle:
    """Detection of loads that return (Brent's cycle detection): each is compared with one stored at a power of two.

    Attributes
    ----------
    stored : Array, optional
        Scaled load, contact fraction and motion that were stored last; None before the first.
    next_store : int
        Iteration at which another one is stored.
    max_distance : float
        Largest distance from the stored one since.
    returns : int
        Number of times the loads have returned to it.
    """

    stored: Array | None = None
    next_store: int = 0
    max_distance: float = 0.0
    returns: int = 0

    @property
    def is_closed(self) -> bool:
        """True if the loads keep returning."""
        return self.returns >= MAX_RETURNS

    def add(self, iteration: int, loads: Array, tolerance: float) -> "LoadCycle":
        """Return the detection after one more iteration; excursions below the tolerance do not count."""
        if self.stored is None:
            return LoadCycle(loads, 2 * iteration)
        distance = float(np.abs(loads - self.stored).max(initial=0.0))
        if self.max_distance > tolerance and distance <= MAX_RETURN_DISTANCE * self.max_distance:
            return replace(self, returns=self.returns + 1)
        if iteration >= self.next_store:
            return LoadCycle(loads, 2 * iteration)
        return replace(self, max_distance=max(self.max_distance, distance))


class ConvergenceMonitor:
    """Record of one iteration of a solver, which decides when it ends and with which status.

    Parameters
    ----------
    problem : ContactProblem
        Problem that is being solved.
    solver : Solver
        Solver that iterates.
    criteria : StoppingCriteria
        Criteria in force.
    """

    def __init__(self, problem: ContactProblem, solver: Solver, criteria: StoppingCriteria) -> None:
        self._problem, self._solver, self._criteria = problem, solver, criteria
        self._scales = problem_scales(problem)
        self._motion_scales = motion_scales(problem, self._scales)
        self._fields, self._conducts = essential_fields(problem), conducting(problem)
        self._window = criteria.stall_window or solver.stall_window
        self._progression: Progression | None = None
        self._estimates: Progression | None = None
        self._cycle = LoadCycle()
        self._history: list[tuple[int, float]] = []
        self._state: ContactState | None = None
        self._residual = np.inf
        self.iteration = 0

    @property
    def outcome(self) -> tuple[Status, str] | None:
        """Status and its reason in words; None while the iteration continues."""
        if self._progression is None:
            return None
        return status_of(self._progression, self._criteria, self._window, self._cycle.is_closed)

    @property
    def fraction(self) -> float:
        """Fraction, in decades, of the way to the tolerance."""
        return 0.0 if self._progression is None else self._progression.fraction(self._criteria.tolerance)

    def begin(self, iterate: Iterate) -> None:
        """Record the first iterate. By its solver's estimate one may be too far to be evaluated."""
        if self._problem.prescribed_resultants and beyond_bound(self._problem):
            self._window = 0
        estimate, tolerance = iterate.estimate, self._criteria.tolerance
        if self._criteria.by_residual and estimate is not None and tolerance < estimate < np.inf:
            self._residual = estimate
        else:
            self._evaluate(iterate)
        if self._criteria.by_residual:
            self._history = [(0, self._residual)]
            self._progression = Progression.start(self._history[0])

    def observe(self, iterate: Iterate) -> bool:
        """Record an iterate after one more step; return whether it has been evaluated."""
        problem, criteria = self._problem, self._criteria
        self.iteration += 1
        if iterate.estimate is None:
            self._follow(iterate)
        elif problem.prescribed_resultants:
            entry = (self.iteration, iterate.estimate)
            self._estimates = Progression.start(entry) if self._estimates is None else self._estimates.add(entry)
            if self._estimates.stalled_for >= INFEASIBLE_WINDOW and self._insufficiency(evaluate(problem, iterate)):
                self._window = 0
        if not (self._is_due(iterate) or self._cycle.is_closed or not self._window):
            return False
        previous, self._state = None if criteria.by_residual else self._state, None
        state = self._evaluate(iterate)
        self._state = None if criteria.by_residual and self._residual > criteria.tolerance else state
        if iterate.estimate is not None and self._residual > criteria.tolerance:
            self._follow(iterate)
        value = self._residual if criteria.by_residual or previous is None else paper_change(previous, state)
        entry = (self.iteration, value)
        self._history.append(entry)
        self._progression = Progression.start(entry) if self._progression is None else self._progression.add(entry)
        if self._progression.stalled_for >= INFEASIBLE_WINDOW and self._infeasibility(state):
            self._window = min(self._window, INFEASIBLE_WINDOW)
        return True

    def conclude(self, iterate: Iterate) -> ContactSolution:
        """Return the solution at the last iterate, once there is an outcome."""
        outcome = self.outcome
        assert outcome is not None, "the iteration has not ended"
        status, message = outcome
        if self._state is None or status is not Status.CONVERGED:
            self._state = evaluate(self._problem, iterate)
            self._residual = law_residual(self._problem, self._state, self._scales)
            if self._criteria.by_residual and self._progression is not None:
                final = self._progression.add((self.iteration, self._residual))
                outcome = status_of(final, self._criteria, self._window, self._cycle.is_closed)
                status, message = outcome or (status, message)
        state = self._state
        if status is Status.CONVERGED and not self._residual <= MAX_RESIDUAL:
            status = Status.STALLED
            message = f"{message}, but the laws are violated by {self._residual:.1e}: a longer step is needed"
        if status is not Status.CONVERGED:
            reason = self._infeasibility(state) or self._missed_resultants(state)
            message = f"{message}: {reason}" if reason else message
        return ContactSolution(state, status, self.iteration, self._residual, np.array(self._history), message)

    def _evaluate(self, iterate: Iterate) -> ContactState:
        """Evaluate state and residual of an iterate, with the essential fields alone while these violate the laws."""
        problem, fields, tolerance = self._problem, self._fields, self._criteria.tolerance
        nearly_solved = iterate.estimate is not None and iterate.estimate <= tolerance
        if self._criteria.by_residual and len(fields) < problem.fields.size and not nearly_solved:
            self._state = evaluate(problem, iterate, fields)
            self._residual = law_residual(problem, self._state, self._scales, fields)
            if not self._residual <= tolerance:
                return self._state
            self._state = None
        self._state = evaluate(problem, iterate)
        self._residual = law_residual(problem, self._state, self._scales)
        return self._state

    def _follow(self, iterate: Iterate) -> None:
        """Compare load, contact fraction and motion, in characteristic units, with earlier ones."""
        nodes = slice(None, None, -(-len(iterate.load) // MAX_FOLLOWED_NODES))
        entries = [iterate.load[nodes, field] / self._scales.load[field] for field in self._fields]
        entries += [iterate.contact_fraction[nodes]] if self._conducts else []
        entry = np.concatenate([*entries, iterate.motion / self._motion_scales])
        self._cycle = self._cycle.add(self.iteration, entry, self._criteria.tolerance)

    def _is_due(self, iterate: Iterate) -> bool:
        """Return whether to evaluate an iterate: at every check interval, unless its solver estimates it to be far."""
        criteria, interval = self._criteria, self._solver.check_interval
        if not criteria.by_residual or self.iteration >= criteria.max_iterations:
            return True
        if iterate.estimate is None:
            return self.iteration % interval == 0
        return iterate.estimate <= criteria.tolerance or self.iteration % (ESTIMATED_INTERVALS * interval) == 0

    @cached_property
    def _infeasible_resultants(self) -> str | None:
        """Reason, in words, why no state has the prescribed resultants; None if there is none."""
        return infeasibility(self._problem, self._scales) if self._problem.prescribed_resultants else None

    def _infeasibility(self, state: ContactState) -> str | None:
        """Return why no state, or none under these pressures, has the prescribed resultants; None if one may."""
        return self._infeasible_resultants or self._insufficiency(state)

    def _insufficiency(self, state: ContactState) -> str | None:
        """Return why friction or conduction under the pressures of a state does not suffice; None if it may."""
        problem, scales = self._problem, self._scales
        return beyond_friction(problem, state, scales) or beyond_conduction(problem, state, scales)

    def _missed_resultants(self, state: ContactState) -> str | None:
        """Return words that say that loads are far from the prescribed resultants; None if they are not."""
        missing = largest(unbalance(self._problem, state.load) / self._scales.totals)
        if not missing > MAX_RESIDUAL:
            return None
        return (
            f"the loads found miss the prescribed resultants ({missing:.1e} off), which may be more than the contact "
            "bears"
        )
