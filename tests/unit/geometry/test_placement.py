"""The initial gap agrees with formulas on flat zones, rotated points for tilt, and spheres against spheres."""

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.elements import Quad4, Quad9
from meeframe.fields import Array
from meeframe.indenters import (
    Cone,
    Cylinder,
    FlatPunch,
    Paraboloid,
    Placement,
    RectangularPunch,
    SampledHeights,
    Sphere,
    initial_gap,
)
from meeframe.indenters.base import Indenter
from meeframe.mesh import ContactZone, block_mesh, box_mesh, find_contact_zone, local_frames

FLAT = find_contact_zone(block_mesh(0.05, 0.12, 0.005, 12, 3, 2, Quad4()), "contact")
SHAPES = [
    Sphere(0.1),
    Sphere(0.02, "exact"),
    Cone(0.2),
    Cylinder(0.05, 0.4),
    Paraboloid(0.1, 0.02),
    FlatPunch(2e-3),
    RectangularPunch(2e-3, 1e-3),
]
EVERY_SHAPE = pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)


def zone_of(points: Array, normals: Array) -> ContactZone:
    return ContactZone(points, local_frames(normals), np.ones(len(points)), (), np.arange(len(points)))


def rotation_matrix(axis: int, angle: float) -> Array:
    """Return the rotation matrix by Rodrigues' formula."""
    k = np.cross(np.eye(3)[axis], -np.eye(3))
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def test_rodrigues_is_right_handed() -> None:
    np.testing.assert_allclose(rotation_matrix(2, np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)


@EVERY_SHAPE
@pytest.mark.parametrize("approach", [0.0, 5e-5])
def test_upright_on_a_flat_zone(shape: Indenter, approach: float) -> None:
    x, y, _ = FLAT.points.T
    np.testing.assert_array_equal(
        initial_gap(shape, FLAT, approach=approach) + approach, shape.height(x, y) - approach + approach
    )
    moved = initial_gap(shape, FLAT, Placement(x=1e-3, y=-5e-4), approach)
    np.testing.assert_allclose(moved, shape.height(x - 1e-3, y + 5e-4) - approach, atol=1e-18)


def test_case_of_the_paper() -> None:
    gap = initial_gap(Sphere(0.1), FLAT, approach=5e-5)
    assert gap.min() == -5e-5
    radius = np.hypot(*FLAT.points[:, :2].T)
    # the overlap extends to sqrt(2 R g), contact to a = sqrt(R g)
    np.testing.assert_array_equal(gap < 0, radius < np.sqrt(2 * 0.1 * 5e-5))


def test_level_with_the_highest_point_of_the_zone() -> None:
    box = find_contact_zone(box_mesh((1, 1, 3), (4, 4, 4), Quad4()), "z+")
    x, y, z = box.points.T
    assert (z == 1.5).all()
    np.testing.assert_allclose(initial_gap(Sphere(2.0), box), (x**2 + y**2) / 4, atol=1e-15)


def test_rotation_in_its_plane() -> None:
    rotated = initial_gap(Cylinder(0.05), FLAT, Placement(rotation=0.4))
    np.testing.assert_allclose(rotated, Cylinder(0.05, 0.4).height(*FLAT.points[:, :2].T), atol=1e-18)
    quarter = initial_gap(RectangularPunch(2e-3, 1e-3), FLAT, Placement(rotation=np.pi / 2))
    np.testing.assert_array_equal(quarter, RectangularPunch(1e-3, 2e-3).height(*FLAT.points[:, :2].T))
    askew = initial_gap(Paraboloid(0.1, 0.02), FLAT, Placement(rotation=0.4))
    cylinders = [Cylinder(0.1, 0.4 + np.pi / 2), Cylinder(0.02, 0.4)]
    np.testing.assert_allclose(askew, sum(c.height(*FLAT.points[:, :2].T) for c in cylinders), atol=1e-18)


@EVERY_SHAPE
@pytest.mark.parametrize("tilts", [(0.0, 0.0), (1e-3, 0.0), (0.0, -0.02), (0.05, 0.1), (-0.3, 0.2)])
def test_tilt_against_rotated_points(shape: Indenter, tilts: tuple[float, float]) -> None:
    # rotated points of the indenter's surface, whose distance from the plane of the zone is known
    rng = np.random.default_rng(7)
    x, y = rng.uniform(-1.5e-3, 1.5e-3, (2, 300))
    height = shape.height(x, y)
    local = np.stack([x, y, height], axis=1)[np.isfinite(height)]
    rotation, placement = 0.7, Placement(1e-4, 2e-4, 0.7, *tilts)
    rotated = local @ (rotation_matrix(0, tilts[0]) @ rotation_matrix(1, tilts[1]) @ rotation_matrix(2, rotation)).T + [
        1e-4,
        2e-4,
        0.0,
    ]
    below = rotated * [1, 1, 0]
    gap = initial_gap(shape, zone_of(below, np.tile([0.0, 0.0, 1.0], (len(below), 1))), placement, 3e-6)
    np.testing.assert_allclose(gap, rotated[:, 2] - 3e-6, atol=2e-14)


def test_tilted_plane() -> None:
    x, y, _ = FLAT.points.T
    np.testing.assert_allclose(initial_gap(FlatPunch(1.0), FLAT, Placement(tilt_1=0.1)), y * np.tan(0.1), atol=1e-16)
    np.testing.assert_allclose(initial_gap(FlatPunch(1.0), FLAT, Placement(tilt_2=0.1)), -x * np.tan(0.1), atol=1e-16)


def test_gap_is_infinite_beside_a_tilted_punch() -> None:
    x, y, _ = FLAT.points.T
    gap = initial_gap(FlatPunch(1e-3), FLAT, Placement(tilt_2=0.4))
    within = np.hypot(x / np.cos(0.4), y) <= 1e-3
    np.testing.assert_allclose(gap, np.where(within, -x * np.tan(0.4), np.inf), atol=1e-16)


def test_tilt_of_a_sphere_is_a_translation() -> None:
    radius, tilt = 0.02, 0.15
    x, y, _ = FLAT.points.T
    centre = radius * np.array([np.sin(tilt), np.cos(tilt)])  # of the sphere rotated by tilt_2 about its lowest point
    expected = centre[1] - np.sqrt(radius**2 - (x - centre[0]) ** 2 - y**2)
    computed = initial_gap(Sphere(radius, "exact"), FLAT, Placement(tilt_2=tilt))
    np.testing.assert_allclose(computed, expected, atol=1e-14)


def test_sphere_on_a_sphere() -> None:
    # rays from the centre of the body to the sphere of the indenter
    body, radius, approach = 0.1, 0.04, 1e-3
    rng = np.random.default_rng(2)
    normals = np.column_stack([rng.uniform(-0.8, 0.8, (500, 2)), np.ones(500)])
    normals = np.vstack([normals / np.linalg.norm(normals, axis=1, keepdims=True), [0.0, 0.0, 1.0]])
    zone = zone_of(body * normals, normals)
    gap = initial_gap(Sphere(radius, "exact"), zone, approach=approach)
    centre = np.array([0.0, 0.0, body + radius - approach])
    along = normals @ centre
    room = along**2 - centre @ centre + radius**2
    meets = room > 0
    distance = along - np.sqrt(np.where(meets, room, 0.0)) - body
    # the indenter's surface is its lower half
    lower = meets & (zone.points[:, 2] + distance * normals[:, 2] <= centre[2])
    clear = np.abs(room) > 1e-6  # rays at grazing incidence are omitted
    np.testing.assert_allclose(gap[lower & clear], distance[lower & clear], atol=1e-12)
    assert np.isinf(gap[~meets & clear]).all()
    assert lower.sum() > 50
    assert gap[-1] == pytest.approx(-approach)


def test_the_side_of_a_block() -> None:
    zone = find_contact_zone(block_mesh(1.0, 2.0, 0.5, 4, 3, 4, Quad9()), "side_x+")
    _, y, z = zone.points.T
    position = Placement(axis=(3.0, 0.0, 0.0), x=0.1, y=-0.9)
    np.testing.assert_array_equal(position.base, [[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    gap = initial_gap(Sphere(4.0), zone, position, 0.01)
    np.testing.assert_allclose(gap, ((y - 0.1) ** 2 + (z + 0.9) ** 2) / 8 - 0.01, atol=1e-14)


def test_normals_away_from_the_indenter_have_infinite_gap() -> None:
    normals = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    gap = initial_gap(Sphere(1.0), zone_of(np.zeros((3, 3)), normals))
    np.testing.assert_array_equal(gap, [np.inf, np.inf, 0.0])


def test_tilted_rough_surface() -> None:
    # level sets of a bilinear map: the computed point lies on the surface
    rng = np.random.default_rng(11)
    axis = np.linspace(-4e-3, 4e-3, 33)
    x, y = (a.ravel() for a in np.meshgrid(axis, axis))
    shape = SampledHeights(np.stack([x, y, 1e-5 * rng.uniform(size=x.size)], axis=1))
    placement = Placement(tilt_1=0.02, tilt_2=0.03)
    gap = initial_gap(shape, FLAT, placement)
    local = (FLAT.points + gap[:, None] * [0, 0, 1]) @ (rotation_matrix(0, 0.02) @ rotation_matrix(1, 0.03))
    np.testing.assert_allclose(shape.height(local[:, 0], local[:, 1]), local[:, 2], atol=1e-14)


def test_invalid_placements_are_rejected() -> None:
    with pytest.raises(CaseError, match=r"Placement: tilt_1 = 1\.6: must be > -1\.57.* and < 1\.57"):
        Placement(tilt_1=1.6)
    with pytest.raises(CaseError, match="Placement: x = nan"):
        Placement(x=float("nan"))
    for axis in ((0.0, 0.0, 0.0), (1.0, np.inf, 0.0), (1.0, np.nan, 0.0), (1.0, 0.0)):
        with pytest.raises(CaseError, match=r"Placement: axis = .*must be a direction"):
            Placement(axis=axis)


def test_surface_too_rough_for_intersection_is_rejected() -> None:
    axis = np.linspace(-4e-3, 4e-3, 81)
    x, y = (a.ravel() for a in np.meshgrid(axis, axis))
    rough = 3e-4 * (1 + np.cos(x / 3e-4) * np.sin(y / 3e-4))
    shape = SampledHeights(np.stack([x, y, rough], axis=1))
    with pytest.raises(CaseError, match=r"no distance to the indenter along the normal at .* too steep there"):
        initial_gap(shape, FLAT, Placement(tilt_1=0.9, tilt_2=0.5))
