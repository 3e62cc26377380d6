"""Compliant interface: pressure as a power of the overlap."""

import math
from dataclasses import dataclass
from typing import Annotated, Final, final

import numpy as np

from meeframe.plugin import Array, Quantity, StepLengths, check_quantities
from meeframe_laws.coulomb_contact import CoulombContact

_MOST_STEPS: Final = 60


@final
@dataclass(frozen=True)
class Compliant(CoulombContact):
    """|p_nu| = reference_pressure * (closure / reference_closure)^exponent, 0 where the surfaces are apart.

    The closure is how far the nominal surfaces overlap, -g_nu: the asperities of a rough interface are pressed in by so
    much. Exponents of machined metal surfaces are 2 to 3.3 (Back, Burdekin & Cowley); 1 is a layer of springs, 1.5 a
    layer of equal spheres. As the reference closure goes to zero the contact becomes Signorini's.

    reference_pressure [Pa], reference_closure [m], exponent: > 0; mu: Coulomb friction on the pressure, inf allowed.
    Raises CaseError if one is out of bounds.
    Source: Oden & Martins, Comput. Methods Appl. Mech. Eng. 52 (1985) 527.
    """

    reference_pressure: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)]
    reference_closure: Annotated[float, Quantity("m", gt=0, lt=math.inf)]
    exponent: Annotated[float, Quantity("", gt=0, lt=math.inf)] = 2.0

    def __post_init__(self) -> None:
        check_quantities(self)

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the traction (n, 3) with p_nu + r_nu g_nu(p_nu) = trial, and radial return to the disc of radius mu
        |p_nu|."""
        return self.project(self._pressed(trial, r))

    def tangents(self, trial: Array, gap: Array, r: StepLengths) -> tuple[Array, Array]:
        """Return the derivatives by the trial (n, 3, 3), and zero by the gap."""
        pressed = self._pressed(trial, r)
        pressure = -pressed[:, 2]
        contact_fraction = pressure > 0.0
        closure = self._closure(np.where(contact_fraction, pressure, self.reference_pressure))
        softness = closure / (self.exponent * np.where(contact_fraction, pressure, self.reference_pressure))
        by_trial = self.tangent(pressed)
        by_trial[:, :, 2] /= (1.0 + r[0] * softness)[:, None]
        by_trial[~contact_fraction] = 0.0
        return by_trial, np.zeros_like(by_trial)

    def _closure(self, pressure: Array) -> Array:
        """Return the overlap (n,) [m] under pressures (n,) [Pa]."""
        return np.asarray(self.reference_closure * (pressure / self.reference_pressure) ** (1.0 / self.exponent))

    def _pressed(self, trial: Array, r: StepLengths) -> Array:
        """Return the trial (n, 3) with the normal traction of the law in its last column."""
        driving = np.maximum(-trial[:, 2], 0.0) / self.reference_pressure
        spring = r[0] * self.reference_closure / self.reference_pressure
        pressed = np.array(trial)
        pressed[:, 2] = -self.reference_pressure * _share_of_power(driving, spring, self.exponent)
        return pressed


def _share_of_power(total: Array, spring: float, exponent: float) -> Array:
    """Return x^exponent, (n,), of the x >= 0 with x^exponent + spring x = total (n,) >= 0.

    Newton's method on whichever of x and x^exponent makes the sum convex: from above it falls to the root.
    """
    steeper = max(exponent, 1.0 / exponent)
    power, linear = (1.0, spring) if exponent >= 1.0 else (spring, 1.0)
    x = np.minimum((total / power) ** (1.0 / steeper), total / linear)
    for _ in range(_MOST_STEPS):
        excess = power * x**steeper + linear * x - total
        lower = x - excess / (steeper * power * x ** (steeper - 1.0) + linear)
        if (lower >= x).all():
            break
        x = np.minimum(lower, x)
    return np.asarray(x**exponent if exponent >= 1.0 else x)
