"""Command on rough surfaces."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from meeframe.cli import console
from meeframe.cli.app import PictureFormat, PluginFiles, Threads, app


@app.command()
def rough(
    surface: Annotated[
        Path, typer.Argument(metavar="SURFACE", help="A study file (.toml, docs/howto/rough.md) or a file of heights.")
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results; created if it does not exist.")],
    material: Annotated[
        str | None, typer.Option(metavar="NAME", help="Material of the half space: a name of the library.")
    ] = None,
    modulus: Annotated[
        str | None,
        typer.Option(metavar="PRESSURE", help="Contact modulus E/(1 - nu²) such as '120 GPa', instead of a material."),
    ] = None,
    pressure: Annotated[
        list[str] | None, typer.Option(metavar="PRESSURE", help="Mean pressure such as '5 MPa'; repeatable.")
    ] = None,
    first: Annotated[str | None, typer.Option("--from", metavar="PRESSURE", help="Smallest mean pressure.")] = None,
    last: Annotated[str | None, typer.Option("--to", metavar="PRESSURE", help="Largest mean pressure.")] = None,
    count: Annotated[int | None, typer.Option(metavar="N", help="Number of pressures between --from and --to.")] = None,
    periodic: Annotated[
        bool | None,
        typer.Option("--periodic/--free", help="Take the surface as one period of an infinite one, or as it is."),
    ] = None,
    samples: Annotated[
        int | None, typer.Option(metavar="N", help="Resample the surface to this number of nodes along x.")
    ] = None,
    spacing: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Spacing of the heights of a matrix, such as '0.5 um'.")
    ] = None,
    unit: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Unit of the heights in a file, such as '1 nm'.")
    ] = None,
    lateral_unit: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Unit of the coordinates in a file, such as '1 um'.")
    ] = None,
    dataset: Annotated[
        str | None, typer.Option(metavar="NAME", help="Dataset of an HDF5 file, or channel of an instrument.")
    ] = None,
    outliers: Annotated[
        float | None,
        typer.Option(
            metavar="NUMBER", help="Remove heights that differ from those around by more standard deviations than this."
        ),
    ] = None,
    levelled: Annotated[
        Literal["plane", "quadratic"] | None,
        typer.Option(metavar="TREND", help="Subtract the best-fit 'plane' or 'quadratic' surface from the heights."),
    ] = None,
    missing: Annotated[
        Literal["nearest", "harmonic"] | None,
        typer.Option(
            metavar="FILLING", help="Fill missing heights from the 'nearest' ones or by a 'harmonic' surface."
        ),
    ] = None,
    hardness: Annotated[
        str | None,
        typer.Option(metavar="PRESSURE", help="Hardness: the largest pressure, of perfectly plastic asperities."),
    ] = None,
    potential: Annotated[
        str | None, typer.Option(metavar="VOLTAGE", help="Potential of the surface; computes charge and capacitance.")
    ] = None,
    conductivity: Annotated[
        str | None,
        typer.Option(metavar="VALUE", help="Conductivity of the body such as '58 MS/m'; computes the conductance."),
    ] = None,
    contact_conductance: Annotated[
        str | None,
        typer.Option(metavar="VALUE", help="Conductance of the interface for currents such as '3e10 S/m^2'."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", metavar="", help="Replace earlier results in DIR.")] = False,
    format: PictureFormat = "png",
    threads: Threads = None,
    plugin: PluginFiles = None,
) -> None:
    """Press a rough surface against a half space with a series of mean pressures.

    Area, mean gap, stiffness, conductance, capacitance and charge at each pressure are written to rough.h5 and
    rough.csv, the statistics of the surface to surface.json; both are drawn in pictures. Options replace the keys of a
    study file. The exit status is 0 if every pressure converged, 1 if not, 2 for invalid input and 130 if interrupted.
    """
    with console.exit_status(console.NOT_CONVERGED, f"nothing was written to {out}"):
        from meeframe.common.errors import CaseError
        from meeframe.model.threads import limited
        from meeframe.study.rough.figures import rough_table
        from meeframe.study.rough.study import load_study
        from meeframe.study.rough.study import rough as run_study

        if material is not None and modulus is not None:
            raise CaseError(f"--material {material} and --modulus {modulus}: allowed: one of them")
        prepared = {
            "spacing": [spacing, spacing] if spacing else None,
            "unit": unit,
            "lateral_unit": lateral_unit,
            "dataset": dataset,
            "outliers": outliers,
            "levelled": levelled,
            "missing": missing,
        }
        options: dict[str, Any] = {
            "material": _material(material, modulus),
            "pressures": _pressures(pressure, first, last, count),
            "periodic": periodic,
            "samples": samples,
            "contact": {"law": {"name": "hardness", "hardness": _or_infinite(hardness)}} if hardness else None,
            "electric_potential": potential,
            "electrical_conductivity": conductivity,
            "contact_conductance": _or_infinite(contact_conductance) if contact_conductance else None,
            "surface": {key: value for key, value in prepared.items() if value is not None},
        }
        registry = console.registry(plugin)
        chosen = {key: value for key, value in options.items() if value not in (None, {})}
        with limited(threads), console.progress() as progress:
            progress("reading", 0.0)
            study = load_study(surface, chosen, registry)
            for warning in study.warnings:
                console.warn(warning)
            result = run_study(study, out, overwrite, progress, format)
        title = result.study.table.title
        console.stdout().print(rough_table(title, result.pressures, result.values, result.status, result.message))
        print(f"dataset: {out / 'rough.h5'}, pictures: {out / 'rough'}.{format}, {out / 'surface'}.{format}")
        raise typer.Exit(console.CONVERGED if result.is_converged else console.NOT_CONVERGED)


def _material(name: str | None, modulus: str | None) -> dict[str, Any] | None:
    """Return the [material] table of a name, or of an isotropic material with a contact modulus."""
    if modulus is None:
        return None if name is None else {"name": name}
    from meeframe.common.errors import CaseError
    from meeframe.fields.units import Quantity

    try:
        value = Quantity("Pa", gt=0, lt=float("inf")).check(modulus)
    except ValueError as error:
        raise CaseError(f"--modulus {modulus}: {error}") from None
    return {"name": "isotropic", "young_modulus": value, "poisson_ratio": 0.0}


def _or_infinite(text: str) -> str | float:
    """Return infinity for the text inf, which is written without a unit, and any other text as it is."""
    return float("inf") if text.strip() == "inf" else text


def _pressures(values: list[str] | None, first: str | None, last: str | None, count: int | None) -> Any:
    """Return the key `pressures` of the options; None without any."""
    limits = {"from": first, "to": last, "count": count}
    chosen = {key: value for key, value in limits.items() if value is not None}
    if values and chosen:
        from meeframe.common.errors import CaseError

        raise CaseError(f"--pressure and --{next(iter(chosen))}: allowed: one of them")
    return values or chosen or None
