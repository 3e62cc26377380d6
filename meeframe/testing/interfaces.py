"""Interface laws that are more than a projection, for the checks of solvers; SI units."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self, final

import numpy as np

from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb
from meeframe.laws.base import ConductivityLaw, ContactLaw, StepLengths

_WEAKENED = 0.5
"""Ratio of the friction coefficients after a long slip and without slip."""


@final
@dataclass(frozen=True)
class SoftAttractedContact(ContactLaw):
    """Compliant contact with slip-weakening friction and attraction across the gap.

    The normal law is |p_nu| = pressure (overlap / closure).

    Attributes
    ----------
    pressure
        Pressure [Pa] at an overlap equal to `closure`.
    closure
        Overlap, slip and gap [m] over which pressure, friction and attraction change.
    mu
        Friction coefficient without slip.
    pull
        Attraction in contact, relative to `pressure`.
    """

    pressure: float
    closure: float
    mu: float = 0.0
    pull: float = 0.0

    def project(self, trial: Array) -> Array:
        """Return the traction of Coulomb friction with the coefficient without slip, (n, 3) [Pa]."""
        return IsotropicCoulomb(self.mu).project(trial)

    def tangential_scaling(self) -> Array:
        """Return the scaling of Coulomb friction."""
        return IsotropicCoulomb(self.mu).tangential_scaling()

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the traction (n, 3) [Pa] of the springs, limited tangentially by mu |p_nu| at the slip."""
        slip = np.linalg.norm(gap[:, :2], axis=1) / self.closure
        share = 1.0 - (1.0 - _WEAKENED) * -np.expm1(-slip)
        reduced_trial = trial.copy()
        reduced_trial[:, 2] = share * np.minimum(trial[:, 2], 0.0) / (1.0 + r[0] * self.closure / self.pressure)
        # the reduced pressure determines the friction limit, the full one the traction
        traction = self.project(reduced_trial)
        traction[:, 2] /= share
        return traction

    def adhesion(self, gap: Array) -> Array:
        """Return pull pressure exp(-gap / closure), (n,) [Pa]."""
        return self.pull * self.pressure * np.exp(-np.maximum(gap, 0.0) / self.closure)

    def rescaled(self, length: float, pressure: float) -> Self:
        """Return the law in other units, given the number of new units in an old one."""
        return replace(self, pressure=self.pressure * pressure, closure=self.closure * length)


@final
@dataclass(frozen=True)
class GapConductivity(ConductivityLaw):
    """Conduction across the gap, and in contact, that increases with the drop.

    kappa = constant / (gap + residual) (1 + (drop / strength)^2 / (1 + (drop / strength)^2)).

    Attributes
    ----------
    constant
        Constant [F/m] or [H/m].
    residual
        Gap that remains in contact [m].
    strength
        Characteristic drop [V] or [A].
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
        """Return the law in other units, given the number of new units in an old one."""
        constant = self.constant * length * flux / potential
        return replace(self, constant=constant, residual=self.residual * length, strength=self.strength * potential)
