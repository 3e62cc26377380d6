"""Coulomb friction laws, isotropic and orthotropic."""

import math
from dataclasses import dataclass
from typing import Annotated, Final, final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.laws.base import ContactLaw

MAX_FRICTION_RATIO: Final = 1e3
"""Largest ratio of finite principal friction coefficients."""


@final
@checked_arguments
@dataclass(frozen=True)
class IsotropicCoulomb(ContactLaw):
    """Unilateral contact with isotropic friction (eqs. 11-16 with mu1 = mu2).

    Attributes
    ----------
    mu : float
        Friction coefficient >= 0; with inf, all nodes with pressure stick.

    Raises
    ------
    CaseError
        If it is negative or NaN.
    """

    mu: Annotated[float, Quantity("", ge=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def project(self, trial: Array) -> Array:
        """Return the radial return to the disc of radius mu |p_nu|.

        Parameters
        ----------
        trial : Array
            Trial tractions, (n, 3) [Pa], along e1, e2, nu.

        Returns
        -------
        Array
            Tractions, (n, 3) [Pa].
        """
        return _radial_return(trial, np.array([self.mu, self.mu]))

    def tangential_scaling(self) -> Array:
        """Return the identity, or zero if mu is zero."""
        return _scaling(np.array([self.mu, self.mu]))

    def tangent(self, trial: Array) -> Array:
        """Return the derivative of the radial return.

        Parameters
        ----------
        trial : Array
            Trial tractions, (n, 3) [Pa].

        Returns
        -------
        Array
            Derivatives, (n, 3, 3), with rows of the traction.
        """
        return _radial_tangent(trial, np.array([self.mu, self.mu]), np.eye(2))


@final
@checked_arguments
@dataclass(frozen=True)
class OrthotropicCoulomb(ContactLaw):
    """Unilateral contact with orthotropic friction (eqs. 11-16).

    Attributes
    ----------
    mu1, mu2 : float
        Principal friction coefficients >= 0; with inf, all nodes with pressure stick in that direction.
    angle : float
        Angle from the local axis e1 to the first principal direction, positive towards e2 [rad].

    Raises
    ------
    CaseError
        If one of them is out of bounds, or if one finite coefficient is more than 1000 times the other and neither is
        zero: the metric is then too distorted to distinguish slip from stick in the weak direction.

    Notes
    -----
    The radial return of eq. (16) is the projection in the norm ||.||_mu of eq. (13). With the step scaled by
    M^2 / max(mu)^2, its fixed points slip along M^2 g, the associated rule of eq. (12) (docs/explanation/theory.md, Set
    and metric).
    """

    mu1: Annotated[float, Quantity("", ge=0)]
    mu2: Annotated[float, Quantity("", ge=0)]
    angle: Annotated[float, Quantity("rad", gt=-math.inf, lt=math.inf)] = 0.0

    def __post_init__(self) -> None:
        check_quantities(self)
        smaller, larger = sorted((self.mu1, self.mu2))
        if smaller > 0.0 and MAX_FRICTION_RATIO * smaller < larger < math.inf:
            raise CaseError(
                f"OrthotropicCoulomb: mu1 = {self.mu1:g} and mu2 = {self.mu2:g} differ by more than a factor of "
                f"{MAX_FRICTION_RATIO:g}; allowed: less, or 0 or inf for one of them"
            )

    def project(self, trial: Array) -> Array:
        """Return the radial return to the ellipse with half axes mu1 |p_nu| and mu2 |p_nu|.

        Parameters
        ----------
        trial : Array
            Trial tractions, (n, 3) [Pa], along e1, e2, nu.

        Returns
        -------
        Array
            Tractions, (n, 3) [Pa].
        """
        axes = self._axes()
        principal = np.column_stack([trial[:, :2] @ axes.T, trial[:, 2]])
        traction = _radial_return(principal, np.array([self.mu1, self.mu2]))
        traction[:, :2] = traction[:, :2] @ axes
        return traction

    def tangential_scaling(self) -> Array:
        """Return M^2 / max(mu)^2, rotated by the angle."""
        axes = self._axes()
        scaling: Array = axes.T @ _scaling(np.array([self.mu1, self.mu2])) @ axes
        return scaling

    def tangent(self, trial: Array) -> Array:
        """Return the derivative of the radial return.

        Parameters
        ----------
        trial : Array
            Trial tractions, (n, 3) [Pa].

        Returns
        -------
        Array
            Derivatives, (n, 3, 3), with rows of the traction.
        """
        return _radial_tangent(trial, np.array([self.mu1, self.mu2]), self._axes())

    def _axes(self) -> Array:
        """Return the principal directions, (2, 2), one in each row."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, s], [-s, c]])


def _scaling(mu: Array) -> Array:
    """Return diag(mu^2) / max(mu)^2 with finite coefficients, and one for infinite coefficients.

    An infinite coefficient decouples the two directions. Any scaling is then correct, and one converges fastest.
    """
    largest = mu[np.isfinite(mu)].max(initial=0.0)
    factors = np.where(np.isinf(mu), 1.0, 0.0 if largest == 0.0 else (mu / (largest or 1.0)) ** 2)
    return np.diag(factors)


def _radial_return(trial: Array, mu: Array) -> Array:
    """Return the projection of eqs. (11) and (16) in principal directions, (n, 3); mu (2,) in [0, inf]."""
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
    """Return the derivative (n, 3, 3) of the radial return by the trial (n, 3); mu (2,) along the rows of axes (2, 2).

    On the limit the derivative is that of stick, at zero normal trial that of open contact.
    """
    bounded = (mu > 0.0) & np.isfinite(mu)
    sticking, slipping = ((axes.T * mask) @ axes for mask in (mu > 0.0, bounded))
    in_contact = np.isfinite(trial).all(axis=1) & (trial[:, 2] < 0.0)
    inverse = np.divide(1.0, mu, out=np.zeros(2), where=bounded)
    factor, unit = _slip(trial, in_contact, inverse[:, None] * axes)
    along, across = (axes.T * np.where(bounded, mu, 0.0)) @ unit, (axes.T * inverse) @ unit
    tangent = np.zeros((3, 3, len(trial))).transpose(2, 0, 1)
    tangent[:, 2, 2] = in_contact
    tangent[:, :2, 2] = -along.T
    along *= factor
    factor -= 1.0
    for i, j in np.ndindex(2, 2):
        tangent[:, i, j] = in_contact * sticking[i, j] + factor * slipping[i, j] - along[i] * across[j]
    return tangent


def _slip(trial: Array, in_contact: NDArray[np.bool_], reduce: Array) -> tuple[Array, Array]:
    """Return factors (n,) of the radial return of trials (n, 3), and unit vectors (2, n) of slip, zero in stick.

    The unit vectors are along reduce @ trial. Arrays have components before nodes, since NumPy is much faster along the
    longer axis.
    """
    reduced = reduce @ [np.where(in_contact, row, 0.0) for row in trial[:, :2].T]
    norm = np.linalg.norm(reduced, axis=0)
    slips = in_contact & (norm > -trial[:, 2])
    norm[~slips] = 1.0
    return np.where(slips, -trial[:, 2] / norm, 1.0), np.array([np.where(slips, row / norm, 0.0) for row in reduced])
