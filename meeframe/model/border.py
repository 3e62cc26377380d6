"""Where a contact zone ends and its contact would go on."""

from collections.abc import Callable
from typing import Final

import numpy as np

from meeframe.fields import Array, Indices
from meeframe.mesh.measures import corners
from meeframe.results.records import StepResult, Zone

_BESIDE: Final = 1e-3
"""Of the way from the middle of an element to its side: so far beyond the side it is looked for the indenter."""
_FLAT: Final = 1e-6
"""Overlaps that differ by a smaller fraction are the same."""


def border_sides(zone: Zone) -> tuple[Indices, Array]:
    """Corners (m, 2) of the sides that belong to one cell only, and the ways (m, 3) there from the middle of it [m]."""
    sides, ways = [np.zeros((0, 2), np.int64)], [np.zeros((0, 3))]
    for outline in corners(zone.cells):
        pairs = np.stack([outline, np.roll(outline, -1, axis=1)], axis=-1)
        middles = zone.points[outline].mean(axis=1)[:, None]
        sides.append(pairs.reshape(-1, 2))
        ways.append((zone.points[pairs].mean(axis=2) - middles).reshape(-1, 3))
    joined, away = np.concatenate(sides), np.concatenate(ways)
    one, other = np.sort(joined, axis=1).T
    _, first, counts = np.unique(one * len(zone.points) + other, return_index=True, return_counts=True)
    border = first[counts == 1]
    return joined[border], away[border]


def open_sides(zone: Zone, gaps: Callable[[Array, Array], Array] | None) -> Indices:
    """Corners (m, 2) of the sides at the border of a zone beyond which the indenter goes on.

    gaps: gives the gap at points (k, 3) with frames (k, 3, 3), inf where the indenter has ended; None if nobody knows.
    """
    sides, away = border_sides(zone)
    if gaps is None or not len(sides):
        return sides
    beyond = zone.points[sides].mean(axis=1) + _BESIDE * away
    on: Indices = sides[np.isfinite(gaps(beyond, zone.frames[sides[:, 0]]))]
    return on


def sides_reached(step: StepResult, sides: Indices) -> int:
    """How many of these sides (m, 2) the contact has reached; none where full contact is meant, by the same gap
    all over the zone."""
    count = int(step.touching[sides].all(axis=1).sum())
    return 0 if count and overlaps_evenly(step.initial_gap) else count


def overlaps_evenly(gap: Array) -> bool:
    """Whether the overlap is the same at all nodes, gap (n,) [m], as where full contact is meant."""
    return bool(np.ptp(gap) <= _FLAT * -gap.min())
