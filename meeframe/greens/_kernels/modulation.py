"""U, T and U,q from the direction-dependent part of a fundamental solution, its modulation.

At x = r e, with (n, m, e) a right-handed orthonormal triad, every fundamental solution has the form
    4 pi r U = H,    4 pi r^2 U,q = n_q A + m_q B - e_q H,
with symmetric 5x5 matrices H, A, B that depend on the direction alone: A and B are the tangential derivatives of H
(eqs. 42, 48, 49). They are packed as the 15 entries of the upper triangle, row by row.

The number of fields is that of the default field set, for which some inner loops of these kernels are written out.
"""

import math

import numpy as np
from numba import njit

from meeframe.fields import N_FIELDS

N_PAIRS, N_PACKED = N_FIELDS**2, N_FIELDS * (N_FIELDS + 1) // 2
# Module constants of NumPy types are compiled in as constants.
PACKED = np.empty((N_FIELDS, N_FIELDS), np.int64)
PACKED[np.triu_indices(N_FIELDS)] = PACKED.T[np.triu_indices(N_FIELDS)] = np.arange(N_PACKED)


@njit(cache=True, nogil=True)
def triads(offset):
    """Return the distances (n,) and triads (n, 3, 3) with rows n, m, e for offset (n, 3)."""
    distance = np.empty(offset.shape[0])
    triad = np.empty((offset.shape[0], 3, 3))
    for point in range(offset.shape[0]):
        x, y, z = offset[point]
        scale = max(abs(x), abs(y), abs(z))
        x, y, z = x / scale, y / scale, z / scale
        length = math.sqrt(x * x + y * y + z * z)
        x, y, z = x / length, y / length, z / length
        distance[point] = scale * length
        # The axis that is least aligned with e gives a well-conditioned n.
        if abs(x) <= abs(y) and abs(x) <= abs(z):
            nx, ny, nz = 0.0, z, -y
        elif abs(y) <= abs(z):
            nx, ny, nz = -z, 0.0, x
        else:
            nx, ny, nz = y, -x, 0.0
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx / length, ny / length, nz / length
        frame = triad[point]
        frame[0, 0], frame[0, 1], frame[0, 2] = nx, ny, nz
        frame[1, 0], frame[1, 1], frame[1, 2] = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
        frame[2, 0], frame[2, 1], frame[2, 2] = x, y, z
    return distance, triad


@njit(cache=True, nogil=True)
def contract(stiffness, a, b, out):
    """Fill out (5, 5) with C_iJKm a_i b_m, for stiffness (3, 5, 5, 3)."""
    for j in range(N_FIELDS):
        for k in range(N_FIELDS):
            total = 0.0
            for i in range(3):
                for m in range(3):
                    total += stiffness[i, j, k, m] * a[i] * b[m]
            out[j, k] = total


@njit(cache=True, nogil=True)
def displacement_and_traction(stiffness, normal, distance, triad, modulation):
    """Return U and T, (n, 5, 5) each, from the modulation (n, 3, 15) = H, A, B (eqs. 42, 47)."""
    count = distance.shape[0]
    u = np.empty((count, N_FIELDS, N_FIELDS))
    t = np.empty((count, N_FIELDS, N_FIELDS))
    row = np.empty((3, N_FIELDS, N_FIELDS))
    for point in range(count):
        r = distance[point]
        frame = triad[point]
        h, a, b = modulation[point]
        for axis in range(3):
            contract(stiffness, normal[point], frame[axis], row[axis])
        for j in range(N_FIELDS):
            for k in range(N_FIELDS):
                total = 0.0
                for m in range(N_FIELDS):
                    entry = PACKED[m, k]
                    total += row[0, j, m] * a[entry] + row[1, j, m] * b[entry] - row[2, j, m] * h[entry]
                t[point, j, k] = total / (4.0 * math.pi * r * r)
                u[point, j, k] = h[PACKED[j, k]] / (4.0 * math.pi * r)
    return u, t


@njit(cache=True, nogil=True)
def displacement_gradient(distance, triad, modulation):
    """Return U,q, (n, 5, 5, 3), from the modulation (n, 3, 15) = H, A, B (eq. 48)."""
    gradient = np.empty((distance.shape[0], N_FIELDS, N_FIELDS, 3))
    for point in range(distance.shape[0]):
        r = distance[point]
        n, m, e = triad[point]
        h, a, b = modulation[point]
        for j in range(N_FIELDS):
            for k in range(N_FIELDS):
                entry = PACKED[j, k]
                for q in range(3):
                    value = n[q] * a[entry] + m[q] * b[entry] - e[q] * h[entry]
                    gradient[point, j, k, q] = value / (4.0 * math.pi * r * r)
    return gradient
