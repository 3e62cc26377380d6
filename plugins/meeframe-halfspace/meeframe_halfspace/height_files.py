"""Height maps from files: arrays, HDF5, grids of mapping programs, and the text that profilometers write."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from meeframe.core.errors import CaseError
from meeframe.core.fields import Array
from meeframe.core.quantities import Quantity

AnyArray = NDArray[Any]

SURFER_BLANK: Final = 1.70141e38
"""Heights from here on are missing ones in a Surfer grid."""
_METRES: Final = Quantity("m")
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
    """What a file does not say of itself: metres per unit of its heights and of its coordinates, spacing of a matrix
    [m] along x and y, path of the dataset in an HDF5 file."""

    unit: float = 1.0
    lateral_unit: float = 1.0
    spacing: tuple[float, float] | None = None
    dataset: str | None = None


def read_height_map(file: str | Path, scales: Scales | None = None) -> HeightMap:
    """The height map in a file, by its name and its beginning.

    - .npy, .h5, .hdf5: a matrix (rows along y, columns along x, from the lowest on) or rows (x, y, height).
    - Surfer ASCII grid (DSAA), ESRI ASCII grid (ncols, nrows, ...): as those formats say.
    - Text: a matrix or rows as above; lines with # are comments, of which '# Width: 20 um', '# Height: 20 um' and
      '# Value units: nm' say the size of a matrix and the unit of its numbers; other lines before the first number are
      skipped.
    Raises CaseError, naming the file, if it cannot be read or does not make a full rectangular grid.
    """
    path, scales = Path(file), scales or Scales()
    try:
        return _reader(path)(path, scales)
    except OSError as error:
        raise CaseError(f"height map {path}: cannot be read: {error.strerror or error}") from None
    except (ValueError, UnicodeDecodeError, IndexError) as error:
        raise CaseError(f"height map {path}: {error}") from None


def _reader(path: Path) -> Callable[[Path, Scales], HeightMap]:
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return lambda file, scales: _of_array(np.load(file, allow_pickle=False), scales)
    if suffix in (".h5", ".hdf5"):
        return _read_hdf5
    with path.open(encoding="utf-8", errors="replace") as text:
        first = text.readline().split()
    if first[:1] == ["DSAA"]:
        return _read_surfer
    if first and first[0].lower() == "ncols":
        return _read_esri
    return _read_text


def _read_hdf5(path: Path, scales: Scales) -> HeightMap:
    with h5py.File(path) as file:
        found: list[str] = []
        file.visititems(lambda name, item: found.append(name) if getattr(item, "ndim", 0) == 2 else None)
        name = scales.dataset or (found[0] if len(found) == 1 else None)
        if name is None or name not in file:
            raise ValueError(f"dataset = {scales.dataset!r}; allowed: one of {', '.join(found) or 'none: no matrix'}")
        return _of_array(np.asarray(file[name]), scales)


def _read_surfer(path: Path, scales: Scales) -> HeightMap:
    words = path.read_text(encoding="utf-8").split()
    nx, ny = int(words[1]), int(words[2])
    x0, x1, y0, y1 = (float(word) * scales.lateral_unit for word in words[3:7])
    heights = np.array(words[9:], float)
    heights[heights >= SURFER_BLANK] = np.nan
    return _matrix(np.linspace(x0, x1, nx), np.linspace(y0, y1, ny), _reshaped(heights, ny, nx), scales)


def _read_esri(path: Path, scales: Scales) -> HeightMap:
    words = path.read_text(encoding="utf-8").split()
    header: dict[str, float] = {}
    while words[2 * len(header)][0].isalpha():
        key, value = words[2 * len(header) : 2 * len(header) + 2]
        header[key.lower()] = float(value)
    missing = [key for key in ("ncols", "nrows", "cellsize") if key not in header]
    if missing:
        raise ValueError(f"its header lacks {', '.join(missing)}")
    heights = np.array(words[2 * len(header) :], float)
    heights[heights == header.get("nodata_value", -9999.0)] = np.nan
    nx, ny, size = int(header["ncols"]), int(header["nrows"]), header["cellsize"]
    starts = [header.get(f"{a}llcenter", header.get(f"{a}llcorner", 0.0) + size / 2) for a in "xy"]
    x, y = (
        (start + size * np.arange(count)) * scales.lateral_unit for start, count in zip(starts, (nx, ny), strict=True)
    )
    return _matrix(x, y, _reshaped(heights, ny, nx)[::-1], scales)


def _read_text(path: Path, scales: Scales) -> HeightMap:
    lines = path.read_text(encoding="utf-8").splitlines()
    said = {match[1].lower(): match[2].strip() for line in lines if (match := _MATRIX_HEADER.match(line))}
    rows = [line.partition("#")[0].replace(",", " ").replace(";", " ").split() for line in lines]
    numbers = [row for row in rows if row]
    while numbers and not _is_number(numbers[0][0]):
        numbers = numbers[1:]
    if not numbers or len({len(row) for row in numbers}) != 1:
        raise ValueError("rows of equally many numbers are wanted")
    array = np.array(numbers, float)
    if "value units" in said:
        scales = replace(scales, unit=_METRES.convert(f"1 {said['value units']}"))
    if "width" in said and "height" in said:
        sizes = _METRES.convert(said["width"]), _METRES.convert(said["height"])
        scales = replace(scales, spacing=(sizes[0] / array.shape[1], sizes[1] / array.shape[0]))
    return _of_array(array, scales)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _of_array(array: Array, scales: Scales) -> HeightMap:
    """Rows (x, y, height) if there are three columns and no spacing is known, else a matrix."""
    if array.ndim != 2 or array.dtype.kind not in "fiu" or min(array.shape) < 2:
        raise ValueError(f"numbers in a matrix or in rows (x, y, height) are wanted, not {array.dtype} {array.shape}")
    if scales.spacing is not None:
        (dx, dy), (ny, nx) = scales.spacing, array.shape
        return _matrix(dx * np.arange(nx), dy * np.arange(ny), array.astype(float), scales)
    if array.shape[1] != 3:
        raise ValueError(f"a matrix of {array.shape[0]} x {array.shape[1]} heights needs a spacing")
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
    """rows: (ny, nx) heights in units of the file."""
    return HeightMap(np.asarray(x, float), np.asarray(y, float), np.ascontiguousarray(rows.T) * scales.unit)
