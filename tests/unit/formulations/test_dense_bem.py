"""Dense boundary elements against exact fields."""

import numpy as np
import pytest

from meeframe.core.body import Body, BoundaryCondition
from meeframe.core.errors import CaseError, MeshError
from meeframe.core.fields import Array
from meeframe.core.formulation import ReducedSystem
from meeframe.elements import Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.fundamental import LineIntegral, Tabulated
from meeframe.geometry import block_mesh, box_mesh
from meeframe.materials import library_material, rotation_about
from meeframe.testing.manufactured import LinearField, prescribe, relative_errors

TRICLINIC = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8))
TIGHT = DenseBEM(LineIntegral(), quadrature_tolerance=1e-13)
MIXED = {"x-": "vvvvv", "x+": "vfffv", "y-": "fffvf", "y+": "fvvff", "z-": "vvvvv", "z+": "fffff"}
"""Mechanical, electric and magnetic partitions that differ, with corners where three clamped faces meet."""


@pytest.mark.parametrize("element", [Quad4(), Quad8(), Quad9(), Tri3(), Tri6()], ids=lambda e: e.name)
def test_linear_fields_are_exact(element):
    mesh = box_mesh((1.0, 1.5, 0.8), (1, 2, 1), element)
    field = LinearField.random(TRICLINIC.stiffness, seed=5)
    computed = TIGHT.boundary_fields(prescribe(mesh, field, TRICLINIC.stiffness, MIXED))
    assert max(relative_errors(mesh, field, computed)) < 1e-8


def test_linear_fields_are_exact_in_any_unit_of_length():
    mesh = box_mesh((1e-6, 2e-6, 1e-6), (1, 2, 1), Quad4())
    field = LinearField.random(TRICLINIC.stiffness, seed=6)
    field = LinearField(field.stiffness, field.gradient, 1e-6 * field.constant)
    computed = TIGHT.boundary_fields(prescribe(mesh, field, TRICLINIC.stiffness, MIXED))
    assert max(relative_errors(mesh, field, computed)) < 1e-8


BASE = tuple(BoundaryCondition("base", field, "value") for field in range(5))


def small_block(divisions: int = 4) -> Body:
    mesh = block_mesh(0.05, 0.12, 0.005, divisions, 3, 3, Quad4())
    return Body(library_material("batio3-cofe2o4").stiffness, mesh, BASE, "contact")


@pytest.fixture(scope="module")
def reduced() -> ReducedSystem:
    return DenseBEM(Tabulated(), quadrature_tolerance=1e-8).reduce(small_block())


def pressure(system: ReducedSystem) -> Array:
    load = np.zeros((len(system.points), 5))
    load[:, 2] = -1e8 * (1 + system.points[:, 0] / 0.005)
    return load


def test_compliance_is_all_but_symmetric_with_positive_definite_symmetric_part(reduced):
    n = len(reduced.points)
    matrix = reduced.dense().reshape(5 * n, 5 * n)
    weighted = matrix * np.repeat(reduced.weights, 5)[:, None]
    scale = 1 / np.sqrt(np.diag(weighted))
    scaled = weighted * scale[:, None] * scale
    assert np.linalg.eigvalsh(scaled + scaled.T).min() > 0


def test_load_on_the_zone_equals_the_same_traction_prescribed(reduced):
    """The reduced system against a plain boundary value problem on the same mesh."""
    body = small_block()
    load = pressure(reduced)
    fluxes = tuple(BoundaryCondition("contact", field, "flux", load[:, field]) for field in range(5))
    plain = DenseBEM(Tabulated(), quadrature_tolerance=1e-8).boundary_fields(
        Body(body.stiffness, body.mesh, body.conditions + fluxes, None)
    )
    recovered = reduced.recover(load)
    scale = np.abs(plain.values).max(axis=0)
    order = [np.lexsort(fields.points.T) for fields in (plain, recovered)]
    np.testing.assert_allclose(recovered.points[order[1]], plain.points[order[0]])
    np.testing.assert_allclose(recovered.values[order[1]] / scale, plain.values[order[0]] / scale, atol=1e-9)


def test_recovered_fields_agree_with_the_compliance(reduced):
    load = pressure(reduced)
    displacement = reduced.offset + reduced.apply(load)
    fields = reduced.recover(load)
    for point, values in zip(reduced.points, displacement, strict=True):
        same = np.flatnonzero(np.all(np.isclose(fields.points, point, atol=1e-12), axis=1))
        np.testing.assert_allclose(fields.values[same[0], :3], values[:3], rtol=1e-12, atol=1e-20)
        np.testing.assert_allclose(fields.values[same[0], 3:], -values[3:], rtol=1e-12)


def imbalance(divisions: int, layers: int) -> float:
    """Resultant of the normal tractions over the whole surface, relative to the force on the zone."""
    mesh = block_mesh(0.05, 0.12, 0.05, divisions, 3, layers, Quad4())
    system = DenseBEM().reduce(Body(library_material("batio3-cofe2o4").stiffness, mesh, BASE, "contact"))
    load = pressure(system)
    fields = system.recover(load)
    total = 0.0
    for _, cells in fields.cells:
        a, b, c, d = (fields.points[cells[:, k]] for k in range(4))
        area = np.linalg.norm(np.cross(c - a, d - b), axis=1) / 2
        total += float(area @ fields.fluxes[cells, 2].mean(axis=1))
    return abs(total / (system.weights @ load[:, 2]))


def test_reaction_of_the_base_balances_the_load_as_the_mesh_is_refined():
    coarse, fine = imbalance(4, 3), imbalance(8, 6)
    assert coarse < 0.1
    assert fine < 0.6 * coarse


def test_open_meshes_and_missing_zones_are_refused():
    body = small_block()
    with pytest.raises(CaseError, match="no contact zone"):
        DenseBEM().reduce(Body(body.stiffness, body.mesh, body.conditions, None))
    with pytest.raises(MeshError, match="no face group 'nowhere'"):
        DenseBEM().reduce(Body(body.stiffness, body.mesh, body.conditions, "nowhere"))
