"""Between a grid and one of every HOP-th node, by interpolation of the fifth degree."""

# mypy: ignore-errors
from math import prod
from typing import Final

import numpy as np
from numba import njit

HOP: Final = 4
"""Spacings of the grid in one of the coarse one."""
TAPS: Final = 6
"""Coarse nodes that say what is at a node between them."""
BEFORE: Final = TAPS // 2 - 1
"""Of them as many stand before the one at or just before the node; coarse grids begin with so many beside the grid."""


def _weights():
    """(HOP, TAPS) of the coarse nodes around the nodes 0, 1, ... spacings behind one."""
    places = range(-BEFORE, TAPS - BEFORE)
    shares = [[prod((step / HOP - q) / (p - q) for q in places if q != p) for p in places] for step in range(HOP)]
    return np.array(shares, np.float32)


WEIGHTS: Final = _weights()


def coarse_count(count: int) -> int:
    """Nodes of the coarse grid of so many nodes in a row."""
    return (count - 1) // HOP + TAPS


@njit(cache=True, nogil=True)
def add_restricted(fine, weights, coarse):
    """coarse (c, m) += what `add_interpolated` takes from it, transposed, of fine (n, m)."""
    for i in range(len(fine)):
        step, first = i % len(weights), i // len(weights)
        for tap in range(weights.shape[1]):
            if weights[step, tap] != 0.0:
                _add(weights[step, tap], fine[i], coarse[first + tap])


@njit(cache=True, nogil=True)
def add_interpolated(coarse, weights, fine):
    """fine (n, m) += coarse (c, m) between its nodes, along the first axis."""
    for i in range(len(fine)):
        step, first = i % len(weights), i // len(weights)
        for tap in range(weights.shape[1]):
            if weights[step, tap] != 0.0:
                _add(weights[step, tap], coarse[first + tap], fine[i])


@njit(cache=True, nogil=True)
def _add(factor, part, whole):
    """whole += factor part."""
    for j in range(len(whole)):
        whole[j] += factor * part[j]
