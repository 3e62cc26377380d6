"""Elimination of a dense system whose last unknowns alone are wanted for many right-hand sides.

With A = [[A11, A12], [A21, A22]], right-hand sides B and P A = LU on the columns of the first k unknowns,

    W = A21 A11^-1,    (A22 - W A12) x2 = B2 - W B1,    A11 x1 = B1 - A12 x2,

rows exchanged. As W is found once from the factor L21 = A21 U11^-1, which pivoting makes anyway, neither A12 nor B1 is
divided by L11, as an elimination of the whole matrix would: a sixth less to do where the last unknowns and the
right-hand sides are a quarter each.
"""

from typing import Final

import numpy as np
from scipy.linalg.lapack import dlange

from meeframe.fields import Array
from meeframe.formulations.dense_bem._kernels.row_swaps import swap_rows
from meeframe.formulations.dense_bem.blas import (
    Swaps,
    divide_by_lower,
    divide_by_upper,
    factorise,
    subtract_product,
)

PANEL: Final = 32
"""Columns that are factorised at once, by one thread: several would wait for each other at every few columns, which
takes long on a machine with other work."""
SAMPLES: Final = 8
"""Random right-hand sides for the condition; that all are a tenth as large as expected has a probability of 1e-7."""


def eliminate(columns: Array, k: int) -> None:
    """Eliminate the first k unknowns of columns (u, w), in Fortran order and in place, then the others.

    The first u columns are the matrix, the rest right-hand sides. Left behind are, in rows exchanged alike,

        L11 \\ U11   A12      B1
        W           L2 \\ U2  L2^-1 (B2 - W B1)
    """
    u = len(columns)
    swaps = np.empty(u, np.int32)
    _factorise(columns[:, :k], swaps[:k])
    swap_rows(columns[:, k:], swaps[:k])
    below = columns[k:]
    divide_by_lower(below[:, :k], columns[:k, :k], from_right=True)
    subtract_product(below[:, k:], below[:, :k], columns[:k, k:])
    _factorise(below[:, k:u], swaps[k:])
    for part in (below[:, :k], below[:, u:]):
        swap_rows(part, swaps[k:])
    divide_by_lower(below[:, u:], below[:, k:u])


def last_unknowns(columns: Array, k: int, right: Array) -> Array:
    """Return the unknowns after the first k, (u - k, m), of an eliminated system, for right-hand sides as it left
    them."""
    found = np.array(right[k:], order="F")
    divide_by_upper(found, columns[k:, k : len(columns)])
    return found


def all_unknowns(columns: Array, k: int, right: Array) -> Array:
    """Return the unknowns (u, m) of an eliminated system for right-hand sides (u, m) as it left them."""
    found = np.array(right, order="F")
    first, last = found[:k], found[k:]
    divide_by_upper(last, columns[k:, k : len(columns)])
    subtract_product(first, columns[:k, k : len(columns)], last)
    divide_by_lower(first, columns[:k, :k])
    divide_by_upper(first, columns[:k, :k])
    return found


def inverse_norm(columns: Array, k: int) -> float:
    """Return the Frobenius norm of the inverse of an eliminated matrix, estimated; not finite if a pivot is zero.

    The root of the mean square of the solutions for independent right-hand sides of variance 1 (Gudmundsson, Kenney,
    Laub 1995, Small-sample statistical estimates for matrix norms).
    """
    right = np.asfortranarray(np.random.default_rng(0).standard_normal((len(columns), SAMPLES)))
    subtract_product(right[k:], columns[k:, :k], right[:k])
    divide_by_lower(right[k:], columns[k:, k : len(columns)])
    return float(dlange("F", all_unknowns(columns, k, right))) / SAMPLES**0.5


def _factorise(matrix: Array, swaps: Swaps) -> None:
    """Factorise a matrix (m, n), m >= n, into LU in blocks: one call of LAPACK fails from 22,450 columns on.

    Halves of the columns, halved in turn, so that nearly all is done by products of large matrices (Toledo 1997).
    """
    half = matrix.shape[1] // 2
    if matrix.shape[1] <= PANEL:
        factorise(matrix, swaps)
        return
    left, right = matrix[:, :half], matrix[:, half:]
    _factorise(left, swaps[:half])
    swap_rows(right, swaps[:half])
    divide_by_lower(right[:half], left[:half])
    subtract_product(right[half:], left[half:], right[:half])
    _factorise(right[half:], swaps[half:])
    swap_rows(left[half:], swaps[half:])
    swaps[half:] += half
