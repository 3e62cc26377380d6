"""Voigt matrices and tensors. Order of index pairs: 11, 22, 33, 23, 13, 12, without factors (engineering shear)."""

from typing import Final

import numpy as np

from meeframe.fields import Array

PAIRS: Final = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
_VOIGT_OF: Final = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
_FIRST: Final = np.array([i for i, _ in PAIRS])
_SECOND: Final = np.array([j for _, j in PAIRS])


def voigt_index(i: int, j: int) -> int:
    """Voigt number 0..5 of the index pair i, j (each 0..2)."""
    return int(_VOIGT_OF[i, j])


def elastic_tensor(matrix: Array) -> Array:
    """c_ijkl, (3, 3, 3, 3), of the Voigt matrix (6, 6)."""
    tensor: Array = matrix[_VOIGT_OF[:, :, None, None], _VOIGT_OF[None, None, :, :]]
    return tensor


def elastic_matrix(tensor: Array) -> Array:
    """Voigt matrix (6, 6) of c_ijkl (3, 3, 3, 3)."""
    matrix: Array = tensor[_FIRST[:, None], _SECOND[:, None], _FIRST[None, :], _SECOND[None, :]]
    return matrix


def mandel_matrix(tensor: Array) -> Array:
    """Matrix (6, 6) of c_ijkl in the orthonormal basis of symmetric tensors; its eigenvalues are those of c."""
    weights = np.where(_FIRST == _SECOND, 1.0, np.sqrt(2.0))
    matrix: Array = weights[:, None] * weights[None, :] * elastic_matrix(tensor)
    return matrix


def coupling_tensor(matrix: Array) -> Array:
    """e_kij, (3, 3, 3), of the Voigt matrix (3, 6); rows: the electric or magnetic index k."""
    tensor: Array = matrix[:, _VOIGT_OF]
    return tensor


def coupling_matrix(tensor: Array) -> Array:
    """Voigt matrix (3, 6) of e_kij (3, 3, 3)."""
    matrix: Array = tensor[:, _FIRST, _SECOND]
    return matrix
