"""Roughly truncated inverses of the compliance of the contact zone, as preconditioners."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.fields import Array, Indices
from meeframe_hmatrix.arithmetic import Factors, Truncation, eliminate, helpers, solved
from meeframe_hmatrix.blocks import Block, multiply

ROUGHLY: Final = 1e-2
"""Truncation of an approximate inverse."""
FAR_OFF: Final = 0.5
"""Relative error in a uniform load from which an inverse is none."""


@dataclass(frozen=True, eq=False)
class RoughInverse:
    """Loads (n, k) for displacements (n, k): factors of a matrix in the units (k,) that make its entries alike,
    its nodes in the given order."""

    factors: Factors
    unit: Array
    order: Indices

    def __call__(self, displacement: Array) -> Array:
        """Loads (n, k) that roughly cause displacements (n, k)."""
        values = self.unit * displacement[self.order]
        loads = np.empty(displacement.shape, displacement.dtype)
        loads[self.order] = self.unit * solved(self.factors, values.reshape(-1, 1)).reshape(displacement.shape)
        return loads


def rough_inverse(matrix: Block, unit: Array, order: Indices) -> RoughInverse | None:
    """In single precision or, if that is far off, in double; None if that is, too, as on a body so slender that
    truncation loses all but its bending.

    matrix: k rows and columns a node, both counted from 0, in the units (k,) that make its entries alike.
    """
    uniform = np.ones((len(order), len(unit)))
    displacement = np.empty_like(uniform)
    displacement[order] = multiply(matrix, uniform.reshape(-1, 1)).reshape(uniform.shape) / unit
    for dtype in (np.float32, np.float64):
        with helpers() as pool:
            inverse = RoughInverse(eliminate(matrix, Truncation(ROUGHLY, dtype, pool)), unit, order)
        if np.linalg.norm(inverse(displacement) / unit - uniform) < FAR_OFF * np.linalg.norm(uniform):
            return inverse
    return None
