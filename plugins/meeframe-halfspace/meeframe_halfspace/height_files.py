"""Height maps from files: arrays, HDF5, grids of mapping programs, and the text that profilometers write."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import Array, CaseError, Quantity

AnyArray = NDArray[Any]

SURFER_BLANK: Final = 1.70141e38
"""Heights from here on are missing ones in a Surfer grid."""
_POSITIVE: Final = Quantity("m", gt=0, lt=float("inf"))
_MATRIX_HEADER: Final = re.compile(r"#\s*(width|height|value units)\s*:\s*(.+)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class HeightMap:
    """A measured surface. x: (nx,), y: (ny,) rising [m]; heights: (nx, ny) [m], NaN where missing."""

    x: Array
    y: Array
    heights: Array

    @property
    def rms_height(self) -> float:
        """Root of the mean square distance from the mean height [m]."""
        return float(np.nanstd(self.heights))

    @property
    def rms_slope(self) -> float:
        """Root of the mean square of the gradient, by differences of neighbours."""
        parts = (np.diff(self.heights, axis=axis) for axis in (0, 1))
        steps = np.diff(self.x)[:, None], np.diff(self.y)[None, :]
        return float(np.sqrt(sum(np.nanmean((part / step) ** 2) for part, step in zip(parts, steps, strict=True))))

    def levelled(self) -> "HeightMap":
        """Without its best plane."""
        x, y = (grid.ravel() for grid in np.meshgrid(self.x, self.y, indexing="ij"))
        z, basis = self.heights.ravel(), np.column_stack([np.ones_like(x), x - x.mean(), y - y.mean()])
        known = np.isfinite(z)
        plane = basis @ np.linalg.lstsq(basis[known], z[known])[0]
        return replace(self, heights=(z - plane).reshape(self.heights.shape))


@dataclass(frozen=True)
class Scales:
    """Units and spacings that a file does not state, or states wrongly.

    Metres per unit of heights (None: as the file states, or metres) and of coordinates, spacing of a matrix [m] along x
    and y, path of the dataset in an HDF5 file.
    """

    unit: float | None = None
    lateral_unit: float = 1.0
    spacing: tuple[float, float] | None = None
    dataset: str | None = None


def read_height_map(file: str | Path, scales: Scales | None = None) -> HeightMap:
    """The height map in a file, by its name and its beginning.

    - .npy, .h5, .hdf5: a matrix (rows along y, columns along x, from the lowest on) or rows (x, y, height).
    - Surfer ASCII grid (DSAA), ESRI ASCII grid (ncols, nrows, ...): as those formats say.
    - Text: a matrix or rows as above; lines with # are comments, of which '# Width: 20 um', '# Height: 20 um' and
      '# Value units: nm' say the size of a matrix and the unit of its numbers, where scales do not; other lines before
      the first number are skipped.
    Raises CaseError, naming the file, if it cannot be read or does not make a full rectangular grid.
    """
    path, scales = Path(file), scales or Scales()
    try:
        reader = _reader(path)
    except OSError as error:
        raise CaseError(f"height map {path}: cannot be read: {error.strerror or error}") from None
    try:
        with np.errstate(invalid="ignore"):  # places that are not finite are refused below
            return reader.read(path, scales)
    except _UNREADABLE as error:
        raise CaseError(f"height map {path}: {error}; allowed: {reader.allowed}") from None


_UNREADABLE: Final = (ValueError, KeyError, OverflowError, EOFError, OSError, RuntimeError)
"""What numpy and h5py raise of files that are damaged or hold something else."""


@dataclass(frozen=True)
class _Reader:
    """How files of a kind are read, and what may be in them, in words."""

    read: Callable[[Path, Scales], HeightMap]
    allowed: str


def _reader(path: Path) -> _Reader:
    suffix = path.suffix.lower()
    with path.open(encoding="utf-8", errors="replace") as text:
        first = text.readline(100).split()
    if suffix == ".npy":
        return _Reader(_read_npy, "one array of real numbers as numpy.save writes it, a matrix or rows (x, y, height)")
    if suffix in (".h5", ".hdf5"):
        return _Reader(_read_hdf5, "HDF5 with a dataset of real numbers, a matrix or rows (x, y, height)")
    if first[:1] == ["DSAA"]:
        return _Reader(_read_surfer, "DSAA, nx ny, x0 x1, y0 y1, z0 z1, with x0 < x1 and y0 < y1, and nx ny heights")
    if first and first[0].lower() == "ncols":
        return _Reader(_read_esri, "ncols, nrows and cellsize > 0, each with its number, and ncols nrows heights")
    return _Reader(_read_text, "rows of equally many numbers: a matrix whose spacing is known, or x, y, height")


def _read_npy(path: Path, scales: Scales) -> HeightMap:
    with path.open("rb") as file:
        return _of_array(np.lib.format.read_array(file, allow_pickle=False), scales)


def _read_hdf5(path: Path, scales: Scales) -> HeightMap:
    with h5py.File(path) as file:
        found: list[str] = []
        file.visititems(lambda name, item: found.append(name) if getattr(item, "ndim", 0) == 2 else None)
        name = scales.dataset or (found[0] if len(found) == 1 else None)
        dataset = None if name is None else file.get(name)  # None for a link that leads nowhere, too
        if not isinstance(dataset, h5py.Dataset):
            raise ValueError(f"dataset = {scales.dataset!r}, and of matrices it has {', '.join(found) or 'none'}")
        return _of_array(np.asarray(dataset), scales)


def _read_surfer(path: Path, scales: Scales) -> HeightMap:
    words = path.read_text(encoding="utf-8").split()
    if len(words) < 9:
        raise ValueError("its header is not whole")
    nx, ny = int(words[1]), int(words[2])
    x0, x1, y0, y1 = (float(word) * scales.lateral_unit for word in words[3:7])
    heights = _reshaped(np.array(words[9:], float), ny, nx)
    heights[heights >= SURFER_BLANK] = np.nan
    return _matrix(np.linspace(x0, x1, nx), np.linspace(y0, y1, ny), heights, scales)


def _read_esri(path: Path, scales: Scales) -> HeightMap:
    words = path.read_text(encoding="utf-8").split()
    header: dict[str, float] = {}
    while len(words) > 1 and words[0][0].isalpha():
        header[words[0].lower()] = float(words[1])
        words = words[2:]
    missing = [key for key in ("ncols", "nrows", "cellsize") if key not in header]
    if missing:
        raise ValueError(f"its header lacks {', '.join(missing)}")
    nx, ny, size = int(header["ncols"]), int(header["nrows"]), header["cellsize"]
    heights = _reshaped(np.array(words, float), ny, nx)[::-1]
    heights[heights == header.get("nodata_value", -9999.0)] = np.nan
    starts = [header.get(f"{a}llcenter", header.get(f"{a}llcorner", 0.0) + size / 2) for a in "xy"]
    x, y = (
        (start + size * np.arange(count)) * scales.lateral_unit for start, count in zip(starts, (nx, ny), strict=True)
    )
    return _matrix(x, y, heights, scales)


def _read_text(path: Path, scales: Scales) -> HeightMap:
    lines = path.read_text(encoding="utf-8").splitlines()
    said = {match[1].lower(): match[2].strip() for line in lines if (match := _MATRIX_HEADER.match(line))}
    rows = [line.partition("#")[0].replace(",", " ").replace(";", " ").split() for line in lines]
    numbers = [row for row in rows if row]
    while numbers and not _is_number(numbers[0][0]):
        numbers = numbers[1:]
    if not numbers or len({len(row) for row in numbers}) != 1:
        raise ValueError("rows of unequal length" if numbers else "no numbers in it")
    array = np.array(numbers, float)
    if scales.unit is None and "value units" in said:
        scales = replace(scales, unit=_length(said, "value units", "1 "))
    if scales.spacing is None and "width" in said and "height" in said:
        width, height = (_length(said, key) for key in ("width", "height"))
        scales = replace(scales, spacing=(width / array.shape[1], height / array.shape[0]))
    return _of_array(array, scales)


def _length(said: dict[str, str], key: str, before: str = "") -> float:
    """What a line of the header says [m]. Raises ValueError, naming the line."""
    try:
        return _POSITIVE.check(before + said[key])
    except ValueError as error:
        raise ValueError(f"# {key}: {said[key]}: {error}") from None


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _of_array(array: Array, scales: Scales) -> HeightMap:
    """Rows (x, y, height) if there are three columns and no spacing is known, else a matrix."""
    if array.ndim != 2 or array.dtype.kind not in "fiu" or min(array.shape) < 2:
        raise ValueError(f"{array.dtype} {array.shape} in it")
    if scales.spacing is not None:
        (dx, dy), (ny, nx) = scales.spacing, array.shape
        return _matrix(dx * np.arange(nx), dy * np.arange(ny), array.astype(float), scales)
    if array.shape[1] != 3:
        size = f"{array.shape[0]} x {array.shape[1]}"
        raise ValueError(f'a matrix of {size} heights needs a key such as spacing = ["10 um", "10 um"]')
    x, column = np.unique(array[:, 0], return_inverse=True)
    y, row = np.unique(array[:, 1], return_inverse=True)
    if len(array) != len(x) * len(y) or len(np.unique(column * len(y) + row)) != len(array):
        raise ValueError(f"{len(array)} rows with {len(x)} different x and {len(y)} different y are no full grid")
    heights = np.empty((len(y), len(x)))
    heights[row, column] = array[:, 2]
    return _matrix(x * scales.lateral_unit, y * scales.lateral_unit, heights, scales)


def _reshaped(heights: Array, rows: int, columns: int) -> Array:
    if len(heights) != rows * columns:
        raise ValueError(f"{len(heights)} heights do not make {rows} rows of {columns}")
    return heights.reshape(rows, columns)


def _matrix(x: AnyArray, y: AnyArray, rows: Array, scales: Scales) -> HeightMap:
    """rows: (ny, nx) heights in units of the file. Raises ValueError unless x and y have two places and rise."""
    for name, places in (("x", x), ("y", y)):
        if len(places) < 2 or not np.isfinite(places).all() or (np.diff(places) <= 0.0).any():
            ends = f" from {places[0]:g} to {places[-1]:g} m" if len(places) else ""
            raise ValueError(f"its {len(places)} places along {name} do not rise{ends}")
    unit = 1.0 if scales.unit is None else scales.unit
    return HeightMap(np.asarray(x, float), np.asarray(y, float), np.ascontiguousarray(rows.T) * unit)
