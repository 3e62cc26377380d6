"""The edge of a contact below the spacing of the grid: nodes there stand for the part of their area that is covered.

Densities that are singular like 1/sqrt(d) at the edge, as charges under prescribed potentials or the pressure of a
punch, are of first order in the spacing if the edge is where the nodes say: it then lies 0.39 spacings beyond the
outermost ones, wherever it should be. Here nodes within 0.61 spacings outside the true edge take part too, and nodes on
both sides respond so much more to their own load that a conducting half plane ends where the edge is
(meeframe_halfspace.strip). What is added is a block for each node: Re Y of a wave across the edge, since along the edge
nothing varies.
"""

from typing import Final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.plugin import Array, EdgeCorrection, IndenterEdge
from meeframe_halfspace.grid import Grid
from meeframe_halfspace.outline import find_outline, fourfold
from meeframe_halfspace.response import series_blocks
from meeframe_halfspace.strip import edge_limits, edge_response

MEAN_OFF: Final = 0.005
"""Edges along the axes of the grid are exact; by the capacity of discs round ones are so many spacings too far out."""
OF_THE_RIM: Final = 1.5
"""So many spacings from where the indenter ends the edge is there."""
TOWARDS: Final = 0.5
"""Cosine to the direction across the rim above which a pressure fades towards it."""


def resolved_edges(
    grid: Grid, waves: Array, scaling: Array, pressure: Array, rim: IndenterEdge | None, periodic: bool = False
) -> EdgeCorrection:
    """Return the correction for a contact edge between the nodes; see `EdgeResolution.edge_correction`.

    waves: series of Re Y, see PointResponse.wave_series; scaling: (5, 5) of its entries.
    """
    distance, outward = _outline(grid, pressure, periodic)
    if rim is not None:
        _enter_rim(grid, rim, pressure, distance, outward, periodic)
    at = np.flatnonzero(np.isfinite(distance))
    lowest, _ = edge_limits()
    place = distance[at] - MEAN_OFF * (1.0 - fourfold(outward[at]))
    area_fraction = (pressure > 0.0).astype(float)
    # on average over nodes as large as the contact
    area_fraction[at] = np.clip(0.5 - 0.5 * place / lowest, 0.0, 1.0)
    extra_compliance = np.zeros((len(pressure), *scaling.shape))
    grown = edge_response(place) * _spacing(grid, outward[at]) / (2.0 * np.pi)
    taking_part = place > lowest
    blocks = series_blocks(waves, np.arctan2(outward[at, 1], outward[at, 0])) * scaling
    extra_compliance[at] = np.where(taking_part, grown, 0.0)[:, None, None] * blocks
    return EdgeCorrection(extra_compliance, area_fraction)


def _outline(grid: Grid, pressure: Array, periodic: bool) -> tuple[Array, Array]:
    """Distance (n,) of nodes from the edge in spacings across it, NaN if it is far, and its direction (n, 2) [1]."""
    outline = find_outline(pressure[grid.nodes], periodic)
    numbers = grid.nodes[outline.nodes[:, 0], outline.nodes[:, 1]]
    distance, outward = np.full(len(pressure), np.nan), np.zeros((len(pressure), 2))
    distance[numbers] = outline.distance
    normal = outline.outward / np.array(grid.spacing)
    outward[numbers] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return distance, outward


def _enter_rim(grid: Grid, rim: IndenterEdge, pressure: Array, distance: Array, outward: Array, periodic: bool) -> None:
    """Enter the distance of nodes from the rim where the contact ends there.

    It ends before where the pressure fades before; a pressure that is singular at the rim rises towards it.
    """
    places = rim.distance / _spacing(grid, rim.outward)
    pressed = pressure > 0.0
    outermost = pressed & (places < 1.0)  # no other node lies between them and the rim
    beside = np.pad(outermost[grid.nodes], 1, mode="wrap" if periodic else "constant")
    around = scipy.ndimage.binary_dilation(beside, np.ones((3, 3), bool))[1:-1, 1:-1]
    near = grid.scatter(around[None].astype(float))[:, 0] > 0.0
    fades = (np.einsum("na,na->n", outward, rim.outward) > TOWARDS) & (distance < places)
    # nodes under the indenter without pressure have their edge elsewhere
    here = near & (np.abs(places) < OF_THE_RIM) & (pressed | (places < 0.0)) & ~fades
    distance[here], outward[here] = places[here], rim.outward[here]


def _spacing(grid: Grid, outward: Array) -> Array:
    """Spacing of the nodes in directions (n, 2), (n,) [m]: along e1 and e2 that of the grid."""
    spacing: Array = np.hypot(*(outward * np.array(grid.spacing)).T)
    return np.where(spacing > 0.0, spacing, 1.0)
