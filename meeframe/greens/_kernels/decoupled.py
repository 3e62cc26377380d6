"""Decoupled scalar fields: the solution of the Laplace equation, and matrices of all fields.

Matrices of f fields are flat, with entry (J, K) in column f J + K.
"""

import math

import numpy as np
from numba import njit

from meeframe.fields import N_FIELDS


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _at_point(inverse, factor, x, normal):
    """Return U and T at an offset x (3,), with the inverse (3, 3) of k and factor = -1 / (4 pi sqrt(det k))."""
    square = 0.0
    for i in range(3):
        for j in range(3):
            square += x[i] * inverse[i, j] * x[j]
    u = factor / math.sqrt(square)
    return u, u * (x[0] * normal[0] + x[1] * normal[1] + x[2] * normal[2]) / square


@njit(cache=True, nogil=True, error_model="numpy")
def laplace(inverse, factor, offset, normal):
    """Return U and T, (n,) each, for offset and normal (n, 3)."""
    u, t = np.empty(len(offset)), np.empty(len(offset))
    for point in range(len(offset)):
        u[point], t[point] = _at_point(inverse, factor, offset[point], normal[point])
    return u, t


@njit(cache=True, nogil=True, error_model="numpy")
def laplace_sums(inverse, factor, offset, weights, starts, normals):
    """Return sums (m, k) of weights (n, k) times U and T over the points starts[e] to starts[e + 1] of piece e."""
    u_sums, t_sums = np.zeros((len(normals), weights.shape[1])), np.zeros((len(normals), weights.shape[1]))
    for piece in range(len(normals)):
        for point in range(starts[piece], starts[piece + 1]):
            u, t = _at_point(inverse, factor, offset[point], normals[piece])
            for node in range(weights.shape[1]):
                u_sums[piece, node] += weights[point, node] * u
                t_sums[piece, node] += weights[point, node] * t
    return u_sums, t_sums


@njit(cache=True, nogil=True)
def combine(coupled, count, diagonal):
    """Return matrices (n, f^2) with the first count^2 entries of coupled (n, 25) and a diagonal (f - count, n)."""
    size = count + len(diagonal)
    combined = np.empty((len(coupled), size * size))
    for point in range(len(coupled)):
        row = combined[point]
        row[:] = 0.0
        for j in range(count):
            for k in range(count):
                row[size * j + k] = coupled[point, N_FIELDS * j + k]
        for scalar in range(len(diagonal)):
            row[(size + 1) * (count + scalar)] = diagonal[scalar, point]
    return combined
