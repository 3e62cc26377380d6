"""Isotropic Coulomb friction on the contact traction, shared by the normal laws of the interface."""

from dataclasses import dataclass
from typing import Annotated

from meeframe.plugin import Array, ContactLaw, IsotropicCoulomb, Quantity, check_quantities


@dataclass(frozen=True, kw_only=True)
class CoulombContact(ContactLaw):
    """Abstract: laws whose contact tractions are those of unilateral contact with isotropic Coulomb friction.

    mu: friction coefficient, >= 0; inf sticks wherever there is pressure. The limit is mu times the pressure of the
    contact alone, any attraction left out. Raises CaseError if a field is out of bounds.
    """

    mu: Annotated[float, Quantity("", ge=0)] = 0.0

    def __post_init__(self) -> None:
        check_quantities(self)

    def project(self, trial: Array) -> Array:
        """Return the traction of isotropic-coulomb, (n, 3) [Pa]."""
        return IsotropicCoulomb(self.mu).project(trial)

    def tangential_scaling(self) -> Array:
        """Return the scaling of isotropic-coulomb, (2, 2)."""
        return IsotropicCoulomb(self.mu).tangential_scaling()

    def tangent(self, trial: Array) -> Array:
        """Return the derivative of isotropic-coulomb, (n, 3, 3)."""
        return IsotropicCoulomb(self.mu).tangent(trial)
