"""Preparation of height maps: trends, missing heights, outliers, resampling and windows."""

from collections.abc import Sequence
from dataclasses import replace
from numbers import Integral, Real
from typing import Any, Final, Literal

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.indenters.topography.height_map import HeightMap

Trend = Literal["mean", "plane", "quadratic"]
Filling = Literal["nearest", "harmonic"]
_DEGREES: Final = {"mean": 0, "plane": 1, "quadratic": 2}
_NEIGHBOURHOOD: Final = 5
"""Number of points along each side of the neighbourhood that outliers are compared with."""
_ROUND_OFF: Final = 1e-13
"""Deviation due to round-off, relative to the largest height."""
_NORMAL_DEVIATION: Final = 1.4826
"""Standard deviation over median absolute deviation of a normal distribution."""


def detrend(surface: HeightMap, trend: Trend = "plane") -> HeightMap:
    """Return the map without its best-fit polynomial; missing heights do not affect the fit.

    Parameters
    ----------
    surface : HeightMap
        The map.
    trend : {'mean', 'plane', 'quadratic'}, optional
        Polynomials of degree 0, 1 or 2 in x and y.

    Returns
    -------
    HeightMap
        The map minus the polynomial of least squares.

    Raises
    ------
    CaseError
        For an unknown trend, or fewer known heights than coefficients.
    """
    if trend not in _DEGREES:
        raise CaseError(f"detrend: trend = {trend!r}; allowed: {', '.join(_DEGREES)}")
    degree = _DEGREES[trend]
    x, y = ((axis - axis.mean()) / max(float(np.ptp(axis)), np.finfo(float).tiny) for axis in (surface.x, surface.y))
    x, y = (grid.ravel() for grid in np.meshgrid(x, y, indexing="ij"))
    powers = [(i, total - i) for total in range(degree + 1) for i in range(total, -1, -1)]
    basis = np.column_stack([x**i * y**j for i, j in powers])
    z = surface.heights.ravel()
    known = np.isfinite(z)
    if known.sum() < len(powers):
        raise CaseError(f"detrend: {known.sum()} known heights; allowed: at least {len(powers)} for a {trend}")
    polynomial = basis @ np.linalg.lstsq(basis[known], z[known])[0]
    return replace(surface, heights=(z - polynomial).reshape(surface.heights.shape))


def fill_missing(surface: HeightMap, filling: Filling = "nearest") -> HeightMap:
    """Return the map with its missing heights filled.

    Parameters
    ----------
    surface : HeightMap
        The map.
    filling : {'nearest', 'harmonic'}, optional
        The height of the nearest known point, or the solution of Laplace's equation with the known heights around.

    Returns
    -------
    HeightMap
        The full map.

    Raises
    ------
    CaseError
        For an unknown filling, or if no height is known.
    """
    if filling not in ("nearest", "harmonic"):
        raise CaseError(f"fill_missing: filling = {filling!r}; allowed: nearest, harmonic")
    missing = ~np.isfinite(surface.heights)
    if not missing.any():
        return surface
    if missing.all():
        raise CaseError("fill_missing: no height of the map is known; allowed: maps with known heights")
    if filling == "harmonic":
        return replace(surface, heights=_harmonic(surface, missing))
    nearest = scipy.ndimage.distance_transform_edt(
        missing, sampling=surface.spacing, return_distances=False, return_indices=True
    )
    return replace(surface, heights=surface.heights[tuple(nearest)])


def _harmonic(surface: HeightMap, missing: Array) -> Array:
    """Return the heights with the discrete Laplacian zero where they are missing."""
    numbers = np.full(missing.shape, -1)
    numbers[missing] = np.arange(missing.sum())
    rows, columns, values = [], [], []
    diagonal, right = np.zeros(missing.sum()), np.zeros(missing.sum())
    for axis, step in enumerate(surface.spacing):
        weight = step**-2
        for shift in (-1, 1):
            there = np.roll(np.arange(missing.shape[axis]), shift)
            inside = np.ones(missing.shape[axis], bool)
            if not surface.is_periodic:
                inside[0 if shift == 1 else -1] = False  # no neighbour beyond the border
            neighbours, heights = np.take(numbers, there, axis), np.take(surface.heights, there, axis)
            use = missing & np.moveaxis(np.broadcast_to(inside, np.moveaxis(missing, axis, -1).shape), -1, axis)
            np.add.at(diagonal, numbers[use], weight)
            coupled = use & (neighbours >= 0)
            known = use & (neighbours < 0)
            rows.append(numbers[coupled])
            columns.append(neighbours[coupled])
            values.append(np.full(coupled.sum(), -weight))
            np.add.at(right, numbers[known], weight * heights[known])
    count = len(diagonal)
    indices = np.concatenate([*rows, np.arange(count)]), np.concatenate([*columns, np.arange(count)])
    matrix = scipy.sparse.csc_matrix((np.concatenate([*values, diagonal]), indices), (count, count))
    filled = surface.heights.copy()
    filled[missing] = scipy.sparse.linalg.spsolve(matrix, right)
    return filled


def remove_outliers(surface: HeightMap, limit: float) -> HeightMap:
    """Return the map without heights that deviate too much from those around them.

    A height is compared with the median of the means of opposite points in its neighbourhood of 5 x 5 points. Inside
    the map, single outliers are found, and clusters of up to five points. Of larger clusters a part remains, and good
    points around them are removed.

    Parameters
    ----------
    surface : HeightMap
        The map.
    limit : float
        Largest deviation, in standard deviations of these deviations. The standard deviation is estimated from their
        median modulus, which outliers hardly affect.

    Returns
    -------
    HeightMap
        The map with outliers missing.

    Raises
    ------
    CaseError
        Unless the limit is a positive number.
    """
    if not isinstance(limit, Real) or not limit > 0.0:
        raise CaseError(f"remove_outliers: limit = {limit!r}; allowed: numbers > 0")
    full = fill_missing(surface).heights
    deviation = np.abs(full - _expected(full, surface.is_periodic))
    round_off = _ROUND_OFF * float(np.abs(full).max())
    spread = float(np.median(deviation[np.isfinite(surface.heights)]))
    allowed = max(limit * _NORMAL_DEVIATION * spread, round_off)
    return replace(surface, heights=np.where(deviation > allowed, np.nan, surface.heights))


def _expected(heights: Array, is_periodic: bool) -> Array:
    """Return the median of the means of opposite neighbours, (nx, ny); on a tilted plane these are the heights."""
    width = _NEIGHBOURHOOD // 2
    # an odd reflection continues a plane beyond the border
    padded = np.pad(heights, width, "wrap") if is_periodic else np.pad(heights, width, "reflect", reflect_type="odd")
    nx, ny = heights.shape

    def shifted(i: int, j: int) -> Array:
        return padded[width + i : width + i + nx, width + j : width + j + ny]

    offsets = [(i, j) for i in range(width + 1) for j in range(-width, width + 1) if (i, j) > (0, 0)]
    return np.asarray(np.median([(shifted(i, j) + shifted(-i, -j)) / 2.0 for i, j in offsets], axis=0))


def resample(surface: HeightMap, shape: tuple[int, int]) -> HeightMap:
    """Return the map at other numbers of points.

    Parameters
    ----------
    surface : HeightMap
        A full map.
    shape : tuple of int
        Numbers of points along x and y.

    Returns
    -------
    HeightMap
        The map: by its Fourier series if it is periodic, where waves shorter than two spacings are removed, and by
        cubic splines from border to border along axes with more points if not. Along axes with fewer points it is
        averaged over the cell of each new point, which ends halfway to the next one; heights at the border stay. The
        averages damp waves shorter than two new spacings, which would appear as longer ones.

    Raises
    ------
    CaseError
        If a height is missing, unless the shape is two integers from 2, or for too few points of a spline.
    """
    check_full(surface, "resample")
    counts = shape if isinstance(shape, Sequence) and len(shape) == 2 else ()
    if not counts or not all(isinstance(count, Integral) and count >= 2 for count in counts):
        raise CaseError(f"resample: shape = {shape!r}; allowed: two integers from 2, such as (64, 64)")
    if surface.is_periodic:
        heights = surface.heights
        for axis, count in enumerate(shape):
            heights = _resample_waves(heights, count, axis)
        (x, y), (lx, ly) = (surface.x[0], surface.y[0]), surface.size
        return HeightMap(
            x + lx / shape[0] * np.arange(shape[0]), y + ly / shape[1] * np.arange(shape[1]), heights, True
        )
    if min(surface.shape) < 4:
        raise CaseError(f"resample: {surface.shape} points; allowed: at least 4 along each side of a spline")
    heights = surface.heights
    for axis, count in enumerate(shape):
        if count < heights.shape[axis]:
            means = _cell_means(heights.shape[axis], count)
            heights = means @ heights if axis == 0 else (means @ heights.T).T
    x, y = (np.linspace(axis[0], axis[-1], count) for axis, count in zip((surface.x, surface.y), shape, strict=True))
    for axis, (old, new) in enumerate(((surface.x, x), (surface.y, y))):
        if len(new) > len(old):
            heights = scipy.interpolate.make_interp_spline(old, heights, axis=axis)(new)
    return HeightMap(x, y, np.ascontiguousarray(heights))


def _cell_means(old: int, new: int) -> Any:
    """Return the sparse matrix (new, old) of means over the cells of fewer points between the same ends.

    Cells end halfway to the next points, heights are linear between the old ones. The ends stay as they are.
    """
    width = (old - 1) / (new - 1)
    edges = width * (np.arange(1, new) - 0.5)
    cuts = np.union1d(edges, np.arange(np.ceil(edges[0]), edges[-1]))
    middles, lengths = (cuts[1:] + cuts[:-1]) / 2.0, np.diff(cuts) / width
    cells, left = np.searchsorted(edges, middles), np.floor(middles).astype(int)
    share = middles - left
    values = np.concatenate([[1.0, 1.0], lengths * (1.0 - share), lengths * share])
    rows, columns = np.concatenate([[0, new - 1], cells, cells]), np.concatenate([[0, old - 1], left, left + 1])
    return scipy.sparse.csr_array((values, (rows, columns)), (new, old))


def _resample_waves(heights: Array, count: int, axis: int) -> Array:
    """Return periodic heights at `count` points along an axis, the first of which stays."""
    old = heights.shape[axis]
    waves = np.moveaxis(np.fft.rfft(heights, axis=axis, norm="forward"), axis, 0)
    common = min(old, count)
    result = np.zeros((count // 2 + 1, *waves.shape[1:]), complex)
    result[: (common + 1) // 2] = waves[: (common + 1) // 2]
    if common % 2 == 0 and old != count:
        # the shortest wave of an even number of points stands for a pair of waves where there are more points
        middle = common // 2
        result[middle] = waves[middle] / 2.0 if count > old else 2.0 * waves[middle].real
    elif common % 2 == 0:
        result[common // 2] = waves[common // 2]
    return np.asarray(np.fft.irfft(np.moveaxis(result, 0, axis), count, axis=axis, norm="forward"))


def window(surface: HeightMap) -> Array:
    """Return the Hann window of a map, whose mean square is one, so that it preserves the mean square of noise.

    Parameters
    ----------
    surface : HeightMap
        The map.

    Returns
    -------
    Array
        Factors on the heights, (nx, ny); one everywhere if the map is periodic.
    """
    if surface.is_periodic:
        return np.ones(surface.shape)
    # without its zeros at both ends, which would waste two points
    sides = [np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2 for count in surface.shape]
    product = np.multiply.outer(*sides)
    return np.asarray(product / np.sqrt(np.mean(product**2)))


def check_full(surface: HeightMap, what: str) -> None:
    """Raise CaseError if a height of a map is missing; what: the operation that needs all."""
    missing = int((~np.isfinite(surface.heights)).sum())
    if missing:
        raise CaseError(
            f"{what}: {missing} of {surface.heights.size} heights are missing; allowed: a full map (fill_missing)"
        )
