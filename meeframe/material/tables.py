"""Materials as TOML tables, in case files, in material files and in the library."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from meeframe.common.arguments import near_miss
from meeframe.common.errors import CaseError, MaterialError
from meeframe.common.toml import read_toml, toml_text
from meeframe.fields import Array
from meeframe.fields.units import Quantity
from meeframe.material.checks import material_phrase
from meeframe.material.components import UNITS, material_components, material_from_components, parse_component
from meeframe.material.material import Material
from meeframe.material.rotation import rotation_about, rotation_from_euler
from meeframe.material.thermal import CONSTRAINT

_INLINE_KEYS = {"name", "source", "symmetry", "components", "rotation", CONSTRAINT}


def inline_material(table: Mapping[str, Any]) -> Material:
    """Make a material from a table of components.

    Parameters
    ----------
    table : mapping
        The keys are `components` (a table of named components, texts with units such as '226 GPa' or SI numbers) and,
        optionally, `name`, `source`, `symmetry`, `pyro_constraint` (see `material_from_components`) and `rotation`
        (see `rotation_from_table`).

    Raises
    ------
    MaterialError
        If the table is not valid; the message names key, value and what is allowed.
    """
    check_keys(table, _INLINE_KEYS, "material")
    name = _text(table, "name", "")
    components = table.get("components")
    if not isinstance(components, Mapping) or not components:
        raise MaterialError(
            f"{material_phrase(name)}: components is {components!r}, must be a table such as {{c_1111 = '226 GPa'}}"
        )
    values = {
        key: quantity(f"{material_phrase(name)}: components.{key}", value, UNITS[parse_component(key)[0]])
        for key, value in components.items()
    }
    constraint = _text(table, CONSTRAINT, "") if CONSTRAINT in table else None
    texts = _text(table, "symmetry", "triclinic"), _text(table, "source", "")
    material = material_from_components(name, values, *texts, constraint)
    return rotate_by_table(material, table)


def material_table(material: Material) -> dict[str, Any]:
    """Return the table of a material, with numbers in SI units.

    `inline_material` makes the same material from the table, to the last digit.

    Parameters
    ----------
    material : Material
        The material.

    Returns
    -------
    dict
        Table with `name`, `source`, `symmetry`, `components` and, with thermal moduli, `pyro_constraint`.
    """
    head = {"name": material.name, "source": material.source, "symmetry": "triclinic"}
    if material.thermal_moduli is not None:
        head[CONSTRAINT] = "strain"
    return {**head, "components": material_components(material)}


def read_material(path: Path) -> Material:
    """Read a material from a TOML file that holds the table of `inline_material`.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Material
        The material.

    Raises
    ------
    MaterialError
        If the file cannot be read or its table is not valid; the message names the file.
    """
    try:
        _, table = read_toml(path)
    except CaseError as error:
        raise MaterialError(f"material file {error}") from None
    try:
        return inline_material(table)
    except MaterialError as error:
        raise MaterialError(f"material file {path}: {error}") from None


def write_material(material: Material, path: Path) -> None:
    """Write a material to a new TOML file.

    Parameters
    ----------
    material : Material
        The material.
    path : Path
        The file, which must not exist.

    Raises
    ------
    MaterialError
        If the file exists or cannot be written.
    """
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(toml_text(material_table(material)))
    except OSError as error:
        raise MaterialError(f"material file {path}: {error.strerror or error}") from None


def rotate_by_table(material: Material, table: Mapping[str, Any]) -> Material:
    """Return the material rotated by the entry `rotation` of a table, if there is one."""
    if "rotation" not in table:
        return material
    return material.rotated(rotation_from_table(table["rotation"]))


def rotation_from_table(table: Any) -> Array:
    """Return the rotation matrix (3, 3) of a table.

    Parameters
    ----------
    table : mapping
        One of {axis, angle}, {euler, sequence} and {matrix}. Angles are texts such as '30 deg' or radians.

    Raises
    ------
    MaterialError
        If the table is none of these.
    """
    forms = {"axis": {"axis", "angle"}, "euler": {"euler", "sequence"}, "matrix": {"matrix"}}
    if not isinstance(table, Mapping) or len(matches := forms.keys() & table.keys()) != 1:
        raise MaterialError(f"rotation is {table!r}, must be {{axis, angle}}, {{euler, sequence}} or {{matrix}}")
    form = matches.pop()
    check_keys(table, forms[form], "rotation")
    if form == "axis":
        angle = quantity("rotation.angle", table.get("angle"), "rad")
        return rotation_about(_numbers("rotation.axis", table["axis"], (3,)), angle)
    if form == "euler":
        angles = table["euler"] if isinstance(table["euler"], list | tuple) else [table["euler"]]
        values = np.array([quantity("rotation.euler", angle, "rad") for angle in angles])
        return rotation_from_euler(values, _text(table, "sequence", "ZXZ"))
    return _numbers("rotation.matrix", table["matrix"], (3, 3))


def quantity(key: str, value: Any, unit: str) -> float:
    """Convert a text such as '226 GPa', or a number in SI units, to a number in SI units.

    Parameters
    ----------
    key : str
        Key of the value, for messages.
    value : str or float
        The quantity.
    unit : str
        SI unit of the quantity.

    Raises
    ------
    MaterialError
        If the value is not such a quantity; the message names the key.
    """
    try:
        return float(Quantity(unit).convert(value))
    except ValueError as error:
        raise MaterialError(f"{key} = {value!r}: {error}") from None


def check_keys(table: Mapping[str, Any], allowed: set[str], name: str) -> None:
    """Check that a table has no unknown keys.

    Parameters
    ----------
    table : mapping
        The table.
    allowed : set of str
        Allowed keys.
    name : str
        Name of the table, for messages.

    Raises
    ------
    MaterialError
        For an unknown key; the message lists the allowed ones.
    """
    unknown = sorted(table.keys() - allowed)
    if unknown:
        names = sorted(allowed)
        hint = near_miss(str(unknown[0]), names)
        raise MaterialError(f"unknown key {unknown[0]!r} in {name}; {hint}allowed: {', '.join(names)}")


def _text(table: Mapping[str, Any], key: str, default: str) -> str:
    value = table.get(key, default)
    if not isinstance(value, str):
        raise MaterialError(f"{key} is {value!r}, must be a text")
    return value


def _numbers(key: str, value: Any, shape: tuple[int, ...]) -> Array:
    try:
        numbers = np.array(value, dtype=float)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != shape:
        raise MaterialError(f"{key} is {value!r}, must be numbers of shape {shape}")
    return numbers
