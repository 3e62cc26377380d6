"""Continuation of an increment that does not converge, through states of problems that are easier to solve."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from meeframe.contact.conduction import conducting
from meeframe.contact.problem import ContactProblem, ContactState, Status, indenter_position
from meeframe.contact.residual import law_residual
from meeframe.contact.scales import problem_scales
from meeframe.fields import Array
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.model.history import ConvergedState
from meeframe.model.kinematics import Increment
from meeframe.model.lifted_nodes import lifted_node, violations
from meeframe.results.records import StepResult

Solution = tuple[Increment, ConvergedState, StepResult]
SolveFrom = Callable[[float, ContactState | None], Solution]
"""Solves an increment under a fraction of the change of its load, from an initial guess or, with None, the usual one.

Slip counts from the beginning of the increment, whatever the fraction.
"""

_MIN_FRACTION: Final = 1.0 / 16.0
"""Least part of the change of the load by which it is raised from one state to the next."""
FINAL: Final = (Status.CONVERGED, Status.ITERATION_LIMIT)
"""Status of an increment for which no other way is sought."""
_RATIOS: Final = (10.0, 1000.0, np.inf)
"""Ratios of friction to pressure by which a limit that jumps is replaced: the first, the last, and the limit itself."""
_CONDUCTION_FACTORS: Final = (1e-6, 1.0, 1.0)
"""Factors of conductivities that are too large to begin with, likewise."""
_FACTORS: Final = (10.0, 1.7)
"""First and least factor by which these values are raised."""
_MIN_RATIO: Final = 100.0
"""Least ratio with which nodes that bear as much friction lie between open and closed."""
_NOTABLE: Final = 1e-3
"""Part of the largest violation of a law from which nodes are counted that violate it."""


@dataclass(frozen=True)
class CappedLaw(ContactLaw):
    """A contact law with friction of at most a multiple of the pressure, so that its limit does not jump.

    Attributes
    ----------
    law : ContactLaw
        The law.
    ratio : float
        Largest friction over the pressure.
    """

    law: ContactLaw
    ratio: float

    def project(self, trial: Array) -> Array:
        """Return the projection of the law, shortened along its friction to the largest one, (n, 3) [Pa]."""
        return self._shorten(self.law.project(trial))

    def tangential_scaling(self) -> Array:
        """Return that of the law."""
        return self.law.tangential_scaling()

    def __getattr__(self, name: str) -> Any:
        """Return an optional method of the law."""
        method = getattr(self.law, name)
        return method if name != "resolve" else lambda *arguments: self._shorten(method(*arguments))

    def _shorten(self, traction: Array) -> Array:
        size, limit = np.linalg.norm(traction[:, :2], axis=1), -self.ratio * traction[:, 2]
        factor = np.divide(limit, size, out=np.ones_like(size), where=size > limit)
        return np.column_stack([factor[:, None] * traction[:, :2], traction[:, 2]])


@dataclass(frozen=True)
class ScaledLaw(ConductivityLaw):
    """A multiple of a law of conductivity.

    Attributes
    ----------
    law : ConductivityLaw
        The law.
    factor : float
        Factor > 0 of the conductivity.
    """

    law: ConductivityLaw
    factor: float

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return the multiple of the conductivity, (n,)."""
        return self.factor * self.law.conductivity(normal_traction, gap, drop)


class ScaledLawAcrossGap(ScaledLaw):
    """A multiple of a law of conductivity that depends on the gap or the drop."""

    across_gap = True


@dataclass(frozen=True)
class Easing:
    """Change of the laws that makes an increment easier to solve.

    Attributes
    ----------
    ratio : float, optional
        Largest friction over the pressure.
    factor : float, optional
        Factor of all conductivities.
    """

    ratio: float = np.inf
    factor: float = 1.0

    def apply(self, problem: ContactProblem) -> ContactProblem:
        """Return a problem under the changed laws."""
        law = problem.contact_law if self.ratio == np.inf else CappedLaw(problem.contact_law, self.ratio)
        if self.factor == 1.0:
            return replace(problem, contact_law=law)
        kinds = (ScaledLawAcrossGap if channel.law.across_gap else ScaledLaw for channel in problem.channels)
        channels = (
            replace(channel, law=kind(channel.law, self.factor)) if channel.is_conducting else channel
            for channel, kind in zip(problem.channels, kinds, strict=True)
        )
        return replace(problem, contact_law=law, channels=tuple(channels))


EXACT: Final = Easing()
"""No change of the laws."""
SolveEased = Callable[[ContactState | None, Easing], Solution]
"""Solves an increment under easier laws, from an initial guess or, with None, the usual one."""


def solve_by_capped_friction(solve: SolveEased, failed: Solution) -> Solution | None:
    """Return the solution of an increment whose friction limit jumps where contact begins.

    It is sought from states under friction of at most a multiple of the pressure. If there is none, the result is the
    increment with such a state, if that has nodes that lie in the jump, or one that has no state; otherwise None.

    Parameters
    ----------
    solve : callable
        Solves the increment under easier laws.
    failed : tuple
        Increment that did not converge from the usual initial guess.
    """
    by_ratio = lambda start, ratio: solve(start, Easing(ratio=ratio))  # noqa: E731
    solution, nearest, ratio = _raise(by_ratio, failed, _RATIOS)
    if nearest is None and conducting(failed[0].problem):
        by_factor = lambda start, factor: solve(start, Easing(_RATIOS[0], factor))  # noqa: E731
        eased, *_ = _raise(by_factor, failed, _CONDUCTION_FACTORS)
        if eased is not None:
            solution, nearest, ratio = _raise(by_ratio, eased, _RATIOS, eased[1].state)
    if solution is not None:
        return _noted(solution, f"friction of at most {_RATIOS[1]:g} times the pressure")
    if nearest is None:
        return None
    planned, end, result = nearest
    start, problem = end.state, replace(planned.problem, contact_law=failed[0].problem.contact_law)
    assert start is not None
    planned, note = replace(planned, problem=problem), f"this state is one with friction of at most {ratio:.0f} times"
    if ratio >= _MIN_RATIO:
        violation = violations(problem, start.load, indenter_position(problem, start.motion) - start.displacement)
        in_jump = np.flatnonzero(violation > _NOTABLE * violation.max())
        position = ", ".join(f"{value:.4g}" for value in problem.system.points[in_jump].mean(axis=0))
        nodes = f"{in_jump.size} node{'s' * (in_jump.size > 1)} around ({position}) m"
        note = f"{note} the pressure, with {nodes} between open and closed"
    elif lifted_node(planned, result) is None:
        return None
    else:
        note = f"{note} the pressure"
    residual = law_residual(problem, start, problem_scales(problem))
    message = f"{failed[2].message}; {note}"
    return planned, failed[1], replace(result, status=Status.STALLED, residual=residual, message=message)


def solve_by_scaled_conduction(solve: SolveEased, failed: Solution) -> Solution | None:
    """Return the solution of an increment from states under a part of its conductivities; None if it is not found.

    Parameters
    ----------
    solve, failed
        As for `solve_by_capped_friction`.
    """
    solution, *_ = _raise(lambda start, factor: solve(start, Easing(factor=factor)), failed, _CONDUCTION_FACTORS)
    return None if solution is None else _noted(solution, "smaller conductivities")


def _raise(
    solve: Callable[[ContactState | None, float], Solution],
    before: Solution,
    values: tuple[float, float, float],
    start: ContactState | None = None,
) -> tuple[Solution | None, Solution | None, float]:
    """Return the solutions at the last value of a parameter and the one before, and that value; None if not found.

    before: solution whose iterations count, too; values: first one, last but one, and last; start: initial guess at the
    first one.
    """
    first, most, last = values
    iterations, nearest, reached, value, factor = before[2].iterations, None, first, first, _FACTORS[0]
    while factor >= _FACTORS[1]:
        planned, end, result = solve(start if nearest is None else nearest[1].state, value)
        iterations += result.iterations
        if result.status is Status.CONVERGED:
            solution = planned, end, replace(result, iterations=iterations)
            if value == last:
                return solution, nearest, reached
            nearest, reached = solution, value
        elif nearest is None or reached >= most:
            break
        else:
            factor = np.sqrt(factor)
        value = last if reached >= most else min(factor * reached, most)
    return None, nearest, reached


def _noted(solution: Solution, origin: str) -> Solution:
    planned, end, result = solution
    return planned, end, replace(result, message=f"{result.message}; from a state with {origin}")


def solve_by_continuation(solve: SolveFrom, failed: Solution) -> Solution:
    """Return the solution of an increment from states under parts of its load; the failed one if there is none.

    The states are initial guesses alone: the result solves the same problem.

    Parameters
    ----------
    solve : callable
        Solves a part of the increment.
    failed : tuple
        Whole increment that did not converge.
    """
    done, size, iterations = 0.0, 0.5, failed[2].iterations
    start: ContactState | None = None
    while size >= _MIN_FRACTION:
        planned, end, result = solve(done + size, start)
        iterations += result.iterations
        if result.status is not Status.CONVERGED:
            size /= 2.0  # for good: parts that fail cost the most
            continue
        done += size
        if done == 1.0:
            solution = planned, end, replace(result, iterations=iterations)
            return _noted(solution, "a part of the load of the increment")
        start, size = end.state, min(size, 1.0 - done)
    return failed
