"""Every second node of a grid, and values at all of them; parts of a grid."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import Array, Indices
from meeframe_halfspace.grid import Grid

FEWEST: Final = 24
"""Nodes along an axis of the coarsest grid."""
STEPS: Final = 64
"""At which parts of a grid may begin and end along an axis, at every node of smaller ones: more places make parts
smaller, fewer make them serve more contacts that change a little. Counted from either end, so that parts of turned
grids are turned parts."""


def coarse_grid(grid: Grid) -> Grid | None:
    """The grid of every second node, numbered anew row by row; None if it is too coarse."""
    size = tuple((n + 1) // 2 for n in grid.size)
    if min(size) < FEWEST:
        return None
    spacing = 2.0 * grid.spacing[0], 2.0 * grid.spacing[1]
    return Grid(np.arange(size[0] * size[1]).reshape(size), spacing, grid.frame)


def numbered(grid: Grid, size: tuple[int, int]) -> Grid:
    """A part of a grid of that size, numbered anew row by row."""
    return Grid(np.arange(size[0] * size[1]).reshape(size), grid.spacing, grid.frame)


def box(grid: Grid, nodes: Indices) -> tuple[slice, slice]:
    """A part of a grid that holds these nodes (k,), from one of STEPS along each axis to another."""
    inside = np.zeros((1, grid.nodes.size), bool)
    inside[0, nodes] = True
    (placed,) = grid.place(inside)
    along, across = (_span(placed.any(axis=axis), n) for axis, n in zip((1, 0), grid.size, strict=True))
    return along, across


def _span(held: NDArray[np.bool_], count: int) -> slice:
    """A part of range(count) that holds those of them, (count,)."""
    there, step = np.flatnonzero(held), -(-count // STEPS)
    return slice(there[0] // step * step, count - (count - 1 - there[-1]) // step * step)


def coarse_cells(grid: Grid) -> tuple[tuple[str, Indices], ...]:
    """Quadrilaterals between the nodes of a grid."""
    nodes = grid.nodes
    corners = nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]
    return (("quad", np.stack([corner.ravel() for corner in corners], axis=1)),)


def bilinear(values: Array, size: tuple[int, int], periodic: bool) -> Array:
    """Values (k, cx, cy) at every second node of a grid of that size, at all of its nodes, (k, nx, ny).

    Beyond the border they fall to zero in one of their spacings, unless the grid repeats itself.
    """
    fine = np.empty((len(values), *size))
    fine[:, ::2, ::2] = values
    fine[:, 1::2, ::2] = _between(values, periodic)[:, : size[0] // 2]
    fine[:, :, 1::2] = _between(fine[:, :, ::2].swapaxes(1, 2), periodic).swapaxes(1, 2)[:, :, : size[1] // 2]
    return fine


def _between(values: Array, periodic: bool) -> Array:
    """Means of values (k, m, l) and the next ones along the second axis; zero is beyond the last unless periodic."""
    means = 0.5 * values
    means[:, :-1] += 0.5 * values[:, 1:]
    if periodic:
        means[:, -1] += 0.5 * values[:, 0]
    return means
