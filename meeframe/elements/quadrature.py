"""Quadrature rules over one element as records: the Python face of meeframe.elements._kernels.quadrature."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from meeframe.common.errors import MeshError
from meeframe.elements._kernels import quadrature as kernels
from meeframe.elements._kernels.quadrature_order import MODERATE_ANISOTROPY
from meeframe.elements._kernels.shape import ShapeTable, map_rule
from meeframe.elements.base import SurfaceElement, shape_coefficients
from meeframe.fields import Array, Indices

MOST_GAUSS_POINTS = 24


@lru_cache(maxsize=64)
def shape_table(element: SurfaceElement) -> ShapeTable:
    """Return the element as plain, read-only arrays for the kernels."""
    arrays = (element.exponents.astype(np.int64), shape_coefficients(element).copy(), element.nodes.copy())
    for array in arrays:
        array.setflags(write=False)
    return ShapeTable(*arrays, triangle=element.reference == "triangle")


@lru_cache(maxsize=1)
def gauss_table() -> kernels.GaussTable:
    """Return the Gauss-Legendre rules with 1 to MOST_GAUSS_POINTS points, read-only."""
    points = np.zeros((MOST_GAUSS_POINTS + 1, MOST_GAUSS_POINTS))
    weights = np.zeros_like(points)
    for n in range(1, MOST_GAUSS_POINTS + 1):
        points[n, :n], weights[n, :n] = np.polynomial.legendre.leggauss(n)
    points.setflags(write=False)
    weights.setflags(write=False)
    return kernels.GaussTable(points, weights)


@dataclass(frozen=True, eq=False)
class ElementRule:
    """A quadrature rule on one element.

    points: (m, 2) reference coordinates; weights: (m,) in the reference domain; positions: (m, 3); normals: (m, 3)
    unit, outward; measures: (m,) weights times the area ratio [length^2]; shapes: (m, n) shape functions.
    """

    points: Array
    weights: Array
    positions: Array
    normals: Array
    measures: Array
    shapes: Array


def pair_rule(
    element: SurfaceElement,
    nodes: Array,
    source: Array,
    tolerance: float,
    own_xi: Array | None = None,
    anisotropy: float = MODERATE_ANISOTROPY,
) -> ElementRule:
    """Return the rule for kernels 1/r and 1/r^2 times shape functions on an element with nodes (n, 3), seen from
    source (3,).

    own_xi: (2,) reference coordinates of the source where the element holds it: kernels 1/r, and 1/r^2 times functions
    that vanish at the source; tolerance: relative to the integral of the absolute value; anisotropy: of the medium,
    see meeframe.elements.anisotropy. Raises MeshError if own_xi is not given and yet the source lies on the element.
    See meeframe.elements._kernels.quadrature for the method.
    """
    nodes = np.ascontiguousarray(nodes, dtype=np.float64)
    source = np.ascontiguousarray(source, dtype=np.float64)
    own = np.full(2, np.nan) if own_xi is None else np.array(own_xi, dtype=np.float64)
    capacity = 4096
    while True:
        points, weights = np.empty((capacity, 2)), np.empty(capacity)
        count = kernels.pair_rule(
            source, nodes, shape_table(element), own, tolerance, gauss_table(), points, weights, anisotropy
        )
        if count == kernels.SOURCE_ON_ELEMENT:
            raise MeshError(
                f"the source {source} lies on an element of type {element.name} that does not hold it; "
                "meshes must be conforming, without hanging nodes"
            )
        if count != kernels.BUFFER_TOO_SMALL:
            return mapped(element, nodes, points[:count], weights[:count])
        capacity *= 4


def tensor_rule(element: SurfaceElement, nodes: Array, order: int, order_eta: int | None = None) -> ElementRule:
    """Return the tensor Gauss rule with order points per direction, 1 to MOST_GAUSS_POINTS, for smooth integrands.

    order_eta: points along eta if they are not as many as along xi.
    """
    count = order * (order_eta or order)
    points, weights = np.empty((count, 2)), np.empty(count)
    kernels.rectangular_rule(order, order_eta or order, element.reference == "triangle", gauss_table(), points, weights)
    return mapped(element, nodes, points, weights)


def mapped(element: SurfaceElement, nodes: Array, points: Array, weights: Array) -> ElementRule:
    """Return a rule of the reference domain, points (m, 2) and weights (m,), on an element with nodes (n, 3)."""
    m, n = len(weights), len(element.nodes)
    positions, normals = np.empty((m, 3)), np.empty((m, 3))
    measures, shapes = np.empty(m), np.empty((m, n))
    nodes = np.ascontiguousarray(nodes, dtype=np.float64)
    map_rule(shape_table(element), nodes, points, weights, positions, normals, measures, shapes)
    return ElementRule(points, weights, positions, normals, measures, shapes)


@dataclass(frozen=True, eq=False)
class ElementExtents:
    """What the order of a rule on a whole element depends on, for required_orders of
    meeframe.elements._kernels.quadrature_order.

    centres: (e, 3); sizes: (e, 2) lengths along xi and eta, enlarged for skew and curvature; least_orders: (e,) points
    per direction that shape functions and the turning of the normal ask for at any distance.
    """

    centres: Array
    sizes: Array
    least_orders: Indices


def element_extents(element: SurfaceElement, nodes: Array, tolerance: float) -> ElementExtents:
    """Return the extents of elements with nodes (e, n, 3), for rules of a relative tolerance."""
    nodes = np.ascontiguousarray(nodes, dtype=np.float64)
    count = len(nodes)
    extents = ElementExtents(np.empty((count, 3)), np.empty((count, 2)), np.empty(count, np.int64))
    kernels.element_extents(
        shape_table(element), nodes, tolerance, extents.centres, extents.sizes, extents.least_orders
    )
    return extents
