"""Height maps from files: arrays, HDF5, grids of mapping programs, and text files of profilometers."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import Array, CaseError, HeightMap, Quantity, check_file, open_hdf5, read_npy
from meeframe_halfspace.instrument_files import is_binary, read_instrument
from meeframe_halfspace.text_table import TextTable, read_text

AnyArray = NDArray[Any]

SURFER_BLANK: Final = 1.70141e38
"""Heights of at least this value are missing in a Surfer grid."""
MAX_BYTES: Final = 2**30
"""Largest size of a file."""
_POSITIVE: Final = Quantity("m", gt=0, lt=float("inf"))
_MATRIX_HEADER: Final = re.compile(r"#\s*(width|height|value units)\s*:\s*(.+)", re.IGNORECASE)


@dataclass(frozen=True)
class Scales:
    """Properties that a file does not define, or defines wrongly.

    Attributes
    ----------
    unit : float or None
        Metres per unit of heights; None for that of the file, or metres.
    lateral_unit : float
        Metres per unit of coordinates.
    spacing : tuple of float or None
        Spacing of a matrix along x and y [m].
    dataset : str or None
        Path of the dataset in an HDF5 file, or name of the channel of an instrument.
    """

    unit: float | None = None
    lateral_unit: float = 1.0
    spacing: tuple[float, float] | None = None
    dataset: str | None = None


def read_height_map(file: str | Path, scales: Scales | None = None) -> HeightMap:
    """Read the height map in a file, whose format follows from its name and its first line.

    Parameters
    ----------
    file : str or Path
        One of these formats:

        - .npy, .h5, .hdf5: a matrix (rows along y, columns along x, ascending) or rows (x, y, height).
        - Surfer ASCII grid (DSAA), ESRI ASCII grid (ncols, nrows, ...).
        - Text: a matrix or rows as above, with decimal points, or with decimal commas if blanks or semicolons separate
          the numbers. Entries such as BAD or *** are missing. Lines with # are comments, of which '# Width: 20 um',
          '# Height: 20 um' and '# Value units: nm' define the size of a matrix and the unit of its numbers unless
          `scales` do; other lines without numbers before the heights are skipped.
        - Other binary files, and text with another header: those of instruments, by SurfaceTopography if it is
          installed.
    scales : Scales, optional
        Properties that the file does not define.

    Returns
    -------
    HeightMap
        The map [m].

    Raises
    ------
    CaseError
        If the file cannot be read or does not form a rectangular grid; the message names it.
    """
    path, scales = Path(file), scales or Scales()
    try:
        reader = _reader(path)
    except OSError as error:
        raise CaseError(f"height map {path}: cannot be read: {error.strerror or error}") from None
    try:
        with np.errstate(invalid="ignore"):  # coordinates that are not finite are refused below
            return reader.read(path, scales)
    except _UNREADABLE as error:
        raise CaseError(f"height map {path}: {error}; allowed: {reader.allowed}") from None


_UNREADABLE: Final = (ValueError, KeyError, OverflowError, EOFError, OSError, RuntimeError)
"""Errors raised by numpy and h5py for files that are damaged or of another kind."""


@dataclass(frozen=True)
class _Reader:
    """Function that reads files of a format, and a description of valid contents."""

    read: Callable[[Path, Scales], HeightMap]
    allowed: str


def _reader(path: Path) -> _Reader:
    check_file(path, MAX_BYTES)
    suffix = path.suffix.lower()
    with path.open(encoding="utf-8-sig", errors="replace") as text:
        first = text.readline(100).split()
    if suffix == ".npy":
        return _Reader(_read_npy, "one array of real numbers as numpy.save writes it, a matrix or rows (x, y, height)")
    if suffix in (".h5", ".hdf5"):
        return _Reader(_read_hdf5, "HDF5 with a dataset of real numbers, a matrix or rows (x, y, height)")
    if first[:1] == ["DSAA"]:
        return _Reader(_read_surfer, "DSAA, nx ny, x0 x1, y0 y1, z0 z1, with x0 < x1 and y0 < y1, and nx ny heights")
    if first and first[0].lower() == "ncols":
        return _Reader(_read_esri, "ncols, nrows and cellsize > 0, each with its number, and ncols nrows heights")
    if is_binary(path):
        return _Reader(_read_instrument, "a file of an instrument that SurfaceTopography reads")
    return _Reader(_read_text, "rows of equally many numbers: a matrix whose spacing is known, or x, y, height")


def _read_npy(path: Path, scales: Scales) -> HeightMap:
    return _from_array(read_npy(path), scales)


def _read_hdf5(path: Path, scales: Scales) -> HeightMap:
    with open_hdf5(path) as file:
        datasets: list[str] = []
        file.visititems(lambda name, item: datasets.append(name) if getattr(item, "ndim", 0) == 2 else None)
        name = scales.dataset or (datasets[0] if len(datasets) == 1 else None)
        dataset = None if name is None else file.get(name)  # None for a broken link, too
        if not isinstance(dataset, h5py.Dataset):
            matrices = ", ".join(datasets) or "none"
            raise ValueError(f"dataset = {scales.dataset!r}: must name one of the matrices in the file: {matrices}")
        _check_matrix(dataset)  # before texts of any length are read
        return _from_array(np.asarray(dataset), scales)


def _read_surfer(path: Path, scales: Scales) -> HeightMap:
    tokens = read_text(path).split()
    if len(tokens) < 9:
        raise ValueError("its header is incomplete")
    nx, ny = int(tokens[1]), int(tokens[2])
    x0, x1, y0, y1 = (float(token) * scales.lateral_unit for token in tokens[3:7])
    heights = _reshape(np.array(tokens[9:], float), ny, nx)
    heights[heights >= SURFER_BLANK] = np.nan
    return _matrix(np.linspace(x0, x1, nx), np.linspace(y0, y1, ny), heights, scales)


def _read_esri(path: Path, scales: Scales) -> HeightMap:
    tokens = read_text(path).split()
    header: dict[str, float] = {}
    while len(tokens) > 1 and tokens[0][0].isalpha():
        header[tokens[0].lower()] = float(tokens[1])
        tokens = tokens[2:]
    missing = [key for key in ("ncols", "nrows", "cellsize") if key not in header]
    if missing:
        raise ValueError(f"its header lacks {', '.join(missing)}")
    nx, ny, size = int(header["ncols"]), int(header["nrows"]), header["cellsize"]
    heights = _reshape(np.array(tokens, float), ny, nx)[::-1]
    heights[heights == header.get("nodata_value", -9999.0)] = np.nan
    starts = [header.get(f"{a}llcenter", header.get(f"{a}llcorner", 0.0) + size / 2) for a in "xy"]
    x, y = (
        (start + size * np.arange(count)) * scales.lateral_unit for start, count in zip(starts, (nx, ny), strict=True)
    )
    return _matrix(x, y, heights, scales)


def _read_instrument(path: Path, scales: Scales) -> HeightMap:
    return read_instrument(path, scales.unit, scales.spacing, scales.dataset)


def _read_text(path: Path, scales: Scales) -> HeightMap:
    text = read_text(path)
    header = {match[1].lower(): match[2].strip() for line in text.splitlines() if (match := _MATRIX_HEADER.match(line))}
    table = TextTable.of(text)
    if table.unknown is not None and (scales.unit is None or scales.spacing is None):
        return _read_exported(path, scales, table.unknown)
    array = table.numbers()
    if scales.unit is None and "value units" in header:
        scales = replace(scales, unit=_length(header, "value units", "1 "))
    if scales.spacing is None and "width" in header and "height" in header:
        width, height = (_length(header, key) for key in ("width", "height"))
        scales = replace(scales, spacing=(width / array.shape[1], height / array.shape[0]))
    return _from_array(array, scales)


def _read_exported(path: Path, scales: Scales, line: str) -> HeightMap:
    """Return the map of a text whose header meeframe does not know. Raises ValueError, naming the line."""
    try:
        return read_instrument(path, scales.unit, scales.spacing, scales.dataset)
    except (CaseError, ValueError) as error:
        raise ValueError(
            f"{line}: neither a comment nor heights, and perhaps a unit or a size; begin it with # and give the keys "
            f"unit and spacing, or lateral_unit ({str(error).removeprefix(f'height map {path}: ')})"
        ) from None


def _length(header: dict[str, str], key: str, before: str = "") -> float:
    """Return the value of a header line [m]. Raises ValueError, naming the line."""
    try:
        return _POSITIVE.check(before + header[key])
    except ValueError as error:
        raise ValueError(f"# {key}: {header[key]}: {error}") from None


def _from_array(array: Array, scales: Scales) -> HeightMap:
    """Return the map of rows (x, y, height) if there are three columns and no spacing is known, else of a matrix."""
    _check_matrix(array)
    if scales.spacing is not None:
        if array.shape[1] == 3 and _is_grid(array):
            raise ValueError("its three columns are x, y and height, which need no spacing; leave it out")
        (dx, dy), (ny, nx) = scales.spacing, array.shape
        return _matrix(dx * np.arange(nx), dy * np.arange(ny), array.astype(float), scales)
    if array.shape[1] != 3:
        size = f"{array.shape[0]} x {array.shape[1]}"
        raise ValueError(f'a matrix of {size} heights needs a key such as spacing = ["10 um", "10 um"]')
    x, y, heights = _grid_of(array)
    return _matrix(x * scales.lateral_unit, y * scales.lateral_unit, heights, scales)


def _is_grid(rows: Array) -> bool:
    try:
        _grid_of(rows)
    except ValueError:
        return False
    return True


def _grid_of(rows: Array) -> tuple[AnyArray, AnyArray, Array]:
    """Return x (nx,), y (ny,) and heights (ny, nx) of rows (x, y, height), nan where there is no row.

    Raises ValueError if they do not form a grid.
    """
    x, column = np.unique(rows[:, 0], return_inverse=True)
    y, row = np.unique(rows[:, 1], return_inverse=True)
    size = f"{len(rows)} rows with {len(x)} different x and {len(y)} different y form no grid"
    if min(len(x), len(y)) < 2:
        raise ValueError(f"{size} of at least 2 x 2 points")
    repeated = len(rows) - len(np.unique(column * len(y) + row))
    if repeated:
        raise ValueError(f"{size}: {repeated} of them repeat the point of another one")
    if 2 * len(rows) <= len(x) * len(y):
        raise ValueError(f"{size}: half of its points or more have no row")
    heights = np.full((len(y), len(x)), np.nan)
    heights[row, column] = rows[:, 2]
    return x, y, heights


def _check_matrix(array: Any) -> None:
    """Raise ValueError unless an array, or a dataset, is a matrix of real numbers."""
    if array.ndim != 2 or array.dtype.kind not in "fiu":
        raise ValueError(f"{array.dtype} {array.shape} in it")
    if min(array.shape) < 2:
        raise ValueError(f"{array.shape[0]} x {array.shape[1]} numbers in it; a map has at least 2 x 2")


def _reshape(heights: Array, rows: int, columns: int) -> Array:
    if len(heights) != rows * columns:
        raise ValueError(f"{len(heights)} heights do not make {rows} rows of {columns}")
    return heights.reshape(rows, columns)


def _matrix(x: AnyArray, y: AnyArray, rows: Array, scales: Scales) -> HeightMap:
    """Return the map of heights (ny, nx) in units of the file. Raises ValueError unless x and y are increasing."""
    for name, coordinates in (("x", x), ("y", y)):
        if len(coordinates) < 2 or not np.isfinite(coordinates).all() or (np.diff(coordinates) <= 0.0).any():
            ends = f" from {coordinates[0]:g} to {coordinates[-1]:g} m" if len(coordinates) else ""
            raise ValueError(f"its {len(coordinates)} coordinates along {name} do not increase{ends}")
    unit = 1.0 if scales.unit is None else scales.unit
    return HeightMap(np.asarray(x, float), np.asarray(y, float), np.ascontiguousarray(rows.T) * unit)
