# mypy: ignore-errors
"""Kernels of the assembly: quadrature points of elements seen from a source or a box, and sums over them by columns."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from meeframe.plugin.boundary_elements import (
    BUFFER_TOO_SMALL,
    element_rule,
    map_rule,
    max_points_per_direction,
    rectangular_rule,
    required_orders,
    shape_degree,
)


class Elements(NamedTuple):
    """Elements of one kind.

    Attributes
    ----------
    nodes
        Nodes (e, k, 3).
    centres, sizes, min_orders
        Arrays (e, 3), (e, 2) and (e,) as in ElementExtents.
    """

    nodes: np.ndarray
    centres: np.ndarray
    sizes: np.ndarray
    min_orders: np.ndarray


class QuadraturePoints(NamedTuple):
    """Quadrature points on elements, of which element i has those from starts[i] to starts[i + 1].

    Attributes
    ----------
    starts
        First points of the elements, (e + 1,).
    offsets
        Positions (c, 3) relative to the source.
    normals
        Normals (c, 3).
    weights
        Shape functions times measure, (c, k).
    measures
        Measures (c,).
    reference, reference_weights
        Work arrays of rules.
    """

    starts: np.ndarray
    offsets: np.ndarray
    normals: np.ndarray
    weights: np.ndarray
    measures: np.ndarray
    reference: np.ndarray
    reference_weights: np.ndarray


class Columns(NamedTuple):
    """Columns of nodes, with sites, unknowns and loads in the order of the tree.

    Attributes
    ----------
    value_column, value_data
        Columns and data of values at the sites, (sites, f); columns are negative where there is none.
    flux_column, flux_data, load_column
        Columns and data of fluxes, and columns of loads, on the patches, (patches, f).
    flux_unit
        Unit of unknown fluxes.
    """

    value_column: np.ndarray
    value_data: np.ndarray
    flux_column: np.ndarray
    flux_data: np.ndarray
    load_column: np.ndarray
    flux_unit: float


class Window(NamedTuple):
    """The required columns.

    Attributes
    ----------
    unknown, load, site, patch
        Position of each unknown, load, site and patch, negative if it is not required.
    sites, patches
        Numbers of sites and patches in the order of their positions.
    """

    unknown: np.ndarray
    load: np.ndarray
    site: np.ndarray
    patch: np.ndarray
    sites: np.ndarray
    patches: np.ndarray


class Sums(NamedTuple):
    """Integrals over the elements at each site (s, f^2) and patch (p, f^2) of a window, seen from one source."""

    values: np.ndarray
    fluxes: np.ndarray


class Rows(NamedTuple):
    """Output: coefficients of unknowns (r, u) and loads (r, l), and the known data and f constant fields (r, 1 + f)."""

    unknown: np.ndarray
    load: np.ndarray
    known_terms: np.ndarray


@njit(cache=True, nogil=True)
def orders_from_box(box, numbers, elements, table, accuracy, gauss, out):
    """Set out (n, 2) to orders of tensor rules valid for elements (n,) seen from anywhere in a box (2, 3), else 0."""
    limit, degree = max_points_per_direction(accuracy.tolerance, gauss), shape_degree(table)
    for i in range(len(numbers)):
        element = numbers[i]
        square = 0.0
        for axis in range(3):
            x = elements.centres[element, axis]
            gap = max(0.0, max(box[0, axis] - x, x - box[1, axis]))
            square += gap * gap
        size_xi, size_eta = elements.sizes[element]
        xi, eta = required_orders(sqrt(square), size_xi, size_eta, degree, accuracy.tolerance, accuracy.anisotropy)
        xi, eta = max(xi, elements.min_orders[element]), max(eta, elements.min_orders[element])
        if table.triangle:
            xi = eta = max(xi, eta)
        if xi > limit or eta > limit:
            xi = eta = 0
        out[i, 0], out[i, 1] = xi, eta


@njit(cache=True, nogil=True)
def fill_quadrature_points(source, numbers, orders, xi, elements, table, accuracy, gauss, out):
    """Fill out with rules on elements (n,) for a source (3,): tensor rules of orders (n, 2), adaptive ones for order 0.

    xi: (n, 2) reference coordinates of the source in an element that contains it, else NaN. Returns the number of
    points, or a negative code of element_rule.
    """
    count = 0
    for i in range(len(numbers)):
        nodes = elements.nodes[numbers[i]]
        reference, weights = out.reference[count:], out.reference_weights[count:]
        n = orders[i, 0] * orders[i, 1]
        if n > len(weights):
            return BUFFER_TOO_SMALL
        if n > 0:
            rectangular_rule(orders[i, 0], orders[i, 1], table.triangle, gauss, reference, weights)
        else:
            tolerance, anisotropy = accuracy.tolerance, accuracy.anisotropy
            n = element_rule(source, nodes, table, xi[i], tolerance, gauss, reference, weights, anisotropy)
            if n < 0:
                return n
        rows = slice(count, count + n)
        offsets, measures, shapes = out.offsets[rows], out.measures[rows], out.weights[rows]
        map_rule(table, nodes, reference[:n], weights[:n], offsets, out.normals[rows], measures, shapes)
        for q in range(n):
            for axis in range(3):
                offsets[q, axis] -= source[axis]
            for a in range(shapes.shape[1]):
                shapes[q, a] *= measures[q]
        out.starts[i] = count
        count += n
    out.starts[len(numbers)] = count
    return count


@njit(cache=True, nogil=True)
def sums_by_element(fields, u, t, flux_weights, value_weights, starts, sum_u, sum_t):
    """Set sums (m, k, f^2) to weights (c, k) times u and t (c, f^2) at the points from starts[e] to starts[e + 1].

    fields: (0, ..., f - 1), a tuple, whose length is known to the compiler.
    """
    n_entries = len(fields) ** 2
    sum_u[:] = 0.0
    sum_t[:] = 0.0
    for element in range(len(starts) - 1):
        for point in range(starts[element], starts[element + 1]):
            for a in range(flux_weights.shape[1]):
                wu, wt = flux_weights[point, a], value_weights[point, a]
                for i in range(n_entries):
                    sum_u[element, a, i] += wu * u[point, i]
                    sum_t[element, a, i] += wt * t[point, i]


@njit(cache=True, nogil=True)
def accumulate(fields, u, t, sites, patches, window, sums):
    """Add integrals u, t (m, k, f^2) over elements to the sums of their nodes; sites, patches: (m, k) of these."""
    n_entries = len(fields) ** 2
    for element in range(len(sites)):
        for a in range(sites.shape[1]):
            position = window.site[sites[element, a]]
            if position >= 0:
                value, flux = sums.values[position], sums.fluxes[window.patch[patches[element, a]]]
                for i in range(n_entries):
                    value[i] += t[element, a, i]
                    flux[i] += u[element, a, i]


@njit(cache=True, nogil=True)
def enter(fields, sums, rows, columns, window, out):
    """Add the sums of one source to its rows (f,), where those are not negative.

    Entry f J + K of an integral belongs to the field J in the equation K. fields: (0, ..., f - 1).
    """
    n_fields = len(fields)
    constants = np.zeros(n_fields**2)
    for position in range(len(window.sites)):
        site, t = window.sites[position], sums.values[position]
        for i in range(n_fields**2):
            constants[i] += t[i]
        for j in range(n_fields):
            column = columns.value_column[site, j]
            if column >= 0:
                _add_column(fields, t[n_fields * j :], 1.0, rows, out.unknown, window.unknown[column])
            else:
                _add_column(fields, t[n_fields * j :], -columns.value_data[site, j], rows, out.known_terms, 0)
    for j in range(n_fields):
        _add_column(fields, constants[n_fields * j :], 1.0, rows, out.known_terms, 1 + j)
    for position in range(len(window.patches)):
        patch, u = window.patches[position], sums.fluxes[position]
        for j in range(n_fields):
            column, load = columns.flux_column[patch, j], columns.load_column[patch, j]
            if column >= 0:
                _add_column(fields, u[n_fields * j :], -columns.flux_unit, rows, out.unknown, window.unknown[column])
            elif load >= 0:
                _add_column(fields, u[n_fields * j :], 1.0, rows, out.load, window.load[load])
            else:
                _add_column(fields, u[n_fields * j :], columns.flux_data[patch, j], rows, out.known_terms, 0)


@njit(cache=True, nogil=True)
def _add_column(fields, coefficients, factor, rows, out, column):
    """Add factor times f coefficients to a column of out in the rows (f,) that are not negative."""
    for k in range(len(fields)):
        if rows[k] >= 0:
            out[rows[k], column] += factor * coefficients[k]
