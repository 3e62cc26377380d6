"""Test rotated frames: the same relation in other components, and friction along a direction field."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, Status
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb
from meeframe.laws.base import ContactLaw
from meeframe.material import library_material
from meeframe.mesh import local_frames, sphere_mesh
from meeframe.mesh.axes import FrictionAxes
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.surface import ElementBlock, SurfaceMesh
from meeframe.solvers import Auto, solve
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import NodalFields, ReducedSystem
from meeframe.system.rotated import rotate_frames
from meeframe.testing.half_space import half_space_system, indentation_problem
from meeframe.testing.matrix_free import MatrixFree

N = 12
RANDOM = np.random.default_rng(3)


def random_system() -> DenseSystem:
    """Return a system with random normals and known fields for any load."""
    normals = RANDOM.normal(size=(N, 3))
    frames = local_frames(normals / np.linalg.norm(normals, axis=1, keepdims=True))
    points, matrix = RANDOM.normal(size=(N, 3)), RANDOM.normal(size=(N, 5, N, 5))

    def recover(load: Array) -> NodalFields:
        fields = np.concatenate([np.einsum("na,nai->ni", load[:, :3], frames), load[:, 3:]], axis=1)
        return NodalFields(points, (), fields, -fields)

    return DenseSystem(points, frames, np.ones(N), (), RANDOM.normal(size=(N, 5)), matrix, recover)


def in_global_axes(system: ReducedSystem, fields: Array) -> Array:
    return np.concatenate([np.einsum("na,nai->ni", fields[:, :3], system.frames), fields[:, 3:]], axis=1)


def in_local_axes(system: ReducedSystem, fields: Array) -> Array:
    return np.concatenate([np.einsum("nai,ni->na", system.frames, fields[:, :3]), fields[:, 3:]], axis=1)


@pytest.mark.parametrize("hidden", [False, True])
def test_rotated_system_is_equivalent(hidden: bool) -> None:
    system = random_system()
    directions = RANDOM.normal(size=(N, 3)) * 10.0 ** RANDOM.uniform(-200, 200, (N, 1))
    other = rotate_frames(MatrixFree.of(system) if hidden else system, directions)
    assert isinstance(other, DenseSystem) != hidden
    assert (other.dense() is None) == hidden
    loads = RANDOM.normal(size=(N, 5))
    old, new = in_local_axes(system, loads), in_local_axes(other, loads)
    np.testing.assert_allclose(in_global_axes(other, other.offset), in_global_axes(system, system.offset), atol=1e-14)
    expected = in_global_axes(system, system.apply(old))
    np.testing.assert_allclose(in_global_axes(other, other.apply(new)), expected, atol=1e-12)
    np.testing.assert_allclose(other.recover(new).values, system.recover(old).values, atol=1e-13)
    np.testing.assert_allclose(other.recover(new).fluxes, system.recover(old).fluxes, atol=1e-13)
    for node, block in enumerate(other.diagonal_blocks()):
        for field in range(5):
            unit = np.zeros((N, 5))
            unit[node, field] = 1.0
            np.testing.assert_allclose(block[:, field], other.apply(unit)[node], atol=1e-13)


def test_first_axis_follows_the_direction() -> None:
    system = random_system()
    directions = RANDOM.normal(size=(N, 3))
    frames = rotate_frames(system, directions).frames
    np.testing.assert_allclose(frames @ frames.swapaxes(1, 2), np.tile(np.eye(3), (N, 1, 1)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, atol=1e-14)
    np.testing.assert_array_equal(frames[:, 2], system.frames[:, 2])
    tangential = directions - np.sum(directions * frames[:, 2], axis=1)[:, None] * frames[:, 2]
    expected = tangential / np.linalg.norm(tangential, axis=1, keepdims=True)
    np.testing.assert_allclose(frames[:, 0], expected, atol=1e-13)


def test_nodes_without_a_direction_keep_their_frame() -> None:
    system = random_system()
    directions = RANDOM.normal(size=(N, 3))
    directions[2], directions[5] = 0.0, -7.0 * system.frames[5, 2]
    frames = rotate_frames(system, directions).frames
    np.testing.assert_array_equal(frames[[2, 5]], system.frames[[2, 5]])
    assert np.abs(np.delete(frames - system.frames, [2, 5], axis=0)).max(axis=(1, 2)).min() > 1e-3


def test_invalid_directions_are_rejected() -> None:
    system = random_system()
    with pytest.raises(CaseError, match=r"shape \(12, 2\); \(12, 3\) is needed"):
        rotate_frames(system, np.ones((N, 2)))
    with pytest.raises(CaseError, match=r"direction at node 4 is .*finite"):
        rotate_frames(system, np.where(np.arange(N)[:, None] == 4, np.nan, 1.0) * np.ones(3))


def cap_system() -> ReducedSystem:
    """Return a sphere of radius 10 mm clamped at its lower sixth, with contact on the upper one, by boundary
    elements."""
    sphere = sphere_mesh(0.01, 5, Quad4())
    (block,) = sphere.blocks
    heights = sphere.points[block.connectivity].mean(axis=1)[:, 2]
    order = np.argsort(heights)
    groups = np.full(len(order), 2)
    groups[order[:25]], groups[order[-25:]] = 1, 0
    mesh = SurfaceMesh(
        sphere.points, (ElementBlock(block.element, block.connectivity, groups),), ("contact", "base", "side")
    )
    base = tuple(BoundaryCondition("base", field, "value") for field in range(5))
    material = library_material("orthotropic-mee")
    return DenseBEM(quadrature_tolerance=1e-3).reduce(Body(material.stiffness, mesh, base, "contact"))


def socket_problem(system: ReducedSystem, law: ContactLaw) -> ContactProblem:
    """Return a problem of a conforming socket of slightly larger radius, pressed down and moved along (1, -0.6, 0)."""
    normals = system.frames[:, 2]
    drag = system.frames @ np.array([1.0, -0.6, 0.0]) * 2e-5
    gap = 5e-5 * (1.0 - normals[:, 2]) - 2e-5 * normals[:, 2] + drag[:, 2]
    laws = law, flux_channels(Insulating(), Insulating())
    return ContactProblem(system, *laws, gap, drag[:, :2], np.zeros((len(gap), 2)))


def tractions(system: ReducedSystem, problem: ContactProblem) -> Array:
    """Return the loads (n, 5) in global axes."""
    solution = solve(problem, Auto())
    assert solution.status is Status.CONVERGED, solution.message
    return in_global_axes(system, solution.state.load)


@pytest.fixture(scope="module")
def cap() -> ReducedSystem:
    return cap_system()


@pytest.mark.full
@pytest.mark.parametrize("angle", [0.7, -2.0])
def test_rotated_frames_with_opposite_angle_on_curved_zone(cap, angle) -> None:
    expected = tractions(cap, socket_problem(cap, OrthotropicCoulomb(0.1, 0.5, 0.3)))
    e1, e2 = cap.frames[:, 0], cap.frames[:, 1]
    other = rotate_frames(cap, np.cos(angle) * e1 + np.sin(angle) * e2)
    computed = tractions(other, socket_problem(other, OrthotropicCoulomb(0.1, 0.5, 0.3 - angle)))
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(computed - expected).max(axis=0) <= 1e-8 * scale).all()
    wrong = tractions(other, socket_problem(other, OrthotropicCoulomb(0.1, 0.5, 0.3)))
    assert np.abs(wrong - expected)[:, :2].max() > 1e-2 * scale[:2].max()
    touching = expected[:, 2] != 0.0
    assert 4 < touching.sum() < len(touching)


def test_isotropic_friction_does_not_depend_on_frames(cap) -> None:
    expected = tractions(cap, socket_problem(cap, IsotropicCoulomb(0.3)))
    other = rotate_frames(cap, np.random.default_rng(0).normal(size=cap.points.shape))
    computed = tractions(other, socket_problem(other, IsotropicCoulomb(0.3)))
    assert (np.abs(computed - expected).max(axis=0) <= 1e-8 * np.abs(expected).max(axis=0)).all()


SIDE, CELLS = 2.0, 17
XI = np.diag([1.0, 1.0, 1.0, -1.0, -1.0])
"""A body that answers in all tangential directions alike."""


def flat_problem(system: ReducedSystem, law: ContactLaw, translation: tuple[float, float]) -> ContactProblem:
    height = 0.5 * (system.points**2).sum(axis=1)
    problem = indentation_problem(system, height, 0.5, law)
    drag = system.frames @ np.array([*translation, 0.0])
    return replace(problem, translation=drag[:, :2])


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("angle", [0.5, 2.0, -0.9])
def test_direction_equals_angle_on_flat_zone(angle: float) -> None:
    system = half_space_system(XI, SIDE, CELLS)
    expected = tractions(system, flat_problem(system, OrthotropicCoulomb(0.1, 0.5, angle), (0.03, 0.02)))
    axes = FrictionAxes(direction=(3.0 * np.cos(angle), 3.0 * np.sin(angle), 5.0))
    other = rotate_frames(system, axes.directions(system.points))
    computed = tractions(other, flat_problem(other, OrthotropicCoulomb(0.1, 0.5), (0.03, 0.02)))
    np.testing.assert_allclose(computed, expected, atol=1e-9 * np.abs(expected).max())


def twisted(mu1: float, mu2: float, twist: float, radial: bool) -> tuple[Array, Array, Array]:
    """Return points, pressure (n,) and (radial, circumferential) traction (n, 2) of a pressed, twisted and expanding
    sphere."""
    system: ReducedSystem = half_space_system(XI, SIDE, CELLS)
    if radial:
        system = rotate_frames(system, FrictionAxes(around=(0.0, 0.0, 2.0)).directions(system.points))
    points = system.points
    swelling = 0.3 * twist * points + twist * np.cross([0.0, 0.0, 1.0], points)
    problem = flat_problem(system, OrthotropicCoulomb(mu1, mu2), (0.0, 0.0))
    problem = replace(problem, translation=np.einsum("nai,ni->na", system.frames, swelling)[:, :2])
    load = tractions(system, problem)
    radius = np.linalg.norm(points, axis=1)
    away = points[:, :2] / np.where(radius > 0.0, radius, 1.0)[:, None]
    around = np.column_stack([-away[:, 1], away[:, 0]])
    return points, -load[:, 2], np.column_stack([(load[:, :2] * axis).sum(axis=1) for axis in (away, around)])


def test_radial_axes_preserve_axisymmetry() -> None:
    """Exact under quarter turns; up to discretisation between (3, 4) and (5, 0) cells from the axis."""
    points, pressure, traction = twisted(0.1, 0.5, 0.3, radial=True)
    quarter = np.arange(CELLS**2).reshape(CELLS, CELLS)[:, ::-1].T.ravel()
    np.testing.assert_allclose(points[quarter], np.cross([0.0, 0.0, 1.0], points), atol=1e-12)
    scale = np.abs(traction).max()
    np.testing.assert_allclose(traction[quarter], traction, atol=1e-8 * scale)
    cells = np.rint(points[:, :2] * CELLS / SIDE).astype(int)
    straight, oblique = (int(np.flatnonzero((cells == position).all(axis=1))[0]) for position in ([5, 0], [3, 4]))
    assert pressure[straight] > 0.0
    np.testing.assert_allclose(traction[oblique], traction[straight], atol=0.03 * scale)
    _, _, wrong = twisted(0.1, 0.5, 0.3, radial=False)
    assert np.abs(wrong[quarter] - wrong).max() > 0.2 * scale


def test_radial_axes_limit_twist_by_second_coefficient() -> None:
    """Far above the limit, the traction follows the associated rule in radial components."""
    mu = np.array([0.1, 0.5])
    points, pressure, traction = twisted(*mu, 1e4, radial=True)
    slip = np.array([0.3, 1.0])
    expected = pressure[:, None] * mu**2 * slip / np.linalg.norm(mu * slip)
    away = np.linalg.norm(points, axis=1) > 1e-9
    np.testing.assert_allclose(traction[away], expected[away], atol=1e-3 * expected.max())
