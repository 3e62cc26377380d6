"""Quadrature over an element seen from a source point: one adaptive rule for distant, near and own elements.

Idea. A domain of integration is one or more bilinear *patches* (u, v) in [-1, 1]^2 of the reference domain; triangles
are patches with a collapsed edge. Along a straight line of length l that is seen from the source with end distances
r1, r2, kernels r^-p have their complex singularities on the Bernstein ellipse rho = s + sqrt(s^2 - 1),
s = (r1 + r2) / l, and n Gauss points leave an error of order rho^-(2n - degree). Each direction of a cell gets the order
that follows from its least s; a cell that would need too many points is halved across its longer side.

Own elements are split at the source into triangles with the collapsed edge (u = -1) at the source (Duffy). With
offset = rho g, rho = (1 + u) / 2, the singularities that remain are those of 1/|g|, so that the same estimate, with g
in place of the offset, gives orders and halvings for elongated and curved elements alike.
"""

from math import ceil, log, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from meeframe.kernels.shape import geometry_polynomial, normal_at, position_at, tangent_at

BUFFER_TOO_SMALL = -1
SOURCE_ON_ELEMENT = -2
UNREACHABLE_ORDER = 1 << 20

_ERROR_CONSTANT = 4.0
_STACK = 128
_SMALLEST_CELL = 1e-13
_TINY = 1e-300


class GaussTable(NamedTuple):
    """Gauss-Legendre rules on [-1, 1]: row n of points and of weights (N + 1, N) holds the n-point rule."""

    points: np.ndarray
    weights: np.ndarray


@njit(cache=True, nogil=True)
def order_for(spread, degree, tolerance):
    """Gauss points for kernels r^-p times a polynomial, seen at spread s = (sum of end distances) / length."""
    if spread <= 1.0 + 1e-12:
        return UNREACHABLE_ORDER
    growth = log(spread + sqrt(spread * spread - 1.0))
    order = ceil(0.5 * (log(_ERROR_CONSTANT / tolerance) / growth + degree))
    return max(min(order, UNREACHABLE_ORDER), degree + 1)


@njit(cache=True, nogil=True)
def required_order(distance, size_xi, size_eta, degree, tolerance):
    """Points per direction of a tensor Gauss rule over a whole element, for a relative error below tolerance.

    distance: source to element centre; size_xi, size_eta: from element_extents, same unit; degree: highest exponent of
    the shape functions. Large (>= UNREACHABLE_ORDER at worst) where the source is too close: use pair_rule there.
    """
    along_xi = order_for((2.0 * distance - size_eta) / size_xi, degree, tolerance)
    along_eta = order_for((2.0 * distance - size_xi) / size_eta, degree, tolerance)
    return max(along_xi, along_eta)


@njit(cache=True, nogil=True)
def _bilinear(corners, u, v):
    a, b = 0.5 * (1.0 - u), 0.5 * (1.0 + u)
    c, d = 0.5 * (1.0 - v), 0.5 * (1.0 + v)
    xi = c * (a * corners[0, 0] + b * corners[1, 0]) + d * (b * corners[2, 0] + a * corners[3, 0])
    eta = c * (a * corners[0, 1] + b * corners[1, 1]) + d * (b * corners[2, 1] + a * corners[3, 1])
    return xi, eta


@njit(cache=True, nogil=True)
def _bilinear_area(corners, u, v):
    """Jacobian determinant of the bilinear map, positive for corners in counter-clockwise order."""
    c, d = 0.25 * (1.0 - v), 0.25 * (1.0 + v)
    xi_u = c * (corners[1, 0] - corners[0, 0]) + d * (corners[2, 0] - corners[3, 0])
    eta_u = c * (corners[1, 1] - corners[0, 1]) + d * (corners[2, 1] - corners[3, 1])
    a, b = 0.25 * (1.0 - u), 0.25 * (1.0 + u)
    xi_v = a * (corners[3, 0] - corners[0, 0]) + b * (corners[2, 0] - corners[1, 0])
    eta_v = a * (corners[3, 1] - corners[0, 1]) + b * (corners[2, 1] - corners[1, 1])
    return xi_u * eta_v - eta_u * xi_v


@njit(cache=True, nogil=True)
def _offset(table, polynomial, source, corners, own, u, v):
    """Offset from the source at (u, v); on own elements divided by the distance 0..1 from the collapsed edge."""
    xi, eta = _bilinear(corners, u, v)
    if own and u <= -1.0:
        a, b = _bilinear(corners, 1.0, v)
        return tangent_at(table, polynomial, xi, eta, a - corners[0, 0], b - corners[0, 1])
    x, y, z = position_at(table, polynomial, xi, eta)
    scale = 2.0 / (1.0 + u) if own else 1.0
    return scale * (x - source[0]), scale * (y - source[1]), scale * (z - source[2])


@njit(cache=True, nogil=True)
def _norm(x, y, z):
    return sqrt(x * x + y * y + z * z)


@njit(cache=True, nogil=True)
def _segment_distance(grid, first, second):
    """Distance from the origin to the segment between two of the grid's points."""
    ax, ay, az = grid[first, 0], grid[first, 1], grid[first, 2]
    dx, dy, dz = grid[second, 0] - ax, grid[second, 1] - ay, grid[second, 2] - az
    square = dx * dx + dy * dy + dz * dz
    t = 0.0
    if square > 0.0:
        t = min(1.0, max(0.0, -(ax * dx + ay * dy + az * dz) / square))
    return _norm(ax + t * dx, ay + t * dy, az + t * dz)


@njit(cache=True, nogil=True)
def _distance(grid, first, second):
    return _norm(grid[first, 0] - grid[second, 0], grid[first, 1] - grid[second, 1], grid[first, 2] - grid[second, 2])


@njit(cache=True, nogil=True)
def _bulge(grid, first, middle, second):
    """Distance of a line's middle point from the middle of its chord."""
    return _norm(
        grid[middle, 0] - 0.5 * (grid[first, 0] + grid[second, 0]),
        grid[middle, 1] - 0.5 * (grid[first, 1] + grid[second, 1]),
        grid[middle, 2] - 0.5 * (grid[first, 2] + grid[second, 2]),
    )


@njit(cache=True, nogil=True)
def _lengths_and_spreads(grid):
    """Of a cell sampled on a 3 x 3 grid (9, 3), v fastest: length and spread along u, then along v.

    The spread is a lower bound: each of the two end lines counts with its nearest point, less the bulge of the cell.
    """
    bulge = max(
        max(_bulge(grid, 0, 1, 2), _bulge(grid, 6, 7, 8)),
        max(_bulge(grid, 0, 3, 6), _bulge(grid, 2, 5, 8)),
    )
    bulge = max(bulge, max(_bulge(grid, 1, 4, 7), _bulge(grid, 3, 4, 5)))
    length_u = max(_distance(grid, 0, 6), max(_distance(grid, 1, 7), _distance(grid, 2, 8)))
    length_v = max(_distance(grid, 0, 2), max(_distance(grid, 3, 5), _distance(grid, 6, 8)))
    ends_u = _segment_distance(grid, 0, 2) + _segment_distance(grid, 6, 8)
    ends_v = _segment_distance(grid, 0, 6) + _segment_distance(grid, 2, 8)
    spread_u = max(0.0, ends_u - 2.0 * bulge) / max(length_u, _TINY)
    spread_v = max(0.0, ends_v - 2.0 * bulge) / max(length_v, _TINY)
    return length_u, length_v, spread_u, spread_v


@njit(cache=True, nogil=True)
def _turning_spread(grid, first, second):
    """Spread that corresponds to the turning of the normal between two points: the root in the area ratio."""
    a = max(_norm(grid[first, 0], grid[first, 1], grid[first, 2]), _TINY)
    b = max(_norm(grid[second, 0], grid[second, 1], grid[second, 2]), _TINY)
    add = turn = 0.0
    for axis in range(3):
        one, two = grid[first, axis] / a, grid[second, axis] / b
        add += (one + two) ** 2
        turn += (one - two) ** 2
    return sqrt(1.0 + add / max(turn, 1e-20))


@njit(cache=True, nogil=True)
def _cell_orders(table, polynomial, source, corners, own, cell, degree, tolerance, grid):
    """Gauss points along u and v of a cell (u0, u1, v0, v1), and its lengths along u and v."""
    for a in range(3):
        for b in range(3):
            u = cell[0] + 0.5 * a * (cell[1] - cell[0])
            v = cell[2] + 0.5 * b * (cell[3] - cell[2])
            x, y, z = _offset(table, polynomial, source, corners, own, u, v)
            grid[3 * a + b, 0], grid[3 * a + b, 1], grid[3 * a + b, 2] = x, y, z
    length_u, length_v, spread_u, spread_v = _lengths_and_spreads(grid)
    for a in range(2):
        for b in range(2):
            xi, eta = _bilinear(corners, cell[a], cell[2 + b])
            x, y, z = normal_at(table, polynomial, xi, eta)
            grid[2 * a + b, 0], grid[2 * a + b, 1], grid[2 * a + b, 2] = x, y, z
    spread_u = min(spread_u, min(_turning_spread(grid, 0, 2), _turning_spread(grid, 1, 3)))
    spread_v = min(spread_v, min(_turning_spread(grid, 0, 1), _turning_spread(grid, 2, 3)))
    return order_for(spread_u, degree, tolerance), order_for(spread_v, degree, tolerance), length_u, length_v


@njit(cache=True, nogil=True)
def _emit(corners, cell, order_u, order_v, gauss, points, weights, count):
    """Append the tensor Gauss rule of a cell; returns the new count or BUFFER_TOO_SMALL."""
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
def _patch_rule(table, polynomial, source, corners, own, degree, tolerance, gauss, points, weights, count):
    """Append the adaptive rule of one patch, halving cells that are too close; an explicit stack of cells."""
    limit = most_points(tolerance, gauss)
    stack = np.empty((_STACK, 4))
    grid = np.empty((9, 3))
    cell = np.empty(4)
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = -1.0, 1.0, -1.0, 1.0
    depth = 1
    while depth > 0:
        depth -= 1
        cell[:] = stack[depth]
        order_u, order_v, length_u, length_v = _cell_orders(
            table, polynomial, source, corners, own, cell, degree, tolerance, grid
        )
        if order_u <= limit and order_v <= limit:
            count = _emit(corners, cell, order_u, order_v, gauss, points, weights, count)
            if count < 0:
                return count
            continue
        low = 0 if length_u >= length_v else 2
        if cell[low + 1] - cell[low] < _SMALLEST_CELL or depth + 2 > _STACK:
            return SOURCE_ON_ELEMENT
        middle = 0.5 * (cell[low] + cell[low + 1])
        stack[depth] = cell
        stack[depth, low + 1] = middle
        stack[depth + 1] = cell
        stack[depth + 1, low] = middle
        depth += 2
    return count


@njit(cache=True, nogil=True)
def most_points(tolerance, gauss):
    """Points per direction beyond which halving a cell is cheaper than a higher order."""
    return min(gauss.points.shape[1], max(6, int(ceil(1.2 - 1.1 * log(tolerance) / log(10.0)))))


@njit(cache=True, nogil=True)
def _reference_corners(triangle, out):
    """Fill out (4, 2) with the corners of the reference domain; a triangle repeats its third. Returns their number."""
    if triangle:
        out[0, 0], out[0, 1], out[1, 0], out[1, 1] = 0.0, 0.0, 1.0, 0.0
        out[2, 0], out[2, 1], out[3, 0], out[3, 1] = 0.0, 1.0, 0.0, 1.0
        return 3
    out[0, 0], out[0, 1], out[1, 0], out[1, 1] = -1.0, -1.0, 1.0, -1.0
    out[2, 0], out[2, 1], out[3, 0], out[3, 1] = 1.0, 1.0, -1.0, 1.0
    return 4


@njit(cache=True, nogil=True)
def _degrees(table):
    """Highest exponent in one direction and highest total degree of the shape functions."""
    directional = total = 0
    for k in range(table.exponents.shape[0]):
        i, j = table.exponents[k, 0], table.exponents[k, 1]
        directional = max(directional, max(i, j))
        total = max(total, i + j)
    return directional, total


@njit(cache=True, nogil=True)
def pair_rule(source, nodes, table, local_node, tolerance, gauss, points, weights):
    """Rule in the reference domain for an element with nodes (n, 3) seen from source (3,).

    local_node: number of the source among the element's nodes, -1 if it is none of them. Kernels may grow as 1/r and
    1/r^2; on own elements as 1/r, or as 1/r^2 times functions that vanish at the source. The error relative to the
    integral of the absolute value is below tolerance for polynomial densities of the element's degree.
    Fills points (capacity, 2), weights (capacity,) and returns their number, or BUFFER_TOO_SMALL, or SOURCE_ON_ELEMENT
    if local_node is -1 and yet the source lies on the element.
    """
    polynomial = np.empty((table.exponents.shape[0], 3))
    geometry_polynomial(table, nodes, polynomial)
    corners = np.empty((4, 2))
    n_corners = _reference_corners(table.triangle, corners)
    directional, total = _degrees(table)
    if local_node < 0:
        degree = total + 1 if table.triangle else directional
        return _patch_rule(table, polynomial, source, corners, False, degree, tolerance, gauss, points, weights, 0)
    count = 0
    wedge = np.empty((4, 2))
    for side in range(n_corners):
        wedge[0] = table.nodes[local_node]
        wedge[1] = corners[side]
        wedge[2] = corners[(side + 1) % n_corners]
        wedge[3] = wedge[0]
        if _bilinear_area(wedge, 1.0, 0.0) < 1e-12:
            continue
        count = _patch_rule(table, polynomial, source, wedge, True, total + 1, tolerance, gauss, points, weights, count)
        if count < 0:
            break
    return count


@njit(cache=True, nogil=True)
def tensor_rule(order, triangle, gauss, points, weights):
    """Fill points (order^2, 2) and weights (order^2,) with the tensor Gauss rule of the whole reference domain."""
    corners = np.empty((4, 2))
    _reference_corners(triangle, corners)
    cell = np.array([-1.0, 1.0, -1.0, 1.0])
    return _emit(corners, cell, order, order, gauss, points, weights, 0)
