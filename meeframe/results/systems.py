"""Files of reduced systems: the results of reductions, stored so that they are computed once."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np

from meeframe.common.errors import ResultError
from meeframe.common.hdf5 import open_hdf5
from meeframe.fields import Array
from meeframe.mesh.regular import GridCells
from meeframe.results.hdf5 import changed_file
from meeframe.results.output import replacing
from meeframe.system.capabilities import AnyArray
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import NodalFields, ReducedSystem

Value = TypeVar("Value")

FORMAT: Final = "meeframe-system 1"
ARRAYS: Final = "meeframe-kept-system 1"
"""Format of systems without a matrix, stored as the arrays of `Persistence.to_arrays`."""

_GRID: Final = "grid"
"""Dataset with the numbers of nodes along both axes of a grid, in place of its cells."""
_UNITS: Final = {
    "points": "m",
    "frames": "1",
    "weights": "m^2",
    "offset": "m, m, m, V, A",
    "matrix": "displacement (m, m, m, -V, -A) per load (Pa, Pa, Pa, C/m^2, Wb/m^2)",
}


def create_folder(folder: Path) -> None:
    """Create the folder of reduced systems unless it exists. Raises ResultError if it cannot be created."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(f"folder {folder} of reduced systems cannot be made: {error.strerror or error}") from None


def write_system(path: Path, key: str, system: ReducedSystem, matrix: Array) -> None:
    """Write a reduced system.

    matrix: its compliance (n, f, n, f); key: its identification, stored with it. The file is written completely or not
    at all. Raises ResultError if it cannot be written.
    """
    arrays = {name: getattr(system, name) for name in _UNITS if name != "matrix"} | {"matrix": matrix}
    with _written(path, FORMAT, key) as file:
        for name, unit in _UNITS.items():
            _put(file, name, arrays[name]).attrs["units"] = unit
        if isinstance(system.cells, GridCells):  # areas of its elements are equal to the last bit
            _put(file, _GRID, np.array(system.cells.shape)).attrs["units"] = "1"
            return
        for number, (cell_type, connectivity) in enumerate(system.cells):
            _put(file, f"cells/{number}", connectivity).attrs.update({"type": cell_type, "units": "1"})


def write_arrays(path: Path, key: str, arrays: Mapping[str, AnyArray]) -> None:
    """Write the arrays of a reduced system without a matrix (`Persistence.to_arrays`); see write_system."""
    with _written(path, ARRAYS, key) as file:
        for name, array in arrays.items():
            _put(file, name, array)


def read_arrays(path: Path, key: str) -> dict[str, AnyArray] | None:
    """Return the arrays of a file of write_arrays; None if there is no complete file with this key."""
    return _read(path, ARRAYS, key, lambda file: {name: file[name][()] for name in file})


def read_system(path: Path, key: str, recovery: Callable[[Array], NodalFields]) -> DenseSystem | None:
    """Return the reduced system of a file, bit for bit; None if there is no complete file of this key.

    recovery: returns the fields on the whole boundary, which no file holds.
    """

    def system(file: Any) -> DenseSystem:
        arrays = {name: file[name][()] for name in _UNITS}
        if _GRID in file:
            return DenseSystem(**arrays, cells=GridCells((int(file[_GRID][0]), int(file[_GRID][1]))), recovery=recovery)
        blocks = [file["cells"][name] for name in sorted(file["cells"], key=int)]
        cells = tuple((str(block.attrs["type"]), block[()]) for block in blocks)
        return DenseSystem(**arrays, cells=cells, recovery=recovery)

    return _read(path, FORMAT, key, system)


def _read(path: Path, kind: str, key: str, take: Callable[[Any], Value]) -> Value | None:
    """Return the data read from a file of this kind and key; None if there is no complete one."""
    try:
        with open_hdf5(path) as file:
            return take(file) if (file.attrs["format"], file.attrs["key"]) == (kind, key) else None
    except (OSError, KeyError, RuntimeError, ValueError):  # absent, cut short, or changed on the disk
        return None


@contextmanager
def _written(path: Path, kind: str, key: str) -> Iterator[Any]:
    """Open a file that replaces the target when it is complete."""
    with replacing(path) as temporary, changed_file(temporary, "w") as file:
        file.attrs.update({"format": kind, "key": key})
        yield file


def _put(file: Any, name: str, array: Any) -> Any:
    """Return a new dataset; arrays have a check sum, so that a change on the disk is detected on reading.

    Single numbers have none.
    """
    checked = {"chunks": True, "fletcher32": True} if np.ndim(array) else {}
    return file.create_dataset(name, data=array, **checked)
