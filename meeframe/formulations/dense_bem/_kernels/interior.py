"""Quadrature points on a surface seen from a point inside, with densities of the interior representation."""

import numpy as np
from numba import njit

from meeframe.elements._kernels.quadrature import BUFFER_TOO_SMALL, element_rule


@njit(cache=True, nogil=True)
def _power(base, exponent):
    value = 1.0
    for _ in range(exponent):
        value *= base
    return value


@njit(cache=True, nogil=True)
def surface_points(
    source, nodes, values, fluxes, table, accuracy, gauss, first, reference, weights, offsets, areas, t, moments, curls
):
    """Fill the buffers with the points of the adaptive rules on the elements of a block, from `first` on.

    source: (3,); nodes: (e, k, 3); values, fluxes: (e, k, f) at the nodes; table: of the element; reference (c, 2),
    weights (c,): scratch for the rule of one element. With the reference weight w, the buffers receive offsets (c, 3),
    areas (c, 3) = w x_xi cross x_eta, t (c, f) times the length of that, moments (c, 3, f) = areas u, and curls
    (c, 3, f) = w (x_eta u_xi - x_xi u_eta). Returns the number of points, or the negative code of element_rule if the
    source lies on an element, and the first element whose points do not fit, e if there is none.
    """
    n_monomials, n_nodes, n_fields = len(table.exponents), nodes.shape[1], values.shape[2]
    polynomial = np.empty((n_monomials, 3 + 2 * n_fields))
    at = np.empty((3, 3 + 2 * n_fields))
    no_xi = np.full(2, np.nan)
    count = 0
    for element in range(first, len(nodes)):
        n = element_rule(
            source,
            nodes[element],
            table,
            no_xi,
            accuracy.tolerance,
            gauss,
            reference,
            weights,
            accuracy.anisotropy,
        )
        if n == BUFFER_TOO_SMALL or count + n > len(offsets):
            return count, element
        if n < 0:
            return n, element
        polynomial[:] = 0.0
        for k in range(n_monomials):
            for a in range(n_nodes):
                c = table.coefficients[a, k]
                for axis in range(3):
                    polynomial[k, axis] += c * nodes[element, a, axis]
                for field in range(n_fields):
                    polynomial[k, 3 + field] += c * values[element, a, field]
                    polynomial[k, 3 + n_fields + field] += c * fluxes[element, a, field]
        for point in range(n):
            xi, eta, w = reference[point, 0], reference[point, 1], weights[point]
            at[:] = 0.0  # position, value and flux, then their derivatives by xi and eta
            for k in range(n_monomials):
                i, j = table.exponents[k, 0], table.exponents[k, 1]
                along_xi, along_eta = _power(xi, i), _power(eta, j)
                slope_xi = i * _power(xi, i - 1) * along_eta if i > 0 else 0.0
                slope_eta = j * _power(eta, j - 1) * along_xi if j > 0 else 0.0
                for column in range(at.shape[1]):
                    at[0, column] += along_xi * along_eta * polynomial[k, column]
                    at[1, column] += slope_xi * polynomial[k, column]
                    at[2, column] += slope_eta * polynomial[k, column]
            total = 0.0
            for axis in range(3):
                b, c = (axis + 1) % 3, (axis + 2) % 3
                offsets[count, axis] = at[0, axis] - source[axis]
                areas[count, axis] = w * (at[1, b] * at[2, c] - at[1, c] * at[2, b])
                total += areas[count, axis] ** 2
            total = np.sqrt(total)
            for field in range(n_fields):
                t[count, field] = total * at[0, 3 + n_fields + field]
                for axis in range(3):
                    moments[count, axis, field] = areas[count, axis] * at[0, 3 + field]
                    curls[count, axis, field] = w * (at[2, axis] * at[1, 3 + field] - at[1, axis] * at[2, 3 + field])
            count += 1
    return count, len(nodes)


@njit(cache=True, nogil=True)
def view(offsets, areas):
    """Return the least distance and the solid angle of points with offsets (n, 3) and areas (n, 3)."""
    least, angle = np.inf, 0.0
    for point in range(len(offsets)):
        x, y, z = offsets[point]
        a, b, c = areas[point]
        square = x * x + y * y + z * z
        least = min(least, square)
        angle += (x * a + y * b + z * c) / (square * np.sqrt(square))
    return np.sqrt(least), angle


@njit(cache=True, nogil=True, fastmath={"contract"})
def add_points(slopes, offsets, t, from_values, from_curls, result):
    """Subtract from result (f, 4), a value and its gradient, the sums over points of U_JK,l times its densities.

    slopes: (n, f, f, 3), the derivatives U_JK,l; offsets: (n, 3); t: (n, f); from_values (n, f, 3), from_curls
    (n, f, 3, 3): densities of the value, and of the gradient with its direction last, to which those of t are added.
    U is homogeneous of degree -1, so that U_JK = - x_l U_JK,l.
    """
    n_fields = t.shape[1]
    for point in range(len(t)):
        for j in range(n_fields):
            load = t[point, j]
            for axis in range(3):
                of_value = from_values[point, j, axis] + offsets[point, axis] * load
                a, b, c = from_curls[point, j, axis]
                a += load if axis == 0 else 0.0
                b += load if axis == 1 else 0.0
                c += load if axis == 2 else 0.0
                for k in range(n_fields):
                    slope = slopes[point, j, k, axis]
                    result[k, 0] -= slope * of_value
                    result[k, 1] -= slope * a
                    result[k, 2] -= slope * b
                    result[k, 3] -= slope * c
