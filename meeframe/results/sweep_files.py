"""Files of a sweep: sweep.h5, which xarray opens, and sweep.json, which identifies the folder's points."""

import json
import re
import shutil
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np

from meeframe.common.errors import CaseError, ResultError
from meeframe.common.files import read_json
from meeframe.fields import Array, Indices
from meeframe.results import schema
from meeframe.results.hdf5 import sink
from meeframe.results.output import LOCK_FILE, check_output, locked, replacing
from meeframe.results.sweep_records import INCREMENT, SweepResult
from meeframe.results.tables import absent_names, absent_scalars

FORMAT: Final = "meeframe-sweep 1"
SWEEP_FILE: Final = "sweep.h5"
LIST_FILE: Final = "sweep.json"
POINTS: Final = "points"
SYSTEMS: Final = "systems"
NODE: Final = "node"
_KEY: Final = re.compile(r"[0-9a-f]{64}", re.ASCII)
"""Pattern of the key of a point, which is also the name of its folder."""
_LEFTOVER: Final = re.compile(rf"\.(sweep\.\d+\.(h5|json)|{_KEY.pattern}\.\d+\.h5)", re.ASCII)
"""Pattern of the name of a file that a sweep was writing when its process ended."""
_SAME_LINE: Final = 1e-9
"""Distance of nodes on one line of a grid, as a fraction of the extent of the grid."""


def write_sweep(folder: Path, sweep: SweepResult) -> None:
    """Write sweep.h5 completely; `xarray.open_dataset(path, engine="h5netcdf")` reads it.

    Its dimensions are the axes, and where these exist `increment`, and `y` and `x` for nodes on a grid or `node` for
    others; units are attributes. Raises ResultError if it cannot be written, CaseError without xarray.
    """
    check_installed()
    h5netcdf, backends = import_module("h5netcdf"), import_module("xarray.backends")
    with replacing(folder / SWEEP_FILE) as path, sink(path, "w") as stream, h5netcdf.File(stream, "w") as file:
        dataset(sweep).dump_to_store(backends.H5NetCDFStore(file))


def check_installed() -> None:
    """Raise CaseError unless the packages that write sweep.h5 are installed."""
    try:
        for module in ("xarray", "h5netcdf"):
            import_module(module)
    except ImportError as error:
        raise CaseError(f"sweep.h5 needs xarray ({error}); install the extra: pip install 'meeframe[sweep]'") from None


def dataset(sweep: SweepResult) -> Any:
    """Return the sweep as an xarray.Dataset; scalar fields that are zero in all points are left out."""
    import xarray

    names = [axis.name for axis in sweep.axes]
    variables: dict[str, Any] = {
        name: (names, getattr(sweep, name).astype(object)) for name in ("status", "message", "key")
    }
    hidden = _hidden(sweep)
    for name, values in sweep.quantities.items():
        if name in hidden:
            continue
        dimensions = names if values.ndim == len(names) else [*names, INCREMENT]
        variables[name] = dimensions, values, _attributes(sweep.units[name], schema.label_of(name, sweep.field_set))
    grid = _grid(sweep.nodes)
    for name, values in sweep.fields.items():
        label = schema.label_of(name.removeprefix("zone_"), sweep.field_set)
        attributes = _attributes(sweep.units[name], label)
        if grid is None:
            variables[name] = [*names, NODE], values, attributes
        else:
            variables[name] = [*names, "y", "x"], values[..., grid.order], attributes
    coordinates: dict[str, Any] = {}
    for axis in sweep.axes:
        values = np.array(axis.labels, object) if axis.values is None else axis.values
        units = {"units": axis.unit} if axis.unit else {}
        coordinates[axis.name] = [axis.name], values, {"long_name": axis.name, **units}
    for name, coordinate in sweep.nodes.items() if grid is None else grid.coordinates(sweep.nodes["z"]):
        if not isinstance(coordinate, tuple):
            coordinate = [NODE] if coordinate.ndim == 1 else [*names, NODE], coordinate
        coordinates[name] = *coordinate, {"units": "m", "long_name": name}
    return xarray.Dataset(variables, coordinates, {"format": FORMAT, "title": sweep.title, **sweep.notes})


def _hidden(sweep: SweepResult) -> set[str]:
    """Return the names of quantities that the dataset leaves out: of absent scalar fields that no plot shows."""
    fields, missing = sweep.field_set, np.full(sweep.shape, np.nan)
    values = {name: sweep.quantities.get(name, missing) for row in schema.all_totals(fields) for name in row.names}
    return absent_names(values, fields, absent_scalars(values, fields)) - {*sweep.plotted}


@dataclass(frozen=True, eq=False)
class _Grid:
    """Nodes at all crossings of lines x and y.

    x, y: coordinates of the lines, (nx,) and (ny,); order: (ny, nx) node at each crossing.
    """

    x: Array
    y: Array
    order: Indices

    def coordinates(self, z: Array) -> list[tuple[str, tuple[list[str], Any]]]:
        """Return the names of the coordinates with dimensions and values; z is one number for a plane."""
        height = z[self.order]
        plane = bool((height == height[0, 0]).all())
        return [
            ("x", (["x"], self.x)),
            ("y", (["y"], self.y)),
            ("z", ([], height[0, 0]) if plane else (["y", "x"], height)),
        ]


def _grid(nodes: Mapping[str, Array]) -> _Grid | None:
    """Return the grid of nodes, None if they are not on one or differ from point to point."""
    if not nodes or nodes["x"].ndim != 1:
        return None
    lines, numbers = [], []
    for name in "xy":
        size = np.ptp(nodes[name])
        if not size > 0.0:
            return None
        rounded = np.round(nodes[name] / (_SAME_LINE * size))
        _, first, inverse = np.unique(rounded, return_index=True, return_inverse=True)
        lines.append(nodes[name][first])
        numbers.append(inverse)
    (x, y), position = lines, numbers[1] * len(lines[0]) + numbers[0]
    if len(x) * len(y) != len(position) or len(np.unique(position)) != len(position):
        return None
    return _Grid(x, y, np.argsort(position).reshape(len(y), len(x)))


def _attributes(unit: str, label: str) -> dict[str, str]:
    """Return attributes as xarray's plots read them."""
    return {"units": unit, "long_name": label}


@contextmanager
def open_folder(folder: Path, keys: Collection[str], overwrite: bool) -> Iterator[None]:
    """Prepare the folder of a sweep for new or continued points, and lock it against other processes.

    keys: of its points. Existing points with these keys remain. With overwrite, points of another sweep are removed
    that are not in this one. Raises ResultError if it cannot be written, or while another process writes a sweep there;
    if sweep.json lists anything but keys of points, or if `points` or `systems` is a link; and unless overwrite is true
    if it holds anything else, or another sweep.
    """
    check_output(folder, overwrite or _held(folder) is not None or _begun(folder))
    with locked(folder):
        _make_ready(folder, set(keys), overwrite)
        yield


def _make_ready(folder: Path, wanted: set[str], overwrite: bool) -> None:
    held = _held(folder)
    for path in (folder / SYSTEMS, folder / POINTS):
        if path.is_symlink():  # files that sweeps remove would be those of another folder
            raise ResultError(f"{path} is a symbolic link; allowed: a folder that a sweep created")
    if held is not None and held != wanted and not overwrite:
        raise ResultError(
            f"folder {folder} holds another sweep, {len(held & wanted)} of its {len(held)} points are in this one of "
            f"{len(wanted)}: study, case or the versions of what computes them have changed; name another folder or "
            "pass --overwrite, which keeps the points that are in both"
        )
    try:
        (folder / SYSTEMS).mkdir(exist_ok=True)
        (folder / POINTS).mkdir(exist_ok=True)
        for leftover in (*folder.glob(".*"), *folder.glob(f"{SYSTEMS}/.*")):
            if _LEFTOVER.fullmatch(leftover.name):
                leftover.unlink(missing_ok=True)  # by a worker that is just ending
        for leftover in folder.glob(f"{POINTS}/.*"):
            if _KEY.fullmatch(leftover.name[1:]):
                shutil.rmtree(leftover)
        for key in (held or set()) - wanted:
            shutil.rmtree(folder / POINTS / key, ignore_errors=True)
        if held is not None and held != wanted:
            (folder / SWEEP_FILE).unlink(missing_ok=True)
    except OSError as error:
        raise _unwritable(folder, error) from None
    with replacing(folder / LIST_FILE) as path:
        path.write_text(json.dumps({"format": FORMAT, "points": sorted(wanted)}, indent=1) + "\n", encoding="utf-8")


def _unwritable(folder: Path, error: OSError) -> ResultError:
    return ResultError(f"folder {folder} cannot be written: {error.strerror or error}")


def drop_systems(folder: Path, keys: Collection[str]) -> None:
    """Remove the reduced systems of a sweep's folder that have none of these keys."""
    for path in (folder / SYSTEMS).glob("*.h5"):
        if _KEY.fullmatch(path.stem) and path.stem not in keys:
            with suppress(OSError):
                path.unlink()


def _begun(folder: Path) -> bool:
    """Return whether a folder holds only what a sweep creates before sweep.json, as after an early interruption."""
    try:
        return all(
            path.name == LOCK_FILE
            or path.match(f".{Path(LIST_FILE).stem}.*")
            or (path.name in (SYSTEMS, POINTS) and not any(path.iterdir()))
            for path in folder.iterdir()
        )
    except OSError:  # there is none, or it cannot be read
        return False


def _held(folder: Path) -> set[str] | None:
    """Return the keys of the points of the sweep that a folder holds; None if it holds none.

    Raises ResultError for a key that is not of the form that sweeps write: keys are names of folders that are removed.
    """
    try:
        table = read_json(folder / LIST_FILE)
        keys = list(table["points"]) if table["format"] == FORMAT else None
    except (OSError, ValueError, KeyError, TypeError):
        return None
    for key in keys or ():
        if not (isinstance(key, str) and _KEY.fullmatch(key)):
            raise ResultError(
                f"{folder / LIST_FILE}: points lists {key!r:.100}; allowed: keys of 64 hexadecimal digits, as a sweep "
                "writes them; remove the file if it is not of a sweep, or name another folder"
            )
    return None if keys is None else set(keys)
