"""Contact edges below the spacing of the grid: nodes there represent the covered fraction of their area.

Densities that are singular like 1/sqrt(d) at the edge, such as charges under prescribed potentials or the pressure of a
punch, are only of first order in the spacing if the nodes define the edge: it then lies 0.39 spacings beyond the
outermost ones. Here nodes up to 0.61 spacings outside the true edge are included, and the response of nodes on both
sides to their loads is increased so that a conducting half plane ends at the edge (meeframe_halfspace.strip). The
additional compliance is a block for each node, Re Y of a wave across the edge, since nothing varies along the edge.
"""

from typing import Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.plugin import Array, EdgeCorrection, IndenterEdge
from meeframe_halfspace.grid import Grid
from meeframe_halfspace.outline import find_outline, fourfold
from meeframe_halfspace.response import series_blocks
from meeframe_halfspace.strip import edge_limits, edge_response

MEAN_OFFSET: Final = 0.005
"""Mean offset in spacings of round edges, from the capacity of discs; edges along the axes of the grid are exact."""
RIM_DISTANCE: Final = 1.5
"""Distance in spacings from the indenter edge up to which the contact edge coincides with it."""
MIN_COSINE: Final = 0.5
"""Cosine to the direction across the indenter edge above which a pressure decreases towards it."""


def resolved_edges(
    grid: Grid, waves: Array, scaling: Array, pressure: Array, rim: IndenterEdge | None, periodic: bool = False
) -> EdgeCorrection:
    """Return the correction for a contact edge between the nodes; see `EdgeResolution.edge_correction`.

    Parameters
    ----------
    grid
        The grid.
    waves
        Series of Re Y, see PointResponse.wave_series.
    scaling
        Scaling (5, 5) of its entries.
    pressure
        Pressures (n,).
    rim
        Edge of the indenter; None without one.
    periodic
        Whether the grid is one period.
    """
    distance, outward = _outline(grid, pressure, periodic)
    if rim is not None:
        _enter_rim(grid, rim, pressure, distance, outward, periodic)
    nodes = np.flatnonzero(np.isfinite(distance))
    lowest, _ = edge_limits()
    offset = distance[nodes] - MEAN_OFFSET * (1.0 - fourfold(outward[nodes]))
    area_fraction = (pressure > 0.0).astype(float)
    # the sum over nodes is the contact area on average
    area_fraction[nodes] = np.clip(0.5 - 0.5 * offset / lowest, 0.0, 1.0)
    extra_compliance = np.zeros((len(pressure), *scaling.shape))
    growth = edge_response(offset) * _spacing(grid, outward[nodes]) / (2.0 * np.pi)
    included = offset > lowest
    blocks = series_blocks(waves, np.arctan2(outward[nodes, 1], outward[nodes, 0])) * scaling
    extra_compliance[nodes] = np.where(included, growth, 0.0)[:, None, None] * blocks
    return EdgeCorrection(extra_compliance, area_fraction)


def _outline(grid: Grid, pressure: Array, periodic: bool) -> tuple[Array, Array]:
    """Return the distance (n,) of nodes from the edge in spacings, NaN if it is far, and its direction (n, 2) [1]."""
    outline = find_outline(pressure[grid.nodes], periodic)
    numbers = grid.nodes[outline.nodes[:, 0], outline.nodes[:, 1]]
    distance, outward = np.full(len(pressure), np.nan), np.zeros((len(pressure), 2))
    distance[numbers] = outline.distance
    normal = outline.outward / np.array(grid.spacing)
    outward[numbers] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return distance, outward


def _enter_rim(grid: Grid, rim: IndenterEdge, pressure: Array, distance: Array, outward: Array, periodic: bool) -> None:
    """Enter the distance of nodes from the indenter edge where the contact ends there.

    It ends before where the pressure decreases before; a pressure that is singular at the indenter edge increases
    towards it.
    """
    offsets = rim.distance / _spacing(grid, rim.outward)
    loaded = pressure > 0.0
    outermost = loaded & (offsets < 1.0)  # no other node is between them and the indenter edge
    outermost_on_grid = np.pad(outermost[grid.nodes], 1, mode="wrap" if periodic else "constant")
    near_outermost = scipy.ndimage.binary_dilation(outermost_on_grid, np.ones((3, 3), bool))[1:-1, 1:-1]
    near = grid.scatter(near_outermost[None].astype(float))[:, 0] > 0.0
    decreasing = (np.einsum("na,na->n", outward, rim.outward) > MIN_COSINE) & (distance < offsets)
    # nodes under the indenter without pressure have their edge elsewhere
    at_rim = near & (np.abs(offsets) < RIM_DISTANCE) & (loaded | (offsets < 0.0)) & ~decreasing
    distance[at_rim], outward[at_rim] = offsets[at_rim], rim.outward[at_rim]


def _spacing(grid: Grid, outward: Array) -> Array:
    """Return the spacing (n,) of the nodes in directions (n, 2) [m]; along e1 and e2 it is that of the grid."""
    spacing: Array = np.hypot(*(outward * np.array(grid.spacing)).T)
    return np.where(spacing > 0.0, spacing, 1.0)
