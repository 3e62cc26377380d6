"""Inverses of the compliance of the contact zone with a large truncation error, as preconditioners."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.plugin import Array, Indices
from meeframe_hmatrix.arithmetic import Factors, Truncation, apply_inverse, eliminate, worker_pool
from meeframe_hmatrix.blocks import Block, multiply

TRUNCATION: Final = 1e-2
"""Relative truncation error of an approximate inverse."""
MAX_ERROR: Final = 0.5
"""Largest relative error in a uniform load of a useful inverse."""


@dataclass(frozen=True, eq=False)
class TruncatedInverse:
    """A map from displacements (n, k) to loads (n, k) by factors of a matrix.

    Attributes
    ----------
    factors
        Factors of the matrix, with nodes in the order `order`.
    unit
        Units (k,) in which entries of the matrix have similar magnitudes.
    order
        (n,) nodes in the order of the matrix.
    """

    factors: Factors
    unit: Array
    order: Indices

    def __call__(self, displacement: Array) -> Array:
        """Return loads (n, k) that approximately cause displacements (n, k)."""
        values = self.unit * displacement[self.order]
        loads = np.empty(displacement.shape, displacement.dtype)
        loads[self.order] = self.unit * apply_inverse(self.factors, values.reshape(-1, 1)).reshape(displacement.shape)
        return loads


def truncated_inverse(matrix: Block, unit: Array, order: Indices) -> TruncatedInverse | None:
    """Return an approximate inverse in single precision or, if that is not accurate enough, in double precision.

    None if neither is accurate enough, as on bodies so slender that truncation loses everything but their bending.

    Parameters
    ----------
    matrix
        Hierarchical matrix with k rows and columns per node, both counted from 0.
    unit : (k,) array
        Units in which entries of the matrix have similar magnitudes.
    order : (n,) array
        Nodes in the order of the matrix.
    """
    uniform = np.ones((len(order), len(unit)))
    displacement = np.empty_like(uniform)
    displacement[order] = multiply(matrix, uniform.reshape(-1, 1)).reshape(uniform.shape) / unit
    for dtype in (np.float32, np.float64):
        with worker_pool() as pool:
            inverse = TruncatedInverse(eliminate(matrix, Truncation(TRUNCATION, dtype, pool)), unit, order)
        if np.linalg.norm(inverse(displacement) / unit - uniform) < MAX_ERROR * np.linalg.norm(uniform):
            return inverse
    return None
