"""Indenters whose surface is given as numbers: a grid of heights, or one height for each contact node."""

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Final, Literal, final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.common.errors import CaseError
from meeframe.fields import Array, Indices
from meeframe.fields.units import Quantity, check_quantities
from meeframe.indenters.base import Indenter

Interpolation = Literal["linear", "cubic", "nodes"]

SAME: Final = 1e-6  # coordinates within this part of the extent are the same


@final
@dataclass(frozen=True)
class Heights(Indenter):
    """Heights read from a file: .npy with an array (n, 3), or text with rows 'x, y, height' (# starts a comment).

    interpolation: 'linear' (bilinear) and 'cubic' (bicubic) want a full rectangular grid, in any order of rows; 'nodes'
    takes one row for each node of the contact zone that has indenter above it, in any order. unit: metres in the file's
    unit of all three columns. Heights count from the lowest of the file; outside the grid there is no surface. Raises
    CaseError for another interpolation or unit; the file is read when heights are asked for.
    """

    file: Path
    interpolation: Interpolation = "linear"
    unit: Annotated[float, Quantity("m", gt=0, lt=float("inf"))] = 1.0

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest given one, (n,) [m]. Raises CaseError, naming the file, if its data do
        not serve."""
        try:
            rows = _read(str(self.file), os.stat(self.file).st_mtime_ns) * self.unit
            return _interpolate(rows, self.interpolation, x, y)
        except OSError as error:
            raise CaseError(f"heights: {self.file}: cannot be read: {error.strerror or error}") from None
        except ValueError as error:
            raise CaseError(f"heights: {self.file}: {error}") from None

    @property
    def pointwise(self) -> bool:
        """True if heights are not interpolated between nodes."""
        return self.interpolation == "nodes"


@final
@dataclass(frozen=True, eq=False)
class SampledHeights(Indenter):
    """Heights from an array in Python: rows (n, 3) of x, y, height [m]; interpolation as of Heights.

    They are those of the indenter's surface, which points towards the body: its lowest point touches first. A grid of
    heights is easier given to `on_grid`. Raises CaseError for another interpolation, or unless the rows are finite
    numbers.
    """

    rows: Array
    interpolation: Interpolation = "linear"

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "rows", np.asarray(self.rows))
            _check_rows(self.rows)
        except ValueError as error:
            raise CaseError(f"heights: {error}") from None
        check_quantities(self)

    @classmethod
    def on_grid(cls, x: Array, y: Array, heights: Array, interpolation: Interpolation = "linear") -> "SampledHeights":
        """Make an indenter of heights (nx, ny) on the grid of x (nx,) and y (ny,), heights[i, j] at x[i], y[j], all
        [m].

        Raises CaseError unless these shapes fit, or as the class does.
        """
        try:
            x, y, heights = (np.asarray(values) for values in (x, y, heights))
        except ValueError as error:
            raise CaseError(f"heights: {error}") from None
        if x.ndim != 1 or y.ndim != 1 or heights.shape != (x.size, y.size):
            raise CaseError(
                f"heights: x, y and heights have the shapes {x.shape}, {y.shape} and {heights.shape}; allowed: (nx,), "
                "(ny,) and (nx, ny), rows of heights along x, as of numpy.meshgrid(x, y, indexing='ij')"
            )
        across, along = np.meshgrid(x, y, indexing="ij")
        return cls(np.column_stack([across.ravel(), along.ravel(), heights.ravel()]), interpolation)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest given one, (n,) [m]. Raises CaseError if the rows are no grid."""
        try:
            return _interpolate(self.rows, self.interpolation, x, y)
        except ValueError as error:
            raise CaseError(f"heights: {error}") from None

    @property
    def pointwise(self) -> bool:
        """True if heights are not interpolated between nodes."""
        return self.interpolation == "nodes"


@lru_cache(maxsize=4)
def _read(file: str, _changed: int) -> Array:
    """Return rows of a file, kept until it changes."""
    if file.lower().endswith(".npy"):
        with open(file, "rb") as raw:
            rows = np.lib.format.read_array(raw, allow_pickle=False)
    else:
        with open(file, encoding="utf-8") as text:
            lines = [line.partition("#")[0].replace(",", " ").replace(";", " ") for line in text]
        rows = np.loadtxt(lines, ndmin=2) if any(line.strip() for line in lines) else np.empty((0, 3))
    _check_rows(rows)
    return np.asarray(rows, float)


def _check_rows(rows: Array) -> None:
    if rows.ndim != 2 or rows.shape[1] != 3 or len(rows) == 0 or rows.dtype.kind not in "fiu":
        raise ValueError(f"numbers in rows (x, y, height) are wanted, not an array of the shape {rows.shape}")
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if bad.size:
        raise ValueError(f"row {bad[0] + 1} is not finite: {rows[bad[0]]}")


def _interpolate(rows: Array, interpolation: Interpolation, x: Array, y: Array) -> Array:
    at = np.stack([np.asarray(x, float), np.asarray(y, float)], axis=-1)
    if interpolation == "nodes":
        return _at_nodes(rows, at)
    xs, ys, grid = _grid(rows)
    if interpolation == "cubic" and min(grid.shape) < 4:
        raise ValueError(f"cubic interpolation needs 4 points along each side of the grid; it has {grid.shape}")
    # nodes on the border of the grid belong to it, whatever their last digits
    slack = SAME * np.array([np.ptp(xs), np.ptp(ys)])
    low, high = np.array([xs[0], ys[0]]), np.array([xs[-1], ys[-1]])
    within = np.all((at >= low - slack) & (at <= high + slack), axis=-1)
    inside = np.clip(at[within], low, high)
    heights = np.full(len(at), np.inf)
    if interpolation == "cubic":
        heights[within] = scipy.interpolate.RectBivariateSpline(xs, ys, grid - grid.min()).ev(*inside.T)
    else:
        heights[within] = scipy.interpolate.RegularGridInterpolator((xs, ys), grid - grid.min())(inside)
    return heights


def _grid(rows: Array) -> tuple[Array, Array, Array]:
    """Return the axes (nx,), (ny,) and heights (nx, ny) of rows that form a full rectangular grid."""
    (xs, i), (ys, j) = _axis(rows[:, 0]), _axis(rows[:, 1])
    if len(rows) != len(xs) * len(ys) or len(np.unique(i * len(ys) + j)) != len(rows) or min(len(xs), len(ys)) < 2:
        raise ValueError(
            f"{len(rows)} rows with {len(xs)} different x and {len(ys)} different y are no full rectangular grid of at "
            "least 2 x 2 points (interpolation = 'nodes' takes scattered points)"
        )
    grid = np.empty((len(xs), len(ys)))
    grid[i, j] = rows[:, 2]
    return xs, ys, grid


def _axis(values: Array) -> tuple[Array, Indices]:
    """Return the different values in rising order, and the number of each given value among them."""
    order = np.argsort(values)
    ordered = values[order]
    new = np.diff(ordered, prepend=-np.inf) > SAME * np.ptp(values)
    number = np.empty(len(values), np.int64)
    number[order] = np.cumsum(new) - 1
    return ordered[new], number


def _at_nodes(rows: Array, at: Array) -> Array:
    """Return the heights of the rows at the same places, inf where there is none."""
    extent = np.ptp(rows[:, :2], axis=0).max()
    distance, row = scipy.spatial.cKDTree(rows[:, :2]).query(at)
    return np.where(distance <= SAME * extent, rows[row, 2] - rows[:, 2].min(), np.inf)
