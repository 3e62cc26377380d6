"""Test quadrature over random elements and sources, and closed surfaces of random anisotropic materials."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meeframe.elements import ELEMENTS, Quad4, Quad9, Tri3, Tri6
from meeframe.elements.anisotropy import anisotropy
from meeframe.elements.base import shape_functions
from meeframe.elements.quadrature import element_rule
from meeframe.greens import LineIntegral
from meeframe.mesh import box_mesh, sphere_mesh
from meeframe.testing.element import check_element, reference_points
from meeframe.testing.polygon import single_layer, solid_angle
from meeframe.testing.principal_value import free_term, tangent_facet, traction_principal_value
from meeframe.testing.strategies import extended_stiffness, unit_vectors


@settings(max_examples=20, deadline=None)
@given(element=st.sampled_from(list(ELEMENTS.values())), seed=st.integers(0, 1000))
def test_elements_conform(element, seed):
    check_element(element, seed)


@st.composite
def flat_elements(draw):
    """Generate a flat quadrilateral or triangle in any orientation, up to 50:1: element, nodes, corners."""
    element = draw(st.sampled_from([Quad4(), Quad9(), Tri3(), Tri6()]))
    linear = Quad4() if element.reference == "quadrilateral" else Tri3()
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    plane = linear.nodes + 0.15 * rng.uniform(-1, 1, linear.nodes.shape)
    stretched = np.column_stack([draw(st.floats(1.0, 50.0)) * plane[:, 0], plane[:, 1], np.zeros(len(plane))])
    corners = stretched @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return element, shape_functions(linear, element.nodes) @ corners, corners


@settings(max_examples=60, deadline=None)
@given(
    flat=flat_elements(),
    seed=st.integers(0, 1000),
    exponent=st.floats(-3.0, 1.0),
    direction=unit_vectors(1),
    tolerance=st.sampled_from([1e-6, 1e-9]),
)
def test_potentials_of_flat_elements(flat, seed, exponent, direction, tolerance):
    element, nodes, corners = flat
    size = np.linalg.norm(corners[1] - corners[0])
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    # at least slightly upwards, so that sources do not lie in the plane of the element
    direction = direction[0] + np.copysign(0.5, direction[0] @ normal) * normal
    position = shape_functions(element, reference_points(element, 1, seed)) @ nodes
    source = position[0] + 10**exponent * size * direction / np.linalg.norm(direction)
    rule = element_rule(element, nodes, source, tolerance)
    offset = rule.positions - source
    distance = np.linalg.norm(offset, axis=1)
    double = rule.measures @ ((offset * rule.normals).sum(axis=1) / distance**3)
    assert rule.measures @ (1 / distance) == pytest.approx(single_layer(corners, source), rel=tolerance)
    assert abs(double - solid_angle(corners, source)) < tolerance * (rule.measures @ distance**-2)


@settings(max_examples=40, deadline=None)
@given(flat=flat_elements(), seed=st.integers(0, 1000), inside=st.booleans())
def test_weakly_singular_on_flat_elements(flat, seed, inside):
    element, nodes, corners = flat
    own = reference_points(element, 1, seed)[0] if inside else element.nodes[seed % len(nodes)]
    source = shape_functions(element, own[None])[0] @ nodes
    rule = element_rule(element, nodes, source, 1e-9, own)
    distance = np.linalg.norm(rule.positions - source, axis=1)
    assert rule.measures @ (1 / distance) == pytest.approx(single_layer(corners, source), rel=1e-9)


def elements_of(mesh):
    block = mesh.blocks[0]
    return block.element, mesh.points[block.connectivity]


@pytest.mark.full
@settings(max_examples=12, deadline=None)
@given(
    stiffness=extended_stiffness(),
    number=st.integers(0, 23),
    seed=st.integers(0, 1000),
    exponent=st.floats(-3.0, -0.5),
    outside=st.booleans(),
    curved=st.booleans(),
)
def test_unit_flux_through_a_closed_surface_from_nearby(stiffness, number, seed, exponent, outside, curved):
    """int T dS is minus the identity from inside and zero from outside, at any distance of the source from the
    surface."""
    kernel, medium = LineIntegral().bind(stiffness), anisotropy(stiffness)
    element, nodes = elements_of(sphere_mesh(1.0, 2, Quad9()) if curved else box_mesh((2, 2, 14), (2, 2, 2), Quad4()))
    xi = reference_points(element, 1, seed)
    position = shape_functions(element, xi)[0] @ nodes[number]
    centre = shape_functions(element, np.zeros((1, 2)))[0] @ nodes[number]
    normal = centre if curved else np.where(np.isclose(np.ptp(nodes[number], axis=0), 0), centre, 0)
    normal = normal / np.linalg.norm(normal)
    source = position + (1 if outside else -1) * 10**exponent * normal
    flux = np.zeros((5, 5))
    size = 0.0
    for each in nodes:
        rule = element_rule(element, each, source, 1e-6, anisotropy=medium)
        traction = kernel.evaluate(rule.positions - source, rule.normals)[1]
        flux += np.einsum("m,mjk->jk", rule.measures, traction)
        size += np.einsum("m,mjk->jk", rule.measures, np.abs(traction)).max()
    assert np.abs(flux + (0 if outside else 1) * np.eye(5)).max() < 1e-6 * size


@pytest.mark.full
@settings(max_examples=10, deadline=None)
@given(stiffness=extended_stiffness(), seed=st.integers(0, 1000), curved=st.booleans())
def test_free_term_and_principal_value_of_constant_fields(stiffness, seed, curved):
    """c + principal value over a closed surface vanishes at any node of an elongated, sheared box and of a sphere."""
    kernel, medium = LineIntegral().bind(stiffness), anisotropy(stiffness)
    rng = np.random.default_rng(seed)
    element, nodes = elements_of(sphere_mesh(1.0, 2, Quad9()) if curved else box_mesh((2, 2, 10), (2, 2, 2), Quad4()))
    if not curved:
        nodes = nodes @ (np.eye(3) + 0.2 * rng.uniform(-1, 1, (3, 3)))
    source = nodes[rng.integers(len(nodes)), rng.integers(nodes.shape[1])]
    total, facets = np.zeros((5, 5)), []
    for each in nodes:
        distance = np.linalg.norm(each - source, axis=1)
        local = int(distance.argmin())
        if distance[local] < 1e-12:
            facets.append(tangent_facet(element, each, local))
            total += traction_principal_value(kernel, element, each, local, 1e-8, medium).sum(axis=0)
        else:
            rule = element_rule(element, each, source, 1e-8, anisotropy=medium)
            total += np.einsum("m,mjk->jk", rule.measures, kernel.evaluate(rule.positions - source, rule.normals)[1])
    assert np.abs(total + free_term(kernel, np.array(facets))).max() < 1e-6
