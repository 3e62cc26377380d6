"""Coarse grids of every second node, interpolation from them, and boxes of a grid."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import Array, Indices
from meeframe_halfspace.grid import Grid

MIN_COARSE_NODES: Final = 24
"""Smallest number of nodes along an axis of a coarse grid."""
BOX_STEPS: Final = 64
"""Number of steps along an axis at which boxes can begin and end; boxes of smaller grids can do so at every node.

More steps make boxes smaller, fewer steps make them fit more contacts that change a little. Counted from either end, so
that boxes of rotated grids are rotated boxes."""


def coarse_grid(grid: Grid) -> Grid | None:
    """Return the grid of every second node, numbered row by row; None if it is too coarse."""
    size = tuple((n + 1) // 2 for n in grid.size)
    if min(size) < MIN_COARSE_NODES:
        return None
    spacing = 2.0 * grid.spacing[0], 2.0 * grid.spacing[1]
    return Grid(np.arange(size[0] * size[1]).reshape(size), spacing, grid.frame)


def numbered(grid: Grid, size: tuple[int, int]) -> Grid:
    """Return a grid of this size within a grid, numbered row by row."""
    return Grid(np.arange(size[0] * size[1]).reshape(size), grid.spacing, grid.frame)


def box(grid: Grid, nodes: Indices) -> tuple[slice, slice]:
    """Return the box of a grid that contains these nodes (k,), with bounds at BOX_STEPS along each axis."""
    inside = np.zeros((1, grid.nodes.size), bool)
    inside[0, nodes] = True
    (flags,) = grid.place(inside)
    rows, columns = (_span(flags.any(axis=axis), n) for axis, n in zip((1, 0), grid.size, strict=True))
    return rows, columns


def _span(flags: NDArray[np.bool_], count: int) -> slice:
    """Return the range of a box along an axis, from the flags (count,) of nodes that it contains."""
    indices, step = np.flatnonzero(flags), -(-count // BOX_STEPS)
    return slice(indices[0] // step * step, count - (count - 1 - indices[-1]) // step * step)


def coarse_cells(grid: Grid) -> tuple[tuple[str, Indices], ...]:
    """Return the quadrilaterals between the nodes of a grid."""
    nodes = grid.nodes
    corners = nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]
    return (("quad", np.stack([corner.ravel() for corner in corners], axis=1)),)


def bilinear(values: Array, size: tuple[int, int], periodic: bool) -> Array:
    """Interpolate values (k, cx, cy) at every second node of a grid of this size to all nodes, (k, nx, ny).

    Beyond the border they decrease to zero within one coarse spacing, unless the grid is periodic.
    """
    fine = np.empty((len(values), *size))
    fine[:, ::2, ::2] = values
    fine[:, 1::2, ::2] = _between(values, periodic)[:, : size[0] // 2]
    fine[:, :, 1::2] = _between(fine[:, :, ::2].swapaxes(1, 2), periodic).swapaxes(1, 2)[:, :, : size[1] // 2]
    return fine


def _between(values: Array, periodic: bool) -> Array:
    """Return means of values (k, m, l) and the next ones along the second axis; zero follows unless periodic."""
    means = 0.5 * values
    means[:, :-1] += 0.5 * values[:, 1:]
    if periodic:
        means[:, -1] += 0.5 * values[:, 0]
    return means
