"""Quadrature converges at the predicted rates."""

import numpy as np
import pytest

from meeframe.elements import Quad4, Quad9, Tri3
from meeframe.elements._kernels.quadrature import required_orders, shape_degree
from meeframe.elements.quadrature import MAX_GAUSS_POINTS, element_extents, element_rule, shape_table, tensor_rule
from meeframe.greens import LineIntegral
from meeframe.material import library_material
from meeframe.testing.polygon import single_layer
from meeframe.testing.strategies import scaled_stiffness

SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)


def single(rule, source):
    return rule.measures @ (1 / np.linalg.norm(rule.positions - source, axis=1))


@pytest.mark.parametrize("height", [0.3, 0.6, 1.0])
def test_gauss_converges_at_the_rate_of_the_bernstein_ellipse(height):
    """Above the centre, the roots of r^2 are +- i height: each point reduces the error by rho^2 = (h + sqrt(1 +
    h^2))^2."""
    source = np.array([0.0, 0.0, height])
    orders = np.arange(4, 20 if height < 1 else 14, 2)
    exact = single_layer(SQUARE, source)
    errors = [abs(single(tensor_rule(Quad4(), SQUARE, int(n)), source) - exact) for n in orders]
    observed = -np.polyfit(orders, np.log(errors), 1)[0]
    assert observed > 2 * np.arcsinh(height) - 0.15


@pytest.mark.parametrize("position", [(0.3, -0.2, 1e-3), (1.001, 0.2, 0.0), (-1.0, -1.0, 2e-3), (0.2, 0.1, 1.5)])
def test_pair_rule_meets_tolerances_at_logarithmic_cost(position):
    source = np.array(position)
    exact = single_layer(SQUARE, source)
    counts = []
    for tolerance in 10.0 ** -np.arange(2, 14):
        rule = element_rule(Quad4(), SQUARE, source, tolerance)
        counts.append(len(rule.weights))
        assert abs(single(rule, source) / exact - 1) < max(tolerance, 1e-13)
    # the order of each direction grows like log(1/tolerance)
    assert counts[-1] < 1.5 * counts[0] * (13 / 2) ** 2
    assert np.all(np.diff(counts) >= 0)


def test_cost_grows_with_logarithm_of_inverse_distance():
    distances = 10.0 ** -np.arange(1, 8)
    counts = [len(element_rule(Quad4(), SQUARE, np.array([0.1, 0.2, d]), 1e-6).weights) for d in distances]
    assert np.diff(counts).max() < 1.5 * np.diff(counts).min()


ELEMENTS = {
    "quad4": (Quad4(), SQUARE),
    "quad4, seven to one": (Quad4(), SQUARE * [7, 1, 1]),
    "quad4, trapezoid": (Quad4(), np.array([[0, 0, 0], [3, 0, 0], [2, 1, 0], [0.5, 1.3, 0]], float)),
    "tri3": (Tri3(), np.array([[0, 0, 0], [1, 0.2, 0], [0.3, 0.9, 0]])),
    "quad9": (Quad9(), np.column_stack([Quad9().nodes, 0.2 * (Quad9().nodes ** 2).sum(axis=1)])),
}


@pytest.mark.parametrize("material", ["batio3-cofe2o4", "orthotropic-mee"])
@pytest.mark.parametrize(("element", "nodes"), ELEMENTS.values(), ids=ELEMENTS)
def test_required_orders_suffice_for_the_kernels(element, nodes, material):
    """All entries of int U N_a and int T N_a are accurate relative to the largest integral of absolute values."""
    kernel = LineIntegral().bind(scaled_stiffness(library_material(material)))
    rng = np.random.default_rng(0)
    degree = shape_degree(shape_table(element))
    served = 0
    for tolerance in (1e-4, 1e-6, 1e-8):
        extents = element_extents(element, nodes[None], tolerance)
        centre, sizes = extents.centres[0], extents.sizes[0]
        for _ in range(25):
            direction = rng.normal(size=3)
            distance = sizes.max() * 10 ** rng.uniform(-0.5, 1.5)
            source = centre + distance * direction / np.linalg.norm(direction)
            order = max(*required_orders(distance, *sizes, degree, tolerance), extents.min_orders[0])
            if order > MAX_GAUSS_POINTS:
                continue
            served += 1
            exact = integrals(kernel, element_rule(element, nodes, source, 1e-11), source)
            for value, reference in zip(
                integrals(kernel, tensor_rule(element, nodes, order), source), exact, strict=True
            ):
                assert np.abs(value - reference).max() < 1.2 * tolerance * np.abs(reference).sum(axis=0).max()
    assert served > 50


@pytest.mark.parametrize("name", ["quad4", "quad4, seven to one", "quad4, trapezoid", "quad9"])
def test_fewer_points_suffice_along_the_shorter_side(name):
    """Separate orders for both directions meet the same tolerance with fewer points than the larger order for both."""
    element, nodes = ELEMENTS[name]
    kernel = LineIntegral().bind(scaled_stiffness(library_material("batio3-cofe2o4")))
    rng = np.random.default_rng(1)
    degree = shape_degree(shape_table(element))
    extents = element_extents(element, nodes[None], 1e-5)
    sizes, least = extents.sizes[0], extents.min_orders[0]
    rectangular = square = 0
    for direction in rng.normal(size=(60, 3)):
        distance = sizes.max() * 10 ** rng.uniform(-0.2, 1.5)
        source = extents.centres[0] + distance * direction / np.linalg.norm(direction)
        orders = [max(order, least) for order in required_orders(distance, *sizes, degree, 1e-5, 1.9)]
        if max(orders) > MAX_GAUSS_POINTS:
            continue
        rectangular += orders[0] * orders[1]
        square += max(orders) ** 2
        exact = integrals(kernel, element_rule(element, nodes, source, 1e-10), source)
        computed = integrals(kernel, tensor_rule(element, nodes, *orders), source)
        for value, reference in zip(computed, exact, strict=True):
            assert np.abs(value - reference).max() < 1.2e-5 * np.abs(reference).sum(axis=0).max()
    assert rectangular <= square
    assert name != "quad4, seven to one" or rectangular < 0.7 * square


def integrals(kernel, rule, source):
    return [
        np.einsum("m,ma,mjk->ajk", rule.measures, rule.shapes, pair)
        for pair in kernel.evaluate(rule.positions - source, rule.normals)
    ]
