"""Changes that make an increment easier to solve, whose states are initial guesses for the solution without them."""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from meeframe.contact.conduction import MIN_TRACTION
from meeframe.contact.problem import ContactProblem, ContactState
from meeframe.contact.scales import problem_scales
from meeframe.fields import Array
from meeframe.laws.base import ConductivityLaw, ContactLaw, StepLengths, attraction, resolve
from meeframe.system.capabilities import EdgeResolution


@dataclass(frozen=True)
class CappedLaw(ContactLaw):
    """A contact law with friction of at most a multiple of the pressure, so that its limit does not jump.

    Attributes
    ----------
    law : ContactLaw
        The law.
    ratio : float
        Largest friction over the pressure.
    """

    law: ContactLaw
    ratio: float

    def project(self, trial: Array) -> Array:
        """Return the projection of the law, shortened along its friction to the largest one, (n, 3) [Pa]."""
        traction = self.law.project(trial)
        return self._shorten(traction, -traction[:, 2])

    def tangential_scaling(self) -> Array:
        """Return that of the law."""
        return self.law.tangential_scaling()

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the tractions of the law, with friction of at most a multiple of the pressure, (n, 3) [Pa].

        The pressure is that before the trial, which in a solution is that of the trial. The gap of other trials would
        change the largest friction by `ratio` times as much as the pressure: Newton's method would then find a state
        only from very close to it.
        """
        traction = resolve(self.law, trial, gap, r)
        pressure = np.zeros(len(trial))
        pressed = traction[:, 2] < 0.0
        pressure[pressed] = np.maximum(r[0] * gap[pressed, 2] - trial[pressed, 2], 0.0)
        return self._shorten(traction, pressure)

    def __getattr__(self, name: str) -> Any:
        """Return an optional method of the law."""
        return getattr(self.law, name)

    def _shorten(self, traction: Array, pressure: Array) -> Array:
        size, limit = np.linalg.norm(traction[:, :2], axis=1), self.ratio * pressure
        factor = np.divide(limit, size, out=np.ones_like(size), where=size > limit)
        return np.column_stack([factor[:, None] * traction[:, :2], traction[:, 2]])


@dataclass(frozen=True, eq=False)
class AttractedLaw(CappedLaw):
    """A capped law with an attraction at each node, which cancels the pressure that bears friction up to the cap.

    Surfaces touch rigidly where they attract each other: in the solution they have no pressure under which to yield.

    Attributes
    ----------
    pull : Array
        (n,), further attraction of touching surfaces [Pa].
    """

    pull: Array

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the tractions of the capped law, without its compliance where there is an attraction, (n, 3) [Pa]."""
        traction = super().resolve(trial, gap, r)
        traction[:, 2] = np.where(self.pull > 0.0, np.minimum(trial[:, 2], 0.0), traction[:, 2])
        return traction

    def adhesion(self, gap: Array) -> Array:
        """Return the attraction of the law and the further one, (n,) [Pa]."""
        return self.pull + attraction(self.law, gap)


@dataclass(frozen=True, eq=False)
class AttractedConductivity(ConductivityLaw):
    """A law of conductivity under pressures less an attraction.

    Attributes
    ----------
    law : ConductivityLaw
        The law.
    pull : Array
        (n,), attraction of touching surfaces [Pa].
    """

    law: ConductivityLaw
    pull: Array

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return the conductivity under the remaining pressure, (n,), that in touch if none remains."""
        pull = self.pull if len(normal_traction) == len(self.pull) else 0.0  # samples of a law are not at its nodes
        remaining = np.where(normal_traction < 0.0, np.minimum(normal_traction + pull, MIN_TRACTION), 0.0)
        return self.law.conductivity(remaining, gap, drop)


class AttractedConductivityAcrossGap(AttractedConductivity):
    """A law of conductivity under pressures less an attraction that depends on the gap or the drop."""

    across_gap = True


@dataclass(frozen=True)
class GradualLaw(ConductivityLaw):
    """A law of conductivity that rises gradually from zero with the pressure, also where the law jumps or is steep.

    Attributes
    ----------
    law : ConductivityLaw
        The law.
    pressure : float
        Pressure [Pa] at which half the conductivity of the law is reached.
    """

    law: ConductivityLaw
    pressure: float

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return the conductivity times p / (p + pressure), (n,); perfect conductors remain what they are."""
        kappa, pressure = self.law.conductivity(normal_traction, gap, drop), np.maximum(-normal_traction, 0.0)
        share = np.divide(pressure, pressure + self.pressure, out=np.zeros_like(pressure), where=pressure > 0.0)
        return np.where(np.isinf(kappa), kappa, kappa * share)


@dataclass(frozen=True)
class ScaledLaw(ConductivityLaw):
    """A multiple of a law of conductivity that depends on the gap or the drop.

    Attributes
    ----------
    law : ConductivityLaw
        The law.
    factor : float
        Factor > 0 of the conductivity.
    """

    law: ConductivityLaw
    factor: float
    across_gap = True

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return the multiple of the conductivity, (n,)."""
        return self.factor * self.law.conductivity(normal_traction, gap, drop)


@dataclass(frozen=True)
class Easing:
    """Change of the laws, or of the contact edge, that makes an increment easier to solve.

    Attributes
    ----------
    ratio : float, optional
        Largest friction over the pressure.
    rise : float, optional
        Characteristic pressure over the one at which half a conductivity is reached. Conductivities across gaps are
        multiplied by rise / (1 + rise).
    pull : Array, optional
        (n,), attraction that cancels the pressure of nodes whose friction is the largest one [Pa].
    at_nodes : bool, optional
        Whether the contact ends at nodes even if the formulation resolves its edge between them.
    edge_of : ContactState, optional
        State at nodes whose contact edge is resolved; by default that of the solution at nodes.
    """

    ratio: float = np.inf
    rise: float = np.inf
    pull: Array | None = None
    at_nodes: bool = False
    edge_of: ContactState | None = None

    def apply(self, problem: ContactProblem) -> ContactProblem:
        """Return a problem under the changed laws."""
        if self.pull is not None:
            return self._with_pull(problem, self.pull)
        law = problem.contact_law if self.ratio == np.inf else CappedLaw(problem.contact_law, self.ratio)
        if self.rise == np.inf:
            return replace(problem, contact_law=law)
        pressure, factor = problem_scales(problem).pressure / self.rise, self.rise / (1.0 + self.rise)
        channels = (
            replace(channel, law=ScaledLaw(channel.law, factor))
            if channel.law.across_gap
            else replace(channel, law=GradualLaw(channel.law, pressure))
            if channel.is_conducting
            else channel
            for channel in problem.channels
        )
        return replace(problem, contact_law=law, channels=tuple(channels))

    def _with_pull(self, problem: ContactProblem, pull: Array) -> ContactProblem:
        kinds = (
            AttractedConductivityAcrossGap if channel.law.across_gap else AttractedConductivity
            for channel in problem.channels
        )
        channels = (
            replace(channel, law=kind(channel.law, pull)) if channel.is_conducting else channel
            for channel, kind in zip(problem.channels, kinds, strict=True)
        )
        return replace(
            problem, contact_law=AttractedLaw(problem.contact_law, self.ratio, pull), channels=tuple(channels)
        )


EXACT: Final = Easing()
"""No change."""


def resolves_edge(problem: ContactProblem) -> bool:
    """Return whether the contact edge of a problem lies between nodes, or may do so."""
    return problem.area_fraction is not None or problem.system.capability(EdgeResolution) is not None
