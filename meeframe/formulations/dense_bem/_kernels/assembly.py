"""Collocation of the boundary integral equation: sums over quadrature points for one source at a time.

Panels hold the coefficients of one source, value_panel (p, f^2) those of the value nodes and flux_panel (m, f^2) those
of the flux nodes. Entry f J + K is the coefficient of field J at the node in the equation of field K. The
number f is known when the code is compiled where that pays: it is the length of a tuple of the fields.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from meeframe.elements._kernels.quadrature import BUFFER_TOO_SMALL, element_rule
from meeframe.elements._kernels.quadrature_order import required_orders
from meeframe.elements._kernels.shape import map_rule


class Buffers(NamedTuple):
    """Buffers for up to c quadrature points of one source.

    Attributes
    ----------
    offsets, normals : ndarray
        Offsets from the source and unit normals, (c, 3).
    shape_weights : ndarray
        Shape functions times measure, (c, k).
    weights : ndarray
        Measure, (c,).
    elements : ndarray
        Element of each point, (c,).
    near : ndarray
        Elements that need the adaptive rule, (e,).
    reference, reference_weights, shapes : ndarray
        Scratch for the adaptive rule.
    """

    offsets: np.ndarray
    normals: np.ndarray
    shape_weights: np.ndarray
    weights: np.ndarray
    elements: np.ndarray
    near: np.ndarray
    reference: np.ndarray
    reference_weights: np.ndarray
    shapes: np.ndarray


class RuleTable(NamedTuple):
    """Tensor rules on all elements of a block.

    Attributes
    ----------
    centres, sizes, min_orders, degree : ndarray or int
        Arguments of required_orders, (e, 3), (e, 2), (e,) and one number.
    square : bool
        True if both directions have the larger order.
    starts : ndarray
        First entry of the rule of each order along xi and eta, (orders, orders), negative if it is not tabulated.
    positions, normals, shape_weights : ndarray
        Points of the rules, (., 3), (., 3) and (., k).
    """

    centres: np.ndarray
    sizes: np.ndarray
    min_orders: np.ndarray
    degree: int
    square: bool
    starts: np.ndarray
    positions: np.ndarray
    normals: np.ndarray
    shape_weights: np.ndarray


class Accuracy(NamedTuple):
    """Accuracy of the element integrals.

    Attributes
    ----------
    tolerance : float
        Relative error of each element integral.
    anisotropy : float
        Anisotropy of the medium, see `meeframe.elements.anisotropy`.
    """

    tolerance: float
    anisotropy: float


@njit(cache=True, nogil=True)
def accumulate(fields, u, t, shape_weights, elements, value_nodes, flux_nodes, value_panel, flux_panel, total):
    """Add the kernels u, t (n, f^2) at quadrature points, times shape_weights (n, k), to the panels.

    fields: (0, ..., f - 1); elements: (n,) element of each point, in runs of equal numbers; value_nodes, flux_nodes:
    (e, k). The integral of t alone is added to total (f^2,).
    """
    n_points, n_nodes = shape_weights.shape
    entries = len(fields) ** 2
    sum_u = np.zeros((n_nodes, entries))
    sum_t = np.zeros((n_nodes, entries))
    point = 0
    while point < n_points:
        element = elements[point]
        sum_u[:] = 0.0
        sum_t[:] = 0.0
        while point < n_points and elements[point] == element:
            for a in range(n_nodes):
                w = shape_weights[point, a]
                for i in range(entries):
                    sum_u[a, i] += w * u[point, i]
                    sum_t[a, i] += w * t[point, i]
            point += 1
        for a in range(n_nodes):
            value = value_nodes[element, a]
            flux = flux_nodes[element, a]
            for i in range(entries):
                value_panel[value, i] += sum_t[a, i]
                flux_panel[flux, i] += sum_u[a, i]
                total[i] += sum_t[a, i]


@njit(cache=True, nogil=True)
def piece_starts(elements):
    """Return the start of each run of equal numbers in elements (n,), and n, (m + 1,)."""
    starts = np.empty(len(elements) + 1, np.int64)
    count = 0
    for point in range(len(elements)):
        if point == 0 or elements[point] != elements[point - 1]:
            starts[count] = point
            count += 1
    starts[count] = len(elements)
    return starts[: count + 1]


@njit(cache=True, nogil=True)
def add_pieces(u, t, elements, value_nodes, flux_nodes, value_panel, flux_panel, total):
    """Add integrals u, t (m, k, f^2) over pieces of elements (m,) to the panels, as accumulate does."""
    entries = u.shape[2]
    for piece in range(len(elements)):
        element = elements[piece]
        for a in range(u.shape[1]):
            value = value_nodes[element, a]
            flux = flux_nodes[element, a]
            for i in range(entries):
                value_panel[value, i] += t[piece, a, i]
                flux_panel[flux, i] += u[piece, a, i]
                total[i] += t[piece, a, i]


@njit(cache=True, nogil=True)
def accumulate_singular(u, t, shape_weights, weights, source_shape, value_nodes, flux_nodes, value_panel, flux_panel):
    """Add a singular element to the panels, with t times N_a(x) - N_a(source), which is integrable.

    weights: (n,) of the points; source_shape: (k,); value_nodes, flux_nodes: (k,).
    """
    n_points, n_nodes = shape_weights.shape
    entries = u.shape[1]
    for a in range(n_nodes):
        value = value_nodes[a]
        flux = flux_nodes[a]
        for point in range(n_points):
            w = shape_weights[point, a]
            difference = w - weights[point] * source_shape[a]
            for i in range(entries):
                flux_panel[flux, i] += w * u[point, i]
                value_panel[value, i] += difference * t[point, i]


@njit(cache=True, nogil=True)
def subtract_constant(total, mesh_points, shape, value_panel):
    """Subtract the value at the source, interpolated by shape (k,) at mesh_points (k,), times total (f^2,).

    total is the integral of t over all regular elements. Constant fields satisfy the equations of a closed
    surface, which gives the sum of free term and principal value.
    """
    entries = len(total)
    for a in range(len(mesh_points)):
        if shape[a] != 0.0:
            for i in range(entries):
                value_panel[mesh_points[a], i] -= shape[a] * total[i]


@njit(cache=True, nogil=True)
def enter_rows(
    fields,
    rows,
    value_panel,
    flux_panel,
    value_column,
    value_data,
    flux_column,
    flux_data,
    load_column,
    matrix,
    load_matrix,
    rhs,
):
    """Enter the panels of one source into its rows of matrix @ unknowns = rhs + load_matrix @ loads.

    Entries of matrix are set, those of load_matrix and rhs are added to: patches that meet in the contact zone share
    their load. rows: (fields,), negative for fields that are not collocated here; *_column, *_data: (nodes, fields).
    fields: (0, ..., f - 1).
    """
    n_fields = len(fields)
    for node in range(len(value_column)):
        for j in range(n_fields):
            column = value_column[node, j]
            for field in range(n_fields):
                row = rows[field]
                if row < 0:
                    continue
                coefficient = value_panel[node, n_fields * j + field]
                if column >= 0:
                    matrix[row, column] = coefficient
                else:
                    rhs[row] -= coefficient * value_data[node, j]
    for node in range(len(flux_column)):
        for j in range(n_fields):
            column = flux_column[node, j]
            load = load_column[node, j]
            for field in range(n_fields):
                row = rows[field]
                if row < 0:
                    continue
                coefficient = flux_panel[node, n_fields * j + field]
                if column >= 0:
                    matrix[row, column] = -coefficient
                elif load >= 0:
                    load_matrix[row, load] += coefficient
                else:
                    rhs[row] += coefficient * flux_data[node, j]


@njit(cache=True, nogil=True)
def _next_tabulated_order(order, rules):
    """Return the smallest tabulated order that is at least this one, or the size of the table if there is none."""
    while order < len(rules.starts) and rules.starts[order, order] < 0:
        order += 1
    return min(order, len(rules.starts))


@njit(cache=True, nogil=True)
def far_points(source, singular, accuracy, rules, out):
    """Fill the buffers with the points of all elements with a tabulated rule, seen from source (3,).

    singular: (e,) bool, elements to leave out. Returns the number of points, or BUFFER_TOO_SMALL, and the number of
    elements in out.near.
    """
    n_orders = len(rules.starts)
    n_nodes = rules.shape_weights.shape[1]
    count = 0
    n_near = 0
    for element in range(len(rules.centres)):
        if singular[element]:
            continue
        dx = rules.centres[element, 0] - source[0]
        dy = rules.centres[element, 1] - source[1]
        dz = rules.centres[element, 2] - source[2]
        distance = sqrt(dx * dx + dy * dy + dz * dz)
        size_xi, size_eta = rules.sizes[element]
        xi, eta = required_orders(distance, size_xi, size_eta, rules.degree, accuracy.tolerance, accuracy.anisotropy)
        if rules.square:
            xi = eta = max(xi, eta)
        xi = _next_tabulated_order(max(xi, rules.min_orders[element]), rules)
        eta = _next_tabulated_order(max(eta, rules.min_orders[element]), rules)
        if xi == n_orders or eta == n_orders:
            out.near[n_near] = element
            n_near += 1
            continue
        n = xi * eta
        if count + n > len(out.elements):
            return BUFFER_TOO_SMALL, n_near
        row = rules.starts[xi, eta] + element * n
        for _ in range(n):
            for axis in range(3):
                out.offsets[count, axis] = rules.positions[row, axis] - source[axis]
                out.normals[count, axis] = rules.normals[row, axis]
            for a in range(n_nodes):
                out.shape_weights[count, a] = rules.shape_weights[row, a]
            out.elements[count] = element
            count += 1
            row += 1
    return count, n_near


@njit(cache=True, nogil=True)
def adaptive_points(source, points, connectivity, element, xi, table, accuracy, gauss, out, count):
    """Append the adaptive rule of one element to the buffers after count points.

    points: (p, 3) of the mesh; connectivity: (e, k); xi: (2,) reference coordinates of the source if the element is
    singular, else NaN. Returns the new count or a negative code of element_rule.
    """
    nodes = np.empty((connectivity.shape[1], 3))
    for a in range(connectivity.shape[1]):
        for axis in range(3):
            nodes[a, axis] = points[connectivity[element, a], axis]
    n = element_rule(
        source, nodes, table, xi, accuracy.tolerance, gauss, out.reference, out.reference_weights, accuracy.anisotropy
    )
    if n < 0:
        return n
    if count + n > len(out.elements):
        return BUFFER_TOO_SMALL
    positions = out.offsets[count : count + n]
    weights = out.weights[count : count + n]
    map_rule(
        table,
        nodes,
        out.reference[:n],
        out.reference_weights[:n],
        positions,
        out.normals[count : count + n],
        weights,
        out.shapes[:n],
    )
    for i in range(n):
        for axis in range(3):
            positions[i, axis] -= source[axis]
        for a in range(nodes.shape[0]):
            out.shape_weights[count + i, a] = weights[i] * out.shapes[i, a]
        out.elements[count + i] = element
    return count + n


@njit(cache=True, nogil=True)
def near_points(source, points, connectivity, n_near, table, accuracy, gauss, out, count):
    """Append the adaptive rules of the elements in out.near to the buffers, as adaptive_points does."""
    no_xi = np.full(2, np.nan)
    for i in range(n_near):
        count = adaptive_points(source, points, connectivity, out.near[i], no_xi, table, accuracy, gauss, out, count)
        if count < 0:
            return count
    return count
