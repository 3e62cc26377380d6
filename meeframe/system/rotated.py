"""A reduced system in other local frames: e1 along a direction field, as friction with principal axes asks for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import Array, Indices
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import (
    BlockResponse,
    Coarsening,
    Edges,
    IndenterEdge,
    NodalFields,
    Prolongation,
    ReducedSystem,
    Stencil,
    Subsystem,
)

TANGENTIAL: Final = frozenset((0, 1))
NORMAL_TO_SURFACE: Final = 1e-9
"""A direction whose part in the tangent plane is a smaller fraction of it points nowhere in that plane."""


def rotate_frames(system: ReducedSystem, directions: Array) -> ReducedSystem:
    """The same relation with each frame turned about its normal, so that e1 follows a direction.

    directions: (n, 3) in global axes, of any length; e1 is along their projection on the tangent plane. Nodes whose
    projection vanishes keep their frame. Offset and compliance are in components of the new frames, recovered fields in
    global axes as before. A DenseSystem if the compliance is held as a matrix, otherwise a RotatedSystem.
    Raises CaseError if directions are of another shape or not finite.
    """
    cosine_sine = _turn(system.frames, directions)
    frames = _turned_frames(system.frames, cosine_sine)
    offset = _rotated(system.offset, cosine_sine)
    parts = system.points, frames, system.weights, system.cells, offset
    matrix = system.dense()
    if matrix is None:
        return RotatedSystem(*parts, original=system, cosine_sine=cosine_sine)
    # responses to the loads on one node, then those of one node to the loads, in the new components
    rows = _rotated(matrix.transpose(2, 3, 0, 1), cosine_sine).transpose(2, 3, 0, 1)
    # of a DenseSystem no more than the recovery, so that its matrix need not stay in memory
    recover = system.recovery if isinstance(system, DenseSystem) else system.recover
    return DenseSystem(
        *parts, np.ascontiguousarray(_rotated(rows, cosine_sine)), partial(_recover, recover, cosine_sine)
    )


def rotated_frames(frames: Array, directions: Array) -> Array:
    """The frames (n, 3, 3) of `turned`, of those of the system. Raises CaseError as there."""
    return _turned_frames(frames, _turn(frames, directions))


def _turned_frames(frames: Array, cosine_sine: Array) -> Array:
    found = frames.copy()
    found[:, :2] = _rotated(frames[:, :2].swapaxes(1, 2), cosine_sine[:, None]).swapaxes(1, 2)
    return found


@final
@dataclass(frozen=True, eq=False)
class RotatedSystem(ReducedSystem):
    """A reduced system that is not held as a matrix, in other frames; see `turned`.

    original: the system in its own frames; cosine_sine: (n, 2) of the angles by which the frames are turned.
    """

    original: ReducedSystem
    cosine_sine: Array

    def apply(self, load: Array) -> Array:
        """compliance(load), (n, 5) for load (n, 5)."""
        return _rotated(self.original.apply(_rotated(load, _inverse(self.cosine_sine))), self.cosine_sine)

    def response(self, load: Array, fields: Sequence[int]) -> Array:
        """compliance(load) in k fields alone, (n, k) for load (n, 5)."""
        asked = _with_both_tangential(fields)
        found = self.original.response(_rotated(load, _inverse(self.cosine_sine)), asked)
        return self._chosen(found, asked, fields)

    def block_response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """compliance in k fields alone, (n, k), of loads (n, l) in l fields alone."""
        return self._answered(self.original.block_response, load, loaded, fields)

    def rough_response(self) -> BlockResponse | None:
        """That of the original, turned."""
        rough = self.original.rough_response()
        return None if rough is None else partial(self._answered, rough)

    def _answered(self, answer: BlockResponse, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """`block_response` by an answer of the original."""
        borne, asked = _with_both_tangential(loaded), _with_both_tangential(fields)
        whole = np.zeros((len(borne), len(load)), load.dtype).T
        whole[:, [borne.index(field) for field in loaded]] = load
        if TANGENTIAL.intersection(loaded):
            whole = _rotated(whole, _inverse(self.cosine_sine))
        return self._chosen(answer(whole, borne, asked), asked, fields)

    def _chosen(self, found: Array, asked: list[int], fields: Sequence[int]) -> Array:
        """Of the original's displacement in the fields asked for, (n, k) in these ones, turned."""
        if TANGENTIAL.intersection(fields):
            found = _rotated(found, self.cosine_sine)
        return found[:, [asked.index(field) for field in fields]]

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array] | None:
        """That of the original, if it is asked for both tangential fields, first of all, or for none of them."""
        tangential = TANGENTIAL.intersection(fields)
        if tangential and tuple(fields[:2]) != (0, 1):
            return None
        inverse = self.original.approximate_inverse(fields)
        if inverse is None or not tangential:
            return inverse
        back, forth = _inverse(self.cosine_sine), self.cosine_sine
        return lambda displacement: _rotated(inverse(_rotated(displacement, back)), forth)

    def extension(self, nodes: Indices) -> Prolongation | None:
        """That of the original."""
        return self.original.extension(nodes)

    def coarser(self) -> Coarsening | None:
        """That of the original, turned likewise."""
        coarse = self.original.coarser()
        if coarse is None:
            return None
        directions = self.frames[coarse.kept, 0]
        return replace(coarse, system=rotate_frames(coarse.system, directions))

    def within(self, nodes: Indices) -> Subsystem | None:
        """That of the original, turned likewise."""
        part = self.original.within(nodes)
        if part is None:
            return None
        there, kept = part.system, part.kept
        geometry = there.points, self.frames[kept], there.weights, there.cells, self.offset[kept]
        return Subsystem(RotatedSystem(*geometry, there, self.cosine_sine[kept]), kept)

    def stencil(self, reach: int, fields: Sequence[int]) -> Stencil | None:
        """That of the original, if all frames are turned alike."""
        found = self.original.stencil(reach, _with_both_tangential(fields))
        if found is None or np.ptp(self.cosine_sine, axis=0).any():
            return None
        blocks: Array = found.responses.reshape(-1, *found.responses.shape[2:])
        responses = _rotated_blocks(blocks, np.broadcast_to(self.cosine_sine[0], (len(blocks), 2)))
        return replace(found, responses=responses.reshape(found.responses.shape))

    def diagonal_blocks(self) -> Array:
        """Response of each node to its own load, (n, 5, 5)."""
        return _rotated_blocks(self.original.diagonal_blocks(), self.cosine_sine)

    def dense(self) -> Array | None:
        """None: of a system that holds its matrix `turned` makes a DenseSystem."""
        return None

    def edges(self, pressure: Array, rim: IndenterEdge | None = None) -> Edges | None:
        """The edge of the contact between the nodes, if the original resolves it."""
        if rim is not None:
            rim = replace(rim, outward=_rotated(rim.outward, _inverse(self.cosine_sine)))
        found = self.original.edges(pressure, rim)
        return None if found is None else replace(found, own=_rotated_blocks(found.own, self.cosine_sine))

    def recover(self, load: Array) -> NodalFields:
        """Fields on the whole boundary for a load (n, 5) on the contact zone."""
        return _recover(self.original.recover, self.cosine_sine, load)


def _turn(frames: Array, directions: Array) -> Array:
    """Cosine and sine (n, 2) of the angle from e1 to the direction in each tangent plane."""
    if np.shape(directions) != (len(frames), 3):
        raise CaseError(f"directions have shape {np.shape(directions)}; {(len(frames), 3)} is needed")
    if not np.isfinite(directions).all():
        node = int(np.argwhere(~np.isfinite(directions))[0][0])
        raise CaseError(f"direction at node {node} is {directions[node]}; allowed: finite components")
    largest = np.abs(directions).max(axis=1, keepdims=True)
    unit = directions / np.where(largest > 0.0, largest, 1.0)
    along = np.einsum("nai,ni->na", frames[:, :2], unit)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    lies = length > NORMAL_TO_SURFACE
    return np.where(lies, along / np.where(lies, length, 1.0), [1.0, 0.0])


def _with_both_tangential(fields: Sequence[int]) -> list[int]:
    """Fields with both tangential ones, first, if one of them is among them."""
    return sorted(TANGENTIAL.union(fields)) if TANGENTIAL.intersection(fields) else list(fields)


def _inverse(cosine_sine: Array) -> Array:
    return cosine_sine * [1.0, -1.0]


def _rotated(components: Array, cosine_sine: Array) -> Array:
    """Components (..., k), the first two tangential, in axes turned by angles of cosine and sine (..., 2)."""
    c, s = cosine_sine[..., 0], cosine_sine[..., 1]
    rotated = components.copy()
    rotated[..., 0] = c * components[..., 0] + s * components[..., 1]
    rotated[..., 1] = c * components[..., 1] - s * components[..., 0]
    return rotated


def _rotated_blocks(blocks: Array, cosine_sine: Array) -> Array:
    """Blocks (n, 5, 5) in axes turned by angles of cosine and sine (n, 2)."""
    turn = cosine_sine[:, None]
    return _rotated(_rotated(blocks.swapaxes(1, 2), turn).swapaxes(1, 2), turn)


def _recover(recover: Callable[[Array], NodalFields], cosine_sine: Array, load: Array) -> NodalFields:
    return recover(_rotated(load, _inverse(cosine_sine)))
