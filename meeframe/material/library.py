"""The library of materials with sources, and the reader of the [material] table of a case file."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np

from meeframe.common.arguments import near_miss
from meeframe.common.errors import MaterialError
from meeframe.common.toml import toml_tables
from meeframe.fields import OPTIONAL_FIELDS, THERMAL_FIELD, Array, ScalarField
from meeframe.material.material import Material
from meeframe.material.tables import check_keys, inline_material, quantity, read_material, rotate_by_table
from meeframe.material.thermal import CONSTRAINT, HEAT_KEYS, heat_constants


@dataclass(frozen=True)
class LibraryEntry:
    """One material of the library.

    Attributes
    ----------
    name, summary, source : str
        Name in case files, one line of description, and the source of the constants.
    symmetry : str
        Symmetry class.
    confidence, note : str
        Level of `CONFIDENCE`, and the reason for it.
    make : callable
        Function that takes the options in SI units and returns the material.
    options : mapping of str to str
        Units of the options by name.
    required : tuple of str
        Names of the options that have no default.
    """

    name: str
    summary: str
    source: str
    make: Callable[..., Material] = field(repr=False)
    options: Mapping[str, str] = field(default_factory=dict)
    required: tuple[str, ...] = ()
    symmetry: str = "isotropic"
    confidence: str = ""
    note: str = ""


CONFIDENCE: Final[Mapping[str, str]] = {
    "good": "two independent forms or tables agree as the note says",
    "fair": "one table, or tables that disagree as the note says",
    "low": "constants that fit together, some of them without access to a print, as the note says",
    "nominal": "rounded values of a standard",
    "printed": "as printed in the reference paper",
    "estimate": "thermal constants some of which are estimated, as the note says",
}
"""Levels of confidence in the constants of the library."""


def orthotropic_mee(magnetoelectric_scale: float = 1e-8) -> Material:
    """Return the orthotropic material of the paper's Table 3.

    Parameters
    ----------
    magnetoelectric_scale : float
        Factor [s/m] on the printed lambda_11, lambda_22, lambda_33 = 0.60, 0.80, 0.10.

    Returns
    -------
    Material
        The material.

    Raises
    ------
    MaterialError
        If the factor is 2.69e-8 s/m or more: the block [[eps, lambda], [lambda, mu]] is then not positive definite.

    Notes
    -----
    The printed unit would make the material inadmissible: a power of ten is missing. A factor of 1e-8 s/m agrees best
    with the results of the paper (docs/explanation/theory.md, Half space).
    """
    printed = np.diag([0.60, 0.80, 0.10])
    return replace(_from_data("orthotropic-mee"), magnetoelectric=magnetoelectric_scale * printed)


def library() -> tuple[LibraryEntry, ...]:
    """Return all entries of the library."""
    return (*(_data_entry(name) for name in _DATA), _ISOTROPIC)


def library_material(name: str, *, thermal: bool = False, **options: float) -> Material:
    """Return a material of the library.

    Parameters
    ----------
    name : str
        Name of the entry.
    thermal : bool, optional
        Whether the material has a temperature, with the thermal constants of the library.
    **options : float
        Options of the entry in SI units.

    Returns
    -------
    Material
        The material.

    Raises
    ------
    MaterialError
        For an unknown name or option; the message lists those that exist. For a material without thermal constants in
        the library.
    """
    entry = library_entry(name)
    check_keys(options, set(entry.options), f"material {name!r}")
    missing = [option for option in entry.required if option not in options]
    if missing:
        raise MaterialError(f"material {name!r} needs {', '.join(missing)}")
    return with_library_heat(entry.make(**options), name) if thermal else entry.make(**options)


def with_library_heat(material: Material, name: str) -> Material:
    """Return a material with the thermal constants of the entry of a name; raise MaterialError if it has none."""
    table = library_heat(name)
    if table is None:
        known = ", ".join(entry for entry in _DATA if library_heat(entry))
        raise MaterialError(
            f"material {name!r} has no thermal constants in the library; allowed: {known}, or thermal_conductivity and "
            "other constants of your choice"
        )
    return material.with_heat(**{key: table[key] for key in (THERMAL_FIELD.coefficient, *HEAT_KEYS) if key in table})


def library_heat(name: str) -> Mapping[str, Any] | None:
    """Return the thermal constants of an entry in SI units, with source, confidence and note; None if it has none."""
    return _data(name).get("thermal") if name in _DATA else None


def material_from_table(
    table: Mapping[str, Any], directory: Path = Path(), scalar_fields: tuple[ScalarField, ...] = OPTIONAL_FIELDS
) -> Material:
    """Return the material of a [material] table of a case file.

    Parameters
    ----------
    table : mapping
        One of the following, each with an optional rotation = {...}. Quantities are texts such as '226 GPa' or SI
        numbers.

        - {name = "...", options}: a material of the library; thermal = true adds its thermal constants;
        - {components = {...}, symmetry, name, source}: see `meeframe.material.tables.inline_material`;
        - {file = "..."}: a material file.
    directory : Path
        Directory to which the path of a material file is relative.
    scalar_fields : tuple of ScalarField
        Further scalar fields whose coefficients the table may contain, as one number, three on the diagonal, or three
        rows of three.

    Returns
    -------
    Material
        The material.

    Raises
    ------
    MaterialError
        If the table is not valid; the message names key, value and what is allowed.
    """
    coefficients = {field: table[field.coefficient] for field in scalar_fields if field.coefficient in table}
    if coefficients:
        return rotate_by_table(_with_fields(table, coefficients, directory), table)
    _check_heat_keys(table)
    forms = table.keys() & {"components", "file"} or table.keys() & {"name"}
    if len(forms) != 1:
        raise MaterialError("a material needs exactly one of the keys name (from the library), components or file")
    if "components" in table:
        return inline_material(table)
    if "file" in table:
        check_keys(table, {"file", "rotation"}, "material")
        return rotate_by_table(read_material(directory / str(table["file"])), table)
    entry = library_entry(table["name"])
    check_keys(table, {"name", "rotation", "thermal", *entry.options}, f"material {entry.name!r}")
    thermal = table.get("thermal", False)
    if not isinstance(thermal, bool):
        raise MaterialError(f"material {entry.name!r}: thermal is {thermal!r}; allowed: true or false")
    options = {
        key: quantity(f"material {entry.name!r}: {key}", table[key], unit)
        for key, unit in entry.options.items()
        if key in table
    }
    return rotate_by_table(library_material(entry.name, thermal=thermal, **options), table)


def _with_fields(table: Mapping[str, Any], coefficients: Mapping[ScalarField, Any], directory: Path) -> Material:
    """Return the material of a table with further scalar fields, not rotated."""
    further = {"rotation", *(field.coefficient for field in coefficients)}
    constants: dict[str, Any] = {}
    if THERMAL_FIELD in coefficients:
        constants = heat_constants(table)
        further |= constants.keys()
    else:
        _check_heat_keys(table)
    material = material_from_table({key: value for key, value in table.items() if key not in further}, directory, ())
    for scalar, value in coefficients.items():
        coefficient = _coefficient(scalar, value)
        if scalar == THERMAL_FIELD:
            material = material.with_heat(coefficient, **constants)
        else:
            material = material.with_field(scalar, coefficient)
    return material


def _check_heat_keys(table: Mapping[str, Any]) -> None:
    """Raise MaterialError if the temperature acts on other fields but has no conductivity of its own."""
    present = [key for key in HEAT_KEYS if key in table and not (key == CONSTRAINT and "components" in table)]
    if present:
        raise MaterialError(f"{present[0]} without {THERMAL_FIELD.coefficient}; allowed: both, or neither")


def _coefficient(field: ScalarField, value: Any) -> Array | float:
    """Return the coefficient of a scalar field in SI units, from one number, three on the diagonal, or three rows."""
    if not isinstance(value, list | tuple):
        return quantity(field.coefficient, value, field.coefficient_unit)
    if len(value) == 3 and not any(isinstance(entry, list | tuple) for entry in value):
        return np.diag([quantity(field.coefficient, entry, field.coefficient_unit) for entry in value])
    if len(value) != 3 or any(not isinstance(row, list | tuple) or len(row) != 3 for row in value):
        raise MaterialError(
            f"{field.coefficient} is {value!r}, must be one number, three on the diagonal, or three rows of three"
        )
    return np.array([[quantity(field.coefficient, entry, field.coefficient_unit) for entry in row] for row in value])


def library_entry(name: Any) -> LibraryEntry:
    """Return an entry of the library by name.

    Raises
    ------
    MaterialError
        For an unknown name; the message lists those that exist.
    """
    entries = _entries()
    if not isinstance(name, str) or name not in entries:
        hint = near_miss(str(name).lower(), entries)
        raise MaterialError(f"unknown material {name!r}; {hint}the library has {', '.join(entries)}")
    return entries[name]


@lru_cache(maxsize=1)
def _entries() -> Mapping[str, LibraryEntry]:
    return {entry.name: entry for entry in library()}


@lru_cache(maxsize=64)
def _data(name: str) -> dict[str, Any]:
    text = (files("meeframe.material") / "data" / f"{name}.toml").read_text(encoding="utf-8")
    return toml_tables(text)


@lru_cache(maxsize=64)
def _from_data(name: str) -> Material:
    return inline_material({key: value for key, value in _data(name).items() if key not in (*_DESCRIPTION, "thermal")})


def _data_entry(name: str) -> LibraryEntry:
    data = _data(name)
    make: Callable[..., Material] = partial(_from_data, name)
    options: dict[str, str] = {}
    if name == "orthotropic-mee":
        make, options = orthotropic_mee, {"magnetoelectric_scale": "s/m"}
    elif "young_modulus" in data:
        constants = {key: data[key] for key in ("young_modulus", "poisson_ratio", "name", "source")}
        make, options = partial(Material.isotropic, **constants), _ELECTROMAGNETIC
    # no symmetry class of components is trigonal: the file lists all components of the crystal
    symmetry = "trigonal" if name == "linbo3" else data.get("symmetry", "isotropic")
    texts = {key: data[key] for key in ("name", *_DESCRIPTION, "source")}
    return LibraryEntry(**texts, make=make, options=options, symmetry=symmetry)


_DESCRIPTION: Final = ("summary", "confidence", "note")
_ELECTROMAGNETIC: Final = {"permittivity": "F/m", "permeability": "N*s^2/C^2"}
_DATA: Final = (
    "aln",
    "aluminium",
    "batio3",
    "batio3-cofe2o4",
    "cofe2o4",
    "diamond",
    "glass",
    "linbo3",
    "orthotropic-mee",
    "pvdf",
    "pzt-4",
    "pzt-5a",
    "pzt-5h",
    "silicon",
    "steel",
    "terfenol-d",
    "tungsten",
    "zno",
)
_ISOTROPIC = LibraryEntry(
    "isotropic",
    "isotropic elastic, no coupling; permittivity and permeability of vacuum by default",
    "Hooke's law",
    Material.isotropic,
    {"young_modulus": "Pa", "poisson_ratio": "", **_ELECTROMAGNETIC},
    ("young_modulus", "poisson_ratio"),
    note="constants of your choice",
)
