"""Division of an increment in which surfaces wear, so that the pressure changes little in each subincrement."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from meeframe.contact.problem import Status
from meeframe.fields import Array
from meeframe.model.history import ConvergedState
from meeframe.model.kinematics import Solution
from meeframe.results.records import StepResult, join_sentences

Solve = Callable[[float, float, ConvergedState, int | None], Solution]
"""Solves a subincrement between two fractions of an increment, from a converged state, with a window of stagnation."""

_MIN_FRACTION: Final = 2.0**-8
"""Smallest fraction of an increment, where any change is accepted: the pressure may jump as a node begins to slip."""
_SAFETY: Final = 0.8
"""Change of the pressure at which a subincrement aims, in units of the largest one allowed."""
_FACTORS: Final = (0.1, 2.0)
"""Smallest and largest ratio of the sizes of successive subincrements."""


def solve_subdivided(
    solve: Solve, here: ConvergedState, weights: Array, max_change: float, stall_window: int
) -> Solution:
    """Solve an increment in subincrements, in each of which the pressure changes by a fraction at most.

    Subincrements that do not converge are divided, too.

    Parameters
    ----------
    solve : callable
        Solves a subincrement.
    here : ConvergedState
        State at the beginning of the increment.
    weights : Array
        (n,), integration weights of the nodes.
    max_change : float
        Largest integral of the change of the pressure over that of the pressure, > 0.
    stall_window : int
        That of the solver. Subincrements that can be divided end after a quarter of it.

    Returns
    -------
    Solution
        Last subincrement; its result has the slip, the work of friction and the iterations of all of them. The state
        is `here` if a subincrement did not converge.
    """
    done, size, begin, results = 0.0, 1.0, here, list[StepResult]()
    while True:
        last = 1.0 if done + size > 1.0 - _MIN_FRACTION else done + size
        divisible = last - done > _MIN_FRACTION
        planned, end, result = solve(done, last, begin, max(1, stall_window // 4) if divisible else None)
        converged = result.status is Status.CONVERGED
        change = _change(weights, begin, result) if converged else np.inf
        factor = float(np.clip(_SAFETY * max_change / max(change, 1e-300), *_FACTORS))
        if change > max_change and divisible:
            size = max(factor * (last - done), _MIN_FRACTION)
            continue
        results.append(result)
        if not converged or last == 1.0:
            return Solution(planned, end if converged else here, _combined(results))
        done, begin, size = last, end, max(factor * (last - done), _MIN_FRACTION)


def _change(weights: Array, begin: ConvergedState, result: StepResult) -> float:
    """Return the integral of the modulus of the change of the pressure, over the larger integral of the pressure."""
    if begin.state is None:
        return 0.0
    before, after = begin.state.load[:, 2], result.traction[:, 2]
    change, *forces = (float(np.abs(weights) @ np.abs(values)) for values in (after - before, before, after))
    return change / max(*forces, 1e-300)


def _combined(results: Sequence[StepResult]) -> StepResult:
    """Return the result of an increment from those of its subincrements."""
    last = results[-1]
    if len(results) == 1:
        return last
    durations = [result.loading.duration for result in results]
    loading = last.loading if None in durations else replace(last.loading, duration=sum(filter(None, durations)))
    return replace(
        last,
        loading=loading,
        slip=np.sum([result.slip for result in results], axis=0),
        dissipation=np.sum([result.dissipation for result in results], axis=0),
        iterations=sum(result.iterations for result in results),
        message=join_sentences(
            last.message, f"in {len(results)} subincrements, for the pressure to change little in each"
        ),
    )
