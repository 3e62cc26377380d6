"""Contract of a rigid indenter: the shape of its surface above the undeformed contact zone, and its motions."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from meeframe.fields import MEE, N_MECHANICAL, Array, FieldSet
from meeframe.mesh.regular import local_components

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
class Indenter(ABC):
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


def motion_modes(points: Array, frames: Array, axes: Array, reference: Array, fields: FieldSet = MEE) -> Array:
    """Return the motion of the indenter's surface per unit of each motion, (motions, n, fields), in local frames.

    points: (n, 3) [m]; frames: (n, 3, 3) as in ReducedSystem; axes: rows e1, e2 and axis of the indenter, (3, 3);
    reference: point of the indenter about which it tilts and twists, (3,) [m]. Motions are small: approach against the
    axis, translation along e1 and e2, right-handed rotations about e1, e2 and the axis; a unit potential is -1 in its
    column, as in a displacement of ReducedSystem.
    """
    potentials = np.arange(len(fields.scalars))
    # field by field: a column that is zero throughout is never written, and takes no memory
    modes = np.zeros((N_RIGID + len(potentials), fields.size, len(points))).transpose(0, 2, 1)
    for number in range(N_RIGID):
        if number < 3:
            displacement = np.broadcast_to((-axes[2], axes[0], axes[1])[number], points.shape)
        else:
            displacement = np.cross(axes[number - 3], points - reference)
        local = local_components(frames, displacement)
        for column in range(N_MECHANICAL):
            if local[:, column].any():
                modes[number, :, column] = local[:, column]
    modes[N_RIGID + potentials, :, N_MECHANICAL + potentials] = -1.0
    return modes


def motion_measures(modes: Array, weights: Array) -> Array:
    """Return measures (motions, n, fields) of the resultants that work on the motions.

    Each resultant is sum(measure * load) of a load (n, fields). modes: as returned by motion_modes; weights: (n,) [m^2]
    as in ReducedSystem. Forces [N] and moments [N m] are those of the indenter on the body, the normal force positive
    in compression; total fluxes, such as the charge [C], are what leaves the body.
    """
    return np.stack([motion_measure(modes, weights, number) for number in range(len(modes))])


def motion_measure(modes: Array, weights: Array, number: int) -> Array:
    """Return one of the measures of `motion_measures`, (n, fields)."""
    signs = weights if number < N_RIGID else -weights
    measure = np.zeros(modes.shape[:0:-1]).T  # field by field, as the modes
    for column, mode in enumerate(modes[number].T):
        if mode.any():
            measure[:, column] = signs * mode
    return measure


def total_resultants(modes: Array, weights: Array, load: Array) -> Array:
    """Return the resultants (motions,) of a load (n, fields), see `motion_measures`, without their measures."""
    weighted = [weights * column for column in load.T]
    result = np.array(
        [sum(float(mode @ column) for mode, column in zip(each.T, weighted, strict=True)) for each in modes]
    )
    result[N_RIGID:] *= -1.0
    return result
