"""Shape functions and geometry of one element, without allocations per point."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import njit


class ShapeTable(NamedTuple):
    """An element type as arrays.

    Attributes
    ----------
    exponents : ndarray
        Exponents of the monomials, (k, 2), int64.
    coefficients : ndarray
        Coefficients of the shape functions in the monomials, (n, k).
    nodes : ndarray
        Reference coordinates of the nodes, (n, 2).
    triangle : bool
        True for the reference domain with corners (0, 0), (1, 0), (0, 1), false for [-1, 1]^2.
    """

    exponents: np.ndarray
    coefficients: np.ndarray
    nodes: np.ndarray
    triangle: bool


@njit(cache=True, nogil=True)
def _power(base, exponent):
    value = 1.0
    for _ in range(exponent):
        value *= base
    return value


@njit(cache=True, nogil=True)
def geometry_polynomial(table, nodes, out):
    """Fill out (k, 3) such that position = sum_k out[k] xi^i eta^j on an element with nodes (n, 3)."""
    for k in range(table.exponents.shape[0]):
        for axis in range(3):
            total = 0.0
            for n in range(nodes.shape[0]):
                total += table.coefficients[n, k] * nodes[n, axis]
            out[k, axis] = total


@njit(cache=True, nogil=True)
def position_at(table, polynomial, xi, eta):
    """Return the position (x, y, z) at a reference point."""
    x = y = z = 0.0
    for k in range(table.exponents.shape[0]):
        value = _power(xi, table.exponents[k, 0]) * _power(eta, table.exponents[k, 1])
        x += value * polynomial[k, 0]
        y += value * polynomial[k, 1]
        z += value * polynomial[k, 2]
    return x, y, z


@njit(cache=True, nogil=True)
def tangent_at(table, polynomial, xi, eta, along_xi, along_eta):
    """Return the derivative of the position in the reference direction (along_xi, along_eta)."""
    x = y = z = 0.0
    for k in range(table.exponents.shape[0]):
        i = table.exponents[k, 0]
        j = table.exponents[k, 1]
        value = 0.0
        if i > 0:
            value += along_xi * i * _power(xi, i - 1) * _power(eta, j)
        if j > 0:
            value += along_eta * j * _power(xi, i) * _power(eta, j - 1)
        x += value * polynomial[k, 0]
        y += value * polynomial[k, 1]
        z += value * polynomial[k, 2]
    return x, y, z


@njit(cache=True, nogil=True)
def normal_at(table, polynomial, xi, eta):
    """Return the vector Jacobian x_xi x x_eta, outward, whose length is the ratio of areas."""
    ax, ay, az = tangent_at(table, polynomial, xi, eta, 1.0, 0.0)
    bx, by, bz = tangent_at(table, polynomial, xi, eta, 0.0, 1.0)
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(cache=True, nogil=True)
def shapes_at(table, xi, eta, out):
    """Fill out (n,) with the shape functions at a reference point."""
    out[:] = 0.0
    for k in range(table.exponents.shape[0]):
        value = _power(xi, table.exponents[k, 0]) * _power(eta, table.exponents[k, 1])
        for n in range(out.shape[0]):
            out[n] += value * table.coefficients[n, k]


@njit(cache=True, nogil=True)
def map_rule(table, nodes, points, weights, positions, normals, measures, shapes):
    """Map a rule from the reference domain to an element.

    Parameters
    ----------
    table : ShapeTable
        Element type.
    nodes : ndarray
        Positions of the nodes of the element, (n, 3).
    points : ndarray
        Reference coordinates of the rule, (m, 2).
    weights : ndarray
        Weights of the rule, (m,).
    positions : ndarray
        Positions, (m, 3), filled.
    normals : ndarray
        Unit normals, (m, 3), outward by the right-hand rule of the node order, filled.
    measures : ndarray
        Weights times area ratios, (m,), filled.
    shapes : ndarray
        Shape functions, (m, n), filled.
    """
    polynomial = np.empty((table.exponents.shape[0], 3))
    geometry_polynomial(table, nodes, polynomial)
    for m in range(points.shape[0]):
        xi, eta = points[m, 0], points[m, 1]
        positions[m, 0], positions[m, 1], positions[m, 2] = position_at(table, polynomial, xi, eta)
        x, y, z = normal_at(table, polynomial, xi, eta)
        area = sqrt(x * x + y * y + z * z)
        normals[m, 0], normals[m, 1], normals[m, 2] = x / area, y / area, z / area
        measures[m] = weights[m] * area
        shapes_at(table, xi, eta, shapes[m])
