"""Piecewise polynomial fundamental solution on the three pairs of faces of a cube.

On the faces |x_a| = max |x|, with u = x_b / x_a and v = x_c / x_a in [-1, 1] and (a, b, c) cyclic,
    4 pi |x_a| U = G(u, v),
so that with s = x_a |x_a|
    4 pi s U,b = G_u,   4 pi s U,c = G_v,   4 pi s U,a = -(G + u G_u + v G_v).
G is a polynomial of total degree 8 in the local coordinates s, t of each of cells x cells squares a face. The table
(3 cells^2, 45 * 16) holds its coefficients: of s^(8 - i) t^(i - j) in row i (i + 1) / 2 + j, of 16 columns: the packed
upper triangle and one of padding.
"""

import math

import numpy as np
from numba import njit

from meeframe.kernels.modulation import PACKED

DEGREE = 8
WIDTH = 16
# Points whose tractions are computed together, and points whose results stay in the second-level cache.
BLOCK = 32
CHUNK = 4096
FLAT = PACKED.ravel()


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _face(x, y, z):
    """Face number, x_a, u and v of an offset."""
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        return 0, x, y / x, z / x
    if ay >= az:
        return 1, y, z / y, x / y
    return 2, z, x / z, y / z


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _cell(coordinate, cells):
    """Cell along one parameter in [-1, 1]; a valid one for NaN too."""
    return max(0, min(int(0.5 * (coordinate + 1.0) * cells), cells - 1))


@njit(cache=True, nogil=True, error_model="numpy")
def _sort_by_cell(offset, cells):
    """Point numbers ordered by cell, (n,), and the bounds of the three faces in that order, (4,)."""
    n = offset.shape[0]
    key = np.empty(n, np.int32)
    start = np.zeros(3 * cells * cells + 1, np.int64)
    for point in range(n):
        face, _, u, v = _face(offset[point, 0], offset[point, 1], offset[point, 2])
        key[point] = (face * cells + _cell(u, cells)) * cells + _cell(v, cells)
        start[key[point] + 1] += 1
    for k in range(3 * cells * cells):
        start[k + 1] += start[k]
    bounds = start[:: cells * cells].copy()
    order = np.empty(n, np.int64)
    for point in range(n):
        order[start[key[point]]] = point
        start[key[point]] += 1
    return order, bounds


@njit(cache=True, nogil=True, fastmath={"contract"}, inline="always")
def horner(table, cell, column, s, t):
    """G, G_s, G_t of one column at local coordinates s, t of one cell of the table, by Horner's rule in both.

    The bounds of the inner loop are constants: in a loop over the columns the compiler unrolls it and makes vectors of
    them. Zeros with which the rule would begin are left out.
    """
    g_s = table[cell, column]
    g_t = table[cell, column + WIDTH]
    g = g_s * s + (g_t * t + table[cell, column + 2 * WIDTH])
    entry = column + 3 * WIDTH
    for degree in range(2, DEGREE + 1):
        row_t = table[cell, entry]
        row = row_t * t + table[cell, entry + WIDTH]
        entry += 2 * WIDTH
        for _ in range(degree - 1):
            row_t = row_t * t + row
            row = row * t + table[cell, entry]
            entry += WIDTH
        g_s = g_s * s + g
        g = g * s + row
        g_t = g_t * s + row_t
    return g, g_s, g_t


@njit(cache=True, nogil=True, fastmath={"contract"})
def _interpolate(table, cell, s, t, value):
    """G, G_s, G_t into value (48,)."""
    for column in range(WIDTH):
        value[column], value[WIDTH + column], value[2 * WIDTH + column] = horner(table, cell, column, s, t)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def locate(x, y, z, cells):
    """Face, x_a, u, v, cell of the table and local coordinates in it, of an offset."""
    face, xa, u, v = _face(x, y, z)
    i, j = _cell(u, cells), _cell(v, cells)
    return (
        face,
        xa,
        u,
        v,
        (face * cells + i) * cells + j,
        (u + 1.0) * cells - (2 * i + 1),
        (v + 1.0) * cells - (2 * j + 1),
    )


@njit(cache=True, nogil=True, fastmath={"contract"})
def _tractions(coefficients, place, sources, rows, traction):
    """T (25 blocks,) of one block of points on one face; all arrays flat, the points of the block run fastest.

    coefficients (225,): C_iJMl as [J, M, 3 k + i] with l = a, b, c for k = 0, 1, 2; place (6 blocks,): normal, u, v and
    1 / (4 pi s); sources (75 blocks,): G, G_u, G_v unpacked as [K, 5 k + M]; rows (15 blocks,) is scratch.
    """
    for j in range(5):
        for m in range(5):
            o = 9 * (5 * j + m)
            a0, a1, a2 = coefficients[o], coefficients[o + 1], coefficients[o + 2]
            b0, b1, b2 = coefficients[o + 3], coefficients[o + 4], coefficients[o + 5]
            c0, c1, c2 = coefficients[o + 6], coefficients[o + 7], coefficients[o + 8]
            for p in range(BLOCK):
                x, y, z = place[p], place[BLOCK + p], place[2 * BLOCK + p]
                along = a0 * x + a1 * y + a2 * z
                rows[BLOCK * m + p] = -along
                rows[BLOCK * (m + 5) + p] = b0 * x + b1 * y + b2 * z - place[3 * BLOCK + p] * along
                rows[BLOCK * (m + 10) + p] = c0 * x + c1 * y + c2 * z - place[4 * BLOCK + p] * along
        for k in range(5):
            for p in range(BLOCK):
                total = 0.0
                for q in range(15):
                    total += rows[BLOCK * q + p] * sources[BLOCK * (15 * k + q) + p]
                traction[BLOCK * (5 * j + k) + p] = total * place[5 * BLOCK + p]


@njit(cache=True, nogil=True, error_model="numpy")
def _gather(table, cells, offset, normal, point, p, value, place, sources, u_out):
    """Evaluate G at one point; fill column p of place and sources (see _tractions), and U."""
    _, xa, u, v, cell, s, t = locate(offset[point, 0], offset[point, 1], offset[point, 2], cells)
    _interpolate(table, cell, s, t, value)
    for axis in range(3):
        place[BLOCK * axis + p] = normal[point, axis]
    place[3 * BLOCK + p], place[4 * BLOCK + p] = u, v
    place[5 * BLOCK + p] = 0.25 / (math.pi * xa * abs(xa))
    scale = 0.25 / (math.pi * abs(xa))
    for q in range(25):
        u_out[point, q] = scale * value[FLAT[q]]
    for k in range(5):
        for m in range(5):
            o = BLOCK * (15 * k + m) + p
            entry = FLAT[5 * k + m]
            sources[o] = value[entry]
            sources[o + 5 * BLOCK] = cells * value[WIDTH + entry]
            sources[o + 10 * BLOCK] = cells * value[2 * WIDTH + entry]


@njit(cache=True, nogil=True, error_model="numpy")
def _evaluate_chunk(table, cells, coefficients, offset, normal, work, u_out, t_out):
    """U and T (n, 25) of points few enough for their results to stay in cache; work: scratch arrays."""
    value, place, rows, sources, traction = work
    order, bounds = _sort_by_cell(offset, cells)
    for face in range(3):
        for first in range(bounds[face], bounds[face + 1], BLOCK):
            used = min(BLOCK, bounds[face + 1] - first)
            for p in range(used):
                _gather(table, cells, offset, normal, order[first + p], p, value, place, sources, u_out)
            # Columns beyond those used hold old points: finite, and not written out.
            _tractions(coefficients[face], place, sources, rows, traction)
            for p in range(used):
                point = order[first + p]
                for q in range(25):
                    t_out[point, q] = traction[BLOCK * q + p]


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(table, cells, coefficients, offset, normal, u_out, t_out):
    """Write U and T (n, 25) for offset (n, 3), normal (n, 3); coefficients (3, 225) per face as in _tractions."""
    n = offset.shape[0]
    work = (
        np.empty(3 * WIDTH),
        np.zeros(6 * BLOCK),
        np.empty(15 * BLOCK),
        np.zeros(75 * BLOCK),
        np.empty(25 * BLOCK),
    )
    for first in range(0, n, CHUNK):
        part = slice(first, min(first + CHUNK, n))
        _evaluate_chunk(table, cells, coefficients, offset[part], normal[part], work, u_out[part], t_out[part])


@njit(cache=True, nogil=True, error_model="numpy")
def gradient(table, cells, offset):
    """U,q (n, 5, 5, 3) for offset (n, 3)."""
    n = offset.shape[0]
    out = np.empty((n, 5, 5, 3))
    value = np.empty(3 * WIDTH)
    for point in range(n):
        face, xa, u, v, cell, s, t = locate(offset[point, 0], offset[point, 1], offset[point, 2], cells)
        _interpolate(table, cell, s, t, value)
        scale = 0.25 / (math.pi * abs(xa) * xa)
        for j in range(5):
            for k in range(5):
                entry = PACKED[j, k]
                gu, gv = cells * value[entry + 16], cells * value[entry + 32]
                out[point, j, k, face] = -scale * (value[entry] + u * gu + v * gv)
                out[point, j, k, (face + 1) % 3] = scale * gu
                out[point, j, k, (face + 2) % 3] = scale * gv
    return out
