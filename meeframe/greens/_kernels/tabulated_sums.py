"""Sums of the tabulated fundamental solution over the points of plane pieces of surface."""

import math

import numpy as np
from numba import njit

from meeframe.fields import N_FIELDS
from meeframe.greens._kernels.modulation import N_PAIRS
from meeframe.greens._kernels.tabulated import PACKED_FLAT, WIDTH, horner, locate


@njit(cache=True, nogil=True, fastmath={"contract"})
def _field(table, cell, s, t, factors, field):
    """Fill field (64,) with U and its derivatives along the axes a, b, c of a face, packed, 16 columns each.

    factors: those of G in U, of G in U,a, of G_s in U,a and in U,b, of G_t in U,a and in U,c.
    """
    scale, along, along_s, steep_s, along_t, steep_t = factors
    for column in range(WIDTH):
        g, g_s, g_t = horner(table, cell, column, s, t)
        field[column] = scale * g
        field[WIDTH + column] = along * g + along_s * g_s + along_t * g_t
        field[2 * WIDTH + column] = steep_s * g_s
        field[3 * WIDTH + column] = steep_t * g_t


@njit(cache=True, nogil=True, error_model="numpy")
def _at_point(table, cells, offset, field):
    """Fill field (64,) as _field does and return the face."""
    face, xa, u, v, cell, s, t = locate(offset[0], offset[1], offset[2], cells)
    scale = 0.25 / (math.pi * abs(xa))
    steep = scale / xa
    slope = steep * cells
    _field(table, cell, s, t, (scale, -steep, -u * slope, slope, -v * slope, slope), field)
    return face


@njit(cache=True, nogil=True, fastmath={"contract"})
def _contract_normal(coefficients, normal, contracted):
    """Fill contracted (75,) with C_iJMl n_i as [l, J, M], for coefficients (225,) as in tabulated.tractions."""
    x, y, z = normal
    for q in range(N_PAIRS):
        for axis in range(3):
            o = 9 * q + 3 * axis
            contracted[N_PAIRS * axis + q] = coefficients[o] * x + coefficients[o + 1] * y + coefficients[o + 2] * z


@njit(cache=True, nogil=True, fastmath={"contract"})
def _add_tractions(contracted, sums, spread, line, t_out):
    """Add to t_out (k, 25) the tractions on a plane that belong to sums of derivatives (k, 64).

    contracted: (75,) from _contract_normal; spread (3, 5, 8 k) and line (8 k,) are scratch, with five of eight entries
    in use.
    """
    n_nodes = len(sums)
    for node in range(n_nodes):
        for axis in range(3):
            for q in range(N_PAIRS):
                spread[axis, q // N_FIELDS, 8 * node + q % N_FIELDS] = sums[node, WIDTH * (1 + axis) + PACKED_FLAT[q]]
    for j in range(N_FIELDS):
        line[:] = 0.0
        for axis in range(3):
            o = N_PAIRS * axis + N_FIELDS * j
            c0, c1, c2, c3, c4 = (
                contracted[o],
                contracted[o + 1],
                contracted[o + 2],
                contracted[o + 3],
                contracted[o + 4],
            )
            r = spread[axis]
            for i in range(len(line)):
                line[i] += c0 * r[0, i] + c1 * r[1, i] + c2 * r[2, i] + c3 * r[3, i] + c4 * r[4, i]
        for node in range(n_nodes):
            for k in range(N_FIELDS):
                t_out[node, N_FIELDS * j + k] += line[8 * node + k]


@njit(cache=True, nogil=True, fastmath={"contract"})
def integrate(table, cells, coefficients, offset, weights, starts, normals, u_out, t_out):
    """Write sums, (m, k, 25), of weights (n, k) times U and T over points starts[e] to starts[e + 1] of piece e.

    offset (n, 3), starts (m + 1,), normals (m, 3); coefficients (3, 225): for each face as in tabulated.tractions.
    Derivatives are summed, face by face, before they are contracted with stiffness and normal, once for each piece and
    not at every point.
    """
    n_nodes = weights.shape[1]
    field, contracted = np.empty(4 * WIDTH), np.empty((3, 3 * N_PAIRS))
    sums, spread, line = np.empty((3, n_nodes, 4 * WIDTH)), np.zeros((3, N_FIELDS, 8 * n_nodes)), np.empty(8 * n_nodes)
    used = np.zeros(3, np.bool_)
    for piece in range(len(normals)):
        u_out[piece] = 0.0
        t_out[piece] = 0.0
        for point in range(starts[piece], starts[piece + 1]):
            face = _at_point(table, cells, offset[point], field)
            if not used[face]:
                used[face] = True
                sums[face] = 0.0
            for node in range(n_nodes):
                weight = weights[point, node]
                for i in range(4 * WIDTH):
                    sums[face, node, i] += weight * field[i]
        previous = normals[max(piece - 1, 0)]
        x, y, z = normals[piece]
        if piece == 0 or x != previous[0] or y != previous[1] or z != previous[2]:
            for face in range(3):
                _contract_normal(coefficients[face], normals[piece], contracted[face])
        for face in range(3):
            if used[face]:
                used[face] = False
                for node in range(n_nodes):
                    for q in range(N_PAIRS):
                        u_out[piece, node, q] += sums[face, node, PACKED_FLAT[q]]
                _add_tractions(contracted[face], sums[face], spread, line, t_out[piece])
