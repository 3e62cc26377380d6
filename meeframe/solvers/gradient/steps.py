"""Common parts of the gradient iterations: contact gap of a traction, potentials eliminated, and largest eigenvalue."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask, Switches, depends_on_gap, resistances, unloaded
from meeframe.contact.free_motion import balanced_projection, motions
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, contact_gap, indenter_position
from meeframe.contact.scales import Scales, problem_scales
from meeframe.fields import MECHANICAL, NORMAL, POTENTIALS, Array
from meeframe.laws.base import attraction, contact_traction, is_adhesive
from meeframe.solvers.conduction.elimination import Conductors, Elimination

TOLERANCE: Final = 5e-3
MAX_ITERATIONS: Final = 60
MAX_GROWTH: Final = 0.1
MIN_REMAINING: Final = 0.9


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Largest eigenvalue of the compliance on the exposed nodes.

    Attributes
    ----------
    largest : float
        Eigenvalue in the law's metric with the potentials eliminated [m/Pa].
    exposure : Array
        (n, 1 + channels) in [0, 1] at which it was computed: mechanical (in contact or about to be) and of each channel
        (share of the flux that a perfect conductor would draw).
    vector : Array
        (n, 3), its eigenvector, where the next computation starts.
    """

    largest: float
    exposure: Array
    vector: Array

    def is_valid(self, exposure: Array) -> bool:
        """Return whether the eigenvalue applies to another exposure.

        It grows with the exposure, and a slight overestimate costs little.
        """
        grown = (exposure > self.exposure + MAX_GROWTH).any()
        shrunk = (exposure.sum(axis=0) < MIN_REMAINING * self.exposure.sum(axis=0)).any()
        return not (grown or shrunk)


def largest_eigenvalue(
    elimination: Elimination, conductors: Conductors, exposure: Array, scaling: Array, start: Array | None
) -> Spectrum:
    """Return the largest eigenvalue by power iteration on the exposed nodes, of which there must be at least one.

    scaling: (2, 2) the law's tangential scaling; start: (n, 3) or None.
    """
    weight = exposure[:, :1] > 0.0
    values, axes = np.linalg.eigh(scaling)
    root = np.eye(3)
    root[:2, :2] = (axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T
    # without any symmetry, so that no eigenvector is missed; nearly uniform, as the one of the largest eigenvalue
    seed = np.array([0.8, 0.6, 1.0]) if start is None else start + 0.01 * np.abs(start).max()
    vector = weight * np.broadcast_to(seed, (len(exposure), 3)) @ root
    guess = np.zeros_like(exposure[:, 1:])
    largest, norm = 0.0, float(np.linalg.norm(vector))
    for _ in range(MAX_ITERATIONS):
        vector = vector / norm
        response = elimination.respond(vector @ root, conductors, guess, TOLERANCE)
        guess = conductors.without_floating(response.flux, response.potential)
        vector = weight * (response.displacement @ root)
        previous, norm = largest, float(np.linalg.norm(vector))
        largest = norm
        if abs(largest - previous) <= TOLERANCE * largest:
            break
    return Spectrum(largest, exposure, vector)


RELAXATION_GROWTH: Final = 1.1
RELAXATION_SHRINKAGE: Final = 0.5
MIN_RELAXATION: Final = 1e-3
FLUX_REDUCTION: Final = 1e-3
"""Part of the fluxes' change in a step that may be left for the next one where fluxes are found by iteration."""


@dataclass(frozen=True, eq=False)
class Slope:
    """Gap at given tractions.

    Attributes
    ----------
    gap : Array
        (n, 3), as from `contact_gap` [m].
    flux : Array
        (n, channels), flux densities.
    motion : Array
        (m,), motions as given, and potentials as the flux equations determine them.
    """

    gap: Array
    flux: Array
    motion: Array


@dataclass(frozen=True, eq=False)
class Step:
    """Projected step.

    Attributes
    ----------
    traction : Array
        (n, 3), tractions after the step [Pa].
    trial : Array
        (n, 3), trial tractions that were projected [Pa].
    slope : Slope
        Slope at the tractions before the step, with the motions by which the resultants after it balance.
    """

    traction: Array
    trial: Array
    slope: Slope


@dataclass(frozen=True, eq=False)
class GradientStepper:
    """Operators of a gradient iteration, constant during it.

    Attributes
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    elimination : Elimination
        Elimination of the potentials.
    scales : Scales
        Characteristic magnitudes of the problem.
    """

    problem: ContactProblem
    elimination: Elimination
    scales: Scales

    @classmethod
    def of(cls, problem: ContactProblem) -> "GradientStepper":
        """Return the data of a problem."""
        return cls(problem, Elimination.of(problem), problem_scales(problem))

    def conductors(
        self, iterate: Iterate, conduction: "Conduction", previous: Conductors | None
    ) -> tuple["Conduction", Conductors]:
        """Return the conduction at the gap and the drop of an iterate, and the conductors."""
        problem, normal_traction, relative_displacement = self.problem, iterate.load[:, NORMAL], None
        self_compliance = self.elimination.self_compliance
        if depends_on_gap(problem) or is_adhesive(problem.contact_law):
            displacement = problem.system.offset + problem.system.apply(iterate.load)
            relative_displacement = indenter_position(problem, iterate.motion) - displacement
            normal_traction = contact_traction(problem.contact_law, normal_traction, relative_displacement[:, NORMAL])
            relative_displacement = unloaded(relative_displacement, iterate.load[:, POTENTIALS], self_compliance)
        resistance = resistances(
            problem, normal_traction, conduction.contact_fraction, self_compliance, relative_displacement
        )
        if depends_on_gap(problem):
            conduction, transmissivity = conduction.relax(self_compliance / (self_compliance + resistance))
            with np.errstate(divide="ignore"):
                resistance = np.where(np.isfinite(resistance), self_compliance * (1.0 / transmissivity - 1.0), np.inf)
        return conduction, self.elimination.prepare(resistance, previous)

    def touching(self, traction: Array, gap: Array) -> Mask:
        """Return the nodes (n,) that bear tractions (n, 3), overlap at the gap (n, 3) or attract across it."""
        attracted = attraction(self.problem.contact_law, gap[:, NORMAL]) > 0.0
        return np.asarray((traction[:, NORMAL] < 0.0) | (gap[:, NORMAL] < 0.0) | attracted)

    def take_step(
        self, traction: Array, base: Array, slope: Slope, r: tuple[float, float], conduction: "Conduction"
    ) -> tuple[Iterate, "Conduction"]:
        """Return the iterate, without memory, and the conduction after a step from tractions (n, 3).

        The step r, as in `project`, begins at a base (n, 3) with its slope.
        """
        step, law, gap = self.project(base, slope, r), self.problem.contact_law, slope.gap[:, NORMAL]
        earlier, later = (contact_traction(law, values[:, NORMAL], gap) for values in (traction, step.traction))
        conduction = conduction.next(earlier, later, step.trial[:, NORMAL], self.scales)
        load = np.concatenate([step.traction, slope.flux], axis=1)
        return Iterate(load, conduction.contact_fraction, None, step.slope.motion), conduction

    def slope(self, traction: Array, conductors: Conductors, flux: Array, motion: Array) -> Slope:
        """Return the gap at tractions (n, 3) and motion (m,); flux: (n, channels), an initial guess."""
        floating = conductors.floating.numbers
        response = self.elimination.state(traction, conductors, flux, motion[floating], FLUX_REDUCTION)
        if floating.size:
            motion = motion.copy()
            motion[floating] = response.potential
        return Slope(contact_gap(self.problem, response.displacement, motion), response.flux, motion)

    def project(self, traction: Array, slope: Slope, r: tuple[float, float]) -> Step:
        """Return the tractions after a step r, normal and tangential [Pa/m], from tractions (n, 3) and their slope."""
        balanced = balanced_projection(self.problem, traction, slope.gap, r)
        numbers = motions(self.problem)
        if numbers.size == 0:
            return Step(balanced.traction, balanced.trial, slope)
        motion, gap = slope.motion.copy(), slope.gap.copy()
        motion[numbers] += balanced.motion
        for number, amount in zip(numbers, balanced.motion, strict=True):
            gap += amount * self.problem.prescribed_resultants[number].mode[:, MECHANICAL]
        return Step(balanced.traction, balanced.trial, replace(slope, gap=gap, motion=motion))

    def largest(self, spectrum: Spectrum | None) -> float:
        """Return the largest eigenvalue [m/Pa], the expected one if there has been no contact yet."""
        return self.scales.normal_compliance if spectrum is None else spectrum.largest

    def spectrum(self, touching: Mask, conductors: Conductors, previous: Spectrum | None) -> Spectrum | None:
        """Return the largest eigenvalue where nodes touch (n,); the previous one if it still holds or none touch."""
        if not touching.any():
            return previous
        compliance = np.diag(self.scales.compliance)[POTENTIALS]
        exposure = np.column_stack([touching, compliance / (compliance + conductors.resistance)])
        if previous is not None and previous.is_valid(exposure):
            return previous
        scaling = self.problem.contact_law.tangential_scaling()
        start = None if previous is None else previous.vector
        return largest_eigenvalue(self.elimination, conductors, exposure, scaling, start)


@dataclass(frozen=True, eq=False)
class Conduction:
    """Conduction of the nodes during an iteration.

    The transmissivity of laws that depend on the gap or the drop is relaxed: it advances by only a part of the way to
    the value of these laws, a smaller one where the direction reverses at the next step, against oscillation.

    Attributes
    ----------
    contact_fraction : Array
        (n,), contact fractions.
    switches : Switches
        Rules that change them.
    transmissivity : Array, optional
        (n, channels) in [0, 1], of laws that depend on the gap or the drop; None at first.
    relaxation : Array or float
        (n, channels), part of the way that the transmissivity advances.
    direction : Array or float
        (n, channels), sign of its last change.
    """

    contact_fraction: Array
    switches: Switches
    transmissivity: Array | None = None
    relaxation: Array | float = 1.0
    direction: Array | float = 0.0

    @classmethod
    def of(cls, start: ContactState | None, n: int) -> "Conduction":
        """Return the conduction of a start, or that of n open nodes."""
        return cls(np.zeros(n) if start is None else start.contact_fraction, Switches.unused(n))

    def relax(self, target: Array) -> tuple["Conduction", Array]:
        """Return the conduction after a relaxed change to a transmissivity (n, channels), and the value reached."""
        if self.transmissivity is None:
            return replace(self, transmissivity=target), target
        change = target - self.transmissivity
        direction = np.sign(change)
        relaxation = np.clip(
            self.relaxation * np.where(direction * self.direction < 0.0, RELAXATION_SHRINKAGE, RELAXATION_GROWTH),
            MIN_RELAXATION,
            1.0,
        )
        relaxed = self.transmissivity + relaxation * change
        return replace(self, transmissivity=relaxed, relaxation=relaxation, direction=direction), relaxed

    def next(self, before: Array, after: Array, trial: Array, scales: Scales) -> "Conduction":
        """Return the conduction after a normal traction step from `before` to `after` (n,) with the trial (n,)."""
        touching = after < 0.0
        switches = self.switches.next(before < 0.0, touching, trial)
        contact_fraction = switches.contact_fraction(self.contact_fraction, touching, trial, scales.pressure)
        return replace(self, contact_fraction=contact_fraction, switches=switches)
