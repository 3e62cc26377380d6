"""Test library materials, tables and files."""

import importlib.resources
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from meeframe.common.errors import MaterialError
from meeframe.material import (
    VACUUM_PERMEABILITY,
    Material,
    library,
    library_material,
    material_from_table,
    material_table,
    orthotropic_mee,
    read_material,
    rotation_about,
    write_material,
)

INLINE = """
name = "mine"
symmetry = "isotropic"
components = { c_1111 = "3 GPa", c_1122 = 1e9, eps_11 = "0.1 nF/m", mu_11 = "1.3 uH/m" }
"""


def test_every_entry_is_valid_and_cited() -> None:
    for entry in library():
        options = {"young_modulus": 1e9, "poisson_ratio": 0.3} if entry.required else {}
        material = library_material(entry.name, **options)
        assert material.name == entry.name
        assert entry.summary
        assert entry.source
    assert {"batio3-cofe2o4", "orthotropic-mee", "isotropic", "batio3", "cofe2o4", "pzt-4", "pvdf"} <= {
        entry.name for entry in library()
    }


def test_every_data_file_is_listed() -> None:
    folder = importlib.resources.files("meeframe.material") / "data"
    stems = {Path(file.name).stem for file in folder.iterdir() if file.name.endswith(".toml")}
    assert stems == {entry.name for entry in library()} - {"isotropic"}


def test_table_1_is_as_printed() -> None:
    material = library_material("batio3-cofe2o4")
    expected = {(0, 0, 0, 0): 226e9, (0, 0, 1, 1): 125e9, (0, 0, 2, 2): 124.25e9, (2, 2, 2, 2): 216e9}
    for index, value in expected.items():
        assert material.elastic[index] == value
    assert material.elastic[1, 2, 1, 2] == 44.15e9
    assert [material.piezoelectric[i] for i in ((0, 0, 2), (2, 2, 2), (2, 0, 0))] == [5.8, 9.3, -2.2]
    assert [material.piezomagnetic[i] for i in ((0, 0, 2), (2, 2, 2), (2, 0, 0))] == [275.0, 350.0, 290.15]
    np.testing.assert_allclose(np.diag(material.permittivity), [5.64e-9, 5.64e-9, 6.35e-9])
    np.testing.assert_allclose(np.diag(material.permeability), [297.5e-6, 297.5e-6, 83.5e-6])


def test_pvdf_rounds_to_table_3() -> None:
    # the mechanical and electric constants of Table 3 are rounded constants of PVDF
    film, table_3 = library_material("pvdf"), library_material("orthotropic-mee")
    np.testing.assert_array_equal(film.elastic, table_3.elastic)
    np.testing.assert_allclose(film.piezoelectric, table_3.piezoelectric, atol=0.5e-3)
    np.testing.assert_allclose(film.permittivity, table_3.permittivity, atol=0.5e-12)


def test_piezoelectric_library_constants() -> None:
    ceramic = library_material("pzt-4")
    assert ceramic.elastic[2, 2, 2, 2] == 115e9
    assert ceramic.elastic[0, 1, 0, 1] == pytest.approx(30.6e9)
    assert ceramic.piezoelectric[0, 0, 2] == 12.7
    np.testing.assert_array_equal(ceramic.permeability, VACUUM_PERMEABILITY * np.eye(3))


def test_magnetoelectric_scale() -> None:
    assert orthotropic_mee(1e-12).magnetoelectric[1, 1] == pytest.approx(0.8e-12)
    orthotropic_mee(2.68e-8)
    for scale in (2.69e-8, 1.0):
        with pytest.raises(MaterialError, match=r"'orthotropic-mee'.*block.*eigenvalue.*lambda_22"):
            orthotropic_mee(scale)
    material = material_from_table({"name": "orthotropic-mee", "magnetoelectric_scale": "5 ns/m"})
    assert material.magnetoelectric[0, 0] == pytest.approx(3e-9)


def test_inline_table() -> None:
    material = material_from_table(tomllib.loads(INLINE))
    assert material.name == "mine"
    assert material.elastic[0, 1, 0, 1] == pytest.approx(1e9)
    assert material.permittivity[2, 2] == pytest.approx(1e-10)
    assert material.permeability[2, 2] == pytest.approx(1.3e-6)


def test_isotropic_options() -> None:
    material = material_from_table({"name": "isotropic", "young_modulus": "210 GPa", "poisson_ratio": 0.3})
    np.testing.assert_allclose(material.elastic, Material.isotropic(210e9, 0.3).elastic)


@pytest.mark.parametrize(
    "rotation",
    [
        {"axis": [0, 1, 0], "angle": "90 deg"},
        {"euler": [0, "90 deg", 0], "sequence": "XYZ"},
        {"matrix": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]},
    ],
)
def test_rotation_entry(rotation: dict[str, object]) -> None:
    rotated = material_from_table({"name": "batio3", "rotation": rotation})
    expected = library_material("batio3").rotated(rotation_about(np.array([0.0, 1, 0]), np.pi / 2))
    scale = rotated.scaling.scale_stiffness
    np.testing.assert_allclose(scale(rotated.stiffness), scale(expected.stiffness), atol=1e-14)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, "name.*components or file"),
        ({"name": "rhubarb"}, "'rhubarb'; the library has .*batio3.*isotropic"),
        (
            {"name": "isotropic", "poisson": 0.3},
            r"'poisson' in .*; did you mean 'poisson_ratio'\? allowed",
        ),
        ({"name": "BaTiO3"}, r"'BaTiO3'; did you mean 'batio3'\? the library has"),
        ({"name": "batio-3"}, r"'batio-3'; did you mean 'batio3'\? the library has"),
        ({"name": 3}, "unknown material 3"),
        ({"components": {"c_11": 1e9}, "file": "x.toml"}, "one of"),
        ({"name": "batio3", "scale": 2}, "'scale' in material 'batio3'; allowed: name, rotation"),
        ({"name": "isotropic", "young_modulus": 1e9}, "needs poisson_ratio"),
        ({"name": "isotropic", "young_modulus": "1 m", "poisson_ratio": 0}, "young_modulus = '1 m'.*Pa"),
        ({"components": {"c_1111": "1 C/m^2"}}, r"components\.c_1111 = '1 C/m\^2'.*Pa"),
        ({"components": {"c_1111": True}}, r"c_1111 = True"),
        ({"components": {"c_1111": float("nan")}}, r"c_1111 = nan"),
        ({"components": {"c_1111": float("inf")}}, r"c_1111 is inf"),
        ({"components": []}, r"components is \[\]"),
        ({"components": {"c_11": 1e9}, "colour": "red"}, "'colour' in material; allowed: components"),
        ({"components": {"c_11": 1e9}, "symmetry": 6}, "symmetry is 6"),
        ({"name": "batio3", "rotation": 30}, "rotation is 30"),
        ({"name": "batio3", "rotation": {"axis": [0, 0], "angle": 1}}, r"rotation\.axis is \[0, 0\]"),
        ({"name": "batio3", "rotation": {"axis": [0, 0, 1]}}, r"rotation\.angle = None"),
        (
            {"name": "batio3", "rotation": {"axis": [0, 0, 1], "angel": 1}},
            r"'angel' in rotation; did you mean 'angle'\? allowed: angle",
        ),
        ({"file": "absent.toml"}, "absent.toml: cannot be read: No such file"),
    ],
)
def test_invalid_tables(table: dict[str, object], message: str) -> None:
    with pytest.raises(MaterialError, match=message):
        material_from_table(table)


def test_tables_round_trip_exactly() -> None:
    tilted = library_material("orthotropic-mee").rotated(rotation_about(np.array([1.0, 2, 3]), 0.7))
    for material in (tilted, library_material("batio3-cofe2o4")):
        again = material_from_table(material_table(material))
        np.testing.assert_array_equal(again.stiffness, material.stiffness)
        assert (again.name, again.source) == (material.name, material.source)


def test_files_round_trip_and_are_not_overwritten(tmp_path: Path) -> None:
    material = library_material("cofe2o4")
    path = tmp_path / "m.toml"
    write_material(material, path)
    np.testing.assert_array_equal(read_material(path).stiffness, material.stiffness)
    np.testing.assert_array_equal(material_from_table({"file": "m.toml"}, tmp_path).stiffness, material.stiffness)
    before = path.read_bytes()
    with pytest.raises(MaterialError, match=r"m\.toml: File exists"):
        write_material(library_material("batio3"), path)
    assert path.read_bytes() == before


@pytest.mark.parametrize("text", ["components = [", "components = {c_1 = 2}", "x = 1"])
def test_invalid_files_are_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(MaterialError, match=r"material file .*bad\.toml: "):
        read_material(path)


def test_names_with_any_characters(tmp_path: Path) -> None:
    """A byte order mark, as written by some Windows editors, is not part of the text."""
    material = replace(library_material("cofe2o4"), name='"µ\\\x7f\n"')
    write_material(material, tmp_path / "m.toml")
    (tmp_path / "marked.toml").write_bytes(b"\xef\xbb\xbf" + (tmp_path / "m.toml").read_bytes())
    assert read_material(tmp_path / "m.toml").name == read_material(tmp_path / "marked.toml").name == material.name
