from dataclasses import dataclass
from typing import final

import meshio
import numpy as np
import pytest

from meeframe.elements import ELEMENTS, Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.elements.base import SurfaceElement, shape_functions
from meeframe.elements.quadrature import shape_table, tensor_rule
from meeframe.testing.element import check_element, check_interpolation, check_traces, reference_points


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
def test_conformance(element):
    check_element(element)


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
def test_meshio_knows_the_cell_type(element):
    points = np.column_stack([element.nodes, np.zeros(len(element.nodes))])
    mesh = meshio.Mesh(points, [(element.meshio_type, [range(len(points))])])
    assert mesh.cells[0].dim == 2


def test_bilinear_shape_functions():
    xi, eta = reference_points(Quad4(), 10, 1).T
    expected = [(1 - xi) * (1 - eta), (1 + xi) * (1 - eta), (1 + xi) * (1 + eta), (1 - xi) * (1 + eta)]
    assert np.allclose(shape_functions(Quad4(), np.column_stack([xi, eta])), np.transpose(expected) / 4)


def test_serendipity_shape_functions():
    xi, eta = reference_points(Quad8(), 10, 2).T
    values = shape_functions(Quad8(), np.column_stack([xi, eta]))
    assert np.allclose(values[:, 2], (1 + xi) * (1 + eta) * (xi + eta - 1) / 4)
    assert np.allclose(values[:, 5], (1 + xi) * (1 - eta**2) / 2)


def test_quadratic_triangle_in_area_coordinates():
    xi, eta = reference_points(Tri6(), 10, 3).T
    values = shape_functions(Tri6(), np.column_stack([xi, eta]))
    assert np.allclose(values[:, 1], xi * (2 * xi - 1))
    assert np.allclose(values[:, 4], 4 * xi * eta)


def test_biquadratic_is_product_of_parabolas():
    xi, eta = reference_points(Quad9(), 10, 4).T
    values = shape_functions(Quad9(), np.column_stack([xi, eta]))
    assert np.allclose(values[:, 8], (1 - xi**2) * (1 - eta**2))


def test_tables_are_shared_and_frozen():
    assert shape_table(Quad4()) is shape_table(Quad4())
    assert shape_table(Tri3()).triangle
    with pytest.raises(ValueError, match="read-only"):
        Quad4().nodes[0, 0] = 0.0


def test_quadratic_elements_integrate_a_curved_area():
    # z = x^2 / 2 is represented exactly; its area per unit of y is the arc length of the parabola
    for element, low in ((Quad8(), -1.0), (Quad9(), -1.0)):
        x, y = element.nodes.T
        rule = tensor_rule(element, np.column_stack([x, y, x**2 / 2]), 24)
        arc = np.sqrt(2.0) + np.arcsinh(1.0)
        assert rule.measures.sum() == pytest.approx(2 * arc, rel=1e-12)
        assert np.allclose(rule.normals[:, 0] / rule.normals[:, 2], -rule.positions[:, 0])
        assert rule.positions[:, 1].min() > low


@final
@dataclass(frozen=True)
class Overstated(SurfaceElement):
    """An incompatible Wilson-like element of first order."""

    name = "overstated"
    meshio_type = "quad"
    reference = "quadrilateral"
    order = 2
    nodes = np.vstack([Quad4().nodes, [[0.0, 0.0]]])
    exponents = np.vstack([Quad4().exponents, [[2.0, 0.0]]])


def test_conformance_kit_detects_faults():
    points = reference_points(Overstated(), 5, 0)
    with pytest.raises(AssertionError, match="order is overstated"):
        check_interpolation(Overstated(), points)
    with pytest.raises(AssertionError, match="nodes off a side"):
        check_traces(Overstated())
