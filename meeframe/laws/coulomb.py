"""Coulomb friction, isotropic and orthotropic."""

import math
from dataclasses import dataclass
from typing import Annotated, Final, final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.laws.base import ContactLaw

LARGEST_RATIO: Final = 1e3
"""Of finite principal friction coefficients."""


@final
@dataclass(frozen=True)
class IsotropicCoulomb(ContactLaw):
    """Unilateral contact with isotropic friction (eqs. 11-16 with mu1 = mu2).

    mu: friction coefficient, >= 0; inf sticks wherever there is pressure. Raises CaseError if it is negative or NaN.
    """

    mu: Annotated[float, Quantity("", ge=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def project(self, trial: Array) -> Array:
        """Return the radial return to the disc of radius mu |p_nu|, (n, 3) [Pa]."""
        return _radial_return(trial, np.array([self.mu, self.mu]))

    def tangential_scaling(self) -> Array:
        """Return the identity; zero if mu is zero."""
        return _scaling(np.array([self.mu, self.mu]))

    def tangent(self, trial: Array) -> Array:
        """Return the derivative of the radial return, (n, 3, 3)."""
        return _radial_tangent(trial, np.array([self.mu, self.mu]), np.eye(2))


@final
@dataclass(frozen=True)
class OrthotropicCoulomb(ContactLaw):
    """Unilateral contact with orthotropic friction (eqs. 11-16).

    mu1, mu2: principal friction coefficients, >= 0; inf sticks in that direction wherever there is pressure;
    angle: from the local axis e1 to the first principal direction, positive towards e2 [rad]. Raises CaseError if one
    of them is out of bounds, or if one finite coefficient is more than 1000 times the other, neither being zero: the
    metric is then too distorted to tell slip from stick in the weak direction.

    The radial return of eq. (16) is the projection in the norm ||.||_mu of eq. (13). With the step scaled by
    M^2 / max(mu)^2 its fixed points slip along M^2 g, the associated rule of eq. (12) (docs/theory.md, Set and metric).
    """

    mu1: Annotated[float, Quantity("", ge=0)]
    mu2: Annotated[float, Quantity("", ge=0)]
    angle: Annotated[float, Quantity("rad", gt=-math.inf, lt=math.inf)] = 0.0

    def __post_init__(self) -> None:
        check_quantities(self)
        smaller, larger = sorted((self.mu1, self.mu2))
        if smaller > 0.0 and LARGEST_RATIO * smaller < larger < math.inf:
            raise CaseError(
                f"OrthotropicCoulomb: mu1 = {self.mu1:g} and mu2 = {self.mu2:g} differ by more than a factor of "
                f"{LARGEST_RATIO:g}; allowed: less, or 0 or inf for one of them"
            )

    def project(self, trial: Array) -> Array:
        """Return the radial return to the ellipse of half-axes mu1 |p_nu|, mu2 |p_nu|, (n, 3) [Pa]."""
        axes = self._axes()
        principal = np.column_stack([trial[:, :2] @ axes.T, trial[:, 2]])
        traction = _radial_return(principal, np.array([self.mu1, self.mu2]))
        traction[:, :2] = traction[:, :2] @ axes
        return traction

    def tangential_scaling(self) -> Array:
        """Return M^2 / max(mu)^2 turned by the angle; see _scaling for coefficients that are zero or infinite."""
        axes = self._axes()
        scaling: Array = axes.T @ _scaling(np.array([self.mu1, self.mu2])) @ axes
        return scaling

    def tangent(self, trial: Array) -> Array:
        """Return the derivative of the radial return, (n, 3, 3)."""
        return _radial_tangent(trial, np.array([self.mu1, self.mu2]), self._axes())

    def _axes(self) -> Array:
        """Return the principal directions as rows, (2, 2)."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, s], [-s, c]])


def _scaling(mu: Array) -> Array:
    """Return diag(mu^2) / max(mu)^2. An infinite coefficient leaves its direction free and the two decoupled: any
    scaling will then do, and one is the fastest."""
    largest = mu[np.isfinite(mu)].max(initial=0.0)
    factors = np.where(np.isinf(mu), 1.0, 0.0 if largest == 0.0 else (mu / (largest or 1.0)) ** 2)
    return np.diag(factors)


def _radial_return(trial: Array, mu: Array) -> Array:
    """Return the Eqs. (11) and (16) in principal directions, (n, 3); mu (2,) in [0, inf]."""
    traction = np.zeros_like(trial)
    pressure = -np.minimum(trial[:, 2], 0.0)
    traction[:, 2] = -pressure
    free = np.isinf(mu)
    bounded = (mu > 0.0) & ~free
    traction[:, :2][:, free] = np.where(pressure[:, None] > 0.0, trial[:, :2][:, free], 0.0)
    norm = np.linalg.norm(trial[:, :2][:, bounded] / mu[bounded], axis=1)
    outside = norm > pressure
    factor = np.divide(pressure, norm, out=np.ones_like(norm), where=outside)
    traction[:, :2][:, bounded] = trial[:, :2][:, bounded] * factor[:, None]
    return traction


def _radial_tangent(trial: Array, mu: Array, axes: Array) -> Array:
    """Return the derivative (n, 3, 3) of the radial return by the trial (n, 3); mu (2,) along axes (2, 2), one a row.

    On the limit that of stick is taken, at zero normal trial that of open contact.
    """
    bounded = (mu > 0.0) & np.isfinite(mu)
    sticking, slipping = ((axes.T * which) @ axes for which in (mu > 0.0, bounded))
    contact_fraction = np.isfinite(trial).all(axis=1) & (trial[:, 2] < 0.0)
    inverse = np.divide(1.0, mu, out=np.zeros(2), where=bounded)
    factor, unit = _slip(trial, contact_fraction, inverse[:, None] * axes)
    along, across = (axes.T * np.where(bounded, mu, 0.0)) @ unit, (axes.T * inverse) @ unit
    tangent = np.zeros((3, 3, len(trial))).transpose(2, 0, 1)
    tangent[:, 2, 2] = contact_fraction
    tangent[:, :2, 2] = -along.T
    along *= factor
    factor -= 1.0
    for i, j in np.ndindex(2, 2):
        tangent[:, i, j] = contact_fraction * sticking[i, j] + factor * slipping[i, j] - along[i] * across[j]
    return tangent


def _slip(trial: Array, contact_fraction: NDArray[np.bool_], reduce: Array) -> tuple[Array, Array]:
    """Return the factors (n,) of the radial return of trials (n, 3), and unit vectors (2, n) along reduce @ trial,
    zero in stick.

    Components before nodes, here and in what follows: numpy is much faster along the longer axis.
    """
    reach = reduce @ [np.where(contact_fraction, part, 0.0) for part in trial[:, :2].T]
    norm = np.linalg.norm(reach, axis=0)
    slips = contact_fraction & (norm > -trial[:, 2])
    norm[~slips] = 1.0
    return np.where(slips, -trial[:, 2] / norm, 1.0), np.array([np.where(slips, part / norm, 0.0) for part in reach])
