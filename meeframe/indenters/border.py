"""Border of an indenter: the distance from it of points of the contact zone, found by evaluating gaps."""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from meeframe.fields import Array, Indices
from meeframe.mesh.measures import corners
from meeframe.system.capabilities import IndenterEdge

Gaps = Callable[[Array, Array], Array]
"""Gap (m,) [m] along the normals at points (m, 3) with frames (m, 3, 3), inf where there is no indenter above."""

FIRST_LOOK: Final = 16
"""Directions in which it is first asked whether the indenter ends within reach."""
DIRECTIONS: Final = 64
"""In which the rim is looked for: the nearest of them is at most 0.12 per cent farther than the rim."""
HALVINGS: Final = 32
CLEARLY: Final = 1e-9
"""Of the reach: so far under the indenter a point belongs to it."""


def find_indenter_edge(gaps: Gaps, points: Array, frames: Array, reach: float) -> IndenterEdge | None:
    """Return where the indenter ends, up to a distance [m] from points (n, 3) with frames (n, 3, 3); None if nowhere
    near.

    The gap beside the indenter is that of the rim, continued straight on from as far under the indenter.
    """
    under = np.isfinite(gaps(points, frames))
    looks = [np.isfinite(gaps(points + reach * ray, frames)) != under for ray in _rays(frames, FIRST_LOOK)]
    near = np.flatnonzero(np.any(looks, axis=0))
    if not near.size:
        return None
    here, axes, inside = points[near], frames[near], under[near]
    lengths = _crossings(gaps, here, axes, _rays(axes, DIRECTIONS), reach)
    nearest = lengths.argmin(axis=0)
    found = lengths.min(axis=0)
    away = _circle(DIRECTIONS)[nearest]
    distance = np.where(under, np.inf, -np.inf)
    distance[near] = np.where(inside, found, -found)
    outward = np.zeros((len(points), 2))
    outward[near] = np.where(inside[:, None], away, -away)
    gap = np.full(len(points), np.inf)
    into = np.einsum("na,nai->ni", away, axes[:, :2]) * (found + CLEARLY * reach)[:, None]
    once, twice = gaps(here + into, axes), gaps(here + 2.0 * into, axes)
    straight = np.where(np.isfinite(twice), 2.0 * once - np.where(np.isfinite(twice), twice, 0.0), once)
    gap[near] = np.where(inside | ~np.isfinite(once), np.inf, straight)
    return IndenterEdge(distance, outward, gap)


def longest_side(points: Array, cells: Sequence[tuple[str, Indices]]) -> float:
    """Return the longest side [m], from corner to corner, of cells of points (n, 3): pairs (meshio cell type,
    connectivity)."""
    outlines = (points[numbers] for numbers in corners(cells))
    sides = (np.linalg.norm(outline - np.roll(outline, 1, axis=1), axis=2) for outline in outlines)
    return float(max((lengths.max(initial=0.0) for lengths in sides), default=0.0))


def _circle(count: int) -> Array:
    """Return the unit vectors (count, 2) around the circle."""
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _rays(frames: Array, count: int) -> Array:
    """Return the unit vectors (count, n, 3) around each normal."""
    rays: Array = np.einsum("ka,nai->kni", _circle(count), frames[:, :2])
    return rays


def _crossings(gaps: Gaps, points: Array, frames: Array, rays: Array, reach: float) -> Array:
    """Return how far along rays (k, n, 3) the indenter ends, or begins, (k, n), inf if not within reach: by halving."""
    directions, n = rays.shape[:2]
    under = np.isfinite(gaps(points, frames))
    crosses = np.array([np.isfinite(gaps(points + reach * ray, frames)) != under for ray in rays])
    direction, point = np.nonzero(crosses)
    start, along, axes, state = points[point], rays[direction, point], frames[point], under[point]
    low, high = np.zeros(len(point)), np.full(len(point), reach)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = np.isfinite(gaps(start + middle[:, None] * along, axes)) == state
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    lengths = np.full((directions, n), np.inf)
    lengths[crosses] = high
    return lengths
