"""Common parts of the gradient iterations: the contact gap of a traction, with the potentials eliminated."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask, Switches, follows_gap, potential_diagonal, resistances, unloaded
from meeframe.contact.free_motion import balanced_projection, motions
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, contact_gap, indenter_position
from meeframe.contact.scales import Scales, problem_scales
from meeframe.fields import MECHANICAL, POTENTIALS, Array
from meeframe.laws.base import attraction, contact_traction, is_adhesive
from meeframe.solvers.conduction.elimination import Conductors, Elimination
from meeframe.solvers.conduction.krylov_elimination import eliminate
from meeframe.solvers.gradient.spectrum import Spectrum, contact_exposure, largest_eigenvalue

FOLLOW_GROWTH: Final = 1.1
FOLLOW_FALL: Final = 0.5
LEAST_FOLLOW: Final = 1e-3
FOLLOWED: Final = 1e-3
"""Part of the fluxes' change in a step that may be left for the next one where fluxes are found by iteration."""


@dataclass(frozen=True, eq=False)
class Slope:
    """Gap at given tractions.

    gap: (n, 3) as of contact_gap; flux: (n, channels); motion: (m,) of the prescribed resultants: potentials as the
    flux equations determine them, motions as given.
    """

    gap: Array
    flux: Array
    motion: Array


@dataclass(frozen=True, eq=False)
class Step:
    """Projected step.

    Tractions (n, 3) and the trial (n, 3) that was projected; slope: at the tractions before the step, with the motions
    by which the resultants after it balance.
    """

    traction: Array
    trial: Array
    slope: Slope


@dataclass(frozen=True, eq=False)
class Ground:
    """Constant data of an iteration: elimination, responses of nodes to their own fluxes (n, channels), and scales."""

    problem: ContactProblem
    elimination: Elimination
    own: Array
    scales: Scales

    @classmethod
    def of(cls, problem: ContactProblem) -> "Ground":
        """Return the data of a problem."""
        return cls(problem, eliminate(problem), potential_diagonal(problem), problem_scales(problem))

    def conductors(
        self, iterate: Iterate, conduction: "Conduction", previous: Conductors | None
    ) -> tuple["Conduction", Conductors]:
        """Return the conduction at the gap and the drop of an iterate, and the conductors."""
        problem, pressing, ahead = self.problem, iterate.load[:, 2], None
        if follows_gap(problem) or is_adhesive(problem.contact_law):
            displacement = problem.system.offset + problem.system.apply(iterate.load)
            ahead = indenter_position(problem, iterate.motion) - displacement
            pressing = contact_traction(problem.contact_law, pressing, ahead[:, 2])
            ahead = unloaded(ahead, iterate.load[:, POTENTIALS], self.own)
        resistance = resistances(problem, pressing, conduction.contact_fraction, self.own, ahead)
        if follows_gap(problem):
            conduction, transmissivity = conduction.followed(self.own / (self.own + resistance))
            with np.errstate(divide="ignore"):
                resistance = np.where(np.isfinite(resistance), self.own * (1.0 / transmissivity - 1.0), np.inf)
        return conduction, self.elimination.prepare(resistance, previous)

    def touching(self, traction: Array, gap: Array) -> Mask:
        """Return the nodes (n,) that bear tractions (n, 3), overlap at the gap (n, 3) or attract across it."""
        attracted = attraction(self.problem.contact_law, gap[:, 2]) > 0.0
        return np.asarray((traction[:, 2] < 0.0) | (gap[:, 2] < 0.0) | attracted)

    def conducted(self, conduction: "Conduction", before: Array, slope: "Slope", step: "Step") -> "Conduction":
        """Return the conduction after a step from tractions (n, 3) with a slope."""
        law, gap = self.problem.contact_law, slope.gap[:, 2]
        earlier, later = (contact_traction(law, traction[:, 2], gap) for traction in (before, step.traction))
        return conduction.next(earlier, later, step.trial[:, 2], self.scales)

    def slope(self, traction: Array, conductors: Conductors, flux: Array, motion: Array, left: float = 0.0) -> Slope:
        """Return the gap at tractions (n, 3) and motion (m,).

        flux: (n, channels), an initial guess; left: see Elimination.
        """
        floating = conductors.floating.numbers
        found = self.elimination.state(traction, conductors, flux, motion[floating], FOLLOWED, left)
        if floating.size:
            motion = motion.copy()
            motion[floating] = found.potential
        return Slope(contact_gap(self.problem, found.displacement, motion), found.flux, motion)

    def projected(self, traction: Array, slope: Slope, r: tuple[float, float]) -> Step:
        """Return the tractions after a step r, normal and tangential [Pa/m], from tractions (n, 3) and their slope."""
        balanced = balanced_projection(self.problem, traction, slope.gap, r)
        moving = motions(self.problem)
        if moving.size == 0:
            return Step(balanced.traction, balanced.trial, slope)
        motion, gap = slope.motion.copy(), slope.gap.copy()
        motion[moving] += balanced.motion
        for number, amount in zip(moving, balanced.motion, strict=True):
            gap += amount * self.problem.prescribed_resultants[number].mode[:, MECHANICAL]
        return Step(balanced.traction, balanced.trial, replace(slope, gap=gap, motion=motion))

    def largest(self, spectrum: Spectrum | None) -> float:
        """Return the largest eigenvalue [m/Pa], the expected one if there has been no contact yet."""
        return self.scales.normal_compliance if spectrum is None else spectrum.largest

    def spectrum(self, touching: Mask, conductors: Conductors, previous: Spectrum | None) -> Spectrum | None:
        """Return the largest eigenvalue where nodes touch (n,); the previous one if it still holds or none touch."""
        if not touching.any():
            return previous
        exposure = contact_exposure(touching, conductors.resistance, self.scales)
        if previous is not None and previous.holds(exposure):
            return previous
        scaling = self.problem.contact_law.tangential_scaling()
        start = None if previous is None else previous.vector
        return largest_eigenvalue(self.elimination, conductors, exposure, scaling, start)


@dataclass(frozen=True, eq=False)
class Conduction:
    """Conduction of the nodes during an iteration.

    closed: fractions (n,), and the switches that change them; transmissivity: (n, channels), in [0, 1], of laws that
    depend on the gap or the drop; None at first. It is relaxed: it advances by only a part, `follow` (n, channels), of
    the way to the value of these laws, a smaller part where the direction reverses at the next step, which would
    otherwise oscillate; way: (n, channels) sign of the last change.
    """

    contact_fraction: Array
    switches: Switches
    transmissivity: Array | None = None
    follow: Array | float = 1.0
    way: Array | float = 0.0

    @classmethod
    def of(cls, start: ContactState | None, n: int) -> "Conduction":
        """Return the conduction of a start, or that of n open nodes."""
        return cls(np.zeros(n) if start is None else start.contact_fraction, Switches.unused(n))

    def followed(self, asked: Array) -> tuple["Conduction", Array]:
        """Return the conduction after a relaxed change to a transmissivity (n, channels), and the value reached."""
        if self.transmissivity is None:
            return replace(self, transmissivity=asked), asked
        change = asked - self.transmissivity
        way = np.sign(change)
        follow = np.clip(self.follow * np.where(way * self.way < 0.0, FOLLOW_FALL, FOLLOW_GROWTH), LEAST_FOLLOW, 1.0)
        reached = self.transmissivity + follow * change
        return replace(self, transmissivity=reached, follow=follow, way=way), reached

    def next(self, before: Array, after: Array, trial: Array, scales: Scales) -> "Conduction":
        """Return the conduction after a normal traction step from `before` to `after` (n,) with the trial (n,)."""
        touching = after < 0.0
        switches = self.switches.next(before < 0.0, touching, trial)
        contact_fraction = switches.contact_fraction(self.contact_fraction, touching, trial, scales.pressure)
        return replace(self, contact_fraction=contact_fraction, switches=switches)


def start_load(problem: ContactProblem, start: ContactState | None) -> Array:
    """Return the load (n, fields) of the previous load step, zero if there is none."""
    return np.zeros_like(problem.system.offset) if start is None else start.load


def traction_of(load: Array) -> Array:
    """Return the tractions (n, 3) of a load (n, fields)."""
    return load[:, MECHANICAL]
