"""Search for the edge of an indenter near points of the contact zone, by evaluations of gaps."""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from meeframe.fields import Array, Indices
from meeframe.mesh.measures import corners
from meeframe.mesh.regular import GridCells
from meeframe.system.capabilities import IndenterEdge

Gaps = Callable[[Array, Array], Array]
"""Function of points (m, 3) and frames (m, 3, 3) that returns gaps (m,) [m] along the normals, inf if there is none."""

N_SEARCH_DIRECTIONS: Final = 16
"""Number of directions of the first search, which decides whether the edge of the indenter is near."""
N_DIRECTIONS: Final = 64
"""Number of directions of the search for the nearest point of the edge; its distance is at most 0.12 % too large."""
N_BISECTIONS: Final = 32
INSIDE_FRACTION: Final = 1e-9
"""Distance from the edge, relative to the search distance, at which points count as under the indenter."""


def find_indenter_edge(gaps: Gaps, points: Array, frames: Array, max_distance: float) -> IndenterEdge | None:
    """Find the edge of an indenter near points of the contact zone.

    Parameters
    ----------
    gaps : callable
        Function that returns gaps (m,) [m] along the normals at points (m, 3) with frames (m, 3, 3), inf where no
        indenter lies above.
    points : Array
        Positions, (n, 3) [m].
    frames : Array
        Local frames at the points, (n, 3, 3).
    max_distance : float
        Distance up to which the edge is searched [m].

    Returns
    -------
    IndenterEdge or None
        The edge near the points, None if it is farther than `max_distance` from all of them. The gap at points outside
        the indenter is linearly extrapolated from two points under it.
    """
    is_under = np.isfinite(gaps(points, frames))
    changes = [
        np.isfinite(gaps(points + max_distance * ray, frames)) != is_under for ray in _rays(frames, N_SEARCH_DIRECTIONS)
    ]
    near = np.flatnonzero(np.any(changes, axis=0))
    if not near.size:
        return None
    near_points, near_frames, near_under = points[near], frames[near], is_under[near]
    lengths = _crossings(gaps, near_points, near_frames, _rays(near_frames, N_DIRECTIONS), max_distance)
    nearest = lengths.argmin(axis=0)
    shortest = lengths.min(axis=0)
    direction = _circle(N_DIRECTIONS)[nearest]
    distance = np.where(is_under, np.inf, -np.inf)
    distance[near] = np.where(near_under, shortest, -shortest)
    outward = np.zeros((len(points), 2))
    outward[near] = np.where(near_under[:, None], direction, -direction)
    gap = np.full(len(points), np.inf)
    step = np.einsum("na,nai->ni", direction, near_frames[:, :2]) * (shortest + INSIDE_FRACTION * max_distance)[:, None]
    gap_1, gap_2 = gaps(near_points + step, near_frames), gaps(near_points + 2.0 * step, near_frames)
    extrapolated = np.where(np.isfinite(gap_2), 2.0 * gap_1 - np.where(np.isfinite(gap_2), gap_2, 0.0), gap_1)
    gap[near] = np.where(near_under | ~np.isfinite(gap_1), np.inf, extrapolated)
    return IndenterEdge(distance, outward, gap)


def longest_side(points: Array, cells: Sequence[tuple[str, Indices]]) -> float:
    """Return the longest side of cells, from corner to corner [m].

    Parameters
    ----------
    points : Array
        Positions, (n, 3) [m].
    cells : sequence of tuple
        meshio cell type and connectivity of each block.

    Returns
    -------
    float
        Length [m].
    """
    if isinstance(cells, GridCells):
        return float(max(np.linalg.norm(points[number] - points[0]) for number in (1, cells.shape[1])))
    outlines = (points[numbers] for numbers in corners(cells))
    sides = (np.linalg.norm(outline - np.roll(outline, 1, axis=1), axis=2) for outline in outlines)
    return float(max((lengths.max(initial=0.0) for lengths in sides), default=0.0))


def _circle(count: int) -> Array:
    """Return unit vectors (count, 2) around the circle."""
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _rays(frames: Array, count: int) -> Array:
    """Return unit vectors (count, n, 3) around each normal."""
    rays: Array = np.einsum("ka,nai->kni", _circle(count), frames[:, :2])
    return rays


def _crossings(gaps: Gaps, points: Array, frames: Array, rays: Array, max_distance: float) -> Array:
    """Return the distance (k, n) along rays (k, n, 3) at which the indenter ends, or begins, by bisection; else inf."""
    n_rays, n = rays.shape[:2]
    is_under = np.isfinite(gaps(points, frames))
    crosses = np.array([np.isfinite(gaps(points + max_distance * ray, frames)) != is_under for ray in rays])
    ray_number, point = np.nonzero(crosses)
    start, ray, near_frames, start_under = points[point], rays[ray_number, point], frames[point], is_under[point]
    low, high = np.zeros(len(point)), np.full(len(point), max_distance)
    for _ in range(N_BISECTIONS):
        middle = 0.5 * (low + high)
        unchanged = np.isfinite(gaps(start + middle[:, None] * ray, near_frames)) == start_under
        low, high = np.where(unchanged, middle, low), np.where(unchanged, high, middle)
    lengths = np.full((n_rays, n), np.inf)
    lengths[crosses] = high
    return lengths
