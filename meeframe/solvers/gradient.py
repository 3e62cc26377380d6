"""What the gradient iterations share: the contact gap of a traction, with the potentials eliminated."""

from dataclasses import dataclass, replace

import numpy as np

from meeframe.core.contact import ContactProblem, ContactState, contact_gap
from meeframe.core.fields import MECHANICAL, Array
from meeframe.solvers.conduction import Mask, Switches, own_response, resistances
from meeframe.solvers.elimination import Conductors, Elimination, eliminate
from meeframe.solvers.scales import Scales, problem_scales
from meeframe.solvers.spectrum import Spectrum, contact_exposure, largest_eigenvalue


@dataclass(frozen=True, eq=False)
class Slope:
    """The gap at given tractions, and what was needed for it.

    gap: (n, 3) as of contact_gap; flux: (n, 2); conductors: with which both were computed.
    """

    gap: Array
    flux: Array
    conductors: Conductors


@dataclass(frozen=True, eq=False)
class Ground:
    """What does not change during an iteration: elimination, own responses (n, 2) and scales of the problem."""

    problem: ContactProblem
    elimination: Elimination
    own: Array
    scales: Scales

    @classmethod
    def of(cls, problem: ContactProblem) -> "Ground":
        """Of a problem."""
        return cls(problem, eliminate(problem), own_response(problem), problem_scales(problem))

    def conductors(self, traction: Array, closed: Array, previous: Conductors | None) -> Conductors:
        """Conductors of tractions (n, 3) and closed fractions (n,)."""
        return self.elimination.prepare(resistances(self.problem, traction[:, 2], closed, self.own), previous)

    def slope(self, traction: Array, conductors: Conductors, flux: Array) -> Slope:
        """The gap at tractions (n, 3); flux: (n, 2) near that to be found."""
        extra, moved = self.elimination.respond(traction, conductors, flux - conductors.flux)
        gap = contact_gap(self.problem, moved + conductors.displacement)
        return Slope(gap, extra + conductors.flux, conductors)

    def spectrum(self, touching: Mask, conductors: Conductors, previous: Spectrum | None) -> Spectrum:
        """The largest eigenvalue where nodes touch (n,); the previous one if it still holds."""
        exposure = contact_exposure(touching, conductors.resistance, self.scales)
        if previous is not None and previous.holds(exposure):
            return previous
        scaling = self.problem.contact_law.tangential_scaling()
        start = None if previous is None else previous.vector
        return largest_eigenvalue(self.elimination, conductors, exposure, scaling, start)


@dataclass(frozen=True, eq=False)
class Conduction:
    """The conduction of the nodes during an iteration: closed fractions (n,) and the switches that move them."""

    closed: Array
    switches: Switches

    @classmethod
    def of(cls, start: ContactState | None, n: int) -> "Conduction":
        """Of a start, or of n open nodes."""
        return cls(np.zeros(n) if start is None else start.closed, Switches.unused(n))

    def next(self, before: Array, after: Array, trial: Array, scales: Scales) -> "Conduction":
        """After a step of the normal traction from `before` to `after` (n,) with the trial (n,)."""
        touching = after < 0.0
        switches = self.switches.next(before < 0.0, touching, trial)
        closed = switches.closed(self.closed, touching, trial, scales.pressure)
        return replace(self, closed=closed, switches=switches)


def start_load(start: ContactState | None, n: int) -> Array:
    """Load (n, 5) of the previous load step, or none."""
    return np.zeros((n, 5)) if start is None else start.load


def traction_of(load: Array) -> Array:
    """Tractions (n, 3) of a load (n, 5)."""
    return load[:, MECHANICAL]
