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


@njit(cache=True, nogil=True, fastmath={"contract"})
def _interpolate(table, cell, s, t, value):
    """G, G_s, G_t into value (48,) at local coordinates s, t of one cell of the table, by Horner's rule in both.

    The bounds of the inner loops are constants, so that the compiler unrolls them and makes vectors of the columns.
    """
    for column in range(WIDTH):
        g, g_s, g_t = 0.0, 0.0, 0.0
        entry = column
        for degree in range(DEGREE + 1):
            row, row_t = 0.0, 0.0
            for _ in range(degree + 1):
                row_t = row_t * t + row
                row = row * t + table[cell, entry]
                entry += WIDTH
            g_s = g_s * s + g
            g = g * s + row
            g_t = g_t * s + row_t
        value[column], value[WIDTH + column], value[2 * WIDTH + column] = g, g_s, g_t


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _locate(x, y, z, cells):
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
    _, xa, u, v, cell, s, t = _locate(offset[point, 0], offset[point, 1], offset[point, 2], cells)
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


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _at_point(table, cells, offset, value, field):
    """U, U,x U,y and U,z at one point into field (64,), packed, 16 columns each; value (48,) is scratch."""
    face, xa, u, v, cell, s, t = _locate(offset[0], offset[1], offset[2], cells)
    _interpolate(table, cell, s, t, value)
    scale = 0.25 / (math.pi * abs(xa))
    steep = scale / xa
    a, b, c = WIDTH * (1 + face), WIDTH * (1 + (face + 1) % 3), WIDTH * (1 + (face + 2) % 3)
    for column in range(WIDTH):
        g = value[column]
        g_u = steep * cells * value[WIDTH + column]
        g_v = steep * cells * value[2 * WIDTH + column]
        field[column] = scale * g
        field[a + column] = -(steep * g + u * g_u + v * g_v)
        field[b + column] = g_u
        field[c + column] = g_v


@njit(cache=True, nogil=True, fastmath={"contract"})
def _flat_tractions(coefficients, normal, sums, spread, row, t_out):
    """Tractions (k, 25) of summed derivatives sums (k, 64) on a plane with one normal.

    coefficients (225,): C_iJMl as [J, M, l, i]; spread (3, 5, 8 k) and row (8 k,) are scratch, five of eight in use.
    """
    n_nodes = len(sums)
    for node in range(n_nodes):
        for part in range(3):
            for q in range(25):
                spread[part, q // 5, 8 * node + q % 5] = sums[node, WIDTH * (1 + part) + FLAT[q]]
    x, y, z = normal
    for j in range(5):
        row[:] = 0.0
        for part in range(3):
            o = 45 * j + 3 * part
            c0 = coefficients[o] * x + coefficients[o + 1] * y + coefficients[o + 2] * z
            c1 = coefficients[o + 9] * x + coefficients[o + 10] * y + coefficients[o + 11] * z
            c2 = coefficients[o + 18] * x + coefficients[o + 19] * y + coefficients[o + 20] * z
            c3 = coefficients[o + 27] * x + coefficients[o + 28] * y + coefficients[o + 29] * z
            c4 = coefficients[o + 36] * x + coefficients[o + 37] * y + coefficients[o + 38] * z
            r = spread[part]
            for i in range(len(row)):
                row[i] += c0 * r[0, i] + c1 * r[1, i] + c2 * r[2, i] + c3 * r[3, i] + c4 * r[4, i]
        for node in range(n_nodes):
            for k in range(5):
                t_out[node, 5 * j + k] = row[8 * node + k]


@njit(cache=True, nogil=True, fastmath={"contract"})
def integrate(table, cells, coefficients, offset, weights, starts, normals, u_out, t_out):
    """Write sums of weights (n, k) times U and T at points starts[e]..starts[e + 1] of plane pieces e, (m, k, 25).

    offset (n, 3), starts (m + 1,), normals (m, 3); coefficients as in _flat_tractions. A derivative is summed before
    it is contracted with stiffness and normal: a piece costs that once and not at every point.
    """
    n_nodes = weights.shape[1]
    value, field = np.empty(3 * WIDTH), np.empty(4 * WIDTH)
    sums, spread, row = np.empty((n_nodes, 4 * WIDTH)), np.zeros((3, 5, 8 * n_nodes)), np.empty(8 * n_nodes)
    for piece in range(len(normals)):
        sums[:] = 0.0
        for point in range(starts[piece], starts[piece + 1]):
            _at_point(table, cells, offset[point], value, field)
            for node in range(n_nodes):
                weight = weights[point, node]
                for i in range(4 * WIDTH):
                    sums[node, i] += weight * field[i]
        for node in range(n_nodes):
            for q in range(25):
                u_out[piece, node, q] = sums[node, FLAT[q]]
        _flat_tractions(coefficients, normals[piece], sums, spread, row, t_out[piece])


@njit(cache=True, nogil=True, error_model="numpy")
def gradient(table, cells, offset):
    """U,q (n, 5, 5, 3) for offset (n, 3)."""
    n = offset.shape[0]
    out = np.empty((n, 5, 5, 3))
    value = np.empty(3 * WIDTH)
    for point in range(n):
        face, xa, u, v, cell, s, t = _locate(offset[point, 0], offset[point, 1], offset[point, 2], cells)
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
