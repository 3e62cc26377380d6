"""Nodes that graze: they lift off where they conduct and touch where they do not (see meeframe.contact.conduction)."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask
from meeframe.fields import Array, Indices

TELLING: Final = 0.5
"""Move of a closed fraction that tells the slope of its own trial: beside a smaller one others' moves count for more,
and a slope that is theirs would be so steep that the node never moved again."""
LEAST_MOVE: Final = 1e-12
"""Of all that graze together, which tells how their trials follow: smaller ones tell round-off."""
REMEMBERED: Final = 50
"""Looks of which derivatives are kept."""
WORSE: Final = 3.0
"""Times as large trials: what was found of their derivatives does not hold there."""
ROUNDS: Final = 3
"""Of the search for the nodes that graze: at those that leave the others, the equations are solved without them."""


@dataclass(frozen=True, eq=False)
class Grazing:
    """How the trial tractions of nodes follow their closed fractions; for iterations that know the contact at each.

    A node conducts when it has traction. Where that has made it lift off, and not conducting touch, its trial traction
    grows with the fraction between, nearly linearly. A first secant tells how, node by node, while all around it do the
    same; Broyden's updates tell what each of those that graze has to do with the others.

    Source: Broyden, Math. Comput. 19 (1965) 577.

    closed, trial: (n,) when last looked at, no number at first; slope: (n,) of the trial over the fraction, where it
    was found to grow; changes: of these derivatives, (n,) by (n,) vectors, one pair for each look.
    """

    contact_fraction: Array
    trial: Array
    slope: Array
    changes: tuple[tuple[Array, Array], ...] = ()

    @classmethod
    def unknown(cls, n: int) -> "Grazing":
        """Of n nodes at the beginning."""
        return cls(*np.full((3, n), np.nan))

    def next(self, contact_fraction: Array, trial: Array) -> "Grazing":
        """After the trial tractions (n,) at closed fractions (n,): anew if these grew, or hardly anything moved.

        From the beginning if trials are no numbers, which laws may answer on the way.
        """
        if not np.isfinite(trial).all():
            return Grazing.unknown(len(contact_fraction))
        moved, rise = contact_fraction - self.contact_fraction, trial - self.trial
        known = self.slope > 0.0
        nodes = np.flatnonzero(known & (_between(contact_fraction) | _between(self.contact_fraction)))
        astray = float(np.linalg.norm(trial[nodes])) > WORSE * float(np.linalg.norm(self.trial[nodes]))
        with np.errstate(divide="ignore", invalid="ignore"):
            found = rise / moved
        grows = (np.abs(moved) > TELLING) & (found > 0.0)
        # a slope that sends a node from one end to the other is none of its own, and no update would ever see it
        thrown = np.abs(moved) == 1.0
        slope = np.where(grows & (astray | ~known | thrown), found, self.slope)
        size = float(moved[nodes] @ moved[nodes])
        if astray or size <= LEAST_MOVE**2:
            return Grazing(contact_fraction, trial, slope)
        by, along = np.zeros((2, len(contact_fraction)))
        by[nodes], along[nodes] = rise[nodes] - self._rise(moved, nodes), moved[nodes] / size
        return Grazing(contact_fraction, trial, slope, (*self.changes, (by, along))[-REMEMBERED:])

    def fractions(self, touching: Mask) -> Array:
        """Closed fractions (n,) to go on with, of nodes that touch or not (n,)."""
        known = self.slope > 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            fraction = np.where(known, np.clip(self.contact_fraction - self.trial / self.slope, 0.0, 1.0), touching)
        for _ in range(ROUNDS):
            nodes = np.flatnonzero(known & _between(fraction))
            if not len(nodes) or not self.changes:
                break
            moved = fraction - self.contact_fraction
            moved[nodes] = 0.0
            # the slopes, and a matrix of low rank beside them (Sherman, Morrison and Woodbury)
            by, along = (np.array([part[nodes] for part in parts]) for parts in zip(*self.changes, strict=True))
            step = (self.trial[nodes] + self._rise(moved, nodes)) / self.slope[nodes]
            by = by / self.slope[nodes]
            step -= np.linalg.lstsq(np.eye(len(by)) + along @ by.T, along @ step, rcond=None)[0] @ by
            found = np.clip(self.contact_fraction[nodes] - step, 0.0, 1.0)
            # no node ends against its own trial: where conduction draws nodes into contact, trials fall with fractions
            # and vanish beyond the wrong end
            stays = ((found - self.contact_fraction[nodes]) * self.trial[nodes] >= 0.0) & ~_between(found)
            fraction[nodes] = np.where(stays, fraction[nodes], found)
            if _between(found).all() or stays.any():
                break
        return np.asarray(fraction)

    def _rise(self, moved: Array, nodes: Indices) -> Array:
        """Of the trials of nodes (k,) with known slopes, when fractions move (n,)."""
        rise = self.slope[nodes] * moved[nodes]
        for by, along in self.changes:
            rise += by[nodes] * float(along @ moved)
        return rise


def _between(contact_fraction: Array) -> Mask:
    return np.asarray((contact_fraction > 0.0) & (contact_fraction < 1.0))
