"""Action of heat on the other fields, interpolated on the faces of a cube; see tabulated for faces and cells.

With W odd and of degree 0, W = sign(x_a) G(u, v), and
    |x_a| W,b = G_u,   |x_a| W,c = G_v,   |x_a| W,a = -(u G_u + v G_v).
"""

import math

import numpy as np
from numba import njit

from meeframe.fields import N_FIELDS
from meeframe.greens._kernels.tabulated import WIDTH, horner, locate


@njit(cache=True, nogil=True, fastmath={"contract"})
def _interpolate(table, cell, s, t, factors, value):
    """Fill value (2 WIDTH,) with W and direction . grad W; factors: those of G in W and of G_s, G_t in the slope.

    All columns of the table are interpolated, though few are in use: of 8 columns the compiler would make no vector.
    """
    sign, along_s, along_t = factors
    for column in range(WIDTH):
        g, g_s, g_t = horner(table, cell, column, s, t)
        value[column] = sign * g
        value[WIDTH + column] = along_s * g_s + along_t * g_t


@njit(cache=True, nogil=True, error_model="numpy")
def _at_point(table, cells, offset, direction, value):
    """Fill value (2 WIDTH,) with W and direction . grad W at an offset, for offset and direction (3,)."""
    face, xa, u, v, cell, s, t = locate(offset[0], offset[1], offset[2], cells)
    scale = cells / abs(xa)
    a, b, c = direction[face], direction[(face + 1) % 3], direction[(face + 2) % 3]
    factors = math.copysign(1.0, xa), scale * (b - a * u), scale * (c - a * v)
    _interpolate(table, cell, s, t, factors, value)


@njit(cache=True, nogil=True)
def heat_source(table, cells, offset, direction, first, u_out, t_out):
    """Write W and -direction . grad W into 5 columns of u_out, t_out (n, .), for offset and direction (n, 3)."""
    value = np.empty(2 * WIDTH)
    for point in range(len(offset)):
        _at_point(table, cells, offset[point], direction[point], value)
        for column in range(N_FIELDS):
            u_out[point, first + column], t_out[point, first + column] = value[column], -value[WIDTH + column]


@njit(cache=True, nogil=True, fastmath={"contract"})
def heat_source_sums(table, cells, offset, direction, weights, starts, first, u_out, t_out):
    """Write sums of weights (n, k) times W and -direction . grad W into 5 columns of u_out, t_out (m, k, .).

    Piece e has the points starts[e] to starts[e + 1] and one direction, (m, 3).
    """
    value, sums = np.empty(2 * WIDTH), np.empty((weights.shape[1], 2 * WIDTH))
    for piece in range(len(direction)):
        sums[:] = 0.0
        for point in range(starts[piece], starts[piece + 1]):
            _at_point(table, cells, offset[point], direction[piece], value)
            for node in range(weights.shape[1]):
                weight = weights[point, node]
                for entry in range(2 * WIDTH):
                    sums[node, entry] += weight * value[entry]
        for node in range(weights.shape[1]):
            for column in range(N_FIELDS):
                u_out[piece, node, first + column] = sums[node, column]
                t_out[piece, node, first + column] = -sums[node, WIDTH + column]
