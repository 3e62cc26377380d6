"""H and its tangential derivatives as means over the half circle normal to a direction (Barnett; notes, section 6)."""

import math

import numpy as np
from numba import njit

from meeframe.kernels.modulation import PACKED, contract


@njit(cache=True, nogil=True)
def _invert(matrix):
    """Inverse in place of a symmetric 5x5 matrix with definite mechanical and electromagnetic blocks of opposite sign.

    Such matrices have nonzero pivots in any order, so no pivoting is needed. Returns False where a pivot is not.
    """
    for k in range(5):
        pivot = matrix[k, k]
        if not abs(pivot) > 0.0:
            return False
        pivot = 1.0 / pivot
        matrix[k, k] = 1.0
        for j in range(5):
            matrix[k, j] *= pivot
        for i in range(5):
            if i != k:
                factor = matrix[i, k]
                matrix[i, k] = 0.0
                for j in range(5):
                    matrix[i, j] -= factor * matrix[k, j]
    return True


@njit(cache=True, nogil=True)
def _add_angles(forms, first, step, count, with_tangents, total, inverse, product):
    """Add to total (3, 15) the integrands G^-1, cos F, sin F at angles first + k step; False if G is singular."""
    for node in range(count):
        angle = first + node * step
        c, s = math.cos(angle), math.sin(angle)
        for i in range(5):
            for j in range(5):
                inverse[i, j] = c * c * forms[0, i, j] + c * s * forms[1, i, j] + s * s * forms[2, i, j]
        if not _invert(inverse):
            return False
        for i in range(5):
            for j in range(i, 5):
                total[0, PACKED[i, j]] += inverse[i, j]
        if with_tangents:
            for i in range(5):
                for j in range(5):
                    value = 0.0
                    for k in range(5):
                        value += inverse[i, k] * (c * forms[3, k, j] + s * forms[4, k, j])
                    product[i, j] = value
            for i in range(5):
                for j in range(i, 5):
                    value = 0.0
                    for k in range(5):
                        value += product[i, k] * inverse[k, j]
                    total[1, PACKED[i, j]] += c * value
                    total[2, PACKED[i, j]] += s * value
    return True


@njit(cache=True, nogil=True)
def line_integrals(stiffness, triad, points, most_points, tolerance, with_tangents):
    """Modulation (n, 3, 15) = H, A, B on triads (n, 3, 3), and whether all of them converged.

    The trapezoidal rule starts with half of points and doubles, keeping its nodes, until it changes by less than the
    tolerance, relative to the largest entry. Without tangents A and B are left zero.
    """
    n = triad.shape[0]
    modulation = np.zeros((n, 3, 15))
    forms = np.empty((5, 5, 5))
    inverse, product = np.empty((5, 5)), np.empty((5, 5))
    total = np.empty((3, 15))
    rows = 3 if with_tangents else 1
    for point in range(n):
        axis_n, axis_m, axis_e = triad[point]
        contract(stiffness, axis_n, axis_n, forms[0])
        contract(stiffness, axis_n, axis_m, forms[1])
        contract(stiffness, axis_m, axis_m, forms[2])
        contract(stiffness, axis_n, axis_e, forms[3])
        contract(stiffness, axis_m, axis_e, forms[4])
        for form in (1, 3, 4):
            forms[form] += forms[form].T.copy()
        total[:] = 0.0
        count = points // 2
        step = math.pi / count
        if not _add_angles(forms, 0.0, step, count, with_tangents, total, inverse, product):
            return modulation, False
        change = math.inf
        while change > tolerance:
            if count > most_points:
                return modulation, False
            previous = total / count
            if not _add_angles(forms, 0.5 * step, step, count, with_tangents, total, inverse, product):
                return modulation, False
            count *= 2
            step *= 0.5
            new = total[:rows] / count
            change = np.abs(new - previous[:rows]).max() / np.abs(new).max()
        modulation[point] = total / count
    return modulation, True
