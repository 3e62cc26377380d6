"""Dataset and files of the study of a rough surface."""

import csv
import io
import json
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from meeframe.common.errors import ResultError
from meeframe.common.hdf5 import open_hdf5
from meeframe.common.json_values import plain
from meeframe.common.memoize import memoize_by_identity
from meeframe.indenters.topography import (
    HeightMap,
    bearing_curve,
    profile_spectrum,
    radial_spectrum,
    scale_dependent_slope,
)
from meeframe.results.figures import write_figure
from meeframe.results.hdf5 import sink
from meeframe.results.output import in_all_formats, replacing
from meeframe.results.sweep_files import check_installed
from meeframe.study.rough.figures import contact_figure, rough_table, surface_figure
from meeframe.study.rough.quantities import QUANTITIES
from meeframe.study.rough.run import RoughResult

FORMAT: Final = "meeframe-rough 1"
DATASET_FILE: Final = "rough.h5"
TABLE_FILE: Final = "rough.csv"
STATISTICS_FILE: Final = "surface.json"
CONTACT_PICTURE: Final = "rough"
SURFACE_PICTURE: Final = "surface"
FILES: Final = (
    DATASET_FILE,
    TABLE_FILE,
    STATISTICS_FILE,
    *in_all_formats(CONTACT_PICTURE),
    *in_all_formats(SURFACE_PICTURE),
)


def dataset(result: RoughResult) -> Any:
    """Return the result as an xarray.Dataset.

    Parameters
    ----------
    result : RoughResult
        The result.

    Returns
    -------
    xarray.Dataset
        Quantities over the mean pressure, the surface and its spectra; units and names are attributes, as are the
        statistics of the surface.

    Raises
    ------
    CaseError
        Without xarray.
    """
    check_installed()
    import xarray

    surface, title, planned = result.study.surface, result.study.table.title, len(result.study.pressures)
    variables: dict[str, Any] = {
        name: (["pressure"], values, {"units": QUANTITIES[name].unit, "long_name": QUANTITIES[name].label})
        for name, values in result.values.items()
    }
    for name in ("status", "message"):
        variables[name] = ["pressure"], np.array(getattr(result, name), object)
    variables["height"] = ["y", "x"], surface.heights.T, _named("m", "height, peaks up")
    if result.nodal_pressure.size:
        variables["nodal_pressure"] = ["y", "x"], result.nodal_pressure.T, _named("Pa", "pressure at the last load")
    coordinates = {
        "pressure": (["pressure"], result.pressures, _named("Pa", "mean pressure")),
        "x": (["x"], surface.x, _named("m", "x")),
        "y": (["y"], surface.y, _named("m", "y")),
    }
    keys = result.study.table.model_dump(exclude_defaults=True, exclude={"title", "pressures"})
    # a surface or law made in Python is recorded by its type
    declared = json.dumps(keys, default=lambda value: type(value).__name__)
    attributes = {"format": FORMAT, "title": title, "planned": planned, "study": declared, **facts(result)}
    return xarray.Dataset(variables, coordinates, attributes).merge(_curves(surface))


@memoize_by_identity
def _curves(surface: HeightMap) -> Any:
    """Return the spectra, the bearing curve and the slope by scale as an xarray.Dataset."""
    import xarray

    rings, (fractions, levels) = radial_spectrum(surface), bearing_curve(surface)
    distances, slopes = scale_dependent_slope(surface)
    variables: dict[str, Any] = {
        "spectrum": (["wave_number"], rings.density, _named("m^4", "power spectral density")),
        "bearing_height": (["bearing_fraction"], levels, _named("m", "height with this bearing ratio")),
        "scale_dependent_slope": (["distance"], slopes, _named("1", "root mean square slope")),
    }
    coordinates: dict[str, Any] = {
        "wave_number": (["wave_number"], rings.wave_number, _named("1/m", "wave number")),
        "bearing_fraction": (["bearing_fraction"], fractions, _named("1", "bearing ratio")),
        "distance": (["distance"], distances, _named("m", "distance")),
    }
    for axis, name in enumerate("xy"):
        q, density = profile_spectrum(surface, axis)
        variables[f"spectrum_{name}"] = (
            [f"wave_number_{name}"],
            density,
            _named("m^3", f"spectrum of profiles along {name}"),
        )
        coordinates[f"wave_number_{name}"] = [f"wave_number_{name}"], q, _named("1/m", f"wave number along {name}")
    return xarray.Dataset(variables, coordinates)


def _named(unit: str, label: str) -> dict[str, str]:
    return {"units": unit, "long_name": label}


def facts(result: RoughResult) -> dict[str, float | int]:
    """Return the statistics of the surface, and the constants that scale the results.

    Parameters
    ----------
    result : RoughResult
        The result.

    Returns
    -------
    dict of str to float or int
        Statistics by name, the root mean square slope of theories, the contact modulus [Pa], and whether the surface is
        periodic (0 or 1).
    """
    study = result.study
    return {
        **asdict(study.statistics),
        "theory_slope": study.slope,
        "contact_modulus": study.modulus,
        "is_periodic": int(study.surface.is_periodic),
    }


def stored_table(folder: Path) -> RenderableType:
    """Return the table of the study in a folder, as `rough_table`.

    Parameters
    ----------
    folder : Path
        Folder with the dataset of a study.

    Returns
    -------
    RenderableType
        The table, to be printed on a terminal.

    Raises
    ------
    ResultError
        If the dataset cannot be read, or has another format.
    """
    path = folder / DATASET_FILE
    try:
        with open_hdf5(path) as file:
            version = file.attrs.get("format")
            if version != FORMAT:
                raise ResultError(f"{path}: format {version!r} is unknown; this version reads {FORMAT!r}")
            values = {name: np.asarray(file[name], float) for name in QUANTITIES if name in file}
            status, message = ([str(text) for text in file[name].asstr()[:]] for name in ("status", "message"))
            planned = int(np.max(file.attrs.get("planned", len(status))))
            table = rough_table(str(file.attrs["title"]), np.asarray(file["pressure"], float), values, status, message)
            unfinished = f"{len(status)} of {planned} pressures are finished"
            return Group(table, Text(unfinished)) if len(status) < planned else table
    except OSError as error:
        raise ResultError(f"{path} cannot be read: {error.strerror or error}") from None
    except (AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
        raise ResultError(f"{path} is damaged: {error}") from None


def csv_text(result: RoughResult) -> str:
    """Return the quantities as a table of comma-separated values, with units in the first line."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = [f"{name} [{QUANTITIES[name].unit}]" for name in result.values]
    writer.writerow(["pressure [Pa]", *columns, "status"])
    for number, pressure in enumerate(result.pressures):
        numbers = (f"{values[number]:.10g}" for values in result.values.values())
        writer.writerow([f"{pressure:.10g}", *numbers, result.status[number]])
    return text.getvalue()


def write_rough(folder: Path, result: RoughResult, suffix: str = "png") -> None:
    """Write the dataset, the table, the statistics and the pictures into a folder.

    Parameters
    ----------
    folder : Path
        Existing folder, whose files of an earlier study are replaced.
    result : RoughResult
        The result, with at least one pressure.
    suffix : str, optional
        Format of the pictures.

    Raises
    ------
    ResultError
        If a file cannot be written.
    CaseError
        Without xarray.
    """
    write_tables(folder, result)
    for name, figure in ((SURFACE_PICTURE, surface_figure(result)), (CONTACT_PICTURE, contact_figure(result))):
        write_figure(figure, folder, name, suffix)


def write_tables(folder: Path, result: RoughResult) -> None:
    """Write the dataset, the table and the statistics as `write_rough`, without the pictures.

    Parameters
    ----------
    folder : Path
        Existing folder.
    result : RoughResult
        The result, with at least one pressure.
    """
    backends, h5netcdf = import_module("xarray.backends"), import_module("h5netcdf")
    with replacing(folder / DATASET_FILE) as path, sink(path, "w") as stream, h5netcdf.File(stream, "w") as file:
        dataset(result).dump_to_store(backends.H5NetCDFStore(file))
    statistics = json.dumps(plain(facts(result)), indent=1)
    for name, text in ((TABLE_FILE, csv_text(result)), (STATISTICS_FILE, f"{statistics}\n")):
        with replacing(folder / name) as path:
            path.write_text(text, encoding="utf-8")
