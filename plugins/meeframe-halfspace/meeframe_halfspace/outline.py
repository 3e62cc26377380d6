"""Contact edges between the nodes of a grid, located from the nodal pressures.

At the edge of a contact without singular pressure p^2 rises linearly with the distance d from it, p^2 = G d: a bilinear
density reproduces that from the third node on. Nearer to the edge its nodal values differ from p by a function of d,
in spacings, and of the direction of the edge: NEARER and FOURFOLD are its first terms, from Hertz's pressure on fine
grids. They turn each pressure into a distance, and a quadratic function, fitted to the distances of the nodes around,
says where zero is. Lengths in spacings.
"""

from dataclasses import dataclass
from math import ceil
from typing import Final

import numpy as np
import scipy  # its parts load where they are used
from numpy.typing import NDArray

from meeframe.plugin import Array, Indices

Flags = NDArray[np.bool_]

REACH: Final = 2.9
"""Nodes so near to an edge node are fitted ..."""
BESIDE: Final = 0.5
"""... and so much farther ones, if it lies outside the contact."""
LEAST_NODES: Final = 8
SWEEPS: Final = 8
"""Of slope and distance in turn."""
STEP: Final = 0.1
"""Between the values of NEARER."""
NEARER: Final = np.array(
    [
        *(-0.041, 0.018, 0.062, 0.087, 0.099, 0.095, 0.072, 0.035, -0.008, -0.060),
        *(-0.103, -0.080, -0.047, -0.018, -0.004, -0.005, -0.008, -0.011, -0.009),
    ]
)
"""d - p^2/G at p/sqrt(G) = 0, 0.1, ..., the mean over directions."""
FOURFOLD: Final = np.array(
    [
        *(-0.028, -0.030, -0.022, -0.014, -0.003, 0.008, 0.020, 0.035, 0.037, 0.029),
        *(-0.016, -0.032, -0.020, -0.008, 0.003, 0.006, 0.003, -0.002, -0.001),
    ]
)
"""What comes to it times cos 4 alpha, alpha of the direction across the edge."""
TAIL: Final = 0.03
"""Beyond, d - p^2/G is -TAIL/d."""
OUTERMOST: Final = 0.1
"""A node with pressure is so far outside at most, one without so far inside."""
_AROUND: Final = np.ones((3, 3), bool)
_WIDTH: Final = ceil(REACH + BESIDE)
"""Of all that one node's edge depends on, to each side."""


@dataclass(frozen=True, eq=False)
class Outline:
    """The edge near some nodes. nodes: (m, 2) places of nodes in the grid; distance: (m,) of the edge from there,
    positive in the contact; outward: (m, 2) unit vectors across it."""

    nodes: Indices
    distance: Array
    outward: Array


def find_outline(pressure: Array, periodic: bool = False) -> Outline:
    """The edge of the contact between the nodes of a grid of pressures (nx, ny) >= 0, which may be one period.

    Of all nodes next to it on either side, but for those where too few others or no rising pressure tell.
    """
    if periodic:
        around = find_outline(np.pad(pressure, _WIDTH, mode="wrap"))
        nodes = around.nodes - _WIDTH
        own = ((nodes >= 0) & (nodes < pressure.shape)).all(axis=1)
        return Outline(nodes[own], around.distance[own], around.outward[own])
    touching = pressure > 0.0
    edge = scipy.ndimage.binary_dilation(~touching, _AROUND) & scipy.ndimage.binary_dilation(touching, _AROUND)
    nodes = np.argwhere(edge)
    places, near = _neighbours(nodes, touching)
    known = near.sum(axis=1) >= LEAST_NODES
    nodes, places, near = nodes[known], places[known], near[known]
    if not len(nodes):
        return Outline(nodes, np.zeros(0), np.zeros((0, 2)))
    values = np.where(near, pressure[places[..., 0], places[..., 1]], 0.0)
    with np.errstate(all="ignore"):
        distance, outward = _fitted(places - nodes[:, None], near, values)
    inside = touching[nodes[:, 0], nodes[:, 1]]
    found = np.isfinite(distance) & (np.abs(distance) < REACH)
    distance = np.where(inside, np.maximum(distance, -OUTERMOST), np.minimum(distance, OUTERMOST))
    return Outline(nodes[found], distance[found], outward[found])


def fourfold(outward: Array) -> Array:
    """cos 4 alpha of directions (m, 2), (m,)."""
    square = outward[:, 0] ** 2
    return np.asarray(8.0 * square * (square - 1.0) + 1.0)


def distance_of(pressure: Array, outward: Array) -> Array:
    """Distance (m, k) of nodes from an edge with directions (m, 2) across it; pressures (m, k) in sqrt(G spacing)."""
    square = pressure**2
    knots = np.arange(len(NEARER)) * STEP
    far = knots[-1]
    near = np.interp(pressure, knots, NEARER) + fourfold(outward)[:, None] * np.interp(pressure, knots, FOURFOLD)
    distance: Array = square + np.where(pressure > far, -TAIL / np.maximum(square, 1.0), near)
    return distance


def _neighbours(nodes: Indices, touching: Flags) -> tuple[Indices, Flags]:
    """Places (m, k, 2) of the nodes around each, and which of them (m, k) are in contact and within reach."""
    offsets = np.stack(np.meshgrid(*[np.arange(-_WIDTH, _WIDTH + 1)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    apart = np.hypot(*offsets.T)
    offsets, apart = offsets[apart <= REACH + BESIDE], apart[apart <= REACH + BESIDE]
    places = nodes[:, None] + offsets
    on_grid = ((places >= 0) & (places < touching.shape)).all(axis=2)
    places = np.clip(places, 0, np.array(touching.shape) - 1)
    reach = REACH + np.where(touching[nodes[:, 0], nodes[:, 1]], 0.0, BESIDE)
    return places, on_grid & touching[places[..., 0], places[..., 1]] & (apart <= reach[:, None])


def _fitted(offsets: Indices, near: Flags, pressure: Array) -> tuple[Array, Array]:
    """Distance (m,) and direction (m, 2) of the edge, of nodes with pressures (m, k) around them."""
    x, y = np.moveaxis(offsets.astype(float), -1, 0)
    basis = np.stack([np.ones_like(x), x, y, x * x / 2.0, x * y, y * y / 2.0], axis=-1) * near[..., None]
    fit = np.linalg.pinv(basis)
    square = np.einsum("mck,mk->mc", fit, pressure**2)
    slope = np.hypot(square[:, 1], square[:, 2])
    outward = -square[:, 1:3] / slope[:, None]
    for _ in range(SWEEPS):
        reduced = np.where(near, distance_of(pressure / np.sqrt(slope)[:, None], outward), 0.0)
        value, gx, gy, xx, xy, yy = np.einsum("mck,mk->cm", fit, reduced)
        steep = np.hypot(gx, gy)
        outward = -np.stack([gx, gy], axis=1) / steep[:, None]
        bend = outward[:, 0] ** 2 * xx + 2.0 * outward[:, 0] * outward[:, 1] * xy + outward[:, 1] ** 2 * yy
        # where value - steep d + bend d^2 / 2 = 0
        distance = 2.0 * value / (steep + np.sqrt(steep**2 - 2.0 * bend * value))
        # half of the change, in logarithms: all of it overshoots where NEARER is steep
        slope = slope * np.sqrt(steep - bend * distance)
    return distance, outward
