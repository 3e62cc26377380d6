"""Points that lie very close together."""

from typing import Final

import numpy as np

from meeframe.fields import Array, Indices

_RATIO: Final = 0.7548776662466927
"""Root of x^3 + x^2 = 1: multiples of 1, x and x^2 by small whole numbers, or by their roots, do not cancel."""
_ASKEW: Final = np.array([1.0, _RATIO, _RATIO**2]) / np.sqrt(1.0 + _RATIO**2 + _RATIO**4)
"""A unit vector along which points of the usual lattices do not line up."""
_PASSES: Final = 50
"""Neighbours along it that are looked at; a tree is quicker than more of them."""


def close_pairs(points: Array, distance: float) -> Indices:
    """Return the pairs of points (p, 3) not farther apart than a distance [m], which few are: (k, 2), the lower number
    first.

    They are close along any direction too: sorted along one, candidates are next to each other. Quicker than a tree,
    and than loading one, unless many points line up across it.
    """
    along = points @ _ASKEW
    order = np.argsort(along)
    along = along[order]
    found = [np.empty((0, 2), np.int64)]
    for apart in range(1, len(points)):
        candidates = np.flatnonzero(along[apart:] - along[:-apart] <= distance)
        if candidates.size == 0:
            break
        if apart > _PASSES:
            return _by_tree(points, distance)
        pairs = np.stack([order[candidates], order[candidates + apart]], axis=1)
        near = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1) <= distance
        found.append(np.sort(pairs[near], axis=1))
    return np.concatenate(found)


def _by_tree(points: Array, distance: float) -> Indices:
    from scipy.spatial import cKDTree

    pairs: Indices = cKDTree(points).query_pairs(distance, output_type="ndarray")
    return np.sort(pairs, axis=1).astype(np.int64, copy=False)
