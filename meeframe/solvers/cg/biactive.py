"""Biactive nodes: they open when they conduct and close when they do not (see meeframe.contact.conduction)."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask
from meeframe.fields import Array, Indices

MIN_SLOPE_CHANGE: Final = 0.5
"""Smallest change of a contact fraction from which the slope of the node's own trial is determined.

With a smaller change those of other nodes dominate, and a slope due to them would be so steep that the node never moved
again.
"""
MIN_INCREMENT: Final = 1e-12
"""Smallest norm of the changes of all biactive fractions for a derivative update: smaller ones show round-off only."""
MAX_UPDATES: Final = 50
"""Largest number of derivative updates that are stored."""
MAX_TRIAL_GROWTH: Final = 3.0
"""Growth factor of the norm of the trials beyond which earlier derivatives are discarded."""
MAX_ROUNDS: Final = 3
"""Largest number of rounds in the search for the biactive nodes; each solves again without the nodes that have left."""


@dataclass(frozen=True, eq=False)
class BiactiveNodes:
    """Model of the trial tractions of nodes as functions of their contact fractions.

    It serves iterations that know the contact at each fraction. A node conducts when it has traction. Where that opens
    it, and not conducting closes it, its trial traction grows with the fraction between, nearly linearly. A first
    secant gives the slope, node by node, while all nodes around do the same; Broyden's updates add the coupling between
    biactive nodes.

    Attributes
    ----------
    contact_fraction, trial : Array
        (n,), contact fractions and trial tractions [Pa] at the last evaluation, NaN at first.
    slope : Array
        (n,), derivative of the trial by the fraction, where it was found to grow; NaN elsewhere.
    updates : tuple of (Array, Array)
        Updates of these derivatives, pairs of (n,) by (n,) vectors, one for each evaluation.

    References
    ----------
    Broyden, Math. Comput. 19 (1965) 577.
    """

    contact_fraction: Array
    trial: Array
    slope: Array
    updates: tuple[tuple[Array, Array], ...] = ()

    @classmethod
    def unknown(cls, n: int) -> "BiactiveNodes":
        """Return the model of n nodes before any evaluation."""
        return cls(*np.full((3, n), np.nan))

    def next(self, contact_fraction: Array, trial: Array) -> "BiactiveNodes":
        """Return the model after evaluating the trial tractions (n,) at contact fractions (n,).

        Derivatives are discarded if the trials grew, and not updated if hardly anything moved. The model starts again
        from the beginning if trials are not finite, which laws may return during the iteration.
        """
        if not np.isfinite(trial).all():
            return BiactiveNodes.unknown(len(contact_fraction))
        increment, rise = contact_fraction - self.contact_fraction, trial - self.trial
        known = self.slope > 0.0
        nodes = np.flatnonzero(known & (_is_partial(contact_fraction) | _is_partial(self.contact_fraction)))
        has_diverged = float(np.linalg.norm(trial[nodes])) > MAX_TRIAL_GROWTH * float(np.linalg.norm(self.trial[nodes]))
        with np.errstate(divide="ignore", invalid="ignore"):
            secant = rise / increment
        grows = (np.abs(increment) > MIN_SLOPE_CHANGE) & (secant > 0.0)
        # a slope that moves a node from one end to the other is due to other nodes, and no update would correct it
        jumped = np.abs(increment) == 1.0
        slope = np.where(grows & (has_diverged | ~known | jumped), secant, self.slope)
        square = float(increment[nodes] @ increment[nodes])
        if has_diverged or square <= MIN_INCREMENT**2:
            return BiactiveNodes(contact_fraction, trial, slope)
        update, direction = np.zeros((2, len(contact_fraction)))
        update[nodes], direction[nodes] = rise[nodes] - self._rise(increment, nodes), increment[nodes] / square
        return BiactiveNodes(contact_fraction, trial, slope, (*self.updates, (update, direction))[-MAX_UPDATES:])

    def fractions(self, touching: Mask) -> Array:
        """Return the next contact fractions (n,), given which nodes touch (n,)."""
        known = self.slope > 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            fraction = np.where(known, np.clip(self.contact_fraction - self.trial / self.slope, 0.0, 1.0), touching)
        for _ in range(MAX_ROUNDS):
            nodes = np.flatnonzero(known & _is_partial(fraction))
            if not len(nodes) or not self.updates:
                break
            increment = fraction - self.contact_fraction
            increment[nodes] = 0.0
            # the slopes plus a matrix of low rank (Sherman, Morrison and Woodbury)
            update, direction = (
                np.array([vector[nodes] for vector in vectors]) for vectors in zip(*self.updates, strict=True)
            )
            step = (self.trial[nodes] + self._rise(increment, nodes)) / self.slope[nodes]
            update = update / self.slope[nodes]
            step -= (
                np.linalg.lstsq(np.eye(len(update)) + direction @ update.T, direction @ step, rcond=None)[0] @ update
            )
            solution = np.clip(self.contact_fraction[nodes] - step, 0.0, 1.0)
            # no node ends against its own trial: where conduction pulls nodes into contact, trials fall with fractions
            # and vanish beyond the wrong end
            is_blocked = ((solution - self.contact_fraction[nodes]) * self.trial[nodes] >= 0.0) & ~_is_partial(solution)
            fraction[nodes] = np.where(is_blocked, fraction[nodes], solution)
            if _is_partial(solution).all() or is_blocked.any():
                break
        return np.asarray(fraction)

    def _rise(self, increment: Array, nodes: Indices) -> Array:
        """Return the increments of the trials of nodes (k,) with known slopes when the fractions change by (n,)."""
        rise = self.slope[nodes] * increment[nodes]
        for update, direction in self.updates:
            rise += update[nodes] * float(direction @ increment)
        return rise


def _is_partial(contact_fraction: Array) -> Mask:
    return np.asarray((contact_fraction > 0.0) & (contact_fraction < 1.0))
