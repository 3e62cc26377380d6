"""Sums of spherical harmonics of odd degree at many directions.

Directions are processed in groups of LANES, over which the compiler vectorises.
"""

import math

import numpy as np
from numba import njit

LANES = 32


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def odd_sums(cosines, sines, directions, out):
    """Write sums of P_lm(z) (cosines[m, l] cos(m phi) + sines[m, l] sin(m phi)) over odd l, (n, k).

    cosines, sines: (degree + 1, degree + 1, k); directions: unit vectors (n, 3). The functions P_lm are normalised so
    that P_lm cos(m phi) has mean square 1 / (4 pi) over the sphere; recurrence over l.
    """
    n_orders, _, n_columns = cosines.shape
    height, radius, cos_step, sin_step, cos_order, sin_order = np.zeros((6, LANES))
    sectoral, last, before, following = np.zeros((4, LANES))
    along_cosine, along_sine = np.zeros((2, n_columns, LANES))
    for first in range(0, len(directions), LANES):
        count = min(LANES, len(directions) - first)
        for p in range(count):
            x, y, z = directions[first + p]
            rho = math.sqrt(x * x + y * y)
            height[p], radius[p] = z, rho
            cos_step[p], sin_step[p] = (x / rho, y / rho) if rho > 0.0 else (1.0, 0.0)
        cos_order[:], sin_order[:] = 1.0, 0.0
        sectoral[:] = 1.0 / math.sqrt(4.0 * math.pi)
        out[first : first + count] = 0.0
        for m in range(n_orders):
            if m > 0:
                step = math.sqrt((2 * m + 1) / (2 * m) * (2.0 if m == 1 else 1.0))
                for p in range(LANES):
                    sectoral[p] *= step * radius[p]
                    c, s = cos_order[p], sin_order[p]
                    cos_order[p] = c * cos_step[p] - s * sin_step[p]
                    sin_order[p] = s * cos_step[p] + c * sin_step[p]
            along_cosine[:], along_sine[:] = 0.0, 0.0
            last[:], before[:] = sectoral, 0.0
            for n in range(m, n_orders):
                if n > m:
                    a = math.sqrt((2 * n - 1) * (2 * n + 1) / ((n - m) * (n + m)))
                    b = 0.0
                    if n > m + 1:
                        b = math.sqrt((2 * n + 1) * (n + m - 1) * (n - m - 1) / ((n - m) * (n + m) * (2 * n - 3)))
                    for p in range(LANES):
                        following[p] = a * height[p] * last[p] - b * before[p]
                        before[p] = last[p]
                        last[p] = following[p]
                if n % 2:
                    for column in range(n_columns):
                        c, s = cosines[m, n, column], sines[m, n, column]
                        for p in range(LANES):
                            along_cosine[column, p] += c * last[p]
                            along_sine[column, p] += s * last[p]
            for column in range(n_columns):
                for p in range(count):
                    out[first + p, column] += (
                        cos_order[p] * along_cosine[column, p] + sin_order[p] * along_sine[column, p]
                    )
