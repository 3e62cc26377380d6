"""Continuation of an increment that does not converge, through states of problems that are easier to solve."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from meeframe.contact.conduction import conducting
from meeframe.contact.problem import ContactState, Status, indenter_position
from meeframe.contact.residual import law_residual
from meeframe.contact.scales import problem_scales
from meeframe.model.easier_laws import EXACT, Easing
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
_FINAL: Final = (Status.CONVERGED, Status.ITERATION_LIMIT)
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

SolveEased = Callable[[ContactState | None, Easing], Solution]
"""Solves an increment under easier laws, from an initial guess or, with None, the usual one."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """Attempt to solve an increment; slip counts from its beginning, whatever the part of the load.

    Attributes
    ----------
    part : float, optional
        Fraction of the change of the load.
    start : ContactState, optional
        Initial guess; by default the usual one.
    easing : Easing, optional
        Change of the laws.
    stall_window : int, optional
        That of the solver; by default that of the case.
    stores : bool, optional
        Whether the compliance is stored as a matrix.
    """

    part: float = 1.0
    start: ContactState | None = None
    easing: Easing = EXACT
    stall_window: int | None = None
    stores: bool = False


def solve_persistently(solve: Callable[[Attempt], Solution], window: int, limit_jumps: bool, stores: bool) -> Solution:
    """Return the solution of an increment, sought in other ways where the usual one does not lead to it.

    Parameters
    ----------
    solve : callable
        Makes an attempt.
    window : int
        Stall window of attempts that converge soon or lead nowhere.
    limit_jumps : bool
        Whether the friction limit jumps where contact begins.
    stores : bool
        Whether attempts after the first one may store the compliance as a matrix.

    Returns
    -------
    tuple
        Solution, or the best reason why there may be none.
    """
    is_brief, capped = stores or limit_jumps, None
    solution = solve(Attempt(stall_window=window if is_brief else None))
    if solution[2].status in _FINAL:
        return solution
    brief = Attempt(stall_window=window, stores=stores)

    def solve_eased(start: ContactState | None, easing: Easing) -> Solution:
        return solve(replace(brief, start=start, easing=easing))

    if limit_jumps:
        capped = solve_by_capped_friction(solve_eased, solution)
        if capped is not None and (capped[2].status in _FINAL or lifted_node(capped[0], capped[2]) is not None):
            return capped
    if is_brief:
        solution = solve(Attempt(stores=stores))
        if solution[2].status in _FINAL:
            return solution
    if conducting(solution[0].problem):
        conducted = solve_by_scaled_conduction(solve_eased, solution)
        if conducted is not None:
            return conducted
    if capped is not None:
        return capped
    # with the contact edge between nodes it began at a solution, the one with the contact edge at nodes
    has_start = solution[2].area_fraction is not None
    if has_start:
        return solution
    return solve_by_continuation(lambda part, start: solve(replace(brief, part=part, start=start)), solution)


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

    def by_ratio(start: ContactState | None, ratio: float) -> Solution:
        return solve(start, Easing(ratio=ratio))

    solution, nearest, ratio = _raise_value(by_ratio, failed, _RATIOS)
    if nearest is None and conducting(failed[0].problem):
        eased, *_ = _raise_value(
            lambda start, factor: solve(start, Easing(_RATIOS[0], factor)), failed, _CONDUCTION_FACTORS
        )
        if eased is not None:
            solution, nearest, ratio = _raise_value(by_ratio, eased, _RATIOS, eased[1].state)
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
    solution, *_ = _raise_value(lambda start, factor: solve(start, Easing(factor=factor)), failed, _CONDUCTION_FACTORS)
    return None if solution is None else _noted(solution, "smaller conductivities")


def _raise_value(
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
