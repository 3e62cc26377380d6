"""Conformance of a surface element with its contract (meeframe.core.element)."""

import numpy as np

from meeframe.core.element import SurfaceElement, shape_coefficients, shape_derivatives, shape_functions
from meeframe.core.fields import Array
from meeframe.elements.quadrature import tensor_rule
from meeframe.testing.requirements import explained

_ROUND_OFF = 1e-12
_CORNERS = {
    "quadrilateral": np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]),
    "triangle": np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
}
_AREAS = {"quadrilateral": 4.0, "triangle": 0.5}


def check_element(element: SurfaceElement, seed: int = 0) -> None:
    """All checks of this module. Raises AssertionError."""
    with explained(element):
        check_nodes(element)
        points = reference_points(element, 20, seed)
        check_interpolation(element, points)
        check_derivatives(element, points)
        check_traces(element)
        check_orientation(element)


def reference_points(element: SurfaceElement, count: int, seed: int) -> Array:
    """Random points of the reference domain, (count, 2): weighted means of its corners."""
    corners = _CORNERS[element.reference]
    shares = np.random.default_rng(seed).dirichlet(np.ones(len(corners)), count)
    points: Array = shares @ corners
    return points


def check_nodes(element: SurfaceElement) -> None:
    """Names, corners first and counter-clockwise, nodes in the domain, whole exponents, equal and hashable objects."""
    assert element.name, "the element has no name"
    assert element.meshio_type, f"{element.name}: no meshio cell type"
    nodes, exponents, corners = element.nodes, element.exponents, _CORNERS[element.reference]
    assert nodes.shape == exponents.shape == (len(nodes), 2), f"{element.name}: as many monomials as nodes, (n, 2) each"
    assert np.array_equal(nodes[: len(corners)], corners), f"{element.name}: the first nodes must be the corners"
    assert np.array_equal(exponents, np.round(np.abs(exponents))), f"{element.name}: exponents must be whole, >= 0"
    low = -1.0 if element.reference == "quadrilateral" else 0.0
    assert ((nodes >= low) & (nodes <= 1.0)).all(), f"{element.name}: a node lies outside the reference domain"
    if element.reference == "triangle":
        assert (nodes.sum(axis=1) <= 1.0).all(), f"{element.name}: a node lies outside the reference domain"
    twin = type(element)()
    assert twin == element, f"{element.name}: two elements of the type must be equal"
    assert hash(twin) == hash(element), f"{element.name}: equal elements must have equal hashes"


def check_interpolation(element: SurfaceElement, points: Array) -> None:
    """One at the own node and zero at others; sum one; polynomials up to the element's order reproduced."""
    nodes, values = element.nodes, shape_functions(element, points)
    identity = np.eye(len(nodes))
    assert np.isfinite(shape_coefficients(element)).all(), f"{element.name}: the shape functions are not determined"
    assert np.allclose(shape_functions(element, nodes), identity, rtol=0, atol=_ROUND_OFF), (
        f"{element.name}: N_n(node m)"
    )
    assert np.allclose(values.sum(axis=1), 1.0, rtol=0, atol=_ROUND_OFF), f"{element.name}: sum of shape functions"
    assert element.order >= 1, f"{element.name}: order must be at least 1"
    for i in range(element.order + 1):
        for j in range(element.order + 1 - i):
            exact = points[:, 0] ** i * points[:, 1] ** j
            error = np.abs(values @ (nodes[:, 0] ** i * nodes[:, 1] ** j) - exact).max()
            assert error < _ROUND_OFF, f"{element.name}: xi^{i} eta^{j} is off by {error:.1e}; the order is overstated"


def check_derivatives(element: SurfaceElement, points: Array) -> None:
    """Derivatives agree with central differences."""
    step = 1e-5
    derivatives = shape_derivatives(element, points)
    for axis in range(2):
        shift = step * np.eye(2)[axis]
        change = shape_functions(element, points + shift) - shape_functions(element, points - shift)
        assert np.allclose(change / (2 * step), derivatives[..., axis], rtol=0, atol=1e-8), f"{element.name}: dN/dxi"


def check_traces(element: SurfaceElement) -> None:
    """On a side only the nodes of that side count, so that neighbours fit together without gaps."""
    corners = _CORNERS[element.reference]
    share = np.linspace(0.0, 1.0, 7)[:, None]
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        values = shape_functions(element, (1 - share) * start + share * end)
        along, across = end - start, element.nodes - start
        elsewhere = np.abs(along[0] * across[:, 1] - along[1] * across[:, 0]) > _ROUND_OFF
        leak = np.abs(values[:, elsewhere]).max(initial=0.0)
        assert leak < _ROUND_OFF, f"{element.name}: nodes off a side contribute {leak:.1e} there"


def check_orientation(element: SurfaceElement) -> None:
    """Laid flat, counter-clockwise seen from above, the element has its normal upwards and its full area."""
    flat = np.column_stack([element.nodes, np.zeros(len(element.nodes))])
    rule = tensor_rule(element, flat, 4)
    assert np.allclose(rule.normals, [0.0, 0.0, 1.0], rtol=0, atol=_ROUND_OFF), f"{element.name}: normal not upwards"
    assert abs(rule.measures.sum() - _AREAS[element.reference]) < _ROUND_OFF, f"{element.name}: wrong area"
