"""The result file: self-describing HDF5, written step by step so that an interrupted run keeps its finished steps.

Layout (docs/results.md): attributes of the root say what made the file; /zone is the contact zone; /boundary the points
and cells of the whole boundary; /steps/0001, /steps/0002, ... hold one increment each. Every dataset has `units`.
"""

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from meeframe.common.errors import ResultError
from meeframe.contact.problem import Status
from meeframe.fields import MEE, Array, FieldSet, Indices, ScalarField
from meeframe.indenters.base import RIGID_RESULTANTS, IndenterMotions
from meeframe.results.hdf5 import changed_file, numbers_of, table_of, text_of
from meeframe.results.output import RESULT_FILE, replacing
from meeframe.results.records import Loading, Provenance, Region, Result, SecondSurface, StepResult, Zone, resultants
from meeframe.system.reduced import NodalFields

FORMAT: Final = "meeframe-result 4"

_ZONE_UNITS: Final = {"points": "m", "frames": "1", "weights": "m^2"}
_STEP_UNITS: Final = {
    "initial_gap": "m",
    "gap": "m",
    "traction": "Pa",
    "displacement": "m",
    "contact_fraction": "1",
    "slip": "m",
    "total_slip": "m",
    "slip_path": "m",
    "dissipation": "J/m^2",
    "region": "1",
    "step": "1",
    "increment": "1",
    "history": "1",
    "residual": "1",
    "iterations": "1",
}
_LOADING_UNITS: Final = {"reference": "m", "axes": "1"}
_RESULTANT_UNITS: Final = {
    "force": "N",
    **{name: IndenterMotions().units[name] for name in RIGID_RESULTANTS},
    "dissipated_energy": "J",
    "contact_area": "m^2",
    "stick_area": "m^2",
    "slip_area": "m^2",
    "max_pressure": "Pa",
    "max_tension": "Pa",
}


def resultant_units(fields: FieldSet) -> dict[str, str]:
    """Return the units of all resultants by name."""
    totals = {scalar.resultant: scalar.resultant_unit for scalar in fields.scalars}
    return _RESULTANT_UNITS | totals | {f"max_abs_{scalar.value_name}": scalar.value_unit for scalar in fields.scalars}


def create_result(folder: Path, result: Result) -> None:
    """Write the result file with the increments that are finished so far."""
    with replacing(folder / RESULT_FILE) as path, changed_file(path, "w") as file:
        file.attrs["format"] = FORMAT
        file.attrs["title"] = result.provenance.title
        file.attrs["case"] = result.provenance.case_text
        file.attrs["versions"] = json.dumps(dict(result.provenance.versions))
        file.attrs["threads"] = result.provenance.threads
        file.attrs["planned_steps"] = result.planned_steps
        file.attrs["status"] = str(result.status)
        zone = file.create_group("zone")
        zone.attrs["note"] = "frames: rows e1, e2, nu (outward normal); sum(weights * density) is a resultant"
        _put_all(zone, _ZONE_UNITS, {name: getattr(result.zone, name) for name in _ZONE_UNITS})
        _put_cells(zone, result.zone.cells)
        file.create_group("steps")
        for step in result.steps:
            _put_step(file, result.zone, step)


def append_step(folder: Path, zone: Zone, step: StepResult) -> None:
    """Add one increment to the result file."""
    with _changing(folder) as file:
        _put_step(file, zone, step)


def finish_result(folder: Path, result: Result) -> None:
    """Write what is known after the last step: status, timings [s], peak memory [MB]."""
    with _changing(folder) as file:
        file.attrs["status"] = str(result.status)
        file.attrs["timings"] = json.dumps(dict(result.timings))
        file.attrs["peak_memory_mb"] = result.peak_memory_mb


def read_result(folder: str | Path) -> Result:
    """The result in an output folder; raises ResultError if there is none or it cannot be read."""
    folder = Path(folder)
    path = folder / RESULT_FILE
    try:
        if folder.is_file():
            raise ResultError(f"no result in {folder}: it is a file; name the folder of a run")
        with h5py.File(path, "r") as file:
            found = file.attrs.get("format")
            if found != FORMAT:
                again = ": run the case again, which is in its attribute 'case'" if "case" in file.attrs else ""
                raise ResultError(f"{path}: format {found!r} is unknown; this version reads {FORMAT!r}{again}")
            return _read(file)
    except PermissionError:
        raise ResultError(f"no result in {folder}: {path} cannot be read: Permission denied") from None
    except OSError:
        state = "cannot be read as HDF5" if path.exists() else "does not exist"
        raise ResultError(f"no result in {folder}: {path} {state}") from None
    except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
        # changed on the disk
        raise ResultError(f"{path} is damaged: {error}") from None


@contextmanager
def _changing(folder: Path) -> Iterator[Any]:
    """The result file open for a change that takes place whole or not at all.

    HDF5 cannot undo a change that was cut short, so each one is made to a copy: steps squared in data copied, which
    only thousands of steps would notice.
    """
    target = folder / RESULT_FILE
    with replacing(target) as path:
        shutil.copyfile(target, path)
        with changed_file(path, "r+") as file:
            yield file


def _put_scalars(group: Any, fields: FieldSet, potentials: Array, fluxes: Array | None = None) -> None:
    """Write potentials (n, scalars) and fluxes (n, scalars) as datasets by the names of their fields."""
    for scalar, potential in zip(fields.scalars, potentials.T, strict=True):
        _put_all(group, {scalar.value_name: scalar.value_unit}, {scalar.value_name: potential})
    if fluxes is not None:
        for scalar, flux in zip(fields.scalars, fluxes.T, strict=True):
            _put_all(group, {scalar.flux_name: scalar.flux_unit}, {scalar.flux_name: flux})


def _put_step(file: Any, zone: Zone, step: StepResult) -> None:
    steps = file["steps"]
    group = steps.create_group(f"{len(steps) + 1:04d}")
    group.attrs.update({"status": str(step.status), "message": step.message, "reaches_edge": step.reaches_edge})
    group.attrs["note"] = (
        "traction, displacement, slip: along e1, e2, nu of the zone's frames; fluxes: outward; "
        + "region: "
        + ", ".join(f"{region.value} {region.name.lower()}" for region in Region)
    )
    fields, motions = step.fields, IndenterMotions(step.fields)
    group.attrs["scalar_fields"] = json.dumps([asdict(scalar) for scalar in fields.scalars])
    _put_all(group, _STEP_UNITS, {name: getattr(step, name) for name in _STEP_UNITS})
    _put_scalars(group, fields, step.potentials, step.fluxes)
    loading = group.create_group("loading")
    units = {name: motions.units[name] for name in motions.motions} | _LOADING_UNITS
    _put_all(loading, units, {name: getattr(step.loading, name) for name in units})
    if step.loading.duration is not None:
        _put_all(loading, {"duration": "s"}, {"duration": step.loading.duration})
    prescribed = step.loading.prescribed
    _put_all(loading.create_group("prescribed"), {key: motions.units[key] for key in prescribed}, prescribed)
    totals, units = resultants(zone, step), resultant_units(fields)
    _put_all(group.create_group("resultants"), units, {name: getattr(totals, name) for name in units})
    if step.area_fraction is not None:
        _put_all(group, {"area_fraction": "1"}, {"area_fraction": step.area_fraction})
    if step.second_body is not None:
        surface = group.create_group("second_body")
        _put_all(surface, {"displacement": "m"}, {"displacement": step.second_body.displacement})
        _put_scalars(surface, fields, step.second_body.potentials)
    if step.boundary is not None:
        _put_boundary(file, group, step.boundary, fields)


def _put_all(group: Any, units: Mapping[str, str], values: Mapping[str, Any]) -> None:
    for name, unit in units.items():
        group.create_dataset(name, data=values[name]).attrs["units"] = unit


def _put_cells(group: Any, cells: tuple[tuple[str, Indices], ...]) -> None:
    own = group.create_group("cells")
    own.attrs["note"] = "numbers into points; meshio cell types"
    for number, (cell_type, connectivity) in enumerate(cells):
        own.create_dataset(str(number), data=connectivity).attrs.update({"type": cell_type, "units": "1"})


def _put_boundary(file: Any, step: Any, boundary: NodalFields, fields: FieldSet) -> None:
    if "boundary" not in file:
        shared = file.create_group("boundary")
        _put_all(shared, {"points": "m"}, {"points": boundary.points})
        _put_cells(shared, boundary.cells)
    units = {"values": ", ".join(fields.value_units), "fluxes": ", ".join(fields.flux_units)}
    _put_all(step.create_group("boundary"), units, {"values": boundary.values, "fluxes": boundary.fluxes})


def _read(file: Any) -> Result:
    attributes, places = file.attrs, file["zone"]
    n = len(places["points"])
    shapes = {"points": (n, 3), "frames": (n, 3, 3), "weights": (n,)}
    zone = Zone(**{name: numbers_of(places, name, shapes[name]) for name in _ZONE_UNITS}, cells=_get_cells(places, n))
    return Result(
        provenance=Provenance(
            title=text_of(file, "title"),
            case_text=text_of(file, "case"),
            versions=table_of(file, "versions", str),
            threads=int(attributes["threads"]),
        ),
        zone=zone,
        planned_steps=int(attributes["planned_steps"]),
        steps=tuple(_get_step(file, file["steps"][name], n) for name in sorted(file["steps"])),
        timings=table_of(file, "timings", int | float) if "timings" in attributes else {},
        peak_memory_mb=float(attributes.get("peak_memory_mb", 0.0)),
    )


def _get_step(file: Any, group: Any, n: int) -> StepResult:
    boundary, second_body = None, None
    fields = _get_fields(group)
    names = [scalar.value_name for scalar in fields.scalars]
    if "second_body" in group:
        own = group["second_body"]
        second_body = SecondSurface(numbers_of(own, "displacement", (n, 3)), _get_scalars(own, names, n))
    if "boundary" in group:
        own, shared = group["boundary"], file["boundary"]
        p = len(shared["points"])
        both = (numbers_of(own, name, (p, fields.size)) for name in ("values", "fluxes"))
        boundary = NodalFields(numbers_of(shared, "points", (p, 3)), _get_cells(shared, p), *both)
    return StepResult(
        loading=_get_loading(group["loading"], fields),
        step=int(group["step"][()]),
        increment=int(group["increment"][()]),
        initial_gap=numbers_of(group, "initial_gap", (n,)),
        traction=numbers_of(group, "traction", (n, 3)),
        displacement=numbers_of(group, "displacement", (n, 3)),
        potentials=_get_scalars(group, names, n),
        fluxes=_get_scalars(group, [scalar.flux_name for scalar in fields.scalars], n),
        contact_fraction=numbers_of(group, "contact_fraction", (n,)),
        slip=numbers_of(group, "slip", (n, 2)),
        total_slip=numbers_of(group, "total_slip", (n, 2)),
        slip_path=numbers_of(group, "slip_path", (n,)),
        dissipation=numbers_of(group, "dissipation", (n,)),
        region=numbers_of(group, "region", (n,), "iu"),
        status=Status(group.attrs["status"]),
        iterations=int(group["iterations"][()]),
        residual=float(group["residual"][()]),
        history=numbers_of(group, "history", (len(group["history"]), 2)),
        message=text_of(group, "message"),
        boundary=boundary,
        second_body=second_body,
        area_fraction=numbers_of(group, "area_fraction", (n,)) if "area_fraction" in group else None,
        reaches_edge=bool(group.attrs["reaches_edge"]),
        fields=fields,
    )


def _get_fields(group: Any) -> FieldSet:
    """Return the field set of an increment; files of earlier versions, which do not say, have the default one."""
    if "scalar_fields" not in group.attrs:
        return MEE
    return FieldSet(tuple(ScalarField(**entry) for entry in json.loads(text_of(group, "scalar_fields"))))


def _get_scalars(group: Any, names: Sequence[str], n: int) -> Array:
    """Return datasets (n,) of these names as one array, (n, scalars)."""
    return np.stack([numbers_of(group, name, (n,)) for name in names], axis=1)


def _get_loading(group: Any, fields: FieldSet) -> Loading:
    motions = IndenterMotions(fields)
    motion = np.concatenate([np.atleast_1d(group[name][()]) for name in motions.motions])
    if motion.shape != (motions.size,):
        raise ValueError(f"{group.name} has {len(motion)} motions instead of {motions.size}")
    shapes = {key: (columns.stop - columns.start,) for key, columns in motions.columns.items()}
    prescribed = {key: numbers_of(group["prescribed"], key, shapes[key]) for key in group["prescribed"]}
    duration = float(group["duration"][()]) if "duration" in group else None
    reference, axes = numbers_of(group, "reference", (3,)), numbers_of(group, "axes", (3, 3))
    return Loading.of(motion, prescribed, reference, axes, duration, fields)


def _get_cells(group: Any, n: int) -> tuple[tuple[str, Indices], ...]:
    """Of n points."""
    cells = []
    for name in sorted(group["cells"], key=int):
        own = group["cells"][name]
        connectivity: Indices = numbers_of(group["cells"], name, own.shape, "iu")
        if connectivity.ndim != 2 or ((connectivity < 0) | (connectivity >= n)).any():
            raise ValueError(f"{own.name} are no numbers into {n} points")
        cells.append((text_of(own, "type"), connectivity))
    return tuple(cells)
