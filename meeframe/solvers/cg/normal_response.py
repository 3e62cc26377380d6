"""Gap response of the body to a pressure in frictionless contact, with the potentials eliminated."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from meeframe.contact.conduction import Mask
from meeframe.contact.free_motion import start_motion
from meeframe.contact.problem import ContactProblem, ContactState, Iterate
from meeframe.contact.scales import Scales
from meeframe.fields import N_MECHANICAL, POTENTIALS, Array
from meeframe.solvers.cg.biactive import BiactiveNodes
from meeframe.solvers.cg.normal_modes import NORMAL
from meeframe.solvers.conduction.elimination import Conductors
from meeframe.solvers.gradient.steps import Conduction, GradientStepper, start_load
from meeframe.system.capabilities import apply_fields, diagonal

CHANGE_TOLERANCE: Final = 3e-3
"""Largest residual of the potentials for a change of pressure, relative to its displacement.

The potentials found at a pressure correct it.
"""
UPDATE_REDUCTION: Final = 0.01
"""Reduction of the violation since the last update at which the conduction is updated, without biactive nodes."""
BIACTIVE_UPDATE_REDUCTION: Final = 0.3
"""Reduction of the violation since the last update at which the conduction is updated, with biactive nodes.

Secants of their fractions are found early or not at all.
"""
POTENTIAL_TOLERANCE: Final = 1e-2
"""Largest residual of the potentials solved for anew, relative to the violation.

Both are in square roots of the nodes' self-compliances.
"""
SINGLE_REDUCTION: Final = 1e-4
"""Reduction of the violation at which gaps changed in single precision are computed anew.

Three digits of the violation are then right.
"""


@dataclass(frozen=True, eq=False)
class Effect:
    """Effect of a pressure, or of a change of the pressure.

    Attributes
    ----------
    gap : Array
        (n,), normal gap [m].
    flux : Array
        (n, channels), or (0, channels) where nothing conducts.
    motion : Array
        (m,), free motions of the prescribed resultants.
    """

    gap: Array
    flux: Array
    motion: Array


@dataclass(frozen=True, eq=False)
class NormalResponse(ABC):
    """Gap and flux response to pressures (n,) [Pa], positive in compression."""

    problem: ContactProblem
    scales: Scales

    @abstractmethod
    def at(self, pressure: Array, guess: Effect) -> Effect:
        """Return the effect of a pressure (n,), given a nearby effect, whose indenter motion is used."""

    @abstractmethod
    def change(self, pressure: Array) -> Effect:
        """Return the approximate effect of a pressure (n,) alone, with the indenter fixed but for its potentials.

        See `update_reduction` for the accuracy.
        """

    @abstractmethod
    def after_change(self, pressure: Array, change: Array, effect: Effect) -> Effect:
        """Return the approximate effect at a pressure (n,) that differs by a change (n,) from that of a known effect.

        See `update_reduction` for the accuracy.
        """

    @property
    @abstractmethod
    def update_reduction(self) -> float:
        """Reduction of the violation after which the whole effect must be computed anew."""

    @abstractmethod
    def contact_fraction(self, pressure: Array) -> Array:
        """Return the contact fractions (n,) at a pressure (n,)."""

    @property
    @abstractmethod
    def biactive(self) -> Mask | None:
        """Biactive nodes (n,), which are to bear no pressure and may overlap meanwhile; None if there are none."""

    @abstractmethod
    def has_new_overlap(self, gap: Array) -> bool:
        """Return true if nodes overlap, by their gap (n,), that the last update of the conduction opened."""

    @abstractmethod
    def update_conduction(self, pressure: Array, effect: Effect) -> "NormalResponse":
        """Return the response with the conduction that belongs to a pressure (n,) and its effect.

        Responses without conduction return themselves.
        """


def load_of(pressure: Array, flux: Array) -> Array:
    """Return the load (n, fields) of a pressure (n,) and a flux (n, channels) or (0, channels).

    Fields are stored one after another.
    """
    load = np.zeros((N_MECHANICAL + flux.shape[1], len(pressure))).T
    np.negative(pressure, out=load[:, NORMAL])
    if flux.size:
        load[:, POTENTIALS] = flux
    return load


@final
@dataclass(frozen=True, eq=False)
class Insulated(NormalResponse):
    """Response of a body when nothing conducts.

    Attributes
    ----------
    unloaded_gap : Array
        (n,), normal gap of the unloaded body with the indenter's free motions at zero [m].
    modes : Array
        (m, n), normal parts of the free motions.
    """

    unloaded_gap: Array
    modes: Array

    @classmethod
    def of(cls, problem: ContactProblem, scales: Scales) -> "Insulated":
        """Return the response for a problem in which nothing conducts."""
        modes = np.array([resultant.mode[:, NORMAL] for resultant in problem.prescribed_resultants]).reshape(
            -1, len(problem.gap)
        )
        return cls(problem, scales, problem.gap - problem.system.offset[:, NORMAL], modes)

    def at(self, pressure: Array, guess: Effect) -> Effect:
        """Return the effect by one application of the normal compliance; see NormalResponse."""
        gap = self.unloaded_gap + self._gap_opening(pressure)
        for mode, amount in zip(self.modes, guess.motion, strict=True):
            gap += amount * mode
        return Effect(gap, self._empty_flux, guess.motion)

    def change(self, pressure: Array) -> Effect:
        """Return the effect of a change by one normal response in single precision; see NormalResponse."""
        return Effect(
            self._gap_opening(pressure.astype(np.float32, copy=False)),
            self._empty_flux,
            np.zeros(len(self.problem.prescribed_resultants)),
        )

    def after_change(self, pressure: Array, change: Array, effect: Effect) -> Effect:
        """Return the effect with that of the change added; see NormalResponse."""
        return Effect(effect.gap + self.change(change).gap, self._empty_flux, effect.motion)

    @property
    def update_reduction(self) -> float:
        """Fraction set by single precision: the gap retains an error of that precision relative to its changes."""
        return SINGLE_REDUCTION

    def contact_fraction(self, pressure: Array) -> Array:
        """Return one where there is pressure and zero elsewhere; see NormalResponse."""
        return (pressure > 0.0).astype(float)

    @property
    def biactive(self) -> Mask | None:
        """None, since no node is biactive."""
        return None

    def has_new_overlap(self, gap: Array) -> bool:
        """Return false, since no node conducts."""
        return False

    def update_conduction(self, pressure: Array, effect: Effect) -> NormalResponse:
        """Return self, since there is no conduction to update."""
        return self

    @property
    def _empty_flux(self) -> Array:
        return np.zeros((0, len(self.problem.channels)))

    def _gap_opening(self, pressure: Array) -> Array:
        return apply_fields(self.problem.system, pressure[:, None], (NORMAL,), (NORMAL,))[:, 0]


@final
@dataclass(frozen=True, eq=False)
class Conducting(NormalResponse):
    """Response of a body whose fluxes follow the pressure.

    Attributes
    ----------
    stepper : GradientStepper
        Operators of the gradient iterations.
    self_compliance : Array
        (n,), normal response of the nodes to their own pressure [m/Pa].
    flux_per_pressure : Array
        (n, channels), approximate flux under a pressure of one.
    conduction, conductors : Conduction, Conductors
        Conduction in force.
    biactive_model : BiactiveNodes
        Model of the biactive nodes.
    biactive : Mask, optional
        (n,), biactive nodes: their fraction, not a pressure, is to close their gap.
    newly_open : Mask, optional
        (n,), nodes that conducted before the last update of the conduction, but not after it.
    """

    stepper: GradientStepper
    self_compliance: Array
    flux_per_pressure: Array
    conduction: Conduction
    conductors: Conductors
    biactive_model: BiactiveNodes
    biactive: Mask | None = None
    newly_open: Mask | None = None

    @classmethod
    def of(cls, problem: ContactProblem, scales: Scales, start: ContactState | None) -> "Conducting":
        """Return the response for a problem, with the conduction of a start, or none."""
        n = len(problem.gap)
        stepper, conduction = GradientStepper.of(problem), Conduction.of(start, n)
        guess = Iterate(start_load(problem, start), conduction.contact_fraction, motion=start_motion(problem, start))
        conduction, conductors = stepper.conductors(guess, conduction, None)
        self_compliance = diagonal(problem.system, (NORMAL,))[:, 0]
        biactive_model = BiactiveNodes.unknown(n)
        return cls(
            problem,
            scales,
            stepper,
            self_compliance,
            _flux_per_pressure(problem),
            conduction,
            conductors,
            biactive_model,
        )

    def at(self, pressure: Array, guess: Effect) -> Effect:
        """Return the effect with the potentials solved as exactly as the present violation of the gap requires.

        The gap counts where there is pressure or overlap. Relative to their characteristic magnitudes, the potentials
        are not less exact than the gap. Single precision is used while its error does not matter. See NormalResponse.
        """
        violating_gap = np.where((pressure > 0.0) | (guess.gap < 0.0), guess.gap, 0.0)
        violation = float(np.abs(violating_gap).max()) / (self.scales.normal_compliance * self.scales.pressure)
        conducting = [bool(np.isfinite(one).any()) for one in self.conductors.resistance.T]
        potential_scales = [
            displacement / np.sqrt(self_compliance.max())
            for displacement, self_compliance in zip(
                self.scales.displacement[POTENTIALS], self.stepper.self_compliance.T, strict=True
            )
        ]
        allowed_error = min(
            [
                POTENTIAL_TOLERANCE * float(np.linalg.norm(violating_gap / np.sqrt(self.self_compliance))),
                *(violation * np.array(potential_scales)[conducting]),
            ]
        )
        traction = _traction(pressure.astype(np.float32) if violation > SINGLE_REDUCTION else pressure)
        slope = self.stepper.slope(traction, self.conductors, guess.flux, guess.motion, allowed_error)
        return Effect(slope.gap[:, NORMAL], slope.flux, slope.motion)

    def change(self, pressure: Array) -> Effect:
        """Return the effect of a change in single precision; see NormalResponse."""
        traction, guess = _traction(pressure.astype(np.float32, copy=False)), self.flux_per_pressure * pressure[:, None]
        response = self.stepper.elimination.respond(traction, self.conductors, guess, allowed_error=CHANGE_TOLERANCE)
        motion = np.zeros(len(self.problem.prescribed_resultants))
        motion[self.conductors.floating.numbers] = response.potential
        return Effect(-response.displacement[:, NORMAL], response.flux, motion)

    def after_change(self, pressure: Array, change: Array, effect: Effect) -> Effect:
        """Return the effect with that of the change added; see NormalResponse."""
        response = self.change(change)
        return Effect(effect.gap + response.gap, effect.flux + response.flux, effect.motion + response.motion)

    @property
    def update_reduction(self) -> float:
        """Fraction at which the conduction is to be updated."""
        return UPDATE_REDUCTION if self.biactive is None or not self.biactive.any() else BIACTIVE_UPDATE_REDUCTION

    def contact_fraction(self, pressure: Array) -> Array:
        """Return the contact fractions of the conduction; see NormalResponse."""
        return self.conduction.contact_fraction

    def has_new_overlap(self, gap: Array) -> bool:
        """Return true if nodes that the last update of the conduction opened overlap; see NormalResponse."""
        return self.newly_open is not None and bool((self.newly_open & (gap < 0.0)).any())

    def update_conduction(self, pressure: Array, effect: Effect) -> NormalResponse:
        """Return the response with the conduction updated to the pressure and its effect; see NormalResponse."""
        # nodes respond to their own pressure much less than the contact as a whole
        biactive_model = self.biactive_model.next(
            self.conduction.contact_fraction, -pressure + effect.gap / self.self_compliance
        )
        contact_fraction = biactive_model.fractions(pressure > 0.0)
        biactive, newly_open = (
            (contact_fraction > 0.0) & (contact_fraction < 1.0),
            (contact_fraction == 0.0) & (self.conduction.contact_fraction > 0.0),
        )
        iterate = Iterate(load_of(pressure, effect.flux), contact_fraction, motion=effect.motion)
        conduction = replace(self.conduction, contact_fraction=contact_fraction)
        conduction, conductors = self.stepper.conductors(iterate, conduction, self.conductors)
        return replace(
            self,
            conduction=conduction,
            conductors=conductors,
            biactive_model=biactive_model,
            biactive=biactive,
            newly_open=newly_open,
        )

    def has_same_conductors(self, other: NormalResponse) -> bool:
        """Return true if another response has the same conductors."""
        return isinstance(other, Conducting) and other.conductors is self.conductors


def _flux_per_pressure(problem: ContactProblem) -> Array:
    """Return the flux (n, channels) with which a node's own potentials do not change under a pressure of one.

    If a body responds alike along all directions of its surface, that holds for all pressures together.
    """
    blocks = problem.system.diagonal_blocks()
    fields = [field for field, channel in enumerate(problem.channels, N_MECHANICAL) if channel.is_conducting]
    flux = np.zeros((len(blocks), len(problem.channels)))
    normal_column = blocks[:, fields, NORMAL, None]
    flux[:, [field - N_MECHANICAL for field in fields]] = np.linalg.solve(
        blocks[:, fields][:, :, fields], normal_column
    )[..., 0]
    return flux


def _traction(pressure: Array) -> Array:
    """Return the tractions (n, 3) of a pressure (n,), in its precision."""
    traction = np.zeros((3, len(pressure)), pressure.dtype).T
    traction[:, NORMAL] = -pressure
    return traction
