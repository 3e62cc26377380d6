"""Test interior fields by finite elements: exact fields, points on faces and outside, boundary elements."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_skfem import FiniteElements
from meeframe_skfem.elements import HEX8, HEX27, tabulate
from meeframe_skfem.grid import tensor_grid
from meeframe_skfem.interior import locate

from meeframe.common.errors import CaseError
from meeframe.elements import Quad4, Quad9
from meeframe.fields import FieldScaling
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.material import library_material, rotation_about
from meeframe.mesh import block_mesh
from meeframe.results.interior import interior
from meeframe.system.capabilities import InteriorFields
from meeframe.testing.manufactured import LinearField, PointSourceField, prescribe

STIFFNESS = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
FACTORS = FieldScaling.of(STIFFNESS).factors
CONDITIONS = {"base": "vvvvv"} | dict.fromkeys(("top", "side_x-", "side_x+", "side_y-", "side_y+"), "fffff")


def make_body(field, divisions=2, element=None):
    mesh = block_mesh((0.5, 0.4), 0.6, (0.4, 0.3), (divisions + 1, divisions), 2, 2, element or Quad4())
    return replace(prescribe(mesh, field, STIFFNESS, CONDITIONS), contact_group="contact")


def exact_load(field, system):
    load = field.fluxes(system.points, system.frames[:, 2])
    load[:, :3] = np.einsum("nai,ni->na", system.frames, load[:, :3])
    return load


def inside(body, count=10):
    low, high = body.mesh.points.min(axis=0), body.mesh.points.max(axis=0)
    return low + (high - low) * np.random.default_rng(1).uniform(0.05, 0.95, (count, 3))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("element", [Quad4(), Quad9()], ids=lambda e: e.name)
def test_linear_fields_are_exact(element):
    """A linear state of a coupled block is exact to round-off, also on the surface and at corners of elements."""
    field = LinearField.random(STIFFNESS, seed=3)
    body = make_body(field, element=element)
    system = FiniteElements(growth=2.0).reduce(body)
    points = np.concatenate([inside(body), system.points, body.mesh.points[:5]])
    result = interior(system, exact_load(field, system), points)
    values = np.concatenate([result.displacement, result.potentials], axis=1) / FACTORS
    expected = field.values(points) / FACTORS
    np.testing.assert_allclose(values, expected, atol=1e-10 * np.abs(expected).max())
    fluxes = np.concatenate([result.stress, result.flux_densities.transpose(0, 2, 1)], axis=2) * FACTORS
    exact = np.einsum("ijkm,km->ij", STIFFNESS, field.gradient) * FACTORS
    np.testing.assert_allclose(fluxes, np.broadcast_to(exact, fluxes.shape), atol=1e-9 * np.abs(exact).max())


@pytest.mark.full
def test_against_boundary_elements():
    """Finite and boundary elements agree within the errors of both, which the exact field determines."""
    field = PointSourceField(STIFFNESS, np.array([1.0, 0.9, 1.1]), np.array([1.0, -0.6, 0.8, 0.5, -0.9]))
    body = make_body(field, 4, Quad9())
    points = inside(body)
    steps = 1e-4 * np.eye(3)
    slopes = np.stack([(field.values(points + h) - field.values(points - h)) / 2e-4 for h in steps], axis=2)
    scale = FACTORS[:, None] * np.abs(slopes / FACTORS[:, None]).max()
    computed = []
    for formulation, bound in ((FiniteElements(growth=1.5), 0.05), (DenseBEM(), 0.02)):
        system = formulation.reduce(body)
        gradients = system.capability(InteriorFields).evaluate(exact_load(field, system), points).gradients
        assert np.abs((gradients - slopes) / scale).max() < bound
        computed.append(gradients)
    assert np.abs((computed[1] - computed[0]) / scale).max() < 0.07


@pytest.mark.parametrize("element", [HEX8, HEX27], ids=lambda e: e.name)
def test_points_in_distorted_elements(element):
    grid = tensor_grid((np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, 3.0]), np.array([0.0, 0.5, 1.0])), element)
    x, y, z = grid.points.T
    bent = np.stack([x + 0.1 * y * z, y + 0.1 * np.sin(x), z + 0.05 * x * y], axis=1)
    mesh = replace(grid, points=bent)
    shapes = np.random.default_rng(0).dirichlet(np.ones(8), 20)
    cells = np.arange(20) % len(mesh.cells)
    points = np.einsum("mn,mnx->mx", shapes, mesh.points[mesh.cells[cells, :8]])
    computed, xi = locate(mesh, points)
    assert (computed >= 0).all()
    values, _ = tabulate(element, xi)
    np.testing.assert_allclose(np.einsum("mn,mnx->mx", values, mesh.points[mesh.cells[computed]]), points, atol=1e-10)
    assert locate(mesh, np.array([[10.0, 0.0, 0.0], [-0.5, 1.0, 0.5]]))[0].tolist() == [-1, -1]


def test_points_outside_are_rejected():
    field = LinearField.random(STIFFNESS, seed=3)
    body = make_body(field)
    system = FiniteElements(growth=2.0).reduce(body)
    with pytest.raises(CaseError, match="1 of 1 points are outside the body"):
        interior(system, exact_load(field, system), np.array([[9.0, 0.0, 0.0]]))
