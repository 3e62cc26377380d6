"""Wear of surfaces that roll through the contact again and again, extrapolated over many cycles."""

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from meeframe.fields import Array
from meeframe.laws.wear import WearLaw
from meeframe.model.history import ConvergedState
from meeframe.model.kinematics import Solution
from meeframe.model.steady import Solve
from meeframe.results.records import StepResult
from meeframe.system.rolling import CellShift

_STAGES: Final = 6
"""Number of stages of a step. Stable steps grow with its square: neighbouring lines of a grid equalize fast."""
_DAMPING: Final = 2.0 / 13.0
_SAFETY: Final = 0.8
_FACTORS: Final = (0.1, 4.0)
"""Smallest and largest ratio of the sizes of successive steps."""
_MIN_STEP: Final = 2.0**-20
"""Smallest step, as a fraction of all cycles, at which any error is accepted."""


class _Coefficients(NamedTuple):
    """Coefficients of a stage from the second on; names as in the reference of `solve_cycles`."""

    mu: float
    nu: float
    mu_tilde: float
    gamma_tilde: float


def _coefficients(stages: int) -> tuple[float, list[_Coefficients]]:
    """Return the share of a step in the first stage, and the coefficients of the others."""
    w0 = 1.0 + _DAMPING / stages**2
    series = [np.polynomial.Chebyshev.basis(degree) for degree in range(stages + 1)]
    value, slope, curvature = (np.array([each.deriv(m)(w0) if m else each(w0) for each in series]) for m in range(3))
    w1 = slope[-1] / curvature[-1]
    b = np.divide(curvature, slope**2, out=np.zeros_like(slope), where=slope > 0.0)
    b[:2] = b[2]
    a = 1.0 - b * value
    others = []
    for j in range(2, stages + 1):
        mu_tilde = 2.0 * b[j] * w1 / b[j - 1]
        others.append(_Coefficients(2.0 * b[j] * w0 / b[j - 1], -b[j] / b[j - 2], mu_tilde, -a[j - 1] * mu_tilde))
    return float(b[1] * w1), others


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

        A particle wears in each cell on its way through the contact, under the mean of the pressures at both ends of
        the cell: of second order, as is the work of friction. worn: (n,), depth before the cycle [m].
        """
        slip, duration = np.linalg.norm(result.slip, axis=1), result.loading.duration
        speed = np.zeros_like(slip) if duration is None else slip / duration
        pressure = np.maximum(-result.traction[:, 2], 0.0)
        mean = 0.5 * (pressure + self.cell_shift.values(pressure))
        in_cell: Array = slip * self.law.rate(mean, speed, worn)
        depth, grid = np.empty_like(in_cell), self.cell_shift.grid
        depth[grid] = in_cell[grid].sum(axis=0)
        return depth


def solve_cycles(solve: Solve, here: ConvergedState, wear: WearOfCycles, cycles: float, tolerance: float) -> Solution:
    """Wear surfaces in a number of cycles of steady rolling, and return the steady state after them.

    The worn depth w after N cycles follows dw/dN = depth of one cycle, by the Runge-Kutta-Chebyshev method of
    second order. Its steps, of many cycles each, are as large as the estimated error permits.

    Parameters
    ----------
    solve : callable
        Solves steady rolling from a state, whose worn depth is that of the surfaces.
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
    Solution
        Steady state after the cycles, with the iterations of all states; the state is `here` if one of them
        does not converge.

    References
    ----------
    B. P. Sommeijer, L. F. Shampine and J. G. Verwer, J. Comput. Appl. Math. 88 (1998) 315.
    """
    start, states, iterations = here, 0, 0

    def steady(worn: Array) -> Solution:
        nonlocal start, states, iterations
        solution = solve(replace(here, wear=worn, state=start.state))
        states, iterations = states + 1, iterations + solution.result.iterations
        if solution.is_converged:
            start = solution.end
        return solution

    def finished(solution: Solution, sentence: str) -> Solution:
        end, loading = replace(solution.end, cycles=here.cycles + done), solution.result.loading
        if loading.rolling is not None:
            loading = replace(loading, rolling=replace(loading.rolling, cycles=end.cycles))
        solution = solution._replace(end=end if solution.is_converged else here)
        solution = solution.with_result(loading=loading, iterations=iterations)
        return solution.with_sentences(f"{sentence}, with {states} steady states")

    done, size, error, steps = 0.0, cycles, 0.0, 0
    first, others = _coefficients(_STAGES)
    worn = here.wear
    solution = steady(worn)
    if not solution.is_converged:
        return finished(solution, "before the first cycle")
    depth = wear.depth(solution.result, worn)
    while done < cycles:
        size = min(size, cycles - done)
        before, after = worn, worn + first * size * depth
        stage = steady(after)
        for each in others:
            if not stage.is_converged:
                break
            change = size * (each.mu_tilde * wear.depth(stage.result, after) + each.gamma_tilde * depth)
            after, before = (1.0 - each.mu - each.nu) * worn + each.mu * after + each.nu * before + change, after
            stage = steady(after)
        divisible = size > _MIN_STEP * cycles
        if not stage.is_converged:
            if not divisible:
                return finished(stage, f"after {done:g} of {cycles:g} cycles")
            size *= _FACTORS[0]
            continue
        new_depth = wear.depth(stage.result, after)
        deviation = float(np.abs(0.8 * (worn - after) + 0.4 * size * (depth + new_depth)).sum())
        relative = deviation / max(float((after - worn).sum()), 1e-300)
        factor = float(np.clip(_SAFETY * np.sqrt(tolerance / max(relative, 1e-300)), *_FACTORS))
        if relative > tolerance and divisible:
            size *= factor
            continue
        done = cycles if size == cycles - done else done + size
        worn, depth, solution = after, new_depth, stage
        size, error, steps = size * factor, error + deviation, steps + 1
    share = error / max(float((worn - here.wear).sum()), 1e-300)
    return finished(solution, f"worn in {cycles:g} cycles by {steps} steps, estimated error {share:.2%} of the depth")
