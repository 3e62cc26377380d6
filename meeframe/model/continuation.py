"""Continuation of an increment that does not converge, through states of problems that are easier to solve."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from meeframe.contact.problem import ContactState, Status, indenter_position
from meeframe.contact.residual import law_residual
from meeframe.contact.scales import problem_scales
from meeframe.fields import Array
from meeframe.laws.base import ContactLaw
from meeframe.model.history import ConvergedState
from meeframe.model.kinematics import Increment
from meeframe.model.lifted_nodes import violations
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
_RATIOS: Final = (10.0, 1000.0)
"""First and last ratio of friction to pressure by which a limit that jumps is replaced."""
_FACTORS: Final = (10.0, 1.7)
"""First and least factor by which this ratio is raised."""
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


def solve_by_capped_friction(
    solve: Callable[[ContactState | None, float], Solution], failed: Solution
) -> Solution | None:
    """Return the solution of an increment whose friction limit jumps where contact begins.

    It is sought from states under friction of at most a multiple of the pressure. If there is none, the result is the
    increment with such a state, which has nodes that lie in the jump; or None, if there is no such state either.

    Parameters
    ----------
    solve : callable
        Solves the increment from an initial guess, with friction of at most a ratio times the pressure.
    failed : tuple
        Increment that did not converge from the usual initial guess.
    """
    _, end, result = failed
    iterations, start, nearest = result.iterations, None, None
    ratio, factor = _RATIOS[0], _FACTORS[0]
    while factor >= _FACTORS[1]:
        planned, capped_end, capped = solve(start, ratio)
        iterations += capped.iterations
        if capped.status is Status.CONVERGED:
            if ratio == np.inf:
                note = f"{capped.message}; from a state with friction of at most {_RATIOS[1]:g} times the pressure"
                return planned, capped_end, replace(capped, iterations=iterations, message=note)
            start, nearest, reached = capped_end.state, (planned, capped), ratio
        elif start is None or ratio == np.inf:
            break
        else:
            factor = np.sqrt(factor)
        ratio = np.inf if reached >= _RATIOS[1] else min(factor * reached, _RATIOS[1])
    if nearest is None or start is None or reached < _MIN_RATIO:
        return None
    planned, capped = nearest
    law = planned.problem.contact_law
    assert isinstance(law, CappedLaw)
    problem = replace(planned.problem, contact_law=law.law)
    violation = violations(problem, start.load, indenter_position(problem, start.motion) - start.displacement)
    in_jump = np.flatnonzero(violation > _NOTABLE * violation.max())
    position = ", ".join(f"{value:.4g}" for value in problem.system.points[in_jump].mean(axis=0))
    note = (
        f"{result.message}; this state is one with friction of at most {law.ratio:.0f} times the pressure, with "
        f"{in_jump.size} node{'s' * (in_jump.size > 1)} around ({position}) m between open and closed"
    )
    residual = law_residual(problem, start, problem_scales(problem))
    result = replace(capped, status=Status.STALLED, residual=residual, iterations=iterations, message=note)
    return replace(planned, problem=problem), end, result


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
            note = f"{result.message}; from a state under a part of the load of the increment"
            return planned, end, replace(result, iterations=iterations, message=note)
        start, size = end.state, min(size, 1.0 - done)
    return failed
