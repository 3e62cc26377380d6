"""Coarser grids, interpolation from them, and rectangular subgrids."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import Array, Indices
from meeframe_halfspace.grid import Grid

MIN_COARSE_NODES: Final = 24
"""Smallest number of nodes along an axis of the coarsest grid."""
SUBGRID_BOUNDARIES: Final = 64
"""Number of positions along an axis at which subgrids may begin or end. More positions make subgrids smaller; fewer let
a subgrid serve more contacts that change a little. They are counted from both ends, so that subgrids of reflected grids
are reflected subgrids."""


def coarse_grid(grid: Grid) -> Grid | None:
    """Return the grid of every second node, numbered row by row; None if it is too coarse."""
    size = tuple((n + 1) // 2 for n in grid.size)
    if min(size) < MIN_COARSE_NODES:
        return None
    spacing = 2.0 * grid.spacing[0], 2.0 * grid.spacing[1]
    return Grid(np.arange(size[0] * size[1]).reshape(size), spacing, grid.frame)


def row_major_grid(grid: Grid, size: tuple[int, int]) -> Grid:
    """Return a subgrid of that size, numbered row by row."""
    return Grid(np.arange(size[0] * size[1]).reshape(size), grid.spacing, grid.frame)


def box(grid: Grid, nodes: Indices) -> tuple[slice, slice]:
    """Return the smallest subgrid with these nodes (k,) between SUBGRID_BOUNDARIES."""
    inside = np.zeros((1, grid.nodes.size), bool)
    inside[0, nodes] = True
    (flags_on_grid,) = grid.to_grid(inside)
    along, across = (_span(flags_on_grid.any(axis=axis), n) for axis, n in zip((1, 0), grid.size, strict=True))
    return along, across


def _span(flags: NDArray[np.bool_], count: int) -> slice:
    """Return the smallest slice of range(count) with the marked indices, (count,)."""
    indices, step = np.flatnonzero(flags), -(-count // SUBGRID_BOUNDARIES)
    return slice(indices[0] // step * step, count - (count - 1 - indices[-1]) // step * step)


def coarse_cells(grid: Grid) -> tuple[tuple[str, Indices], ...]:
    """Return the quadrilaterals between the nodes of a grid."""
    nodes = grid.nodes
    corners = nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]
    return (("quad", np.stack([corner.ravel() for corner in corners], axis=1)),)


def bilinear(values: Array, size: tuple[int, int], periodic: bool) -> Array:
    """Return values (k, nx, ny) at all nodes of a grid from values (k, cx, cy) at every second node.

    Beyond the border values fall to zero in one of their spacings, unless the grid repeats itself.
    """
    fine = np.empty((len(values), *size))
    fine[:, ::2, ::2] = values
    fine[:, 1::2, ::2] = _between(values, periodic)[:, : size[0] // 2]
    fine[:, :, 1::2] = _between(fine[:, :, ::2].swapaxes(1, 2), periodic).swapaxes(1, 2)[:, :, : size[1] // 2]
    return fine


def _between(values: Array, periodic: bool) -> Array:
    """Return means of values (k, m, l) and the next ones along the second axis, zeros after the last or periodic."""
    means = 0.5 * values
    means[:, :-1] += 0.5 * values[:, 1:]
    if periodic:
        means[:, -1] += 0.5 * values[:, 0]
    return means
