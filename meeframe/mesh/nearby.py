"""Points that lie very close together."""

from typing import Final

import numpy as np

from meeframe.fields import Array, Indices

_RATIO: Final = 0.7548776662466927
"""Root of x^3 + x^2 = 1: multiples of 1, x and x^2 by small integers, or by their roots, do not cancel."""
_SORT_DIRECTION: Final = np.array([1.0, _RATIO, _RATIO**2]) / np.sqrt(1.0 + _RATIO**2 + _RATIO**4)
"""Unit vector on which points of common lattices have distinct projections."""
_MAX_PASSES: Final = 50
"""Number of neighbours along that vector that are compared; a tree is faster than more of them."""


def close_point_pairs(points: Array, distance: float) -> Indices:
    """Return the pairs of points that are not farther apart than a distance, of which there should be few.

    Parameters
    ----------
    points : Array
        Positions, (p, 3) [m].
    distance : float
        Largest distance [m].

    Returns
    -------
    Indices
        Point numbers, (k, 2), the lower one first.

    Notes
    -----
    Close points have close projections on any direction, so that candidates are neighbours in the order of these
    projections. This is faster than a tree, and than importing one, unless many points have the same projection.
    """
    along = points @ _SORT_DIRECTION
    order = np.argsort(along)
    along = along[order]
    blocks = [np.empty((0, 2), np.int64)]
    for offset in range(1, len(points)):
        candidates = np.flatnonzero(along[offset:] - along[:-offset] <= distance)
        if candidates.size == 0:
            break
        if offset > _MAX_PASSES:
            return _by_tree(points, distance)
        pairs = np.stack([order[candidates], order[candidates + offset]], axis=1)
        near = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1) <= distance
        blocks.append(np.sort(pairs[near], axis=1))
    return np.concatenate(blocks)


def _by_tree(points: Array, distance: float) -> Indices:
    from scipy.spatial import cKDTree

    pairs: Indices = cKDTree(points).query_pairs(distance, output_type="ndarray")
    return np.sort(pairs, axis=1).astype(np.int64, copy=False)
