"""Friction of biactive nodes, which touch without pressure, under laws whose limit jumps where contact begins."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask
from meeframe.contact.problem import ContactProblem, ContactState, contact_gap
from meeframe.contact.residual import MIN_JUMP, law_residual
from meeframe.contact.scales import problem_scales
from meeframe.fields import MECHANICAL, Array
from meeframe.laws.base import ContactLaw, augmented_traction, contact_traction, resolve
from meeframe.model.easier_laws import Easing
from meeframe.model.kinematics import Solution

SolveEased = Callable[[ContactState | None, Easing], Solution]
"""Solves an increment under easier laws, from an initial guess or, with None, the usual one."""

_BIACTIVE_RATIO: Final = 1e6
"""Ratio of friction to pressure from which nodes of a solution count as biactive."""
_RATIOS: Final = (1e3, 1e2, 1e4)
"""Largest ratios of friction to pressure with which it is sought from a state nearby."""
_MAX_PULLS: Final = 20
"""Number of attractions that are tried with one ratio."""
_MAX_ROUND_OFF: Final = 1e-6
"""Residual below which round-off may be what prevents its fall."""
_LOWER: Final = 10.0
"""Factor by which the ratio is then lowered."""
_MIN_SHARE: Final = 1.0 / 8.0
"""Least fraction of the change of an attraction by which it is changed."""
_MEMORY: Final = 4
"""Number of attractions from which the next one follows."""
_MIN_EXCESS: Final = 1e-6
"""Fraction of the capped friction by which the law must exceed it for the cap to count."""
_MIN_SINGULAR_VALUE: Final = 1e-8
"""Relative singular value from which changes of pressures count."""


def solve_from_biactive_friction(
    solve: SolveEased,
    start: ContactState | None,
    similar: ContactState | None,
    exact: ContactProblem,
    tolerance: float,
) -> Solution | None:
    """Return the solution of an increment in which nodes may be biactive from one under a similar load, or None.

    Parameters
    ----------
    solve, exact, tolerance
        As for `solve_with_biactive_friction`.
    start : ContactState, optional
        Initial guess; by default the usual one.
    similar : ContactState, optional
        The other solution, in which nodes may be biactive.
    """
    frictions = [np.zeros(len(exact.gap))]
    if similar is not None:
        size, is_biactive = _biactive(exact, similar, np.zeros(len(exact.gap)), _BIACTIVE_RATIO)
        if is_biactive.any():
            frictions = [np.where(is_biactive, size, 0.0), *frictions]
    for ratio in _RATIOS:
        for friction in frictions:
            pull = friction / ratio
            capped = solve(start, Easing(ratio, pull=pull if pull.any() else None))
            if capped.is_converged:
                solution = solve_with_biactive_friction(solve, capped, ratio, exact, tolerance, pull)
                if solution is not None:
                    return solution
    return None


def solve_with_biactive_friction(
    solve: SolveEased,
    capped: Solution,
    ratio: float,
    exact: ContactProblem,
    tolerance: float,
    pull: Array | None = None,
) -> Solution | None:
    """Return the solution of an increment in which biactive nodes bear a fraction of the largest friction, or None.

    Under friction of at most a multiple of the pressure, such nodes bear a small pressure. An attraction of the same
    size, found by Anderson's method, leaves them without pressure, and the friction as it is.

    Parameters
    ----------
    solve : callable
        Solves the increment under easier laws.
    capped : Solution
        Increment under friction of at most a multiple of the pressure.
    ratio : float
        The multiple.
    exact : ContactProblem
        Problem with the laws of the increment.
    tolerance : float
        Residual of a solution.
    pull : Array, optional
        (n,), attraction [Pa] in that increment; zero by default.
    """
    pull = np.zeros(len(exact.gap)) if pull is None else pull
    while True:
        solution, pull, residual = _cancel_pressure(solve, capped, ratio, exact, tolerance, pull)
        if residual <= tolerance:
            problem = _under_laws(solution, exact)
            solution = solution._replace(increment=replace(solution.increment, problem=problem))
            return with_biactive_nodes(solution.with_result(residual=residual), ratio)
        if residual > _MAX_ROUND_OFF or not _may_lower(solution, exact.contact_law, ratio / _LOWER, pull):
            return None
        ratio, pull = ratio / _LOWER, _LOWER * pull
        capped = solve(solution.end.state, Easing(ratio, pull=pull))
        if not capped.is_converged:
            return None
        capped = capped.with_result(iterations=solution.result.iterations + capped.result.iterations)


def _cancel_pressure(
    solve: SolveEased, capped: Solution, ratio: float, exact: ContactProblem, tolerance: float, pull: Array
) -> tuple[Solution, Array, float]:
    """Return a solution whose attraction (n,) [Pa] nearly leaves biactive nodes without pressure, and its residual.

    The other arguments are those of `solve_with_biactive_friction`. The attraction changes until the residual under the
    laws of the increment is within the tolerance, or falls no longer.
    """
    solution, share, iterations, last = capped, 1.0, capped.result.iterations, np.inf
    pulls: list[Array] = []
    pressures: list[Array] = []
    while True:
        state, problem = solution.end.state, _under_laws(solution, exact)
        assert state is not None
        residual = law_residual(problem, state, problem_scales(problem))
        is_idle = last < 2.0 * residual < 2.0 * _MAX_ROUND_OFF
        if residual <= tolerance or is_idle or len(pulls) == _MAX_PULLS:
            return solution.with_result(iterations=iterations), pull, residual
        last = residual
        pulls, pressures = [*pulls, pull], [*pressures, _capped_pressure(solution, exact.contact_law, ratio, pull)]
        change = _next_value(pulls[-_MEMORY:], pressures[-_MEMORY:]) - pull
        while True:
            following = solve(_relieved(state, share * change), Easing(ratio, pull=pull + share * change))
            iterations += following.result.iterations
            if following.is_converged:
                break
            if share <= _MIN_SHARE:
                return solution.with_result(iterations=iterations), pull, residual
            share /= 2.0
        solution, pull, share = following, pull + share * change, min(2.0 * share, 1.0)


def _under_laws(solution: Solution, exact: ContactProblem) -> ContactProblem:
    """Return the problem of a solution under easier laws with those of the increment."""
    return replace(solution.increment.problem, contact_law=exact.contact_law, channels=exact.channels)


def _may_lower(solution: Solution, law: ContactLaw, ratio: float, pull: Array) -> bool:
    """Return whether friction of at most a lower multiple of the pressure would still be that of the other nodes.

    Round-off of the pressures is the smaller in the friction of biactive nodes, the lower the multiple is.
    """
    state = solution.end.state
    assert state is not None
    gap = contact_gap(solution.increment.problem, state.displacement, state.motion)[:, 2]
    pressure = -contact_traction(law, state.load[:, 2], gap)
    size, others = np.linalg.norm(state.load[:, :2], axis=1), pull == 0.0
    return ratio >= 1.0 and bool((size[others] <= ratio * np.maximum(pressure[others], 0.0)).all())


def _relieved(state: ContactState, pull: Array) -> ContactState:
    """Return a guess of a state under a further attraction (n,) [Pa], with the pressure of the contact as it is."""
    load = state.load.copy()
    load[:, 2] += pull
    return replace(state, load=load)


def _capped_pressure(solution: Solution, law: ContactLaw, ratio: float, pull: Array) -> Array:
    """Return the pressure (n,) [Pa] of the nodes whose friction a law would increase, zero elsewhere.

    Nodes that stick under a larger attraction count with the pressure that their friction needs.

    solution: under friction of at most a multiple of the pressure; ratio: the multiple; pull: (n,), attraction [Pa].
    """
    problem, state = solution.increment.problem, solution.end.state
    assert state is not None
    r = (1.0 / problem_scales(problem).normal_compliance,) * 2
    gap = contact_gap(problem, state.displacement, state.motion)
    trial = augmented_traction(problem.contact_law, state.load[:, MECHANICAL], gap, r)
    capped = resolve(problem.contact_law, trial, gap, r)
    size, largest = (np.linalg.norm(each[:, :2], axis=1) for each in (capped, resolve(law, trial, gap, r)))
    pressure = -capped[:, 2]
    is_capped = largest > (1.0 + _MIN_EXCESS) * size
    return np.where(is_capped, pressure, np.where(pressure < pull, size / ratio, 0.0))


def _next_value(values: list[Array], images: list[Array]) -> Array:
    """Return the next value, positive where the last image is, towards a fixed point of a map.

    It is that of Anderson's method (Walker and Ni, SIAM J. Numer. Anal. 49 (2011) 1715). values, images: the last ones.
    """
    residuals = np.column_stack(images) - np.column_stack(values)
    if len(values) == 1:
        return images[-1]
    changes, moves = np.diff(residuals, axis=1), np.diff(np.column_stack(images), axis=1)
    extrapolated = images[-1] - moves @ np.linalg.lstsq(changes, residuals[:, -1], rcond=_MIN_SINGULAR_VALUE)[0]
    return np.where((images[-1] > 0.0) & (extrapolated > 0.0), extrapolated, images[-1])


def with_biactive_nodes(solution: Solution, ratio: float) -> Solution:
    """Return a solution with words in its message about the nodes whose friction exceeds a multiple of their pressure.

    ratio: the multiple, of the friction in the state from which the solution was found.
    """
    problem, state = solution.increment.problem, solution.end.state
    assert state is not None
    gap = contact_gap(problem, state.displacement, state.motion)[:, 2]
    is_biactive = _biactive(problem, state, gap, ratio)[1]
    if is_biactive.any():
        position = ", ".join(f"{value:.4g}" for value in problem.system.points[is_biactive].mean(axis=0))
        number = int(is_biactive.sum())
        nodes = f"{number} nodes touch" if number > 1 else "1 node touches"
        words = (
            f"{nodes} without pressure around ({position}) m, where the friction limit jumps, with friction below it"
        )
    else:
        words = f"from a state with friction of at most {ratio:.4g} times the pressure"
    return solution.with_sentences(words)


def _biactive(problem: ContactProblem, state: ContactState, gap: Array, ratio: float) -> tuple[Array, Mask]:
    """Return the friction (n,) [Pa], and where it exceeds a multiple of the pressure at gaps (n,)."""
    pressure = np.maximum(-contact_traction(problem.contact_law, state.load[:, 2], gap), 0.0)
    size = np.linalg.norm(state.load[:, :2], axis=1)
    return size, (size > ratio * pressure) & (size > MIN_JUMP * problem_scales(problem).pressure)
