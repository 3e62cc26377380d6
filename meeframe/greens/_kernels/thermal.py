"""Action of heat on the other fields, interpolated on the faces of a cube; see tabulated for faces and cells.

With W odd and of degree 0, W = sign(x_a) G(u, v), and
    |x_a| W,b = G_u,   |x_a| W,c = G_v,   |x_a| W,a = -(u G_u + v G_v).
"""

import math

import numpy as np
from numba import njit

from meeframe.greens._kernels.tabulated import horner, locate

COLUMNS = 5
# Columns of the table that are interpolated together, one cache line of its rows.
PADDED = 8


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _at_point(table, cells, x, y, z, value):
    """Fill value (3 PADDED,) with W, |x_a| W,b and |x_a| W,c of each column; return face, x_a, u and v."""
    face, xa, u, v, cell, s, t = locate(x, y, z, cells)
    sign = math.copysign(1.0, xa)
    for column in range(PADDED):
        g, g_s, g_t = horner(table, cell, column, s, t)
        value[column], value[PADDED + column], value[2 * PADDED + column] = sign * g, cells * g_s, cells * g_t
    return face, xa, u, v


@njit(cache=True, nogil=True, error_model="numpy")
def heat_source(table, cells, offset, direction, w_out, slope_out):
    """Write W and direction . grad W, (n, 5) each, for offset and direction (n, 3)."""
    value = np.empty(3 * PADDED)
    for point in range(len(offset)):
        face, xa, u, v = _at_point(table, cells, offset[point, 0], offset[point, 1], offset[point, 2], value)
        scale = 1.0 / abs(xa)
        a, b, c = direction[point, face], direction[point, (face + 1) % 3], direction[point, (face + 2) % 3]
        along_u, along_v = scale * (b - a * u), scale * (c - a * v)
        for column in range(COLUMNS):
            w_out[point, column] = value[column]
            slope_out[point, column] = along_u * value[PADDED + column] + along_v * value[2 * PADDED + column]


@njit(cache=True, nogil=True, error_model="numpy")
def heat_source_sums(table, cells, offset, direction, weights, starts, w_out, slope_out):
    """Write sums, (m, k, 5), of weights (n, k) times W and direction . grad W over the points of each piece.

    Piece e has the points starts[e] to starts[e + 1] and one direction, (m, 3).
    """
    value = np.empty(3 * PADDED)
    w_out[:] = 0.0
    slope_out[:] = 0.0
    for piece in range(len(direction)):
        for point in range(starts[piece], starts[piece + 1]):
            face, xa, u, v = _at_point(table, cells, offset[point, 0], offset[point, 1], offset[point, 2], value)
            scale = 1.0 / abs(xa)
            a, b, c = direction[piece, face], direction[piece, (face + 1) % 3], direction[piece, (face + 2) % 3]
            along_u, along_v = scale * (b - a * u), scale * (c - a * v)
            for node in range(weights.shape[1]):
                weight = weights[point, node]
                for column in range(COLUMNS):
                    w_out[piece, node, column] += weight * value[column]
                    slope = along_u * value[PADDED + column] + along_v * value[2 * PADDED + column]
                    slope_out[piece, node, column] += weight * slope
