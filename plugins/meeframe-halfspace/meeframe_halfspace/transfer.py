"""Transfer between a grid and one of every RATIO-th node, by interpolation of the fifth degree."""

# mypy: ignore-errors
from math import prod
from typing import Final

import numpy as np
from numba import njit

RATIO: Final = 4
"""Ratio of the spacings of the coarse and the fine grid."""
N_POINTS: Final = 6
"""Number of coarse nodes from which the value at a node between them is interpolated."""
N_BEFORE: Final = N_POINTS // 2 - 1
"""Number of these before the one at or just before the node; coarse grids begin this many nodes outside the grid."""


def _weights():
    """Return the weights (RATIO, N_POINTS) of the coarse nodes at 0, 1, ... fine spacings behind one of them."""
    positions = range(-N_BEFORE, N_POINTS - N_BEFORE)
    weights = [
        [prod((step / RATIO - q) / (p - q) for q in positions if q != p) for p in positions] for step in range(RATIO)
    ]
    return np.array(weights, np.float32)


WEIGHTS: Final = _weights()


def coarse_count(count: int) -> int:
    """Return the number of coarse nodes for `count` nodes in a row."""
    return (count - 1) // RATIO + N_POINTS


@njit(cache=True, nogil=True)
def add_restricted(fine, weights, coarse):
    """Add to coarse (c, m) the transpose of `add_interpolated` applied to fine (n, m)."""
    for i in range(len(fine)):
        step, first = i % len(weights), i // len(weights)
        for point in range(weights.shape[1]):
            if weights[step, point] != 0.0:
                _add(weights[step, point], fine[i], coarse[first + point])


@njit(cache=True, nogil=True)
def add_interpolated(coarse, weights, fine):
    """Add to fine (n, m) the interpolation of coarse (c, m) along the first axis."""
    for i in range(len(fine)):
        step, first = i % len(weights), i // len(weights)
        for point in range(weights.shape[1]):
            if weights[step, point] != 0.0:
                _add(weights[step, point], coarse[first + point], fine[i])


@njit(cache=True, nogil=True)
def _add(factor, term, total):
    """Add `factor` times `term` to `total`."""
    for j in range(len(total)):
        total[j] += factor * term[j]
