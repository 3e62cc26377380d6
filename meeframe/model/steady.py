"""Steady rolling under laws that depend on the path that the material has slipped in the contact."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from meeframe.contact.problem import Status
from meeframe.fields import Array
from meeframe.model.history import ConvergedState
from meeframe.model.kinematics import Solution
from meeframe.results.records import StepResult
from meeframe.system.rolling import CellShift

Solve = Callable[[ConvergedState], Solution]
"""Solves steady rolling from a state with the slip path of the material one cell before."""

_PATH_TOLERANCE: Final = 1e-9
"""Change of slip paths that counts as none, as a fraction of the longest."""
_MAX_STATES: Final = 100
"""Largest number of states in which the slip path becomes steady."""


def solve_steady(solve: Solve, here: ConvergedState, cell_shift: CellShift, has_memory: bool) -> Solution:
    """Return steady rolling, with the slip path that the material collects on its way through the contact.

    The path of a state is that of the slips of the state before, until it stays the same.

    Parameters
    ----------
    solve : callable
        Solves steady rolling for a given slip path.
    here : ConvergedState
        State at the beginning.
    cell_shift : CellShift
        Shift by one cell.
    has_memory : bool
        Whether the contact law depends on the path.

    Returns
    -------
    Solution
        Steady state, with the iterations of all states; the state is `here` if it is not reached.
    """
    path, start, iterations = np.zeros_like(here.slip_path), here, 0
    for count in range(1, _MAX_STATES + 1):
        solution = solve(replace(start, slip_path=path))
        iterations += solution.result.iterations
        solution = solution.with_result(iterations=iterations)
        if not solution.is_converged:
            return solution._replace(end=here)
        if not has_memory:
            return solution
        passed = path_before(solution.result, cell_shift)
        if np.abs(passed - path).max() <= _PATH_TOLERANCE * passed.max():
            return solution.with_sentences(f"{count} states until the slip path was steady")
        path, start = passed, replace(start, state=solution.end.state)
    solution = solution.with_sentences(f"the slip path is not steady after {_MAX_STATES} states")
    return solution.with_result(status=Status.STALLED)._replace(end=here)


def path_before(result: StepResult, cell_shift: CellShift) -> Array:
    """Return the length (n,) [m] that the material at each node had slipped in contact one cell before."""
    slip = np.where(result.touching, np.linalg.norm(result.slip, axis=1), 0.0)
    return np.where(cell_shift.entering, 0.0, cell_shift.values(cell_shift.accumulate(slip)))
