"""Conformance of a surface element with its abstract class (meeframe.elements.base)."""

import numpy as np
from hypothesis import strategies as st

from meeframe.elements.base import SurfaceElement, shape_coefficients, shape_derivatives, shape_functions
from meeframe.elements.quadrature import tensor_rule
from meeframe.fields import Array
from meeframe.testing.requirements import each, explained, require
from meeframe.testing.search import search_for

_ROUND_OFF = 1e-12
_CORNERS = {
    "quadrilateral": np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]),
    "triangle": np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
}
_AREAS = {"quadrilateral": 4.0, "triangle": 0.5}
_SHARES = st.sampled_from([0.0, 1.0, 0.5, 0.25]) | st.floats(0.0, 1.0, allow_subnormal=False)


def check_element(element: SurfaceElement, seed: int = 0) -> None:
    """Check an element by all tests of this module, at random points and at simple ones drawn by hypothesis.

    Parameters
    ----------
    element : SurfaceElement
        The element.
    seed : int, optional
        Seed of the random points.

    Raises
    ------
    AssertionError
        If a property fails; the message names the property, the point and why it matters.
    """
    with explained(element):
        check_nodes(element)
        check_points(element, reference_points(element, 20, seed))
        search_for(st.tuples(_SHARES, _SHARES), lambda shares: check_points(element, _point_at(element, *shares)))
        check_traces(element)
        check_orientation(element)


def reference_points(element: SurfaceElement, count: int, seed: int) -> Array:
    """Return random points of the reference domain, (count, 2), as weighted means of its corners."""
    corners = _CORNERS[element.reference]
    shares = np.random.default_rng(seed).dirichlet(np.ones(len(corners)), count)
    points: Array = shares @ corners
    return points


def _point_at(element: SurfaceElement, first: float, second: float) -> Array:
    """Return the point (1, 2) of the reference domain at fractions in [0, 1] of its two directions."""
    if element.reference == "triangle":
        return np.array([[first, second * (1.0 - first)]])
    return np.array([[2.0 * first - 1.0, 2.0 * second - 1.0]])


def check_nodes(element: SurfaceElement) -> None:
    """Check names, corners (first and counter-clockwise), nodes in the domain, integer exponents, equality and hash."""
    require(bool(element.name), "the element has no name", element)
    require(bool(element.meshio_type), "no meshio cell type", element)
    nodes, exponents, corners = element.nodes, element.exponents, _CORNERS[element.reference]
    same_shape = nodes.shape == exponents.shape == (len(nodes), 2)
    require(same_shape, "as many monomials as nodes are needed, (n, 2) each", (nodes.shape, exponents.shape))
    first = nodes[: len(corners)]
    require(np.array_equal(first, corners), "the first nodes must be the corners", first)
    integer = (exponents == np.round(np.abs(exponents))).all(axis=1)
    each(integer, "exponents must be whole, >= 0", np.arange(len(nodes)), exponents)
    low = -1.0 if element.reference == "quadrilateral" else 0.0
    inside = ((nodes >= low) & (nodes <= 1.0)).all(axis=1)
    if element.reference == "triangle":
        inside &= nodes.sum(axis=1) <= 1.0
    each(inside, "a node lies outside the reference domain", np.arange(len(nodes)), nodes)
    copy = type(element)()
    require(copy == element, "two elements of the type must be equal", copy)
    require(hash(copy) == hash(element), "equal elements must have equal hashes", copy)
    require(bool(np.isfinite(shape_coefficients(element)).all()), "the shape functions are not determined", nodes)
    values = shape_functions(element, nodes)
    nodal = (np.abs(values - np.eye(len(nodes))) <= _ROUND_OFF).all(axis=1)
    each(nodal, "shape functions at a node are not one for it and zero for others", nodes, values)


def check_points(element: SurfaceElement, points: Array) -> None:
    """Check values and derivatives at points (m, 2) of the reference domain."""
    check_interpolation(element, points)
    check_derivatives(element, points)


def check_interpolation(element: SurfaceElement, points: Array) -> None:
    """Check that shape functions sum to one and reproduce polynomials up to the order of the element."""
    nodes, values = element.nodes, shape_functions(element, points)
    total = values.sum(axis=1)
    each(np.abs(total - 1.0) <= _ROUND_OFF, "sum of shape functions", points, total)
    require(element.order >= 1, "order must be at least 1", element.order)
    for i in range(element.order + 1):
        for j in range(element.order + 1 - i):
            exact = points[:, 0] ** i * points[:, 1] ** j
            value = values @ (nodes[:, 0] ** i * nodes[:, 1] ** j)
            message = f"xi^{i} eta^{j} is off by {np.abs(value - exact).max():.1e}; the order is overstated"
            each(np.abs(value - exact) < _ROUND_OFF, message, points, value)


def check_derivatives(element: SurfaceElement, points: Array) -> None:
    """Check derivatives against central differences."""
    step = 1e-5
    derivatives = shape_derivatives(element, points)
    for axis in range(2):
        shift = step * np.eye(2)[axis]
        change = (shape_functions(element, points + shift) - shape_functions(element, points - shift)) / (2.0 * step)
        agree = (np.abs(change - derivatives[..., axis]) <= 1e-8).all(axis=1)
        each(agree, f"dN/dxi_{axis + 1} is not the derivative", points, derivatives[..., axis])


def check_traces(element: SurfaceElement) -> None:
    """Check that only the nodes of a side contribute on it, so that neighbouring elements are continuous."""
    corners = _CORNERS[element.reference]
    share = np.linspace(0.0, 1.0, 7)[:, None]
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        points = (1 - share) * start + share * end
        values = shape_functions(element, points)
        side, relative = end - start, element.nodes - start
        off_side = np.abs(side[0] * relative[:, 1] - side[1] * relative[:, 0]) > _ROUND_OFF
        leak = np.abs(values[:, off_side]).max(axis=1, initial=0.0)
        each(leak < _ROUND_OFF, "nodes off a side contribute on it", points, leak)


def check_orientation(element: SurfaceElement) -> None:
    """Check that a flat element, counter-clockwise from above, has its normal upwards and its full area."""
    flat = np.column_stack([element.nodes, np.zeros(len(element.nodes))])
    rule = tensor_rule(element, flat, 4)
    upwards = (np.abs(rule.normals - [0.0, 0.0, 1.0]) <= _ROUND_OFF).all(axis=1)
    each(upwards, "normal not upwards", rule.positions, rule.normals)
    area = rule.measures.sum()
    require(bool(abs(area - _AREAS[element.reference]) < _ROUND_OFF), "wrong area", area)
