"""The kernel of fundamental solutions that are defined by their direction-dependent part."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import MECHANICAL, N_FIELDS, POTENTIALS, Array
from meeframe.greens._kernels.modulation import displacement_and_traction, displacement_gradient, triads
from meeframe.greens.base import Kernel
from meeframe.greens.directions import spread_directions

Modulation = Callable[[Array], Array]
"""Function that returns H, A, B (n, 3, 15) on triads (n, 3, 3); see meeframe.greens._kernels.modulation."""


@final
@dataclass(frozen=True, eq=False)
class ModulatedKernel(Kernel):
    """The kernel of a scaled stiffness, from its modulation (eqs. 42, 47, 48).

    Attributes
    ----------
    stiffness : Array
        Scaled extended stiffness, (3, 5, 5, 3).
    modulation : callable
        Direction-dependent part.
    """

    stiffness: Array
    modulation: Modulation

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return U and T, (n, 5, 5) each, for offsets (n, 3) and unit normals (n, 3)."""
        distance, triad = triads(np.ascontiguousarray(offset, dtype=float))
        normal = np.ascontiguousarray(normal, dtype=float)
        u, t = displacement_and_traction(self.stiffness, normal, distance, triad, self.modulation(triad))
        return u, t

    def gradient(self, offset: Array) -> Array:
        """Return U,q, (n, 5, 5, 3), for offsets (n, 3)."""
        distance, triad = triads(np.ascontiguousarray(offset, dtype=float))
        gradient: Array = displacement_gradient(distance, triad, self.modulation(triad))
        return gradient


def validate_stiffness(stiffness: Array) -> Array:
    """Return a contiguous read-only copy of a scaled extended stiffness, (3, 5, 5, 3), after checking it.

    Raises
    ------
    MaterialError
        If it is not finite, not symmetric (C_iJKm = C_mKJi) or not elliptic: for all directions z, C_iJKm z_i z_m must
        have a positive definite mechanical and a negative definite electromagnetic block.
    """
    tensor = np.array(stiffness, dtype=float, order="C")
    if tensor.shape != (3, N_FIELDS, N_FIELDS, 3):
        raise MaterialError(f"extended stiffness has shape {tensor.shape}; allowed: (3, {N_FIELDS}, {N_FIELDS}, 3)")
    if not np.isfinite(tensor).all():
        raise MaterialError("extended stiffness has entries that are not finite")
    asymmetry = np.abs(tensor - tensor.transpose(3, 2, 1, 0)).max() / np.abs(tensor).max()
    if asymmetry > 1e-10:
        raise MaterialError(f"extended stiffness violates C_iJKm = C_mKJi by {asymmetry:.1e} of its largest entry")
    directions = spread_directions(200)
    acoustic = np.einsum("ni,ijkm,nm->njk", directions, tensor, directions)
    blocks = {
        "mechanical": acoustic[:, MECHANICAL, MECHANICAL],
        "electromagnetic": -acoustic[:, POTENTIALS, POTENTIALS],
    }
    for name, block in blocks.items():
        smallest = float(np.linalg.eigvalsh(block).min())
        if not smallest > 0.0:
            raise MaterialError(
                f"{name} block of the material has eigenvalue {smallest:.3e} in some direction; it must be positive"
            )
    tensor.setflags(write=False)
    return tensor
