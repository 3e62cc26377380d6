"""Continuation of an increment that does not converge, through states of problems that are easier to solve."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from meeframe.contact.conduction import conducting
from meeframe.contact.generated_heat import heat_moves_surface
from meeframe.contact.problem import ContactProblem, ContactState, Status
from meeframe.contact.residual import limit_jumps
from meeframe.contact.scales import problem_scales
from meeframe.indenters.base import N_RIGID, RIGID_MOTIONS
from meeframe.laws.base import is_adhesive
from meeframe.model.biactive_friction import (
    SolveEased,
    solve_from_biactive_friction,
    solve_with_biactive_friction,
    with_biactive_nodes,
)
from meeframe.model.easier_laws import EXACT, Easing, resolves_edge
from meeframe.model.kinematics import Solution
from meeframe.model.polyhedral_friction import solve_from_polyhedral_friction

SolveFrom = Callable[[float, ContactState | None], Solution | None]
"""Solves an increment under a fraction of the change of its load, from an initial guess or, with None, the usual one.

Slip counts from the beginning of the increment, whatever the fraction. The result may be None if there is no solution.
"""

SolveApproached = Callable[[ContactState | None, Easing, float | None], Solution]
"""Solves an increment as SolveEased does, with an approach in place of the force, or with None under the force."""

_Outcome = tuple[Solution | None, str]
"""Solution that a strategy found or, if it is None, words on how far it came."""

_STATE: Final = "there is a state, with more none was found"
_MIN_FRACTION: Final = 1.0 / 16.0
_MIN_BIACTIVE_FRACTION: Final = 1.0 / 64.0
"""Least fraction of the change of the load from one state to the next, and with biactive friction."""
_FINAL: Final = (Status.CONVERGED, Status.ITERATION_LIMIT)
"""Status of an increment for which no other way is sought."""
LARGE_RATIO: Final = 10.0
"""Ratio of friction to pressure from which friction counts as large."""
_RATIOS: Final = (LARGE_RATIO, 1.0, 1e6, np.inf)
"""Ratios of friction to pressure by which large friction is replaced: first, least, largest, and that of the law."""
_RISES: Final = (0.1, 1e-6, 1e10, np.inf)
"""Rises of conductivities that are too large, or begin too suddenly, likewise."""
_FACTORS: Final = (10.0, 1.05)
"""First and least factor by which these values are raised."""
_MIN_EXTRAPOLATED: Final = 1.0
"""Least value at which states are extrapolated."""
_MAX_VALUES: Final = 60
_MAX_APPROACHES: Final = 40
"""Number of values, and of approaches, that are tried."""
_APPROACH_STEPS: Final = 1.0 / 16.0, 1.0 / 4096.0
"""First and least step of the approach, in displacements that the load causes."""
_STEP_GROWTH: Final = 1.5
"""Factor of the next step of the approach."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """Attempt to solve an increment; slip counts from its beginning, whatever the fraction of its load.

    Attributes
    ----------
    fraction : float, optional
        Fraction of the change of the load.
    start : ContactState, optional
        Initial guess; by default the usual one.
    easing : Easing, optional
        Change that makes it easier.
    stall_window : int, optional
        That of the solver; by default that of the case.
    stores : bool, optional
        Whether the compliance is stored as a matrix.
    approach : float, optional
        Approach [m] that is prescribed in place of the normal force; by default the force is.
    """

    fraction: float = 1.0
    start: ContactState | None = None
    easing: Easing = EXACT
    stall_window: int | None = None
    stores: bool = False
    approach: float | None = None


def solve_persistently(
    solve: Callable[[Attempt], Solution],
    window: int,
    has_large_friction: bool,
    stores: bool,
    tolerance: float,
    before: ContactState | None = None,
) -> Solution:
    """Return the solution of an increment, sought in other ways where the usual one does not lead to it.

    Parameters
    ----------
    solve : callable
        Makes an attempt.
    window : int
        Stall window of attempts that converge soon or lead nowhere.
    has_large_friction : bool
        Whether friction may be many times the pressure, as where its limit jumps.
    stores : bool
        Whether attempts after the first one may store the compliance as a matrix.
    tolerance : float
        Residual of a solution.
    before : ContactState, optional
        Converged state before the increment, in which nodes may be biactive.

    Returns
    -------
    Solution
        Solution, or the increment as it ended last.
    """
    is_brief = stores or has_large_friction
    brief = Attempt(stall_window=window, stores=stores)

    def solve_eased(start: ContactState | None, easing: Easing, approach: float | None = None) -> Solution:
        return solve(replace(brief, start=start, easing=easing, approach=approach))

    def by_polyhedral_friction(failed: Solution) -> _Outcome:
        return solve_from_polyhedral_friction(solve_eased, failed, tolerance), ""

    def by_capped_friction(failed: Solution) -> _Outcome:
        solution, ratio = solve_by_capped_friction(solve_eased, failed, tolerance)
        return solution, f"with friction of at most {ratio:.3g} times the pressure {_STATE}" if ratio > 0.0 else ""

    def by_longer_attempt(failed: Solution) -> _Outcome:
        return solve(Attempt(stores=stores)), ""

    def by_gradual_conduction(failed: Solution) -> _Outcome:
        solution, pressure = solve_by_gradual_conduction(solve_eased, failed)
        words = f"with conductivities that rise over {pressure:.3g} Pa there is a state, over less none was found"
        return solution, words if pressure < np.inf else ""

    def by_approach(failed: Solution) -> _Outcome:
        return solve_by_approach(solve_eased, failed)

    def by_fractions(failed: Solution) -> _Outcome:
        if failed.result.area_fraction is not None:  # it began at a solution, the one with the contact edge at nodes
            return None, ""
        problem = failed.increment.problem
        jumps = has_large_friction and limit_jumps(problem.contact_law, len(problem.gap))

        def solve_fraction(fraction: float, start: ContactState | None) -> Solution | None:
            if not jumps:
                return solve(replace(brief, fraction=fraction, start=start))
            return solve_from_biactive_friction(
                lambda guess, easing: solve(replace(brief, fraction=fraction, start=guess, easing=easing)),
                start,
                start or before,
                problem,
                tolerance,
            )

        return solve_by_continuation(solve_fraction, failed, _MIN_BIACTIVE_FRACTION if jumps else _MIN_FRACTION)

    last = solve(Attempt(stall_window=window if is_brief else None))
    if last.result.status in _FINAL:
        return last
    increment, sentences = last.increment, list[str]()
    has_matrix = stores or increment.problem.system.dense() is not None
    for strategy, applies in (
        (by_polyhedral_friction, has_large_friction and has_matrix),
        (by_capped_friction, has_large_friction),
        (by_longer_attempt, is_brief),
        (by_gradual_conduction, conducting(increment.problem)),
        (by_approach, "normal_force" in increment.prescribed and _may_attract(increment.problem)),
        (by_fractions, True),
    ):
        solution, sentence = strategy(last) if applies else (None, "")
        last = last if solution is None else solution
        if last.result.status in _FINAL:
            return last
        sentences += [sentence] * bool(sentence)
    return last.with_sentences(*sentences)


def solve_by_capped_friction(solve: SolveEased, failed: Solution, tolerance: float) -> tuple[Solution | None, float]:
    """Return the solution of an increment with large friction; None if it is not found.

    It is sought from states under friction of at most a multiple of the pressure, under larger and larger ones. The
    pressure of nodes with the largest friction is inverse to the multiple: extrapolated to an infinite one, they touch
    without pressure. Where the states end before and the limit jumps, an attraction of these nodes takes their
    pressure.

    Parameters
    ----------
    solve : callable
        Solves the increment under easier laws.
    failed : Solution
        Increment that did not converge from the usual initial guess.
    tolerance : float
        Residual of a solution.

    Returns
    -------
    Solution or None
        The solution.
    float
        Largest multiple under which a state was found; 0 if there is none.
    """

    def by_ratio(start: ContactState | None, ratio: float) -> Solution:
        return solve(start, Easing(ratio=ratio))

    solution, path = _raise_value(by_ratio, failed, _RATIOS)
    if not path and conducting(failed.increment.problem):
        eased, _ = _raise_value(lambda start, rise: solve(start, Easing(_RATIOS[0], rise)), failed, _RISES)
        if eased is not None:
            solution, path = _raise_value(by_ratio, eased, _RATIOS, eased.end.state)
    if solution is not None:
        return with_biactive_nodes(solution, _RATIOS[2]), np.inf
    highest, problem = path[-1][0] if path else 0.0, failed.increment.problem
    while path and limit_jumps(problem.contact_law, len(problem.gap)):
        ratio, capped = path[-1]
        solution = solve_with_biactive_friction(solve, capped, ratio, problem, tolerance)
        if solution is not None:
            return solution, highest
        # smaller multiples are further, but vary less; under the last one, pressures are nearly too small to be found
        path = path[:-1] if ratio >= _RATIOS[2] else path[: len(path) // 2]
    return None, highest


def solve_by_gradual_conduction(solve: SolveEased, failed: Solution) -> tuple[Solution | None, float]:
    """Return the solution of an increment from states with gradual conductivities; None if it is not found.

    They rise with the pressure over a smaller and smaller one. With contact edges between nodes, this is done at nodes
    first, and then, if need be, once more with the edge of the solution at nodes: an edge that moved with the
    conductivities would move in jumps.

    Parameters
    ----------
    solve, failed
        As for `solve_by_capped_friction`.

    Returns
    -------
    Solution or None
        The solution.
    float
        Smallest pressure [Pa] over which conductivities rise in a state that was found; inf if there is none, and 0 for
        the solution.
    """

    def raised(easing: Easing, before: Solution) -> tuple[Solution | None, list[tuple[float, Solution]]]:
        return _raise_value(lambda start, rise: solve(start, replace(easing, rise=rise)), before, _RISES)

    problem = failed.increment.problem
    solution, path = raised(Easing(at_nodes=True), failed)
    if solution is not None and resolves_edge(problem):
        at_nodes = solution.end.state
        before, solution = solution, solve(at_nodes, EXACT)
        solution = solution.with_result(iterations=before.result.iterations + solution.result.iterations)
        if not solution.is_converged:
            # heat that moves the surface moves the edge once more
            solution, path = (None, path) if heat_moves_surface(problem) else raised(Easing(edge_of=at_nodes), solution)
    if solution is None:
        return None, problem_scales(problem).pressure / path[-1][0] if path else np.inf
    return solution.with_sentences("from a state with gradual conductivities"), 0.0


def solve_by_approach(solve: SolveApproached, failed: Solution) -> tuple[Solution | None, str]:
    """Return the solution of an increment under a normal force from states with prescribed approaches, if it is found.

    Where surfaces attract each other, states under a force end where the surfaces snap together; those with an approach
    mostly do not. From the approach before the increment, it changes until the force is passed.

    Parameters
    ----------
    solve : callable
        Solves the increment under easier laws, with an approach in place of the force, or with None under the force.
    failed : Solution
        Increment that did not converge.

    Returns
    -------
    Solution or None
        The solution; None if it is not found.
    str
        Words on the forces that were found with approaches; empty if there are none.
    """
    planned, iterations = failed.increment, failed.result.iterations
    (column,) = range(N_RIGID)[RIGID_MOTIONS["approach"]]
    approach, force = float(planned.base[column]), float(planned.prescribed["normal_force"].item())

    def at_nodes(approach: float, start: ContactState | None, rise: float = np.inf) -> Solution:
        return solve(start, Easing(rise=rise, at_nodes=True), approach)

    def force_of(solution: Solution) -> float:
        return float(solution.end.resultants[column])

    first = at_nodes(approach, None)
    solution: Solution | None = first
    if not first.is_converged:
        solution, _ = _raise_value(lambda start, rise: at_nodes(approach, start, rise), first, _RISES)
    if solution is None:
        return None, ""
    iterations += solution.result.iterations
    sign, passed, untried = np.sign(force - force_of(solution)), "", [solution]
    step, least = (depth * problem_scales(planned.problem).displacement[2] for depth in _APPROACH_STEPS)
    for _ in range(_MAX_APPROACHES):
        if step < least:
            break
        further = at_nodes(approach + sign * step, solution.end.state)
        iterations += further.result.iterations
        if not further.is_converged:
            step /= 2.0
        elif sign * (force - force_of(further)) > 0.0:
            approach, solution, step = approach + sign * step, further, _STEP_GROWTH * step
            untried = [solution]
        else:
            for end in (each.end for each in (further, *untried)):
                motion = end.motion[planned.free] - planned.base[planned.free]
                exact = solve(end.state and replace(end.state, motion=motion), EXACT, None)
                iterations += exact.result.iterations
                if exact.is_converged:
                    exact = exact.with_result(iterations=iterations)
                    return exact.with_sentences("from a state with a prescribed approach"), ""
            passed = f", with {approach + sign * step:.6g} m under {force_of(further):.4g} N, none between"
            step, untried = step / 2.0, []
    else:  # there may be states that were not sought
        return None, ""
    sentence = (
        f"with an approach of {approach:.6g} m there is a state under a normal force of {force_of(solution):.4g} N"
    )
    return None, sentence + (passed or ", none beyond")


def _raise_value(
    solve: Callable[[ContactState | None, float], Solution],
    before: Solution,
    values: tuple[float, float, float, float],
    start: ContactState | None = None,
) -> tuple[Solution | None, list[tuple[float, Solution]]]:
    """Return the solution at the last value of a parameter, None if it is not found, and those at values before.

    before: solution whose iterations count, too; values: first one, least and largest one, and that of the laws; start:
    initial guess at the first one.
    """
    value, least, most, last = values
    path: list[tuple[float, Solution]] = []
    iterations, factor = before.result.iterations, _FACTORS[0]
    for _ in range(_MAX_VALUES):
        solution = solve(_extrapolated(path, value) if path else start, value)
        iterations += solution.result.iterations
        if solution.is_converged:
            solution = solution.with_result(iterations=iterations)
            if value == last:
                return solution, path
            path.append((value, solution))
            factor = min(factor**1.5, _FACTORS[0])
        elif not path and value > least and start is None:
            value /= _FACTORS[0]
            continue
        elif not path or path[-1][0] >= most or factor < _FACTORS[1]:
            break
        else:
            factor = np.cbrt(factor)
        highest = path[-1][0]
        value = last if highest >= most else min(factor * highest, most)
    return None, path


def _extrapolated(path: list[tuple[float, Solution]], value: float) -> ContactState | None:
    """Return a guess of the state at a value, extrapolated from the last two linearly in the reciprocal of values."""
    (highest, latest), state = path[-1], path[-1][1].end.state
    if len(path) == 1 or state is None or value < _MIN_EXTRAPOLATED:
        return state
    before, earlier = path[-2][0], path[-2][1].end.state
    if earlier is None or latest is None:
        return state
    share = (1.0 / value - 1.0 / highest) / (1.0 / highest - 1.0 / before)
    load, motion = (
        new + share * (new - old) for new, old in ((state.load, earlier.load), (state.motion, earlier.motion))
    )
    return replace(state, load=np.where(state.load == 0.0, 0.0, load), motion=motion)


def _may_attract(problem: ContactProblem) -> bool:
    """Return whether an adhesive law or potentials may attract the surfaces."""
    return is_adhesive(problem.contact_law) or conducting(problem)


def solve_by_continuation(
    solve: SolveFrom, failed: Solution, least: float = _MIN_FRACTION
) -> tuple[Solution | None, str]:
    """Return the solution of an increment from states under fractions of its load, if it is found.

    The states are initial guesses alone: the result solves the same problem.

    Parameters
    ----------
    solve : callable
        Solves the increment under a fraction of its load.
    failed : Solution
        Whole increment that did not converge.
    least : float, optional
        Least fraction of the change of the load by which it is raised from one state to the next.

    Returns
    -------
    Solution or None
        The solution; None if it is not found.
    str
        Words on the largest fraction under which there is a state; empty if there is none.
    """
    done, size, iterations = 0.0, 0.5, failed.result.iterations
    start: ContactState | None = None
    while size >= least:
        solution = solve(done + size, start)
        iterations += 0 if solution is None else solution.result.iterations
        if solution is None or not solution.is_converged:
            size /= 2.0  # for good: fractions that fail cost the most
            continue
        done += size
        if done == 1.0:
            solution = solution.with_result(iterations=iterations)
            return solution.with_sentences("from a state with a part of the load of the increment"), ""
        start, size = solution.end.state, min(size, 1.0 - done)
    return None, f"with {done:.3g} of the change of the load {_STATE}" if done > 0.0 else ""
