"""Properties of random admissible anisotropic materials under rotation, mixture and serialisation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from meeframe.material import (
    Material,
    library_material,
    material_from_table,
    material_table,
    mixture,
    rotation_about,
    rotation_from_euler,
)
from meeframe.material.half_space import surface_compliance
from meeframe.material.voigt import mandel_matrix

ANGLES = st.floats(-3.2, 3.2)
ROTATIONS = st.tuples(ANGLES, ANGLES, ANGLES).map(lambda angles: rotation_from_euler(np.array(angles)))
# no tiny entries, for which the norms of the invariants would underflow
ENTRIES = st.integers(-(10**6), 10**6).map(lambda k: k / 10**6)
COMMON = settings(deadline=None, max_examples=40)


@st.composite
def materials(draw: st.DrawFn) -> Material:
    """Generate a random triclinic, fully coupled, admissible material with constants of realistic magnitude."""
    root = draw(arrays(float, (6, 6), elements=ENTRIES))
    elastic = 1e11 * (root @ root.T + 0.3 * np.eye(6))
    scale = np.repeat([np.sqrt(1e-9), np.sqrt(1e-5)], 3)
    # a sum of products of positive matrices is positive and has a symmetric off-diagonal block
    pairs, triples = draw(arrays(float, (3, 2), elements=ENTRIES)), draw(arrays(float, (3, 3), elements=ENTRIES))
    products = sum(np.kron(np.outer(v, v), np.outer(w, w)) for v, w in zip(pairs, triples, strict=True))
    block = scale[:, None] * scale * (products + 0.3 * np.eye(6))
    e, q = (draw(arrays(float, (3, 6), elements=ENTRIES)) * size for size in (10.0, 500.0))
    return Material.from_voigt("random", elastic, e, q, block[:3, :3], block[:3, 3:], block[3:, 3:])


def distance(first: Material, second: Material) -> float:
    scale = first.scaling.scale_stiffness
    return float(np.abs(scale(first.stiffness) - scale(second.stiffness)).max())


@COMMON
@given(materials(), ROTATIONS)
def test_rotation_and_its_inverse_cancel(material: Material, rotation: np.ndarray) -> None:
    assert distance(material, material.rotated(rotation).rotated(rotation.T)) < 1e-13


@COMMON
@given(materials(), ROTATIONS, ROTATIONS)
def test_rotations_compose(material: Material, first: np.ndarray, second: np.ndarray) -> None:
    assert distance(material.rotated(second @ first), material.rotated(first).rotated(second)) < 1e-13


@COMMON
@given(materials(), ROTATIONS)
def test_rotation_preserves_invariants(material: Material, rotation: np.ndarray) -> None:
    rotated = material.rotated(rotation)
    for read in (
        lambda m: np.linalg.eigvalsh(mandel_matrix(m.elastic)),
        lambda m: np.linalg.eigvalsh(m.permittivity),
        lambda m: np.linalg.eigvalsh(m.permeability),
        lambda m: np.array([np.linalg.norm(m.piezoelectric), np.linalg.norm(m.piezomagnetic)]),
        lambda m: np.array([np.linalg.norm(np.einsum("kii->k", m.piezoelectric))]),
    ):
        before, after = read(material), read(rotated)
        np.testing.assert_allclose(after, before, atol=1e-12 * np.abs(before).max())


@COMMON
@given(ANGLES)
def test_transverse_isotropy_about_its_axis(angle: float) -> None:
    material = library_material("batio3-cofe2o4")
    turn = rotation_about(np.array([0.0, 0.0, 1.0]), angle)
    assert distance(material, material.rotated(turn)) < 1e-13


def test_orthotropy_is_not_transverse_isotropy() -> None:
    material = library_material("orthotropic-mee")
    z = np.array([0.0, 0.0, 1.0])
    assert distance(material, material.rotated(rotation_about(z, np.pi))) < 1e-13
    assert distance(material, material.rotated(rotation_about(z, np.pi / 2))) > 1e-2


@COMMON
@given(ROTATIONS)
def test_isotropy_in_all_directions(rotation: np.ndarray) -> None:
    material = Material.isotropic(1e9, 0.25)
    assert distance(material, material.rotated(rotation)) < 1e-13


@COMMON
@given(materials())
def test_tables_round_trip(material: Material) -> None:
    np.testing.assert_array_equal(material_from_table(material_table(material)).stiffness, material.stiffness)


@pytest.mark.full
@COMMON
@given(materials(), materials(), st.floats(0.0, 1.0))
def test_mixtures_of_admissible_materials_are_admissible(first: Material, second: Material, fraction: float) -> None:
    mixed = mixture(first, second, fraction)
    np.testing.assert_allclose(
        mixed.stiffness, fraction * first.stiffness + (1 - fraction) * second.stiffness, rtol=1e-12, atol=1e-25
    )


@settings(deadline=None, max_examples=15)
@given(materials(), ROTATIONS, ANGLES)
def test_surface_compliance_rotates_with_the_material(material: Material, rotation: np.ndarray, angle: float) -> None:
    normal, direction = np.array([0.0, 0.0, 1.0]), np.array([np.cos(angle), np.sin(angle), 0.0])
    extended = np.eye(5)
    extended[:3, :3] = rotation
    factors = np.outer(material.scaling.factors, material.scaling.factors)
    y = surface_compliance(material.stiffness, normal, direction)[0] / factors
    rotated = surface_compliance(material.rotated(rotation).stiffness, rotation @ normal, rotation @ direction)[0]
    np.testing.assert_allclose(rotated / factors, extended @ y @ extended.T, atol=1e-10 * np.abs(y).max())
    flipped = np.diag([1.0, 1.0, 1.0, -1.0, -1.0]) @ y
    assert np.linalg.eigvalsh(flipped + np.conj(flipped.T)).min() > 0
