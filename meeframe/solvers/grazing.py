"""Nodes that graze: they lift off where they conduct and touch where they do not (see meeframe.solvers.conduction)."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.core.fields import Array
from meeframe.solvers.conduction import Mask

LEAST_MOVE: Final = 1e-8
"""Of a closed fraction, from which the slope of its trial is measured."""
FEW: Final = 0.05
"""Of the nodes that touch: more that graze are neighbours and know of each other."""


@dataclass(frozen=True, eq=False)
class Grazing:
    """How the trial tractions of nodes follow their closed fractions; for iterations that know the contact at each.

    A node conducts when it has traction. Where that has made it lift off, and not conducting touch, its trial traction
    grows with the fraction between, nearly linearly: a secant tells where it vanishes. That serves where few nodes
    graze, which hardly know of each other.

    closed, trial: (n,) when last looked at, no number at first; slope: (n,) of the trial over the fraction, where it
    was found to grow.
    """

    closed: Array
    trial: Array
    slope: Array

    @classmethod
    def unknown(cls, n: int) -> "Grazing":
        """Of n nodes at the beginning."""
        return cls(*np.full((3, n), np.nan))

    def next(self, closed: Array, trial: Array) -> "Grazing":
        """After the trial tractions (n,) at closed fractions (n,)."""
        moved = closed - self.closed
        with np.errstate(divide="ignore", invalid="ignore"):
            found = (trial - self.trial) / moved
        slope = np.where((np.abs(moved) > LEAST_MOVE) & (found > 0.0), found, self.slope)
        return Grazing(closed, trial, slope)

    def fractions(self, touching: Mask) -> Array | None:
        """Closed fractions (n,) to go on with, of nodes that touch or not (n,); None where more than a few graze."""
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.clip(self.closed - self.trial / self.slope, 0.0, 1.0)
        fraction = np.where(self.slope > 0.0, root, touching)
        graze = (fraction > 0.0) & (fraction < 1.0)
        return fraction if graze.sum() <= FEW * touching.sum() else None
