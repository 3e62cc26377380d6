"""Test materials: symmetries, admissibility, extended stiffness, rotation, mixture."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import MaterialError
from meeframe.material import Material, library_material, mixture, rotation_about, rotation_from_euler
from meeframe.material.voigt import coupling_matrix, coupling_tensor, elastic_matrix, elastic_tensor, mandel_matrix

VOIGT = {(0, 0): 0, (1, 1): 1, (2, 2): 2, (1, 2): 3, (0, 2): 4, (0, 1): 5}


@pytest.fixture
def table_1() -> Material:
    return library_material("batio3-cofe2o4")


@pytest.fixture
def table_3() -> Material:
    return library_material("orthotropic-mee")


def fields(material: Material) -> dict[str, np.ndarray]:
    names = ("elastic", "piezoelectric", "piezomagnetic", "permittivity", "magnetoelectric", "permeability")
    return {name: np.array(getattr(material, name)) for name in names}


def test_voigt_maps_every_index_pair() -> None:
    c, e = np.arange(36.0).reshape(6, 6), np.arange(18.0).reshape(3, 6)
    elastic, coupling = elastic_tensor(c), coupling_tensor(e)
    for i, j, k, l in itertools.product(range(3), repeat=4):  # noqa: E741
        row, column = VOIGT[min(i, j), max(i, j)], VOIGT[min(k, l), max(k, l)]
        assert elastic[i, j, k, l] == c[row, column]
        assert coupling[k, i, j] == e[k, row]
    np.testing.assert_array_equal(elastic_matrix(elastic), c)
    np.testing.assert_array_equal(coupling_matrix(coupling), e)


def test_mandel_eigenvalues_of_isotropic_stiffness() -> None:
    material = Material.isotropic(200e9, 0.3)
    bulk, shear = 200e9 / (3 * 0.4), 200e9 / 2.6
    expected = [2 * shear] * 5 + [3 * bulk]
    np.testing.assert_allclose(np.linalg.eigvalsh(mandel_matrix(material.elastic)), expected, rtol=1e-13)


def test_extended_stiffness_gives_constitutive_law(table_3: Material) -> None:
    # eqs. (5)-(7) evaluated directly, compared with eq. (41)
    gradient = np.random.default_rng(1).normal(size=(5, 3)) * np.array([1e-4, 1e-4, 1e-4, 1e3, 1.0])[:, None]
    strain = (gradient[:3] + gradient[:3].T) / 2
    electric, magnetic = -gradient[3], -gradient[4]
    m = table_3
    stress = (
        np.einsum("ijkl,kl->ij", m.elastic, strain)
        - np.einsum("lij,l->ij", m.piezoelectric, electric)
        - np.einsum("lij,l->ij", m.piezomagnetic, magnetic)
    )
    d = np.einsum("ikl,kl->i", m.piezoelectric, strain) + m.permittivity @ electric + m.magnetoelectric @ magnetic
    b = np.einsum("ikl,kl->i", m.piezomagnetic, strain) + m.magnetoelectric @ electric + m.permeability @ magnetic
    extended = np.einsum("iJKm,Km->iJ", m.stiffness, gradient)
    np.testing.assert_allclose(extended[:, :3], stress, rtol=1e-12)
    np.testing.assert_allclose(extended[:, 3], d, rtol=1e-12)
    np.testing.assert_allclose(extended[:, 4], b, rtol=1e-12)


def test_extended_stiffness_is_symmetric_and_cached(table_3: Material) -> None:
    np.testing.assert_array_equal(table_3.stiffness, table_3.stiffness.transpose(3, 2, 1, 0))
    assert table_3.stiffness is table_3.stiffness
    with pytest.raises(ValueError, match="read-only"):
        table_3.stiffness[0, 0, 0, 0] = 1.0


def test_scaling_brings_stiffness_to_order_one(table_1: Material) -> None:
    scaled = table_1.scaling.scale_stiffness(table_1.stiffness)
    assert np.abs(scaled).max() == pytest.approx(1.0)
    for field in range(5):
        assert np.abs(scaled[:, field, field, :]).max() > 0.1


def test_material_copies_its_arrays(table_1: Material) -> None:
    data = fields(table_1)
    material = Material("copy", **data)
    data["elastic"][:] = 0.0
    assert material.elastic.max() == 226e9


@pytest.mark.parametrize(
    ("field", "index", "law"),
    [
        ("elastic", (0, 0, 1, 1), "c_klij"),
        ("elastic", (0, 1, 0, 1), "c_jikl"),
        ("piezoelectric", (0, 0, 2), "e_kji"),
        ("piezomagnetic", (2, 0, 1), "q_kji"),
        ("permittivity", (0, 1), "eps_lk"),
        ("magnetoelectric", (1, 2), "lambda_lk"),
        ("permeability", (0, 2), "mu_lk"),
    ],
)
def test_broken_symmetry_is_named(table_3: Material, field: str, index: tuple[int, ...], law: str) -> None:
    data = fields(table_3)
    data[field][index] += 0.01 * np.abs(data[field]).max()
    with pytest.raises(MaterialError, match=rf"'broken'.*{law}.*{''.join(str(i + 1) for i in index)}"):
        Material("broken", **data)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_nonfinite_entries_are_rejected(table_1: Material, value: float) -> None:
    data = fields(table_1)
    data["piezoelectric"][2, 0, 0] = value
    with pytest.raises(MaterialError, match=r"e_311 is (nan|inf)"):
        Material("bad", **data)


def test_wrong_shapes_are_rejected(table_1: Material) -> None:
    data = fields(table_1)
    with pytest.raises(MaterialError, match=r"c has shape \(6, 6\)"):
        Material("bad", **{**data, "elastic": np.eye(6)})
    with pytest.raises(MaterialError, match=r"Voigt matrix e is \(6, 3\)"):
        Material.from_voigt("bad", np.eye(6), np.zeros((6, 3)), np.zeros((3, 6)), np.eye(3), np.eye(3), np.eye(3))


def test_indefinite_stiffness_names_block_and_eigenvalue(table_1: Material) -> None:
    data = fields(table_1)
    c = elastic_matrix(data["elastic"])
    c[3, 3] = -2e9  # eigenvalue of the tensor: 2 c_2323
    with pytest.raises(MaterialError, match=r"elastic stiffness c must be positive definite.*-4e\+09 Pa"):
        Material("bad", **{**data, "elastic": elastic_tensor(c)})


def test_indefinite_permittivity_is_named(table_1: Material) -> None:
    data = fields(table_1)
    data["permeability"][2, 2] = -1e-6
    with pytest.raises(MaterialError, match=r"mu must be positive definite.*-1e-06"):
        Material("bad", **data)


def test_inadmissible_coupling_names_component_and_limit(table_1: Material) -> None:
    data = fields(table_1)
    limit = np.sqrt(data["permittivity"][0, 0] * data["permeability"][0, 0])
    data["magnetoelectric"][0, 0] = 0.999 * limit
    Material("good", **data)
    data["magnetoelectric"][0, 0] = 1.001 * limit
    with pytest.raises(MaterialError, match=r"block \[\[eps, lambda\], \[lambda, mu\]\].*eigenvalue is -.*lambda_11"):
        Material("bad", **data)


def test_jointly_inadmissible_coupling_is_rejected() -> None:
    # each component is below its limit of 1e-7, but the matrix of all ones is not admissible
    one, none = np.eye(3), np.zeros((3, 3, 3))
    c = Material.isotropic(1e9, 0.3).elastic
    with pytest.raises(MaterialError, match="jointly too large"):
        Material("bad", c, none, none, 1e-9 * one, 0.5e-7 * np.ones((3, 3)), 1e-5 * one)


@pytest.mark.parametrize(("young", "poisson"), [(0.0, 0.3), (-1.0, 0.3), (np.nan, 0.3), (1e9, 0.5), (1e9, -1.0)])
def test_isotropic_bounds(young: float, poisson: float) -> None:
    with pytest.raises(MaterialError, match="must"):
        Material.isotropic(young, poisson)


def test_isotropic_uniaxial_stress() -> None:
    material = Material.isotropic(210e9, 0.28)
    strain = np.diag([1e-3, -0.28e-3, -0.28e-3])
    stress = np.einsum("ijkl,kl->ij", material.elastic, strain)
    np.testing.assert_allclose(stress, np.diag([210e6, 0, 0]), atol=1e-6 * 210e6 * 1e-6)


def test_rotation_by_90_degrees_about_x2(table_1: Material) -> None:
    # x3 becomes x1 and x1 becomes -x3: the poling axis is along x1
    rotated = table_1.rotated(rotation_about(np.array([0.0, 1.0, 0.0]), np.pi / 2))
    assert rotated.elastic[0, 0, 0, 0] == pytest.approx(216e9)
    assert rotated.piezoelectric[0, 0, 0] == pytest.approx(9.3)
    assert rotated.piezoelectric[0, 1, 1] == pytest.approx(-2.2)
    assert rotated.piezoelectric[1, 0, 1] == pytest.approx(5.8)
    assert rotated.permeability[0, 0] == pytest.approx(83.5e-6)
    half = table_1.rotated(rotation_about(np.array([1.0, 0.0, 0.0]), np.pi))
    assert half.piezoelectric[2, 2, 2] == pytest.approx(-9.3)


@pytest.mark.parametrize(("odd", "magnetic"), [("piezomagnetic", 1.0), ("magnetoelectric", -1.0)])
def test_mirror_images(table_3: Material, odd: str, magnetic: float) -> None:
    """docs/reference/materials.md: a reflection in x1 = 0 maps the fields onto each other, with psi unchanged or
    negated."""
    material = table_3.rotated(rotation_from_euler([0.3, 0.8, -0.5]))
    names = ("piezoelectric", odd)
    negated = replace(material, **{name: -getattr(material, name) for name in names})
    mirrored = negated.rotated(rotation_about([1, 0, 0], np.pi))
    values = np.diag([-1.0, 1.0, 1.0, 1.0, magnetic])
    space = values[:3, :3]
    expected = np.einsum("ia,JB,KD,mc,aBDc->iJKm", space, values, values, space, material.stiffness)
    computed, reference, before = map(
        material.scaling.scale_stiffness, (mirrored.stiffness, expected, material.stiffness)
    )
    np.testing.assert_allclose(computed, reference, atol=1e-14)
    assert not np.allclose(computed, before, atol=1e-3)


def test_subnormal_coupling_survives_rotation(table_1: Material) -> None:
    data = fields(table_1)
    data["magnetoelectric"] = np.full((3, 3), 1.3e-316)
    Material("tiny", **data).rotated(rotation_from_euler(np.array([0.0, 0.0, 1.0])))


def test_euler_angles_compose_rotations() -> None:
    a, b, c = 0.3, 1.1, -0.4
    x, z = np.eye(3)[0], np.eye(3)[2]
    expected = rotation_about(z, a) @ rotation_about(x, b) @ rotation_about(z, c)
    np.testing.assert_allclose(rotation_from_euler(np.array([a, b, c]), "ZXZ"), expected, atol=1e-14)
    np.testing.assert_allclose(rotation_about(z, np.pi / 2) @ x, [0, 1, 0], atol=1e-15)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.diag([1.0, 1.0, -1.0]), "improper"),
        (np.diag([1.0, 1.0, 1.01]), "not orthogonal"),
        (np.full((3, 3), np.nan), "finite"),
        (np.eye(2), r"\(3, 3\)"),
    ],
)
def test_invalid_rotations_are_rejected(table_1: Material, matrix: np.ndarray, message: str) -> None:
    with pytest.raises(MaterialError, match=message):
        table_1.rotated(matrix)


def test_invalid_axes_and_sequences_are_rejected() -> None:
    with pytest.raises(MaterialError, match="axis"):
        rotation_about(np.zeros(3), 1.0)
    for sequence in ("zxw", "ZxZ", "zz", "zzx"):
        with pytest.raises(MaterialError, match=sequence):
            rotation_from_euler(np.zeros(3), sequence)


def test_equal_mixture_of_phases_is_table_1(table_1: Material) -> None:
    mixed = mixture(library_material("batio3"), library_material("cofe2o4"), 0.5)
    # unrounded constants, docs/explanation/theory.md, Half space
    assert mixed.elastic[2, 2, 2, 2] == pytest.approx(215.75e9)
    assert mixed.piezomagnetic[2, 2, 2] == pytest.approx(349.85)
    assert mixed.permittivity[2, 2] == pytest.approx(6.3465e-9)
    for name, printed in fields(table_1).items():
        np.testing.assert_allclose(getattr(mixed, name), printed, rtol=1.2e-3, err_msg=name)


def test_mixture_ends_and_bounds(table_1: Material, table_3: Material) -> None:
    np.testing.assert_array_equal(mixture(table_1, table_3, 1.0).stiffness, table_1.stiffness)
    np.testing.assert_array_equal(mixture(table_1, table_3, 0.0).stiffness, table_3.stiffness)
    for fraction in (-0.1, 1.1, np.nan):
        with pytest.raises(MaterialError, match="fraction"):
            mixture(table_1, table_3, fraction)
