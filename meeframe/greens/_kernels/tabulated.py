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

from meeframe.greens._kernels.modulation import PACKED
from meeframe.greens._kernels.prefetch import prefetch

DEGREE = 8
WIDTH = 16
# Points of one cell that are interpolated together, and points whose tractions are computed together.
LANES, BLOCK = 8, 32
# From so many points of one cell on it pays to interpolate them together, though some lanes stay idle.
FEW = 5
WIDE = BLOCK + LANES
# Points sorted together: enough for one or two in each cell, few enough for their packed results (0.66 MB) to stay in a
# second-level cache of 1 MiB, where that is so large, until they are written out in order.
CHUNK = 2048
FLAT = PACKED.ravel()
N_PACKED = 15
# Doubles of one point's U, packed, and T: five lines of cache. Those of so many points ahead are fetched.
ROW, LINE, AHEAD = N_PACKED + 25, 8, 8


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _face(x, y, z):
    """Return the face number, x_a, u and v of an offset.

    The choices are written so that the compiler makes vectors of them in a loop over points: branches would be guessed
    wrong at most points.
    """
    ax, ay, az = abs(x), abs(y), abs(z)
    first, second = (ax >= ay) & (ax >= az), ay >= az
    face = 0 if first else (1 if second else 2)
    xa = x if first else (y if second else z)
    xb = y if first else (z if second else x)
    xc = z if first else (x if second else y)
    return face, xa, xb / xa, xc / xa


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _cell(coordinate, cells):
    """Return the cell along one parameter in [-1, 1]; a valid one for NaN too."""
    return max(0, min(int(0.5 * (coordinate + 1.0) * cells), cells - 1))


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _local(coordinate, number, cells):
    """Return where in [-1, 1] of a cell along one parameter a coordinate lies."""
    return (coordinate + 1.0) * cells - (2 * number + 1)


@njit(cache=True, nogil=True, error_model="numpy")
def sort_by_cell(offset, cells, place, key, order):
    """Fill place (3, n): x_a, u, v; key (n,): cells of the table; order (n,): point numbers ordered by cell.

    Returns the bounds of the three faces in that order, (4,).
    """
    n = offset.shape[0]
    start = np.zeros(3 * cells * cells + 1, np.int64)
    # A step of three that the compiler knows: it would make vectors for rows of one alone.
    flat = offset.ravel()
    for point in range(n):
        face, xa, u, v = _face(flat[3 * point], flat[3 * point + 1], flat[3 * point + 2])
        place[0, point], place[1, point], place[2, point] = xa, u, v
        key[point] = (face * cells + _cell(u, cells)) * cells + _cell(v, cells)
    for point in range(n):
        start[key[point] + 1] += 1
    for k in range(3 * cells * cells):
        start[k + 1] += start[k]
    bounds = start[:: cells * cells].copy()
    for point in range(n):
        order[start[key[point]]] = point
        start[key[point]] += 1
    return bounds


@njit(cache=True, nogil=True, fastmath={"contract"}, inline="always")
def horner(table, cell, column, s, t):
    """Return G, G_s, G_t of one column at local coordinates s, t of one cell of the table, by Horner's rule in both.

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
    """Return G, G_s, G_t into value (48,)."""
    for column in range(WIDTH):
        value[column], value[WIDTH + column], value[2 * WIDTH + column] = horner(table, cell, column, s, t)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def locate(x, y, z, cells):
    """Return the face, x_a, u, v, cell of the table and local coordinates in it, of an offset."""
    face, xa, u, v = _face(x, y, z)
    i, j = _cell(u, cells), _cell(v, cells)
    return face, xa, u, v, (face * cells + i) * cells + j, _local(u, i, cells), _local(v, j, cells)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _interpolate_lanes(table, cell, s, t, first, values):
    """Interpolate at LANES points of one cell with s, t (LANES,), into columns first... of values (see _block)."""
    for column in range(N_PACKED):
        out = values[column, first:]
        # A length that the compiler does not know: it would unroll a short loop and make no vectors.
        for p in range(len(s)):
            out[p], out[WIDE + p], out[2 * WIDE + p] = horner(table, cell, column, s[p], t[p])


@njit(cache=True, nogil=True, fastmath={"contract"}, inline="always")
def _row(c, o, place):
    """Return the factors of G, G_u, G_v in T for one J and M, from c[o], ..., c[o + 8]: C_iJMl as [3 k + i]; see
    tractions."""
    x, y, z, u, v = place
    along = c[o] * x + c[o + 1] * y + c[o + 2] * z
    return (
        -along,
        c[o + 3] * x + c[o + 4] * y + c[o + 5] * z - u * along,
        c[o + 6] * x + c[o + 7] * y + c[o + 8] * z - v * along,
    )


@njit(cache=True, nogil=True, fastmath={"contract"}, inline="always")
def _product(k, values, p, factors):
    """Return the row k of a packed symmetric matrix, with its entries in column p of values, times factors."""
    return (
        factors[0] * values[PACKED[k, 0], p]
        + factors[1] * values[PACKED[k, 1], p]
        + factors[2] * values[PACKED[k, 2], p]
        + factors[3] * values[PACKED[k, 3], p]
        + factors[4] * values[PACKED[k, 4], p]
    )


@njit(cache=True, nogil=True, fastmath={"contract"}, inline="always")
def _entry(k, values, p, scale, slope, a, b, c):
    """Return T_JK of one J at point p, from the factors of G, G_u, G_v."""
    steep = _product(k, values, WIDE + p, b) + _product(k, values, 2 * WIDE + p, c)
    return scale * _product(k, values, p, a) + slope * steep


@njit(cache=True, nogil=True, fastmath={"contract"})
def tractions(coefficients, place, values, traction):
    """Return T into traction (5, 5 blocks) of one block of points on one face; the points run fastest.

    coefficients (225,): C_iJMl as [J, M, 3 k + i] with l = a, b, c for k = 0, 1, 2; place (7, BLOCK): normal, u, v,
    1 / (4 pi s) and that times cells; values: see _block. No inner loop: with one the compiler makes no vectors.
    """
    for j in range(5):
        o = 45 * j
        out = traction[j]
        for p in range(BLOCK):
            here = place[0, p], place[1, p], place[2, p], place[3, p], place[4, p]
            a0, b0, c0 = _row(coefficients, o, here)
            a1, b1, c1 = _row(coefficients, o + 9, here)
            a2, b2, c2 = _row(coefficients, o + 18, here)
            a3, b3, c3 = _row(coefficients, o + 27, here)
            a4, b4, c4 = _row(coefficients, o + 36, here)
            a, b, c = (a0, a1, a2, a3, a4), (b0, b1, b2, b3, b4), (c0, c1, c2, c3, c4)
            scale, slope = place[5, p], place[6, p]
            out[p] = _entry(0, values, p, scale, slope, a, b, c)
            out[BLOCK + p] = _entry(1, values, p, scale, slope, a, b, c)
            out[2 * BLOCK + p] = _entry(2, values, p, scale, slope, a, b, c)
            out[3 * BLOCK + p] = _entry(3, values, p, scale, slope, a, b, c)
            out[4 * BLOCK + p] = _entry(4, values, p, scale, slope, a, b, c)


@njit(cache=True, nogil=True, inline="always")
def _prefetch(array, begin, end):
    """Fetch entries begin to end of a contiguous array, counted flat, while others are in use."""
    for entry in range(begin, end, LINE):
        prefetch(array, entry)


@njit(cache=True, nogil=True, error_model="numpy")
def _block(table, cells, points, following, place, key, normal, work):
    """Evaluate G at up to BLOCK points of one face, points (b,) of place and key (see sort_by_cell) and normal.

    following: cell of the point after these, -1 if there is none. Fills work: local (2, WIDE) with s, t; near
    (7, BLOCK), see tractions; values (16, 3 WIDE): of each column G, G_s, G_t at all points. Columns beyond those used
    hold old points: finite, and not written out.
    """
    local, near, values, value = work
    for p in range(len(points)):
        point = points[p]
        xa, u, v = place[0, point], place[1, point], place[2, point]
        local[0, p] = _local(u, _cell(u, cells), cells)
        local[1, p] = _local(v, _cell(v, cells), cells)
        for axis in range(3):
            near[axis, p] = normal[point, axis]
        near[3, p], near[4, p] = u, v
        near[5, p] = 0.25 / (math.pi * xa * abs(xa))
        near[6, p] = cells * near[5, p]
    p = 0
    while p < len(points):
        cell = key[points[p]]
        # Points without order seldom come so many to a cell, those of an assembly mostly do: a good guess either way.
        together = p + FEW <= len(points) and key[points[p + FEW - 1]] == cell
        end = p + (FEW if together else 1)
        while together and end < min(p + LANES, len(points)) and key[points[end]] == cell:
            end += 1
        ahead = key[points[end]] if end < len(points) else following
        if ahead >= 0 and ahead != cell:
            # Sorted points seldom find the coefficients of the next cell near the processor.
            _prefetch(table, ahead * table.shape[1], (ahead + 1) * table.shape[1])
        if together:
            # Idle lanes fill columns of points that follow, before these do.
            _interpolate_lanes(table, cell, local[0, p : p + LANES], local[1, p : p + LANES], p, values)
        else:
            _interpolate(table, cell, local[0, p], local[1, p], value)
            for q in range(N_PACKED):
                values[q, p] = value[q]
                values[q, WIDE + p] = value[WIDTH + q]
                values[q, 2 * WIDE + p] = value[2 * WIDTH + q]
        p = end


@njit(cache=True, nogil=True, error_model="numpy")
def _pack(points, place, values, traction, packed):
    """Return the results of a block of points (see _block, tractions) as rows of packed (b, 40): U, packed, and T."""
    for p in range(len(points)):
        scale = 0.25 / (math.pi * abs(place[0, points[p]]))
        for q in range(N_PACKED):
            packed[p, q] = scale * values[q, p]
        for q in range(25):
            packed[p, N_PACKED + q] = traction[q // 5, BLOCK * (q % 5) + p]


@njit(cache=True, nogil=True, error_model="numpy")
def _write(points, place, values, traction, u_out, t_out):
    """Return the results of a block of points into their rows of U and T (n, 25): fastest where all of these are in
    the caches."""
    for p in range(len(points)):
        point = points[p]
        scale = 0.25 / (math.pi * abs(place[0, point]))
        for q in range(25):
            u_out[point, q] = scale * values[FLAT[q], p]
        for q in range(25):
            t_out[point, q] = traction[q // 5, BLOCK * (q % 5) + p]


@njit(cache=True, nogil=True, error_model="numpy")
def _write_in_order(packed, order, row_of, u_out, t_out):
    """Write U and T (n, 25) from rows of packed of the points in that order (n,); fills row_of (n,), its inverse.

    Written in the order of the points, whole lines one after the other: memory takes those much faster than rows here
    and there, which it would have to read first.
    """
    n = len(order)
    for row in range(n):
        row_of[order[row]] = row
    for point in range(n):
        ahead = ROW * row_of[min(point + AHEAD, n - 1)]
        _prefetch(packed, ahead, ahead + ROW)
        found = packed[row_of[point]]
        for q in range(25):
            u_out[point, q] = found[FLAT[q]]
        for q in range(25):
            t_out[point, q] = found[N_PACKED + q]


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(table, cells, coefficients, offset, normal, u_out, t_out):
    """Write U and T (n, 25) for offset (n, 3), normal (n, 3); coefficients (3, 225) per face as in tractions."""
    n = offset.shape[0]
    room = min(n, CHUNK)
    place, key, packed = np.empty((3, room)), np.empty(room, np.int32), np.empty((room if n > room else 0, ROW))
    order, row_of = np.empty((2, room), np.int32)
    near, values, traction = np.zeros((7, BLOCK)), np.zeros((WIDTH, 3 * WIDE)), np.empty((5, 5 * BLOCK))
    work = np.zeros((2, WIDE)), near, values, np.empty(3 * WIDTH)
    for begin in range(0, n, CHUNK):
        part = slice(begin, min(begin + CHUNK, n))
        # They are needed in another order, in which the processor cannot foresee them.
        _prefetch(normal, 3 * part.start, 3 * part.stop)
        bounds = sort_by_cell(offset[part], cells, place, key, order)
        for face in range(3):
            for first in range(bounds[face], bounds[face + 1], BLOCK):
                last = min(first + BLOCK, bounds[face + 1])
                points = order[first:last]
                following = key[order[last]] if last < bounds[3] else -1
                _block(table, cells, points, following, place, key, normal[part], work)
                tractions(coefficients[face], near, values, traction)
                if n > room:
                    _pack(points, place, values, traction, packed[first:])
                else:
                    _write(points, place, values, traction, u_out, t_out)
        if n > room:
            _write_in_order(packed, order[: part.stop - part.start], row_of, u_out[part], t_out[part])


@njit(cache=True, nogil=True, error_model="numpy")
def gradient(table, cells, offset):
    """Return U,q (n, 5, 5, 3) for offset (n, 3)."""
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
