"""The line integral over the half circle normal to a direction: exact and free of degeneracy."""

from dataclasses import dataclass
from functools import partial
from typing import final

from meeframe.common.errors import CaseError, MaterialError
from meeframe.fields import Array
from meeframe.greens._kernels.line_integral import line_integrals
from meeframe.greens._kernels.modulation import triads
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.directions import spread_directions
from meeframe.greens.modulated import ModulatedKernel, checked_stiffness

MOST_POINTS = 1 << 14
# The rule converges geometrically, so the error is about the square of the last change.
LAST_CHANGE = 1e-8


@final
@dataclass(frozen=True)
class LineIntegral(FundamentalSolution):
    """H(e) as the mean of (C_iJKm z_i z_m)^-1 over the half circle normal to e, by the trapezoidal rule.

    points: nodes of the rule, an even number; they are doubled, direction by direction, until the result is exact to
    round-off. Raises CaseError if points is out of bounds.
    Source: Barnett, Phys. Stat. Sol. (b) 49 (1972) 741; docs/theory.md, Fundamental solution.
    """

    points: int = 32

    def __post_init__(self) -> None:
        if self.points % 2 or not 4 <= self.points <= MOST_POINTS:
            raise CaseError(f"LineIntegral: points = {self.points!r}: allowed are even numbers from 4 to {MOST_POINTS}")

    def bind(self, stiffness: Array) -> Kernel:
        """Return the kernel for a scaled stiffness (3, 5, 5, 3); MaterialError if it is not symmetric or not
        elliptic."""
        checked = checked_stiffness(stiffness)
        modulation = partial(line_modulation, checked, self.points)
        modulation(triads(spread_directions(20))[1])
        return ModulatedKernel(checked, modulation)


def line_modulation(stiffness: Array, points: int, triad: Array, with_tangents: bool = True) -> Array:
    """Return H, A, B (n, 3, 15) on triads (n, 3, 3), or H alone, (n, 1, 15), without tangents.

    Raises MaterialError if the rule does not converge.
    """
    modulation, converged = line_integrals(stiffness, triad, points, MOST_POINTS, LAST_CHANGE, with_tangents)
    if not converged:
        raise MaterialError(
            f"the line integral does not converge with {MOST_POINTS} points: the material is all but not elliptic"
        )
    result: Array = modulation
    return result
