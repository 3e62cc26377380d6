"""Slender bodies are recognised by lengths and thicknesses in closed form."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from meeframe.elements import Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.elements.base import SurfaceElement
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.mesh import box_mesh, check_mesh, half_space_mesh, sphere_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.slenderness import find_slender_limbs
from meeframe.mesh.surface import ElementBlock, SurfaceMesh
from meeframe.model.load import load_case

ROOT = Path(__file__).parents[3]


def clamped(mesh: SurfaceMesh, *groups: str) -> Body:
    """Return a body clamped at face groups; the material does not matter."""
    clamps = tuple(BoundaryCondition(group, field, "value") for group in groups for field in range(5))
    return Body(np.zeros((3, 5, 5, 3)), mesh, clamps, None)


QUADRATIC = Quad9()


def rod(length: float, element: SurfaceElement = QUADRATIC) -> SurfaceMesh:
    """Return a rod two metres wide, whose length is given in widths."""
    return box_mesh((2.0, 2.0, 2.0 * length), (1, 1, 4), element)


@pytest.mark.parametrize(("length", "element"), [(40.0, Quad9()), (40.0, Quad4()), (13.0, Quad9())])
def test_clamped_rod_is_slender(length, element):
    mesh = rod(length, element)
    (computed,) = find_slender_limbs(clamped(mesh, "z-"), 12.0)
    assert computed.length == pytest.approx(2.0 * length)
    assert computed.thickness == pytest.approx(2.0)
    assert computed.at[2] == mesh.points[:, 2].max()


def plate(*groups: str) -> Body:
    """Return a plate one metre thick and a hundred metres wide."""
    return clamped(box_mesh((100.0, 100.0, 1.0), (4, 4, 1), Quad9()), *groups)


@pytest.mark.parametrize(
    ("body", "ratio"),
    [
        (clamped(rod(10.0), "z-"), 10.0),
        (clamped(rod(20.0), "z-", "z+"), 10.0),
        (clamped(rod(1000.0), "x-"), 1.0),
        (plate("z-"), 1.0),
        (plate("x-"), 100.0),
        (plate("x-", "x+"), 50.0),
        (plate("x-", "x+", "y-", "y+"), 50.0),
    ],
)
def test_length_over_thickness(body, ratio):
    """The longest unsupported piece counts: half of the span between two supports, zero with supports along the
    body."""
    assert find_slender_limbs(body, 1.001 * ratio) == ()
    (computed,) = find_slender_limbs(body, 0.999 * ratio)
    assert computed.length / computed.thickness == pytest.approx(ratio)


@pytest.mark.parametrize("body", [clamped(rod(40.0)), clamped(half_space_mesh(1.0, 0.1, 2, 2, Quad4()), "contact")])
def test_without_supports_nothing_is_slender(body):
    assert find_slender_limbs(body, 0.1) == ()


@pytest.mark.parametrize(("fields", "slender"), [([0], True), ([1], True), ([2], True), ([0, 1], False)])
def test_supports_of_each_displacement_component(fields, slender):
    """A rod clamped at one end with some components prescribed along a side bends in the other components."""
    clamps = clamped(rod(40.0), "z-").conditions
    guides = tuple(BoundaryCondition("x-", field, "value") for field in fields)
    body = Body(np.zeros((3, 5, 5, 3)), rod(40.0), clamps + guides, None)
    assert bool(find_slender_limbs(body, 12.0)) == slender


def test_plate_on_rollers_is_not_slender():
    """The plate is supported along its thickness everywhere, and in its plane at two edges."""
    rollers = [("z-", 2), ("x-", 0), ("y-", 1)]
    conditions = tuple(BoundaryCondition(group, field, "value") for group, field in rollers)
    body = Body(np.zeros((3, 5, 5, 3)), plate().mesh, conditions, None)
    assert find_slender_limbs(body, 1.001) == ()


def block_with(limb: tuple[float, float, float]) -> SurfaceMesh:
    """Return a block of 1 x 1 x 1 m below the plane z = 0 with a box of given size on its middle."""
    x, y = (np.array([-0.5, -size / 2.0, size / 2.0, 0.5]) for size in limb[:2])
    levels = np.array([-1.0, 0.0, limb[2]])
    numbers: dict[tuple[float, float, float], int] = {}
    quads = []
    solid = [(i, j, 0) for i in range(3) for j in range(3)] + [(1, 1, 1)]
    for cell in solid:
        for axis in range(3):
            for side in (0, 1):
                neighbour = tuple(c + (2 * side - 1) * (k == axis) for k, c in enumerate(cell))
                if neighbour in solid:
                    continue
                around = [(0, 0), (1, 0), (1, 1), (0, 1)] if side else [(0, 0), (0, 1), (1, 1), (1, 0)]
                quad = []
                for corner in around:
                    position = np.insert(np.array(corner), 0, side)
                    at = [cell[k] + int(position[(k - axis) % 3]) for k in range(3)]
                    point = (float(x[at[0]]), float(y[at[1]]), float(levels[at[2]]))
                    quad.append(numbers.setdefault(point, len(numbers)))
                quads.append(quad)
    points = np.array(list(numbers))
    groups = np.where((points[np.array(quads), 2] == -1.0).all(axis=1), 0, 1)
    return SurfaceMesh(points, (ElementBlock(Quad4(), np.array(quads), groups),), ("base", "rest"))


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_limb_of_a_compact_body(order):
    """A rod of 50 widths on a block, in any direction, is recognised except for a 64th of the body."""
    mesh = block_with((0.02, 0.02, 1.0))
    check_mesh(mesh)
    rotated = replace(mesh, points=mesh.points[:, order])
    (computed,) = find_slender_limbs(clamped(rotated, "base"), 12.0)
    assert computed.thickness == pytest.approx(0.02)
    assert 1.0 - 2.0 / 64 <= computed.length <= 1.0


@pytest.mark.parametrize("limb", [(0.5, 0.5, 1.0), (0.1, 0.1, 0.1), (0.02, 0.02, 0.01)])
def test_compact_limb_is_not_slender(limb):
    assert find_slender_limbs(clamped(block_with(limb), "base"), 2.5) == ()


@pytest.mark.parametrize("angle", [0.0, 0.2, 0.5, np.pi / 4, 1.0])
def test_rods_rotated_about_an_axis(angle):
    """Twenty widths are recognised as 18 at least and never overestimated."""
    cos, sin = np.cos(angle), np.sin(angle)
    upright = rod(20.0)
    mesh = replace(upright, points=upright.points @ np.array([[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]]))
    assert find_slender_limbs(clamped(mesh, "z-"), 20.1) == ()
    assert find_slender_limbs(clamped(mesh, "z-"), 18.0)


@pytest.mark.parametrize("element", [Tri3(), Tri6(), Quad8(), Quad9()])
def test_compact_bodies_are_not_slender(element):
    """Spheres are supported at a cap."""
    mesh = sphere_mesh(1.0, 3, element)
    block = mesh.blocks[0]
    below = (mesh.points[block.connectivity, 2] < -0.5).all(axis=1)
    capped = replace(mesh, blocks=(replace(block, groups=np.where(below, 0, 1)),), group_names=("cap", "rest"))
    assert find_slender_limbs(clamped(capped, "cap"), 2.0) == ()


def test_separate_components_are_checked_independently():
    """A thick block and a slender rod are both supported below."""
    block, thin = box_mesh((9.0, 9.0, 9.0), (2, 2, 2), Quad9()), rod(20.0)
    points = np.concatenate([block.points, thin.points + np.array([100.0, 0.0, 0.0])])
    second = thin.blocks[0]
    moved = ElementBlock(second.element, second.connectivity + len(block.points), second.groups)
    mesh = SurfaceMesh(points, (*block.blocks, moved), block.group_names)
    (computed,) = find_slender_limbs(clamped(mesh, "z-"), 12.0)
    assert computed.length == pytest.approx(40.0)
    assert computed.at[0] > 50.0


def test_formulations_warn():
    (warning,) = DenseBEM().warnings(clamped(rod(40.0), "z-"))
    assert "extends 80 m from its supports" in warning
    assert "40 times its thickness of 2 m" in warning
    assert "formulation skfem" in warning


@pytest.mark.parametrize(
    ("length", "element", "warned"),
    [(19.0, Quad9(), False), (21.0, Quad9(), True), (5.0, Quad4(), False), (7.0, Quad4(), True)],
)
def test_no_warning_where_collocation_is_accurate(length, element, warned):
    """The bodies are those of validation/slender_rods."""
    assert bool(DenseBEM().warnings(clamped(rod(length, element), "z-"))) == warned


def distributed_cases() -> list[Path]:
    """Return the cases of the validation and of the plugins, without studies."""
    folders = ("validation/*", "plugins/*/cases", "plugins/*/examples")
    files = [file for folder in folders for file in sorted(ROOT.glob(f"{folder}/*.toml"))]
    return [file for file in files if "[mesh" in file.read_text(encoding="utf-8")]


@pytest.mark.full(except_for=12)
@pytest.mark.parametrize("file", distributed_cases(), ids=lambda file: f"{file.parents[1].name}-{file.stem}")
def test_no_distributed_case_warns(file):
    assert load_case(file).warnings == ()
