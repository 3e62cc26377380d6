"""Friction that changes with the way that has been slipped, with the speed of slip and with pressure."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar, final

import numpy as np

from meeframe.plugin import Array, CaseError, ContactLaw, Quantity, StepLengths, check_quantities
from meeframe_laws.limits import isotropic_scaling, pressing, returned_to_disc, sheared


@final
@dataclass(frozen=True)
class SlipWeakening(ContactLaw):
    """|t_tau| <= mu |p_nu|, mu falling linearly from mu_static to mu_kinetic over slip_distance of slip path.

    mu_static >= mu_kinetic >= 0: friction coefficients; slip_distance: [m], > 0. A node's path is the length of the way
    that it has slipped before the increment and its slip in it; it does not heal. The limit follows the slip as the
    iteration finds it: with a surrounding stiffness [Pa/m] below (mu_static - mu_kinetic) |p| / slip_distance there
    are several solutions, and sliding sets in with a jump.
    Raises CaseError if one of them is out of bounds.
    Source: Ida, J. Geophys. Res. 77 (1972) 3796; Palmer and Rice, Proc. R. Soc. A 332 (1973) 527; Andrews, J. Geophys.
    Res. 81 (1976) 5679.
    """

    mu_static: Annotated[float, Quantity("", ge=0, lt=math.inf)]
    mu_kinetic: Annotated[float, Quantity("", ge=0, lt=math.inf)]
    slip_distance: Annotated[float, Quantity("m", gt=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)
        if self.mu_kinetic > self.mu_static:
            raise CaseError(
                f"SlipWeakening: mu_kinetic = {self.mu_kinetic:g} is above mu_static = {self.mu_static:g}; allowed: "
                "at most mu_static, as friction weakens"
            )

    def coefficient(self, slip_path: Array) -> Array:
        """Return mu (n,) after slip paths (n,) [m]."""
        strength = np.maximum(self.slip_distance - slip_path, 0.0) / self.slip_distance
        mu: Array = self.mu_kinetic + (self.mu_static - self.mu_kinetic) * strength
        return mu

    def project(self, trial: Array) -> Array:
        """Return the radial return to the disc of radius mu_static |p_nu|, which holds all tractions of the law, (n,
        3) [Pa]."""
        return returned_to_disc(trial, self.mu_static * pressing(trial))

    def tangential_scaling(self) -> Array:
        """Return the identity; zero if mu_static is zero."""
        return isotropic_scaling(self.mu_static)

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the radial return to the disc of radius mu |p_nu|, mu that of the slip of this increment alone, (n,
        3) [Pa]."""
        return returned_to_disc(trial, self.coefficient(sheared(gap)) * pressing(trial))

    def for_increment(self, slip_path: Array, duration: float | None) -> ContactLaw:
        """Return the law on surfaces that have slipped already."""
        return _Increment(self, lambda trial, slip: self.coefficient(slip_path + slip) * pressing(trial))


@final
@dataclass(frozen=True)
class RateAndPressure(ContactLaw):
    """|t_tau| <= mu(v) (|p_nu|/p_0)^(n - 1) |p_nu|, mu(v) = mu_kinetic + (mu_static - mu_kinetic) exp(-(v/v_s)^d).

    The speed v is the slip of the increment over its duration. mu_static, mu_kinetic: coefficients >= 0 of infinitely
    slow and fast slip at the reference pressure; either may be the larger; reference_speed: v_s [m/s], > 0;
    speed_exponent: d, > 0 (1: exponential, 2: Gaussian); reference_pressure: p_0 [Pa], > 0; pressure_exponent: n in
    (0, 1], 1 for Coulomb's proportionality, 2/3 for a single elastic asperity. The limit follows the speed as the
    iteration finds it: where it falls more steeply, in Pa per metre of slip, than the surrounding stiffness there are
    several solutions, and sliding sets in with a jump. At the reference pressure it nowhere falls more steeply than
    (mu_static - mu_kinetic) p_0 / (v_s duration) if d is from 1 to 2; infinitely so at v = 0 if d < 1, whatever the
    stiffness.
    Raises CaseError if one of them is out of bounds, for_increment if it is told no duration.
    Source: Bo and Pavelescu, Wear 82 (1982) 277, for mu(v) after Stribeck; Archard, Proc. R. Soc. A 243 (1957) 190, for
    the area of contact of elastic asperities, which goes with the load to the power of 2/3 to 1.
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
        """Return mu(v) (n,) at speeds (n,) >= 0 [m/s]."""
        with np.errstate(over="ignore"):  # infinitely fast it is then
            static = np.exp(-((speed / self.reference_speed) ** self.speed_exponent))
        mu: Array = self.mu_kinetic + (self.mu_static - self.mu_kinetic) * static
        return mu

    def limit(self, trial: Array, mu: Array | float) -> Array:
        """Return the largest tangential traction (n,) [Pa] at the pressure of trials (n, 3) and coefficients mu
        (n,)."""
        pressure = pressing(trial)
        n = self.pressure_exponent
        limit: Array = mu * self.reference_pressure ** (1.0 - n) * pressure**n
        return limit

    def project(self, trial: Array) -> Array:
        """Return the radial return to the limit of the larger coefficient, which holds all tractions of the law, (n,
        3) [Pa]."""
        return returned_to_disc(trial, self.limit(trial, max(self.mu_static, self.mu_kinetic)))

    def tangential_scaling(self) -> Array:
        """Return the identity; zero if both coefficients are zero."""
        return isotropic_scaling(max(self.mu_static, self.mu_kinetic))

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the radial return to the limit of infinitely slow slip, (n, 3) [Pa]; see for_increment."""
        return returned_to_disc(trial, self.limit(trial, self.mu_static))

    def for_increment(self, slip_path: Array, duration: float | None) -> ContactLaw:
        """Return the law of an increment that takes a duration [s]. Raises CaseError unless that is positive and
        finite."""
        if duration is None or not 0.0 < duration < math.inf:
            raise CaseError(
                f"RateAndPressure: duration of the increment = {duration}; allowed: a positive number of seconds, as "
                "friction depends on the speed of slip"
            )
        return _Increment(self, lambda trial, slip: self.limit(trial, self.coefficient(slip / duration)))


@final
@dataclass(frozen=True, eq=False)
class _Increment(ContactLaw):
    """A law during an increment. limit: (n,) [Pa] of the tangential traction, of trials (n, 3) and slips (n,) [m]."""

    law: ContactLaw
    limit: Callable[[Array, Array], Array]

    def project(self, trial: Array) -> Array:
        return self.law.project(trial)

    def tangential_scaling(self) -> Array:
        return self.law.tangential_scaling()

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        return returned_to_disc(trial, self.limit(trial, sheared(gap)))

    def for_increment(self, slip_path: Array, duration: float | None) -> ContactLaw:
        return self.law.for_increment(slip_path, duration)
