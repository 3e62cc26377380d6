"""Sums of the tabulated fundamental solution (meeframe.greens._kernels.tabulated) over points of plane pieces of
surface."""

import math

import numpy as np
from numba import njit

from meeframe.greens._kernels.tabulated import FLAT, WIDTH, horner, locate


@njit(cache=True, nogil=True, fastmath={"contract"})
def _field(table, cell, s, t, place, field):
    """Return U and its derivatives along the axes a, b, c of a face into field (64,), packed, 16 columns each.

    place: scale of G in U, of G in U,a, of G_s in U,a and in U,b, of G_t in U,a and in U,c.
    """
    scale, along, along_s, steep_s, along_t, steep_t = place
    for column in range(WIDTH):
        g, g_s, g_t = horner(table, cell, column, s, t)
        field[column] = scale * g
        field[WIDTH + column] = along * g + along_s * g_s + along_t * g_t
        field[2 * WIDTH + column] = steep_s * g_s
        field[3 * WIDTH + column] = steep_t * g_t


@njit(cache=True, nogil=True, error_model="numpy")
def _at_point(table, cells, offset, field):
    """Fill field (64,) as _field; returns the face."""
    face, xa, u, v, cell, s, t = locate(offset[0], offset[1], offset[2], cells)
    scale = 0.25 / (math.pi * abs(xa))
    steep = scale / xa
    slope = steep * cells
    _field(table, cell, s, t, (scale, -steep, -u * slope, slope, -v * slope, slope), field)
    return face


@njit(cache=True, nogil=True, fastmath={"contract"})
def _turn(coefficients, normal, turned):
    """Return C_iJMl n_i as [l, J, M] into turned (75,), for coefficients (225,) as in tabulated.tractions."""
    x, y, z = normal
    for q in range(25):
        for part in range(3):
            o = 9 * q + 3 * part
            turned[25 * part + q] = coefficients[o] * x + coefficients[o + 1] * y + coefficients[o + 2] * z


@njit(cache=True, nogil=True, fastmath={"contract"})
def _add_tractions(turned, sums, spread, row, t_out):
    """Add to t_out (k, 25) the tractions of summed derivatives sums (k, 64) on a plane; turned (75,) as of _turn.

    spread (3, 5, 8 k) and row (8 k,) are scratch, five of eight in use.
    """
    n_nodes = len(sums)
    for node in range(n_nodes):
        for part in range(3):
            for q in range(25):
                spread[part, q // 5, 8 * node + q % 5] = sums[node, WIDTH * (1 + part) + FLAT[q]]
    for j in range(5):
        row[:] = 0.0
        for part in range(3):
            o = 25 * part + 5 * j
            c0, c1, c2, c3, c4 = turned[o], turned[o + 1], turned[o + 2], turned[o + 3], turned[o + 4]
            r = spread[part]
            for i in range(len(row)):
                row[i] += c0 * r[0, i] + c1 * r[1, i] + c2 * r[2, i] + c3 * r[3, i] + c4 * r[4, i]
        for node in range(n_nodes):
            for k in range(5):
                t_out[node, 5 * j + k] += row[8 * node + k]


@njit(cache=True, nogil=True, fastmath={"contract"})
def integrate(table, cells, coefficients, offset, weights, starts, normals, u_out, t_out):
    """Write sums of weights (n, k) times U and T at points starts[e]..starts[e + 1] of plane pieces e, (m, k, 25).

    offset (n, 3), starts (m + 1,), normals (m, 3); coefficients (3, 225) per face as in tabulated.tractions. A
    derivative is summed, face by face, before it is contracted with stiffness and normal: a piece costs that once and
    not at every point.
    """
    n_nodes = weights.shape[1]
    field, turned = np.empty(4 * WIDTH), np.empty((3, 75))
    sums, spread, row = np.empty((3, n_nodes, 4 * WIDTH)), np.zeros((3, 5, 8 * n_nodes)), np.empty(8 * n_nodes)
    found = np.zeros(3, np.bool_)
    for piece in range(len(normals)):
        u_out[piece] = 0.0
        t_out[piece] = 0.0
        for point in range(starts[piece], starts[piece + 1]):
            face = _at_point(table, cells, offset[point], field)
            if not found[face]:
                found[face] = True
                sums[face] = 0.0
            for node in range(n_nodes):
                weight = weights[point, node]
                for i in range(4 * WIDTH):
                    sums[face, node, i] += weight * field[i]
        before = normals[max(piece - 1, 0)]
        x, y, z = normals[piece]
        if piece == 0 or x != before[0] or y != before[1] or z != before[2]:
            for face in range(3):
                _turn(coefficients[face], normals[piece], turned[face])
        for face in range(3):
            if found[face]:
                found[face] = False
                for node in range(n_nodes):
                    for q in range(25):
                        u_out[piece, node, q] += sums[face, node, FLAT[q]]
                _add_tractions(turned[face], sums[face], spread, row, t_out[piece])
