"""The regular grid that the nodes of a flat contact zone form."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np

from meeframe.plugin import Array, Indices, MeshError
from meeframe_halfspace.flat_zone import FlatZone

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
        """Nodal values (k, n) on the grid, (k, nx, ny), in the same memory if it can be."""
        if self._order is None:
            return values[:, self.nodes]
        if self._order == "C":
            return values.reshape(-1, *self.size)
        return values.reshape(-1, *self.size[::-1]).swapaxes(1, 2)

    def scatter(self, values: Array) -> Array:
        """Values on the grid, (k, nx, ny), at the nodes, (n, k), in the same memory if it can be.

        Fields are stored one after another.
        """
        if self._order == "C":
            return values.reshape(len(values), self.nodes.size).T
        nodal = np.empty((len(values), self.nodes.size), values.dtype)
        for part, value in zip(nodal, values, strict=True):
            if self._order is None:
                part[self.nodes] = value
            else:
                part.reshape(self.size, order=self._order)[...] = value
        return nodal.T

    @cached_property
    def flat(self) -> tuple[tuple[int, int], Indices | None]:
        """Size of the grid as nodal values are stored, and the place (n,) of each node in it, None if it is its number.

        The first axis is e2 if nodes are numbered along e1 first.
        """
        if self._order is None:
            return self.size, np.argsort(self.nodes, axis=None)
        return self.size if self._order == "C" else self.size[::-1], None

    def weights(self, periodic: bool) -> Array:
        """Area that belongs to each node [m^2]: a cell, of which a free grid has half or a quarter on its border."""
        shares = [np.ones(n) for n in self.size]
        if not periodic:
            for share in shares:
                share[[0, -1]] = 0.5
        areas = np.outer(*shares) * (self.spacing[0] * self.spacing[1])
        return self.scatter(areas[None])[:, 0]


def find_grid(zone: FlatZone, name: str) -> Grid:
    """The grid of a contact zone; name: of its face group.

    Raises MeshError unless its nodes are the places of a full grid with equal spacings along e1 and along e2.
    """
    along, across, _ = zone.frame @ zone.points.T
    (i, hx), (j, hy) = _places(along, across, name), _places(across, along, name)
    nodes = np.full((i.max() + 1, j.max() + 1), -1)
    nodes[i, j] = np.arange(len(i))
    if nodes.size != len(i) or nodes.min() < 0:
        raise _no_grid(name, len(i), f", which would have {nodes.shape[0]} x {nodes.shape[1]}")
    return Grid(nodes, (hx, hy), zone.frame)


def _no_grid(name: str, count: int, reason: str) -> MeshError:
    return MeshError(
        f"contact zone {name!r}: its {count} nodes are no full grid{reason}; allowed: a rectangle of equal elements "
        "with edges along its axes e1 and e2, without nodes on edges alone (quad4, quad9, tri3, but not quad8)"
    )


def _places(coordinates: Array, others: Array, name: str) -> tuple[Indices, float]:
    """Place (n,) of each node along an axis, and the spacing [m]; others: coordinates along the other axis."""
    first, extent = others.min(), float(np.ptp(coordinates))
    row = np.sort(coordinates[others <= first + SAME * np.ptp(others)])
    count = 1 + int((np.diff(row) > SAME * extent).sum())
    if count < 2:
        raise _no_grid(name, len(coordinates), ": only one is on the edge along an axis")
    spacing = float(row[-1] - row[0]) / (count - 1)
    places = (coordinates - row[0]) / spacing
    nearest = np.rint(places).astype(np.int64)
    off = float(np.abs(places - nearest).max())
    if off > SAME * count:
        raise MeshError(
            f"contact zone {name!r}: its nodes are not equally spaced: one is {off:.2g} of the spacing {spacing:.3g} m "
            f"away from its place; allowed: {SAME * count:.2g}"
        )
    return nearest, spacing
