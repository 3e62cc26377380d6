"""Result file in self-describing HDF5; each increment of a run is written once, when it is finished.

Layout (docs/reference/results.md): attributes of the root describe the origin of the file; /zone is the contact zone;
/boundary the points and cells of the whole boundary; /steps/0001, /steps/0002, ... hold one increment each. Every
dataset has `units`.

During a run each increment is a file of its own in the folder `result.increments`, to which result.h5 has external
links: no byte of a finished increment is written again, so that a run that is killed at any moment leaves readable
files, and the cost of an increment does not depend on their number. At the end of the run they are moved into
result.h5.
"""

import json
import shutil
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, TypeVar, cast, final

import h5py
import numpy as np

from meeframe.common.errors import ResultError
from meeframe.common.hdf5 import MAX_DEFLATE, open_hdf5
from meeframe.common.renamed import RENAMED
from meeframe.contact.problem import Status
from meeframe.fields import MEE, Array, FieldSet, Indices, ScalarField
from meeframe.indenters.base import N_RIGID, IndenterMotions, motion_modes
from meeframe.mesh.regular import Cells, GridCells, GridPoints, shared_frames, shares_frame
from meeframe.results import schema
from meeframe.results.hdf5 import changed_file, is_compressible, numbers_of, table_of, text_of
from meeframe.results.output import INCREMENTS, RESULT_FILE, make_folder, replacing
from meeframe.results.records import (
    Loading,
    Provenance,
    Region,
    Result,
    RollingMotion,
    RunStatus,
    SecondSurface,
    StepResult,
    Zone,
    ZoneFields,
)
from meeframe.results.schema import BOUNDARY, NodalField, StorageCondition
from meeframe.system.reduced import NodalFields

FORMAT: Final = "meeframe-result 8"
_READABLE: Final = frozenset({FORMAT, "meeframe-result 7", "meeframe-result 6"})
"""Formats that are read: up to 7, grids hold their points, and in 6 their cells and half spaces their fields twice."""
_EARLIER: Final = frozenset(f"meeframe-result {number}" for number in range(1, 6))
"""Formats of earlier versions with other names."""

_MIN_COMPRESSED_BYTES: Final = 4096
"""Size in bytes below which arrays are not compressed."""
_MAX_TRIED_BYTES: Final = 1 << 20
"""Size in bytes above which arrays that hardly shrink are not compressed, which takes longer than all else."""
_GRID: Final = "grid"
"""Dataset with the numbers of nodes along both axes of a grid, in place of its cells."""
_AXES: Final = ("x", "y")
"""Datasets with the coordinates of the rows and columns of a grid, in place of its points."""
_CHUNK: Final = 1 << 22
"""Largest size of a chunk in bytes."""
_ZONE: Final = "zone"
"""Attribute `boundary` of increments whose fields on the whole boundary are those of the contact zone."""
_BOUNDARY_FILE: Final = "boundary.h5"
SomeResult = TypeVar("SomeResult", bound=Result)
_ZERO_IF_ABSENT: Final = ("wear",)
"""Fields that files of this format by earlier versions lack, and which are zero there."""
_SURFACE: Final = ("displacement", "potentials")
"""Attributes of StepResult that the surface of a second body has, too."""


@final
@dataclass(eq=False)
class ResultWriter:
    """Writer of the result of one run into its folder, increment by increment.

    Parameters
    ----------
    folder : Path
        Output folder.
    result : Result
        Data of the run before its first increment.
    fields : collection of str or None
        Optional nodal fields to store (`meeframe.results.schema.optional_fields`); None: all.
    """

    folder: Path
    result: Result
    fields: Collection[str] | None = None
    count: int = field(default=0, init=False)
    _has_boundary: bool = field(default=False, init=False)

    def append(self, step: StepResult) -> None:
        """Write one more increment, completely or not at all.

        Parameters
        ----------
        step : StepResult
            The increment.

        Raises
        ------
        ResultError
            If it cannot be written.
        """
        increments = self.folder / INCREMENTS
        make_folder(increments)
        if isinstance(step.boundary, NodalFields) and not self._has_boundary and _includes_boundary(self.fields):
            with replacing(increments / _BOUNDARY_FILE) as path, changed_file(path, "w") as file:
                _put_boundary_mesh(file, step.boundary)
            self._has_boundary = True
        with replacing(self._path(self.count + 1)) as path, changed_file(path, "w") as file:
            _put_step(file, self.result.zone, step, self.fields)
        if self.count == 0:
            self._write_links()
        self.count += 1

    def finish(self, ended: Callable[[], SomeResult]) -> SomeResult:
        """Move the increments into result.h5.

        Parameters
        ----------
        ended : callable
            Function that returns the result with its timings; called when everything else is written.

        Returns
        -------
        Result
            The result of `ended`.

        Raises
        ------
        ResultError
            If the file cannot be written; increments then stay where they are.
        """
        with replacing(self.folder / RESULT_FILE) as path, changed_file(path, "w") as file:
            _put_head(file, self.result)
            if self.count:  # as compressed before
                with h5py.File(self.folder / RESULT_FILE, "r") as earlier:
                    earlier.copy(earlier["zone"], file, "zone")
            else:
                _put_zone(file, self.result.zone)
            if self._has_boundary:
                with h5py.File(self.folder / INCREMENTS / _BOUNDARY_FILE, "r") as source:
                    source.copy(source["/"], file, "boundary")
            steps = file.create_group("steps")
            for number in range(1, self.count + 1):
                with h5py.File(self._path(number), "r") as source:
                    source.copy(source["/"], steps, _name(number))
            result = ended()
            _put_end(file, result)
        shutil.rmtree(self.folder / INCREMENTS, ignore_errors=True)
        return result

    def _write_links(self) -> None:
        with replacing(self.folder / RESULT_FILE) as path, changed_file(path, "w") as file:
            _put_head(file, self.result)
            _put_zone(file, self.result.zone)
            file.attrs["status"] = str(RunStatus.UNFINISHED)
            file["boundary"] = h5py.ExternalLink(f"{INCREMENTS}/{_BOUNDARY_FILE}", "/")
            steps = file.create_group("steps")
            for number in range(1, self.result.planned_steps + 1):
                steps[_name(number)] = h5py.ExternalLink(f"{INCREMENTS}/{self._path(number).name}", "/")

    def _path(self, number: int) -> Path:
        return self.folder / INCREMENTS / f"{_name(number)}.h5"


def write_result(folder: Path, result: Result, fields: Collection[str] | None = None) -> None:
    """Write a complete result file.

    Parameters
    ----------
    folder : Path
        Output folder.
    result : Result
        The result.
    fields : collection of str, optional
        Optional nodal fields to store, as in `ResultWriter`; all by default.

    Raises
    ------
    ResultError
        If it cannot be written.
    """
    with replacing(folder / RESULT_FILE) as path, changed_file(path, "w") as file:
        _put_head(file, result)
        _put_zone(file, result.zone)
        boundary = next((step.boundary for step in result.steps if isinstance(step.boundary, NodalFields)), None)
        if boundary is not None and _includes_boundary(fields):
            _put_boundary_mesh(file.create_group("boundary"), boundary)
        steps = file.create_group("steps")
        for number, step in enumerate(result.steps, 1):
            _put_step(steps.create_group(_name(number)), result.zone, step, fields)
        _put_end(file, result)


def _name(number: int) -> str:
    return f"{number:04d}"


def read_result(folder: str | Path) -> Result:
    """Return the result in an output folder, of a run that is finished, in progress or stopped.

    Parameters
    ----------
    folder : str or Path
        The output folder of a run.

    Returns
    -------
    Result
        The increments that are finished.

    Raises
    ------
    ResultError
        If the folder contains no result, or if the file is damaged or of another format.
    """
    folder = Path(folder)
    with _reading(folder), open_hdf5(folder / RESULT_FILE, _is_increment, MAX_DEFLATE) as file:
        version = file.attrs.get("format")
        if version not in _READABLE:
            again = ": run the case again, which is in its attribute 'case'" if "case" in file.attrs else ""
            names = ", ".join(f"{old} is now called {new}" for old, new in RENAMED.items())
            renamed = f"; {names}" if version in _EARLIER else ""
            raise ResultError(
                f"{folder / RESULT_FILE}: format {version!r} is unknown; this version reads {FORMAT!r}{again}{renamed}"
            )
        return _read(file)


def stored_steps(folder: Path, zone: Zone) -> Iterator[StepResult]:
    """Yield the increments of a run of this process from its folder, in order.

    Parameters
    ----------
    folder : Path
        Output folder of the run.
    zone : Zone
        Contact zone of the run.

    Yields
    ------
    StepResult
        The next increment.

    Raises
    ------
    ResultError
        If the file cannot be read.
    """
    with _reading(folder), h5py.File(folder / RESULT_FILE, "r") as file:
        yield from _get_steps(file, zone)


@contextmanager
def _reading(folder: Path) -> Iterator[None]:
    """Report what prevents the reading of a result in a folder as a ResultError."""
    path = folder / RESULT_FILE
    try:
        if folder.is_file():
            raise ResultError(f"no result in {folder}: it is a file; name the folder of a run")
        yield
    except PermissionError:
        raise ResultError(f"no result in {folder}: {path} cannot be read: Permission denied") from None
    except OSError:
        state = "cannot be read as HDF5" if path.exists() else "does not exist"
        raise ResultError(f"no result in {folder}: {path} {state}") from None
    except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
        # changed on the disk
        raise ResultError(f"{path} is damaged: {error}") from None


def _is_increment(name: str, target: str) -> bool:
    """Return whether a link of a result file is one to the file of an increment or of the boundary of an open run."""
    number = name.removeprefix("steps/")
    file_name = _BOUNDARY_FILE if name == "boundary" else f"{number}.h5"
    return (name == "boundary" or number.isdecimal()) and target == f"{INCREMENTS}/{file_name}"


def _put_head(file: Any, result: Result) -> None:
    """Write the data known before the first increment."""
    file.attrs["format"] = FORMAT
    file.attrs["title"] = result.provenance.title
    file.attrs["case"] = result.provenance.case_text
    file.attrs["versions"] = json.dumps(dict(result.provenance.versions))
    file.attrs["threads"] = result.provenance.threads
    file.attrs["planned_steps"] = result.planned_steps


def _put_zone(file: Any, zone: Zone) -> None:
    group = file.create_group("zone")
    group.attrs["note"] = "frames: rows e1, e2, nu (outward normal); sum(weights * density) is a resultant"
    arrays = {name: getattr(zone, name) for name in schema.ZONE_UNITS}
    if shares_frame(zone.frames):
        arrays["frames"] = zone.frames[:1]
    if isinstance(zone.points, GridPoints) and not len(zone.points.others):
        points_group, arrays["points"] = group.create_group("points"), None
        points_group.attrs["note"] = "points of a grid in the plane x3 = 0, numbered row by row: y varies first"
        _put_all(points_group, dict.fromkeys(_AXES, "m"), {axis: getattr(zone.points, axis) for axis in _AXES})
    _put_all(group, schema.ZONE_UNITS, arrays)
    _put_cells(group, zone.cells)


def _put_end(file: Any, result: Result) -> None:
    """Write the data known after the last increment."""
    file.attrs["status"] = str(result.status)
    file.attrs["timings"] = json.dumps(dict(result.timings))
    file.attrs["peak_memory_mb"] = result.peak_memory_mb


def _put_step(group: Any, zone: Zone, step: StepResult, fields: Collection[str] | None) -> None:
    group.attrs.update(
        {
            "status": str(step.status),
            "message": step.message,
            "contact_at_zone_boundary": step.contact_at_zone_boundary,
        }
    )
    group.attrs["note"] = (
        "traction, displacement, slip: along e1, e2, nu of the zone's frames; fluxes: outward; "
        "zero: names of fields that are zero at all nodes; "
        "region: " + ", ".join(f"{region.value} {region.name.lower()}" for region in Region)
    )
    motions = IndenterMotions(step.fields)
    group.attrs["scalar_fields"] = json.dumps([asdict(scalar) for scalar in step.fields.scalars])
    rolls = step.loading.rolling is not None  # slips then do not follow from the motion of the indenter
    chosen = [field for field in schema.nodal_fields(step.fields) if _is_stored(field, fields, rolls)]
    _put_fields(group, chosen, {field.name: field.values(zone, step) for field in chosen})
    _put_all(group, schema.INCREMENT_UNITS, {name: getattr(step, name) for name in schema.INCREMENT_UNITS})
    loading = group.create_group("loading")
    units = {name: motions.units[name] for name in motions.motions} | schema.LOADING_UNITS
    travel = step.loading.travel if step.loading.travel.any() else None
    _put_all(loading, units, {name: getattr(step.loading, name) for name in units} | {"travel": travel})
    rolling, prescribed = step.loading.rolling, step.loading.prescribed
    if rolling is not None:
        values = {name: getattr(rolling, name) for name in schema.ROLLING_UNITS}
        _put_all(loading.create_group("rolling"), schema.ROLLING_UNITS, values)
    _put_all(loading.create_group("prescribed"), {key: motions.units[key] for key in prescribed}, prescribed)
    units = {total.name: total.unit for total in schema.total_rows(step.fields)}
    _put_all(group.create_group("resultants"), units, schema.totals(zone, step))
    if step.second_body is not None:
        surface_fields = _surface_fields(step.fields)
        values = {field.name: _column(getattr(step.second_body, field.attribute), field) for field in surface_fields}
        _put_fields(group.create_group("second_body"), surface_fields, values)
    if isinstance(step.boundary, ZoneFields) and _includes_boundary(fields):
        group.attrs["boundary"] = _ZONE
    elif step.boundary is not None and _includes_boundary(fields):
        units = {"values": ", ".join(step.fields.value_units), "fluxes": ", ".join(step.fields.flux_units)}
        values = {"values": step.boundary.values, "fluxes": step.boundary.fluxes}
        _put_all(group.create_group("boundary"), units, values)


def _includes_boundary(fields: Collection[str] | None) -> bool:
    """Return whether fields, all with None, include those on the boundary."""
    return fields is None or BOUNDARY in fields


def _is_stored(field: NodalField, fields: Collection[str] | None, rolls: bool) -> bool:
    if field.stored is StorageCondition.ALWAYS or (rolls and field.stored is StorageCondition.WITH_FRICTION):
        return True
    # without a selection everything that a step holds, except derived quantities
    return bool(field.attribute) if fields is None else field.name in fields


def _surface_fields(fields: FieldSet) -> list[NodalField]:
    return [field for field in schema.nodal_fields(fields) if field.attribute in _SURFACE]


def _column(array: Array, field: NodalField) -> Array:
    return array if field.column is None else array[:, field.column]


def _put_fields(group: Any, fields: Sequence[NodalField], values: Mapping[str, Any]) -> None:
    """Write nodal fields; only the names of those that are zero at all nodes."""
    zero = [field.name for field in fields if not values[field.name].any()]
    group.attrs["zero"] = " ".join(zero)
    _put_all(group, {field.name: field.unit for field in fields if field.name not in zero}, values)


def _put_all(group: Any, units: Mapping[str, str], values: Mapping[str, Any]) -> None:
    """Write arrays and numbers with their units, but for those that are None."""
    for name, unit in units.items():
        if values[name] is not None:
            _put(group, name, values[name]).attrs["units"] = unit


def _put(group: Any, name: str, values: Any) -> Any:
    """Write an array, compressed if that halves it; one chunk for the whole array compresses best."""
    array = cast(Array, values) if isinstance(values, GridPoints) else np.asarray(values)
    if array.nbytes < _MIN_COMPRESSED_BYTES:
        return group.create_dataset(name, data=array)
    options: dict[str, Any] = {}
    rows = min(len(array), max(1, _CHUNK * len(array) // array.nbytes))
    if array.nbytes <= _MAX_TRIED_BYTES or is_compressible(array):
        options = {"chunks": (rows, *array.shape[1:]), "shuffle": True, "compression": "gzip", "compression_opts": 1}
    dataset = group.create_dataset(name, array.shape, array.dtype, **options)
    for first in range(0, len(array), rows):  # HDF5 copies what it converts
        dataset[first : first + rows] = array[first : first + rows]
    return dataset


def _put_cells(group: Any, cells: Cells) -> None:
    cells_group = group.create_group("cells")
    if isinstance(cells, GridCells):
        cells_group.attrs["note"] = "quadrilaterals between the nodes of a grid, which are numbered row by row"
        _put_all(cells_group, {_GRID: "1"}, {_GRID: np.array(cells.shape)})
        return
    cells_group.attrs["note"] = "numbers into points; meshio cell types"
    for number, (cell_type, connectivity) in enumerate(cells):
        _put(cells_group, str(number), connectivity).attrs.update({"type": cell_type, "units": "1"})


def _put_boundary_mesh(group: Any, boundary: NodalFields) -> None:
    _put_all(group, {"points": "m"}, {"points": boundary.points})
    _put_cells(group, boundary.cells)


def _read(file: Any) -> Result:
    attributes, zone_group = file.attrs, file["zone"]
    points = _get_points(zone_group)
    n = len(points)
    if len(zone_group["frames"]) == 1 != n:
        frames = shared_frames(numbers_of(zone_group, "frames", (1, 3, 3))[0], n)
    else:
        frames = numbers_of(zone_group, "frames", (n, 3, 3))
    zone = Zone(points, frames, numbers_of(zone_group, "weights", (n,)), _get_cells(zone_group, n))
    return Result(
        provenance=Provenance(
            title=text_of(file, "title"),
            case_text=text_of(file, "case"),
            versions=table_of(file, "versions", str),
            threads=int(attributes["threads"]),
        ),
        zone=zone,
        planned_steps=int(attributes["planned_steps"]),
        steps=tuple(_get_steps(file, zone)),
        timings=table_of(file, "timings", int | float) if "timings" in attributes else {},
        peak_memory_mb=float(attributes.get("peak_memory_mb", 0.0)),
    )


def _get_steps(file: Any, zone: Zone) -> Iterator[StepResult]:
    """Yield the finished increments, with slips that the file does not hold."""
    steps = file["steps"]
    start = np.zeros((len(zone.points), 2)), np.zeros(len(zone.points))
    for name in sorted(steps, key=int):
        link = steps.get(name, getlink=True)
        if isinstance(link, h5py.ExternalLink) and not (Path(file.filename).parent / link.filename).exists():
            return  # the run was stopped before
        step = _get_step(file, steps[name], zone, *start)
        if step.status is Status.CONVERGED:
            start = step.total_slip, step.slip_path
        yield step


def _get_step(file: Any, group: Any, zone: Zone, total_slip: Array, slip_path: Array) -> StepResult:
    """Return an increment; total_slip (n, 2) and slip_path (n,) [m] are those of the last converged one before."""
    n = len(zone.points)
    boundary: NodalFields | ZoneFields | None = None
    second_body, field_set = None, _get_field_set(group)
    surface_fields = _surface_fields(field_set)
    if "second_body" in group:
        second_body = SecondSurface(**_get_fields(group["second_body"], surface_fields, n))
    if "boundary" in group:
        values_group, shared = group["boundary"], file["boundary"]
        p = len(shared["points"])
        fields = (numbers_of(values_group, name, (p, field_set.size)) for name in ("values", "fluxes"))
        boundary = NodalFields(numbers_of(shared, "points", (p, 3)), _get_cells(shared, p), *fields)
    held = [field for field in schema.nodal_fields(field_set) if field.attribute]
    zero = text_of(group, "zero").split()
    missing = {
        field.name
        for field in held
        if field.stored is not StorageCondition.ALWAYS and field.name not in (*group, *zero)
    }
    loading = _get_loading(group["loading"], field_set)
    arrays = _get_fields(group, [field for field in held if field.name not in missing], n)
    if missing:
        surface = arrays["displacement"] if second_body is None else arrays["displacement"] - second_body.displacement
        touching = arrays["region"] != Region.OPEN
        derived = _slips(zone, loading, surface, touching, total_slip, slip_path)
        arrays |= {name: derived[name] for name in missing}
    if group.attrs.get("boundary") == _ZONE:
        scalars = arrays["potentials"], arrays["fluxes"]
        boundary = ZoneFields(zone, arrays["displacement"], scalars[0], arrays["traction"], scalars[1])
    return StepResult(
        loading=loading,
        step=int(group["step"][()]),
        increment=int(group["increment"][()]),
        **arrays,
        status=Status(group.attrs["status"]),
        iterations=int(group["iterations"][()]),
        residual=float(group["residual"][()]),
        history=numbers_of(group, "history", (len(group["history"]), 2)),
        message=text_of(group, "message"),
        boundary=boundary,
        second_body=second_body,
        area_fraction=numbers_of(group, "area_fraction", (n,)) if "area_fraction" in group else None,
        contact_at_zone_boundary=bool(group.attrs["contact_at_zone_boundary"]),
        fields=field_set,
    )


def _get_field_set(group: Any) -> FieldSet:
    """Return the field set of an increment, the default one for files of earlier versions, which do not name it."""
    if "scalar_fields" not in group.attrs:
        return MEE
    fields = FieldSet(tuple(ScalarField(**entry) for entry in json.loads(text_of(group, "scalar_fields"))))
    if fields.scalars[: len(MEE.scalars)] != MEE.scalars:
        raise ValueError(f"attribute 'scalar_fields' of {group.name} lacks the electric or the magnetic field")
    return fields


def _slips(
    zone: Zone, loading: Loading, displacement: Array, touching: Any, total_slip: Array, slip_path: Array
) -> dict[str, Array]:
    """Return the slips, from the motion of the indenter and the displacement (n, 3) of the surface under it.

    The total slip is their difference along e1 and e2; the others follow from the last converged increment before.
    """
    modes = motion_modes(zone.points, zone.frames, loading.axes, loading.reference)[:N_RIGID]
    total: Array = np.einsum("k,knt->nt", loading.motion[:N_RIGID], modes[:, :, :2]) - displacement[:, :2]
    slip = total - total_slip
    path = slip_path + np.where(touching, np.linalg.norm(slip, axis=1), 0.0)
    return {"slip": slip, "total_slip": total, "slip_path": path}


def _get_fields(group: Any, fields: Sequence[NodalField], n: int) -> dict[str, Any]:
    """Return the attributes of records that nodal fields are read from, by name."""
    zero = [*text_of(group, "zero").split(), *(name for name in _ZERO_IF_ABSENT if name not in group)]
    arrays: dict[str, Any] = {}
    columns = 1 + max((field.column for field in fields if field.column is not None), default=-1)
    for nodal_field in fields:
        kinds = "iu" if nodal_field.integer else "biuf"
        if nodal_field.name in zero:
            values = np.zeros((n, *nodal_field.shape), np.int64 if nodal_field.integer else float)
        else:
            values = numbers_of(group, nodal_field.name, (n, *nodal_field.shape), kinds)
        if nodal_field.column is None:
            arrays[nodal_field.attribute] = values
        else:
            arrays.setdefault(nodal_field.attribute, np.empty((n, columns)))[:, nodal_field.column] = values
    return arrays


def _get_loading(group: Any, fields: FieldSet) -> Loading:
    motions = IndenterMotions(fields)
    motion = np.concatenate([np.atleast_1d(group[name][()]) for name in motions.motions])
    if motion.shape != (motions.size,) or motion.dtype.kind not in "biuf":
        raise ValueError(f"{group.name} has {len(motion)} motions of {motion.dtype} instead of {motions.size} numbers")
    shapes = {key: (columns.stop - columns.start,) for key, columns in motions.columns.items()}
    prescribed = {key: numbers_of(group["prescribed"], key, shapes[key]) for key in group["prescribed"]}
    duration = float(group["duration"][()]) if "duration" in group else None
    reference, axes = numbers_of(group, "reference", (3,)), numbers_of(group, "axes", (3, 3))
    rolling = None
    if "rolling" in group:
        entries = group["rolling"]
        names = ("spin", "cell", "distance", *(["cycles"] if "cycles" in entries else []))  # not in earlier versions
        numbers = (float(entries[name][()]) for name in names)
        rolling = RollingMotion(numbers_of(entries, "direction", (3,)), numbers_of(entries, "creepage", (2,)), *numbers)
    travel = numbers_of(group, "travel", (2,)) if "travel" in group else None
    return Loading.of(motion, prescribed, reference, axes, duration, fields, rolling, travel)


def _get_points(group: Any) -> Array:
    """Return the points (n, 3) of a group."""
    entry = group["points"]
    if isinstance(entry, h5py.Group):
        return GridPoints.make(*(numbers_of(entry, axis, entry[axis].shape[:1]) for axis in _AXES))
    points: Array = numbers_of(group, "points", (len(entry), 3))
    return points


def _get_cells(group: Any, n: int) -> Cells:
    """Return the cells of a group, whose numbers refer to n points."""
    if _GRID in group["cells"]:
        nx, ny = numbers_of(group["cells"], _GRID, (2,), "iu").tolist()
        if min(nx, ny) < 2 or nx * ny != n:
            raise ValueError(f"{group.name}/cells is a grid of {nx} x {ny} nodes instead of {n}")
        return GridCells((nx, ny))
    cells = []
    for name in sorted(group["cells"], key=int):
        dataset = group["cells"][name]
        connectivity: Indices = numbers_of(group["cells"], name, dataset.shape, "iu")
        if connectivity.ndim != 2 or ((connectivity < 0) | (connectivity >= n)).any():
            raise ValueError(f"{dataset.name} are not numbers into {n} points")
        cells.append((text_of(dataset, "type"), connectivity))
    return tuple(cells)
