# mypy: ignore-errors
"""Truncation of a dense matrix to low rank, without the interpreter's lock."""

import numpy as np
from numba import njit

SINGLE = 1e-5
"""Truncation to at least this tolerance is coarser than single precision, in which it then computes."""
FIRST = 0.4
"""Part of the tolerance that is left by pivoting; the rest goes with the singular values."""

PLAIN = 1e-20
"""Sums of squares from here to its inverse are as good in single precision as in double; others are scaled first."""


def precision(tolerance):
    """The type of numbers in which to truncate."""
    return np.float32 if tolerance >= SINGLE else np.float64


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def truncated(rest, tolerance):
    """Factors left (m, k), right (k, n) of a matrix, to a relative tolerance in the Frobenius norm; overwrites it.

    Gram-Schmidt with pivoting, where the next row is always the one of which most is left, so that right is
    orthonormal; then the singular values of left, from its Gram matrix in double precision, give the best rank.
    Raises LinAlgError if entries are not finite.
    """
    m, n = rest.shape
    room = min(m, n)
    left, right = np.empty((room, m), rest.dtype), np.empty((room, n), rest.dtype)
    if room == 0:
        return left.copy().T, right
    squares = np.empty(m, rest.dtype)
    for i in range(m):
        squares[i] = (rest[i] * rest[i]).sum()
    unit = rest.dtype.type(1.0)
    if not PLAIN < squares.sum() < 1.0 / PLAIN:
        unit = np.abs(rest).max()
        if not np.isfinite(unit):
            raise np.linalg.LinAlgError("entries of a block are not finite")
        if unit > 0.0:
            rest /= unit
        for i in range(m):
            squares[i] = (rest[i] * rest[i]).sum()
    limit = tolerance * tolerance * squares.sum()
    rank = 0
    while rank < room and squares.sum() > FIRST * FIRST * limit:
        row = right[rank]
        row[:] = rest[squares.argmax()]
        for b in range(rank):  # once more, for round-off
            dot = (row * right[b]).sum()
            row -= dot * right[b]
        row /= np.sqrt((row * row).sum())
        for i in range(m):
            dot = rest.dtype.type(0.0)
            for q in range(n):
                dot += rest[i, q] * row[q]
            square = rest.dtype.type(0.0)
            for q in range(n):
                rest[i, q] -= dot * row[q]
                square += rest[i, q] * rest[i, q]
            left[rank, i], squares[i] = dot, square
        rank += 1
    if rank == 0:
        return left[:rank].copy().T, right[:rank].copy()
    exact = left[:rank].astype(np.float64)
    values, vectors = np.linalg.eigh(exact @ exact.T)
    dropped, tail = 0, abs(values[0])
    while dropped < rank - 1 and tail <= (1.0 - FIRST * FIRST) * limit:
        dropped += 1
        tail += abs(values[dropped])
    turn = np.ascontiguousarray(vectors[:, dropped:].T.astype(rest.dtype))
    return (unit * np.dot(turn, left[:rank])).T, np.dot(turn, right[:rank])
