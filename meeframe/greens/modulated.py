"""The kernel shared by fundamental solutions that are given by their direction-dependent part."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import MECHANICAL, POTENTIALS, Array
from meeframe.greens._kernels.modulation import displacement_and_traction, displacement_gradient, triads
from meeframe.greens.base import Kernel
from meeframe.greens.directions import spread_directions

Modulation = Callable[[Array], Array]
"""H, A, B (n, 3, 15) on triads (n, 3, 3) with rows n, m, e; see meeframe.greens._kernels.modulation."""


@final
@dataclass(frozen=True, eq=False)
class ModulatedKernel(Kernel):
    """Kernel of a scaled stiffness (3, 5, 5, 3) from its modulation functions (eqs. 42, 47, 48)."""

    stiffness: Array
    modulation: Modulation

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return U and T, each (n, 5, 5), for offset (n, 3) and unit normal (n, 3)."""
        distance, triad = triads(np.ascontiguousarray(offset, dtype=float))
        normal = np.ascontiguousarray(normal, dtype=float)
        u, t = displacement_and_traction(self.stiffness, normal, distance, triad, self.modulation(triad))
        return u, t

    def gradient(self, offset: Array) -> Array:
        """Return U,q (n, 5, 5, 3) for offset (n, 3)."""
        distance, triad = triads(np.ascontiguousarray(offset, dtype=float))
        gradient: Array = displacement_gradient(distance, triad, self.modulation(triad))
        return gradient


def checked_stiffness(stiffness: Array) -> Array:
    """Return a contiguous read-only copy of a scaled extended stiffness, (3, 5, 5, 3).

    Raises MaterialError unless it is finite, symmetric (C_iJKm = C_mKJi) and elliptic: C_iJKm z_i z_m has a positive
    definite mechanical and a negative definite electromagnetic block for all directions z.
    """
    checked = np.array(stiffness, dtype=float, order="C")
    if checked.shape != (3, 5, 5, 3):
        raise MaterialError(f"extended stiffness of shape {checked.shape}; it must be (3, 5, 5, 3)")
    if not np.isfinite(checked).all():
        raise MaterialError("extended stiffness has entries that are not finite")
    asymmetry = np.abs(checked - checked.transpose(3, 2, 1, 0)).max() / np.abs(checked).max()
    if asymmetry > 1e-10:
        raise MaterialError(f"extended stiffness violates C_iJKm = C_mKJi by {asymmetry:.1e} of its largest entry")
    directions = spread_directions(200)
    acoustic = np.einsum("ni,ijkm,nm->njk", directions, checked, directions)
    blocks = {
        "mechanical": acoustic[:, MECHANICAL, MECHANICAL],
        "electromagnetic": -acoustic[:, POTENTIALS, POTENTIALS],
    }
    for name, block in blocks.items():
        least = float(np.linalg.eigvalsh(block).min())
        if not least > 0.0:
            raise MaterialError(
                f"{name} block of the material has eigenvalue {least:.3e} in some direction; it must be positive"
            )
    checked.setflags(write=False)
    return checked
