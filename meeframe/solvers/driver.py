"""The one loop around every solver: limits, history, the guard against non-finite numbers, and the status."""

import warnings
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Final, Literal

import numpy as np
from scipy.linalg import LinAlgWarning

from meeframe.common.blas import ONE_BLAS_THREAD
from meeframe.common.errors import CaseError
from meeframe.common.memory import keep_freed_memory
from meeframe.contact.feasibility import beyond_friction, unreachable
from meeframe.contact.problem import ContactProblem, ContactSolution, ContactState, Iterate, Solver, Status, unbalance
from meeframe.contact.residual import evaluate, judged_fields, law_residual
from meeframe.contact.scales import Scales, largest, motion_scales, problem_scales
from meeframe.fields import MECHANICAL, POTENTIALS, Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.system.reduced import Progress, silent

Criterion = Literal["residual", "paper"]

RUNAWAY: Final = 1e8
"""A residual so many times the first one is divergence."""
LEAST_FALL: Final = 0.9
"""Over a stall window, the judged quantity must fall below this fraction of its smallest value before."""
REPEAT: Final = 1e-9
"""Loads that return so closely, as a fraction of how far they went meanwhile, repeat ..."""
RETURNS: Final = 2
"""... if they do so as often: a solver may come back once and, remembering that, go another way."""
ACCEPTABLE: Final = 1e-3
"""A state that hardly changes any more, but violates the laws by more, is no solution: the step was too short."""
HOPELESS: Final = 3
"""Stall window where no state has the prescribed resultants, or none under the pressures found."""
UNTROUBLED: Final = 10
"""Strides between two looks at the iterates of a solver that knows how far it is."""
GIGA: Final = 1e9


@dataclass(frozen=True)
class StoppingCriteria:
    """When to stop.

    criterion: 'residual', the dimensionless violation of the laws (meeframe.contact.residual), or 'paper', the largest
    of the Euclidean norms of the changes of displacement, potentials and tractions over the contact nodes in one step
    (section 6), in the paper's units: m, GV, GA, GPa, which are coherent with its Tables 1 and 3. A short step changes
    little wherever it is: with this criterion the residual must have fallen to ACCEPTABLE besides;
    tolerance: of that quantity; max_iterations: steps of the solver; stall_window: steps within which the quantity must
    fall to nine tenths, None for the solver's own patience. Raises CaseError for a value out of bounds.
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


@dataclass(frozen=True)
class _Trend:
    """How the judged quantity develops: (iteration, value) of the first look, the last, and the last notable fall."""

    first: tuple[int, float]
    last: tuple[int, float]
    best: tuple[int, float]

    @property
    def idle(self) -> int:
        """Iterations since the last notable fall."""
        return self.last[0] - self.best[0]

    def fraction(self, tolerance: float) -> float:
        """How much of the way from the first value to the tolerance is done, in decades."""
        decades = np.log(self.first[1] / tolerance)
        done = np.log(self.first[1] / max(self.best[1], tolerance))  # a residual may be zero
        return float(np.clip(done / decades, 0.0, 1.0)) if decades > 0.0 else 1.0


def _next(trend: _Trend | None, look: tuple[int, float]) -> _Trend:
    """After one more look, or the first."""
    if trend is None:
        return _Trend(look, look, look)
    return _Trend(trend.first, look, look if look[1] < LEAST_FALL * trend.best[1] else trend.best)


@dataclass(frozen=True, eq=False)
class _Orbit:
    """Whether loads come back (Brent's cycle detection): each load is compared with one kept from a power of two.

    kept: (6 n + m,) scaled load, closed fraction and motion, None before the first one; until: iteration at which
    another is kept; farthest: largest distance from it since; returns: how often loads have come back to it.
    """

    kept: Array | None = None
    until: int = 0
    farthest: float = 0.0
    returns: int = 0

    @property
    def repeated(self) -> bool:
        """Whether they do so for ever."""
        return self.returns >= RETURNS

    def next(self, iteration: int, point: Array, tolerance: float) -> "_Orbit":
        """After one more iteration; excursions below the tolerance do not count."""
        if self.kept is None:
            return _Orbit(point, 2 * iteration)
        distance = float(np.abs(point - self.kept).max(initial=0.0))
        if self.farthest > tolerance and distance <= REPEAT * self.farthest:
            return replace(self, returns=self.returns + 1)
        if iteration >= self.until:
            return _Orbit(point, 2 * iteration)
        return replace(self, farthest=max(self.farthest, distance))


def solve(
    problem: ContactProblem,
    solver: Solver,
    limits: StoppingCriteria | None = None,
    start: ContactState | None = None,
    progress: Progress = silent,
) -> ContactSolution:
    """Iterate until the limits are met or something goes wrong; the status says which, the message why.

    start: converged state of the previous load step; progress: called whenever the driver looks at an iterate, every
    `solver.stride` steps and at the last one, with the fraction, in decades, of the way to the tolerance.
    An iteration that goes astray raises nothing.
    """
    keep_freed_memory()
    limits = limits or StoppingCriteria()
    by_residual = limits.criterion == "residual"
    fields = judged_fields(problem) if by_residual else None
    hopeless = cache(lambda: unreachable(problem, scales) if problem.prescribed_resultants else None)
    # one thread: products of contact size are too small to share, and waiting for each other costs far more
    with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore", category=LinAlgWarning), ONE_BLAS_THREAD:
        scales = problem_scales(problem)
        iterate = solver.init(problem, start)
        if by_residual:
            iterate = solver.aimed(iterate, limits.tolerance)
        state: ContactState | None = None
        value = np.inf if iterate.estimate is None else iterate.estimate
        if not by_residual or not limits.tolerance < value < np.inf:  # a start that is far off needs no judge
            state, value = _judged(problem, iterate, scales, fields, limits.tolerance)
        looks = [(0, value)] if by_residual else []
        trend = _next(None, looks[0]) if by_residual else None
        pace = None
        units = motion_scales(problem, scales)
        orbit = _Orbit()
        iteration = 0
        window = limits.stall_window or solver.stall_window
        while (verdict := _verdict(trend, limits, window, orbit.repeated)) is None:
            iteration += 1
            iterate = solver.step(problem, iterate)
            due = not by_residual or iteration >= limits.max_iterations or _due(solver, iterate, iteration, limits)
            if iterate.estimate is None:
                orbit = orbit.next(iteration, _point(iterate, scales, units), limits.tolerance)
            elif problem.prescribed_resultants:
                pace = _next(pace, (iteration, iterate.estimate))
                if pace.idle >= HOPELESS and beyond_friction(problem, evaluate(problem, iterate), scales):
                    window = 0
            if not due and not orbit.repeated and window:
                continue
            previous = state
            state, value = _judged(problem, iterate, scales, fields, limits.tolerance)
            if iterate.estimate is not None and value > limits.tolerance:
                orbit = orbit.next(iteration, _point(iterate, scales, units), limits.tolerance)
            looks.append((iteration, value if by_residual or previous is None else _paper_change(previous, state)))
            trend = _next(trend, looks[-1])
            progress("contact", trend.fraction(limits.tolerance))
            if trend.idle >= HOPELESS and (hopeless() or beyond_friction(problem, state, scales)):
                window = min(window, HOPELESS)
        status, message = verdict
        if state is not None and status is Status.CONVERGED:
            final = value
        else:
            state, final = _judged(problem, iterate, scales)
            if by_residual and trend is not None:
                status, message = _verdict(_next(trend, (iteration, final)), limits, window, orbit.repeated) or verdict
    if status is Status.CONVERGED and not final <= ACCEPTABLE:
        status = Status.STALLED
        message = f"{message}, but the laws are violated by {final:.1e}: a longer step is needed"
    if status is not Status.CONVERGED:
        reason = hopeless() or beyond_friction(problem, state, scales) or _missed(problem, state, scales)
        message = f"{message}: {reason}" if reason else message
    # stored as it is read from a file, so that sums over it are the same to the last digit
    state = replace(state, load=np.ascontiguousarray(state.load), displacement=np.ascontiguousarray(state.displacement))
    return ContactSolution(state, status, iteration, final, np.array(looks), message)


def _judged(
    problem: ContactProblem,
    iterate: Iterate,
    scales: Scales,
    fields: tuple[int, ...] | None = None,
    tolerance: float = 0.0,
) -> tuple[ContactState, float]:
    """State of an iterate and its residual, by the given fields alone while that is above the tolerance.

    By all of them at once if the solver itself thinks that it is not.
    """
    near = iterate.estimate is not None and iterate.estimate <= tolerance
    if fields is not None and len(fields) < problem.fields.size and not near:
        state = evaluate(problem, iterate, fields)
        value = law_residual(problem, state, scales, fields)
        if not value <= tolerance:
            return state, value
    state = evaluate(problem, iterate)
    return state, law_residual(problem, state, scales)


def _missed(problem: ContactProblem, state: ContactState, scales: Scales) -> str | None:
    """That loads are far from the prescribed resultants, in words; None if they are not."""
    missing = largest(unbalance(problem, state.load) / scales.totals)
    if not missing > ACCEPTABLE:
        return None
    return (
        f"the loads found miss the prescribed resultants ({missing:.1e} off), which may be more than the contact bears"
    )


def _due(solver: Solver, iterate: Iterate, iteration: int, limits: StoppingCriteria) -> bool:
    """Whether to look at an iterate: every stride, unless the solver itself says that it is not there yet."""
    if iterate.estimate is None:
        return iteration % solver.check_interval == 0
    return iterate.estimate <= limits.tolerance or iteration % (UNTROUBLED * solver.check_interval) == 0


def _point(iterate: Iterate, scales: Scales, units: Array) -> Array:
    """Load, closed fraction and motion in characteristic units, as one vector."""
    return np.concatenate([(iterate.load / scales.load).ravel(), iterate.contact_fraction, iterate.motion / units])


def _paper_change(previous: ContactState, state: ContactState) -> float:
    """Return the largest Euclidean norm of the changes of u [m], the potentials [GV, GA] and p [GPa] (section 6)."""
    moved = state.displacement - previous.displacement
    tractions = (state.load - previous.load)[:, MECHANICAL]
    changes = (moved[:, MECHANICAL], *moved.T[POTENTIALS] / GIGA, tractions / GIGA)
    return max(float(np.linalg.norm(change)) for change in changes)


def _verdict(trend: _Trend | None, limits: StoppingCriteria, window: int, repeated: bool) -> tuple[Status, str] | None:
    """Status and the reason in words; None to go on."""
    if trend is None:
        return None
    (_, first), (iteration, value), (since, best) = trend.first, trend.last, trend.best
    name = "residual" if limits.criterion == "residual" else "change"
    if value <= limits.tolerance:
        return Status.CONVERGED, f"{name} {value:.2e} is within the tolerance {limits.tolerance:.1e}"
    if not np.isfinite(value):
        return Status.DIVERGED, f"not a finite number at iteration {iteration}"
    if value > RUNAWAY * max(first, limits.tolerance):
        return Status.DIVERGED, f"{name} grew from {first:.2e} to {value:.2e} at iteration {iteration}"
    if repeated:
        return Status.CYCLING, f"the same loads return at iteration {iteration}, with {name} {value:.2e}"
    if iteration >= limits.max_iterations:
        return Status.ITERATION_LIMIT, f"{name} {value:.2e} after {iteration} iterations"
    if iteration - since >= window:
        return Status.STALLED, f"{name} has stayed near {best:.2e} since iteration {since}"
    return None
