# mypy: ignore-errors
"""Kernels of the assembly: quadrature points of many elements seen from a source, and sums over them by columns."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from meeframe.kernels.quadrature import BUFFER_TOO_SMALL, pair_rule, required_order
from meeframe.kernels.shape import map_rule


class Rules(NamedTuple):
    """Tensor rules on all elements, of k nodes at most.

    centres (e, 3), sizes (e, 2), least_orders (e,), degrees (e,): for required_order; starts: (e, orders) first row of
    the rule of each order, negative where it is not tabulated, in positions (., 3), normals (., 3) and shape_weights
    (., k).
    """

    centres: np.ndarray
    sizes: np.ndarray
    least_orders: np.ndarray
    degrees: np.ndarray
    starts: np.ndarray
    positions: np.ndarray
    normals: np.ndarray
    shape_weights: np.ndarray


class Points(NamedTuple):
    """Quadrature points: offsets from the source or positions (c, 3), normals (c, 3), shape functions times measure
    for fluxes and for values (c, k), which differ on elements that hold the source, and elements (c,)."""

    places: np.ndarray
    normals: np.ndarray
    flux_weights: np.ndarray
    value_weights: np.ndarray
    elements: np.ndarray


class Columns(NamedTuple):
    """Where the nodes of elements go; sites, unknowns and loads in the order of the tree.

    sites, patches: (e, k) of the nodes, negative beyond the last; value_column, value_data: (sites, 5);
    flux_column, flux_data, load_column: (patches, 5). Columns are negative where there is none. flux_unit: unknown
    fluxes are in units of it.
    """

    sites: np.ndarray
    patches: np.ndarray
    value_column: np.ndarray
    value_data: np.ndarray
    flux_column: np.ndarray
    flux_data: np.ndarray
    load_column: np.ndarray
    flux_unit: float


class Window(NamedTuple):
    """The columns that are wanted: place of each unknown and load in the output, and of the sites, negative if not."""

    unknown: np.ndarray
    load: np.ndarray
    site: np.ndarray


class Rows(NamedTuple):
    """Output: coefficients of unknowns (r, u), of loads (r, l), of the known data and five constant fields (r, 6)."""

    unknown: np.ndarray
    load: np.ndarray
    rest: np.ndarray


@njit(cache=True, nogil=True)
def _order(distance, element, rules, tolerance, anisotropy):
    """The tabulated order that serves an element, 0 if none does."""
    size_xi, size_eta = rules.sizes[element]
    order = required_order(distance, size_xi, size_eta, rules.degrees[element], tolerance, anisotropy)
    order = max(order, rules.least_orders[element])
    while order < rules.starts.shape[1] and rules.starts[element, order] < 0:
        order += 1
    return order if order < rules.starts.shape[1] else 0


@njit(cache=True, nogil=True)
def orders_from_box(low, high, elements, rules, tolerance, anisotropy, out):
    """Orders (n,) that serve elements (n,) seen from anywhere in a box; 0 where none does."""
    for i in range(len(elements)):
        square = 0.0
        for axis in range(3):
            x = rules.centres[elements[i], axis]
            gap = max(0.0, max(low[axis] - x, x - high[axis]))
            square += gap * gap
        out[i] = _order(sqrt(square), elements[i], rules, tolerance, anisotropy)


@njit(cache=True, nogil=True)
def orders_from_point(source, elements, rules, tolerance, anisotropy, out):
    """As orders_from_box, from a point (3,)."""
    orders_from_box(source, source, elements, rules, tolerance, anisotropy, out)


@njit(cache=True, nogil=True)
def tabulated_points(elements, orders, origin, rules, out):
    """Fill out with the rules of elements (n,) of the given orders, relative to origin (3,); those of order 0 not.

    Returns their number; out must have room.
    """
    count = 0
    for i in range(len(elements)):
        n = orders[i] * orders[i]
        if n == 0:
            continue
        row = rules.starts[elements[i], orders[i]]
        for q in range(row, row + n):
            for axis in range(3):
                out.places[count, axis] = rules.positions[q, axis] - origin[axis]
                out.normals[count, axis] = rules.normals[q, axis]
            for a in range(rules.shape_weights.shape[1]):
                out.flux_weights[count, a] = rules.shape_weights[q, a]
                out.value_weights[count, a] = rules.shape_weights[q, a]
            out.elements[count] = elements[i]
            count += 1
    return count


@njit(cache=True, nogil=True)
def spread_out(places, low, high, count):
    """Numbers of at most count of the places (n, 3), spread out as seen from a box.

    The first is the nearest to the box; each next one is the farthest from those before, in terms of its distance from
    the box, so that they are dense where it is close.
    """
    n = len(places)
    if count >= n:
        return np.arange(n)
    scale, gap = np.empty(n), np.full(n, np.inf)
    for i in range(n):
        square = 0.0
        for axis in range(3):
            x = places[i, axis]
            square += max(0.0, max(low[axis] - x, x - high[axis])) ** 2
        scale[i] = 1.0 / square
    chosen = np.empty(count, np.int64)
    chosen[0] = scale.argmax()
    for number in range(1, count):
        farthest, largest = 0, -1.0
        for i in range(n):
            square = 0.0
            for axis in range(3):
                square += (places[i, axis] - places[chosen[number - 1], axis]) ** 2
            gap[i] = min(gap[i], square * scale[i])
            if gap[i] > largest:
                farthest, largest = i, gap[i]
        chosen[number] = farthest
    return chosen


@njit(cache=True, nogil=True)
def refined_points(source, nodes, own_xi, own_shape, table, gauss, tolerance, anisotropy, number, scratch, out, count):
    """Append the adaptive rule of one element (n, 3) to out; returns the new count or a negative code of pair_rule.

    own_xi: (2,) place of the source in it or NaN; own_shape: (n,) the shape functions there, else zero; scratch:
    reference points (c, 2), weights (c,), measures (c,), shapes (c, n).
    """
    reference, weights, measures, shapes = scratch
    n = pair_rule(source, nodes, table, own_xi, tolerance, gauss, reference, weights, anisotropy)
    if n < 0:
        return n
    if count + n > len(out.elements):
        return BUFFER_TOO_SMALL
    places = out.places[count : count + n]
    map_rule(table, nodes, reference[:n], weights[:n], places, out.normals[count : count + n], measures[:n], shapes[:n])
    for i in range(n):
        for axis in range(3):
            places[i, axis] -= source[axis]
        for a in range(nodes.shape[0]):
            out.flux_weights[count + i, a] = measures[i] * shapes[i, a]
            out.value_weights[count + i, a] = measures[i] * (shapes[i, a] - own_shape[a])
        out.elements[count + i] = number
    return count + n


@njit(cache=True, nogil=True)
def accumulate(u, t, points, rows, columns, window, out):
    """Add the coefficients of one source to out. u, t: (c, 25) at the points, entry 5 J + K; rows: (5,) or < 0."""
    count, n_nodes = points.flux_weights.shape
    sum_u, sum_t = np.empty((n_nodes, 25)), np.empty((n_nodes, 25))
    point = 0
    while point < count:
        element = points.elements[point]
        sum_u[:] = 0.0
        sum_t[:] = 0.0
        while point < count and points.elements[point] == element:
            for a in range(n_nodes):
                wu, wt = points.flux_weights[point, a], points.value_weights[point, a]
                for i in range(25):
                    sum_u[a, i] += wu * u[point, i]
                    sum_t[a, i] += wt * t[point, i]
            point += 1
        for a in range(n_nodes):
            site = columns.sites[element, a]
            if site >= 0 and window.site[site] >= 0:
                _enter_values(sum_t[a], site, rows, columns, window, out)
                _enter_fluxes(sum_u[a], columns.patches[element, a], rows, columns, window, out)


@njit(cache=True, nogil=True)
def _enter_values(t, site, rows, columns, window, out):
    for j in range(5):
        column = columns.value_column[site, j]
        for k in range(5):
            row = rows[k]
            if row < 0:
                continue
            coefficient = t[5 * j + k]
            if column >= 0:
                out.unknown[row, window.unknown[column]] += coefficient
            else:
                out.rest[row, 0] -= coefficient * columns.value_data[site, j]
            out.rest[row, 1 + j] += coefficient


@njit(cache=True, nogil=True)
def _enter_fluxes(u, patch, rows, columns, window, out):
    for j in range(5):
        column, load = columns.flux_column[patch, j], columns.load_column[patch, j]
        for k in range(5):
            row = rows[k]
            if row < 0:
                continue
            coefficient = u[5 * j + k]
            if column >= 0:
                out.unknown[row, window.unknown[column]] -= coefficient * columns.flux_unit
            elif load >= 0:
                out.load[row, window.load[load]] += coefficient
            else:
                out.rest[row, 0] += coefficient * columns.flux_data[patch, j]
