"""Every fault of a mesh is detected and described."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import MeshError
from meeframe.elements import ELEMENTS, Quad4, Quad8, Quad9, Tri3
from meeframe.elements.base import SurfaceElement
from meeframe.mesh import box_mesh, check_mesh, merge_points, orient_outward, sphere_mesh, volume
from meeframe.mesh.checks import remove_unused_points
from meeframe.mesh.surface import ElementBlock, SurfaceMesh
from meeframe.mesh.topology import reflection

EVERY = pytest.mark.parametrize("element", ELEMENTS.values(), ids=lambda e: e.name)


def cube(element: SurfaceElement | None = None, divisions: int = 2, size: float = 2.0) -> SurfaceMesh:
    return box_mesh((size,) * 3, (divisions,) * 3, element or Quad4())


def with_cells(mesh: SurfaceMesh, connectivity: np.ndarray) -> SurfaceMesh:
    block = replace(mesh.blocks[0], connectivity=connectivity, groups=np.zeros(len(connectivity), np.int64))
    return replace(mesh, blocks=(block,))


def moved(mesh: SurfaceMesh, change: Callable[[np.ndarray], None]) -> SurfaceMesh:
    points = mesh.points.copy()
    change(points)
    return replace(mesh, points=points)


def inside_out(mesh: SurfaceMesh) -> SurfaceMesh:
    blocks = [replace(b, connectivity=b.connectivity[:, reflection(b.element)]) for b in mesh.blocks]
    return replace(mesh, blocks=tuple(blocks))


def both(first: SurfaceMesh, second: SurfaceMesh) -> SurfaceMesh:
    shifted = [replace(b, connectivity=b.connectivity + len(first.points)) for b in second.blocks]
    return SurfaceMesh(np.concatenate([first.points, second.points]), (*first.blocks, *shifted), first.group_names)


def disconnected(mesh: SurfaceMesh, shift: float = 0.0) -> SurfaceMesh:
    """Return a mesh in which every element has separate points."""
    block = mesh.blocks[0]
    points = mesh.points[block.connectivity].reshape(-1, 3)
    points = points + shift * np.random.default_rng(1).uniform(-1, 1, points.shape)
    return SurfaceMesh(
        points,
        (replace(block, connectivity=np.arange(len(points)).reshape(block.connectivity.shape)),),
        mesh.group_names,
    )


def message_of(mesh: SurfaceMesh, text: str) -> None:
    with pytest.raises(MeshError, match=text):
        check_mesh(mesh)


@EVERY
def test_valid_mesh_passes(element: SurfaceElement) -> None:
    check_mesh(cube(element))


@EVERY
def test_open(element: SurfaceElement) -> None:
    mesh = cube(element)
    cells = 1 if element.reference == "quadrilateral" else 2
    message_of(
        remove_unused_points(with_cells(mesh, mesh.blocks[0].connectivity[cells:])),
        "not closed: an edge belongs to only one element: 4 edges, at",
    )


@EVERY
def test_inverted_mesh_and_repair(element: SurfaceElement) -> None:
    mesh = inside_out(cube(element))
    assert volume(mesh) == pytest.approx(-8.0)
    message_of(mesh, rf"the surface is inside out .*: {mesh.n_elements} elements")
    flipped = orient_outward(mesh)
    check_mesh(flipped)
    assert volume(flipped) == pytest.approx(8.0)


@EVERY
def test_single_inverted_element(element: SurfaceElement) -> None:
    mesh = cube(element)
    cells = mesh.blocks[0].connectivity.copy()
    cells[0] = cells[0][reflection(element)]
    n = 4 if element.reference == "quadrilateral" else 3
    message_of(with_cells(mesh, cells), f"not consistently oriented.*: {n} edges, at")
    with pytest.raises(MeshError, match="not consistently oriented"):
        orient_outward(with_cells(mesh, cells))


def test_orient_outward_preserves_a_valid_mesh() -> None:
    mesh = cube(Quad9())
    np.testing.assert_array_equal(orient_outward(mesh).blocks[0].connectivity, mesh.blocks[0].connectivity)


def test_normals_of_cavities() -> None:
    outer, cavity = cube(size=2.0), cube(size=1.0)
    check_mesh(both(outer, inside_out(cavity)))
    assert volume(both(outer, inside_out(cavity))) == pytest.approx(7.0)
    wrong = both(outer, cavity)
    message_of(wrong, "has 1 of 2 closed surfaces inside out")
    check_mesh(orient_outward(wrong))
    assert volume(orient_outward(wrong)) == pytest.approx(7.0)
    # a body in the cavity, and a second one elsewhere
    check_mesh(both(both(outer, inside_out(cavity)), cube(size=0.5)))
    check_mesh(both(outer, moved(cavity, lambda p: np.add(p, [3.0, 0.1, 0.2], out=p))))


def test_not_a_manifold() -> None:
    beside = moved(cube(), lambda p: np.add(p, [2.0, 2.0, 0.0], out=p))
    message_of(
        merge_points(both(cube(), beside), 1e-9),
        "not a manifold: more than two elements share an edge: 2 edges, at .1, 1,",
    )


def test_duplicate_points_and_how_to_merge_them() -> None:
    message_of(disconnected(cube()), r"points that coincide with others \(merge_tolerance merges them\): \d+ pairs, at")
    merged = merge_points(disconnected(cube(), 1e-7), 1e-6)
    check_mesh(merged)
    assert len(merged.points) == len(cube().points)
    with pytest.raises(MeshError, match="merge_tolerance = -1"):
        merge_points(cube(), -1.0)
    with pytest.raises(MeshError, match="the same node twice"):
        merge_points(cube(), 1.1)


def test_near_duplicate_in_a_graded_mesh() -> None:
    mesh = cube(divisions=8)
    message_of(disconnected(mesh, 1e-6), "coincide")


def test_unused_point() -> None:
    mesh = cube()
    message_of(
        replace(mesh, points=np.vstack([mesh.points, [7.0, 8.0, 9.0]])), r"no element uses: 1 point, at \(7, 8, 9\)"
    )


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_non_finite_points(value: float) -> None:
    message_of(
        moved(cube(), lambda p: p.__setitem__((3, 1), value)), rf"not finite or beyond 1e\+60 m: 1 point, at .*{value}"
    )


def test_repeated_node() -> None:
    mesh = cube()
    cells = mesh.blocks[0].connectivity.copy()
    cells[5, 1] = cells[5, 0]
    message_of(with_cells(mesh, cells), "the same node twice: 1 quad4 element, at")


def test_zero_jacobian_and_folded_elements() -> None:
    mesh = cube(divisions=3)
    cell = mesh.blocks[0].connectivity[4]  # middle of the top face
    a, b, c, d = mesh.points[cell]
    at_line = a + (b - a) * 0.3
    message_of(moved(mesh, lambda p: p.__setitem__(cell[3], at_line)), "degenerate or folded elements")
    message_of(
        moved(mesh, lambda p: p.__setitem__(cell[2], a + 0.05 * (a - c) + 0 * d)), "degenerate or folded elements"
    )


def test_folded_by_a_mid_node() -> None:
    mesh = cube(Quad8())
    cell = mesh.blocks[0].connectivity[0]
    message_of(moved(mesh, lambda p: p.__setitem__(cell[4], p[cell[0]] + 0.1 * (p[cell[1]] - p[cell[0]]))), "folded")


def test_mid_sides_must_conform() -> None:
    linear, quadratic = cube(Quad4()), cube(Quad8())
    block = quadratic.blocks[0]
    half = len(block.connectivity) // 2
    blocks = (
        ElementBlock(Quad8(), block.connectivity[:half], block.groups[:half]),
        ElementBlock(Quad4(), block.connectivity[half:, :4], block.groups[half:]),
    )
    message_of(remove_unused_points(SurfaceMesh(quadratic.points, blocks, linear.group_names)), "not conforming")


def test_mixed_triangles_and_quadrilaterals_conform() -> None:
    mesh = cube()
    quads, groups = mesh.blocks[0].connectivity, mesh.blocks[0].groups
    split = quads[:6][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    blocks = (ElementBlock(Quad4(), quads[6:], groups[6:]), ElementBlock(Tri3(), split, np.repeat(groups[:6], 2)))
    mixed = replace(mesh, blocks=blocks)
    check_mesh(mixed)
    assert volume(mixed) == pytest.approx(8.0)
    check_mesh(orient_outward(inside_out(mixed)))


def test_numbers_out_of_range() -> None:
    mesh = cube()
    cells = mesh.blocks[0].connectivity.copy()
    cells[0, 0] = 99
    message_of(with_cells(mesh, cells), "use point 99")
    block = replace(mesh.blocks[0], groups=mesh.blocks[0].groups + 1)
    message_of(replace(mesh, blocks=(block,)), "use face group 6")
    message_of(
        replace(mesh, blocks=(replace(block, groups=block.groups[1:]),)), "24 elements quad4, but 23 group numbers"
    )
    message_of(replace(mesh, blocks=(replace(block, element=Quad8()),)), r"\(24, 4\); allowed: \(e, 8\)")
    message_of(replace(mesh, points=mesh.points[:, :2]), r"\(26, 2\); allowed: \(p, 3\)")
    message_of(replace(mesh, blocks=()), "no elements")


def test_message_lists_at_most_three_positions() -> None:
    with pytest.raises(MeshError) as caught:
        check_mesh(inside_out(sphere_mesh(1.0, 4, Quad4())))
    assert str(caught.value).count("(") == 1 + 3
    assert ", ... [m]" in str(caught.value)
