"""Indenters from measured surfaces."""

import os
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, final

import numpy as np

from meeframe.plugin import (
    Array,
    CaseError,
    HeightGrid,
    HeightMap,
    Indenter,
    Quantity,
    check_quantities,
    checked_arguments,
    detrend,
    fill_missing,
    remove_outliers,
)
from meeframe_halfspace.height_files import Scales, read_height_map

Length = Annotated[float, Quantity("m", gt=0, lt=float("inf"))]


@final
@checked_arguments
@dataclass(frozen=True)
class MeasuredHeights(Indenter):
    """A rigid rough surface from a height map; see read_height_map for the file formats.

    There is no surface beyond the map.

    Attributes
    ----------
    file : Path
        File of the height map.
    unit : float or None
        Metres per unit of heights; by default that of the file, or metres.
    lateral_unit : float
        Metres per unit of coordinates.
    spacing : tuple of float or None
        Spacing of a matrix along x and y, overriding that of the file.
    dataset : str or None
        Path of the dataset in an HDF5 file, or name of the channel of an instrument.
    facing : {'up', 'down'}
        'up' as measured, so that peaks touch first, or 'down' as the height of an indenter.
    levelled : bool or {'plane', 'quadratic'}
        Whether the best-fit plane is subtracted (true or 'plane'), or the best-fit paraboloid ('quadratic').
    centred : bool
        Whether the middle of the map is on the axis of the indenter; otherwise its coordinates apply.
    outliers : float or None
        Largest deviation from the heights around, in standard deviations; heights that deviate more count as missing.
    missing : {'error', 'nearest', 'harmonic'}
        Whether missing heights are an error, or replaced by those of the nearest neighbours, or by the harmonic surface
        through their neighbours.
    interpolation : {'linear', 'cubic'}
        Bilinear or bicubic interpolation.
    """

    file: Path
    unit: Length | None = None
    lateral_unit: Length = 1.0
    spacing: tuple[Length, Length] | None = None
    dataset: str | None = None
    facing: Literal["up", "down"] = "up"
    levelled: bool | Literal["plane", "quadratic"] = False
    centred: bool = True
    outliers: Annotated[float, Quantity("", gt=0)] | None = None
    missing: Literal["error", "nearest", "harmonic"] = "error"
    interpolation: Literal["linear", "cubic"] = "linear"

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest one of the map.

        Parameters
        ----------
        x, y : Array
            Coordinates from the axis of the indenter, (n,) each [m].

        Returns
        -------
        Array
            Heights, (n,) >= 0 [m], inf beyond the map.

        Raises
        ------
        CaseError
            If the file cannot be read; the message names it.
        """
        # bicubic patches can undershoot the lowest height
        return np.maximum(_sample(self, _modification_time(self.file)).height(x, y), 0.0)

    def topography(self) -> HeightMap:
        """Return the prepared map, peaks up as they touch first.

        Returns
        -------
        HeightMap
            The map [m].

        Raises
        ------
        CaseError
            As `height`.
        """
        surface = _prepared(self, _modification_time(self.file))
        return surface if self.facing == "up" else replace(surface, heights=-surface.heights)


def _modification_time(file: Path) -> int:
    try:
        return os.stat(file).st_mtime_ns
    except (OSError, ValueError) as error:  # ValueError for a path with the character NUL
        reason = getattr(error, "strerror", None) or error
        raise CaseError(f"height map {file}: cannot be read: {reason}") from None


@lru_cache(maxsize=2)
def _prepared(indenter: MeasuredHeights, _modification_time: int) -> HeightMap:
    """Return the full and levelled map, as measured, cached until the file changes."""
    scales = Scales(indenter.unit, indenter.lateral_unit, indenter.spacing, indenter.dataset)
    surface = read_height_map(indenter.file, scales)
    try:
        if indenter.outliers is not None:
            surface = remove_outliers(surface, indenter.outliers)
        missing = ~np.isfinite(surface.heights)
        if missing.any() and (indenter.missing == "error" or missing.all()):
            raise CaseError(
                f"{int(missing.sum())} of {missing.size} heights are missing; allowed: a full map, or missing = "
                "'nearest' or 'harmonic' to replace them by their neighbours"
            )
        if indenter.levelled:
            # missing heights do not affect the fit
            surface = detrend(surface, "quadratic" if indenter.levelled == "quadratic" else "plane")
        return fill_missing(surface, indenter.missing) if indenter.missing != "error" else surface
    except CaseError as error:
        raise CaseError(f"height map {indenter.file}: {error}") from None


@lru_cache(maxsize=2)
def _sample(indenter: MeasuredHeights, modification_time: int) -> HeightGrid:
    """Return the surface of the indenter, cached until the file changes."""
    surface = _prepared(indenter, modification_time)
    x, y = surface.x, surface.y
    if indenter.centred:
        x, y = x - (x[0] + x[-1]) / 2, y - (y[0] + y[-1]) / 2
    heights = surface.heights if indenter.facing == "down" else -surface.heights
    try:
        return HeightGrid(x, y, heights, indenter.interpolation)
    except ValueError as error:
        raise CaseError(f"height map {indenter.file}: {error}") from None
