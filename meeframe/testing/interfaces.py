"""Laws of the interface that are more than a projection, by which solvers are judged; SI units."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self, final

import numpy as np

from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb
from meeframe.laws.base import ConductivityLaw, ContactLaw, StepLengths

_WEAKENED = 0.5
"""Of the friction coefficient, after a long slip."""


@final
@dataclass(frozen=True)
class SoftAttractedContact(ContactLaw):
    """|p_nu| = pressure (overlap / closure), friction that weakens with slip, attraction across the gap.

    pressure [Pa]; closure [m]: the overlap that it causes, and the slip and the gap over which friction and attraction
    decay; mu: friction coefficient without slip; pull: attraction in contact over the pressure.
    """

    pressure: float
    closure: float
    mu: float = 0.0
    pull: float = 0.0

    def project(self, trial: Array) -> Array:
        """Return the Coulomb's with the coefficient without slip, (n, 3) [Pa]."""
        return IsotropicCoulomb(self.mu).project(trial)

    def tangential_scaling(self) -> Array:
        """Return the scaling of Coulomb friction."""
        return IsotropicCoulomb(self.mu).tangential_scaling()

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the traction (n, 3) [Pa] of the springs, tangentially within mu |p_nu| of the slip."""
        slip = np.linalg.norm(gap[:, :2], axis=1) / self.closure
        share = 1.0 - (1.0 - _WEAKENED) * -np.expm1(-slip)
        softened = trial.copy()
        softened[:, 2] = share * np.minimum(trial[:, 2], 0.0) / (1.0 + r[0] * self.closure / self.pressure)
        # the friction limit is that of a smaller pressure, the traction that of the whole
        traction = self.project(softened)
        traction[:, 2] /= share
        return traction

    def adhesion(self, gap: Array) -> Array:
        """Return pull pressure exp(-gap / closure), (n,) [Pa]."""
        return self.pull * self.pressure * np.exp(-np.maximum(gap, 0.0) / self.closure)

    def rescaled(self, length: float, pressure: float) -> Self:
        """Return the law in other units, given how many of them make one of the old ones."""
        return replace(self, pressure=self.pressure * pressure, closure=self.closure * length)


@final
@dataclass(frozen=True)
class GapConductivity(ConductivityLaw):
    """kappa = constant / (gap + residual) (1 + (drop / strength)^2 / (1 + (drop / strength)^2)), in contact as well.

    constant [F/m] or [H/m]; residual: gap that is left in contact [m]; strength [V] or [A].
    """

    across_gap: ClassVar[bool] = True

    constant: float
    residual: float
    strength: float

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa (n,) at gaps (n,) and drops (n,)."""
        square = (drop / self.strength) ** 2
        return self.constant / (gap + self.residual) * (1.0 + square / (1.0 + square))

    def rescaled(self, length: float, potential: float, flux: float) -> Self:
        """Return the law in other units, given how many of them make one of the old ones."""
        constant = self.constant * length * flux / potential
        return replace(self, constant=constant, residual=self.residual * length, strength=self.strength * potential)
