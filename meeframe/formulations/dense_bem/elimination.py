"""Elimination of a dense system of which only the last unknowns are needed for many right-hand sides.

With A = [[A11, A12], [A21, A22]], right-hand sides B and P A = LU on the columns of the first k unknowns,

    W = A21 A11^-1,    (A22 - W A12) x2 = B2 - W B1,    A11 x1 = B1 - A12 x2,

with rows exchanged. W follows from the factor L21 = A21 U11^-1, which pivoting provides. An elimination of the complete
matrix would also divide A12 and B1 by L11; this one saves a sixth of the work where the last unknowns and the
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

PANEL_WIDTH: Final = 32
"""Number of columns that one thread factorises at once.

Several threads would have to wait for each other after every few columns, which is slow on a busy machine.
"""
N_SAMPLES: Final = 8
"""Number of random right-hand sides of the estimate; it is ten times too small with a probability of 1e-7."""


def eliminate(columns: Array, k: int) -> None:
    r"""Eliminate the first k unknowns of a system in place, then the others.

    Parameters
    ----------
    columns : Array
        Matrix, the first u columns, and right-hand sides, (u, w), in Fortran order.
    k : int
        Number of unknowns to eliminate first.

    Notes
    -----
    The result is, with rows exchanged alike,

        L11 \ U11   A12      B1
        W           L2 \ U2  L2^-1 (B2 - W B1)
    """
    u = len(columns)
    swaps = np.empty(u, np.int32)
    _factorise(columns[:, :k], swaps[:k])
    swap_rows(columns[:, k:], swaps[:k])
    below = columns[k:]
    divide_by_lower(below[:, :k], columns[:k, :k], from_right=True)
    subtract_product(below[:, k:], below[:, :k], columns[:k, k:])
    _factorise(below[:, k:u], swaps[k:])
    for block in (below[:, :k], below[:, u:]):
        swap_rows(block, swaps[k:])
    divide_by_lower(below[:, u:], below[:, k:u])


def last_unknowns(columns: Array, k: int, right: Array) -> Array:
    """Return the unknowns after the first k of an eliminated system.

    Parameters
    ----------
    columns : Array
        Result of `eliminate`, (u, w).
    k : int
        Number of unknowns that were eliminated first.
    right : Array
        Right-hand sides, (u, m), as `eliminate` leaves them.

    Returns
    -------
    Array
        Unknowns, (u - k, m).
    """
    unknowns = np.array(right[k:], order="F")
    divide_by_upper(unknowns, columns[k:, k : len(columns)])
    return unknowns


def all_unknowns(columns: Array, k: int, right: Array) -> Array:
    """Return all unknowns of an eliminated system.

    Parameters
    ----------
    columns : Array
        Result of `eliminate`, (u, w).
    k : int
        Number of unknowns that were eliminated first.
    right : Array
        Right-hand sides, (u, m), as `eliminate` leaves them.

    Returns
    -------
    Array
        Unknowns, (u, m).
    """
    unknowns = np.array(right, order="F")
    first, last = unknowns[:k], unknowns[k:]
    divide_by_upper(last, columns[k:, k : len(columns)])
    subtract_product(first, columns[:k, k : len(columns)], last)
    divide_by_lower(first, columns[:k, :k])
    divide_by_upper(first, columns[:k, :k])
    return unknowns


def inverse_norm(columns: Array, k: int) -> float:
    """Estimate the Frobenius norm of the inverse of an eliminated matrix; it is not finite if a pivot is zero.

    Notes
    -----
    The estimate is the root mean square of the solutions for independent right-hand sides of variance 1.

    References
    ----------
    Gudmundsson, Kenney and Laub, Small-sample statistical estimates for matrix norms, 1995.
    """
    right = np.asfortranarray(np.random.default_rng(0).standard_normal((len(columns), N_SAMPLES)))
    subtract_product(right[k:], columns[k:, :k], right[:k])
    divide_by_lower(right[k:], columns[k:, k : len(columns)])
    return float(dlange("F", all_unknowns(columns, k, right))) / N_SAMPLES**0.5


def _factorise(matrix: Array, swaps: Swaps) -> None:
    """Factorise a matrix (m, n), m >= n, into LU, since one call of LAPACK fails for 22,450 columns and more.

    The columns are halved recursively, so that products of large matrices do nearly all the work (Toledo 1997).
    """
    half = matrix.shape[1] // 2
    if matrix.shape[1] <= PANEL_WIDTH:
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
