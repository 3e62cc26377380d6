# mypy: ignore-errors
"""Truncation of a dense matrix to low rank, without the global interpreter lock."""

import numpy as np
from numba import njit

SINGLE_PRECISION_TOLERANCE = 1e-5
"""Tolerance from which single precision is sufficient for a truncation."""
PIVOTING_FRACTION = 0.4
"""Fraction of the tolerance used by pivoting; the remainder is used by the singular values."""

MIN_SQUARES = 1e-20
"""Sums of squares between this and its inverse do not need scaling in single precision."""


def precision(tolerance):
    """Return the type of numbers for a truncation."""
    return np.float32 if tolerance >= SINGLE_PRECISION_TOLERANCE else np.float64


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def truncate(remainder, tolerance):
    """Return factors left (m, k), right (k, n) of a matrix, to a relative tolerance in the Frobenius norm.

    Overwrites the matrix. Gram-Schmidt orthogonalization with pivoting, where the next row is always the one with the
    largest remainder, makes right orthonormal; the singular values of left, from its Gram matrix in double precision,
    then give the best rank. Raises LinAlgError if entries are not finite.
    """
    m, n = remainder.shape
    max_rank = min(m, n)
    left, right = np.empty((max_rank, m), remainder.dtype), np.empty((max_rank, n), remainder.dtype)
    if max_rank == 0:
        return left.copy().T, right
    squares = np.empty(m, remainder.dtype)
    for i in range(m):
        squares[i] = (remainder[i] * remainder[i]).sum()
    unit = remainder.dtype.type(1.0)
    if not MIN_SQUARES < squares.sum() < 1.0 / MIN_SQUARES:
        unit = np.abs(remainder).max()
        if not np.isfinite(unit):
            raise np.linalg.LinAlgError("entries of a block are not finite")
        if unit > 0.0:
            remainder /= unit
        for i in range(m):
            squares[i] = (remainder[i] * remainder[i]).sum()
    limit = tolerance * tolerance * squares.sum()
    rank = 0
    while rank < max_rank and squares.sum() > PIVOTING_FRACTION * PIVOTING_FRACTION * limit:
        row, pivot = right[rank], squares.argmax()
        for q in range(n):
            row[q] = remainder[pivot, q]
        for b in range(rank):  # orthogonalize again because of round-off
            dot = (row * right[b]).sum()
            row -= dot * right[b]
        row /= np.sqrt((row * row).sum())
        for i in range(m):
            dot = remainder.dtype.type(0.0)
            for q in range(n):
                dot += remainder[i, q] * row[q]
            square = remainder.dtype.type(0.0)
            for q in range(n):
                remainder[i, q] -= dot * row[q]
                square += remainder[i, q] * remainder[i, q]
            left[rank, i], squares[i] = dot, square
        rank += 1
    if rank == 0:
        return left[:rank].copy().T, right[:rank].copy()
    exact = left[:rank].astype(np.float64)
    values, vectors = np.linalg.eigh(exact @ exact.T)
    dropped, tail = 0, abs(values[0])
    while dropped < rank - 1 and tail <= (1.0 - PIVOTING_FRACTION * PIVOTING_FRACTION) * limit:
        dropped += 1
        tail += abs(values[dropped])
    rotation = np.ascontiguousarray(vectors[:, dropped:].T.astype(remainder.dtype))
    return (unit * np.dot(rotation, left[:rank])).T, np.dot(rotation, right[:rank])
