"""Conversion of tensors to Voigt matrices, in the order 11, 22, 33, 23, 13, 12, with engineering shear."""

from typing import Final

import numpy as np

from meeframe.fields import Array

PAIRS: Final = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
_VOIGT_OF: Final = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
_FIRST: Final = np.array([i for i, _ in PAIRS])
_SECOND: Final = np.array([j for _, j in PAIRS])


def voigt_index(i: int, j: int) -> int:
    """Return the Voigt number 0..5 of the index pair i, j (each 0..2)."""
    return int(_VOIGT_OF[i, j])


def elastic_tensor(matrix: Array) -> Array:
    """Return c_ijkl, (3, 3, 3, 3), of a Voigt matrix (6, 6)."""
    tensor: Array = matrix[_VOIGT_OF[:, :, None, None], _VOIGT_OF[None, None, :, :]]
    return tensor


def elastic_matrix(tensor: Array) -> Array:
    """Return the Voigt matrix (6, 6) of c_ijkl (3, 3, 3, 3)."""
    matrix: Array = tensor[_FIRST[:, None], _SECOND[:, None], _FIRST[None, :], _SECOND[None, :]]
    return matrix


def mandel_matrix(tensor: Array) -> Array:
    """Return the matrix (6, 6) of c_ijkl in the orthonormal basis of symmetric tensors; it has the eigenvalues of c."""
    weights = np.where(_FIRST == _SECOND, 1.0, np.sqrt(2.0))
    matrix: Array = weights[:, None] * weights[None, :] * elastic_matrix(tensor)
    return matrix


def coupling_tensor(matrix: Array) -> Array:
    """Return e_kij, (3, 3, 3), of a Voigt matrix (3, 6), whose first index is the electric or magnetic one."""
    tensor: Array = matrix[:, _VOIGT_OF]
    return tensor


def coupling_matrix(tensor: Array) -> Array:
    """Return the Voigt matrix (3, 6) of e_kij (3, 3, 3)."""
    matrix: Array = tensor[:, _FIRST, _SECOND]
    return matrix
