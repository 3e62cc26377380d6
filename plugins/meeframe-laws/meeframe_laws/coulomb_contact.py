"""Isotropic Coulomb friction on the contact traction, a base class of the normal laws of the interface."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

from meeframe.plugin import Array, ContactLaw, IsotropicCoulomb, Quantity, check_quantities


@dataclass(frozen=True, kw_only=True)
class CoulombContact(ContactLaw):
    """Abstract base class of laws with the contact tractions of unilateral contact and isotropic Coulomb friction.

    Attributes
    ----------
    mu : float
        Friction coefficient >= 0; with inf, all nodes with pressure stick. The limit is mu times the pressure of the
        contact, without any attraction.

    Raises
    ------
    CaseError
        If a field is out of bounds.
    """

    mu: Annotated[float, Quantity("", ge=0)] = 0.0

    def __post_init__(self) -> None:
        check_quantities(self)

    @cached_property
    def _coulomb(self) -> IsotropicCoulomb:
        """The law of friction, whose creation takes longer than its evaluation at some hundred nodes."""
        return IsotropicCoulomb(self.mu)

    def project(self, trial: Array) -> Array:
        """Return the traction of isotropic Coulomb friction, (n, 3) [Pa]."""
        return self._coulomb.project(trial)

    def tangential_scaling(self) -> Array:
        """Return the scaling of isotropic Coulomb friction, (2, 2)."""
        return self._coulomb.tangential_scaling()

    def tangent(self, trial: Array) -> Array:
        """Return the derivative of isotropic Coulomb friction, (n, 3, 3)."""
        return self._coulomb.tangent(trial)
