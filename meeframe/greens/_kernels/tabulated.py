"""Piecewise polynomial fundamental solution on the faces of a cube, opposite ones taken together.

On the faces |x_a| = max |x|, with u = x_b / x_a and v = x_c / x_a in [-1, 1] and (a, b, c) cyclic,
    4 pi |x_a| U = G(u, v),
so that with s = x_a |x_a|
    4 pi s U,b = G_u,   4 pi s U,c = G_v,   4 pi s U,a = -(G + u G_u + v G_v).
G is a polynomial of total degree 8 in the local coordinates s, t of each of cells x cells squares a face. The table
(3 cells^2, 45 * 16) holds its coefficients: that of s^(8 - i) t^(i - j) in row i (i + 1) / 2 + j of 16 columns, which
are the packed upper triangle and one column of padding.
"""

import math

import numpy as np
from numba import njit

from meeframe.fields import N_FIELDS
from meeframe.greens._kernels.modulation import N_PACKED, N_PAIRS, PACKED
from meeframe.greens._kernels.prefetch import prefetch

DEGREE = 8
WIDTH = 16
# Points of one cell that are interpolated together, and points whose tractions are computed together.
LANES, BLOCK = 8, 32
# Least number of points of one cell that are interpolated together, even if some lanes are idle.
MIN_BATCH = 5
PADDED_BLOCK = BLOCK + LANES
# Points that are sorted together: enough for one or two in each cell, and few enough for their packed results (0.66 MB)
# to stay in a second-level cache of 1 MiB until they are written in order.
CHUNK = 2048
PACKED_FLAT = PACKED.ravel()
# Doubles of U, packed, and T of one point (five cache lines), doubles of a cache line, and the number of points by
# which results are prefetched.
POINT_WIDTH, CACHE_LINE, PREFETCH_DISTANCE = N_PACKED + N_PAIRS, 8, 8


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _face(x, y, z):
    """Return the face number, x_a, u and v of an offset.

    The conditions are written so that the compiler vectorises them in a loop over points; branches would be predicted
    wrongly at most points.
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
    """Return the cell number along one parameter in [-1, 1], a valid number for NaN, too."""
    return max(0, min(int(0.5 * (coordinate + 1.0) * cells), cells - 1))


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _local(coordinate, number, cells):
    """Return the local coordinate in [-1, 1] within a cell, along one parameter."""
    return (coordinate + 1.0) * cells - (2 * number + 1)


@njit(cache=True, nogil=True, error_model="numpy")
def sort_by_cell(offset, cells, coordinates, key, order):
    """Sort points by cell and return the bounds of the three faces in that order, (4,).

    Fills coordinates (3, n) with x_a, u, v; key (n,) with cells of the table; order (n,) with point numbers ordered by
    cell.
    """
    n = offset.shape[0]
    start = np.zeros(3 * cells * cells + 1, np.int64)
    # With a constant step of three the compiler vectorises the loop; with rows it would do so for a step of one only.
    flat = offset.ravel()
    for point in range(n):
        face, xa, u, v = _face(flat[3 * point], flat[3 * point + 1], flat[3 * point + 2])
        coordinates[0, point], coordinates[1, point], coordinates[2, point] = xa, u, v
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

    The inner loop has constant bounds, so that in a loop over the columns the compiler unrolls it and vectorises over
    the columns. The zeros at the start of the rule are left out.
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
    """Return face, x_a, u, v, cell of the table and local coordinates s, t of an offset."""
    face, xa, u, v = _face(x, y, z)
    i, j = _cell(u, cells), _cell(v, cells)
    return face, xa, u, v, (face * cells + i) * cells + j, _local(u, i, cells), _local(v, j, cells)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _interpolate_lanes(table, cell, s, t, first, values):
    """Interpolate at LANES points of one cell with s, t (LANES,) into values (see _block) from column `first` on."""
    for column in range(N_PACKED):
        out = values[column, first:]
        # The compiler must not know this length: it would unroll a short loop instead of vectorising it.
        for p in range(len(s)):
            out[p], out[PADDED_BLOCK + p], out[2 * PADDED_BLOCK + p] = horner(table, cell, column, s[p], t[p])


@njit(cache=True, nogil=True, fastmath={"contract"}, inline="always")
def _traction_factors(c, o, coordinates):
    """Return the factors of G, G_u, G_v in T for one J and M, with C_iJMl in c[o], ..., c[o + 8] as [3 k + i]."""
    x, y, z, u, v = coordinates
    along = c[o] * x + c[o + 1] * y + c[o + 2] * z
    return (
        -along,
        c[o + 3] * x + c[o + 4] * y + c[o + 5] * z - u * along,
        c[o + 6] * x + c[o + 7] * y + c[o + 8] * z - v * along,
    )


@njit(cache=True, nogil=True, fastmath={"contract"}, inline="always")
def _packed_product(k, values, p, factors):
    """Return row k of a packed symmetric matrix, with entries in column p of values, times factors."""
    return (
        factors[0] * values[PACKED[k, 0], p]
        + factors[1] * values[PACKED[k, 1], p]
        + factors[2] * values[PACKED[k, 2], p]
        + factors[3] * values[PACKED[k, 3], p]
        + factors[4] * values[PACKED[k, 4], p]
    )


@njit(cache=True, nogil=True, fastmath={"contract"}, inline="always")
def _traction_entry(k, values, p, scale, slope, a, b, c):
    """Return T_JK of one J at point p, from the factors of G, G_u, G_v."""
    steep = _packed_product(k, values, PADDED_BLOCK + p, b) + _packed_product(k, values, 2 * PADDED_BLOCK + p, c)
    return scale * _packed_product(k, values, p, a) + slope * steep


@njit(cache=True, nogil=True, fastmath={"contract"})
def tractions(coefficients, point_data, values, traction):
    """Fill traction (5, 5 BLOCK) with T at one block of points on one face; the points run fastest.

    coefficients (225,): C_iJMl as [J, M, 3 k + i] with l = a, b, c for k = 0, 1, 2; point_data (7, BLOCK): normal, u,
    v, 1 / (4 pi s) and that times cells; values: see _block. The compiler vectorises only without an inner loop.
    """
    for j in range(N_FIELDS):
        o = 45 * j
        out = traction[j]
        for p in range(BLOCK):
            point = point_data[0, p], point_data[1, p], point_data[2, p], point_data[3, p], point_data[4, p]
            a0, b0, c0 = _traction_factors(coefficients, o, point)
            a1, b1, c1 = _traction_factors(coefficients, o + 9, point)
            a2, b2, c2 = _traction_factors(coefficients, o + 18, point)
            a3, b3, c3 = _traction_factors(coefficients, o + 27, point)
            a4, b4, c4 = _traction_factors(coefficients, o + 36, point)
            a, b, c = (a0, a1, a2, a3, a4), (b0, b1, b2, b3, b4), (c0, c1, c2, c3, c4)
            scale, slope = point_data[5, p], point_data[6, p]
            out[p] = _traction_entry(0, values, p, scale, slope, a, b, c)
            out[BLOCK + p] = _traction_entry(1, values, p, scale, slope, a, b, c)
            out[2 * BLOCK + p] = _traction_entry(2, values, p, scale, slope, a, b, c)
            out[3 * BLOCK + p] = _traction_entry(3, values, p, scale, slope, a, b, c)
            out[4 * BLOCK + p] = _traction_entry(4, values, p, scale, slope, a, b, c)


@njit(cache=True, nogil=True, inline="always")
def _prefetch(array, begin, end):
    """Prefetch the flat entries begin to end of a contiguous array."""
    for entry in range(begin, end, CACHE_LINE):
        prefetch(array, entry)


@njit(cache=True, nogil=True, error_model="numpy")
def _block(table, cells, points, next_cell, coordinates, key, normal, work):
    """Evaluate G at up to BLOCK points of one face, points (b,) of coordinates and key (see sort_by_cell) and normal.

    next_cell: cell of the point after these, -1 if there is none. Fills work: local (2, PADDED_BLOCK) with s, t;
    point_data (7, BLOCK), see tractions; values (16, 3 PADDED_BLOCK): G, G_s, G_t of each column at all points. Unused
    columns hold earlier points, which are finite and not written.
    """
    local, point_data, values, value = work
    for p in range(len(points)):
        point = points[p]
        xa, u, v = coordinates[0, point], coordinates[1, point], coordinates[2, point]
        local[0, p] = _local(u, _cell(u, cells), cells)
        local[1, p] = _local(v, _cell(v, cells), cells)
        for axis in range(3):
            point_data[axis, p] = normal[point, axis]
        point_data[3, p], point_data[4, p] = u, v
        point_data[5, p] = 0.25 / (math.pi * xa * abs(xa))
        point_data[6, p] = cells * point_data[5, p]
    p = 0
    while p < len(points):
        cell = key[points[p]]
        # Unordered points rarely have so many in a cell, those of an assembly mostly do: the branch predicts well.
        batched = p + MIN_BATCH <= len(points) and key[points[p + MIN_BATCH - 1]] == cell
        end = p + (MIN_BATCH if batched else 1)
        while batched and end < min(p + LANES, len(points)) and key[points[end]] == cell:
            end += 1
        upcoming = key[points[end]] if end < len(points) else next_cell
        if upcoming >= 0 and upcoming != cell:
            # The coefficients of the next cell of sorted points are rarely in the caches.
            _prefetch(table, upcoming * table.shape[1], (upcoming + 1) * table.shape[1])
        if batched:
            # Idle lanes write into columns of later points, which overwrite them.
            _interpolate_lanes(table, cell, local[0, p : p + LANES], local[1, p : p + LANES], p, values)
        else:
            _interpolate(table, cell, local[0, p], local[1, p], value)
            for q in range(N_PACKED):
                values[q, p] = value[q]
                values[q, PADDED_BLOCK + p] = value[WIDTH + q]
                values[q, 2 * PADDED_BLOCK + p] = value[2 * WIDTH + q]
        p = end


@njit(cache=True, nogil=True, error_model="numpy")
def _pack(points, coordinates, values, traction, packed):
    """Write U, packed, and T of a block of points (see _block, tractions) into rows of packed (b, 40)."""
    for p in range(len(points)):
        scale = 0.25 / (math.pi * abs(coordinates[0, points[p]]))
        for q in range(N_PACKED):
            packed[p, q] = scale * values[q, p]
        for q in range(N_PAIRS):
            packed[p, N_PACKED + q] = traction[q // N_FIELDS, BLOCK * (q % N_FIELDS) + p]


@njit(cache=True, nogil=True, error_model="numpy")
def _write(points, coordinates, values, traction, u_out, t_out):
    """Write U and T of a block of points into rows of the results (n, 25); fastest if these are in the caches."""
    for p in range(len(points)):
        point = points[p]
        scale = 0.25 / (math.pi * abs(coordinates[0, point]))
        for q in range(N_PAIRS):
            u_out[point, q] = scale * values[PACKED_FLAT[q], p]
        for q in range(N_PAIRS):
            t_out[point, q] = traction[q // N_FIELDS, BLOCK * (q % N_FIELDS) + p]


@njit(cache=True, nogil=True, error_model="numpy")
def _write_in_order(packed, order, row_number, u_out, t_out):
    """Write U and T (n, 25) from packed, whose rows are the points of order (n,); fill row_number (n,), its inverse.

    The results are written in the order of the points, complete lines one after the other. That is much faster than
    scattered rows, which memory would have to read first.
    """
    n = len(order)
    for row in range(n):
        row_number[order[row]] = row
    for point in range(n):
        upcoming = POINT_WIDTH * row_number[min(point + PREFETCH_DISTANCE, n - 1)]
        _prefetch(packed, upcoming, upcoming + POINT_WIDTH)
        result = packed[row_number[point]]
        for q in range(N_PAIRS):
            u_out[point, q] = result[PACKED_FLAT[q]]
        for q in range(N_PAIRS):
            t_out[point, q] = result[N_PACKED + q]


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(table, cells, coefficients, offset, normal, u_out, t_out):
    """Write U and T (n, 25) for offset and normal (n, 3); coefficients (3, 225): for each face as in tractions."""
    n = offset.shape[0]
    capacity = min(n, CHUNK)
    coordinates, key, packed = (
        np.empty((3, capacity)),
        np.empty(capacity, np.int32),
        np.empty((capacity if n > capacity else 0, POINT_WIDTH)),
    )
    order, row_number = np.empty((2, capacity), np.int32)
    point_data, values, traction = (
        np.zeros((7, BLOCK)),
        np.zeros((WIDTH, 3 * PADDED_BLOCK)),
        np.empty((N_FIELDS, N_FIELDS * BLOCK)),
    )
    work = np.zeros((2, PADDED_BLOCK)), point_data, values, np.empty(3 * WIDTH)
    for begin in range(0, n, CHUNK):
        chunk = slice(begin, min(begin + CHUNK, n))
        # The normals are needed in sorted order, which the hardware cannot predict.
        _prefetch(normal, 3 * chunk.start, 3 * chunk.stop)
        bounds = sort_by_cell(offset[chunk], cells, coordinates, key, order)
        for face in range(3):
            for first in range(bounds[face], bounds[face + 1], BLOCK):
                last = min(first + BLOCK, bounds[face + 1])
                points = order[first:last]
                next_cell = key[order[last]] if last < bounds[3] else -1
                _block(table, cells, points, next_cell, coordinates, key, normal[chunk], work)
                tractions(coefficients[face], point_data, values, traction)
                if n > capacity:
                    _pack(points, coordinates, values, traction, packed[first:])
                else:
                    _write(points, coordinates, values, traction, u_out, t_out)
        if n > capacity:
            _write_in_order(packed, order[: chunk.stop - chunk.start], row_number, u_out[chunk], t_out[chunk])


@njit(cache=True, nogil=True, error_model="numpy")
def gradient(table, cells, offset):
    """Return U,q, (n, 5, 5, 3), for offset (n, 3)."""
    n = offset.shape[0]
    out = np.empty((n, N_FIELDS, N_FIELDS, 3))
    value = np.empty(3 * WIDTH)
    for point in range(n):
        face, xa, u, v, cell, s, t = locate(offset[point, 0], offset[point, 1], offset[point, 2], cells)
        _interpolate(table, cell, s, t, value)
        scale = 0.25 / (math.pi * abs(xa) * xa)
        for j in range(N_FIELDS):
            for k in range(N_FIELDS):
                entry = PACKED[j, k]
                gu, gv = cells * value[entry + 16], cells * value[entry + 32]
                out[point, j, k, face] = -scale * (value[entry] + u * gu + v * gv)
                out[point, j, k, (face + 1) % 3] = scale * gu
                out[point, j, k, (face + 2) % 3] = scale * gv
    return out
