"""The regular grid that the nodes of a flat contact zone form."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np

from meeframe.core.errors import MeshError
from meeframe.core.fields import Array
from meeframe.core.mesh import Indices
from meeframe.geometry import ContactZone

SAME: Final = 1e-6
"""Of a spacing: nodes nearer to a place of the grid stand there."""


@dataclass(frozen=True, eq=False)
class Grid:
    """nodes: (nx, ny) node at each place, e1 along the first axis; spacing: along e1 and e2 [m]; frame: (3, 3), rows
    e1, e2, outward normal."""

    nodes: Indices
    spacing: tuple[float, float]
    frame: Array

    @property
    def size(self) -> tuple[int, int]:
        """Nodes along e1 and e2."""
        return self.nodes.shape[0], self.nodes.shape[1]

    @cached_property
    def _order(self) -> Literal["C", "F"] | None:
        """Whether the nodes are numbered along the second axis first, or along the first; None if they are not."""
        counted = np.arange(self.nodes.size)
        if np.array_equal(self.nodes.ravel("C"), counted):
            return "C"
        return "F" if np.array_equal(self.nodes.ravel("F"), counted) else None

    def place(self, values: Array) -> Array:
        """Nodal values (n,) on the grid, (nx, ny)."""
        return values[self.nodes] if self._order is None else values.reshape(self.size, order=self._order)

    def gather(self, values: Array) -> Array:
        """Nodal values (n, k) on the grid, (k, nx, ny)."""
        gathered = np.empty((values.shape[1], *self.size))
        for field, part in enumerate(gathered):
            part[...] = self.place(values[:, field])
        return gathered

    def scatter(self, values: Array) -> Array:
        """Values on the grid, (k, nx, ny), at the nodes, (n, k); fields are stored one after another."""
        nodal = np.empty((len(values), self.nodes.size))
        for part, value in zip(nodal, values, strict=True):
            if self._order is None:
                part[self.nodes] = value
            else:
                part.reshape(self.size, order=self._order)[...] = value
        return nodal.T

    def weights(self, periodic: bool) -> Array:
        """Area that belongs to each node [m^2]: a cell, of which a free grid has half or a quarter on its border."""
        shares = [np.ones(n) for n in self.size]
        if not periodic:
            for share in shares:
                share[[0, -1]] = 0.5
        areas = np.outer(*shares) * (self.spacing[0] * self.spacing[1])
        return self.scatter(areas[None])[:, 0]


def find_grid(zone: ContactZone, name: str) -> Grid:
    """The grid of a contact zone; name: of its face group.

    Raises MeshError unless the zone is flat and its nodes are the places of a full grid with equal spacings along e1
    and along e2.
    """
    frame = zone.frames[0]
    turn = float(np.abs(zone.frames - frame).max())
    along, across, level = (zone.points @ frame.T).T
    extent = max(np.ptp(along), np.ptp(across))
    if turn > SAME or np.ptp(level) > SAME * extent:
        raise MeshError(f"contact zone {name!r}: a half space has a flat one; this is {np.ptp(level):.3g} m deep")
    (i, hx), (j, hy) = _places(along, name), _places(across, name)
    nodes = np.full((i.max() + 1, j.max() + 1), -1)
    nodes[i, j] = np.arange(len(i))
    if nodes.size != len(i) or nodes.min() < 0:
        raise MeshError(
            f"contact zone {name!r}: its {len(i)} nodes are no full grid, which would have {nodes.shape[0]} x "
            f"{nodes.shape[1]}; allowed: a rectangle of equal elements with edges along its axes e1 and e2, without "
            "nodes on edges alone (quad4, quad9, tri3, but not quad8)"
        )
    return Grid(nodes, (hx, hy), frame)


def _places(coordinates: Array, name: str) -> tuple[Indices, float]:
    """Place (n,) of each node along an axis, and the spacing [m]."""
    ordered = np.sort(coordinates)
    steps = np.diff(ordered)
    count = 1 + int((steps > SAME * (ordered[-1] - ordered[0])).sum())
    if count < 2:
        raise MeshError(f"contact zone {name!r}: one row of nodes is no grid")
    spacing = float(ordered[-1] - ordered[0]) / (count - 1)
    places = (coordinates - ordered[0]) / spacing
    nearest = np.rint(places).astype(np.int64)
    off = float(np.abs(places - nearest).max())
    if off > SAME * count:
        raise MeshError(
            f"contact zone {name!r}: its nodes are not equally spaced: one is {off:.2g} of the spacing {spacing:.3g} m "
            f"away from its place; allowed: {SAME * count:.2g}"
        )
    return nearest, spacing
