"""Contract of a rigid indenter: the shape of its surface above the undeformed contact zone, and how it moves."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.fields import ELECTRIC, MAGNETIC, MECHANICAL, N_FIELDS, Array

MOTIONS: Final = {
    "approach": slice(0, 1),
    "translation": slice(1, 3),
    "tilt": slice(3, 5),
    "twist": slice(5, 6),
    "electric_potential": slice(6, 7),
    "magnetic_potential": slice(7, 8),
}
"""Where each motion of the indenter stands among its eight degrees of freedom; its potentials count as motions."""

RESULTANTS: Final = {
    "normal_force": slice(0, 1),
    "tangential_force": slice(1, 3),
    "moment": slice(3, 5),
    "torque": slice(5, 6),
    "charge": slice(6, 7),
    "magnetic_flux": slice(7, 8),
}
"""The resultant that works on each motion, at the same place."""

FORCE_RATIO: Final = "force_ratio"
"""Tangential over normal force, which may be prescribed in place of the tangential force."""

COLUMNS: Final = MOTIONS | RESULTANTS | {FORCE_RATIO: RESULTANTS["tangential_force"]}
"""Places of everything that a load step may prescribe."""

UNITS: Final = {
    "approach": "m",
    "normal_force": "N",
    "translation": "m",
    "tangential_force": "N",
    "force_ratio": "1",
    "tilt": "rad",
    "moment": "N m",
    "twist": "rad",
    "torque": "N m",
    "electric_potential": "V",
    "charge": "C",
    "magnetic_potential": "A",
    "magnetic_flux": "Wb",
}

N_MOTIONS: Final = 8


@dataclass(frozen=True)
class Indenter(ABC):
    """A rigid indenter; the fields of a concrete class are its case-file keys."""

    @abstractmethod
    def height(self, x: Array, y: Array) -> Array:
        """Height of the indenter's surface above its lowest point, (n,) >= 0 [m], inf where there is none.

        x, y: (n,) coordinates from the indenter's axis in its own plane [m].
        """

    @property
    def pointwise(self) -> bool:
        """Whether heights are known at single points alone, so that they cannot tell where the indenter ends."""
        return False


def motion_modes(points: Array, frames: Array, axes: Array, reference: Array) -> Array:
    """How the indenter's surface moves per unit of each motion, (8, n, 5), in the local frames of points (n, 3) [m].

    frames: (n, 3, 3) as in ReducedSystem; axes: rows e1, e2, axis of the indenter's place, (3, 3); reference: point of
    the indenter about which it tilts and twists, (3,) [m]. Small motions: approach against the axis, translation along
    e1 and e2, right-handed rotations about e1, e2 and the axis; a unit potential is -1 in its column, as in a
    displacement of ReducedSystem.
    """
    turning = np.cross(axes[:, None, :], points - reference)
    shifting = np.broadcast_to(np.array([-axes[2], axes[0], axes[1]])[:, None, :], turning.shape)
    modes = np.zeros((N_MOTIONS, len(points), N_FIELDS))
    modes[:6, :, MECHANICAL] = np.einsum("nai,kni->kna", frames, np.concatenate([shifting, turning]))
    modes[6, :, ELECTRIC] = modes[7, :, MAGNETIC] = -1.0
    return modes


def motion_measures(modes: Array, weights: Array) -> Array:
    """Measures (8, n, 5) of the resultants that work on the motions: each is sum(measure * load) of a load (n, 5).

    modes: as motion_modes gives them; weights: (n,) [m^2] as in ReducedSystem. Forces [N] and moments [N m] are those
    of the indenter on the body, the normal force positive in compression; charge [C] and magnetic flux [Wb] are what
    leaves the body.
    """
    measures: Array = weights[:, None] * modes
    measures[6:] *= -1.0
    return measures
