"""Library materials agree with independent forms of their constants: published compliances and moduli."""

import numpy as np
import pytest

from meeframe.material import library, library_material, rotation_about
from meeframe.material.material import VACUUM_PERMITTIVITY
from meeframe.material.voigt import coupling_matrix, elastic_matrix


def hexagonal(s11, s12, s13, s33, s44, s66, d31, d33, d15):
    """Return the compliance (6, 6) [1/TPa] and strain coefficients (3, 6) [pm/V] of class 6mm."""
    s, d = np.diag([s11, s11, s33, s44, s44, s66]), np.zeros((3, 6))
    s[0, 1] = s[1, 0] = s12
    s[:2, 2] = s[2, :2] = s13
    d[2, :3], d[0, 4], d[1, 3] = (d31, d31, d33), d15, d15
    return s, d


def trigonal():
    """Return the compliance and strain coefficients of lithium niobate, Warner, Onoe and Coquin (1967)."""
    s, d = hexagonal(5.78, -1.01, -1.47, 5.02, 17.0, 2 * (5.78 + 1.01), -1.0, 6.0, 68.0)
    s[0, 3] = s[3, 0] = -1.02
    s[1, 3] = s[3, 1] = 1.02
    s[4, 5] = s[5, 4] = -2.04
    d[1, 1], d[1, 0], d[0, 5] = 21.0, -21.0, -42.0
    return s, d


# compliance forms, permittivities at constant stress over vacuum, tolerances of c, e and of eps relative to their
# largest entries: digits of the tables (0.05 of 3.7 C/m^2 for lithium niobate), or the scatter of ceramics
FORMS = {
    "pzt-4": (hexagonal(12.3, -4.05, -5.31, 15.5, 39.0, 32.7, -123, 289, 496), (1475, 1475, 1300), 0.01, 0.05),
    "pzt-5a": (hexagonal(16.4, -5.74, -7.22, 18.8, 47.5, 44.3, -171, 374, 584), (1730, 1730, 1700), 0.01, 0.01),
    "pzt-5h": (hexagonal(16.5, -4.78, -8.45, 20.7, 43.5, 42.6, -274, 593, 741), (3130, 3130, 3400), 0.01, 0.03),
    "zno": (hexagonal(7.86, -3.43, -2.21, 6.94, 23.6, 22.58, -5.43, 11.67, -11.34), (9.16, 9.16, 12.64), 0.01, 0.01),
    "linbo3": (trigonal(), (84, 84, 30), 0.014, 0.01),
}


@pytest.mark.parametrize("name", FORMS)
def test_compliance_form_gives_the_same_constants(name):
    """c = s^-1, e = d c, and eps at constant strain = eps at constant stress - d e^T."""
    (s, d), relative, tolerance, of_permittivity = FORMS[name]
    material = library_material(name)
    stiffness = np.linalg.inv(s) * 1e12
    coupling = d * 1e-12 @ stiffness
    permittivity = np.diag(relative) * VACUUM_PERMITTIVITY - d * 1e-12 @ coupling.T
    for given, expected, allowed in (
        (elastic_matrix(material.elastic), stiffness, tolerance),
        (coupling_matrix(material.piezoelectric), coupling, tolerance),
        (material.permittivity, permittivity, of_permittivity),
    ):
        np.testing.assert_allclose(given, expected, rtol=0, atol=allowed * np.abs(expected).max())


def test_terfenol_d_follows_from_its_compliances_and_is_plausible():
    """Coupling factors, moduli and sound speed of the alloy under bias; magnetostriction hardly changes the volume."""
    s, d = hexagonal(44.0, -11.0, -16.5, 38.0, 240.0, 110.0, -5.3, 11.0, 28.0)  # 1/TPa, nm/A
    s, d = s * 1e-12, d * 1e-9
    stiffness, permeability = np.linalg.inv(s), 6.29e-6
    terfenol = library_material("terfenol-d")
    np.testing.assert_allclose(elastic_matrix(terfenol.elastic), stiffness, rtol=1e-5, atol=1e3)
    np.testing.assert_allclose(coupling_matrix(terfenol.piezomagnetic), d @ stiffness, rtol=1e-5, atol=1e-12)
    at_constant_strain = permeability * np.eye(3) - d @ stiffness @ d.T
    np.testing.assert_allclose(terfenol.permeability, at_constant_strain, rtol=1e-5)

    squared = (d[2, 2] ** 2 / (s[2, 2] * permeability), d[0, 4] ** 2 / (s[4, 4] * permeability))
    assert all(0.7**2 < value < 0.75**2 for value in squared)  # longitudinal and shear coupling
    modulus = 1 / s[2, 2]
    assert 25e9 < modulus < 35e9
    assert 50e9 < modulus / (1 - squared[0]) < 60e9  # at constant flux
    assert np.sqrt(modulus / 9250) == pytest.approx(1690, rel=0.01)  # m/s
    assert abs(d[2, :3].sum()) < 0.05 * d[2, 2]


def test_lithium_niobate_has_a_threefold_axis_and_a_mirror_plane():
    crystal = library_material("linbo3")
    scale = crystal.scaling.scale_stiffness
    third = crystal.rotated(rotation_about(np.array([0.0, 0, 1]), 2 * np.pi / 3))
    np.testing.assert_allclose(scale(third.stiffness), scale(crystal.stiffness), atol=1e-12)
    sixth = crystal.rotated(rotation_about(np.array([0.0, 0, 1]), np.pi / 3))
    assert np.abs(scale(sixth.stiffness) - scale(crystal.stiffness)).max() > 0.01
    mirror = np.diag([-1.0, 1, 1])
    mirrored = np.einsum("ia,jb,kc,abc->ijk", mirror, mirror, mirror, crystal.piezoelectric)
    np.testing.assert_array_equal(mirrored, crystal.piezoelectric)


def young_modulus(name, direction):
    """Return Young's modulus [Pa] of a material along a direction, from the compliance in rotated axes."""
    axis = np.array(direction) / np.linalg.norm(direction)
    normal = np.cross(axis, [1.0, 0, 0])
    length = np.linalg.norm(normal)
    material = library_material(name)
    if length > 0:
        material = material.rotated(rotation_about(normal / length, np.arctan2(length, axis[0])))
    return 1.0 / np.linalg.inv(elastic_matrix(material.elastic))[0, 0]


def test_moduli_of_cubic_crystals():
    assert young_modulus("silicon", [1, 0, 0]) == pytest.approx(130e9, rel=0.01)
    assert young_modulus("silicon", [1, 1, 0]) == pytest.approx(169e9, rel=0.01)
    diamond = library_material("diamond").elastic
    assert (diamond[0, 0, 0, 0] + 2 * diamond[0, 0, 1, 1]) / 3 == pytest.approx(444e9, rel=0.01)  # bulk modulus
    for direction in ([1, 0, 0], [1, 1, 0], [1, 1, 1]):
        assert young_modulus("tungsten", direction) == pytest.approx(411e9, rel=0.01)


def test_moduli_of_standards():
    assert young_modulus("steel", [1, 2, 3]) == pytest.approx(210e9)
    assert library_material("aluminium").elastic[0, 1, 0, 1] == pytest.approx(27e9, rel=0.01)  # shear modulus, EN 1999
    assert library_material("glass", permittivity=6e-11).permittivity[2, 2] == 6e-11


def test_every_entry_states_its_symmetry_and_confidence():
    for entry in library():
        assert entry.symmetry
        assert entry.note
        assert entry.confidence in {"good", "fair", "low", "nominal", "printed"} or entry.name == "isotropic"
