"""Indenters from measured surfaces."""

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, final

import numpy as np
import scipy  # submodules are loaded on first use
from numpy.typing import NDArray

from meeframe.plugin import Array, CaseError, HeightGrid, Indenter, Quantity, check_quantities
from meeframe_halfspace.height_files import HeightMap, Scales, read_height_map

Length = Annotated[float, Quantity("m", gt=0, lt=float("inf"))]


@final
@dataclass(frozen=True)
class MeasuredHeights(Indenter):
    """A rigid rough surface from a height map; see read_height_map for the file formats.

    There is no surface beyond the map.

    Attributes
    ----------
    file
        File of the height map.
    unit, lateral_unit
        Metres per unit of heights (by default that of the file, or metres) and of coordinates.
    spacing
        Spacing of a matrix along x and y, overriding that of the file.
    dataset
        Path of the dataset in an HDF5 file.
    facing
        'up' as measured, so that peaks touch first, or 'down' as the height of an indenter.
    levelled
        Whether the best-fit plane is subtracted.
    centred
        Whether the middle of the map is on the axis of the indenter; otherwise its coordinates apply.
    missing
        Whether missing heights are an error or replaced by those of the nearest neighbours.
    interpolation
        Bilinear or bicubic interpolation.
    """

    file: Path
    unit: Length | None = None
    lateral_unit: Length = 1.0
    spacing: tuple[Length, Length] | None = None
    dataset: str | None = None
    facing: Literal["up", "down"] = "up"
    levelled: bool = False
    centred: bool = True
    missing: Literal["error", "nearest"] = "error"
    interpolation: Literal["linear", "cubic"] = "linear"

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest one of the map, (n,) [m], inf beyond the map.

        Raises
        ------
        CaseError
            If the file cannot be read; the message names it.
        """
        # bicubic patches can undershoot the lowest height
        return np.maximum(_sample(self, _modification_time(self.file)).height(x, y), 0.0)


def _modification_time(file: Path) -> int:
    try:
        return os.stat(file).st_mtime_ns
    except OSError as error:
        raise CaseError(f"height map {file}: cannot be read: {error.strerror or error}") from None


@lru_cache(maxsize=2)
def _sample(indenter: MeasuredHeights, _modification_time: int) -> HeightGrid:
    """Return the map, cached until the file changes."""
    scales = Scales(indenter.unit, indenter.lateral_unit, indenter.spacing, indenter.dataset)
    surface = read_height_map(indenter.file, scales)
    missing = ~np.isfinite(surface.heights)
    if missing.any() and (indenter.missing == "error" or missing.all()):
        raise CaseError(
            f"height map {indenter.file}: {int(missing.sum())} of {missing.size} heights are missing; allowed: a full "
            "map, or missing = 'nearest' for those of the nearest neighbours"
        )
    if indenter.levelled:
        surface = surface.levelled()  # missing heights do not affect the plane
    surface = _fill(surface, missing)
    x, y = surface.x, surface.y
    if indenter.centred:
        x, y = x - (x[0] + x[-1]) / 2, y - (y[0] + y[-1]) / 2
    heights = surface.heights if indenter.facing == "down" else -surface.heights
    try:
        return HeightGrid(x, y, heights, indenter.interpolation)
    except ValueError as error:
        raise CaseError(f"height map {indenter.file}: {error}") from None


def _fill(surface: HeightMap, missing: NDArray[np.bool_]) -> HeightMap:
    if not missing.any():
        return surface
    nearest = scipy.ndimage.distance_transform_edt(missing, return_distances=False, return_indices=True)
    return HeightMap(surface.x, surface.y, surface.heights[tuple(nearest)])
