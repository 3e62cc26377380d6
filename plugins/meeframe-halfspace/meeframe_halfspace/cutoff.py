"""Cutoff radius of the near response, beyond which a coarser grid resolves it (meeframe_halfspace.two_grids)."""

from math import ceil, comb, log
from typing import Final

import numpy as np

from meeframe.plugin import Array
from meeframe_halfspace.cells import far_tables, unfolded
from meeframe_halfspace.response import PointResponse, mirrored
from meeframe_halfspace.transfer import N_BEFORE, N_POINTS, RATIO, WEIGHTS

MIN_CUTOFF: Final = 64
"""Smallest cutoff radius in the wider spacing, however smooth the response is."""
MAX_ERROR: Final = 5e-5
"""Largest relative error of the response to noise in any entry due to the coarser grid."""
MIN_GROWTH: Final = 1.1
"""Smallest factor by which a radius that is too small is increased."""
OUTER_RADIUS: Final = 1.5
"""Radius, relative to the cutoff, beyond which the rest is smooth."""
NEGLIGIBLE: Final = 1e-10
"""Couplings below this fraction of the largest response, in scaled fields, are round-off."""
_SMOOTHNESS: Final = 4
"""Number of continuous derivatives of `near_factor` at the node and at the cutoff."""


def near_factor(size: tuple[int, int], spacing: tuple[float, float], radius: float) -> Array:
    """Return the near fraction of the response, from one at the node to zero at the cutoff radius.

    Parameters
    ----------
    size, spacing
        Size (nx, ny) and spacing [m] of the grid.
    radius
        Cutoff radius [m].

    Returns
    -------
    Array
        Factor at the offsets of a table (cell_table), (nx, 2 ny - 1).
    """
    x, y = spacing[0] * np.arange(size[0]), spacing[1] * np.arange(1 - size[1], size[1])
    distance = np.minimum(np.hypot(x[:, None], y) / radius, 1.0)
    powers = [
        (-1) ** k * comb(_SMOOTHNESS + k, k) * comb(2 * _SMOOTHNESS + 1, _SMOOTHNESS - k)
        for k in range(_SMOOTHNESS + 1)
    ]
    return np.asarray(1.0 - distance ** (_SMOOTHNESS + 1) * np.polyval(powers[::-1], distance))


def cutoff_radius(response: PointResponse, spacing: tuple[float, float], limit: float) -> float:
    """Return the radius [m] beyond which every RATIO-th node along both axes resolves each entry of the response.

    The error of interpolation of the fifth degree finally decreases like the sixth power of the distance. The search
    ends at `limit` [m].
    """
    radius = MIN_CUTOFF * max(spacing)
    while radius <= limit and (error := _error(response, spacing, radius)) > MAX_ERROR:
        radius *= max(MIN_GROWTH, (error / MAX_ERROR) ** (1.0 / N_POINTS))
    return radius


def _error(response: PointResponse, spacing: tuple[float, float], radius: float) -> float:
    """Return the relative error of the response to noise due to restriction and interpolation, in the worst entry.

    It is computed on every second node, half of which are interpolated from the others.
    """
    nx, ny = (ceil(OUTER_RADIUS * radius / (2.0 * h)) for h in spacing)
    steps = 2.0 * spacing[0], 2.0 * spacing[1]
    x, y = (h * np.arange(1 - n, n) for h, n in zip(steps, (nx, ny), strict=True))
    distance = np.hypot(x[:, None], y) / radius
    ring = (distance > 0.5) & (distance < 1.0)
    near_share = (1.0 + log(MIN_CUTOFF)) / log(2.0)  # near response to noise relative to that of the ring
    far_factor = _mirrored(1.0 - near_factor((nx, ny), steps, radius), 1)
    errors = []
    for number, half in far_tables(response, spacing, "constant", (nx, ny), range(response.layout.n_values), 2):
        series, odd = response.entry(number)
        table = _mirrored(unfolded(half, mirrored(series)), -1 if odd else 1)
        far = table * far_factor
        errors.append(
            (_interpolation_error(far) + _interpolation_error(far.T), near_share * float((table[ring] ** 2).sum()))
        )
    threshold = NEGLIGIBLE**2 * max(total for _, total in errors)
    return float(np.sqrt(max(2.0 * squared_error / total for squared_error, total in errors if total > threshold)))


def _mirrored(table: Array, parity: int) -> Array:
    """Return a table (2 nx - 1, 2 ny - 1) from its half (nx, 2 ny - 1) with nonnegative first offsets."""
    return np.concatenate([parity * table[:0:-1, ::-1], table])


def _interpolation_error(table: Array) -> float:
    """Return the sum of squared errors of rows that are interpolated from their neighbours."""
    known, between = table[::2], table[1::2]
    count = len(known) - N_POINTS + 1
    interpolated = sum(weight * known[point : point + count] for point, weight in enumerate(WEIGHTS[RATIO // 2]))
    return float(((interpolated - between[N_BEFORE : N_BEFORE + count]) ** 2).sum())
