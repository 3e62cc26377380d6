"""Wear of surfaces that roll through the contact again and again, extrapolated over many cycles."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from meeframe.contact.problem import Status
from meeframe.fields import Array
from meeframe.laws.wear import WearLaw
from meeframe.model.history import ConvergedState
from meeframe.model.kinematics import Increment
from meeframe.results.records import StepResult
from meeframe.system.rolling import CellShift

Solution = tuple[Increment, ConvergedState, StepResult]
Solve = Callable[[ConvergedState], Solution]
"""Solves steady rolling from a state, whose worn depth is that of the surfaces."""

_NODES: Final = (0.5, 0.75)
"""Fractions of a step at which the wear of a cycle is evaluated, besides its ends."""
_WEIGHTS: Final = np.array([2.0, 3.0, 4.0, 0.0]) / 9.0
"""Weights of the wear of a cycle at the beginning, at _NODES and at the end of a step, of third order."""
_ERROR_WEIGHTS: Final = _WEIGHTS - np.array([7.0, 6.0, 8.0, 3.0]) / 24.0
"""Weights of its difference from the method of second order."""
_SAFETY: Final = 0.8
_FACTORS: Final = (0.1, 4.0)
"""Smallest and largest ratio of the sizes of successive steps."""
_MIN_STEP: Final = 2.0**-20
"""Smallest step, as a fraction of all cycles, at which any error is accepted."""


@dataclass(frozen=True, eq=False)
class WearOfCycles:
    """Depth that one cycle wears off: the passage of every particle of the surfaces through the steady contact.

    Attributes
    ----------
    law
        Wear law.
    cell_shift
        Shift by one cell of the grid.
    """

    law: WearLaw
    cell_shift: CellShift

    def depth(self, result: StepResult, worn: Array) -> Array:
        """Return the depth (n,) [m] of one cycle in a steady state, the same along the rolling direction.

        A particle wears in each cell on its way through the contact. worn: (n,), depth before the cycle [m].
        """
        slip, duration = np.linalg.norm(result.slip, axis=1), result.loading.duration
        speed = np.zeros_like(slip) if duration is None else slip / duration
        in_cell = slip * self.law.rate(np.maximum(-result.traction[:, 2], 0.0), speed, worn)
        depth, grid = np.empty_like(in_cell), self.cell_shift.grid
        depth[grid] = in_cell[grid].sum(axis=0)
        return depth


def solve_cycles(
    solve: Solve, here: ConvergedState, wear: WearOfCycles, cycles: float, tolerance: float
) -> tuple[Increment, ConvergedState, StepResult]:
    """Wear surfaces in a number of cycles of steady rolling, and return the steady state after them.

    The worn depth w after N cycles follows dw/dN = depth of one cycle, by the Runge-Kutta method of orders 3 and 2 of
    Bogacki and Shampine. Its steps, of many cycles each, are as large as the estimated error permits.

    Parameters
    ----------
    solve : callable
        Solves steady rolling.
    here : ConvergedState
        State at the beginning.
    wear : WearOfCycles
        Wear of one cycle.
    cycles : float
        Number of cycles > 0.
    tolerance : float
        Largest estimated error of the depth that wears off in a step, integrated over the zone, as a fraction of that
        depth.

    Returns
    -------
    Increment, ConvergedState, StepResult
        Of the steady state after the cycles, with the iterations of all states; the state is `here` if one of them
        does not converge.

    References
    ----------
    P. Bogacki and L. F. Shampine, Appl. Math. Lett. 2 (1989) 321.
    """
    start, states, iterations = here, 0, 0

    def steady(worn: Array) -> Solution:
        nonlocal start, states, iterations
        solution = solve(replace(here, wear=worn, state=start.state))
        states, iterations = states + 1, iterations + solution[2].iterations
        if solution[2].status is Status.CONVERGED:
            start = solution[1]
        return solution

    def finished(solution: Solution, sentence: str) -> Solution:
        increment, end, result = solution
        message = f"{result.message}; {sentence}, with {states} steady states"
        end = replace(end, cycles=here.cycles + done)
        loading = result.loading
        if loading.rolling is not None:
            loading = replace(loading, rolling=replace(loading.rolling, cycles=end.cycles))
        result = replace(result, loading=loading, iterations=iterations, message=message)
        return increment, end if result.status is Status.CONVERGED else here, result

    done, size, error, steps = 0.0, cycles, 0.0, 0
    worn = here.wear
    solution = steady(worn)
    if solution[2].status is not Status.CONVERGED:
        return finished(solution, "before the first cycle")
    depth = wear.depth(solution[2], worn)
    while done < cycles:
        size = min(size, cycles - done)
        depths, failed = [depth], None
        for fraction in (*_NODES, None):
            after = worn + size * (fraction * depths[-1] if fraction else np.tensordot(_WEIGHTS[:3], depths, 1))
            stage = steady(after)
            if stage[2].status is not Status.CONVERGED:
                failed = stage
                break
            depths.append(wear.depth(stage[2], after))
        divisible = size > _MIN_STEP * cycles
        if failed is not None:
            if not divisible:
                return finished(failed, f"after {done:g} of {cycles:g} cycles")
            size *= _FACTORS[0]
            continue
        deviation = size * float(np.abs(np.tensordot(_ERROR_WEIGHTS, depths, 1)).sum())
        relative = deviation / max(float((after - worn).sum()), 1e-300)
        factor = float(np.clip(_SAFETY * np.sqrt(tolerance / max(relative, 1e-300)), *_FACTORS))
        if relative > tolerance and divisible:
            size *= factor
            continue
        done = cycles if size == cycles - done else done + size
        worn, depth, solution = after, depths[-1], stage
        size, error, steps = size * factor, error + deviation, steps + 1
    share = error / max(float((worn - here.wear).sum()), 1e-300)
    return finished(solution, f"worn in {cycles:g} cycles by {steps} steps, estimated error {share:.2%} of the depth")
