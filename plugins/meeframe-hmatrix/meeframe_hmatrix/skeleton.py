# mypy: ignore-errors
"""Kernels of the cross approximation: points and samples of far columns, and sources that represent all."""

from math import sqrt

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def farthest_points(positions, low, high, count):
    """Return the numbers of at most `count` of the points at positions (n, 3), spread out as seen from a box.

    The first is the nearest to the box; each next one is the farthest from the previous ones relative to its distance
    from the box, so that they are dense close to the box. A larger count only adds points.
    """
    n = len(positions)
    count = min(count, n)
    scale, gap = np.empty(n), np.full(n, np.inf)
    for i in range(n):
        square = 0.0
        for axis in range(3):
            x = positions[i, axis]
            square += max(0.0, max(low[axis] - x, x - high[axis])) ** 2
        scale[i] = 1.0 / square
    selected = np.empty(count, np.int64)
    selected[0] = scale.argmax()
    for number in range(1, count):
        farthest, largest = 0, -1.0
        for i in range(n):
            square = 0.0
            for axis in range(3):
                square += (positions[i, axis] - positions[selected[number - 1], axis]) ** 2
            gap[i] = min(gap[i], square * scale[i])
            if gap[i] > largest:
                farthest, largest = i, gap[i]
        selected[number] = farthest
    return selected


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def enter_samples(fields, u, t, rows, samples, squares):
    """Enter kernels u, t (s p, f^2) of some sources in samples (m, p, 2 f), and add their squares to squares (p, 2).

    rows: (s, f) of the equations of the sources, negative where there is none. Entry f J + K is that of the equation K.
    fields: (0, ..., f - 1).
    """
    n_fields = len(fields)
    n = samples.shape[1]
    for source in range(len(rows)):
        for point in range(n):
            value_u, value_t = u[source * n + point], t[source * n + point]
            squares[point, 0] += (value_u**2).sum()
            squares[point, 1] += (value_t**2).sum()
            for k in range(n_fields):
                if rows[source, k] >= 0:
                    sample = samples[rows[source, k], point]
                    for j in range(n_fields):
                        sample[j], sample[n_fields + j] = value_u[n_fields * j + k], value_t[n_fields * j + k]


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def skeleton_sources(remainder, source, limit, is_sketch):
    """Return ascending sources whose rows of a matrix (m, n) span all rows, and all rows in a basis of these (m, r).

    Overwrites the matrix; the basis is orthonormal. The third result is False if random sums represent less than a
    quarter of the norm. source: (m,) of each row, ascending. All rows of a source are used together, because they cost
    as much as one; the next source is the one whose rows are farthest from the span, until the Frobenius norm of the
    remainder is at most `limit` (block Gram-Schmidt with pivoting). is_sketch: the matrix is another one times
    random vectors, and the norm is that of the other one: what r rows leave of it is represented by n - r vectors only.
    """
    m, n = remainder.shape
    n_sources = source[-1] + 1
    basis, squares = np.empty((min(m, n), n), remainder.dtype), np.zeros(n_sources)
    coefficients, projected = np.zeros((m, len(basis)), remainder.dtype), np.empty((m, n), remainder.dtype)
    round_off = 500.0 * np.finfo(remainder.dtype).eps
    used = np.zeros(n_sources, np.bool_)
    for i in range(m):
        squares[source[i]] += (remainder[i] ** 2).sum()
    rank, represented = 0, 1.0
    while squares.sum() > represented * limit * limit and not used.all():
        next_source = squares.argmax()
        used[next_source] = True
        first = rank
        for i in range(np.searchsorted(source, next_source), np.searchsorted(source, next_source, side="right")):
            row = remainder[i].copy()
            norm = sqrt((row**2).sum())
            for _ in range(2):  # twice for round-off
                for b in range(first, rank):
                    row -= (row * basis[b]).sum() * basis[b]
            remaining_norm = sqrt((row**2).sum())
            if rank < len(basis) and remaining_norm > round_off * norm:
                for q in range(n):  # numba compiles assignments of arrays to slices for seconds
                    basis[rank, q] = row[q] / remaining_norm
                rank += 1
        dots = np.dot(remainder, basis[first:rank].T)
        for i in range(m):
            for b in range(first, rank):
                coefficients[i, b] = dots[i, b - first]
        np.dot(dots, basis[first:rank], projected)
        squares[:] = 0.0
        for i in range(m):
            square = remainder.dtype.type(0.0)
            for q in range(n):
                remainder[i, q] -= projected[i, q]
                square += remainder[i, q] ** 2
            if not used[source[i]]:
                squares[source[i]] += square
        if is_sketch:
            represented = 1.0 - rank / n
            if represented < 0.25:
                break
    return np.flatnonzero(used), coefficients[:, :rank].copy(), represented >= 0.25
