"""Properties of meshes, frames and gaps hold for random sizes, gradings and placements."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from meeframe.elements import ELEMENTS
from meeframe.indenters import Cone, Cylinder, Paraboloid, Placement, Sphere, initial_gap
from meeframe.mesh import (
    Grading,
    area,
    block_mesh,
    box_mesh,
    check_contact_zone,
    check_mesh,
    find_contact_zone,
    local_frames,
    merge_points,
    orient_outward,
    sphere_mesh,
    volume,
)
from meeframe.mesh.surface import SurfaceMesh
from meeframe.mesh.topology import find_edges, reflection

few = settings(deadline=None, max_examples=25)
elements = st.sampled_from(list(ELEMENTS.values()))
lengths = st.floats(1e-3, 1e3)
counts = st.integers(1, 5)
directions = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


def inside_out(mesh: SurfaceMesh) -> SurfaceMesh:
    blocks = [type(b)(b.element, b.connectivity[:, reflection(b.element)], b.groups) for b in mesh.blocks]
    return SurfaceMesh(mesh.points, tuple(blocks), mesh.group_names)


@few
@given(
    element=elements,
    half=st.tuples(lengths, lengths),
    height=lengths,
    share=st.tuples(st.floats(1e-4, 0.95), st.floats(1e-4, 0.95)),
    divisions=st.tuples(counts, counts),
    rings=counts,
    layers=counts,
    first_ring=st.floats(0.05, 20),
    layer_growth=st.floats(0.4, 4),
)
def test_every_block_is_a_closed_outward_box(  # type: ignore[no-untyped-def]
    element, half, height, share, divisions, rings, layers, first_ring, layer_growth
) -> None:
    contact = (2 * half[0] * share[0], 2 * half[1] * share[1])
    mesh = block_mesh(half, height, contact, divisions, rings, layers, element, Grading(first_ring, layer_growth))
    cells = 2 * divisions[0] * divisions[1] + 2 * sum(divisions) * (rings + layers)
    assert mesh.n_elements == cells * (2 if element.reference == "triangle" else 1)
    assert volume(mesh) == pytest.approx(4 * half[0] * half[1] * height, rel=1e-10)
    assert area(mesh, "contact") == pytest.approx(contact[0] * contact[1], rel=1e-10)
    assert area(mesh, "top") + area(mesh, "contact") == pytest.approx(4 * half[0] * half[1], rel=1e-10)
    ends = np.sort(find_edges(mesh).ends, axis=1)
    assert len(np.unique(ends)) - len(np.unique(ends, axis=0)) + mesh.n_elements == 2
    assert set(np.bincount(find_edges(mesh).number)) == {2}


@few
@given(
    element=elements,
    share=st.floats(1e-3, 0.5),
    divisions=st.tuples(counts, counts),
    rings=st.integers(2, 6),
    layers=counts,
    scale=lengths,
)
def test_moderate_blocks_pass_all_checks(element, share, divisions, rings, layers, scale) -> None:  # type: ignore[no-untyped-def]
    mesh = block_mesh(scale, 2 * scale, 2 * share * scale, divisions, rings, layers, element)
    check_mesh(mesh)
    check_contact_zone(mesh, "contact")
    with pytest.raises(Exception, match="inside out"):
        check_mesh(inside_out(mesh))
    check_mesh(orient_outward(inside_out(mesh)))


@few
@given(element=elements, sizes=st.tuples(lengths, lengths, lengths), divisions=st.tuples(counts, counts, counts))
def test_random_boxes(element, sizes, divisions) -> None:  # type: ignore[no-untyped-def]
    mesh = box_mesh(sizes, divisions, element)
    assert volume(mesh) == pytest.approx(np.prod(sizes), rel=1e-11)
    total = sum(area(mesh, name) for name in mesh.group_names)
    assert total == pytest.approx(2 * (sizes[0] * sizes[1] + sizes[1] * sizes[2] + sizes[2] * sizes[0]), rel=1e-11)


@few
@given(element=elements, radius=lengths, divisions=st.integers(2, 6), seed=st.integers(0, 2**32 - 1))
def test_renumbering_and_splitting_have_no_effect(element, radius, divisions, seed) -> None:  # type: ignore[no-untyped-def]
    mesh = sphere_mesh(radius, divisions, element)
    block = mesh.blocks[0]
    rng = np.random.default_rng(seed)
    torn = mesh.points[block.connectivity].reshape(-1, 3)
    order = rng.permutation(len(torn))
    number = np.empty(len(torn), np.int64)
    number[order] = np.arange(len(torn))
    elements_order = rng.permutation(len(block.connectivity))
    connectivity = number.reshape(block.connectivity.shape)[elements_order]
    split = SurfaceMesh(torn[order], (type(block)(element, connectivity, block.groups),), mesh.group_names)
    merged = merge_points(split, 1e-9 * radius)
    check_mesh(merged)
    assert len(merged.points) == len(mesh.points)
    assert volume(merged) == pytest.approx(volume(mesh), rel=1e-12)


@few
@given(normal=directions)
def test_frames_are_right_handed_and_orthonormal(normal) -> None:  # type: ignore[no-untyped-def]
    unit = np.array(normal) / np.linalg.norm(normal)
    frame = local_frames(unit[None])[0]
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    np.testing.assert_array_equal(frame[2], unit)


shapes = st.one_of(
    st.floats(0.05, 1).map(Sphere),
    st.floats(0.05, 1).map(lambda radius: Sphere(radius, "exact")),
    st.tuples(st.floats(0.05, 1), st.floats(0.05, 1)).map(lambda v: Paraboloid(*v)),
    st.floats(0.01, 0.5).map(Cone),
    st.tuples(st.floats(0.05, 1), st.floats(-3, 3)).map(lambda v: Cylinder(*v)),
)
ZONE = find_contact_zone(block_mesh(0.05, 0.1, 0.01, 6, 2, 2, ELEMENTS["quad9"]), "contact")


@few
@given(
    shape=shapes,
    x=st.floats(-5e-3, 5e-3),
    y=st.floats(-5e-3, 5e-3),
    rotation=st.floats(-4, 4),
    tilts=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
    approach=st.floats(0, 1e-3),
)
def test_points_at_the_gap_lie_on_the_indenter(shape, x, y, rotation, tilts, approach) -> None:  # type: ignore[no-untyped-def]
    placement = Placement(x, y, rotation, *tilts)
    gap = initial_gap(shape, ZONE, placement, approach)
    assume(np.isfinite(gap).all())
    meeting = ZONE.points + gap[:, None] * ZONE.frames[:, 2]
    local = (meeting - [x, y, -approach]) @ placement.rotation_matrix
    np.testing.assert_allclose(shape.height(local[:, 0], local[:, 1]), local[:, 2], atol=1e-12)
    np.testing.assert_allclose(placement.rotation_matrix @ placement.rotation_matrix.T, np.eye(3), atol=1e-15)
    # moving the indenter along its axis changes the gap of a flat zone by the same distance
    np.testing.assert_allclose(initial_gap(shape, ZONE, placement), gap + approach, atol=1e-12)
