"""Reduced systems in other local frames: e1 along a direction field, as for friction with principal axes."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final, final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import MECHANICAL, Array
from meeframe.system.capabilities import InteriorFields, PointFields
from meeframe.system.composed import Rotation, Term, compose
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import NodalFields, Progress, ReducedSystem, silent

MIN_TANGENTIAL_COMPONENT: Final = 1e-9
"""Smallest tangential fraction of a direction; below it the direction is taken as normal to the surface."""


def rotate_frames(system: ReducedSystem, directions: Array) -> ReducedSystem:
    """Return the same system with each frame rotated about its normal, so that e1 follows a direction.

    Parameters
    ----------
    system
        The system in its own frames.
    directions : (n, 3) array
        Directions in global axes, of any length; e1 is along their projections on the tangent planes. Nodes whose
        projection vanishes keep their frame.

    Returns
    -------
    ReducedSystem
        Offset and compliance in components of the new frames, recovered fields in global axes as before. A
        `DenseSystem` if the compliance is stored as a matrix, otherwise a `ComposedSystem`.

    Raises
    ------
    CaseError
        If directions have another shape or are not finite.
    """
    frames = rotated_frames(system.frames, directions)
    blocks = np.tile(np.eye(system.n_fields), (len(frames), 1, 1))
    blocks[:, MECHANICAL, MECHANICAL] = frames @ system.frames.transpose(0, 2, 1)
    # rotations about the normal mix nothing but the tangential components
    blocks[:, :2, 2] = blocks[:, 2, :2] = 0.0
    blocks[:, 2, 2] = 1.0
    rotation = Rotation.of(blocks)
    offset = rotation.change(system.offset, range(system.n_fields), range(system.n_fields))
    composed = compose(system, (Term(system, rotation),), frames, offset)
    if composed.matrix is None:
        return composed
    # of a DenseSystem no more than the recovery, so that its matrix need not stay in memory
    interior = system.capability(InteriorFields)
    recover = system.recovery if isinstance(system, DenseSystem) else system.recover
    return DenseSystem(
        system.points,
        frames,
        system.weights,
        system.cells,
        offset,
        composed.matrix,
        partial(_recover, recover, rotation),
        None if interior is None else _RotatedInterior(interior, rotation),
    )


def rotated_frames(frames: Array, directions: Array) -> Array:
    """Return frames (n, 3, 3), each rotated about its normal so that e1 follows a direction; see `rotate_frames`."""
    if np.shape(directions) != (len(frames), 3):
        raise CaseError(f"directions have shape {np.shape(directions)}; {(len(frames), 3)} is needed")
    if not np.isfinite(directions).all():
        node = int(np.argwhere(~np.isfinite(directions))[0][0])
        raise CaseError(f"direction at node {node} is {directions[node]}; allowed: finite components")
    largest = np.abs(directions).max(axis=1, keepdims=True)
    unit = directions / np.where(largest > 0.0, largest, 1.0)
    along = np.einsum("nai,ni->na", frames[:, :2], unit)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    tangential = length > MIN_TANGENTIAL_COMPONENT
    cosine, sine = np.where(tangential, along / np.where(tangential, length, 1.0), [1.0, 0.0]).T[:, :, None]
    rotated = frames.copy()
    rotated[:, 0] = cosine * frames[:, 0] + sine * frames[:, 1]
    rotated[:, 1] = cosine * frames[:, 1] - sine * frames[:, 0]
    return rotated


@final
@dataclass(frozen=True, eq=False)
class _RotatedInterior(InteriorFields):
    """Interior fields for loads in rotated frames."""

    interior: InteriorFields
    rotation: Rotation

    def evaluate(self, load: Array, points: Array, progress: Progress = silent) -> PointFields:
        """Return the fields at points (m, 3) inside the body for a load (n, f) in the rotated frames."""
        fields = range(self.rotation.n_fields)
        return self.interior.evaluate(self.rotation.inverse.change(load, fields, fields), points, progress)


def _recover(recover: Callable[[Array], NodalFields], rotation: Rotation, load: Array) -> NodalFields:
    return recover(rotation.inverse.change(load, range(rotation.n_fields), range(rotation.n_fields)))
