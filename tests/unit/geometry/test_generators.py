"""Test counts, sizes and symmetry of generated meshes."""

from itertools import pairwise

import numpy as np
import pytest

from meeframe.common.errors import MeeframeError, MeshError, TooLargeError
from meeframe.elements import ELEMENTS, Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.elements.base import SurfaceElement, shape_functions
from meeframe.mesh import (
    Grading,
    area,
    block_mesh,
    box_mesh,
    check_mesh,
    find_contact_zone,
    half_space_mesh,
    sphere_mesh,
    volume,
)
from meeframe.mesh.regular import global_components, grid_shape, local_components, shared_frames, shares_frame
from meeframe.mesh.surface import SurfaceMesh
from meeframe.mesh.topology import find_edges

EVERY = pytest.mark.parametrize("element", ELEMENTS.values(), ids=lambda e: e.name)
PAPER = {"half_width": 0.05, "height": 0.12, "contact_width": 0.005, "divisions": 16, "rings": 6, "layers": 3}


def euler_characteristic(mesh: SurfaceMesh) -> int:
    """Return V - E + F of corners, edges and elements."""
    ends = np.sort(find_edges(mesh).ends, axis=1)
    return len(np.unique(ends)) - len(np.unique(ends, axis=0)) + mesh.n_elements


@pytest.mark.parametrize(("rings", "layers"), [(6, 3), (5, 4), (8, 1)])
def test_mesh_of_the_paper(rings: int, layers: int) -> None:
    mesh = block_mesh(**PAPER | {"rings": rings, "layers": layers}, element=Quad4())
    check_mesh(mesh)
    assert mesh.n_elements == 1088
    assert len(mesh.points) == 1090
    assert np.bincount(mesh.blocks[0].groups)[mesh.group("contact")] == 256
    np.testing.assert_array_equal(mesh.points.min(axis=0), [-0.05, -0.05, -0.12])
    np.testing.assert_array_equal(mesh.points.max(axis=0), [0.05, 0.05, 0.0])
    zone = mesh.points[mesh.group_points("contact")]
    np.testing.assert_array_equal([zone.min(axis=0), zone.max(axis=0)], [[-0.0025, -0.0025, 0], [0.0025, 0.0025, 0]])


@EVERY
def test_points_and_elements_of_each_type(element: SurfaceElement) -> None:
    mesh = block_mesh(**PAPER, element=element)
    check_mesh(mesh)
    corners, edges, cells = 1090, 2176, 1088  # 4 edges per cell, each shared by two cells
    expected = {
        "quad4": (cells, corners),
        "quad8": (cells, corners + edges),
        "quad9": (cells, corners + edges + cells),
        "tri3": (2 * cells, corners),
        "tri6": (2 * cells, corners + edges + cells),
    }
    assert (mesh.n_elements, len(mesh.points)) == expected[element.name]
    assert euler_characteristic(mesh) == 2


@EVERY
def test_areas_of_the_faces_and_volume_of_a_block(element: SurfaceElement) -> None:
    mesh = block_mesh((0.05, 0.03), 0.12, (0.005, 0.002), (6, 4), 4, 3, element)
    contact, side_x, side_y, face = 0.005 * 0.002, 0.06 * 0.12, 0.1 * 0.12, 0.1 * 0.06
    expected = {"contact": contact, "top": face - contact, "base": face}
    expected |= {"side_x-": side_x, "side_x+": side_x, "side_y-": side_y, "side_y+": side_y}
    assert set(mesh.group_names) == set(expected)
    for name, value in expected.items():
        assert area(mesh, name) == pytest.approx(value, rel=1e-12)
    assert volume(mesh) == pytest.approx(0.1 * 0.06 * 0.12, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "axis", "value"), [("side_x-", 0, -5), ("side_x+", 0, 5), ("side_y-", 1, -3), ("side_y+", 1, 3)]
)
def test_positions_of_the_sides_of_a_block(name: str, axis: int, value: float) -> None:
    mesh = block_mesh((5, 3), 12.0, 1.0, 4, 3, 2, Quad8())
    np.testing.assert_array_equal(mesh.points[mesh.group_points(name)][:, axis], value)


@pytest.mark.parametrize(
    ("name", "axis", "value"), [(f"{a}{s}", k, v) for k, a in enumerate("xyz") for s, v in (("-", -1), ("+", 1))]
)
def test_positions_of_the_faces_of_a_box(name: str, axis: int, value: float) -> None:
    sizes = np.array([1.0, 2.0, 3.0])
    mesh = box_mesh((1.0, 2.0, 3.0), (2, 3, 4), Quad9())
    np.testing.assert_array_equal(mesh.points[mesh.group_points(name)][:, axis], value * sizes[axis] / 2)
    assert area(mesh, name) == pytest.approx(np.delete(sizes, axis).prod(), rel=1e-12)


@EVERY
def test_box(element: SurfaceElement) -> None:
    mesh = box_mesh((1.0, 2.0, 3.0), (2, 3, 4), element)
    check_mesh(mesh)
    assert mesh.n_elements == 2 * (2 * 3 + 3 * 4 + 2 * 4) * (2 if element.reference == "triangle" else 1)
    assert euler_characteristic(mesh) == 2
    assert volume(mesh) == pytest.approx(6.0, rel=1e-12)
    assert area(mesh) == pytest.approx(22.0, rel=1e-12)


@EVERY
def test_all_nodes_of_a_sphere_lie_on_it(element: SurfaceElement) -> None:
    mesh = sphere_mesh(0.3, 5, element)
    check_mesh(mesh)
    np.testing.assert_allclose(np.linalg.norm(mesh.points, axis=1), 0.3, rtol=1e-15)
    assert mesh.group_names == ("surface",)
    assert euler_characteristic(mesh) == 2


@pytest.mark.full(except_for=2)
@EVERY
def test_area_and_volume_of_a_sphere_converge(element: SurfaceElement) -> None:
    # surfaces through points on the sphere: order p + 1, even orders (symmetric elements) for quadratics: 4
    theory = 2 if element.order == 1 else 4
    divisions = (6, 12, 24)
    meshes = [sphere_mesh(0.3, n, element) for n in divisions]
    for measure, exact in ((area, 4 * np.pi * 0.3**2), (volume, 4 / 3 * np.pi * 0.3**3)):
        errors = [abs(measure(mesh) - exact) for mesh in meshes]
        orders = [np.log2(coarse / fine) for coarse, fine in pairwise(errors)]
        assert min(orders) > theory - 0.2, (measure.__name__, errors, orders)


def test_positions_of_mid_side_nodes() -> None:
    for element in ELEMENTS.values():
        mesh = block_mesh(1.0, 1.0, 0.5, 2, 2, 1, element)
        corners = Tri3() if element.reference == "triangle" else Quad4()
        nodes = mesh.points[mesh.blocks[0].connectivity]
        straight = np.einsum("nc,ecd->end", shape_functions(corners, element.nodes), nodes[:, : len(corners.nodes)])
        np.testing.assert_allclose(nodes, straight, atol=1e-15)


@EVERY
def test_even_mesh_is_symmetric(element: SurfaceElement) -> None:
    mesh = block_mesh(1.0, 1.5, 0.3, 4, 3, 2, element)
    middles = np.round(mesh.points[mesh.blocks[0].connectivity].mean(axis=1), 12)
    mirrored = middles * [-1, 1, 1]
    swapped = middles[:, [1, 0, 2]]
    for image in (mirrored, swapped):
        np.testing.assert_allclose(np.unique(image + 0.0, axis=0), np.unique(middles + 0.0, axis=0), atol=1e-12)


def widths_of_rings(mesh: SurfaceMesh, half_contact: float) -> np.ndarray:
    x = np.unique(np.round(np.abs(mesh.points[mesh.group_points("top")]).max(axis=1), 12))
    assert x[0] == pytest.approx(half_contact)
    return np.diff(x)


def test_rings_grow_geometrically_from_the_given_width() -> None:
    for first_ring in (1.0, 3.0):
        mesh = block_mesh(**PAPER, element=Quad4(), grading=Grading(first_ring=first_ring))
        widths = widths_of_rings(mesh, 0.0025)
        assert widths[0] == pytest.approx(first_ring * 0.005 / 16)
        assert widths.sum() == pytest.approx(0.0475)
        np.testing.assert_allclose(widths[1:] / widths[:-1], widths[1] / widths[0], rtol=1e-9)


def test_rings_are_equal_where_the_first_would_be_too_wide() -> None:
    mesh = block_mesh(1.0, 1.0, 1.0, 2, 4, 1, Quad4(), Grading(first_ring=10.0))
    np.testing.assert_allclose(widths_of_rings(mesh, 0.5), 0.125)


def test_layers_grow_downwards() -> None:
    mesh = block_mesh(**PAPER | {"layers": 4}, element=Quad4(), grading=Grading(layer_growth=2.0))
    levels = np.unique(np.round(mesh.points[mesh.group_points("side_x+")][:, 2], 12))[::-1]
    np.testing.assert_allclose(-np.diff(levels), 0.12 * np.array([1, 2, 4, 8]) / 15)


@pytest.mark.parametrize("element", [Quad4(), Tri6()], ids=lambda e: e.name)
@pytest.mark.parametrize("scale", [1e-3, 100.0, 1e4])
def test_extreme_blocks_are_valid(element: SurfaceElement, scale: float) -> None:
    for rings, layers in ((1, 1), (3, 2), (12, 6)):
        width = 0.005 if scale > 1 else 0.9e-4  # a block only slightly wider than its contact zone
        check_mesh(block_mesh(0.05 * scale, 0.12 * scale, width, 8, rings, layers, element))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"half_width": -1.0}, "half_width = -1.0"),
        ({"height": 0.0}, "height = 0.0"),
        ({"height": float("inf")}, "height = inf"),
        ({"contact_width": (0.005, float("nan"))}, "contact_width = nan"),
        ({"contact_width": 0.1}, "must be less than the block's width"),
        ({"divisions": 0}, "divisions = 0"),
        ({"divisions": (4, 1.5)}, "divisions = 1.5: must be an integer"),
        ({"rings": 0}, "rings = 0: must be an integer of at least 1"),
        ({"layers": -2}, "layers = -2"),
    ],
)
def test_invalid_sizes_are_rejected(change: dict[str, object], text: str) -> None:
    with pytest.raises(MeshError, match=text):
        block_mesh(**PAPER | change, element=Quad4())


def test_invalid_gradings_boxes_and_spheres_are_rejected() -> None:
    with pytest.raises(MeeframeError, match=r"first_ring = 0\.0.*must be > 0"):
        Grading(first_ring=0.0)
    with pytest.raises(MeeframeError, match=r"layer_growth = -1"):
        Grading(layer_growth=-1.0)
    with pytest.raises(MeshError, match=r"sizes = 0\.0"):
        box_mesh((1.0, 0.0, 1.0), (1, 1, 1), Quad4())
    with pytest.raises(MeshError, match="divisions = 0"):
        box_mesh((1.0, 1.0, 1.0), (1, 1, 0), Quad4())
    with pytest.raises(MeshError, match="radius = nan"):
        sphere_mesh(float("nan"), 2, Quad4())


def test_a_grid_that_exceeds_the_memory_is_refused_before_it_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meeframe.mesh.generators.usable_memory", lambda: 300_000_000)
    with pytest.raises(
        TooLargeError, match=r"1000 x 1000: a run with 1002001 nodes needs .* 0\.415 GB; .* 0\.3 GB; .* 454 x 454"
    ):
        half_space_mesh(2.0, 1.0, 1000, 1, Quad4())
    assert half_space_mesh(2.0, 1.0, 20, 1, Quad4()).n_elements == 20 * 20 + 4 * 20


def test_the_zone_of_a_half_space_shares_a_frame() -> None:
    mesh = half_space_mesh(2.0, 1.0, (3, 5), 2, Quad4())
    zone = find_contact_zone(mesh, "contact")
    np.testing.assert_array_equal(zone.frames, np.tile(np.eye(3), (24, 1, 1)))
    assert shares_frame(zone.frames)
    np.testing.assert_array_equal(zone.points, mesh.points[:24])
    assert zone.weights.sum() == pytest.approx(1.0)
    assert grid_shape(zone.cells, 24) == (4, 6)
    assert grid_shape(((zone.cells[0][0], zone.cells[0][1][::-1]),), 24) is None
    assert grid_shape(zone.cells[:0], 24) is None


def test_components_in_shared_frames_are_those_in_frames_of_each_node() -> None:
    rng = np.random.default_rng(5)
    frame, vectors = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=(7, 3))
    shared, separate = shared_frames(frame, 7), np.tile(frame, (7, 1, 1))
    np.testing.assert_allclose(local_components(shared, vectors), local_components(separate, vectors))
    np.testing.assert_allclose(global_components(shared, vectors), global_components(separate, vectors))
    np.testing.assert_allclose(global_components(shared, local_components(shared, vectors)), vectors)
