"""Piecewise polynomial fundamental solution on the three pairs of faces of a cube.

On the faces |x_a| = max |x|, with u = x_b / x_a and v = x_c / x_a in [-1, 1] and (a, b, c) cyclic,
    4 pi |x_a| U = G(u, v),
so that with s = x_a |x_a|
    4 pi s U,b = G_u,   4 pi s U,c = G_v,   4 pi s U,a = -(G + u G_u + v G_v).
G is stored as monomial coefficients of degree 7 in the local coordinates of cells x cells squares a face,
table (3 cells^2, 8 * 8 * 16): powers along u, powers along v, packed upper triangle and one column of padding.
"""

import math

import numpy as np
from numba import njit

from meeframe.kernels.modulation import PACKED

TERMS = 8
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
def _interpolate(table, cell, s, t, rows, value):
    """G, G_s, G_t into value (48,) at local coordinates s, t of one cell of the table; rows (256,) is scratch."""
    t2, t3 = t * t, t * t * t
    t4, t5, t6 = t2 * t2, t2 * t3, t3 * t3
    t7 = t3 * t4
    d2, d3, d4, d5, d6, d7 = 2.0 * t, 3.0 * t2, 4.0 * t3, 5.0 * t4, 6.0 * t5, 7.0 * t6
    for i in range(TERMS):
        for c in range(WIDTH):
            o = 128 * i + c
            a1, a2, a3, a4 = table[cell, o + 16], table[cell, o + 32], table[cell, o + 48], table[cell, o + 64]
            a5, a6, a7 = table[cell, o + 80], table[cell, o + 96], table[cell, o + 112]
            rows[32 * i + c] = table[cell, o] + t * a1 + t2 * a2 + t3 * a3 + t4 * a4 + t5 * a5 + t6 * a6 + t7 * a7
            rows[32 * i + 16 + c] = a1 + d2 * a2 + d3 * a3 + d4 * a4 + d5 * a5 + d6 * a6 + d7 * a7
    s2, s3 = s * s, s * s * s
    s4, s5, s6 = s2 * s2, s2 * s3, s3 * s3
    s7 = s3 * s4
    e2, e3, e4, e5, e6, e7 = 2.0 * s, 3.0 * s2, 4.0 * s3, 5.0 * s4, 6.0 * s5, 7.0 * s6
    for c in range(WIDTH):
        a1, a2, a3, a4 = rows[c + 32], rows[c + 64], rows[c + 96], rows[c + 128]
        a5, a6, a7 = rows[c + 160], rows[c + 192], rows[c + 224]
        b1, b2, b3, b4 = rows[c + 48], rows[c + 80], rows[c + 112], rows[c + 144]
        b5, b6, b7 = rows[c + 176], rows[c + 208], rows[c + 240]
        value[c] = rows[c] + s * a1 + s2 * a2 + s3 * a3 + s4 * a4 + s5 * a5 + s6 * a6 + s7 * a7
        value[16 + c] = a1 + e2 * a2 + e3 * a3 + e4 * a4 + e5 * a5 + e6 * a6 + e7 * a7
        value[32 + c] = rows[c + 16] + s * b1 + s2 * b2 + s3 * b3 + s4 * b4 + s5 * b5 + s6 * b6 + s7 * b7


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
def _gather(table, cells, face, offset, normal, point, p, scratch, value, place, sources, u_out):
    """Evaluate G at one point of a face; fill column p of place and sources (see _tractions), and U."""
    _, xa, u, v = _face(offset[point, 0], offset[point, 1], offset[point, 2])
    i, j = _cell(u, cells), _cell(v, cells)
    cell = (face * cells + i) * cells + j
    _interpolate(table, cell, (u + 1.0) * cells - (2 * i + 1), (v + 1.0) * cells - (2 * j + 1), scratch, value)
    scale = 0.25 / (math.pi * abs(xa))
    for i in range(3):
        place[i * BLOCK + p] = normal[point, i]
    place[3 * BLOCK + p], place[4 * BLOCK + p], place[5 * BLOCK + p] = u, v, scale / xa
    for c in range(16, 48):
        value[c] *= cells
    for k in range(5):
        for m in range(5):
            entry = FLAT[5 * k + m]
            u_out[point, 5 * k + m] = scale * value[entry]
            column = BLOCK * (15 * k + m) + p
            sources[column] = value[entry]
            sources[column + 5 * BLOCK] = value[entry + 16]
            sources[column + 10 * BLOCK] = value[entry + 32]


@njit(cache=True, nogil=True, error_model="numpy")
def _evaluate_chunk(table, cells, coefficients, offset, normal, work, u_out, t_out):
    """U and T (n, 25) of points few enough for their results to stay in cache; work: scratch arrays."""
    scratch, value, place, rows, sources, traction = work
    order, bounds = _sort_by_cell(offset, cells)
    for face in range(3):
        for first in range(bounds[face], bounds[face + 1], BLOCK):
            used = min(BLOCK, bounds[face + 1] - first)
            for p in range(used):
                point = order[first + p]
                _gather(table, cells, face, offset, normal, point, p, scratch, value, place, sources, u_out)
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
        np.empty(2 * TERMS * WIDTH),
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
    scratch = np.empty(2 * TERMS * WIDTH)
    value = np.empty(3 * WIDTH)
    for point in range(n):
        face, xa, u, v = _face(offset[point, 0], offset[point, 1], offset[point, 2])
        i, j = _cell(u, cells), _cell(v, cells)
        cell = (face * cells + i) * cells + j
        _interpolate(table, cell, (u + 1.0) * cells - (2 * i + 1), (v + 1.0) * cells - (2 * j + 1), scratch, value)
        scale = 0.25 / (math.pi * abs(xa) * xa)
        for j in range(5):
            for k in range(5):
                entry = PACKED[j, k]
                gu, gv = cells * value[entry + 16], cells * value[entry + 32]
                out[point, j, k, face] = -scale * (value[entry] + u * gu + v * gv)
                out[point, j, k, (face + 1) % 3] = scale * gu
                out[point, j, k, (face + 2) % 3] = scale * gv
    return out
