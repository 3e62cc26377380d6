"""Indenters defined by numbers: heights on a grid, or one height for each contact node."""

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Final, Literal, final

import numpy as np
import scipy  # submodules load on first use

from meeframe.common.errors import CaseError
from meeframe.common.files import MAX_DATA_BYTES, check_file, read_npy
from meeframe.fields import Array, Indices
from meeframe.fields.units import Quantity, check_quantities
from meeframe.indenters.base import Indenter

Interpolation = Literal["linear", "cubic", "nodes"]

COORDINATE_TOLERANCE: Final = 1e-6  # relative to the extent; closer coordinates are the same


@final
@dataclass(frozen=True)
class Heights(Indenter):
    """Heights from a file.

    Heights are relative to the lowest one of the file. There is no surface outside the grid.

    Attributes
    ----------
    file : Path
        A .npy file with an array (n, 3), or a text file with rows 'x, y, height', in which # starts a comment. It is
        read when heights are evaluated.
    interpolation : {'linear', 'cubic', 'nodes'}
        'linear' (bilinear) and 'cubic' (bicubic) require a full rectangular grid, with the rows in any order. 'nodes'
        requires one row for each node of the contact zone below the indenter, in any order.
    unit : float
        Metres in the unit of all three columns of the file.

    Raises
    ------
    CaseError
        For an unknown interpolation or an invalid unit.
    """

    file: Path
    interpolation: Interpolation = "linear"
    unit: Annotated[float, Quantity("m", gt=0, lt=float("inf"))] = 1.0

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest one, (n,) [m].

        Raises
        ------
        CaseError
            If the file cannot be read or its data are not valid; the message names the file.
        """
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
    """Heights from an array.

    The heights are those of the surface of the indenter, which faces the body: its lowest point touches first. See
    `on_grid` for a grid of heights.

    Attributes
    ----------
    rows : Array
        x, y and height [m] of each point, (n, 3).
    interpolation : {'linear', 'cubic', 'nodes'}
        Interpolation, as for `Heights`.

    Raises
    ------
    CaseError
        For an unknown interpolation, or if the rows are not finite numbers.
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
        """Make an indenter from heights on a grid.

        Parameters
        ----------
        x, y : Array
            Coordinates of the grid, (nx,) and (ny,) [m].
        heights : Array
            Heights, (nx, ny) [m], heights[i, j] at x[i], y[j].
        interpolation : {'linear', 'cubic', 'nodes'}
            Interpolation, as for `Heights`.

        Returns
        -------
        SampledHeights
            The indenter.

        Raises
        ------
        CaseError
            If the shapes do not fit, or as for the class.
        """
        try:
            x, y, heights = (np.asarray(values) for values in (x, y, heights))
        except ValueError as error:
            raise CaseError(f"heights: {error}") from None
        if x.ndim != 1 or y.ndim != 1 or heights.shape != (x.size, y.size):
            raise CaseError(
                f"heights: x, y and heights have the shapes {x.shape}, {y.shape} and {heights.shape}; allowed: (nx,), "
                "(ny,) and (nx, ny), with rows of heights along x, as from numpy.meshgrid(x, y, indexing='ij')"
            )
        across, along = np.meshgrid(x, y, indexing="ij")
        return cls(np.column_stack([across.ravel(), along.ravel(), heights.ravel()]), interpolation)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest sample.

        Parameters
        ----------
        x, y : Array
            Coordinates from the axis of the indenter, (n,) each [m].

        Returns
        -------
        Array
            Heights, (n,) >= 0 [m], inf outside the samples.

        Raises
        ------
        CaseError
            If the rows do not form a grid.
        """
        try:
            return _interpolate(self.rows, self.interpolation, x, y)
        except ValueError as error:
            raise CaseError(f"heights: {error}") from None

    @property
    def pointwise(self) -> bool:
        """True if heights are not interpolated between nodes."""
        return self.interpolation == "nodes"


@lru_cache(maxsize=4)
def _read(file: str, _modified: int) -> Array:
    """Return the rows of a file, cached until the file changes."""
    if file.lower().endswith(".npy"):
        rows = read_npy(file)
    else:
        check_file(file, MAX_DATA_BYTES)
        with open(file, encoding="utf-8") as text:
            lines = [line.partition("#")[0].replace(",", " ").replace(";", " ") for line in text]
        rows = np.loadtxt(lines, ndmin=2) if any(line.strip() for line in lines) else np.empty((0, 3))
    _check_rows(rows)
    return np.asarray(rows, float)


def _check_rows(rows: Array) -> None:
    if rows.ndim != 2 or rows.shape[1] != 3 or len(rows) == 0 or rows.dtype.kind not in "fiu":
        raise ValueError(f"numbers in rows (x, y, height) are required, not an array of shape {rows.shape}")
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if bad.size:
        raise ValueError(f"row {bad[0] + 1} is not finite: {rows[bad[0]]}")


def _interpolate(rows: Array, interpolation: Interpolation, x: Array, y: Array) -> Array:
    targets = np.stack([np.asarray(x, float), np.asarray(y, float)], axis=-1)
    if interpolation == "nodes":
        return _at_nodes(rows, targets)
    xs, ys, grid = _grid(rows)
    if interpolation == "cubic" and min(grid.shape) < 4:
        raise ValueError(f"cubic interpolation needs 4 points along each side of the grid; it has {grid.shape}")
    # nodes on the border of the grid belong to it in spite of round-off
    margin = COORDINATE_TOLERANCE * np.array([np.ptp(xs), np.ptp(ys)])
    low, high = np.array([xs[0], ys[0]]), np.array([xs[-1], ys[-1]])
    covered = np.all((targets >= low - margin) & (targets <= high + margin), axis=-1)
    covered_targets = np.clip(targets[covered], low, high)
    heights = np.full(len(targets), np.inf)
    if interpolation == "cubic":
        heights[covered] = scipy.interpolate.RectBivariateSpline(xs, ys, grid - grid.min()).ev(*covered_targets.T)
    else:
        heights[covered] = scipy.interpolate.RegularGridInterpolator((xs, ys), grid - grid.min())(covered_targets)
    return heights


def _grid(rows: Array) -> tuple[Array, Array, Array]:
    """Return axes (nx,) and (ny,), and heights (nx, ny), of rows that form a full rectangular grid."""
    (xs, i), (ys, j) = _axis(rows[:, 0]), _axis(rows[:, 1])
    if len(rows) != len(xs) * len(ys) or len(np.unique(i * len(ys) + j)) != len(rows) or min(len(xs), len(ys)) < 2:
        raise ValueError(
            f"{len(rows)} rows with {len(xs)} distinct x and {len(ys)} distinct y do not form a full rectangular grid "
            "of at least 2 x 2 points (interpolation = 'nodes' accepts scattered points)"
        )
    grid = np.empty((len(xs), len(ys)))
    grid[i, j] = rows[:, 2]
    return xs, ys, grid


def _axis(values: Array) -> tuple[Array, Indices]:
    """Return the distinct values in rising order, and the number of each value among them."""
    order = np.argsort(values)
    ordered = values[order]
    is_new = np.diff(ordered, prepend=-np.inf) > COORDINATE_TOLERANCE * np.ptp(values)
    number = np.empty(len(values), np.int64)
    number[order] = np.cumsum(is_new) - 1
    return ordered[is_new], number


def _at_nodes(rows: Array, targets: Array) -> Array:
    """Return the heights of the rows at the same positions, inf where there is none."""
    extent = np.ptp(rows[:, :2], axis=0).max()
    distance, row = scipy.spatial.cKDTree(rows[:, :2]).query(targets)
    return np.where(distance <= COORDINATE_TOLERANCE * extent, rows[row, 2] - rows[:, 2].min(), np.inf)
