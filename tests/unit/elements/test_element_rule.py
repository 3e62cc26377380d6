"""Integrals over near, distant and singular elements agree with closed forms (flat) and one-dimensional integrals
(curved)."""

from math import cos, hypot, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import quad

from meeframe.common.errors import MeshError
from meeframe.elements import ELEMENTS, Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.elements._kernels import quadrature as kernels
from meeframe.elements.base import shape_functions
from meeframe.elements.quadrature import element_rule, gauss_table, shape_table
from meeframe.testing.polygon import single_layer, solid_angle


def layers(rule, source):
    """Return single and double layer potentials, and the integral of 1/r^2."""
    offset = rule.positions - source
    distance = np.linalg.norm(offset, axis=1)
    double = (offset * rule.normals).sum(axis=1) / distance**3
    return rule.measures @ (1 / distance), rule.measures @ double, rule.measures @ distance**-2


FLAT = {
    "square": np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float),
    "seven to one": np.array([[0, 0, 0], [7, 0, 0], [7, 1, 0], [0, 1, 0]], float),
    "fifty to one": np.array([[0, 0, 0], [1, 0, 0], [1, 50, 0], [0, 50, 0]], float),
    "trapezoid": np.array([[0, 0, 0], [3, 0.2, 0], [2, 1, 0], [0.5, 1.3, 0]], float),
    "triangle": np.array([[0, 0, 0], [1, 0.2, 0], [0.3, 0.9, 0]], float),
    "needle": np.array([[0, 0, 0], [10, 0, 0], [3, 0.5, 0]], float),
}


def flat(corners, quadratic):
    """Return an element with these corners and straight sides."""
    element = {(4, False): Quad4(), (4, True): Quad9(), (3, False): Tri3(), (3, True): Tri6()}[len(corners), quadratic]
    linear = Quad4() if len(corners) == 4 else Tri3()
    return element, shape_functions(linear, element.nodes) @ corners


def surface_points(corners):
    """Return points of the surface, inside, on a side and at a corner, and outward directions."""
    centre = corners.mean(axis=0)
    up = np.array([0.0, 0.0, 1.0])
    side = (0.3 * corners[0] + 0.7 * corners[1], np.array([0.2, -1.0, 0.0]))
    corner = (corners[2], corners[2] - centre)
    yield 0.6 * centre + 0.4 * corners[1], up
    for position, away in (side, corner):
        yield position, up
        away = away / np.linalg.norm(away)
        yield position, away
        yield position, (away - up) / sqrt(2)


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("quadratic", [False, True], ids=["linear", "quadratic"])
@pytest.mark.parametrize("corners", FLAT.values(), ids=FLAT)
@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
def test_flat_element_near_and_far(corners, quadratic, tolerance):
    element, nodes = flat(corners, quadratic)
    size = np.linalg.norm(corners[1] - corners[0])
    for position, direction in surface_points(corners):
        for distance in (1e-3, 1e-2, 0.1, 0.5, 3.0):
            source = position + distance * size * direction
            single, double, absolute = layers(element_rule(element, nodes, source, tolerance), source)
            assert single == pytest.approx(single_layer(corners, source), rel=tolerance)
            assert abs(double - solid_angle(corners, source)) < tolerance * absolute


def test_elongated_element_is_cheap():
    """Cells are halved across their longer side: the extra points of a 50:1 element are proportional to its length."""
    counts = []
    for length in (1.0, 50.0):
        nodes = np.array([[0, 0, 0], [length, 0, 0], [length, 1, 0], [0, 1, 0]])
        counts.append(len(element_rule(Quad4(), nodes, np.array([length / 2, 0.5, 1e-2]), 1e-6).weights))
    assert counts[1] < 3 * counts[0]


@pytest.mark.parametrize("corners", FLAT.values(), ids=FLAT)
@pytest.mark.parametrize("quadratic", [False, True], ids=["linear", "quadratic"])
def test_weakly_singular_at_every_node(corners, quadratic):
    element, nodes = flat(corners, quadratic)
    for xi, source in zip(element.nodes, nodes, strict=True):
        for tolerance in (1e-6, 1e-11):
            single, _, _ = layers(element_rule(element, nodes, source, tolerance, xi), source)
            assert single == pytest.approx(single_layer(corners, source), rel=tolerance)


def test_weakly_singular_inside():
    for xi in ([0.3, -0.8], [0.99, 0.999], [1.0, 0.4]):
        nodes = FLAT["trapezoid"]
        source = shape_functions(Quad4(), np.array([xi]))[0] @ nodes
        single, _, _ = layers(element_rule(Quad4(), nodes, source, 1e-9, np.array(xi)), source)
        assert single == pytest.approx(single_layer(nodes, source), rel=1e-9)


def test_function_that_vanishes_at_the_source():
    """int x y / r^3 dS over [0, a] x [0, b] from the origin is a + b - sqrt(a^2 + b^2)."""
    a, b = 3.0, 0.4
    nodes = np.array([[0, 0, 0], [a, 0, 0], [a, b, 0], [0, b, 0]])
    rule = element_rule(Quad4(), nodes, nodes[0], 1e-10, Quad4().nodes[0])
    x, y = rule.positions[:, 0], rule.positions[:, 1]
    value = rule.measures @ (x * y / np.hypot(x, y) ** 3)
    assert value == pytest.approx(a + b - hypot(a, b), rel=1e-10)


CURVATURE = 0.35
# Rectangles of a paraboloid z = k (x^2 + y^2) / 2 about its apex: lower and upper x, lower and upper y.
PATCHES = {
    "inside": (-1.0, 1.0, -1.0, 1.0),
    "on a side": (-1.0, 1.0, 0.0, 1.0),
    "at a corner": (0.0, 1.0, 0.0, 1.0),
    "elongated": (-3.0, 4.0, 0.0, 1.0),
}


def paraboloid(patch):
    """Return the nodes of a quad9 that represents the paraboloid exactly."""
    x0, x1, y0, y1 = patch
    x = x0 + (x1 - x0) * (Quad9().nodes[:, 0] + 1) / 2
    y = y0 + (y1 - y0) * (Quad9().nodes[:, 1] + 1) / 2
    return np.column_stack([x, y, CURVATURE * (x**2 + y**2) / 2])


def polar_integral(patch, radial):
    """Integrate radial(distance from the apex to the outline in the x-y plane) over all angles, side by side."""
    x0, x1, y0, y1 = patch
    total = 0.0
    for reach, low, high in ((x1, y0, y1), (y1, -x1, -x0), (-x0, -y1, -y0), (-y0, x0, x1)):
        if reach > 0:
            start, end = np.arctan2(low, reach), np.arctan2(high, reach)
            total += quad(lambda angle, reach=reach: radial(reach / cos(angle)), start, end, epsabs=0, epsrel=1e-12)[0]
    return total


def area_ratio(rho):
    return sqrt(1 + (CURVATURE * rho) ** 2)


@pytest.mark.parametrize("patch", PATCHES.values(), ids=PATCHES)
@pytest.mark.parametrize("height", [1e-3, -0.05, 0.5])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_curved_element_near(patch, height, tolerance):
    nodes, source = paraboloid(patch), np.array([0.0, 0.0, height])
    rule = element_rule(Quad9(), nodes, source, tolerance)
    distance = np.linalg.norm(rule.positions - source, axis=1)

    def ray(power):
        def integrand(rho):
            return rho * area_ratio(rho) / hypot(rho, CURVATURE * rho**2 / 2 - height) ** power

        breaks = [abs(height) * s for s in (0.3, 1, 3, 10, 30, 100)]
        return lambda outline: quad(
            integrand, 0, outline, points=[b for b in breaks if b < outline], epsabs=0, epsrel=1e-12
        )[0]

    for power in (1, 2):
        assert rule.measures @ distance**-power == pytest.approx(polar_integral(patch, ray(power)), rel=tolerance)


@pytest.mark.parametrize("patch", PATCHES.values(), ids=PATCHES)
@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
def test_curved_element_weakly_singular(patch, tolerance):
    nodes, source = paraboloid(patch), np.zeros(3)
    own = -np.array([(patch[1] + patch[0]) / (patch[1] - patch[0]), (patch[3] + patch[2]) / (patch[3] - patch[2])])
    rule = element_rule(Quad9(), nodes, source, tolerance, own)
    single = rule.measures @ (1 / np.linalg.norm(rule.positions, axis=1))

    def ray(outline):
        return quad(lambda r: area_ratio(r) / sqrt(1 + (CURVATURE * r / 2) ** 2), 0, outline, epsrel=1e-12)[0]

    assert single == pytest.approx(polar_integral(patch, ray), rel=tolerance)


def test_solid_angle_depends_on_the_outline_only():
    """A quad9 with straight sides in a plane and a raised middle subtends the solid angle of the flat quadrilateral."""
    nodes = np.column_stack([Quad9().nodes, np.zeros(9)])
    nodes[8, 2] = 0.4
    corners = nodes[:4]
    for source in ([0.1, 0.2, 0.5], [0.0, 0.0, 0.401], [0.0, 0.0, 0.399], [1.001, 0.3, 0.0], [0.2, -0.1, -0.3]):
        _, double, absolute = layers(element_rule(Quad9(), nodes, np.array(source), 1e-8), np.array(source))
        exact = solid_angle(corners, np.array(source))
        if 0 < source[2] < 0.4:
            # the source lies between the raised element and the plane of its outline, on the other side of a
            # closed surface
            exact += 4 * pi
        assert abs(double - exact) < 1e-8 * absolute


def test_kernel_reports_a_small_buffer():
    points, weights = np.empty((10, 2)), np.empty(10)
    nodes, source = FLAT["square"], np.array([0.5, 0.5, 0.01])
    # all arguments, as in the library, or another version would be compiled
    count = kernels.element_rule(
        source, nodes, shape_table(Quad4()), np.full(2, np.nan), 1e-6, gauss_table(), points, weights, 1.5
    )
    assert count == kernels.BUFFER_TOO_SMALL


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
def test_source_outside_its_element(element):
    nodes = np.column_stack([element.nodes, np.zeros(len(element.nodes))])
    with pytest.raises(MeshError, match=rf"{element.name} element of which it is not a node"):
        element_rule(element, nodes, np.array([0.3, 0.4, 0.0]), 1e-6)


def test_rules_do_not_depend_on_the_unit_of_length():
    nodes = paraboloid(PATCHES["inside"])
    source = np.array([0.2, 0.1, 0.3])
    for element, shape in ((Quad9(), nodes), (Quad8(), nodes[:8])):
        large = element_rule(element, shape, source, 1e-6)
        small = element_rule(element, 1e-6 * shape, 1e-6 * source, 1e-6)
        assert np.allclose(large.points, small.points)
        assert small.measures.sum() == pytest.approx(1e-12 * large.measures.sum())


def test_polar_reference():
    assert polar_integral(PATCHES["elongated"], lambda outline: outline**2 / 2) == pytest.approx(7.0)
