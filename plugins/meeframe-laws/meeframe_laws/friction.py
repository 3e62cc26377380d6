"""Friction laws with limits of the tangential traction, and the records of all friction laws."""

import math
from dataclasses import dataclass
from typing import Annotated, Final, final

import numpy as np

from meeframe.plugin import Array, ContactLaw, Quantity, Record, StepLengths, check_quantities
from meeframe_laws.directional import NonAssociatedCoulomb, SuperellipticCoulomb
from meeframe_laws.evolving import RateAndPressure, SlipWeakening
from meeframe_laws.limits import (
    MAX_STEPS,
    ROUND_OFF,
    contact_pressure,
    disc_tangent,
    isotropic_scaling,
    radial_tangent,
    return_to_disc,
    tangential_norm,
    with_tangential_norm,
)

_FLOATS: Final = np.finfo(float)


@final
@dataclass(frozen=True)
class Tresca(ContactLaw):
    """Friction limit |t_tau| <= limit at any contact pressure, like the constant shear factor of metal forming.

    Attributes
    ----------
    limit : float
        Shear stress at which the contact slips, >= 0 [Pa]; 0 is frictionless, inf sticks.

    Raises
    ------
    CaseError
        If it is negative or NaN.

    Notes
    -----
    The traction jumps where the contact opens. A node at the contact edge that opens under shear but would touch
    without shear has no solution, and solvers cycle or stall. `CappedCoulomb` with a large mu, such as 10, has a
    solution and differs at the contact edge only.

    References
    ----------
    Avitzur, Metal Forming: Processes and Analysis (1968). Duvaut and Lions, Inequalities in Mechanics and Physics
    (1976), chapter III, where a prescribed limit makes friction a convex problem.
    """

    limit: Annotated[float, Quantity("Pa", ge=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def project(self, trial: Array) -> Array:
        """Return the radial return to the disc of radius `limit` where p_nu < 0, (n, 3) [Pa]."""
        return return_to_disc(trial, self.limit)

    def tangential_scaling(self) -> Array:
        """Return the identity, or zero if the limit is zero."""
        return isotropic_scaling(self.limit)

    def tangent(self, trial: Array) -> Array:
        """Return the derivative of the radial return, (n, 3, 3)."""
        return disc_tangent(trial, self.limit)


@final
@dataclass(frozen=True)
class CappedCoulomb(ContactLaw):
    """Coulomb friction up to the shear strength of the softer body, |t_tau| <= min(mu |p_nu|, limit).

    Attributes
    ----------
    mu : float
        Friction coefficient >= 0; with inf, nodes stick up to the limit.
    limit : float
        Shear strength >= 0 [Pa]; inf gives Coulomb friction.

    Raises
    ------
    CaseError
        If one of them is negative or NaN.

    References
    ----------
    Orowan, Proc. Inst. Mech. Eng. 150 (1943) 140.
    """

    mu: Annotated[float, Quantity("", ge=0)]
    limit: Annotated[float, Quantity("Pa", ge=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def project(self, trial: Array) -> Array:
        """Return the radial return to the disc of radius min(mu |p_nu|, limit), (n, 3) [Pa]."""
        return return_to_disc(trial, np.minimum(self._shear(trial), self.limit))

    def tangential_scaling(self) -> Array:
        """Return the identity, or zero if either limit is zero."""
        return isotropic_scaling(min(self.mu, self.limit))

    def tangent(self, trial: Array) -> Array:
        """Return the derivative of the radial return, (n, 3, 3)."""
        shear = self._shear(trial)
        return disc_tangent(
            trial, np.minimum(shear, self.limit), np.where((shear > 0.0) & (shear < self.limit), self.mu, 0.0)
        )

    def _shear(self, trial: Array) -> Array:
        """Return the limit of Coulomb friction (n,) [Pa], zero without pressure."""
        pressure = contact_pressure(trial)
        return np.multiply(self.mu, pressure, out=np.zeros_like(pressure), where=pressure > 0.0)


@final
@dataclass(frozen=True)
class RegularisedCoulomb(ContactLaw):
    """Regularised friction t_tau = mu |p_nu| g / sqrt(|g|^2 + slip_length^2) for the slip g of the increment.

    Attributes
    ----------
    mu : float
        Friction coefficient >= 0.
    slip_length : float
        Slip at which 1/sqrt(2) of Coulomb friction is reached, > 0 [m].

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    Notes
    -----
    The law tends to that of Coulomb for slip_length -> 0, with a difference proportional to it. Nothing sticks: under a
    constant force the contact creeps by about slip_length in each increment.

    References
    ----------
    Oden and Pires, J. Appl. Mech. 50 (1983) 67. Wriggers, Computational Contact Mechanics (2006), chapter 5.
    """

    mu: Annotated[float, Quantity("", ge=0, lt=math.inf)]
    slip_length: Annotated[float, Quantity("m", gt=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def project(self, trial: Array) -> Array:
        """Return the radial return to radius mu |p_nu|, which contains all tractions of the law, (n, 3) [Pa]."""
        return return_to_disc(trial, self.mu * contact_pressure(trial))

    def tangential_scaling(self) -> Array:
        """Return the identity, or zero if mu is zero."""
        return isotropic_scaling(self.mu)

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the traction with t + r_tau g(t) = trial, (n, 3) [Pa], where g(t) is the slip of the traction t."""
        limit, width = self._limit_and_width(trial, r)
        return with_tangential_norm(trial, smoothed_friction(tangential_norm(trial), limit, width))

    def tangents(self, trial: Array, gap: Array, r: StepLengths) -> tuple[Array, Array]:
        """Return the derivatives by the trial, (n, 3, 3), and zero for those by the gap.

        With f(x) = limit x / sqrt(width^2 + x^2), they follow from f(x) + x = |trial|.
        """
        limit, width = self._limit_and_width(trial, r)
        friction = smoothed_friction(tangential_norm(trial), limit, width)
        ratio = np.divide(friction, limit, out=np.zeros_like(limit), where=limit > 0.0)
        with np.errstate(over="ignore"):  # f is then a step
            slope = limit / width * np.maximum(1.0 - ratio**2, 0.0) ** 1.5
        by_trial = radial_tangent(trial, friction, 1.0 - 1.0 / (1.0 + slope), self.mu * ratio / (1.0 + slope))
        return by_trial, np.zeros_like(by_trial)

    def _limit_and_width(self, trial: Array, r: StepLengths) -> tuple[Array, float]:
        """Return the limit of Coulomb friction (n,) and the width of the transition to it, both [Pa]."""
        width = min(max(r[1] * self.slip_length, _FLOATS.tiny), _FLOATS.max)
        return self.mu * contact_pressure(trial), width


def smoothed_friction(trial: Array, limit: Array, width: float) -> Array:
    """Return limit x / sqrt(width^2 + x^2) for the x with limit x / sqrt(width^2 + x^2) + x = trial.

    Parameters
    ----------
    trial, limit : Array
        Tractions, (n,) >= 0 [Pa].
    width : float
        Width > 0 [Pa].

    Returns
    -------
    Array
        Friction, (n,) [Pa].

    Notes
    -----
    The left side is concave, and at most limit x / width + x and limit + x. Newton's method therefore increases to the
    root from the larger of the points at which these equal the trial.
    """
    x = np.maximum(trial * (width / (limit + width)), trial - limit)
    for _ in range(MAX_STEPS):
        root = np.hypot(width, x)
        # multiplied by the root, since the slope at x = 0 may overflow
        step = ((trial - x) * root - limit * x) / (limit * (width / root) ** 2 + root)
        x = x + np.maximum(step, 0.0)
        if (step <= ROUND_OFF * x).all():
            break
    friction: Array = limit * (x / np.hypot(width, x))
    return friction


RECORDS: list[Record[ContactLaw]] = [
    Record(
        "tresca",
        Tresca,
        "|t_tau| <= limit wherever there is pressure",
        "Avitzur, Metal Forming: Processes and Analysis (1968); Duvaut & Lions, Inequalities in Mechanics and Physics "
        "(1976), chapter III",
    ),
    Record(
        "capped-coulomb",
        CappedCoulomb,
        "|t_tau| <= min(mu |p|, limit), the shear strength of the softer body",
        "Orowan, Proc. Inst. Mech. Eng. 150 (1943) 140-167",
    ),
    Record(
        "regularised-coulomb",
        RegularisedCoulomb,
        "t_tau = mu |p| g / sqrt(|g|^2 + slip_length^2) of the slip g: smooth, without stick",
        "Oden & Pires, J. Appl. Mech. 50 (1983) 67-76",
    ),
    Record(
        "slip-weakening",
        SlipWeakening,
        "|t_tau| <= mu |p|, with mu decreasing from mu_static to mu_kinetic over slip_distance of slip",
        "Ida, J. Geophys. Res. 77 (1972) 3796-3805; Palmer & Rice, Proc. R. Soc. A 332 (1973) 527-548; "
        "Andrews, J. Geophys. Res. 81 (1976) 5679-5687",
    ),
    Record(
        "rate-and-pressure",
        RateAndPressure,
        "|t_tau| <= mu(v) |p| (|p|/p_0)^(n-1), mu(v) = mu_k + (mu_s - mu_k) exp(-(v/v_s)^d): Stribeck and Archard",
        "Bo & Pavelescu, Wear 82 (1982) 277-289; Archard, Proc. R. Soc. A 243 (1957) 190-205",
    ),
    Record(
        "non-associated-coulomb",
        NonAssociatedCoulomb,
        "t on the ellipse of mu1, mu2; slip normal to another ellipse of half-axes 1, slip_ratio",
        "Michalowski & Mroz, Arch. Mech. 30 (1978) 259-276; Hjiaj, Feng, de Saxce & Mroz, Int. J. Numer. Methods Eng. "
        "60 (2004) 2045-2076",
    ),
    Record(
        "superelliptic-coulomb",
        SuperellipticCoulomb,
        "(|t1|/mu1)^n + (|t2|/mu2)^n <= |p|^n, n >= 1, slip normal to it: rhombus (1), ellipse (2) to box",
        "Mroz & Stupkiewicz, Int. J. Solids Struct. 31 (1994) 1113-1131",
    ),
]
"""Contact laws that this module registers."""
