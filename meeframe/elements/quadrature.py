"""Quadrature rules over one element, computed by meeframe.elements._kernels.quadrature."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from meeframe.common.errors import MeshError
from meeframe.elements._kernels import quadrature as kernels
from meeframe.elements._kernels.quadrature_order import MODERATE_ANISOTROPY
from meeframe.elements._kernels.shape import ShapeTable, map_rule
from meeframe.elements.base import SurfaceElement, shape_coefficients
from meeframe.fields import Array, Indices

MAX_GAUSS_POINTS = 24
"""Largest number of Gauss points per direction."""


@lru_cache(maxsize=64)
def shape_table(element: SurfaceElement) -> ShapeTable:
    """Return the element type as read-only arrays for the kernels.

    Parameters
    ----------
    element : SurfaceElement
        Element type.

    Returns
    -------
    ShapeTable
        Exponents, coefficients and reference coordinates of the nodes.
    """
    arrays = (element.exponents.astype(np.int64), shape_coefficients(element).copy(), element.nodes.copy())
    for array in arrays:
        array.setflags(write=False)
    return ShapeTable(*arrays, triangle=element.reference == "triangle")


@lru_cache(maxsize=1)
def gauss_table() -> kernels.GaussTable:
    """Return the Gauss-Legendre rules with 1 to MAX_GAUSS_POINTS points, read-only."""
    points = np.zeros((MAX_GAUSS_POINTS + 1, MAX_GAUSS_POINTS))
    weights = np.zeros_like(points)
    for n in range(1, MAX_GAUSS_POINTS + 1):
        points[n, :n], weights[n, :n] = np.polynomial.legendre.leggauss(n)
    points.setflags(write=False)
    weights.setflags(write=False)
    return kernels.GaussTable(points, weights)


@dataclass(frozen=True, eq=False)
class ElementRule:
    """A quadrature rule on one element.

    Attributes
    ----------
    points : Array
        Reference coordinates, (m, 2).
    weights : Array
        Weights in the reference domain, (m,).
    positions : Array
        Positions, (m, 3).
    normals : Array
        Outward unit normals, (m, 3).
    measures : Array
        Weights times the ratio of areas, (m,) [length^2].
    shapes : Array
        Shape functions, (m, n).
    """

    points: Array
    weights: Array
    positions: Array
    normals: Array
    measures: Array
    shapes: Array


def element_rule(
    element: SurfaceElement,
    nodes: Array,
    source: Array,
    tolerance: float,
    source_xi: Array | None = None,
    anisotropy: float = MODERATE_ANISOTROPY,
) -> ElementRule:
    """Return the rule for kernels 1/r and 1/r^2 times shape functions, seen from a source.

    Parameters
    ----------
    element : SurfaceElement
        Element type.
    nodes : Array
        Positions of the nodes, (n, 3).
    source : Array
        Position of the source, (3,).
    tolerance : float
        Error relative to the integral of the absolute value.
    source_xi : Array, optional
        Reference coordinates, (2,), of a source on the element. The rule then integrates kernels 1/r, and kernels 1/r^2
        times functions that vanish at the source.
    anisotropy : float
        Anisotropy of the medium, see `meeframe.elements.anisotropy`.

    Raises
    ------
    MeshError
        If the source lies on the element and `source_xi` is None.

    Notes
    -----
    See `meeframe.elements._kernels.quadrature` for the method.
    """
    nodes = np.ascontiguousarray(nodes, dtype=np.float64)
    source = np.ascontiguousarray(source, dtype=np.float64)
    xi = np.full(2, np.nan) if source_xi is None else np.array(source_xi, dtype=np.float64)
    capacity = 4096
    while True:
        points, weights = np.empty((capacity, 2)), np.empty(capacity)
        count = kernels.element_rule(
            source, nodes, shape_table(element), xi, tolerance, gauss_table(), points, weights, anisotropy
        )
        if count == kernels.SOURCE_ON_ELEMENT:
            raise MeshError(
                f"the source {source} lies on a {element.name} element of which it is not a node; "
                "meshes must be conforming, without hanging nodes"
            )
        if count != kernels.BUFFER_TOO_SMALL:
            return map_to_element(element, nodes, points[:count], weights[:count])
        capacity *= 4


def tensor_rule(element: SurfaceElement, nodes: Array, order: int, order_eta: int | None = None) -> ElementRule:
    """Return a tensor Gauss rule for smooth integrands.

    Parameters
    ----------
    element : SurfaceElement
        Element type.
    nodes : Array
        Positions of the nodes, (n, 3).
    order : int
        Points per direction, 1 to MAX_GAUSS_POINTS.
    order_eta : int, optional
        Points along eta; by default as many as along xi.

    Returns
    -------
    ElementRule
        The rule on the element.
    """
    count = order * (order_eta or order)
    points, weights = np.empty((count, 2)), np.empty(count)
    kernels.rectangular_rule(order, order_eta or order, element.reference == "triangle", gauss_table(), points, weights)
    return map_to_element(element, nodes, points, weights)


def map_to_element(element: SurfaceElement, nodes: Array, points: Array, weights: Array) -> ElementRule:
    """Map a rule from the reference domain to an element.

    Parameters
    ----------
    element : SurfaceElement
        Element type.
    nodes : Array
        Positions of the nodes, (n, 3).
    points, weights : Array
        The rule, (m, 2) and (m,).

    Returns
    -------
    ElementRule
        The rule on the element.
    """
    m, n = len(weights), len(element.nodes)
    positions, normals = np.empty((m, 3)), np.empty((m, 3))
    measures, shapes = np.empty(m), np.empty((m, n))
    nodes = np.ascontiguousarray(nodes, dtype=np.float64)
    map_rule(shape_table(element), nodes, points, weights, positions, normals, measures, shapes)
    return ElementRule(points, weights, positions, normals, measures, shapes)


@dataclass(frozen=True, eq=False)
class ElementExtents:
    """Sizes of elements, which determine the orders of tensor rules.

    Attributes
    ----------
    centres : Array
        Centres, (e, 3).
    sizes : Array
        Lengths along xi and eta, enlarged for skew and curvature, (e, 2).
    min_orders : Indices
        Points per direction, (e,), that shape functions and the change of the normal require at any distance.
    """

    centres: Array
    sizes: Array
    min_orders: Indices


def element_extents(element: SurfaceElement, nodes: Array, tolerance: float) -> ElementExtents:
    """Return the sizes of elements, which determine the orders of tensor rules.

    Parameters
    ----------
    element : SurfaceElement
        Element type.
    nodes : Array
        Positions of the nodes, (e, n, 3).
    tolerance : float
        Relative error of the rules.

    Returns
    -------
    ElementExtents
        Centres, sizes and smallest orders of the elements.
    """
    nodes = np.ascontiguousarray(nodes, dtype=np.float64)
    count = len(nodes)
    extents = ElementExtents(np.empty((count, 3)), np.empty((count, 2)), np.empty(count, np.int64))
    kernels.element_extents(shape_table(element), nodes, tolerance, extents.centres, extents.sizes, extents.min_orders)
    return extents
