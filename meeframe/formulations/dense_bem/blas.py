"""Routines of BLAS and LAPACK that work in place on blocks of matrices, which the wrappers of SciPy would copy.

All matrices are float64 and Fortran-ordered, or rectangular blocks of such arrays; others raise ValueError. The library
and its threads are those of SciPy.
"""

from ctypes import CFUNCTYPE, byref, c_double, c_int, c_void_p
from typing import Any

import numpy as np
from numba.extending import get_cython_function_address
from numpy.typing import NDArray

from meeframe.fields import Array

Swaps = NDArray[np.int32]
"""Pivots of LAPACK: row i was exchanged with row swaps[i], counted from 1, one after the other."""


def factorise(matrix: Array, swaps: Swaps) -> None:
    """Factorise a matrix (m, n), m >= n, in place into LU by partial pivoting, and fill swaps (n,).

    One thread works column by column, which suits a few columns.
    """
    rows, columns = matrix.shape
    _dgetf2(*_integers(rows, columns), *_array(matrix), swaps.ctypes.data, *_integers(0))


def subtract_product(target: Array, left: Array, right: Array) -> None:
    """Compute target (m, n) -= left (m, k) @ right (k, n)."""
    sizes = _integers(*target.shape, len(right))
    _dgemm(
        b"N",
        b"N",
        *sizes,
        byref(c_double(-1.0)),
        *_array(left),
        *_array(right),
        byref(c_double(1.0)),
        *_array(target),
    )


def divide_by_lower(target: Array, factors: Array, *, from_right: bool = False) -> None:
    """Compute target = L^-1 target, or target L^-1, with L the unit lower triangle of factors (k, k)."""
    _divide(b"R" if from_right else b"L", b"L", b"U", target, factors)


def divide_by_upper(target: Array, factors: Array) -> None:
    """Compute target = U^-1 target, with U the upper triangle of factors (k, k)."""
    _divide(b"L", b"U", b"N", target, factors)


def _divide(side: bytes, triangle: bytes, diagonal: bytes, target: Array, factors: Array) -> None:
    sizes = _integers(*target.shape)
    _dtrsm(
        side,
        triangle,
        b"N",
        diagonal,
        *sizes,
        byref(c_double(1.0)),
        *_array(factors),
        *_array(target),
    )


def _integers(*values: int) -> tuple[Any, ...]:
    return tuple(byref(c_int(value)) for value in values)


def _array(matrix: Array) -> tuple[Any, Any]:
    """Return the address of the first entry and the leading dimension, which is irrelevant for a single column."""
    (rows, columns), (down, across) = matrix.shape, matrix.strides
    supported = matrix.dtype == np.float64
    supported &= rows <= 1 or columns == 0 or down == matrix.itemsize
    supported &= columns <= 1 or rows == 0 or across >= rows * matrix.itemsize
    if not supported:
        raise ValueError(
            f"matrix of {matrix.dtype}, shape {matrix.shape} and strides {matrix.strides}; allowed: columns of float64"
        )
    return matrix.ctypes.data, *_integers(max(1, rows, across // matrix.itemsize))


def _routine(library: str, name: str, n_arguments: int) -> Any:
    return CFUNCTYPE(None, *[c_void_p] * n_arguments)(get_cython_function_address(f"scipy.linalg.{library}", name))


_dgetf2 = _routine("cython_lapack", "dgetf2", 6)
_dgemm = _routine("cython_blas", "dgemm", 13)
_dtrsm = _routine("cython_blas", "dtrsm", 11)
