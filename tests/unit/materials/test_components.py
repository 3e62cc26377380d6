"""Test named components and symmetry classes."""

import numpy as np
import pytest

from meeframe.common.errors import MaterialError
from meeframe.material import (
    VACUUM_PERMEABILITY,
    VACUUM_PERMITTIVITY,
    Material,
    library_material,
    material_from_components,
)
from meeframe.material.components import component_label, parse_component

HEXAGONAL = {"c_1111": 226e9, "c_1122": 125e9, "c_1133": 124.25e9, "c_3333": 216e9, "c_2323": 44.15e9}
CUBIC = {"c_1111": 118.8e9, "c_1122": 53.8e9, "c_2323": 59.4e9, "e_123": -0.16}


@pytest.mark.parametrize(
    ("names", "component"),
    [
        (("c_1122", "c_2211", "c_12", "c12", "c_21"), ("c", 1, 2)),
        (("c_2323", "c_3223", "c_3232", "c_44"), ("c", 4, 4)),
        (("c_1123", "c_3211", "c_41"), ("c", 1, 4)),
        (("e_113", "e_131", "e_15", "e15"), ("e", 1, 5)),
        (("q_311", "q_31"), ("q", 3, 1)),
        (("q_312", "q_321", "q_36"), ("q", 3, 6)),
        (("eps_13", "eps_31", "epsilon_13"), ("eps", 1, 3)),
        (("lambda_22", "lambda22"), ("lambda", 2, 2)),
        (("mu_32", "mu_23"), ("mu", 2, 3)),
    ],
)
def test_equivalent_names(names: tuple[str, ...], component: tuple[str, int, int]) -> None:
    assert {parse_component(name) for name in names} == {component}
    assert parse_component(component_label(component)) == component


@pytest.mark.parametrize(
    "name", ["c_1", "c_123", "c_1114", "c_17", "e_411", "e_46", "eps_4", "eps_111", "x_11", "c_", ""]
)
def test_invalid_names_are_listed(name: str) -> None:
    with pytest.raises(MaterialError, match=f"unknown component '{name}'.*c_1122.*e_311"):
        material_from_components("m", {name: 1.0})


def test_symmetries_fill_the_tensors() -> None:
    material = material_from_components("m", {**HEXAGONAL, "e_131": 5.8}, "transversely-isotropic")
    for index in ((0, 0, 1, 1), (1, 1, 0, 0)):
        assert material.elastic[index] == 125e9
    for index in ((0, 1, 0, 1), (1, 0, 0, 1), (1, 0, 1, 0)):
        assert material.elastic[index] == pytest.approx(50.5e9)
    for index in ((1, 2, 2, 1), (0, 2, 0, 2)):
        assert material.elastic[index] == 44.15e9
    for index in ((0, 0, 2), (0, 2, 0), (1, 1, 2), (1, 2, 1)):
        assert material.piezoelectric[index] == 5.8


def test_duplicates_must_agree() -> None:
    material_from_components("m", {**HEXAGONAL, "c_2211": 125e9, "c_1313": 44.15e9}, "transversely-isotropic")
    with pytest.raises(MaterialError, match=r"'m': c_1122 = 1\.25e\+11 and c_2211 = 1\.26e\+11 are the same"):
        material_from_components("m", {**HEXAGONAL, "c_2211": 126e9}, "transversely-isotropic")
    with pytest.raises(MaterialError, match=r"c_2323 = .* c_1313 = .*must be equal"):
        material_from_components("m", {**HEXAGONAL, "c_1313": 50e9}, "transversely-isotropic")


def test_shear_relation_solves_for_the_missing_constant() -> None:
    expected = material_from_components("m", HEXAGONAL, "transversely-isotropic").elastic
    for missing in ("c_1111", "c_1122"):
        given = {**HEXAGONAL, "c_1212": 50.5e9}
        del given[missing]
        solved = material_from_components("m", given, "transversely-isotropic").elastic
        np.testing.assert_allclose(solved, expected, rtol=1e-14)
    with pytest.raises(MaterialError, match=r"c_1212 = 4\.4e\+10 must be \(c_1111 - c_1122\)/2 = 5\.05e\+10"):
        material_from_components("m", {**HEXAGONAL, "c_1212": 44e9}, "transversely-isotropic")


def test_isotropic_class_equals_young_and_poisson() -> None:
    young, poisson = 70e9, 0.2
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    shear = young / (2 * (1 + poisson))
    made = material_from_components("m", {"c_12": lame, "c_44": shear}, "isotropic")
    np.testing.assert_allclose(made.elastic, Material.isotropic(young, poisson).elastic, rtol=1e-13, atol=1.0)


def test_cubic_class_has_its_symmetry() -> None:
    material = material_from_components("m", CUBIC, "cubic")
    cycle = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # a threefold axis along (1, 1, 1)
    np.testing.assert_allclose(material.rotated(cycle).stiffness, material.stiffness, rtol=1e-12)


def test_missing_and_forbidden_components() -> None:
    with pytest.raises(MaterialError, match="symmetry 'cubic' needs c_1122, c_2323"):
        material_from_components("m", {"c_1111": 1e9}, "cubic")
    with pytest.raises(MaterialError, match="e_311 does not exist in symmetry 'cubic'"):
        material_from_components("m", {**CUBIC, "e_311": 1.0}, "cubic")
    material_from_components("m", {**CUBIC, "e_311": 0.0}, "cubic")
    with pytest.raises(MaterialError, match="needs eps_33"):
        material_from_components("m", {**HEXAGONAL, "eps_11": 1e-9}, "transversely-isotropic")
    with pytest.raises(MaterialError, match="'hexagonal'; allowed: triclinic, orthotropic, trans"):
        material_from_components("m", HEXAGONAL, "hexagonal")
    with pytest.raises(MaterialError, match="c_1111 is nan"):
        material_from_components("m", {**HEXAGONAL, "c_1111": np.nan})


def test_vacuum_by_default() -> None:
    material = material_from_components("m", HEXAGONAL, "transversely-isotropic")
    np.testing.assert_array_equal(material.permittivity, VACUUM_PERMITTIVITY * np.eye(3))
    np.testing.assert_array_equal(material.permeability, VACUUM_PERMEABILITY * np.eye(3))
    # related by the speed of light
    speed = (VACUUM_PERMITTIVITY * VACUUM_PERMEABILITY) ** -0.5
    assert speed == pytest.approx(299_792_458, rel=1e-9)


def test_triclinic_accepts_any_component() -> None:
    base = {f"c_{i}{i}": 10e9 for i in range(1, 7)} | {f"mu_{i}{i}": 1e-6 for i in range(1, 4)}
    material = material_from_components("m", {**base, "c_1113": 1e9, "e_212": 0.3, "mu_12": 1e-7})
    assert material.elastic[0, 2, 0, 0] == 1e9
    assert material.piezoelectric[1, 1, 0] == 0.3
    assert material.permeability[1, 0] == 1e-7


def test_table_3_is_as_printed() -> None:
    material = library_material("orthotropic-mee")
    assert material.elastic[1, 1, 2, 2] == 1.31e9
    assert material.elastic[0, 2, 2, 0] == 0.59e9
    assert material.piezoelectric[1, 2, 1] == -0.013
    assert material.piezomagnetic[2, 1, 1] == 590.0
    np.testing.assert_allclose(np.diag(material.permittivity), [0.054e-9, 0.066e-9, 0.059e-9])
    np.testing.assert_allclose(np.diag(material.permeability), [5e-6, 7e-6, 10e-6])
    np.testing.assert_allclose(np.diag(material.magnetoelectric), [0.6e-8, 0.8e-8, 0.1e-8])
