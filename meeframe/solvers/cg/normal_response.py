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
from meeframe.solvers.gradient.steps import Conduction, Ground, start_load
from meeframe.system.capabilities import apply_fields, diagonal

CHANGED: Final = 3e-3
"""Largest residual of the potentials for a change of pressure, relative to its displacement.

The potentials found at a pressure correct it.
"""
FOLLOWING: Final = 0.01
"""Reduction of the violation since the last update at which the conduction is updated, without biactive nodes."""
FOLLOWING_GRAZING: Final = 0.3
"""Reduction of the violation since the last update at which the conduction is updated, with biactive nodes.

Secants of their fractions are found early or not at all.
"""
LEFT: Final = 1e-2
"""Largest residual of the potentials solved for anew, relative to the violation.

Both are in square roots of the nodes' own responses.
"""
SINGLE: Final = 1e-4
"""Reduction of the violation at which gaps changed in single precision are computed anew.

Three digits of the violation are then right.
"""


@dataclass(frozen=True, eq=False)
class Effect:
    """Normal gap (n,) [m], flux (n, channels), and motion (m,) of a pressure, or their changes.

    The flux is (0, channels) where nothing conducts.
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
    def at(self, pressure: Array, near: Effect) -> Effect:
        """Return the effect of a pressure (n,), given a nearby effect, whose indenter motion is used."""

    @abstractmethod
    def change(self, pressure: Array) -> Effect:
        """Return the approximate effect of a pressure (n,) alone, with the indenter fixed but for its potentials.

        See `lasting` for the accuracy.
        """

    @abstractmethod
    def after(self, pressure: Array, change: Array, effect: Effect) -> Effect:
        """Return the approximate effect at a pressure (n,) that differs by a change (n,) from that of a known effect.

        See `lasting` for the accuracy.
        """

    @property
    @abstractmethod
    def lasting(self) -> float:
        """Fraction to which violations may fall before the whole effect must be computed anew."""

    @abstractmethod
    def contact_fraction(self, pressure: Array) -> Array:
        """Return the contact fractions (n,) at a pressure (n,)."""

    @property
    @abstractmethod
    def held(self) -> Mask | None:
        """Biactive nodes (n,), which are to bear no pressure and may overlap meanwhile; None if there are none."""

    @abstractmethod
    def touched_again(self, gap: Array) -> bool:
        """Return true if nodes overlap, by their gap (n,), that ceased to conduct at the last update."""

    @abstractmethod
    def updated(self, pressure: Array, effect: Effect) -> "NormalResponse":
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

    apart: (n,) normal gap of the unloaded body [m], the indenter's free motions at zero; modes: (m, n) their normal
    parts.
    """

    apart: Array
    modes: Array

    @classmethod
    def of(cls, problem: ContactProblem, scales: Scales) -> "Insulated":
        """Return the response for a problem in which nothing conducts."""
        modes = np.array([freedom.mode[:, NORMAL] for freedom in problem.prescribed_resultants]).reshape(
            -1, len(problem.gap)
        )
        return cls(problem, scales, problem.gap - problem.system.offset[:, NORMAL], modes)

    def at(self, pressure: Array, near: Effect) -> Effect:
        """Return the effect by one application of the normal compliance; see NormalResponse."""
        gap = self.apart + self._opened(pressure)
        for mode, amount in zip(self.modes, near.motion, strict=True):
            gap += amount * mode
        return Effect(gap, self._no_flux, near.motion)

    def change(self, pressure: Array) -> Effect:
        """Return the effect of a change by one normal response in single precision; see NormalResponse."""
        return Effect(
            self._opened(pressure.astype(np.float32, copy=False)),
            self._no_flux,
            np.zeros(len(self.problem.prescribed_resultants)),
        )

    def after(self, pressure: Array, change: Array, effect: Effect) -> Effect:
        """Return the effect with that of the change added; see NormalResponse."""
        return Effect(effect.gap + self.change(change).gap, self._no_flux, effect.motion)

    @property
    def lasting(self) -> float:
        """Fraction set by single precision: the gap retains an error of that precision relative to its changes."""
        return SINGLE

    def contact_fraction(self, pressure: Array) -> Array:
        """Return one where there is pressure and zero elsewhere; see NormalResponse."""
        return (pressure > 0.0).astype(float)

    @property
    def held(self) -> Mask | None:
        """None, since no node is biactive."""
        return None

    def touched_again(self, gap: Array) -> bool:
        """Return false, since no node conducts."""
        return False

    def updated(self, pressure: Array, effect: Effect) -> NormalResponse:
        """Return self, since there is no conduction to update."""
        return self

    @property
    def _no_flux(self) -> Array:
        return np.zeros((0, len(self.problem.channels)))

    def _opened(self, pressure: Array) -> Array:
        return apply_fields(self.problem.system, pressure[:, None], (NORMAL,), (NORMAL,))[:, 0]


@final
@dataclass(frozen=True, eq=False)
class Conducting(NormalResponse):
    """Response of a body whose fluxes follow the pressure.

    ground: see Ground; own: (n,) normal response of the nodes to their own pressure; following: (n, channels)
    approximate flux under a pressure of one; conduction, conductors: those in force; grazing: the model of the biactive
    nodes (see Grazing); held: (n,) the biactive nodes: their fraction, not a pressure, is to close their gap; opened:
    (n,) those that conducted before the last update of the conduction.
    """

    ground: Ground
    own: Array
    following: Array
    conduction: Conduction
    conductors: Conductors
    grazing: BiactiveNodes
    held: Mask | None = None
    opened: Mask | None = None

    @classmethod
    def of(cls, problem: ContactProblem, scales: Scales, start: ContactState | None) -> "Conducting":
        """Return the response for a problem, with the conduction of a start, or none."""
        n = len(problem.gap)
        ground, conduction = Ground.of(problem), Conduction.of(start, n)
        near = Iterate(start_load(problem, start), conduction.contact_fraction, motion=start_motion(problem, start))
        conduction, conductors = ground.conductors(near, conduction, None)
        own = diagonal(problem.system, (NORMAL,))[:, 0]
        grazing = BiactiveNodes.unknown(n)
        return cls(problem, scales, ground, own, _following(problem), conduction, conductors, grazing)

    def at(self, pressure: Array, near: Effect) -> Effect:
        """Return the effect with the potentials solved as exactly as the present violation of the gap requires.

        The gap counts where there is pressure or overlap. Relative to their characteristic magnitudes, the potentials
        are not less exact than the gap. Single precision is used while its error does not matter. See NormalResponse.
        """
        wrong = np.where((pressure > 0.0) | (near.gap < 0.0), near.gap, 0.0)
        far = float(np.abs(wrong).max()) / (self.scales.normal_compliance * self.scales.pressure)
        conducting = [bool(np.isfinite(one).any()) for one in self.conductors.resistance.T]
        potential = [
            displacement / np.sqrt(own.max())
            for displacement, own in zip(self.scales.displacement[POTENTIALS], self.ground.own.T, strict=True)
        ]
        left = min([LEFT * float(np.linalg.norm(wrong / np.sqrt(self.own))), *(far * np.array(potential)[conducting])])
        traction = _traction(pressure.astype(np.float32) if far > SINGLE else pressure)
        slope = self.ground.slope(traction, self.conductors, near.flux, near.motion, left)
        return Effect(slope.gap[:, NORMAL], slope.flux, slope.motion)

    def change(self, pressure: Array) -> Effect:
        """Return the effect of a change in single precision; see NormalResponse."""
        traction, guess = _traction(pressure.astype(np.float32, copy=False)), self.following * pressure[:, None]
        response = self.ground.elimination.respond(traction, self.conductors, guess, enough=CHANGED)
        motion = np.zeros(len(self.problem.prescribed_resultants))
        motion[self.conductors.floating.numbers] = response.potential
        return Effect(-response.displacement[:, NORMAL], response.flux, motion)

    def after(self, pressure: Array, change: Array, effect: Effect) -> Effect:
        """Return the effect with that of the change added; see NormalResponse."""
        moved = self.change(change)
        return Effect(effect.gap + moved.gap, effect.flux + moved.flux, effect.motion + moved.motion)

    @property
    def lasting(self) -> float:
        """Fraction at which the conduction is to be updated."""
        return FOLLOWING if self.held is None or not self.held.any() else FOLLOWING_GRAZING

    def contact_fraction(self, pressure: Array) -> Array:
        """Return the contact fractions of the conduction; see NormalResponse."""
        return self.conduction.contact_fraction

    def touched_again(self, gap: Array) -> bool:
        """Return true if nodes that the last update of the conduction opened overlap; see NormalResponse."""
        return self.opened is not None and bool((self.opened & (gap < 0.0)).any())

    def updated(self, pressure: Array, effect: Effect) -> NormalResponse:
        """Return the response with the conduction updated to the pressure and its effect; see NormalResponse."""
        # nodes respond to their own pressure much less than the contact as a whole
        grazing = self.grazing.next(self.conduction.contact_fraction, -pressure + effect.gap / self.own)
        contact_fraction = grazing.fractions(pressure > 0.0)
        held, opened = (
            (contact_fraction > 0.0) & (contact_fraction < 1.0),
            (contact_fraction == 0.0) & (self.conduction.contact_fraction > 0.0),
        )
        iterate = Iterate(load_of(pressure, effect.flux), contact_fraction, motion=effect.motion)
        conduction = replace(self.conduction, contact_fraction=contact_fraction)
        conduction, conductors = self.ground.conductors(iterate, conduction, self.conductors)
        return replace(self, conduction=conduction, conductors=conductors, grazing=grazing, held=held, opened=opened)

    def same_conductors(self, other: NormalResponse) -> bool:
        """Return true if another response has the same conductors."""
        return isinstance(other, Conducting) and other.conductors is self.conductors


def _following(problem: ContactProblem) -> Array:
    """Return the flux (n, channels) with which a node's own potentials do not change under a pressure of one.

    If a body responds alike along all directions of its surface, that holds for all pressures together.
    """
    blocks = problem.system.diagonal_blocks()
    fields = [field for field, channel in enumerate(problem.channels, N_MECHANICAL) if channel.is_conducting]
    flux = np.zeros((len(blocks), len(problem.channels)))
    raised = blocks[:, fields, NORMAL, None]
    flux[:, [field - N_MECHANICAL for field in fields]] = np.linalg.solve(blocks[:, fields][:, :, fields], raised)[
        ..., 0
    ]
    return flux


def _traction(pressure: Array) -> Array:
    """Return the tractions (n, 3) of a pressure (n,), in its precision."""
    traction = np.zeros((3, len(pressure)), pressure.dtype).T
    traction[:, NORMAL] = -pressure
    return traction
