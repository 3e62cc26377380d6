"""Continuation of an increment that does not converge, through states under parts of its load."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from meeframe.contact.problem import ContactState, Status
from meeframe.model.history import ConvergedState
from meeframe.model.kinematics import Increment
from meeframe.results.records import StepResult

Solution = tuple[Increment, ConvergedState, StepResult]
SolveFrom = Callable[[float, ContactState | None], Solution]
"""Solves an increment under a fraction of the change of its load, from an initial guess or, with None, the usual one.

Slip counts from the beginning of the increment, whatever the fraction.
"""

_MIN_FRACTION: Final = 1.0 / 16.0
"""Least part of the change of the load by which it is raised from one state to the next."""


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
            size /= 2.0
            continue
        done += size
        if done == 1.0:
            note = f"{result.message}; from a state under a part of the load of the increment"
            return planned, end, replace(result, iterations=iterations, message=note)
        start, size = end.state, min(2.0 * size, 1.0 - done)
    return failed
