"""Indenters defined by numbers: heights on a grid, or one height for each contact node."""

import os
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Final, Literal, final

import numpy as np
import scipy  # submodules load on first use

from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import CaseError
from meeframe.common.files import MAX_DATA_BYTES, check_file, read_npy
from meeframe.fields import Array, Indices
from meeframe.fields.units import MAX_MAGNITUDE, Quantity, check_quantities
from meeframe.indenters.base import Indenter

Interpolation = Literal["linear", "cubic", "nodes"]

COORDINATE_TOLERANCE: Final = 1e-6  # relative to the extent; closer coordinates are the same
NODE_TOLERANCE: Final = 1e-12  # relative to the extent; round-off of positions at nodes of the grid


@final
@checked_arguments
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
        """Return the height above the lowest one.

        Parameters
        ----------
        x, y : Array
            Coordinates from the axis of the indenter, (n,) each [m].

        Returns
        -------
        Array
            Heights, (n,) >= 0 [m], inf where there is no indenter.

        Raises
        ------
        CaseError
            If the file cannot be read or its data are not valid; the message names the file.
        """
        try:
            surface = _read(str(self.file), os.stat(self.file).st_mtime_ns, self.unit, self.interpolation)
            return surface.height(x, y)
        except OSError as error:
            raise CaseError(f"heights: {self.file}: cannot be read: {error.strerror or error}") from None
        except ValueError as error:
            raise CaseError(f"heights: {self.file}: {error}") from None

    @property
    def pointwise(self) -> bool:
        """True if heights are not interpolated between nodes."""
        return self.interpolation == "nodes"


@final
@checked_arguments
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
            object.__setattr__(self, "rows", np.array(self.rows))  # a copy: its grid is made only once
            _check_rows(self.rows)
            self.rows.setflags(write=False)
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
            return self._surface.height(x, y)
        except ValueError as error:
            raise CaseError(f"heights: {error}") from None

    @cached_property
    def _surface(self) -> "HeightGrid | _HeightNodes":
        return _surface(np.asarray(self.rows, float), self.interpolation)

    @property
    def pointwise(self) -> bool:
        """True if heights are not interpolated between nodes."""
        return self.interpolation == "nodes"


@lru_cache(maxsize=4)
def _read(file: str, _modified: int, unit: float, interpolation: Interpolation) -> "HeightGrid | _HeightNodes":
    """Return the surface in a file, cached until the file changes."""
    if file.lower().endswith(".npy"):
        rows = read_npy(file)
    else:
        check_file(file, MAX_DATA_BYTES)
        with open(file, encoding="utf-8") as text:
            lines = [line.partition("#")[0].replace(",", " ").replace(";", " ") for line in text]
        rows = np.loadtxt(lines, ndmin=2) if any(line.strip() for line in lines) else np.empty((0, 3))
    _check_rows(rows)
    return _surface(np.asarray(rows, float) * unit, interpolation)


def _check_rows(rows: Array) -> None:
    if rows.ndim != 2 or rows.shape[1] != 3 or len(rows) == 0 or rows.dtype.kind not in "fiu":
        raise ValueError(f"numbers in rows (x, y, height) are required, not an array of shape {rows.shape}")
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if bad.size:
        raise ValueError(f"row {bad[0] + 1} is not finite: {rows[bad[0]]}")


def _check_magnitudes(*arrays: Array) -> None:
    """Check that differences of coordinates and heights stay finite. Raises ValueError."""
    for values in arrays:
        largest = max(float(values.max()), -float(values.min()))
        if not largest <= MAX_MAGNITUDE:
            raise ValueError(f"coordinates or heights of {largest:g} m; allowed: at most {MAX_MAGNITUDE:g} m")


def _surface(rows: Array, interpolation: Interpolation) -> "HeightGrid | _HeightNodes":
    """Return the surface through rows (x, y, height), (n, 3)."""
    return _HeightNodes(rows) if interpolation == "nodes" else HeightGrid(*_grid(rows), interpolation)


@final
@dataclass(frozen=True, eq=False)
class HeightGrid:
    """A surface that is interpolated between heights on a rectangular grid.

    Attributes
    ----------
    x, y : Array
        Coordinates of the grid, (nx,) and (ny,), increasing [m].
    heights : Array
        Heights, (nx, ny) [m], heights[i, j] at x[i], y[j].
    interpolation : {'linear', 'cubic'}
        Bilinear or bicubic interpolation.

    Raises
    ------
    ValueError
        If cubic interpolation has fewer than four points along a side, or if a number is beyond `MAX_MAGNITUDE`.
    """

    x: Array
    y: Array
    heights: Array
    interpolation: Interpolation = "linear"

    def __post_init__(self) -> None:
        _check_magnitudes(self.x, self.y, self.heights)
        if self.interpolation == "cubic" and min(self.heights.shape) < 4:
            raise ValueError(
                f"cubic interpolation needs 4 points along each side of the grid; it has {self.heights.shape}"
            )

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest point of the grid.

        Parameters
        ----------
        x, y : Array
            Coordinates, (n,) each [m].

        Returns
        -------
        Array
            Heights, (n,) >= 0 [m], inf outside the grid.
        """
        positions = np.asarray(x, float), np.asarray(y, float)
        heights = np.full(positions[0].shape, np.inf)
        covered = np.ones(heights.shape, bool)
        for axis, values in zip((self.x, self.y), positions, strict=True):
            # nodes on the border of the grid belong to it in spite of round-off
            margin = COORDINATE_TOLERANCE * np.ptp(axis)
            covered &= (values >= axis[0] - margin) & (values <= axis[-1] + margin)
        if not covered.any():
            return heights
        across, along = (
            np.clip(values[covered], axis[0], axis[-1])
            for axis, values in zip((self.x, self.y), positions, strict=True)
        )
        i, j = _nodes_at(self.x, across), _nodes_at(self.y, along)
        if i is None or j is None:
            heights[covered] = self._interpolate(across, along)
        else:
            heights[covered] = self.heights[i, j] - self._lowest
        return heights

    @cached_property
    def _lowest(self) -> float:
        return float(self.heights.min())

    @cached_property
    def _interpolant(self) -> Any:
        """Interpolant of the heights, made when a height between nodes is first evaluated."""
        if self.interpolation == "cubic":
            return scipy.interpolate.RectBivariateSpline(self.x, self.y, self.heights)
        return scipy.interpolate.RegularGridInterpolator((self.x, self.y), self.heights)

    def _interpolate(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest one at positions on the grid, (n,) [m]."""
        if self.interpolation == "cubic":
            return np.asarray(self._interpolant.ev(x, y)) - self._lowest
        return np.asarray(self._interpolant(np.stack([x, y], axis=-1))) - self._lowest


def _nodes_at(axis: Array, values: Array) -> Indices | None:
    """Return the number of the node at each of the values (n,), (n,); None if there is not one at every value."""
    tolerance = NODE_TOLERANCE * np.ptp(axis)
    numbers: Indices = np.minimum(np.searchsorted(axis, values - tolerance), len(axis) - 1)
    return numbers if (np.abs(axis[numbers] - values) <= tolerance).all() else None


@final
@dataclass(frozen=True, eq=False)
class _HeightNodes:
    """Heights at nodes that need not be on a grid: rows (x, y, height), (n, 3) [m]."""

    rows: Array

    def __post_init__(self) -> None:
        _check_magnitudes(self.rows)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height of the row at the same position above the lowest one, (n,) [m], inf where there is none."""
        extent = np.ptp(self.rows[:, :2], axis=0).max()
        distance, row = self._tree.query(np.stack([np.asarray(x, float), np.asarray(y, float)], axis=-1))
        above = self.rows[row, 2] - self.rows[:, 2].min()
        return np.where(distance <= COORDINATE_TOLERANCE * extent, above, np.inf)

    @cached_property
    def _tree(self) -> Any:
        return scipy.spatial.cKDTree(self.rows[:, :2])


def _grid(rows: Array) -> tuple[Array, Array, Array]:
    """Return axes (nx,) and (ny,), and heights (nx, ny), of rows that form a full rectangular grid."""
    (xs, i), (ys, j) = _axis(rows[:, 0]), _axis(rows[:, 1])
    grid = np.full((len(xs), len(ys)) if len(rows) == len(xs) * len(ys) else (0, 0), np.nan)
    if grid.size:
        grid[i, j] = rows[:, 2]
    if min(grid.shape) < 2 or np.isnan(grid).any():  # two rows at one node leave another one without
        raise ValueError(
            f"{len(rows)} rows with {len(xs)} distinct x and {len(ys)} distinct y do not form a full rectangular grid "
            "of at least 2 x 2 points (interpolation = 'nodes' accepts scattered points)"
        )
    return xs, ys, grid


def _axis(values: Array) -> tuple[Array, Indices]:
    """Return the distinct values in rising order, and the number of each value among them."""
    order = np.argsort(values)
    ordered = values[order]
    is_new = np.diff(ordered, prepend=-np.inf) > COORDINATE_TOLERANCE * np.ptp(values)
    number = np.empty(len(values), np.int64)
    number[order] = np.cumsum(is_new) - 1
    return ordered[is_new], number
