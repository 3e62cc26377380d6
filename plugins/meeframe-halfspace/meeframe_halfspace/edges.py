"""Contact edges between the nodes of a grid: nodes near the edge represent the part of their area in contact.

Densities that are singular like 1/sqrt(d) at the edge, as charges under prescribed potentials or the pressure of a
punch, are of first order in the spacing if the edge is at nodes: it then lies 0.39 spacings beyond the outermost ones,
whatever its true position. With the correction, nodes within 0.61 spacings outside the true edge take part too, and
nodes on both sides respond more to their own load, such that a conducting half plane ends at the edge
(meeframe_halfspace.strip). The addition is a block for each node: Re Y of a wave across the edge, since nothing varies
along the edge.
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
"""Offset [spacings] by which round edges are too far out (capacity of discs); edges along the axes are exact."""
MAX_EDGE_DISTANCE: Final = 1.5
"""Largest distance [spacings] from the indenter's edge at which it may be the contact edge."""
MIN_FADING_COSINE: Final = 0.5
"""Smallest cosine between the outward directions for a pressure that fades towards the indenter's edge."""


def resolved_edges(
    grid: Grid,
    waves: Array,
    scaling: Array,
    pressure: Array,
    indenter_edge: IndenterEdge | None,
    periodic: bool = False,
) -> EdgeCorrection:
    """Return the correction for a contact edge between the nodes; see `EdgeResolution.edge_correction`.

    waves: series of Re Y, see PointResponse.wave_series; scaling: (5, 5) of its entries.
    """
    distance, outward = _outline(grid, pressure, periodic)
    if indenter_edge is not None:
        _enter_indenter_edge(grid, indenter_edge, pressure, distance, outward, periodic)
    nodes = np.flatnonzero(np.isfinite(distance))
    lowest, _ = edge_limits()
    offset = distance[nodes] - MEAN_OFFSET * (1.0 - fourfold(outward[nodes]))
    area_fraction = (pressure > 0.0).astype(float)
    # on average over nodes as large as the contact
    area_fraction[nodes] = np.clip(0.5 - 0.5 * offset / lowest, 0.0, 1.0)
    extra_compliance = np.zeros((len(pressure), *scaling.shape))
    growth = edge_response(offset) * _spacing(grid, outward[nodes]) / (2.0 * np.pi)
    included = offset > lowest
    blocks = series_blocks(waves, np.arctan2(outward[nodes, 1], outward[nodes, 0])) * scaling
    extra_compliance[nodes] = np.where(included, growth, 0.0)[:, None, None] * blocks
    return EdgeCorrection(extra_compliance, area_fraction)


def _outline(grid: Grid, pressure: Array, periodic: bool) -> tuple[Array, Array]:
    """Return distances (n,) from the edge in spacings across it, NaN far away, and outward directions (n, 2)."""
    outline = find_outline(pressure[grid.nodes], periodic)
    numbers = grid.nodes[outline.nodes[:, 0], outline.nodes[:, 1]]
    distance, outward = np.full(len(pressure), np.nan), np.zeros((len(pressure), 2))
    distance[numbers] = outline.distance
    normal = outline.outward / np.array(grid.spacing)
    outward[numbers] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return distance, outward


def _enter_indenter_edge(
    grid: Grid, indenter_edge: IndenterEdge, pressure: Array, distance: Array, outward: Array, periodic: bool
) -> None:
    """Enter the distance of nodes from the indenter's edge where the contact ends there.

    It ends before where the pressure fades before; a pressure that is singular at the edge rises towards it.
    """
    offsets = indenter_edge.distance / _spacing(grid, indenter_edge.outward)
    loaded = pressure > 0.0
    outermost = loaded & (offsets < 1.0)  # no other node lies between them and the edge
    outermost_on_grid = np.pad(outermost[grid.nodes], 1, mode="wrap" if periodic else "constant")
    near_outermost = scipy.ndimage.binary_dilation(outermost_on_grid, np.ones((3, 3), bool))[1:-1, 1:-1]
    near = grid.scatter(near_outermost[None].astype(float))[:, 0] > 0.0
    decreasing = (np.einsum("na,na->n", outward, indenter_edge.outward) > MIN_FADING_COSINE) & (distance < offsets)
    # nodes under the indenter without pressure have their edge elsewhere
    at_edge = near & (np.abs(offsets) < MAX_EDGE_DISTANCE) & (loaded | (offsets < 0.0)) & ~decreasing
    distance[at_edge], outward[at_edge] = offsets[at_edge], indenter_edge.outward[at_edge]


def _spacing(grid: Grid, outward: Array) -> Array:
    """Return the spacing (n,) [m] of the nodes in directions (n, 2)."""
    spacing: Array = np.hypot(*(outward * np.array(grid.spacing)).T)
    return np.where(spacing > 0.0, spacing, 1.0)
