"""Linear fields are exact to round-off; other fields converge with the theoretical order."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_skfem import FiniteElements
from meeframe_skfem.assembly import gradients
from meeframe_skfem.elements import cell_rule, tabulate

from meeframe.elements import Quad4, Quad8, Quad9
from meeframe.fields import FieldScaling
from meeframe.material import library_material, rotation_about
from meeframe.mesh import block_mesh, box_mesh
from meeframe.testing.manufactured import LinearField, PointSourceField, prescribe

QUADS = {"quad4": Quad4(), "quad8": Quad8(), "quad9": Quad9()}
MIXED = {
    "top": "fffff",
    "side_x-": "vfffv",
    "side_x+": "fffvf",
    "side_y-": "fvffv",
    "side_y+": "fffff",
    "base": "vvvvv",
}
HELD_BELOW = {"x-": "fffff", "x+": "fffff", "y-": "fffff", "y+": "fffff", "z-": "vvvvv"}
SLACK = 0.2


def loads_of(solution, field):
    """Return the exact fluxes on the contact zone (n, 5)."""
    zone = solution.matched.zone
    return field.fluxes(zone.points, zone.frames[:, 2])


def worst(computed, exact):
    return float((np.abs(computed - exact).max(axis=0) / np.abs(exact).max(axis=0)).max())


def check_linear(formulation, body, field):
    """Check values at all points of the volume and fluxes on its whole boundary."""
    solution = formulation.solve(body)
    load = loads_of(solution, field)
    assert worst(solution.values(load), field.values(solution.matched.volume.points)) < 1e-10
    fields = solution.fields(load)
    mesh, (_, connectivity) = solution.matched.body.mesh, fields.cells[0]
    normals = np.zeros_like(fields.points)
    corners = mesh.points[mesh.blocks[0].connectivity]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals[connectivity] = (flat / np.linalg.norm(flat, axis=1, keepdims=True))[:, None]
    assert worst(fields.values, field.values(fields.points)) < 1e-10
    assert worst(fields.fluxes, field.fluxes(fields.points, normals)) < 1e-9


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("element", QUADS.values(), ids=QUADS)
def test_linear_fields_of_triclinic_media_in_a_graded_block(element):
    stiffness = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
    field = LinearField.random(stiffness, seed=3)
    mesh = block_mesh((0.5, 0.4), 0.6, (0.4, 0.3), (3, 2), 2, 2, element)
    body = replace(prescribe(mesh, field, stiffness, MIXED), contact_group="contact")
    check_linear(FiniteElements(growth=2.0), body, field)
    check_linear(FiniteElements(growth=2.0, grid="shells"), body, field)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("axis", "right_angles"), [(1, 1), (0, 1), (0, 2)], ids=["x+", "y-", "z-"])
def test_shells_grow_from_any_side_of_a_box(axis, right_angles):
    """The graded block is rotated so that its zone faces another direction."""
    stiffness = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
    block = block_mesh((0.5, 0.4), 0.6, (0.4, 0.3), (3, 2), 2, 2, Quad9())
    turn = rotation_about(np.eye(3)[axis], right_angles * np.pi / 2)
    mesh = replace(block, points=np.round(block.points @ turn.T, 12))
    field = LinearField.random(stiffness, 5)
    body = replace(prescribe(mesh, field, stiffness, MIXED), contact_group="contact")
    check_linear(FiniteElements(growth=1.5, grid="shells"), body, field)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("name", ["hex8", "hex20", "hex27", "tet10"])
def test_linear_fields_in_skewed_cells_from_a_file(cube_file, name):
    stiffness = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
    mesh, file = cube_file(name, 3, 0.06)
    field = LinearField.random(stiffness, seed=4)
    body = replace(prescribe(mesh, field, stiffness, HELD_BELOW), contact_group="z+")
    check_linear(FiniteElements(volume=file, unit=1e-3), body, field)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("zone", ["x-", "x+", "y-", "y+", "z-", "z+"])
def test_the_zone_may_be_any_side_of_a_box(zone):
    stiffness = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
    field = LinearField.random(stiffness, seed=4)
    opposite = zone[0] + ("+" if zone[1] == "-" else "-")
    groups = {name: "vvvvv" if name == opposite else "fffff" for name in HELD_BELOW | {"z+": ""} if name != zone}
    mesh = box_mesh((0.3, 0.4, 0.5), (2, 3, 4), Quad4())
    body = replace(prescribe(mesh, field, stiffness, groups), contact_group=zone)
    check_linear(FiniteElements(), body, field)


def errors(solution, field):
    """Return the relative L2 errors of values, and of fluxes through all planes, of the worst field."""
    mesh, load = solution.matched.volume, loads_of(solution, field)
    values, stiffness = solution.values(load), solution.matched.body.stiffness
    xi, weights = cell_rule(mesh.element, mesh.element.quadrature + 2)
    shape, slopes = tabulate(mesh.element, xi)
    slopes, jacobians = gradients(mesh.points[mesh.cells], slopes)
    measures = (jacobians * weights).ravel()
    positions = np.einsum("mn,enx->emx", shape, mesh.points[mesh.cells]).reshape(-1, 3)
    computed_values = np.einsum("mn,enj->emj", shape, values[mesh.cells]).reshape(-1, 5)
    gradient = np.einsum("emnx,enk->emkx", slopes, values[mesh.cells]).reshape(-1, 5, 3)
    fluxes = np.einsum("ijkm,pkm->pij", stiffness, gradient)
    exact_fluxes = np.stack([field.fluxes(positions, np.broadcast_to(n, positions.shape)) for n in np.eye(3)], axis=1)
    pairs = ((computed_values, field.values(positions)), (fluxes.reshape(-1, 15), exact_fluxes.reshape(-1, 15)))
    scales = (np.ones(5), np.tile(FieldScaling.of(stiffness).factors, 3))
    return [
        np.sqrt((measures @ (a * scale - b * scale) ** 2).reshape(-1, 5).sum(axis=0)
                / (measures @ (b * scale) ** 2).reshape(-1, 5).sum(axis=0)).max()
        for (a, b), scale in zip(pairs, scales, strict=True)
    ]  # fmt: skip


@pytest.mark.full
@pytest.mark.parametrize(
    ("name", "coarse", "order"), [("hex8", 4, 1), ("hex20", 2, 2), ("hex27", 2, 2), ("tet10", 3, 2)]
)
def test_order_of_convergence(cube_file, name, coarse, order):
    """For a source outside the body, values converge with the degree of the shape functions plus one, gradients with
    the degree."""
    stiffness = library_material("orthotropic-mee").stiffness
    field = PointSourceField(stiffness, np.array([1.9, 2.2, 1.7]), np.array([1.0, -0.5, 0.7, 0.8, -0.6]))
    computed_values = []
    for divisions in (coarse, 2 * coarse):
        mesh, file = cube_file(name, divisions)
        body = replace(prescribe(mesh, field, stiffness, HELD_BELOW), contact_group="z+")
        computed_values.append(errors(FiniteElements(volume=file, unit=1e-3).solve(body), field))
    value_order, flux_order = np.log2(np.divide(*computed_values))
    assert value_order > order + 1 - SLACK
    assert flux_order > order - SLACK
