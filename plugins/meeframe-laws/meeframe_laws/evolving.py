"""Friction laws that change with the slip path, the speed of slip and the pressure."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar, final

import numpy as np

from meeframe.plugin import Array, CaseError, ContactLaw, Quantity, StepLengths, check_quantities
from meeframe_laws.limits import (
    contact_pressure,
    direction,
    disc_tangent,
    in_contact,
    is_within_disc,
    isotropic_scaling,
    return_to_disc,
    tangential_norm,
)


@final
@dataclass(frozen=True)
class SlipWeakening(ContactLaw):
    """Friction |t_tau| <= mu |p_nu| with mu decreasing linearly from mu_static to mu_kinetic over a slip distance.

    Attributes
    ----------
    mu_static, mu_kinetic : float
        Friction coefficients, mu_static >= mu_kinetic >= 0.
    slip_distance : float
        Slip path of complete weakening, > 0 [m].

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    Notes
    -----
    The slip path of a node is the length that it has slipped before the increment plus its slip during the increment.
    There is no healing. The limit follows the slip during the iteration. If the surrounding stiffness [Pa/m] is below
    (mu_static - mu_kinetic) |p| / slip_distance, there are several solutions, and sliding begins with a jump.

    References
    ----------
    Ida, J. Geophys. Res. 77 (1972) 3796. Palmer and Rice, Proc. R. Soc. A 332 (1973) 527. Andrews, J. Geophys. Res. 81
    (1976) 5679.
    """

    mu_static: Annotated[float, Quantity("", ge=0, lt=math.inf)]
    mu_kinetic: Annotated[float, Quantity("", ge=0, lt=math.inf)]
    slip_distance: Annotated[float, Quantity("m", gt=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)
        if self.mu_kinetic > self.mu_static:
            raise CaseError(
                f"SlipWeakening: mu_kinetic = {self.mu_kinetic:g} is larger than mu_static = {self.mu_static:g}; "
                "allowed: at most mu_static, since friction weakens"
            )

    def coefficient(self, slip_path: Array) -> Array:
        """Return the friction coefficient after some slip.

        Parameters
        ----------
        slip_path : Array
            Slip paths, (n,) >= 0 [m].

        Returns
        -------
        Array
            Coefficients, (n,), from mu_static to mu_kinetic.
        """
        strength = np.maximum(self.slip_distance - slip_path, 0.0) / self.slip_distance
        mu: Array = self.mu_kinetic + (self.mu_static - self.mu_kinetic) * strength
        return mu

    def project(self, trial: Array) -> Array:
        """Return the radial return to radius mu_static |p_nu|, which contains all tractions of the law, (n, 3) [Pa]."""
        return return_to_disc(trial, self.mu_static * contact_pressure(trial))

    def tangential_scaling(self) -> Array:
        """Return the identity, or zero if mu_static is zero."""
        return isotropic_scaling(self.mu_static)

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the radial return to radius mu |p_nu|, with mu after the slip of this increment, (n, 3) [Pa]."""
        return return_to_disc(trial, self.coefficient(tangential_norm(gap)) * contact_pressure(trial))

    def for_increment(self, slip_path: Array, duration: float | None) -> ContactLaw:
        """Return the law on surfaces with slip paths before the increment."""

        def limit(trial: Array, slip: Array) -> Array:
            return self.coefficient(slip_path + slip) * contact_pressure(trial)

        def slopes(trial: Array, slip: Array) -> tuple[Array, Array]:
            path = slip_path + slip
            rate = np.where(path < self.slip_distance, (self.mu_static - self.mu_kinetic) / self.slip_distance, 0.0)
            return self.coefficient(path), -rate * contact_pressure(trial)

        return _Increment(self, limit, slopes)


@final
@dataclass(frozen=True)
class RateAndPressure(ContactLaw):
    """Friction that depends on the speed of slip and on the pressure.

    The limit is |t_tau| <= mu(v) (|p_nu|/p_0)^(n - 1) |p_nu| with mu(v) = mu_kinetic + (mu_static - mu_kinetic)
    exp(-(v/v_s)^d).

    Attributes
    ----------
    mu_static, mu_kinetic : float
        Coefficients >= 0 of infinitely slow and infinitely fast slip at the reference pressure; either may be larger.
    reference_speed : float
        v_s > 0 [m/s].
    speed_exponent : float
        d > 0 (1 is exponential, 2 Gaussian).
    reference_pressure : float
        p_0 > 0 [Pa].
    pressure_exponent : float
        n in (0, 1]: 1 for proportionality (Coulomb), 2/3 for a single elastic asperity.

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    Notes
    -----
    The speed v is the slip of the increment over its duration. The limit follows the speed during the iteration. If it
    decreases more steeply, in Pa per metre of slip, than the surrounding stiffness, there are several solutions, and
    sliding begins with a jump. At the reference pressure the slope is at most (mu_static - mu_kinetic) p_0 /
    (v_s duration) if d is from 1 to 2; if d < 1 it is infinite at v = 0, so that no stiffness suffices.

    References
    ----------
    mu(v) after Stribeck: Bo and Pavelescu, Wear 82 (1982) 277. The area of contact of elastic asperities, proportional
    to the load to a power from 2/3 to 1: Archard, Proc. R. Soc. A 243 (1957) 190.
    """

    needs_duration: ClassVar[bool] = True

    mu_static: Annotated[float, Quantity("", ge=0, lt=math.inf)]
    mu_kinetic: Annotated[float, Quantity("", ge=0, lt=math.inf)]
    reference_speed: Annotated[float, Quantity("m/s", gt=0, lt=math.inf)]
    speed_exponent: Annotated[float, Quantity("", gt=0, lt=math.inf)] = 1.0
    reference_pressure: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)] = 1e6
    pressure_exponent: Annotated[float, Quantity("", gt=0, le=1)] = 1.0

    def __post_init__(self) -> None:
        check_quantities(self)

    def coefficient(self, speed: Array) -> Array:
        """Return the friction coefficient mu(v) at the reference pressure.

        Parameters
        ----------
        speed : Array
            Speeds of slip, (n,) >= 0 [m/s].

        Returns
        -------
        Array
            Coefficients, (n,).
        """
        with np.errstate(over="ignore"):  # the speed is then infinite
            static = np.exp(-((speed / self.reference_speed) ** self.speed_exponent))
        mu: Array = self.mu_kinetic + (self.mu_static - self.mu_kinetic) * static
        return mu

    def _coefficient_slope(self, speed: Array) -> Array:
        """Return dmu/dv, (n,) [s/m], at speeds (n,) >= 0 [m/s], zero at rest, where the direction of slip changes."""
        d, ratio = self.speed_exponent, np.where(speed > 0.0, speed, self.reference_speed) / self.reference_speed
        with np.errstate(over="ignore", invalid="ignore"):
            slope = -d * ratio ** (d - 1.0) * (self.coefficient(speed) - self.mu_kinetic) / self.reference_speed
        return np.where(np.isfinite(slope) & (speed > 0.0), slope, 0.0)

    def limit(self, trial: Array, mu: Array | float) -> Array:
        """Return the largest tangential traction.

        Parameters
        ----------
        trial : Array
            Trial tractions, (n, 3) [Pa], along e1, e2, nu.
        mu : Array or float
            Friction coefficients at the reference pressure, (n,).

        Returns
        -------
        Array
            Limits, (n,) >= 0 [Pa].
        """
        pressure = contact_pressure(trial)
        n = self.pressure_exponent
        limit: Array = mu * self.reference_pressure ** (1.0 - n) * pressure**n
        return limit

    def project(self, trial: Array) -> Array:
        """Return the radial return to the larger limit, which contains all tractions of the law, (n, 3) [Pa]."""
        return return_to_disc(trial, self.limit(trial, max(self.mu_static, self.mu_kinetic)))

    def tangential_scaling(self) -> Array:
        """Return the identity, or zero if both coefficients are zero."""
        return isotropic_scaling(max(self.mu_static, self.mu_kinetic))

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the radial return to the limit of infinitely slow slip, (n, 3) [Pa]; see `for_increment`."""
        return return_to_disc(trial, self.limit(trial, self.mu_static))

    def for_increment(self, slip_path: Array, duration: float | None) -> ContactLaw:
        """Return the law during an increment of a duration [s].

        Raises
        ------
        CaseError
            If the duration is None, or not positive and finite.
        """
        if duration is None or not 0.0 < duration < math.inf:
            raise CaseError(
                f"RateAndPressure: duration of the increment = {duration}; allowed: a positive number of seconds, "
                "since friction depends on the speed of slip"
            )

        def limit(trial: Array, slip: Array) -> Array:
            return self.limit(trial, self.coefficient(slip / duration))

        def slopes(trial: Array, slip: Array) -> tuple[Array, Array]:
            pressure = contact_pressure(trial)
            by_pressure = np.divide(limit(trial, slip), pressure, out=np.zeros_like(slip), where=pressure > 0.0)
            by_speed = self._coefficient_slope(slip / duration)
            return self.pressure_exponent * by_pressure, self.limit(trial, by_speed) / duration

        return _Increment(self, limit, slopes)


@final
@dataclass(frozen=True, eq=False)
class _Increment(ContactLaw):
    """A law during an increment, with a limit (n,) [Pa] that is a function of trials (n, 3) and slips (n,) [m].

    Attributes
    ----------
    law : ContactLaw
        The law.
    limit : callable
        The limit.
    slopes : callable
        Derivatives of the limit by the pressure, (n,), and by the slip, (n,) [Pa/m].
    """

    law: ContactLaw
    limit: Callable[[Array, Array], Array]
    slopes: Callable[[Array, Array], tuple[Array, Array]]

    def project(self, trial: Array) -> Array:
        return self.law.project(trial)

    def tangential_scaling(self) -> Array:
        return self.law.tangential_scaling()

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        return return_to_disc(trial, self.limit(trial, tangential_norm(gap)))

    def tangents(self, trial: Array, gap: Array, r: StepLengths) -> tuple[Array, Array]:
        slip = tangential_norm(gap)
        limit, (by_pressure, by_slip) = self.limit(trial, slip), self.slopes(trial, slip)
        by_gap = np.zeros((3, 3, len(trial))).transpose(2, 0, 1)
        slips = in_contact(trial) & ~is_within_disc(trial, limit)
        of_friction, of_slip = direction(trial), direction(gap)
        for i, j in np.ndindex(2, 2):
            by_gap[:, i, j] = np.where(slips, by_slip * of_friction[i] * of_slip[j], 0.0)
        return disc_tangent(trial, limit, by_pressure), by_gap

    def for_increment(self, slip_path: Array, duration: float | None) -> ContactLaw:
        return self.law.for_increment(slip_path, duration)
