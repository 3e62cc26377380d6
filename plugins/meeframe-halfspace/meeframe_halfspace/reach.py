"""Cut-off radius beyond which a response is smooth enough for a coarser grid (meeframe_halfspace.two_grids)."""

from math import ceil, comb, log
from typing import Final

import numpy as np

from meeframe.plugin import Array
from meeframe_halfspace.cells import far_tables, unfolded
from meeframe_halfspace.response import PointResponse, mirrored
from meeframe_halfspace.transfer import BEFORE, HOP, TAPS, WEIGHTS

LEAST: Final = 64
"""In the wider spacings: nearer than that no response is cut, however smooth it is."""
LOST: Final = 5e-5
"""Of the response to noise in any entry: what the coarser grid may make of it, at most."""
GROWTH: Final = 1.1
"""Of a reach that is too small, at least."""
FARTHEST: Final = 1.5
"""Times the reach: farther off, the rest is smooth."""
WEAK: Final = 1e-10
"""Of the largest response, in scaled fields: couplings that are round-off."""
_SMOOTH: Final = 4
"""Derivatives of `nearness` without a jump, at the node and where it is zero."""


def nearness(size: tuple[int, int], spacing: tuple[float, float], reach: float) -> Array:
    """Share of the response that is near, from one at the node to zero at the reach [m]: at the offsets
    (nx, 2 ny - 1) of a table (cell_table)."""
    along, across = spacing[0] * np.arange(size[0]), spacing[1] * np.arange(1 - size[1], size[1])
    far = np.minimum(np.hypot(along[:, None], across) / reach, 1.0)
    powers = [(-1) ** k * comb(_SMOOTH + k, k) * comb(2 * _SMOOTH + 1, _SMOOTH - k) for k in range(_SMOOTH + 1)]
    return np.asarray(1.0 - far ** (_SMOOTH + 1) * np.polyval(powers[::-1], far))


def reach(response: PointResponse, spacing: tuple[float, float], most: float) -> float:
    """Distance [m] within which a response is near: of every entry, each HOP-th node along both axes tells the rest.

    What interpolation of the fifth degree misses falls like the sixth power of the distance, in the end. It is not
    looked for beyond most [m].
    """
    found = LEAST * max(spacing)
    while found <= most and (lost := _lost(response, spacing, found)) > LOST:
        found *= max(GROWTH, (lost / LOST) ** (1.0 / TAPS))
    return found


def _lost(response: PointResponse, spacing: tuple[float, float], reach: float) -> float:
    """What gathering and interpolation make of the response to noise, in parts of it, in the worst entry.

    Found on every second node, half of which tell the others.
    """
    nx, ny = (ceil(FARTHEST * reach / (2.0 * h)) for h in spacing)
    steps = 2.0 * spacing[0], 2.0 * spacing[1]
    x, y = (h * np.arange(1 - n, n) for h, n in zip(steps, (nx, ny), strict=True))
    distance = np.hypot(x[:, None], y) / reach
    ring = (distance > 0.5) & (distance < 1.0)
    around = (1.0 + log(LEAST)) / log(2.0)  # all of the near response to noise, in parts of that of the ring
    farness = _mirrored(1.0 - nearness((nx, ny), steps, reach), 1)
    found = []
    for number, part in far_tables(response, spacing, "constant", (nx, ny), range(response.layout.n_values), 2):
        series, odd = response.entry(number)
        table = _mirrored(unfolded(part, mirrored(series)), -1 if odd else 1)
        far = table * farness
        found.append((_missed(far) + _missed(far.T), around * float((table[ring] ** 2).sum())))
    told = WEAK**2 * max(whole for _, whole in found)
    return float(np.sqrt(max(2.0 * missed / whole for missed, whole in found if whole > told)))


def _mirrored(table: Array, parity: int) -> Array:
    """A table (2 nx - 1, 2 ny - 1) of its half (nx, 2 ny - 1) that is not before the node."""
    return np.concatenate([parity * table[:0:-1, ::-1], table])


def _missed(table: Array) -> float:
    """Sum of squares of what rows between others differ by from their interpolation."""
    known, between = table[::2], table[1::2]
    count = len(known) - TAPS + 1
    found = sum(weight * known[tap : tap + count] for tap, weight in enumerate(WEIGHTS[HOP // 2]))
    return float(((found - between[BEFORE : BEFORE + count]) ** 2).sum())
