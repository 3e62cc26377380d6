"""Contract of a rigid indenter: the shape of its surface above the undeformed contact zone, and its motions."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, final

import numpy as np

from meeframe.common.timed import TimeLimited
from meeframe.fields import MECHANICAL, MEE, N_MECHANICAL, Array, FieldSet
from meeframe.mesh.regular import extreme_points, local_components, shared_frames, shares_frame

N_RIGID: Final = 6
"""Number of rigid motions of the indenter, which come before its potentials."""

RIGID_MOTIONS: Final = {"approach": slice(0, 1), "translation": slice(1, 3), "tilt": slice(3, 5), "twist": slice(5, 6)}
"""Indices of the rigid motions among the degrees of freedom of the indenter."""

RIGID_RESULTANTS: Final = {
    "normal_force": slice(0, 1),
    "tangential_force": slice(1, 3),
    "moment": slice(3, 5),
    "torque": slice(5, 6),
}
"""Indices of the resultants, equal to those of their conjugate motions."""

FORCE_RATIO: Final = "force_ratio"
"""Ratio of tangential to normal force, which may be prescribed in place of the tangential force."""

_BLOCK: Final = 2**16
"""Number of points whose positions are read at once: blocks take little memory."""

_RIGID_UNITS: Final = {
    "approach": "m",
    "normal_force": "N",
    "translation": "m",
    "tangential_force": "N",
    FORCE_RATIO: "1",
    "tilt": "rad",
    "moment": "N m",
    "twist": "rad",
    "torque": "N m",
}


@dataclass(frozen=True)
class IndenterMotions:
    """Names, indices and units of the degrees of freedom of an indenter: six rigid motions and its potentials.

    Attributes
    ----------
    fields : FieldSet
        Field set of the body. Each of its scalar fields adds a potential, which counts as a motion, and a total
        flux, the resultant that works on it.
    """

    fields: FieldSet = MEE

    @cached_property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return N_RIGID + len(self.fields.scalars)

    @cached_property
    def motions(self) -> Mapping[str, slice]:
        """Indices of each motion by name."""
        return RIGID_MOTIONS | self._scalars([scalar.value_name for scalar in self.fields.scalars])

    @cached_property
    def resultants(self) -> Mapping[str, slice]:
        """Indices of each resultant by name, equal to those of its conjugate motion."""
        return RIGID_RESULTANTS | self._scalars([scalar.resultant for scalar in self.fields.scalars])

    @cached_property
    def columns(self) -> Mapping[str, slice]:
        """Indices of all quantities that a load step may prescribe, by name."""
        return {**self.motions, **self.resultants, FORCE_RATIO: RIGID_RESULTANTS["tangential_force"]}

    @cached_property
    def units(self) -> Mapping[str, str]:
        """SI units of all quantities that a load step may prescribe, by name."""
        scalars = (
            unit
            for scalar in self.fields.scalars
            for unit in ((scalar.value_name, scalar.value_unit), (scalar.resultant, scalar.resultant_unit))
        )
        return _RIGID_UNITS | dict(scalars)

    @staticmethod
    def _scalars(names: Sequence[str]) -> dict[str, slice]:
        return {name: slice(index, index + 1) for index, name in enumerate(names, N_RIGID)}


MOTIONS: Final = IndenterMotions().motions
RESULTANTS: Final = IndenterMotions().resultants
COLUMNS: Final = IndenterMotions().columns
UNITS: Final = IndenterMotions().units
N_MOTIONS: Final = IndenterMotions().size
"""Number of degrees of freedom of the indenter with the default field set."""


@dataclass(frozen=True, eq=False)
class Indenter(TimeLimited, ABC):
    """Rigid indenter; the fields of a concrete class are its case-file keys."""

    @abstractmethod
    def height(self, x: Array, y: Array) -> Array:
        """Return the height of the surface of the indenter above its lowest point.

        Parameters
        ----------
        x, y : Array
            Coordinates from the axis of the indenter in its own plane, (n,) each [m].

        Returns
        -------
        Array
            Heights, (n,) >= 0 [m], inf where there is no indenter.
        """

    @property
    def pointwise(self) -> bool:
        """True if heights are known at single points only, so that they do not show where the indenter ends."""
        return False


@final
@dataclass(frozen=True, eq=False)
class MotionModes(Sequence[Array]):
    """Motion of the indenter's surface per unit of each motion, (n, fields) in local frames, computed when it is read.

    Motions are small: approach against the axis, translation along e1 and e2, right-handed rotations about e1, e2 and
    the axis; a unit potential is -1 in its column, as in a displacement of ReducedSystem.

    Attributes
    ----------
    points : Array
        Points of the surface, (n, 3) [m].
    frames : Array
        Local frames, (n, 3, 3), as in ReducedSystem.
    axes : Array
        Rows e1, e2 and axis of the indenter, (3, 3).
    reference : Array
        Point of the indenter about which it tilts and twists, (3,) [m].
    fields : FieldSet
        Field set of the body.
    """

    points: Array
    frames: Array
    axes: Array
    reference: Array
    fields: FieldSet = MEE

    def __len__(self) -> int:
        """Return the number of motions."""
        return N_RIGID + len(self.fields.scalars)

    def __getitem__(self, number: Any) -> Any:
        """Return a mode (n, fields), as a view of one row if it is the same at all points."""
        if not 0 <= number < len(self):
            raise IndexError(f"motion {number} of {len(self)}")
        shape = len(self.points), self.fields.size
        same = np.zeros(self.fields.size)
        if number >= N_RIGID:
            same[N_MECHANICAL + number - N_RIGID] = -1.0
            return np.broadcast_to(same, shape)
        if number < 3:
            displacement = np.broadcast_to((-self.axes[2], self.axes[0], self.axes[1])[number], self.points.shape)
            if shares_frame(self.frames):
                same[MECHANICAL] = self.frames[0] @ displacement[0]
                return np.broadcast_to(same, shape)
        else:
            displacement = np.cross(self.axes[number - 3], self.points - self.reference)
        # field by field: a column that is zero throughout is never written, and takes no memory
        mode = np.zeros(shape[::-1]).T
        for column, values in enumerate(local_components(self.frames, displacement).T):
            if values.any():
                mode[:, column] = values
        return mode

    def work(self, forces: Mapping[int, Array]) -> Array:
        """Return the work of forces on each mode, where the frames of all points are equal.

        Parameters
        ----------
        forces : dict of int to Array
            Forces at the points by their column, (n,) each.

        Returns
        -------
        Array
            Sums of mode times force, (motions,).

        Notes
        -----
        The modes are linear functions of the position, so that the sum and the first moments of each column suffice.
        """
        probes = self.reference + np.concatenate([np.zeros((1, 3)), np.eye(3)])
        at_probes = motion_modes(probes, shared_frames(self.frames[0], 4), self.axes, self.reference, self.fields)
        slopes, result = at_probes[:, 1:] - at_probes[:, :1], np.zeros(len(self))
        for column, force in forces.items():
            total = float(force.sum())
            blocks = [slice(first, first + _BLOCK) for first in range(0, len(force), _BLOCK)]
            moments = sum(force[nodes] @ self.points[nodes] for nodes in blocks) - total * self.reference
            result += at_probes[:, 0, column] * total + slopes[:, :, column] @ moments
        return result

    def at_extremes(self) -> "MotionModes":
        """Return the modes at a few points where the components of each are largest and smallest, if frames are equal.

        These are the corners of a box around the points, since the modes are linear functions of the position.
        """
        if not shares_frame(self.frames):
            return self
        points = extreme_points(self.points)
        ends = np.stack([points.min(axis=0), points.max(axis=0)])
        corners = np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(-1, 3)
        return replace(self, points=corners, frames=shared_frames(self.frames[0], len(corners)))


def motion_modes(points: Array, frames: Array, axes: Array, reference: Array, fields: FieldSet = MEE) -> Array:
    """Return all modes of `MotionModes` as an array.

    Parameters
    ----------
    points : Array
        Points of the surface, (n, 3) [m].
    frames : Array
        Local frames, (n, 3, 3), as in ReducedSystem.
    axes : Array
        Rows e1, e2 and axis of the indenter, (3, 3).
    reference : Array
        Point of the indenter about which it tilts and twists, (3,) [m].
    fields : FieldSet
        Field set of the body.

    Returns
    -------
    Array
        Modes, (motions, n, fields).
    """
    return np.stack(list(MotionModes(points, frames, axes, reference, fields)))


def motion_density(mode: Array, number: int) -> Array:
    """Return the resultant that works on a motion, per area and unit load.

    Parameters
    ----------
    mode : Array
        Mode of the motion, (n, fields).
    number : int
        Number of the motion.

    Returns
    -------
    Array
        Densities, (n, fields): the mode of a rigid motion, and minus that of a potential, whose mode is negated.
    """
    if number < N_RIGID:
        return mode
    return -mode if mode.strides[0] else np.broadcast_to(-mode[0], mode.shape)


def total_resultants(modes: Sequence[Array] | Array, weights: Array, load: Array) -> Array:
    """Return the resultants of a load that work on the motions.

    Parameters
    ----------
    modes : MotionModes or Array
        Modes, (motions, n, fields), as of `motion_modes`.
    weights : Array
        Integration weights, (n,) [m^2], as in ReducedSystem.
    load : Array
        Load, (n, fields), in local frames.

    Returns
    -------
    Array
        Resultants, (motions,). Forces [N] and moments [N m] are those of the indenter on the body, the normal force
        positive in compression; total fluxes, such as the charge [C], are what leaves the body.
    """
    weighted = {number: weights * column for number, column in enumerate(load.T) if column.any()}
    if isinstance(modes, MotionModes) and shares_frame(modes.frames):
        result = modes.work(weighted)
    else:
        totals = (sum(float(mode[:, number] @ column) for number, column in weighted.items()) for mode in modes)
        result = np.array(list(totals), float)  # sums over no column are integers
    result[N_RIGID:] *= -1.0
    return result
