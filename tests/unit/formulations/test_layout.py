"""Test degrees of freedom of dense boundary elements: counts, contradictions, undetermined fields."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.elements import Quad4, Quad9, Tri3
from meeframe.fields import FieldScaling
from meeframe.formulations.dense_bem.collocation import collocate
from meeframe.formulations.dense_bem.layout import NONE, Layout, lay_out
from meeframe.formulations.dense_bem.patches import find_patches
from meeframe.formulations.dense_bem.units import Units
from meeframe.material import library_material
from meeframe.mesh import box_mesh, sphere_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.surface import SurfaceMesh

MATERIAL = library_material("batio3-cofe2o4")


def clamped(group: str) -> tuple[BoundaryCondition, ...]:
    return tuple(BoundaryCondition(group, field, "value") for field in range(5))


def layout_of(mesh: SurfaceMesh, conditions: tuple[BoundaryCondition, ...], contact: str | None = None) -> Layout:
    body = Body(MATERIAL.stiffness, mesh, conditions, contact)
    return lay_out(body, find_patches(mesh, np.pi / 6), Units(1.0, FieldScaling.of(MATERIAL.stiffness)))


@pytest.mark.parametrize(("element", "per_face"), [(Quad4(), 3 * 4), (Tri3(), 3 * 4), (Quad9(), 5 * 7)])
def test_tractions_of_a_box_are_continuous_on_its_faces_and_jump_at_its_edges(element, per_face):
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 3, 2), element)
    faces = {"x": (3, 2), "y": (2, 2), "z": (2, 3)}
    per_axis = {
        axis: np.prod([(per_face == 35 and 2 * n + 1) or n + 1 for n in cells]) for axis, cells in faces.items()
    }
    patches = find_patches(mesh, np.pi / 6)
    assert len(patches.point) == 2 * sum(per_axis.values())


def test_edges_inside_a_group_are_found_by_angle():
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 2), Quad4())
    named = find_patches(mesh, np.pi / 6)
    block = mesh.blocks[0]
    unnamed = SurfaceMesh(mesh.points, (replace(block, groups=np.zeros_like(block.groups)),), ("all",))
    assert len(find_patches(unnamed, np.pi / 6).point) == len(named.point)
    assert len(find_patches(unnamed, 0.9 * np.pi).point) == len(mesh.points)


def test_smooth_sphere_has_one_flux_node_per_point():
    mesh = sphere_mesh(1.0, 4, Quad9())
    assert len(find_patches(mesh, np.pi / 6).point) == len(mesh.points)


@pytest.mark.parametrize("clamps", [("z-",), ("z-", "x+"), ("z-", "x+", "y-")])
def test_every_unknown_has_one_equation(clamps):
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 2), Quad4())
    layout = layout_of(mesh, sum((clamped(group) for group in clamps), ()))
    rows = collocate(mesh, layout).row
    np.testing.assert_array_equal(np.sort(rows[rows != NONE]), np.arange(layout.n_unknowns))


def test_contradictory_conditions_are_rejected():
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 2), Quad4())
    conditions = (*clamped("z-"), BoundaryCondition("x+", 3, "value", 1.0))
    with pytest.raises(
        CaseError, match=r"electric_potential on 'x\+' contradicts another face at 3 shared points: 1 and 0"
    ):
        layout_of(mesh, conditions)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ((0, 1, 2, 3), "no boundary condition prescribes magnetic_potential"),
        ((0, 1, 2, 4), "no boundary condition prescribes electric_potential"),
        ((0, 1, 3, 4), "leave 3 of the 6 rigid motions free"),
    ],
)
def test_undetermined_fields_are_rejected(fields, message):
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 2), Quad4())
    conditions = tuple(BoundaryCondition("z-", field, "value") for field in fields)
    with pytest.raises(CaseError, match=message):
        layout_of(mesh, conditions)


def test_three_rollers_support_a_box():
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 2), Quad4())
    rollers = tuple(BoundaryCondition(group, axis, "value") for axis, group in enumerate(("x-", "y-", "z-")))
    potentials = tuple(BoundaryCondition("z-", field, "value") for field in (3, 4))
    assert layout_of(mesh, rollers + potentials).n_unknowns > 0


def test_conditions_on_the_contact_zone_are_rejected():
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 2), Quad4())
    with pytest.raises(CaseError, match="it is the contact zone"):
        layout_of(mesh, (*clamped("z-"), BoundaryCondition("z+", 3, "value")), contact="z+")
    with pytest.raises(CaseError, match="electric_potential is prescribed on a face that touches the contact zone"):
        layout_of(mesh, (*clamped("z-"), BoundaryCondition("x+", 3, "value")), contact="z+")


def test_values_of_the_zone_are_numbered_last():
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 2), Quad4())
    layout = layout_of(mesh, clamped("z-"), contact="z+")
    last = np.arange(layout.n_unknowns - layout.zone.size * 5, layout.n_unknowns)
    np.testing.assert_array_equal(layout.value_column[layout.zone].ravel(), last)
    columns = np.concatenate([layout.value_column.ravel(), layout.flux_column.ravel()])
    np.testing.assert_array_equal(np.sort(columns[columns != NONE]), np.arange(layout.n_unknowns))
