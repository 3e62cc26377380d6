"""Points that lie very close together."""

from typing import Final

import numpy as np

from meeframe.core.fields import Array
from meeframe.core.mesh import Indices

_ASKEW: Final = np.array([1.0, np.sqrt(2.0), np.sqrt(5.0)]) / np.sqrt(8.0)
"""A unit vector along which points of a lattice do not line up."""


def close_pairs(points: Array, distance: float) -> Indices:
    """Pairs of points (p, 3) not farther apart than a distance [m], which few are: (k, 2), the lower number first.

    They are close along any direction too: sorted along one, candidates are next to each other. Quicker than a tree,
    and than loading one.
    """
    along = points @ _ASKEW
    order = np.argsort(along)
    along = along[order]
    found = [np.empty((0, 2), np.int64)]
    for apart in range(1, len(points)):
        candidates = np.flatnonzero(along[apart:] - along[:-apart] <= distance)
        if candidates.size == 0:
            break
        pairs = np.stack([order[candidates], order[candidates + apart]], axis=1)
        near = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1) <= distance
        found.append(np.sort(pairs[near], axis=1))
    return np.concatenate(found)
