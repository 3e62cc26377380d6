"""The line integral over the half circle normal to a direction, exact for all materials."""

from dataclasses import dataclass
from functools import partial
from typing import final

from meeframe.common.errors import CaseError, MaterialError
from meeframe.fields import Array
from meeframe.greens._kernels.line_integral import line_integrals
from meeframe.greens._kernels.modulation import triads
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.directions import spread_directions
from meeframe.greens.modulated import ModulatedKernel, validate_stiffness

MAX_POINTS = 1 << 14
# The rule converges geometrically, so that the error is about the square of the last change.
MAX_CHANGE = 1e-8


@final
@dataclass(frozen=True)
class LineIntegral(FundamentalSolution):
    """H(e) as the mean of (C_iJKm z_i z_m)^-1 over the half circle normal to e, by the trapezoidal rule.

    Attributes
    ----------
    points : int
        Initial number of nodes of the rule, even. It is doubled for each direction until the result is exact to
        round-off.

    Raises
    ------
    CaseError
        If the number of points is out of bounds.

    References
    ----------
    Barnett, Phys. Stat. Sol. (b) 49 (1972) 741; docs/explanation/theory.md, Fundamental solution.
    """

    points: int = 32

    def __post_init__(self) -> None:
        if self.points % 2 or not 4 <= self.points <= MAX_POINTS:
            raise CaseError(f"LineIntegral: points = {self.points!r}; allowed: even numbers from 4 to {MAX_POINTS}")

    def bind(self, stiffness: Array) -> Kernel:
        """Return the kernel of a material.

        Parameters
        ----------
        stiffness : Array
            Scaled extended stiffness, (3, 5, 5, 3).

        Returns
        -------
        Kernel
            The kernel.

        Raises
        ------
        MaterialError
            If the stiffness is not symmetric or not elliptic.
        """
        stiffness = validate_stiffness(stiffness)
        modulation = partial(line_modulation, stiffness, self.points)
        modulation(triads(spread_directions(20))[1])
        return ModulatedKernel(stiffness, modulation)


def line_modulation(stiffness: Array, points: int, triad: Array, with_tangents: bool = True) -> Array:
    """Return the modulation on triads.

    Parameters
    ----------
    stiffness : Array
        Scaled extended stiffness, (3, 5, 5, 3).
    points : int
        Initial number of nodes of the rule.
    triad : Array
        Triads, (n, 3, 3), with rows n, m, e.
    with_tangents : bool
        If false, compute H alone.

    Returns
    -------
    Array
        H, A, B, (n, 3, 15), or H alone, (n, 1, 15); see `meeframe.greens._kernels.modulation`.

    Raises
    ------
    MaterialError
        If the rule does not converge.
    """
    modulation, converged = line_integrals(stiffness, triad, points, MAX_POINTS, MAX_CHANGE, with_tangents)
    if not converged:
        raise MaterialError(
            f"the line integral does not converge with {MAX_POINTS} points: the material is close to losing ellipticity"
        )
    result: Array = modulation
    return result
