"""The formulation satisfies its contract, is found by its entry point, and rejects unsupported bodies."""

import re
from dataclasses import replace

import meshio
import numpy as np
import pytest
from meeframe_skfem import FiniteElements

from meeframe.common.errors import CaseError, MeshError
from meeframe.elements import Quad4, Quad9, Tri6
from meeframe.fields import MEE, FieldSet
from meeframe.material import library_material, rotation_about
from meeframe.mesh import block_mesh, box_mesh, half_space_mesh, sphere_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.plugin.registry import Kind, load
from meeframe.testing import check_formulation
from meeframe.testing.manufactured import LinearField, prescribe

STIFFNESS = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
SIDES = ("top", "side_x-", "side_x+", "side_y-", "side_y+")
ALLOWED = "volume mesh in the file `volume`"


def clamped(mesh, zone, base):
    return Body(STIFFNESS, mesh, tuple(BoundaryCondition(base, field, "value") for field in range(5)), zone)


def block(element, **changes):
    given = {"half_width": 0.5, "height": 0.8, "contact_width": 0.4, "divisions": 3, "rings": 1, "layers": 2}
    return clamped(block_mesh(**(given | changes), element=element), "contact", "base")


@pytest.mark.full
def test_conformance():
    check_formulation(FiniteElements(), tolerance=1e-10)


@pytest.mark.full
def test_conformance_with_hex27():
    field = LinearField.random(STIFFNESS, seed=5)
    kinds = {"base": "vvvvv", **dict.fromkeys(SIDES, "fffff")}
    body = replace(prescribe(block(Quad9()).mesh, field, STIFFNESS, kinds), contact_group="contact")
    check_formulation(FiniteElements(growth=2.0), body, field, tolerance=1e-10)


def test_registration_and_keys(tmp_path):
    registry = replace(load(), folder=tmp_path)
    assert next(e for e in registry.entries if e.record.name == "skfem").provider.name == "meeframe-skfem"
    made = registry.create(Kind.FORMULATION, {"name": "skfem", "layers": 4, "volume": "a.vtu", "unit": "1 mm"})
    assert (made.layers, made.outside, made.volume, made.unit) == (4, None, tmp_path / "a.vtu", 1e-3)
    for key, value in {
        "growth": 0.5,
        "outside": 0,
        "layers": 2.5,
        "unit": "1 s",
        "linear_solver": "lu",
        "grid": "rings",
    }.items():
        with pytest.raises(CaseError, match=key):
            registry.create(Kind.FORMULATION, {"name": "skfem", key: value})
        if key != "unit":
            with pytest.raises(CaseError, match=key):
                FiniteElements(**{key: value})
    with pytest.raises(CaseError, match="layers = 3: shells have none"):
        FiniteElements(grid="shells", layers=3)


def sheared():
    """Return a block whose base is moved sideways, so that it is not a box."""
    body = block(Quad4())
    points = body.mesh.points + np.outer(np.where(body.mesh.points[:, 2] < -0.7, 0.1, 0.0), [1.0, 0.0, 0.0])
    return replace(body, mesh=replace(body.mesh, points=points))


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (clamped(half_space_mesh(0.5, 0.2, 2, 2, Quad4()), "contact", "top"), "semi-infinite"),
        (replace(clamped(sphere_mesh(1.0, 3, Quad4()), "surface", "surface"), contact_group=None), "no contact zone"),
        (sheared(), "not a box, since its surface has a point at"),
        (block(Tri6()), "made of tri6"),
    ],
    ids=["half space", "no zone", "tilted block", "triangles"],
)
def test_bodies_without_a_grid_are_rejected_early(body, message):
    body = replace(body, conditions=() if "surface" in body.mesh.group_names else body.conditions)
    with pytest.raises(MeshError, match=message) as caught:
        FiniteElements().check(body)
    assert ALLOWED in str(caught.value)


def test_zone_that_is_no_grid_is_rejected():
    mesh = box_mesh((1.0, 1.0, 1.0), (3, 3, 3), Quad4())
    blocks, position = [], mesh.points.copy()
    for b in mesh.blocks:
        top = b.groups == 5
        middles = position[b.connectivity].mean(axis=1)
        lower = top & ((middles[:, 0] < 0) | (middles[:, 1] < 0))  # an L-shaped zone
        blocks.append(replace(b, groups=np.where(top & ~lower, 4, b.groups)))
    with pytest.raises(MeshError, match="not a rectangular grid"):
        FiniteElements().check(clamped(replace(mesh, blocks=tuple(blocks)), "z+", "z-"))


def test_grid_too_large_for_memory_is_rejected():
    body = block(Quad4(), contact_width=0.001)
    unknowns = []
    for fields in (MEE, FieldSet(MEE.scalars[:1])):
        stiffness = body.stiffness[:, : fields.size, : fields.size]
        with pytest.raises(MeshError, match=r"unknowns need about .* GB; this process may use") as caught:
            FiniteElements(growth=1.0).check(replace(body, stiffness=stiffness, fields=fields))
        unknowns.append(float(re.search(r"(\S+) unknowns", str(caught.value)).group(1)))
    assert unknowns[0] / unknowns[1] == pytest.approx(5 / 4, rel=1e-2), "the message has three digits"


def cube_body(mesh):
    return clamped(mesh, "z+", "z-")


def test_invalid_volume_files_are_rejected(cube_file, make_cube, tmp_path):
    mesh, file = cube_file("hex8", 2)
    FiniteElements(volume=file, unit=1e-3).check(cube_body(mesh))
    with pytest.raises(MeshError, match=r"missing\.vtu.*no such file"):
        FiniteElements(volume=tmp_path / "missing.vtu").check(cube_body(mesh))
    with pytest.raises(MeshError, match="not on the body's surface"):
        FiniteElements(volume=file, unit=1.1e-3).check(cube_body(mesh))
    with pytest.raises(MeshError, match=r"'z\+': its elements are not the faces of the volume mesh"):
        FiniteElements(volume=cube_file("hex8", 3)[1], unit=1e-3).check(cube_body(mesh))
    with pytest.raises(MeshError, match="volume cells in the file: none; allowed: one of hexahedron"):
        FiniteElements(volume=surface_file(mesh, tmp_path)).check(cube_body(mesh))
    wrong = make_cube("hex8", 2)
    path = tmp_path / "inside_out.vtu"
    meshio.write(path, meshio.Mesh(wrong.points, [("hexahedron", wrong.cells[:, [4, 5, 6, 7, 0, 1, 2, 3]])]))
    with pytest.raises(MeshError, match="8 of 8 cells are folded or inside out"):
        FiniteElements(volume=path).check(cube_body(mesh))


@pytest.mark.parametrize("number", [-1, 8, 10**9])
def test_point_numbers_out_of_range_are_rejected(make_cube, tmp_path, number):
    cube = make_cube("hex8", 1)
    cells = cube.cells.copy()
    cells[0, 3] = number
    path = tmp_path / "numbers.vtu"
    meshio.write(path, meshio.Mesh(cube.points, [("hexahedron", cells)]))
    with pytest.raises(MeshError, match=rf"numbers\.vtu.*a cell has point number {number}; allowed: 0 to 7"):
        FiniteElements(volume=path).check(block(Quad4()))


@pytest.mark.parametrize("value", [np.nan, np.inf, 1.5, 0, "two", True])
@pytest.mark.parametrize("name", ["outside", "layers"])
def test_numbers_of_elements_are_integers(name, value):
    with pytest.raises(CaseError, match=f"{name} = .*whole number of at least 1"):
        FiniteElements(**{name: value})


def test_disconnected_bodies_are_rejected(make_cube, tmp_path):
    cube = make_cube("hex8", 1)
    points = np.concatenate([cube.points, cube.points + np.array([3.0, 0.0, 0.0])])
    path = tmp_path / "two.vtu"
    meshio.write(path, meshio.Mesh(points, [("hexahedron", np.concatenate([cube.cells, cube.cells + 8]))]))
    with pytest.raises(MeshError, match="2 separate parts"):
        FiniteElements(volume=path).check(block(Quad4()))


def test_face_groups_that_cut_faces_are_rejected(cube_file, make_cube, tmp_path):
    fine, _ = cube_file("hex8", 4)
    _, coarse_file = cube_file("hex8", 2)
    (elements,) = fine.blocks
    strip = (elements.groups == 4) & (fine.points[elements.connectivity].mean(axis=1)[:, 0] < -0.3)
    groups = np.where(strip, 6, elements.groups)
    mesh = replace(fine, blocks=(replace(elements, groups=groups),), group_names=(*fine.group_names, "strip"))
    with pytest.raises(MeshError, match=r"'z-'.*whole faces"):
        FiniteElements(volume=coarse_file, unit=1e-3).check(cube_body(mesh))


def test_contradictory_conditions_are_rejected():
    body = block(Quad4(), contact_width=0.4)
    one = BoundaryCondition("side_x+", 2, "value", 1e-3)
    with pytest.raises(CaseError, match="contradicts"):
        FiniteElements().check(replace(body, conditions=(*body.conditions, one)))
    top = BoundaryCondition("top", 3, "value", 0.0)
    with pytest.raises(CaseError, match="touches the contact zone"):
        FiniteElements().check(replace(body, conditions=(*body.conditions, top)))
    with pytest.raises(CaseError, match="rigid motions"):
        FiniteElements().check(replace(body, conditions=body.conditions[2:]))


def surface_file(mesh, folder):
    path = folder / "surface.vtu"
    meshio.write(path, meshio.Mesh(mesh.points, [("quad", mesh.blocks[0].connectivity)]))
    return path
