"""Rough contact over a series of mean pressures, in Python."""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from meeframe.api.progress import Show, shown
from meeframe.common.arguments import python_numbers
from meeframe.indenters.base import Indenter
from meeframe.indenters.topography import HeightMap
from meeframe.laws.base import ContactLaw
from meeframe.plugin import registry
from meeframe.study.rough.declare import declare
from meeframe.study.rough.files import dataset
from meeframe.study.rough.study import load_study
from meeframe.study.rough.study import rough as solve_and_write


def rough(
    surface: str | Path | HeightMap | Indenter | Mapping[str, Any],
    material: str | Mapping[str, Any] | None = None,
    pressures: float | str | Sequence[float | str] | Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    *,
    overwrite: bool = False,
    progress: Show = None,
    **keys: Any,
) -> Any:
    """Press a rough rigid surface on a half space, and return area, gap, stiffness and more over the mean pressure.

    Parameters
    ----------
    surface : str, Path, HeightMap, Indenter or mapping
        A study file (.toml), a file of heights, a height map with its peaks up, an indenter that has one, or its table
        as in a case file.
    material : str or mapping, optional
        Name of a material of the library, or table as in a case file; a study file may name it.
    pressures : float, str, sequence or mapping, optional
        Mean pressures that increase, [Pa] or texts with units, a single one, or a range {"from": ..., "to": ...,
        "count": ...}, whose keys have defaults; by default eight from 0.01 to 0.3 times the contact modulus times the
        root mean square slope, and less than the contact law bears.
    out : str or Path, optional
        Folder for rough.h5, rough.csv, surface.json and pictures; by default nothing is written.
    overwrite : bool, optional
        True to replace files of an earlier study in the folder.
    progress : bool or callable, optional
        As for `Case.solve`.
    **keys
        Further keys of a study file (docs/howto/rough.md), such as `periodic`, `samples`, `electric_potential`,
        `electrical_conductivity`, `contact_conductance`, which may also be a conductivity law, or `contact`, which may
        also be a contact law.

    Returns
    -------
    xarray.Dataset
        Quantities over the mean pressure, the surface, its spectra and statistics; units are attributes.

    Raises
    ------
    Interrupted
        After Ctrl-C, with the pressures that are finished, which are also in the folder.
    MeeframeError
        If a key or value is not allowed, or the folder cannot be written.

    Warns
    -----
    UserWarning
        If the surface is hardly plausible: for steep slopes, or a jump at the border of a period.
    """
    if isinstance(material, str):
        material = {"name": material}
    if isinstance(keys.get("contact"), ContactLaw):
        keys["contact"] = {"law": keys["contact"]}
    options = {"material": material, "pressures": pressures, **keys}
    options = {key: python_numbers(value, arrays=True) for key, value in options.items() if value is not None}
    if isinstance(surface, str | Path):
        study = load_study(Path(surface), options)
    else:
        study = declare({"surface": python_numbers(surface), **options}, registry.load())
    for text in study.warnings:
        warnings.warn(text, stacklevel=2)
    with shown(progress) as report:
        return dataset(solve_and_write(study, None if out is None else Path(out), overwrite, report))
