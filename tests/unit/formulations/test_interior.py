"""Test the interior representation of boundary elements: exact fields, points near the surface, rejected points."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.elements import Quad4, Quad9, Tri6
from meeframe.fields import THERMAL_FIELD, FieldScaling
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.material import library_material, rotation_about
from meeframe.mesh import box_mesh, half_space_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.results.interior import interior
from meeframe.system.capabilities import InteriorFields
from meeframe.testing.manufactured import LinearField, PointSourceField, prescribe

STIFFNESS = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
FACTORS = FieldScaling.of(STIFFNESS).factors
SIDES = (1.0, 1.5, 0.8)
CONDITIONS = {"z-": "vvvvv"} | dict.fromkeys(("x-", "x+", "y-", "y+"), "fffff")


def exact_problem(field, element, divisions):
    """Return the system of a box with the boundary data of an exact field, and the load of that field on the top."""
    mesh = box_mesh(SIDES, divisions, element)
    body = replace(prescribe(mesh, field, STIFFNESS, CONDITIONS), contact_group="z+")
    system = DenseBEM(quadrature_tolerance=1e-7).reduce(body)
    load = field.fluxes(system.points, system.frames[:, 2])
    load[:, :3] = np.einsum("nai,ni->na", system.frames, load[:, :3])
    return system, load, mesh


def inside(mesh, fractions):
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    return low + (high - low) * fractions


@pytest.mark.parametrize("element", [Quad4(), Tri6()], ids=lambda e: e.name)
def test_linear_fields_are_exact(element):
    """Values and uniform stress, D and B of a linear state of a coupled block are exact to the tolerance of the
    table."""
    field = LinearField.random(STIFFNESS, seed=5)
    system, load, mesh = exact_problem(field, element, (1, 2, 1))
    points = inside(mesh, np.random.default_rng(4).uniform(0.05, 0.95, (8, 3)))
    result = interior(system, load, points)
    values = np.concatenate([result.displacement, result.potentials], axis=1) / FACTORS
    expected = field.values(points) / FACTORS
    np.testing.assert_allclose(values, expected, atol=2e-6 * np.abs(expected).max())
    fluxes = np.concatenate([result.stress, result.flux_densities.transpose(0, 2, 1)], axis=2) * FACTORS
    exact = np.einsum("ijkm,km->ij", STIFFNESS, field.gradient) * FACTORS
    np.testing.assert_allclose(fluxes, np.broadcast_to(exact, fluxes.shape), atol=1e-5 * np.abs(exact).max())


def test_points_near_the_surface():
    """Points down to the smallest distance lie below the middle of an element, an edge of the mesh and a corner."""
    field = LinearField.random(STIFFNESS, seed=6)
    system, load, mesh = exact_problem(field, Quad4(), (1, 2, 1))
    high = mesh.points.max(axis=0)
    exact = np.einsum("ijkm,km->ij", STIFFNESS, field.gradient) * FACTORS
    for distance in (1e-1, 1e-2, 1e-3):
        points = high - np.array([[0.3, 0.4, distance], [0.5, 0.75, distance], [distance] * 3])
        computed = system.capability(InteriorFields).evaluate(load, points)
        np.testing.assert_allclose(computed.fluxes * FACTORS, [exact] * 3, atol=3e-5 * np.abs(exact).max())
    for point, message in (
        (high - [0.3, 0.4, 1e-5], "closer to the surface than"),
        (high - [0.3, 0.4, 0.0], "closer to the surface than"),
        (1.1 * high, "outside the body"),
    ):
        with pytest.raises(CaseError, match=message):
            interior(system, load, np.array([high - 0.3, point]))


def test_field_of_a_point_source_converges():
    """Values and gradients converge on two meshes of quad9; exact gradients are central differences of exact values."""
    field = PointSourceField(STIFFNESS, np.array([2.0, 1.5, 1.9]), np.array([1.0, -0.6, 0.8, 0.5, -0.9]))
    errors = []
    for divisions in ((1, 2, 1), (2, 3, 2)):
        system, load, mesh = exact_problem(field, Quad9(), divisions)
        points = inside(mesh, np.array([[0.5, 0.5, 0.5], [0.3, 0.6, 0.7], [0.8, 0.2, 0.4]]))
        computed = system.capability(InteriorFields).evaluate(load, points)
        steps = 1e-4 * np.eye(3)
        slopes = np.stack([(field.values(points + h) - field.values(points - h)) / 2e-4 for h in steps], axis=2)
        difference = (computed.gradients - slopes) / FACTORS[:, None]
        errors.append(np.abs(difference).max() / np.abs(slopes / FACTORS[:, None]).max())
    assert errors[1] < 5e-3
    assert errors[1] < errors[0] / 2.0


def boussinesq(system, pressure, depths):
    """Return the axial stress on the axis under a bilinear pressure: the point solution by Gauss rules on the
    elements."""
    abscissae, weights = np.polynomial.legendre.leggauss(8)
    one, two = (corner.ravel() for corner in np.meshgrid(abscissae, abscissae))
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    shapes = np.prod(1.0 + corners[:, None] * np.stack([one, two], axis=1), axis=2).T / 4.0
    (_, cells) = system.cells[0]
    nodes = system.points[cells]
    area = np.linalg.norm(nodes[:, 1] - nodes[:, 0], axis=1) * np.linalg.norm(nodes[:, 3] - nodes[:, 0], axis=1)
    forces = (pressure[cells] @ shapes.T) * np.outer(area / 4.0, np.outer(weights, weights).ravel())
    squared = ((shapes @ nodes)[..., :2] ** 2).sum(axis=-1)
    return np.array([-3.0 * z**3 / (2.0 * np.pi) * (forces / (squared + z * z) ** 2.5).sum() for z in depths])


@pytest.mark.full
def test_semi_infinite_mesh():
    """The axial stress under a pressure converges with second order on two meshes of a half space."""
    stiffness = library_material("isotropic", young_modulus=2e11, poisson_ratio=0.3).stiffness
    depths = np.array([0.2, 0.6, 1.0])
    errors = []
    for divisions in (10, 16):
        mesh = half_space_mesh(12.0, 2.4, divisions, 8, Quad4())
        system = DenseBEM().reduce(Body(stiffness, mesh, (), "contact"))
        load = np.zeros(system.offset.shape)
        load[:, 2] = -np.sqrt(np.maximum(1.0 - (system.points[:, :2] ** 2).sum(axis=1), 0.0))
        result = interior(system, load, np.stack([0.0 * depths, 0.0 * depths, -depths], axis=1))
        errors.append(np.abs(result.stress[:, 2, 2] - boussinesq(system, -load[:, 2], depths)).max())
    assert errors[1] < 4e-3
    assert errors[0] / errors[1] > 2.2
    with pytest.raises(CaseError, match="outside the body"):
        interior(system, load, np.array([[0.0, 0.0, 0.5]]))


def test_additional_scalar_field():
    """A uniform heat flux passes through a block on a base at zero temperature, independently of a uniform pressure."""
    material = library_material("batio3-cofe2o4").with_field(THERMAL_FIELD, 2.5)
    mesh = box_mesh(SIDES, (1, 2, 1), Quad4())
    conditions = tuple(BoundaryCondition("z-", field, "value") for field in range(6))
    system = DenseBEM().reduce(Body(material.stiffness, mesh, conditions, "z+", material.fields))
    load = np.zeros(system.offset.shape)
    load[:, 5] = 7.0
    points = inside(mesh, np.array([[0.5, 0.5, 0.5], [0.2, 0.7, 0.9]]))
    result = interior(system, load, points, material.fields)
    height = points[:, 2] - mesh.points[:, 2].min()
    np.testing.assert_allclose(result.potentials[:, 2], -7.0 / 2.5 * height, rtol=1e-4)
    np.testing.assert_allclose(result.flux_densities[:, 2], [[0.0, 0.0, 7.0]] * 2, atol=1e-3)
    np.testing.assert_allclose(result.field_strengths[:, 2], [[0.0, 0.0, 2.8]] * 2, atol=1e-3)
    assert {row.name: row.unit for row in result.maxima()}["thermal_field"] == "K/m"
    with pytest.raises(CaseError, match=r"the load has shape .* and 5 fields"):
        interior(system, load, points)
