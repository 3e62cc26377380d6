"""Test points, frames, weights and Gauss rules of the contact zone."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import MeshError
from meeframe.elements import ELEMENTS, Quad4, Quad9, Tri6
from meeframe.elements.base import SurfaceElement
from meeframe.mesh import block_mesh, box_mesh, check_contact_zone, find_contact_zone, local_frames, sphere_mesh
from meeframe.mesh.measures import gauss_rule
from meeframe.mesh.surface import SurfaceMesh

EVERY = pytest.mark.parametrize("element", ELEMENTS.values(), ids=lambda e: e.name)


def upper_face(mesh: SurfaceMesh) -> SurfaceMesh:
    """Return a cubed sphere with its upper sixth as the face group 'contact'."""
    block = mesh.blocks[0]
    middle = mesh.points[block.connectivity].mean(axis=1)
    upper = middle[:, 2] > np.abs(middle[:, :2]).max(axis=1)
    return SurfaceMesh(mesh.points, (replace(block, groups=upper.astype(np.int64)),), ("rest", "contact"))


@pytest.mark.parametrize("reference", ["quadrilateral", "triangle"])
def test_gauss_rules_integrate_polynomials(reference: str) -> None:
    for n in (1, 3, 6):
        xi, weights = gauss_rule(reference, n)
        for i in range(2 * n - 1):
            for j in range(2 * n - 1 - i):
                if reference == "triangle":  # i! j! / (i + j + 2)!
                    exact = 1.0 / ((i + 1) * np.prod(np.arange(i + 2, i + j + 3)) / np.prod(np.arange(1, j + 1)))
                else:
                    exact = (1 - (-1) ** (i + 1)) / (i + 1) * (1 - (-1) ** (j + 1)) / (j + 1)
                assert weights @ (xi[:, 0] ** i * xi[:, 1] ** j) == pytest.approx(exact, abs=1e-14)


@EVERY
def test_flat_zone_has_global_axes(element: SurfaceElement) -> None:
    mesh = block_mesh(0.05, 0.12, (0.005, 0.004), (4, 6), 3, 2, element)
    zone = find_contact_zone(mesh, "contact")
    np.testing.assert_array_equal(zone.frames, np.broadcast_to(np.eye(3), (len(zone.points), 3, 3)))
    np.testing.assert_array_equal(zone.numbers, mesh.group_points("contact"))
    np.testing.assert_array_equal(zone.points, mesh.points[zone.numbers])
    ((kind, cells),) = zone.cells
    assert kind == element.meshio_type
    own = mesh.blocks[0].groups == mesh.group("contact")
    np.testing.assert_array_equal(zone.numbers[cells], mesh.blocks[0].connectivity[own])


@EVERY
def test_weights_integrate_what_the_element_can_represent(element: SurfaceElement) -> None:
    a, b = 0.005, 0.004
    zone = find_contact_zone(block_mesh(0.05, 0.12, (a, b), (4, 6), 3, 2, element), "contact")
    x, y = zone.points[:, 0], zone.points[:, 1]
    assert zone.weights.sum() == pytest.approx(a * b, rel=1e-13)
    assert zone.weights @ (3 * x - 2 * y + 0.1) == pytest.approx(0.1 * a * b, rel=1e-12)
    if element.order == 2:
        assert zone.weights @ x**2 == pytest.approx(a**3 * b / 12, rel=1e-12)
        assert zone.weights @ (x * y) == pytest.approx(0.0, abs=1e-20)


@EVERY
def test_integrals_of_smooth_densities_converge(element: SurfaceElement) -> None:
    a, b = 0.005, 0.004
    exact = 4 * np.sin(150 * a) / 300 * np.sin(100 * b) / 200
    errors = []
    for n in (4, 8):
        zone = find_contact_zone(block_mesh(0.05, 0.12, (a, b), (n, n), 3, 2, element), "contact")
        density = np.cos(300 * zone.points[:, 0]) * np.cos(200 * zone.points[:, 1])
        errors.append(abs(zone.weights @ density - exact))
    assert np.log2(errors[0] / errors[1]) > (2 if element.order == 1 else 4) - 0.2


@pytest.mark.full(except_for=2)
@EVERY
def test_normals_of_a_sphere_converge(element: SurfaceElement) -> None:
    errors = []
    for n in (8, 16, 32):
        zone = find_contact_zone(upper_face(sphere_mesh(2.0, n, element)), "contact")
        frames = zone.frames
        identity = np.einsum("nik,njk->nij", frames, frames)
        np.testing.assert_allclose(identity, np.broadcast_to(np.eye(3), identity.shape), atol=1e-14)
        np.testing.assert_allclose(np.linalg.det(frames), 1.0, atol=1e-14)
        errors.append(np.abs(frames[:, 2] - zone.points / 2).max())
    # at the border of the zone, the mean is one-sided, with the order p of the normal of a single element
    assert np.log2(errors[1] / errors[2]) > element.order - 0.3


def test_weights_of_a_curved_zone() -> None:
    zone = find_contact_zone(upper_face(sphere_mesh(2.0, 16, Quad9())), "contact")
    assert zone.weights.sum() == pytest.approx(16 * np.pi / 6, rel=1e-5)
    whole = find_contact_zone(sphere_mesh(2.0, 8, Quad9()), "surface")
    assert whole.weights.sum() == pytest.approx(16 * np.pi, rel=1e-4)
    assert np.abs(whole.weights @ whole.points).max() < 1e-12


def test_e1_is_as_close_to_x1_as_possible() -> None:
    rng = np.random.default_rng(3)
    normals = rng.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    frames = local_frames(normals)
    ordinary = np.abs(normals[:, 0]) < 0.99
    angles = np.linspace(0, 2 * np.pi, 721)
    for frame in frames[ordinary]:
        tangents = np.outer(np.cos(angles), frame[0]) + np.outer(np.sin(angles), frame[1])
        assert tangents[:, 0].max() <= frame[0, 0] + 1e-12
        assert frame[0, 0] > 0


def test_e1_falls_back_to_x2() -> None:
    for sign in (1.0, -1.0):
        frame = local_frames(np.array([[sign, 0.0, 0.0]]))[0]
        np.testing.assert_array_equal(frame, [[0, 1, 0], [0, 0, sign], [sign, 0, 0]])


def test_normals_use_elements_of_the_zone_only() -> None:
    # a whole face of a box: normals averaged with the sides would be inclined at its border
    zone = find_contact_zone(box_mesh((1, 1, 1), (3, 3, 3), Tri6()), "z+")
    np.testing.assert_array_equal(zone.frames[:, 2], np.tile([0.0, 0.0, 1.0], (len(zone.points), 1)))


def test_zones_over_two_element_types() -> None:
    mesh = box_mesh((1, 1, 1), (4, 4, 4), Quad4())
    block = mesh.blocks[0]
    split = block.connectivity[:8][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    triangles = type(block)(ELEMENTS["tri3"], split, np.repeat(block.groups[:8], 2))
    rest = type(block)(block.element, block.connectivity[8:], block.groups[8:])
    zone = find_contact_zone(replace(mesh, blocks=(rest, triangles)), "z+")
    assert [kind for kind, _ in zone.cells] == ["quad", "triangle"]
    assert len(zone.points) == 25
    assert zone.weights.sum() == pytest.approx(1.0)
    assert zone.weights @ zone.points[:, 0] == pytest.approx(0.0, abs=1e-15)


def test_invalid_zones_are_rejected() -> None:
    box = box_mesh((1, 1, 1), (2, 2, 2), Quad4())
    check_contact_zone(box, "z+")
    with pytest.raises(MeshError, match="no face group 'contact' in the mesh; it has x-, x"):
        check_contact_zone(box, "contact")
    with pytest.raises(MeshError, match="'empty': the face group has no elements"):
        check_contact_zone(replace(box, group_names=(*box.group_names, "empty")), "empty")
    block = box.blocks[0]
    edge = replace(box, blocks=(replace(block, groups=np.where(block.groups == 1, 5, block.groups)),))
    with pytest.raises(MeshError, match=r"'z\+': it bends by more than 45 degrees at 3 points"):
        check_contact_zone(edge, "z+")
    whole = sphere_mesh(1.0, 6, Quad9())
    with pytest.raises(MeshError, match="'surface': it is the whole surface"):
        check_contact_zone(whole, "surface")


def test_shape_integrals_of_the_reference_cell() -> None:
    # quad8: corners -1/12, mid-sides 1/3 of the area (serendipity)
    zone = find_contact_zone(box_mesh((1, 1, 1), (1, 1, 1), ELEMENTS["quad8"]), "z+")
    np.testing.assert_allclose(np.sort(zone.weights), [-1 / 12] * 4 + [1 / 3] * 4, atol=1e-15)


def test_zone_is_shared_and_immutable():
    """All callers receive the same zone, which cannot be modified."""
    zone = find_contact_zone(block_mesh(1.0, 2.0, 0.5, 4, 3, 4, Quad4()), group="contact")
    for array in (zone.points, zone.frames, zone.weights, zone.numbers, zone.cells[0][1]):
        with pytest.raises(ValueError, match="read-only"):
            array *= 2
