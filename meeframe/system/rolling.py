"""Material that flows through a regular grid, one cell at a time, and the reduced system of steady rolling."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, TypeVar, final

import numpy as np
import scipy  # submodules are loaded on first use
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.fields import TANGENTIAL, Array, Indices
from meeframe.mesh.regular import global_components, local_components, shares_frame
from meeframe.system.capabilities import (
    ApproximateInverse,
    Coarsening,
    FieldwiseApply,
    MaterialFlow,
    Multigrid,
    apply_fields,
)
from meeframe.system.reduced import NodalFields, ReducedSystem

C = TypeVar("C")
MAX_ASPECT_RATIO: Final = 9.0
"""Largest ratio of the sides of a zone with which approximate inverses save products; at 10 they take more."""
RELAXATIONS: Final = (0.1, 1.0, 10.0)
"""Resistances, relative to the response to the shortest wave across the rolling direction, with a relaxation each."""
_POSITION_TOLERANCE: Final = 1e-3
"""Largest distance of a node from its position on the grid, in spacings."""


@dataclass(frozen=True, eq=False)
class CellShift:
    """Shift of nodal values on a regular grid by one cell against the rolling direction.

    The material that is now at a node was, one cell of rolling before, at the node ahead of it.

    Attributes
    ----------
    grid
        (nx, ny) numbers of the nodes, in the rolling direction along the first axis.
    is_periodic
        True if the grid is one period of an infinite one.
    length
        Length of a cell in the rolling direction [m].
    frames
        (nx ny, 3, 3) local frames of the nodes.
    """

    grid: Indices
    is_periodic: bool
    length: float
    frames: Array

    @classmethod
    def of(cls, points: Array, frames: Array, direction: Array, is_periodic: bool = False) -> "CellShift":
        """Return the shift on a grid.

        Parameters
        ----------
        points : (n, 3) array
            Nodes [m].
        frames : (n, 3, 3) array
            Their local frames.
        direction : (3,) array
            Rolling direction, a unit vector in the plane of the nodes.
        is_periodic : bool, optional
            True if the grid is one period of an infinite one.

        Raises
        ------
        CaseError
            If the nodes are no regular grid with an axis along the direction.
        """
        along, length = _positions(points @ direction)
        across, _ = _positions(points @ np.cross(frames[0, 2], direction))
        grid = np.full((along.max() + 1, across.max() + 1), -1)
        if grid.size == len(points) and len(grid) > 1:
            grid[along, across] = np.arange(len(points))
        if grid.min() < 0:
            raise CaseError(
                "the nodes of the contact zone do not form a regular grid along this direction; allowed: a direction "
                "along an axis of a regular grid"
            )
        return cls(grid, is_periodic, length, frames)

    @cached_property
    def next_nodes(self) -> Indices:
        """(n,) node one cell ahead in the rolling direction; at the border of the grid the node itself."""
        next_nodes = np.empty(self.grid.size, np.int64)
        next_nodes[self.grid] = np.concatenate([self.grid[1:], self.grid[:1] if self.is_periodic else self.grid[-1:]])
        return next_nodes

    @cached_property
    def entering(self) -> NDArray[np.bool_]:
        """(n,) mask of the nodes at the border where material enters."""
        entering = np.zeros(self.grid.size, bool)
        if not self.is_periodic:
            entering[self.grid[-1]] = True
        return entering

    def values(self, values: Array) -> Array:
        """Return the values (n, ...) that the material at each node had one cell before."""
        return np.asarray(values[self.next_nodes])

    def tangential(self, components: Array) -> Array:
        """Return components (n, 2) along e1 and e2 of the vectors that the material had one cell before."""
        if shares_frame(self.frames):
            return self.values(components)
        axes = self.frames[:, :2]
        return local_components(axes, self.values(global_components(axes, components)))

    def load(self, load: Array) -> Array:
        """Return the load (n, fields) that the material had one cell before; it enters without load."""
        shifted = self.values(load)
        shifted[:, :2] = self.tangential(load[:, :2])
        shifted[self.entering] = 0.0
        return shifted

    def accumulate(self, changes: Array) -> Array:
        """Return values (n,) of the material, zero where it enters, from their changes over each cell."""
        values = np.empty_like(changes)
        values[self.grid] = np.cumsum(changes[self.grid[::-1]], axis=0)[::-1]
        return values


def _positions(coordinates: Array) -> tuple[Indices, float]:
    """Return the position (n,) of each coordinate in a sequence of equal spacings, and the spacing [m].

    All positions are zero if the coordinates have no common spacing.
    """
    levels = np.sort(coordinates)
    steps = np.diff(levels)
    count = 1 + int((steps > _POSITION_TOLERANCE * steps.max(initial=0.0)).sum())
    spacing = float(levels[-1] - levels[0]) / max(count - 1, 1)
    if spacing > 0.0:
        positions = (coordinates - levels[0]) / spacing
        nearest = np.rint(positions).astype(np.int64)
        if np.abs(positions - nearest).max() <= _POSITION_TOLERANCE * count:
            return nearest, spacing
    return np.zeros(len(coordinates), np.int64), 0.0


@final
@dataclass(frozen=True, eq=False)
class SteadyRollingSystem(ReducedSystem, FieldwiseApply, ApproximateInverse, MaterialFlow, Multigrid):
    """A body whose tangential displacement counts from that of the node ahead, as in steady rolling.

    With the compliance C and the shift S the tangential rows of its compliance are C - S C, the change of displacement
    of the material over one cell. All other rows are those of C. The symmetric part is not negative, as the real part
    of 1 - exp(i k h) is not for any wave k on a grid of spacing h.

    Attributes
    ----------
    body
        Body in the frames of the contact.
    cell_shift
        Shift by one cell.
    cell
        Length of a cell of the finest grid, over which changes count, in lengths of a cell of this grid.
    """

    body: ReducedSystem
    cell_shift: CellShift
    cell: float = 1.0

    @classmethod
    def of(cls, body: ReducedSystem, cell_shift: CellShift, cell: float = 1.0) -> "SteadyRollingSystem":
        """Return the system of a body."""
        geometry = body.points, body.frames, body.weights, body.cells
        return cls(*geometry, _change(cell_shift, body.offset, cell), body, cell_shift, cell)

    def capability(self, kind: type[C]) -> C | None:
        """Return the system itself unless the capability is absent.

        An approximate inverse needs one of the body, a frame that all nodes share, and a zone that is not slender
        unless it is periodic. A coarser division needs one of the body, whose nodes share a frame.
        """
        if kind is Multigrid and (self.body.capability(Multigrid) is None or not shares_frame(self.frames)):
            return None
        if kind is ApproximateInverse and not (
            shares_frame(self.frames)
            and self.body.capability(ApproximateInverse) is not None
            and (self.cell_shift.is_periodic or self._aspect_ratio <= MAX_ASPECT_RATIO)
        ):
            return None
        return super().capability(kind)

    @property
    def _aspect_ratio(self) -> float:
        """Longer side of the zone over the shorter one."""
        corner, along, across = self.points[self.cell_shift.grid[[0, -1, 0], [0, 0, -1]]]
        shorter, longer = sorted((float(np.linalg.norm(along - corner)), float(np.linalg.norm(across - corner))))
        return longer / shorter

    @property
    def flow_lines(self) -> Indices:
        """(nx, ny) numbers of the nodes along the lines of the grid, from the leading border."""
        return self.cell_shift.grid[::-1]

    def apply(self, load: Array) -> Array:
        """Return the displacement (n, fields), tangential to the surface its change over one cell."""
        return _change(self.cell_shift, self.body.apply(load), self.cell)

    def apply_fields(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the displacement in some fields; both tangential ones are computed if one is needed."""
        normal = [field for field in fields if field not in TANGENTIAL]
        if len(normal) == len(fields):
            return apply_fields(self.body, load, loaded, fields)
        known = [*TANGENTIAL, *normal]
        response = _change(self.cell_shift, apply_fields(self.body, load, loaded, known), self.cell)
        return response.T[[known.index(field) for field in fields]].T

    def diagonal(self, fields: Sequence[int]) -> Array:
        """Return the diagonals of `diagonal_blocks` in k fields, (n, k)."""
        return self.diagonal_blocks()[:, list(fields), list(fields)]

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array] | None:
        """Return the inverse of the body after accumulation of the changes from the leading border.

        Gain: a quarter of the products on 64 x 64 nodes, half of them on 32 x 32.
        """
        return self.inverse_with_friction(fields, np.zeros(len(self.points)))

    def inverse_with_friction(self, fields: Sequence[int], resistance: Array) -> Callable[[Array], Array] | None:
        """Return the inverse of the body after accumulation of changes, which relax where friction resists.

        Waves across the rolling direction would otherwise not decay. Gain: half of the products on 128 x 128 nodes.
        """
        body = self.body.capability(ApproximateInverse)
        inverse = None if body is None else body.approximate_inverse(fields)
        if inverse is None or self.capability(ApproximateInverse) is None:
            return None
        columns = [column for column, field in enumerate(fields) if field in TANGENTIAL]
        relaxation = _Relaxation.of(self.cell_shift.grid, resistance / self.cell, self._of_middle[2])

        def solve(changes: Array) -> Array:
            displacement = changes.copy(order="K")
            is_changed = changes.any(axis=1)  # beyond these nodes the displacement decays
            if columns:
                accumulated = relaxation.accumulate(changes[:, columns] / self.cell)
                displacement[:, columns] = np.where(is_changed, accumulated.T, 0.0).T
            return inverse(displacement)

        return solve

    def diagonal_blocks(self) -> Array:
        """Return the response of each node to its own load, (n, fields, fields).

        The response of the node ahead is that in the middle of the grid, in proportion to the area of each node.
        """
        blocks = self.body.diagonal_blocks().copy()
        node, at_next_node, _ = self._of_middle
        share = blocks[:, 2, 2] / blocks[node, 2, 2]
        blocks[:, TANGENTIAL] -= share[:, None, None] * at_next_node[list(TANGENTIAL)]
        blocks[:, TANGENTIAL] *= self.cell
        return blocks

    def coarsen(self) -> Coarsening:
        """Return the system on the coarser division of the body, with changes over a cell of the finest grid."""
        return self._coarsening

    @cached_property
    def _coarsening(self) -> Coarsening:
        multigrid = self.body.capability(Multigrid)
        assert multigrid is not None
        coarse, grid = multigrid.coarsen(), self.cell_shift.grid
        direction = self.points[grid[1, 0]] - self.points[grid[0, 0]]
        direction = direction / np.linalg.norm(direction)
        body = coarse.system
        shift = CellShift.of(body.points, body.frames, direction, self.cell_shift.is_periodic)
        cell = self.cell * self.cell_shift.length / shift.length
        return replace(coarse, system=SteadyRollingSystem.of(body, shift, cell))

    @cached_property
    def _of_middle(self) -> tuple[int, Array, Array]:
        """A node in the middle, and what its loads cause.

        These are the displacements (fields, fields) of the node ahead of it, and the mean tangential ones in the
        direction of the load, (ny,), summed up along the rolling direction.
        """
        grid = self.cell_shift.grid
        node = int(grid[len(grid) // 2 - 1, grid.shape[1] // 2])
        at_next_node = np.empty((self.n_fields, self.n_fields))
        across = np.zeros(grid.shape[1])
        for field in range(self.n_fields):
            load = np.zeros_like(self.offset)
            load[node, field] = 1.0
            response = self.body.apply(load)
            at_next_node[:, field] = response[node] - _change(self.cell_shift, response, 1.0)[node]
            if field in TANGENTIAL:
                across += response[grid, field].sum(axis=0) / len(TANGENTIAL)
        return node, at_next_node, across

    def dense(self) -> Array | None:
        """Return the compliance (n, fields, n, fields) if that of the body is a matrix."""
        return self._matrix

    @cached_property
    def _matrix(self) -> Array | None:
        matrix = self.body.dense()
        if matrix is None:
            return None
        columns = matrix.reshape(*matrix.shape[:2], -1)
        changes = [_change(self.cell_shift, columns[:, :, k], self.cell) for k in range(columns.shape[2])]
        return np.stack(changes, axis=2).reshape(matrix.shape)

    def recover(self, load: Array) -> NodalFields:
        """Return the fields on the whole boundary of the body."""
        return self.body.recover(load)


@dataclass(frozen=True, eq=False)
class _Relaxation:
    """Accumulation of changes f over each cell to displacements u that relax: r K u + du = f, with resistances r.

    K is the stiffness of the body against waves across the rolling direction, among which are those that relax slowly.
    The relaxation in a cell is interpolated between those at a few resistances, and none.

    Attributes
    ----------
    grid
        (nx, ny) numbers of the nodes.
    factors
        (levels, 1, waves), factors of the waves in a cell at each of these resistances.
    shares
        (nx, 1 + levels, ny), shares of no relaxation and of that at each resistance.
    """

    grid: Indices
    factors: Array
    shares: Array

    @classmethod
    def of(cls, grid: Indices, resistance: Array, response: Array) -> "_Relaxation":
        """Return the accumulation with resistances (n,) of the nodes.

        response: (ny,), displacement of the body by loads along a line in the rolling direction, in the middle.
        """
        compliance, levels = np.abs(scipy.fft.rfft(response)) + np.finfo(float).tiny, np.array(RELAXATIONS)
        compliance[0] = compliance.max()  # a periodic surface has none against uniform load
        relative = resistance[grid] / compliance.min()
        position = 1.0 + np.interp(np.log(np.maximum(relative, levels[0])), np.log(levels), np.arange(len(levels)))
        position = np.minimum(position, relative / levels[0])
        shares = np.maximum(1.0 - np.abs(position[:, None] - np.arange(1 + len(levels))[:, None]), 0.0)
        factors = 1.0 / (1.0 + np.outer(levels, compliance.min() / compliance))
        return cls(grid, factors[:, None].astype(np.float32), shares.astype(np.float32))

    def accumulate(self, changes: Array) -> Array:
        """Return the displacements (n, k) of changes (n, k), from the leading border to the last change."""
        on_grid = changes.T[:, self.grid].swapaxes(0, 1)
        relaxing = np.asarray(self.shares[:, 1:].sum(axis=(1, 2)) > 0.0)
        places = np.flatnonzero(np.abs(on_grid).sum(axis=(1, 2)))
        values = np.zeros_like(on_grid[0])
        for place in range(places.max(initial=-1), places.min(initial=0) - 1, -1):
            values = values + on_grid[place]
            if relaxing[place]:
                waves = scipy.fft.irfft(self.factors * scipy.fft.rfft(values), values.shape[1])
                share = self.shares[place, :, None]
                values = share[0] * values + (share[1:] * waves).sum(axis=0)
            on_grid[place] = values
        accumulated = np.empty_like(changes)
        accumulated[self.grid] = on_grid.swapaxes(1, 2)
        return accumulated


def _change(cell_shift: CellShift, displacement: Array, cell: float) -> Array:
    """Return a displacement (n, k), whose first two columns are replaced by their changes over a part of a cell."""
    changed = displacement.copy(order="K")
    changed[:, :2] -= cell_shift.tangential(displacement[:, :2])
    changed[:, :2] *= cell
    return changed
