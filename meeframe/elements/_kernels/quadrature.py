"""Quadrature over an element seen from a source: one adaptive rule for distant, near and singular elements.

A domain of integration is one or more bilinear *patches* (u, v) in [-1, 1]^2 of the reference domain; triangles are
patches with a collapsed edge. Each direction of a cell of a patch gets the order that quadrature_order finds; a cell
that would need too many points is halved across its longer side.

Singular elements, which contain the source, are split there into triangles with the collapsed edge (u = -1) at the
source (Duffy). With offset = rho g, rho = (1 + u) / 2, the remaining singularities are those of 1/|g|. The same
estimate, with g in place of the offset, therefore gives orders and halvings, for elongated and curved elements too.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from meeframe.elements._kernels.quadrature_order import (
    MODERATE_ANISOTROPY,
    cell_spreads,
    lengths_and_bulge,
    max_points_per_direction,
    normal_spread,
    order_for,
    required_orders,
    skew_lengths,
)
from meeframe.elements._kernels.shape import geometry_polynomial, normal_at, position_at, tangent_at

__all__ = [
    "BUFFER_TOO_SMALL",
    "SOURCE_ON_ELEMENT",
    "GaussTable",
    "element_extents",
    "element_rule",
    "rectangular_rule",
    "required_orders",
    "shape_degree",
]

BUFFER_TOO_SMALL = -1
"""Returned instead of the number of points if the arrays are too small for them."""
SOURCE_ON_ELEMENT = -2

_STACK_SIZE = 128
_MIN_CELL_SIZE = 1e-13


class GaussTable(NamedTuple):
    """Gauss-Legendre rules on [-1, 1]: row n of points and of weights (N + 1, N) holds the n-point rule."""

    points: np.ndarray
    weights: np.ndarray


@njit(cache=True, nogil=True)
def _reference_corners(triangle, out):
    """Fill out (4, 2) with the corners of the reference domain and return their number; triangles repeat the third."""
    if triangle:
        out[0, 0], out[0, 1], out[1, 0], out[1, 1] = 0.0, 0.0, 1.0, 0.0
        out[2, 0], out[2, 1], out[3, 0], out[3, 1] = 0.0, 1.0, 0.0, 1.0
        return 3
    out[0, 0], out[0, 1], out[1, 0], out[1, 1] = -1.0, -1.0, 1.0, -1.0
    out[2, 0], out[2, 1], out[3, 0], out[3, 1] = 1.0, 1.0, -1.0, 1.0
    return 4


@njit(cache=True, nogil=True)
def _bilinear(corners, u, v):
    a, b = 0.5 * (1.0 - u), 0.5 * (1.0 + u)
    c, d = 0.5 * (1.0 - v), 0.5 * (1.0 + v)
    xi = c * (a * corners[0, 0] + b * corners[1, 0]) + d * (b * corners[2, 0] + a * corners[3, 0])
    eta = c * (a * corners[0, 1] + b * corners[1, 1]) + d * (b * corners[2, 1] + a * corners[3, 1])
    return xi, eta


@njit(cache=True, nogil=True)
def _bilinear_area(corners, u, v):
    """Return the Jacobian determinant of the bilinear map, positive for corners in counter-clockwise order."""
    c, d = 0.25 * (1.0 - v), 0.25 * (1.0 + v)
    xi_u = c * (corners[1, 0] - corners[0, 0]) + d * (corners[2, 0] - corners[3, 0])
    eta_u = c * (corners[1, 1] - corners[0, 1]) + d * (corners[2, 1] - corners[3, 1])
    a, b = 0.25 * (1.0 - u), 0.25 * (1.0 + u)
    xi_v = a * (corners[3, 0] - corners[0, 0]) + b * (corners[2, 0] - corners[1, 0])
    eta_v = a * (corners[3, 1] - corners[0, 1]) + b * (corners[2, 1] - corners[1, 1])
    return xi_u * eta_v - eta_u * xi_v


@njit(cache=True, nogil=True)
def _offset(table, polynomial, source, corners, singular, u, v):
    """Return the offset from the source at (u, v), on singular elements over the distance from the collapsed edge."""
    xi, eta = _bilinear(corners, u, v)
    if singular and u <= -1.0:
        a, b = _bilinear(corners, 1.0, v)
        return tangent_at(table, polynomial, xi, eta, a - corners[0, 0], b - corners[0, 1])
    x, y, z = position_at(table, polynomial, xi, eta)
    scale = 2.0 / (1.0 + u) if singular else 1.0
    return scale * (x - source[0]), scale * (y - source[1]), scale * (z - source[2])


@njit(cache=True, nogil=True)
def _sample(table, polynomial, source, corners, singular, cell, offsets, normals):
    """Fill offsets (9, 3) on the 3 x 3 grid of a cell (u0, u1, v0, v1) and normals (4, 3) at its corners, v fastest."""
    for a in range(3):
        u = cell[0] + 0.5 * a * (cell[1] - cell[0])
        for b in range(3):
            v = cell[2] + 0.5 * b * (cell[3] - cell[2])
            k = 3 * a + b
            x, y, z = _offset(table, polynomial, source, corners, singular, u, v)
            offsets[k, 0], offsets[k, 1], offsets[k, 2] = x, y, z
            if a != 1 and b != 1:
                k = a + b // 2
                x, y, z = normal_at(table, polynomial, *_bilinear(corners, u, v))
                normals[k, 0], normals[k, 1], normals[k, 2] = x, y, z


@njit(cache=True, nogil=True)
def _normal_spreads(normals):
    along_u = along_v = np.inf
    for k in range(2):
        along_u = min(along_u, normal_spread(normals, k, k + 2))
        along_v = min(along_v, normal_spread(normals, 2 * k, 2 * k + 1))
    return along_u, along_v


@njit(cache=True, nogil=True)
def _emit(corners, cell, order_u, order_v, gauss, points, weights, count):
    """Append the tensor Gauss rule of a cell and return the new count, or BUFFER_TOO_SMALL."""
    if count + order_u * order_v > weights.shape[0]:
        return BUFFER_TOO_SMALL
    half_u, half_v = 0.5 * (cell[1] - cell[0]), 0.5 * (cell[3] - cell[2])
    for a in range(order_u):
        u = cell[0] + half_u * (1.0 + gauss.points[order_u, a])
        for b in range(order_v):
            v = cell[2] + half_v * (1.0 + gauss.points[order_v, b])
            points[count, 0], points[count, 1] = _bilinear(corners, u, v)
            area = half_u * half_v * _bilinear_area(corners, u, v)
            weights[count] = area * gauss.weights[order_u, a] * gauss.weights[order_v, b]
            count += 1
    return count


@njit(cache=True, nogil=True)
def _patch_rule(
    table, polynomial, source, corners, singular, degree, tolerance, anisotropy, gauss, points, weights, count
):
    """Append the adaptive rule of one patch, halving cells that are too close, on an explicit stack."""
    limit = max_points_per_direction(tolerance, gauss)
    stack = np.empty((_STACK_SIZE, 4))
    offsets, normals = np.empty((9, 3)), np.empty((4, 3))
    cell = np.empty(4)
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = -1.0, 1.0, -1.0, 1.0
    depth = 1
    while depth > 0:
        depth -= 1
        for side in range(4):  # numba would compile functions of strings for an assignment of arrays
            cell[side] = stack[depth, side]
        _sample(table, polynomial, source, corners, singular, cell, offsets, normals)
        length_u, length_v, bulge = lengths_and_bulge(offsets)
        spread_u, spread_v = cell_spreads(offsets, length_u, length_v, bulge)
        normal_u, normal_v = _normal_spreads(normals)
        order_u = order_for(min(spread_u, normal_u), degree, tolerance, anisotropy)
        order_v = order_for(min(spread_v, normal_v), degree, tolerance, anisotropy)
        if order_u <= limit and order_v <= limit:
            count = _emit(corners, cell, order_u, order_v, gauss, points, weights, count)
            if count < 0:
                return count
            continue
        low = 0 if length_u >= length_v else 2
        if cell[low + 1] - cell[low] < _MIN_CELL_SIZE or depth + 2 > _STACK_SIZE:
            return SOURCE_ON_ELEMENT
        middle = 0.5 * (cell[low] + cell[low + 1])
        for side in range(4):
            stack[depth, side] = stack[depth + 1, side] = cell[side]
        stack[depth, low + 1] = stack[depth + 1, low] = middle
        depth += 2
    return count


@njit(cache=True, nogil=True)
def _total_degree(table):
    degree = 0
    for k in range(table.exponents.shape[0]):
        degree = max(degree, table.exponents[k, 0] + table.exponents[k, 1])
    return degree


@njit(cache=True, nogil=True)
def shape_degree(table):
    """Return the degree of shape functions along u or v, on triangles with the area ratio of the collapsed patch.

    Parameters
    ----------
    table : ShapeTable
        Element type.

    Returns
    -------
    int
        The degree.
    """
    if table.triangle:
        return _total_degree(table) + 1
    degree = 0
    for k in range(table.exponents.shape[0]):
        degree = max(degree, max(table.exponents[k, 0], table.exponents[k, 1]))
    return degree


@njit(cache=True, nogil=True)
def element_rule(source, nodes, table, source_xi, tolerance, gauss, points, weights, anisotropy=MODERATE_ANISOTROPY):
    """Fill arrays with the rule in the reference domain for an element seen from a source.

    Kernels may grow as 1/r and 1/r^2; on singular elements as 1/r, or as 1/r^2 times functions that vanish at the
    source.

    Parameters
    ----------
    source : ndarray
        Position of the source, (3,).
    nodes : ndarray
        Positions of the nodes of the element, (n, 3).
    table : ShapeTable
        Element type.
    source_xi : ndarray
        Reference coordinates of a source on the element, (2,), else NaN.
    tolerance : float
        Error relative to the integral of the absolute value, for densities of the element's degree.
    gauss : GaussTable
        Gauss-Legendre rules.
    points : ndarray
        Reference coordinates of the points, (capacity, 2), filled.
    weights : ndarray
        Weights in the reference domain, (capacity,), filled.
    anisotropy : float, optional
        Anisotropy of the medium (`meeframe.elements.anisotropy`).

    Returns
    -------
    int
        Number of points; BUFFER_TOO_SMALL, or SOURCE_ON_ELEMENT if the source lies on the element and source_xi is NaN.
    """
    polynomial = np.empty((table.exponents.shape[0], 3))
    geometry_polynomial(table, nodes, polynomial)
    corners = np.empty((4, 2))
    n_corners = _reference_corners(table.triangle, corners)
    singular = not np.isnan(source_xi[0])
    degree = _total_degree(table) + 1 if singular else shape_degree(table)
    count, patch = np.intp(0), corners.copy()
    for side in range(n_corners if singular else 1):
        if singular:
            for axis in range(2):
                patch[0, axis] = patch[3, axis] = source_xi[axis]
                patch[1, axis], patch[2, axis] = corners[side, axis], corners[(side + 1) % n_corners, axis]
            if _bilinear_area(patch, 1.0, 0.0) < 1e-12:
                continue
        count = _patch_rule(
            table, polynomial, source, patch, singular, degree, tolerance, anisotropy, gauss, points, weights, count
        )
        if count < 0:
            break
    return count


@njit(cache=True, nogil=True)
def rectangular_rule(order_xi, order_eta, triangle, gauss, points, weights):
    """Fill arrays with the tensor Gauss rule of the reference domain.

    Parameters
    ----------
    order_xi, order_eta : int
        Numbers of points along xi and eta.
    triangle : bool
        True for the triangle, false for the quadrilateral.
    gauss : GaussTable
        Gauss-Legendre rules.
    points : ndarray
        Reference coordinates of the points, (order_xi * order_eta, 2), filled.
    weights : ndarray
        Weights in the reference domain, (order_xi * order_eta,), filled.
    """
    corners = np.empty((4, 2))
    _reference_corners(triangle, corners)
    cell = np.array([-1.0, 1.0, -1.0, 1.0])
    _emit(corners, cell, order_xi, order_eta, gauss, points, weights, np.intp(0))


@njit(cache=True, nogil=True)
def element_extents(table, nodes, tolerance, centres, sizes, min_orders):
    """Compute the sizes of elements with nodes (e, n, 3), for required_orders.

    Fills centres (e, 3), sizes (e, 2) along xi and eta, enlarged for skew and curvature, and min_orders (e,), points
    per direction that shape functions and the change of the normal require at any distance.
    """
    polynomial = np.empty((table.exponents.shape[0], 3))
    corners = np.empty((4, 2))
    _reference_corners(table.triangle, corners)
    cell = np.array([-1.0, 1.0, -1.0, 1.0])
    offsets, normals, origin, singular = np.empty((9, 3)), np.empty((4, 3)), np.zeros(3), np.bool_(False)
    for e in range(nodes.shape[0]):
        geometry_polynomial(table, nodes[e], polynomial)
        _sample(table, polynomial, origin, corners, singular, cell, offsets, normals)
        length_u, length_v, bulge = lengths_and_bulge(offsets)
        skew_u, skew_v = skew_lengths(offsets)
        for axis in range(3):
            centres[e, axis] = offsets[4, axis]
        sizes[e, 0] = max(length_u, skew_v) + 2.0 * bulge
        sizes[e, 1] = max(length_v, skew_u) + 2.0 * bulge
        normal_u, normal_v = _normal_spreads(normals)
        min_orders[e] = order_for(min(normal_u, normal_v), shape_degree(table), tolerance, MODERATE_ANISOTROPY)
