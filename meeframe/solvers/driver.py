"""The one loop around every solver: limits, history, the guard against non-finite numbers, and the status."""

from dataclasses import dataclass, replace
from typing import Annotated, Final, Literal

import numpy as np
from threadpoolctl import threadpool_limits

from meeframe.core.contact import ContactProblem, ContactSolution, ContactState, Iterate, Solver, Status
from meeframe.core.fields import MECHANICAL, Array
from meeframe.core.formulation import Progress, silent
from meeframe.core.quantities import Quantity, check_quantities
from meeframe.solvers.residual import evaluate, law_residual
from meeframe.solvers.scales import Scales, problem_scales

Criterion = Literal["residual", "paper"]

RUNAWAY: Final = 1e8
"""A residual so many times the first one is divergence."""
LEAST_FALL: Final = 0.9
"""Over a stall window, the judged quantity must fall below this fraction of its smallest value before."""
REPEAT: Final = 1e-9
"""Loads that return so closely, as a fraction of how far they went meanwhile, repeat."""
GIGA: Final = 1e9


@dataclass(frozen=True)
class Limits:
    """When to stop.

    criterion: 'residual', the dimensionless violation of the laws (meeframe.solvers.residual), or 'paper', the largest
    of the Euclidean norms of the changes of displacement, potentials and tractions over the contact nodes in one step
    (section 6), in the paper's units: m, GV, GA, GPa, which are coherent with its Tables 1 and 3;
    tolerance: of that quantity; max_iterations: steps of the solver; stall_window: steps within which the quantity must
    fall to nine tenths. Raises CaseError for a value out of bounds.
    """

    tolerance: Annotated[float, Quantity("", gt=0, lt=1)] = 1e-10
    max_iterations: int = 50_000
    criterion: Criterion = "residual"
    stall_window: int = 2_000

    def __post_init__(self) -> None:
        check_quantities(self)


@dataclass(frozen=True, eq=False)
class _Orbit:
    """Whether loads come back (Brent's cycle detection): each load is compared with one kept from a power of two.

    kept: (n, 6) scaled load and closed fraction; until: iteration at which another is kept; farthest: largest distance
    from it since; repeated: whether the last one came back to it.
    """

    kept: Array
    until: int
    farthest: float = 0.0
    repeated: bool = False

    def next(self, iteration: int, point: Array, tolerance: float) -> "_Orbit":
        """After one more iteration; excursions below the tolerance do not count."""
        distance = float(np.abs(point - self.kept).max(initial=0.0))
        if self.farthest > tolerance and distance <= REPEAT * self.farthest:
            return replace(self, repeated=True)
        if iteration >= self.until:
            return _Orbit(point, 2 * iteration)
        return replace(self, farthest=max(self.farthest, distance))


def solve(
    problem: ContactProblem,
    solver: Solver,
    limits: Limits | None = None,
    start: ContactState | None = None,
    progress: Progress = silent,
) -> ContactSolution:
    """Iterate until the limits are met or something goes wrong; the status says which, the message why.

    start: converged state of the previous load step; progress: called whenever the driver looks at an iterate, every
    `solver.stride` steps and at the last one, with the fraction, in decades, of the way to the tolerance. Never raises for an iteration that goes astray.
    """
    limits = limits or Limits()
    scales = problem_scales(problem)
    # one thread: products of contact size are too small to share, and waiting for each other costs far more
    with np.errstate(all="ignore"), threadpool_limits(1, user_api="blas"):
        iterate = solver.init(problem, start)
        state = evaluate(problem, iterate)
        history = [(0, law_residual(problem, state, scales))] if limits.criterion == "residual" else []
        best = history[0] if history else (0, np.inf)
        status, message = _verdict(history, limits, best, False)
        stride = solver.stride if limits.criterion == "residual" else 1
        orbit = _Orbit(_point(iterate, scales), 1)
        iteration = 0
        while status is None:
            iteration += 1
            iterate = solver.step(problem, iterate)
            orbit = orbit.next(iteration, _point(iterate, scales), limits.tolerance)
            if iteration % stride and iteration < limits.max_iterations and not orbit.repeated:
                continue
            previous, state = state, evaluate(problem, iterate)
            if limits.criterion == "residual":
                history.append((iteration, law_residual(problem, state, scales)))
            else:
                history.append((iteration, _paper_change(previous, state)))
            progress("contact", _fraction(history, limits, best[1]))
            if history[-1][1] < LEAST_FALL * best[1]:
                best = history[-1]
            status, message = _verdict(history, limits, best, orbit.repeated)
        return ContactSolution(
            state, status, iteration, law_residual(problem, state, scales), np.array(history).reshape(-1, 2), message
        )


def _fraction(history: list[tuple[int, float]], limits: Limits, best: float) -> float:
    decades = np.log(history[0][1] / limits.tolerance)
    return float(np.clip(np.log(history[0][1] / best) / decades, 0.0, 1.0)) if decades > 0.0 else 0.0


def _point(iterate: Iterate, scales: Scales) -> Array:
    return np.column_stack([iterate.load / scales.load, iterate.closed])


def _paper_change(previous: ContactState, state: ContactState) -> float:
    """Largest Euclidean norm of the changes of u [m], phi [GV], psi [GA] and p [GPa] (section 6)."""
    moved = state.displacement - previous.displacement
    tractions = (state.load - previous.load)[:, MECHANICAL]
    changes = (moved[:, MECHANICAL], moved[:, 3] / GIGA, moved[:, 4] / GIGA, tractions / GIGA)
    return max(float(np.linalg.norm(change)) for change in changes)


def _verdict(
    history: list[tuple[int, float]], limits: Limits, best: tuple[int, float], repeated: bool
) -> tuple[Status | None, str]:
    """Status, None to go on, and the reason in words. best: iteration and value of the last notable fall."""
    if not history:
        return None, ""
    iteration, value = history[-1]
    name = "residual" if limits.criterion == "residual" else "change"
    if value <= limits.tolerance:
        return Status.CONVERGED, f"{name} {value:.2e} is within the tolerance {limits.tolerance:.1e}"
    if not np.isfinite(value):
        return Status.DIVERGED, f"not a finite number at iteration {iteration}"
    if value > RUNAWAY * max(history[0][1], limits.tolerance):
        return Status.DIVERGED, f"{name} grew from {history[0][1]:.2e} to {value:.2e} at iteration {iteration}"
    if repeated:
        return Status.CYCLING, f"the same loads return at iteration {iteration}, with {name} {value:.2e}"
    if iteration >= limits.max_iterations:
        return Status.ITERATION_LIMIT, f"{name} {value:.2e} after {iteration} iterations"
    if iteration - best[0] >= limits.stall_window:
        return Status.STALLED, f"{name} has stayed near {best[1]:.2e} since iteration {best[0]}"
    return None, ""
