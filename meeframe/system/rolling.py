"""Material that flows through a regular grid, one cell at a time, and the reduced system of steady rolling."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.fields import Array, Indices
from meeframe.mesh.regular import shares_frame
from meeframe.system.capabilities import FieldwiseApply, apply_fields
from meeframe.system.reduced import NodalFields, ReducedSystem

C = TypeVar("C")
TANGENTIAL: Final = (0, 1)
_SAME: Final = 1e-3
"""Largest distance of a node from its position on the grid, in spacings."""


@dataclass(frozen=True, eq=False)
class CellShift:
    """Shift of nodal values on a regular grid by one cell against the rolling direction.

    The material that is now at a node was, one cell of rolling before, at the node ahead of it.

    Attributes
    ----------
    ahead
        (n,) node one cell ahead in the rolling direction; at the border of the grid the node itself.
    entering
        (n,) mask of the nodes at that border, at which material enters.
    length
        Length of a cell in the rolling direction [m].
    frames
        (n, 3, 3) local frames of the nodes.
    """

    ahead: Indices
    entering: NDArray[np.bool_]
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
        nx, ny = int(along.max()) + 1, int(across.max()) + 1
        numbers = np.full((nx, ny), -1)
        if nx * ny == len(points) and nx > 1:
            numbers[along, across] = np.arange(len(points))
        if numbers.min() < 0:
            raise CaseError(
                "the nodes of the contact zone form no regular grid along this direction; allowed: a direction along "
                "an axis of a regular grid"
            )
        border = (0 if is_periodic else nx - 1) * np.ones(ny, np.int64)
        successors = np.vstack([numbers[1:], numbers[border[:1]]])
        return cls(successors[along, across], (along == nx - 1) & (not is_periodic), length, frames)

    def restrict(self, nodes: Indices) -> "CellShift":
        """Return the shift on (m,) nodes of the grid that form a grid themselves."""
        number = np.full(len(self.ahead), -1)
        number[nodes] = np.arange(len(nodes))
        ahead = number[self.ahead[nodes]]
        entering = self.entering[nodes] | (ahead < 0)
        ahead = np.where(ahead < 0, np.arange(len(nodes)), ahead)
        return CellShift(ahead, entering, self.length, self.frames[nodes])

    def values(self, values: Array) -> Array:
        """Return nodal values (n, ...) of the material one cell before, those of scalars."""
        return np.asarray(values[self.ahead])

    def tangential(self, components: Array) -> Array:
        """Return components (n, 2) along e1 and e2 of the vectors that the material had one cell before."""
        if shares_frame(self.frames):
            return self.values(components)
        vectors = np.einsum("na,nai->ni", components, self.frames[:, :2])
        return np.asarray(np.einsum("nai,ni->na", self.frames[:, :2], vectors[self.ahead]))

    def load(self, load: Array) -> Array:
        """Return the load (n, fields) that the material had one cell before; it enters without load."""
        shifted = self.values(load)
        shifted[:, :2] = self.tangential(load[:, :2])
        shifted[self.entering] = 0.0
        return shifted


def _positions(coordinates: Array) -> tuple[Indices, float]:
    """Return the position (n,) of each coordinate in a sequence of equal spacings, and the spacing [m].

    All positions are zero if the coordinates have no common spacing.
    """
    levels = np.sort(coordinates)
    steps = np.diff(levels)
    count = 1 + int((steps > _SAME * steps.max(initial=0.0)).sum())
    spacing = float(levels[-1] - levels[0]) / max(count - 1, 1)
    if spacing == 0.0:
        return np.zeros(len(coordinates), np.int64), 0.0
    positions = (coordinates - levels[0]) / spacing
    nearest = np.rint(positions)
    if np.abs(positions - nearest).max() > _SAME * count:
        return np.zeros(len(coordinates), np.int64), 0.0
    return nearest.astype(np.int64), spacing


@final
@dataclass(frozen=True, eq=False)
class SteadyRollingSystem(ReducedSystem, FieldwiseApply):
    """A body whose tangential displacement counts from that of the node ahead, as in steady rolling.

    With the compliance C and the shift S the tangential rows of its compliance are C - S C, the change of displacement
    of the material over one cell. All other rows are those of C.

    Attributes
    ----------
    body
        Body in the frames of the contact.
    cell_shift
        Shift by one cell.
    """

    body: ReducedSystem
    cell_shift: CellShift

    @classmethod
    def of(cls, body: ReducedSystem, cell_shift: CellShift) -> "SteadyRollingSystem":
        """Return the system of a body."""
        geometry = body.points, body.frames, body.weights, body.cells
        return cls(*geometry, _change(cell_shift, body.offset), body, cell_shift)

    def apply(self, load: Array) -> Array:
        """Return the displacement (n, fields), tangential to the surface its change over one cell."""
        return _change(self.cell_shift, self.body.apply(load))

    def apply_fields(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the displacement in some fields; both tangential ones are computed if one is needed."""
        wanted = [*TANGENTIAL, *(k for k in fields if k not in TANGENTIAL)] if set(fields) & {*TANGENTIAL} else fields
        response = apply_fields(self.body, load, loaded, wanted)
        if wanted is not fields:
            response = _change(self.cell_shift, response)
        return response[:, [list(wanted).index(k) for k in fields]]

    def diagonal(self, fields: Sequence[int]) -> Array:
        """Return the diagonals of `diagonal_blocks` in k fields, (n, k)."""
        return self.diagonal_blocks()[:, list(fields), list(fields)]

    def diagonal_blocks(self) -> Array:
        """Return the response of each node to its own load, (n, fields, fields)."""
        blocks = np.ascontiguousarray(self.body.diagonal_blocks())
        inner = np.flatnonzero(~self.cell_shift.entering)
        node = inner[np.argmin(np.linalg.norm(self.points[inner] - self.points.mean(axis=0), axis=1))]
        neighbour = np.empty(blocks.shape[1:])
        for field in range(self.n_fields):
            load = np.zeros_like(self.offset)
            load[node, field] = 1.0
            neighbour[:, field] = self.body.apply(load)[self.cell_shift.ahead[node]]
        # the border of a grid, which has less area, has less response
        share = blocks[:, 2, 2] / blocks[node, 2, 2]
        blocks[:, TANGENTIAL] -= share[:, None, None] * neighbour[list(TANGENTIAL)]
        return blocks

    def dense(self) -> Array | None:
        """Return the compliance (n, fields, n, fields) if that of the body is a matrix."""
        matrix = self.body.dense()
        if matrix is None:
            return None
        columns = matrix.reshape(*matrix.shape[:2], -1)
        changes = [_change(self.cell_shift, columns[:, :, k]) for k in range(columns.shape[2])]
        return np.stack(changes, axis=2).reshape(matrix.shape)

    def recover(self, load: Array) -> NodalFields:
        """Return the fields on the whole boundary of the body."""
        return self.body.recover(load)


def _change(cell_shift: CellShift, displacement: Array) -> Array:
    """Return a displacement (n, k), whose first two columns are replaced by their changes over one cell."""
    changed = displacement.copy(order="K")
    changed[:, :2] -= cell_shift.tangential(displacement[:, :2])
    return changed
