# mypy: ignore-errors
"""Kernels of the cross approximation: points and samples of far columns, and sources that stand for all."""

from math import sqrt

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def spread_out(places, low, high, count):
    """Numbers of at most count of the places (n, 3), spread out as seen from a box.

    The first is the nearest to the box; each next one is the farthest from those before, in terms of its distance from
    the box, so that they are dense where it is close. A larger count only adds to them.
    """
    n = len(places)
    count = min(count, n)
    scale, gap = np.empty(n), np.full(n, np.inf)
    for i in range(n):
        square = 0.0
        for axis in range(3):
            x = places[i, axis]
            square += max(0.0, max(low[axis] - x, x - high[axis])) ** 2
        scale[i] = 1.0 / square
    chosen = np.empty(count, np.int64)
    chosen[0] = scale.argmax()
    for number in range(1, count):
        farthest, largest = 0, -1.0
        for i in range(n):
            square = 0.0
            for axis in range(3):
                square += (places[i, axis] - places[chosen[number - 1], axis]) ** 2
            gap[i] = min(gap[i], square * scale[i])
            if gap[i] > largest:
                farthest, largest = i, gap[i]
        chosen[number] = farthest
    return chosen


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def enter_samples(u, t, rows, samples, squares):
    """Enter kernels u, t (s p, 25) of some sources in samples (m, p, 10), and add their squares up in squares (p, 2).

    rows: (s, 5) of the sources' equations, negative where there is none. Entry 5 J + K is that of the equation K.
    """
    n = samples.shape[1]
    for source in range(len(rows)):
        for point in range(n):
            one, other = u[source * n + point], t[source * n + point]
            squares[point, 0] += (one**2).sum()
            squares[point, 1] += (other**2).sum()
            for k in range(5):
                if rows[source, k] >= 0:
                    sample = samples[rows[source, k], point]
                    for j in range(5):
                        sample[j], sample[5 + j] = one[5 * j + k], other[5 * j + k]


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def skeleton_sources(rest, source, limit, mean):
    """Sources whose rows of a matrix (m, n) span all of it, rising, and all rows in an orthonormal basis of these,
    (m, r); overwrites the matrix.

    source: (m,) of each row, rising. All rows of a source are taken together, because they cost as much as one; the
    next source is the one whose rows are farthest from what is spanned, until the Frobenius norm of all that is left
    is at most limit (block Gram-Schmidt with pivoting). mean: the matrix is another one times random vectors, whose
    norm is meant: what r rows leave of it is seen by n - r of them only. Also whether a quarter still does.
    """
    m, n = rest.shape
    n_sources = source[-1] + 1
    basis, left = np.empty((min(m, n), n), rest.dtype), np.zeros(n_sources)
    parts, projected = np.zeros((m, len(basis)), rest.dtype), np.empty((m, n), rest.dtype)
    round_off = 500.0 * np.finfo(rest.dtype).eps
    taken = np.zeros(n_sources, np.bool_)
    for i in range(m):
        left[source[i]] += (rest[i] ** 2).sum()
    rank, shown = 0, 1.0
    while left.sum() > shown * limit * limit and not taken.all():
        worst = left.argmax()
        taken[worst] = True
        first = rank
        for i in range(np.searchsorted(source, worst), np.searchsorted(source, worst, side="right")):
            row = rest[i].copy()
            norm = sqrt((row**2).sum())
            for _ in range(2):  # twice is enough
                for b in range(first, rank):
                    row -= (row * basis[b]).sum() * basis[b]
            remains = sqrt((row**2).sum())
            if rank < len(basis) and remains > round_off * norm:
                basis[rank] = row / remains
                rank += 1
        dots = np.dot(rest, basis[first:rank].T)
        parts[:, first:rank] = dots
        np.dot(dots, basis[first:rank], projected)
        left[:] = 0.0
        for i in range(m):
            square = rest.dtype.type(0.0)
            for q in range(n):
                rest[i, q] -= projected[i, q]
                square += rest[i, q] ** 2
            if not taken[source[i]]:
                left[source[i]] += square
        if mean:
            shown = 1.0 - rank / n
            if shown < 0.25:
                break
    return np.flatnonzero(taken), parts[:, :rank].copy(), shown >= 0.25
