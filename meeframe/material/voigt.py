"""Conversion of tensors to Voigt matrices, in the order 11, 22, 33, 23, 13, 12, with engineering shear."""

from typing import Final

import numpy as np

from meeframe.fields import Array

INDEX_PAIRS: Final = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
"""Tensor indices, from 0, of the six Voigt indices."""
_VOIGT_INDEX: Final = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
_FIRST: Final = np.array([i for i, _ in INDEX_PAIRS])
_SECOND: Final = np.array([j for _, j in INDEX_PAIRS])


def voigt_index(i: int, j: int) -> int:
    """Return the Voigt index, 0 to 5, of two tensor indices i and j, each 0 to 2."""
    return int(_VOIGT_INDEX[i, j])


def elastic_tensor(matrix: Array) -> Array:
    """Convert a Voigt matrix (6, 6) to the tensor c_ijkl, (3, 3, 3, 3)."""
    tensor: Array = matrix[_VOIGT_INDEX[:, :, None, None], _VOIGT_INDEX[None, None, :, :]]
    return tensor


def elastic_matrix(tensor: Array) -> Array:
    """Convert a tensor c_ijkl (3, 3, 3, 3) to its Voigt matrix, (6, 6)."""
    matrix: Array = tensor[_FIRST[:, None], _SECOND[:, None], _FIRST[None, :], _SECOND[None, :]]
    return matrix


def mandel_matrix(tensor: Array) -> Array:
    """Convert a tensor c_ijkl (3, 3, 3, 3) to its matrix, (6, 6), in the orthonormal basis of symmetric tensors.

    This matrix has the eigenvalues of the tensor, which the Voigt matrix has not.
    """
    weights = np.where(_FIRST == _SECOND, 1.0, np.sqrt(2.0))
    matrix: Array = weights[:, None] * weights[None, :] * elastic_matrix(tensor)
    return matrix


def coupling_tensor(matrix: Array) -> Array:
    """Convert a Voigt matrix (3, 6), first index electric or magnetic, to the tensor e_kij, (3, 3, 3)."""
    tensor: Array = matrix[:, _VOIGT_INDEX]
    return tensor


def coupling_matrix(tensor: Array) -> Array:
    """Convert a tensor e_kij (3, 3, 3), first index electric or magnetic, to its Voigt matrix, (3, 6)."""
    matrix: Array = tensor[:, _FIRST, _SECOND]
    return matrix
