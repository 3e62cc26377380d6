"""The surface compliance agrees with closed forms, the Stroh eigenproblem and docs/explanation/theory.md."""

import numpy as np
import pytest

from meeframe.common.errors import MaterialError
from meeframe.fields import FieldScaling
from meeframe.material import VACUUM_PERMITTIVITY, Material, library_material, mixture, rotation_about
from meeframe.material.half_space import axisymmetric_compliance, surface_compliance

AXIS = np.array([0.0, 0.0, 1.0])


def stroh_compliance(stiffness: np.ndarray, normal: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return Y = i A B^-1 from the 10x10 eigenproblem of the scaled material (decaying modes), inward normal
    -normal."""
    scaling = FieldScaling.of(stiffness)
    c, m, n = scaling.scale_stiffness(stiffness), direction, -normal
    q, r, t = (np.einsum("i,iJKm,m->JK", a, c, b) for a, b in ((m, m), (m, n), (n, n)))
    inverse = np.linalg.inv(t)
    n1 = -inverse @ r.T
    system = np.block([[n1, inverse], [r @ inverse @ r.T - q, n1.T]])
    values, vectors = np.linalg.eig(system)
    decaying = vectors[:, values.imag > 0]
    y = 1j * decaying[:5] @ np.linalg.inv(decaying[5:])
    return scaling.factors[:, None] * y * scaling.factors


def test_table_1_matches_the_theory_page() -> None:
    xi = axisymmetric_compliance(library_material("batio3-cofe2o4").stiffness)
    expected = [[2.03385e-12, 1.77286e-3, 1.93803e-6], [1.77286e-3, -2.35892e7, 2.85282e3]]
    np.testing.assert_allclose(xi[:2], expected, rtol=3e-6)
    assert xi[2, 2] == pytest.approx(-1.00418e3, rel=3e-6)
    assert np.linalg.det(xi) == pytest.approx(5.14254e-2, rel=5e-6)


def test_unrounded_mixture_gives_table_2() -> None:
    # xi11 as corrected in docs/explanation/theory.md; the others as printed
    mixed = mixture(library_material("batio3"), library_material("cofe2o4"), 0.5)
    xi = axisymmetric_compliance(mixed.stiffness)
    expected = [[2.03552e-12, 1.77480e-3, 1.93900e-6], [1.77480e-3, -2.35928e7, 2.85507e3]]
    np.testing.assert_allclose(xi[:2], expected, rtol=5e-6)
    assert xi[2, 2] == pytest.approx(-1.00418e3, rel=5e-6)
    assert np.linalg.det(xi) == pytest.approx(5.14794e-2, rel=1e-5)


def test_isotropic_half_space_matches_boussinesq_and_cerruti() -> None:
    # degenerate: eigenvectors cannot solve this eigenproblem
    young, poisson = 200e9, 0.3
    shear = young / (2 * (1 + poisson))
    material = Material.isotropic(young, poisson)
    y = surface_compliance(material.stiffness, AXIS, [[1.0, 0.0, 0.0]])[0]
    coupling = (1 - 2 * poisson) / (2 * shear)
    expected = np.diag([(1 - poisson) / shear, 1 / shear, (1 - poisson) / shear]).astype(complex)
    # a tension t3 > 0 displaces the surface outwards around it
    expected[0, 2], expected[2, 0] = -1j * coupling, 1j * coupling
    np.testing.assert_allclose(y[:3, :3] * shear, expected * shear, atol=1e-13)
    xi = axisymmetric_compliance(material.stiffness)
    assert xi[0, 0] == pytest.approx((1 - poisson**2) / (np.pi * young), rel=1e-13)
    # outward flux causes a negative potential: phi = -q/(2 pi eps r)
    assert xi[1, 1] == pytest.approx(-1 / (2 * np.pi * VACUUM_PERMITTIVITY), rel=1e-13)


@pytest.mark.parametrize("missing", [1e-3, 1e-4, 1e-6, 1e-8])
def test_nearly_incompressible_half_space_matches_closed_forms(missing: float) -> None:
    """Near a Poisson ratio of 0.5, the tensor S nearly vanishes, and most of the stiffness cancels in L."""
    young, poisson = 1e6, 0.5 - missing
    shear = young / (2 * (1 + poisson))
    normals = np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0]])
    y = surface_compliance(Material.isotropic(young, poisson).stiffness, AXIS, normals) * shear
    lost = 1e-14 / missing
    np.testing.assert_allclose(y[:, 2, 2], 1 - poisson, rtol=lost)
    np.testing.assert_allclose(y[:, 2, :2], 0.5j * (1 - 2 * poisson) * normals[:, :2], atol=lost)
    np.testing.assert_allclose(y[0, :2, :2], np.diag([1 - poisson, 1.0]), atol=lost)


@pytest.mark.parametrize("young", [1e6, 2e11])
def test_nearly_incompressible_half_space_has_six_digits_or_is_rejected(young: float) -> None:
    normals = np.random.default_rng(0).normal(size=(24, 3))
    normal = np.array([0.6, 0.0, 0.8])
    y = surface_compliance(Material.isotropic(young, 0.4999999999).stiffness, normal, normals)
    along = np.einsum("i,nij,j->n", normal, y[:, :3, :3], normal)
    np.testing.assert_allclose(along, 1.5 / young, rtol=1e-6)
    for poisson in (0.49999999999, 0.499999999999):
        with pytest.raises(
            MaterialError,
            match=r"the surface compliance has a round-off error of 1e-0[45]: the material is nearly incompr",
        ):
            surface_compliance(Material.isotropic(young, poisson).stiffness, normal, normals)


@pytest.mark.parametrize("name", ["orthotropic-mee", "pvdf", "batio3-cofe2o4"])
def test_tilted_materials_match_the_stroh_eigenproblem(name: str) -> None:
    tilted = library_material(name).rotated(rotation_about(np.array([1.0, 2.0, 3.0]), 0.8))
    normal = np.array([0.6, 0.0, 0.8])
    angles = np.array([0.1, 1.3, 2.9])
    directions = np.outer(np.cos(angles), [0.8, 0.0, -0.6]) + np.outer(np.sin(angles), [0.0, 1.0, 0.0])
    y = surface_compliance(tilted.stiffness, normal, directions)
    factors = tilted.scaling.factors
    for got, direction in zip(y, directions, strict=True):
        reference = stroh_compliance(tilted.stiffness, normal, direction)
        np.testing.assert_allclose(got / np.outer(factors, factors), reference / np.outer(factors, factors), atol=1e-10)


def test_compliance_is_hermitian_reversible_and_positive() -> None:
    material = library_material("orthotropic-mee")
    directions = np.random.default_rng(0).normal(size=(8, 3))
    y = surface_compliance(material.stiffness, AXIS, directions)
    np.testing.assert_allclose(y, np.conj(y.transpose(0, 2, 1)), rtol=1e-15)
    back = surface_compliance(material.stiffness, AXIS, -directions)
    factors = np.outer(material.scaling.factors, material.scaling.factors)
    np.testing.assert_allclose(back / factors, np.conj(y) / factors, atol=1e-13)
    flipped = np.diag([1.0, 1.0, 1.0, -1.0, -1.0]) @ (y / factors)
    assert np.linalg.eigvalsh(flipped + np.conj(flipped.transpose(0, 2, 1))).min() > 0


def test_reversed_and_rotated_poling() -> None:
    material = library_material("batio3-cofe2o4")
    xi = axisymmetric_compliance(material.stiffness)
    flip = np.outer([1, -1, -1], [1, -1, -1])
    down = axisymmetric_compliance(material.stiffness, -AXIS)
    np.testing.assert_allclose(down, xi * flip, rtol=1e-10)
    rotated = material.rotated(rotation_about(np.array([0.0, 1.0, 0.0]), np.pi / 2))
    np.testing.assert_allclose(axisymmetric_compliance(rotated.stiffness, [2.0, 0.0, 0.0]), xi, rtol=1e-10)


def test_invalid_vectors_and_anisotropy_are_rejected() -> None:
    stiffness = library_material("orthotropic-mee").stiffness
    with pytest.raises(MaterialError, match="not axisymmetric"):
        axisymmetric_compliance(stiffness)
    with pytest.raises(MaterialError, match="normal"):
        surface_compliance(stiffness, np.zeros(3), [[1.0, 0.0, 0.0]])
    with pytest.raises(MaterialError, match="direction"):
        surface_compliance(stiffness, AXIS, [[0.0, 0.0, 2.0]])
