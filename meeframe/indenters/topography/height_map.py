"""Heights of a surface on a rectangular grid."""

from dataclasses import dataclass
from typing import Any, Final, Protocol, cast

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.indenters.base import Indenter

_SPACING_TOLERANCE: Final = 1e-6
"""Largest relative deviation of a spacing from the mean one on a regular grid."""


@dataclass(frozen=True, eq=False)
class HeightMap:
    """A surface, with peaks up.

    Attributes
    ----------
    x, y : Array
        Coordinates (nx,), (ny,), increasing [m].
    heights : Array
        Heights (nx, ny) [m], NaN where missing; entries that a masked array masks are missing.
    is_periodic : bool
        Whether the map is one period of an infinite surface, which is one spacing longer than its coordinates.

    Raises
    ------
    CaseError
        If these are no real numbers of these shapes, or if coordinates are not finite or do not increase.
    """

    x: Array
    y: Array
    heights: Array
    is_periodic: bool = False

    def __post_init__(self) -> None:
        for name in ("x", "y", "heights"):
            object.__setattr__(self, name, _numbers(name, getattr(self, name)))
        if self.x.ndim != 1 or self.y.ndim != 1 or self.heights.shape != (self.x.size, self.y.size):
            raise CaseError(
                f"height map: x, y and heights have the shapes {self.x.shape}, {self.y.shape} and "
                f"{self.heights.shape}; allowed: (nx,), (ny,) and (nx, ny), with rows of heights along x"
            )
        for name, axis in (("x", self.x), ("y", self.y)):
            if not np.isfinite(axis).all() or (np.diff(axis) <= 0.0).any():
                raise CaseError(f"height map: coordinates along {name}; allowed: finite numbers that increase")

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of points along x and y."""
        return len(self.x), len(self.y)

    @property
    def spacing(self) -> tuple[float, float]:
        """Spacings along x and y [m].

        Raises
        ------
        CaseError
            Unless each is the same everywhere.
        """
        steps = []
        for name, axis in (("x", self.x), ("y", self.y)):
            if len(axis) < 2:
                raise CaseError(f"height map: {len(axis)} point along {name}; allowed: 2 or more")
            differences = np.diff(axis)
            mean = float(np.ptp(axis)) / (len(axis) - 1)
            if np.abs(differences - mean).max() > _SPACING_TOLERANCE * mean:
                raise CaseError(
                    f"height map: spacings along {name} from {differences.min():g} to {differences.max():g} m; "
                    "allowed: equal spacings (resample the map)"
                )
            steps.append(mean)
        return steps[0], steps[1]

    @property
    def size(self) -> tuple[float, float]:
        """Lengths along x and y that the points stand for [m]: numbers of points times spacings."""
        (nx, ny), (dx, dy) = self.shape, self.spacing
        return nx * dx, ny * dy

    @property
    def rms_height(self) -> float:
        """Root mean square height relative to the mean [m]."""
        return float(np.nanstd(self.heights))

    @property
    def rms_slope(self) -> float:
        """Root mean square of the modulus of the gradient, from differences of neighbours."""
        return float(np.sqrt(sum(np.nanmean(slope**2) for slope in self.slopes())))

    def slopes(self, steps: int = 1) -> tuple[Array, Array]:
        """Return the slopes along x and along y between points that are some steps apart.

        Parameters
        ----------
        steps : int, optional
            Number of spacings between the points.

        Returns
        -------
        tuple of Array
            Slopes between all such points; across the border of the period too if the map is periodic.
        """
        slopes = []
        for axis, (coordinates, step) in enumerate(zip((self.x, self.y), self._mean_spacings, strict=True)):
            if self.is_periodic:
                slopes.append((np.roll(self.heights, -steps, axis) - self.heights) / (steps * step))
                continue
            heights = np.moveaxis(self.heights, axis, 0)
            distances = (coordinates[steps:] - coordinates[:-steps])[:, None]
            slopes.append(np.moveaxis((heights[steps:] - heights[:-steps]) / distances, 0, axis))
        return slopes[0], slopes[1]

    @property
    def _mean_spacings(self) -> tuple[float, float]:
        """Return the spacings of a periodic map; of others, whose spacings may vary, their means."""
        if self.is_periodic:
            return self.spacing
        return float(np.ptp(self.x)) / (len(self.x) - 1), float(np.ptp(self.y)) / (len(self.y) - 1)


def _numbers(name: str, values: Any) -> Array:
    """Return values as floats, the array itself where it has them, with NaN for masked ones."""
    try:
        array = np.ma.asarray(values) if np.ma.isMaskedArray(values) else np.asarray(values)
    except ValueError as error:  # rows of unequal length
        raise CaseError(f"height map: {name}: {error}") from None
    if array.dtype.kind not in "fiu":
        raise CaseError(f"height map: {name}: an array of {array.dtype}; allowed: real numbers")
    array = array.astype(float, copy=False)
    return array.filled(np.nan) if isinstance(array, np.ma.MaskedArray) else array


class SampledSurface(Protocol):
    """An indenter that knows its heights on a grid, an optional method of indenters.

    Those that make their heights may have a property `grid_shape`, the numbers of points before they are made.
    """

    def topography(self) -> HeightMap:
        """Return the surface on its grid, peaks up as they touch first."""


def topography_of(indenter: Indenter) -> HeightMap | None:
    """Return the height map of an indenter, None if it has none.

    Parameters
    ----------
    indenter : Indenter
        Any indenter.

    Returns
    -------
    HeightMap or None
        The surface, peaks up.
    """
    return cast(SampledSurface, indenter).topography() if has_topography(indenter) else None


def has_topography(indenter: Indenter) -> bool:
    """Return whether an indenter is a rough surface with a height map."""
    return hasattr(indenter, "topography")
