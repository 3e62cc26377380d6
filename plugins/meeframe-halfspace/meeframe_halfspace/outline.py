"""Position of the contact edge between the nodes of a grid, from the pressures at the nodes.

At a contact edge without singular pressure p^2 increases linearly with the distance d from it, p^2 = G d; a bilinear
density reproduces that from the third node on. Closer to the edge its nodal values differ from p by a function of d, in
spacings, and of the direction of the edge: MEAN_CORRECTION and FOURFOLD_CORRECTION are its first terms, from Hertz's
pressure on fine grids. They convert each pressure into a distance, and the zero of a quadratic function fitted to the
distances of the nodes around gives the edge. Lengths are in spacings.
"""

from dataclasses import dataclass
from math import ceil
from typing import Final

import numpy as np
import scipy  # submodules are loaded on first use
from numpy.typing import NDArray

from meeframe.plugin import Array, Indices

Flags = NDArray[np.bool_]

FIT_RADIUS: Final = 2.9
"""Radius around a node of the nodes that are fitted ..."""
EXTRA_RADIUS: Final = 0.5
"""... and its increase for a node outside the contact."""
MIN_NODES: Final = 8
SWEEPS: Final = 8
"""Number of alternating updates of slope and distance."""
STEP: Final = 0.1
"""Step between the values of MEAN_CORRECTION."""
MEAN_CORRECTION: Final = np.array(
    [
        *(-0.041, 0.018, 0.062, 0.087, 0.099, 0.095, 0.072, 0.035, -0.008, -0.060),
        *(-0.103, -0.080, -0.047, -0.018, -0.004, -0.005, -0.008, -0.011, -0.009),
    ]
)
"""Correction d - p^2/G at p/sqrt(G) = 0, 0.1, ..., mean over directions."""
FOURFOLD_CORRECTION: Final = np.array(
    [
        *(-0.028, -0.030, -0.022, -0.014, -0.003, 0.008, 0.020, 0.035, 0.037, 0.029),
        *(-0.016, -0.032, -0.020, -0.008, 0.003, 0.006, 0.003, -0.002, -0.001),
    ]
)
"""Additional correction times cos 4 alpha, with alpha the direction across the edge."""
TAIL: Final = 0.03
"""Correction beyond the table: d - p^2/G = -TAIL/d."""
MAX_OVERSHOOT: Final = 0.1
"""Largest distance by which a node with pressure lies outside, or one without pressure inside."""
_NEIGHBOURHOOD: Final = np.ones((3, 3), bool)
_WIDTH: Final = ceil(FIT_RADIUS + EXTRA_RADIUS)
"""Width, to each side, of the nodes that affect the edge at one node."""


@dataclass(frozen=True, eq=False)
class Outline:
    """The contact edge near some nodes.

    Attributes
    ----------
    nodes
        Indices (m, 2) of the nodes in the grid.
    distance
        Distance (m,) of the edge from the nodes in spacings, positive in the contact.
    outward
        Outward unit vectors (m, 2) across the edge.
    """

    nodes: Indices
    distance: Array
    outward: Array


def find_outline(pressure: Array, periodic: bool = False) -> Outline:
    """Return the contact edge between the nodes of a grid.

    It contains all nodes next to the edge on either side, except those with too few neighbours or without increasing
    pressure.

    Parameters
    ----------
    pressure
        Pressures (nx, ny) >= 0.
    periodic
        Whether the grid is one period.
    """
    if periodic:
        extended = find_outline(np.pad(pressure, _WIDTH, mode="wrap"))
        nodes = extended.nodes - _WIDTH
        in_period = ((nodes >= 0) & (nodes < pressure.shape)).all(axis=1)
        return Outline(nodes[in_period], extended.distance[in_period], extended.outward[in_period])
    touching = pressure > 0.0
    edge = scipy.ndimage.binary_dilation(~touching, _NEIGHBOURHOOD) & scipy.ndimage.binary_dilation(
        touching, _NEIGHBOURHOOD
    )
    nodes = np.argwhere(edge)
    indices, used = _neighbours(nodes, touching)
    enough = used.sum(axis=1) >= MIN_NODES
    nodes, indices, used = nodes[enough], indices[enough], used[enough]
    if not len(nodes):
        return Outline(nodes, np.zeros(0), np.zeros((0, 2)))
    values = np.where(used, pressure[indices[..., 0], indices[..., 1]], 0.0)
    with np.errstate(all="ignore"):
        distance, outward = _fit(indices - nodes[:, None], used, values)
    inside = touching[nodes[:, 0], nodes[:, 1]]
    valid = np.isfinite(distance) & (np.abs(distance) < FIT_RADIUS)
    distance = np.where(inside, np.maximum(distance, -MAX_OVERSHOOT), np.minimum(distance, MAX_OVERSHOOT))
    return Outline(nodes[valid], distance[valid], outward[valid])


def fourfold(outward: Array) -> Array:
    """Return cos 4 alpha of directions (m, 2), (m,)."""
    square = outward[:, 0] ** 2
    return np.asarray(8.0 * square * (square - 1.0) + 1.0)


def distance_of(pressure: Array, outward: Array) -> Array:
    """Return the distance (m, k) of nodes from the edge.

    Parameters
    ----------
    pressure
        Pressures (m, k) in sqrt(G spacing).
    outward
        Directions (m, 2) across the edge.
    """
    square = pressure**2
    knots = np.arange(len(MEAN_CORRECTION)) * STEP
    last = knots[-1]
    correction = np.interp(pressure, knots, MEAN_CORRECTION) + fourfold(outward)[:, None] * np.interp(
        pressure, knots, FOURFOLD_CORRECTION
    )
    distance: Array = square + np.where(pressure > last, -TAIL / np.maximum(square, 1.0), correction)
    return distance


def _neighbours(nodes: Indices, touching: Flags) -> tuple[Indices, Flags]:
    """Return the indices (m, k, 2) of the nodes around each node, and which of them (m, k) are used in the fit."""
    offsets = np.stack(np.meshgrid(*[np.arange(-_WIDTH, _WIDTH + 1)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    distance = np.hypot(*offsets.T)
    offsets, distance = offsets[distance <= FIT_RADIUS + EXTRA_RADIUS], distance[distance <= FIT_RADIUS + EXTRA_RADIUS]
    indices = nodes[:, None] + offsets
    on_grid = ((indices >= 0) & (indices < touching.shape)).all(axis=2)
    indices = np.clip(indices, 0, np.array(touching.shape) - 1)
    radius = FIT_RADIUS + np.where(touching[nodes[:, 0], nodes[:, 1]], 0.0, EXTRA_RADIUS)
    return indices, on_grid & touching[indices[..., 0], indices[..., 1]] & (distance <= radius[:, None])


def _fit(offsets: Indices, used: Flags, pressure: Array) -> tuple[Array, Array]:
    """Return distance (m,) and direction (m, 2) of the edge from the pressures (m, k) of the nodes around."""
    x, y = np.moveaxis(offsets.astype(float), -1, 0)
    basis = np.stack([np.ones_like(x), x, y, x * x / 2.0, x * y, y * y / 2.0], axis=-1) * used[..., None]
    inverse = np.linalg.pinv(basis)
    square = np.einsum("mck,mk->mc", inverse, pressure**2)
    slope = np.hypot(square[:, 1], square[:, 2])
    outward = -square[:, 1:3] / slope[:, None]
    for _ in range(SWEEPS):
        reduced = np.where(used, distance_of(pressure / np.sqrt(slope)[:, None], outward), 0.0)
        value, gx, gy, xx, xy, yy = np.einsum("mck,mk->cm", inverse, reduced)
        gradient = np.hypot(gx, gy)
        outward = -np.stack([gx, gy], axis=1) / gradient[:, None]
        curvature = outward[:, 0] ** 2 * xx + 2.0 * outward[:, 0] * outward[:, 1] * xy + outward[:, 1] ** 2 * yy
        # root of value - gradient d + curvature d^2 / 2 = 0
        distance = 2.0 * value / (gradient + np.sqrt(gradient**2 - 2.0 * curvature * value))
        # half of the change in logarithms; the full change overshoots where MEAN_CORRECTION is steep
        slope = slope * np.sqrt(gradient - curvature * distance)
    return distance, outward
