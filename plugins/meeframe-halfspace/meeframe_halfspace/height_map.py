"""Indenters from measured surfaces."""

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, final

import numpy as np
import scipy  # its parts load where they are used
from numpy.typing import NDArray

from meeframe.plugin import Array, CaseError, Indenter, Quantity, SampledHeights, check_quantities
from meeframe_halfspace.height_files import HeightMap, Scales, read_height_map

Length = Annotated[float, Quantity("m", gt=0, lt=float("inf"))]


@final
@dataclass(frozen=True)
class MeasuredHeights(Indenter):
    """A rigid rough surface from a height map: see read_height_map for the files that are understood.

    unit, lateral_unit: metres in the file's unit of heights (by default what the file says, or metres) and of
    coordinates; spacing: of a matrix along x and y, whatever the file says;
    dataset: in an HDF5 file. facing: 'up' as measured, so that peaks touch first, or 'down' as an indenter's height.
    levelled: take away the best plane. centred: the middle of the map on the indenter's axis; otherwise where its
    coordinates say. missing: heights that the file marks as missing are an error, or those of the nearest neighbour.
    interpolation: bilinear or bicubic; beyond the map there is no surface.
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
        """Height above the lowest given one, (n,) [m], inf beyond the map. Raises CaseError, naming the file."""
        # bicubic patches may swing below the lowest height
        return np.maximum(_sampled(self, _changed(self.file)).height(x, y), 0.0)


def _changed(file: Path) -> int:
    try:
        return os.stat(file).st_mtime_ns
    except OSError as error:
        raise CaseError(f"height map {file}: cannot be read: {error.strerror or error}") from None


@lru_cache(maxsize=2)
def _sampled(given: MeasuredHeights, _changed: int) -> SampledHeights:
    """The map as an indenter, kept until the file changes."""
    scales = Scales(given.unit, given.lateral_unit, given.spacing, given.dataset)
    surface = read_height_map(given.file, scales)
    gaps = ~np.isfinite(surface.heights)
    if gaps.any() and (given.missing == "error" or gaps.all()):
        raise CaseError(
            f"height map {given.file}: {int(gaps.sum())} of {gaps.size} heights are missing; allowed: a full map, or "
            "missing = 'nearest' to take those of the nearest neighbours"
        )
    if given.levelled:
        surface = surface.levelled()  # by the measured heights alone
    surface = _filled(surface, gaps)
    x, y = surface.x, surface.y
    if given.centred:
        x, y = x - (x[0] + x[-1]) / 2, y - (y[0] + y[-1]) / 2
    heights = surface.heights if given.facing == "down" else -surface.heights
    grid = np.meshgrid(x, y, indexing="ij")
    return SampledHeights(np.column_stack([grid[0].ravel(), grid[1].ravel(), heights.ravel()]), given.interpolation)


def _filled(surface: HeightMap, gaps: NDArray[np.bool_]) -> HeightMap:
    if not gaps.any():
        return surface
    nearest = scipy.ndimage.distance_transform_edt(gaps, return_distances=False, return_indices=True)
    return HeightMap(surface.x, surface.y, surface.heights[tuple(nearest)])
