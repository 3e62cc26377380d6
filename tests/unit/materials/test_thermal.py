"""Thermal constants: components, tables, constraints, rotation and admissibility."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import MaterialError
from meeframe.fields import THERMAL_FIELD
from meeframe.material import (
    Material,
    library_material,
    material_from_table,
    material_table,
    mixture,
    rotation_about,
)
from meeframe.material.tables import inline_material
from meeframe.material.thermal import expansion_of

EXPANSION = [15.7e-6, 15.7e-6, 6.4e-6]
P3 = -260e-6


def test_moduli_of_an_isotropic_body() -> None:
    """beta = E alpha / (1 - 2 nu) on the diagonal (Duhamel-Neumann)."""
    material = Material.isotropic(70e9, 0.3).with_heat(200.0, 23e-6)
    assert material.fields.names[-1] == "thermal"
    expected = np.zeros((3, 5))
    expected[:, :3] = 70e9 * 23e-6 / (1.0 - 2.0 * 0.3) * np.eye(3)
    np.testing.assert_allclose(material.thermal_moduli, expected, rtol=1e-13, atol=1e-7)


def test_coefficients_at_constant_stress_and_strain_differ_by_the_expansion() -> None:
    """A free body that is heated has D = p(stress) theta, computed by its strain and p(strain)."""
    body = library_material("batio3")
    strain = body.with_heat(2.5, EXPANSION, pyroelectric=[0, 0, P3], pyro_constraint="strain")
    alpha = np.diag(EXPANSION)
    total = -strain.thermal_moduli[:, 3] + np.einsum("nkl,kl->n", body.piezoelectric, alpha)
    stress = body.with_heat(2.5, EXPANSION, pyroelectric=total, pyro_constraint="stress")
    np.testing.assert_allclose(stress.thermal_moduli, strain.thermal_moduli, rtol=1e-12, atol=1e-16)
    assert total[2] != P3
    np.testing.assert_allclose(expansion_of(body.elastic, strain.thermal_moduli[:, :3]), alpha, atol=1e-19)
    by_moduli = body.with_heat(
        2.5, thermal_moduli=strain.thermal_moduli[:, :3], pyroelectric=total, pyro_constraint="stress"
    )
    np.testing.assert_allclose(by_moduli.thermal_moduli, strain.thermal_moduli, rtol=1e-12, atol=1e-16)


def test_rotation_and_mixture() -> None:
    """Moduli rotate like the stress and the flux that they cause, and mix like the other tensors."""
    material = library_material("batio3-cofe2o4", thermal=True)
    rotation = rotation_about([1.0, 2.0, -0.5], 0.7)
    rotated = material.rotated(rotation)
    expected = np.column_stack(
        [rotation @ material.thermal_moduli[:, :3] @ rotation.T, rotation @ material.thermal_moduli[:, 3:]]
    )
    np.testing.assert_allclose(rotated.thermal_moduli, expected, rtol=1e-12, atol=1e-9)
    assert rotated.fields == material.fields
    half = mixture(material, rotated, 0.5)
    np.testing.assert_allclose(half.thermal_moduli, (material.thermal_moduli + rotated.thermal_moduli) / 2)


def test_keys_components_and_library_agree() -> None:
    """Constants may be keys of [material], components of a symmetry, or those of the library, and are read back."""
    library = library_material("batio3", thermal=True)
    keys = {
        "name": "batio3",
        "thermal_conductivity": "2.5 W/m/K",
        "thermal_expansion": ["15.7e-6 1/K", 15.7e-6, 6.4e-6],
        "pyroelectric": [0, 0, "-260 uC/m^2/K"],
        "pyro_constraint": "strain",
    }
    table = material_table(library_material("batio3"))
    heat = {"k_11": 2.5, "k_33": 2.5, "alpha_11": 15.7e-6, "alpha_33": "6.4e-6 1/K", "p_3": P3}
    components = table | {
        "symmetry": "transversely-isotropic",
        "components": table["components"] | heat,
        "pyro_constraint": "strain",
    }
    for one in (material_from_table(keys), material_from_table(components), inline_material(material_table(library))):
        assert one.fields == library.fields
        np.testing.assert_allclose(one.thermal_moduli, library.thermal_moduli, rtol=1e-12, atol=1e-18)
        np.testing.assert_allclose(one.decoupled[0][1], 2.5 * np.eye(3), atol=1e-15)
    rotated = material_from_table(keys | {"rotation": {"axis": [1, 0, 0], "angle": "90 deg"}})
    np.testing.assert_allclose(rotated.thermal_moduli[:, 3], [0.0, P3, 0.0], atol=1e-18)
    for name in ("batio3-cofe2o4", "cofe2o4"):
        assert library_material(name, thermal=True).thermal_moduli is not None
    assert library_material("batio3").thermal_moduli is None


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"thermal_expansion": 1e-5}, "thermal_expansion without thermal_conductivity"),
        ({"thermal_conductivity": -1.0}, "thermal_conductivity must be positive definite"),
        ({"thermal_conductivity": [1.0, 2.0]}, "one number, three on the diagonal"),
        (
            {"thermal_conductivity": 1.0, "thermal_expansion": [1.0, 2.0]},
            "thermal_expansion is .*three on the diagonal",
        ),
        ({"thermal_conductivity": 1.0, "thermal_expansion": "1 m"}, "has the wrong unit"),
        ({"thermal_conductivity": 1.0, "thermal_expansion": 1e-5, "thermal_moduli": 1e5}, "are both given"),
        ({"thermal_conductivity": 1.0, "pyroelectric": [0, 0, 1e-4]}, "pyroelectric without pyro_constraint"),
        ({"thermal_conductivity": 1.0, "pyroelectric": [0, 0, 1e-4], "pyro_constraint": "field"}, "'field'; allowed"),
        ({"thermal_conductivity": 1.0, "pyromagnetic": 1e-4, "pyro_constraint": "strain"}, "three finite numbers"),
        ({"thermal": 1}, "allowed: true or false"),
    ],
)
def test_invalid_keys(keys: dict[str, object], message: str) -> None:
    with pytest.raises(MaterialError, match=message):
        material_from_table({"name": "batio3", **keys})


def test_invalid_components_and_objects() -> None:
    table = material_table(library_material("zno"))
    for components, message in (
        ({"alpha_11": 1e-6}, "without thermal conductivity"),
        ({"k_11": 1.0, "k_22": 1.0, "k_33": 1.0, "p_4": 1.0}, "unknown component 'p_4'"),
        ({"k_11": 1.0, "k_22": -1.0, "k_33": 1.0}, "positive definite"),
    ):
        with pytest.raises(MaterialError, match=message):
            inline_material(table | {"components": table["components"] | components})
    hexagonal = table | {"symmetry": "transversely-isotropic", "pyro_constraint": "strain"}
    with pytest.raises(MaterialError, match="p_1 does not exist in symmetry"):
        inline_material(hexagonal | {"components": table["components"] | {"k_11": 1.0, "k_33": 1.0, "p_1": 1.0}})
    with pytest.raises(MaterialError, match="has no thermal constants in the library; allowed: batio3"):
        library_material("zno", thermal=True)
    with pytest.raises(MaterialError, match="thermal_conductivity is missing"):
        replace(library_material("zno"), thermal_moduli=np.zeros((3, 5)))
    with pytest.raises(MaterialError, match="has the thermal field already"):
        library_material("zno").with_heat(1.0).with_field(THERMAL_FIELD, 1.0)
