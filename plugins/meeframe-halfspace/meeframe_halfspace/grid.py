"""Regular grid of the nodes of a flat contact zone."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np

from meeframe.plugin import Array, GridCells, Indices, MeshError
from meeframe_halfspace.flat_zone import FlatZone

POSITION_TOLERANCE: Final = 1e-6
"""Tolerance of positions in spacings."""


@dataclass(frozen=True, eq=False)
class Grid:
    """A regular grid.

    Attributes
    ----------
    size
        Numbers of nodes along e1 and e2.
    spacing
        Spacing along e1 and e2 [m].
    frame
        Rows e1, e2, outward normal, (3, 3).
    numbers
        Number of the node at each position, (nx, ny), e1 along the first axis; None if they count row by row.
    """

    size: tuple[int, int]
    spacing: tuple[float, float]
    frame: Array
    numbers: Indices | None = None

    @property
    def nodes(self) -> Indices:
        """Number of the node at each position, (nx, ny)."""
        return np.arange(self.count).reshape(self.size) if self.numbers is None else self.numbers

    @property
    def count(self) -> int:
        """Number of nodes."""
        return self.size[0] * self.size[1]

    @cached_property
    def _order(self) -> Literal["C", "F"] | None:
        """Order of the numbers of nodes: 'C' along the second axis first, 'F' along the first, None otherwise."""
        if self.numbers is None:
            return "C"
        return "F" if np.array_equal(self.numbers.ravel("F"), np.arange(self.count)) else None

    def to_grid(self, values: Array) -> Array:
        """Return nodal values (k, n) on the grid, (k, nx, ny), as a view if possible."""
        if self._order is None:
            return values[:, self.nodes]
        if self._order == "C":
            return values.reshape(-1, *self.size)
        return values.reshape(-1, *self.size[::-1]).swapaxes(1, 2)

    def scatter(self, values: Array) -> Array:
        """Return values on the grid, (k, nx, ny), at the nodes, (n, k), as a view if possible.

        Fields are stored one after another.
        """
        if self._order == "C":
            return values.reshape(len(values), self.count).T
        nodal = np.empty((len(values), self.count), values.dtype)
        for row_of_values, value in zip(nodal, values, strict=True):
            if self._order is None:
                row_of_values[self.nodes] = value
            else:
                row_of_values.reshape(self.size, order=self._order)[...] = value
        return nodal.T

    @cached_property
    def flat(self) -> tuple[tuple[int, int], Indices | None]:
        """Size of the grid as nodal values are stored, and the position (n,) of each node in it if numbers differ.

        The first axis is e2 if nodes are numbered along e1 first.
        """
        if self._order is None:
            return self.size, np.argsort(self.nodes, axis=None)
        return self.size if self._order == "C" else self.size[::-1], None

    def fractions(self, periodic: bool) -> tuple[Array, Array]:
        """Return fractions (nx,) and (ny,), whose products are those of the density around the nodes in the zone.

        On the border of a free grid half of it is beyond, unless all nodes are on that border: two rows that share a
        length bear load over twice as much, as in plane strain.
        """
        along, across = (widths / widths.max() for widths in self._widths(periodic))
        return along, across

    def weights(self, periodic: bool) -> Array:
        """Return the area of each node [m^2], for a periodic grid as a view of one number."""
        area = self.spacing[0] * self.spacing[1]
        if periodic:
            return np.broadcast_to(area, self.count)
        return self.scatter(np.outer(*self._widths(periodic))[None] * area)[:, 0]

    def _widths(self, periodic: bool) -> tuple[Array, Array]:
        """Widths (nx,) and (ny,) of the nodes in spacings: half of one at the ends of a free grid."""
        along, across = (np.ones(n) for n in self.size)
        if not periodic:
            along[[0, -1]] = across[[0, -1]] = 0.5
        return along, across


def find_grid(zone: FlatZone, name: str) -> Grid:
    """Return the grid of a contact zone.

    Parameters
    ----------
    zone
        The contact zone.
    name
        Name of its face group, for messages.

    Raises
    ------
    MeshError
        Unless its nodes form a full grid with equal spacings along e1 and along e2.
    """
    if isinstance(zone.cells, GridCells):
        first, last = zone.points[0], zone.points[-1]
        extents = (zone.frame @ (last - first))[:2].tolist()
        hx, hy = (extent / (count - 1) for extent, count in zip(extents, zone.cells.shape, strict=True))
        return Grid(zone.cells.shape, (hx, hy), zone.frame)
    x, y, _ = zone.frame @ zone.points.T
    (i, hx), (j, hy) = _positions(x, y, name), _positions(y, x, name)
    nodes = np.full((i.max() + 1, j.max() + 1), -1)
    nodes[i, j] = np.arange(len(i))
    if nodes.size != len(i) or nodes.min() < 0:
        raise _no_grid(name, len(i), f", which would have {nodes.shape[0]} x {nodes.shape[1]}")
    in_order = np.array_equal(nodes.ravel(), np.arange(nodes.size))
    return Grid((nodes.shape[0], nodes.shape[1]), (hx, hy), zone.frame, None if in_order else nodes)


def _no_grid(name: str, count: int, reason: str) -> MeshError:
    return MeshError(
        f"contact zone {name!r}: its {count} nodes do not form a full grid{reason}; allowed: a rectangle of equal "
        "elements with edges along its axes e1 and e2, of quad4, quad9 or tri3 elements, but not quad8"
    )


def _positions(coordinates: Array, others: Array, name: str) -> tuple[Indices, float]:
    """Return the position (n,) of each node along an axis, and the spacing [m]; `others` is the other axis."""
    first, extent = others.min(), float(np.ptp(coordinates))
    edge_coordinates = np.sort(coordinates[others <= first + POSITION_TOLERANCE * np.ptp(others)])
    count = 1 + int((np.diff(edge_coordinates) > POSITION_TOLERANCE * extent).sum())
    if count < 2:
        raise _no_grid(name, len(coordinates), ": only one is on the edge along an axis")
    spacing = float(edge_coordinates[-1] - edge_coordinates[0]) / (count - 1)
    positions = (coordinates - edge_coordinates[0]) / spacing
    nearest = np.rint(positions).astype(np.int64)
    deviation = float(np.abs(positions - nearest).max())
    if deviation > POSITION_TOLERANCE * count:
        raise MeshError(
            f"contact zone {name!r}: its nodes are not equally spaced: one is {deviation:.2g} of the spacing "
            f"{spacing:.3g} m away from its position; allowed: {POSITION_TOLERANCE * count:.2g}"
        )
    return nearest, spacing
