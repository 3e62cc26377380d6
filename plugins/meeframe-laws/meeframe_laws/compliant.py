"""A compliant interface, with the pressure as a power of the overlap."""

import math
from dataclasses import dataclass
from typing import Annotated, Final, final

import numpy as np

from meeframe.plugin import Array, Quantity, StepLengths, check_quantities
from meeframe_laws.coulomb_contact import CoulombContact

_MAX_STEPS: Final = 60


@final
@dataclass(frozen=True)
class Compliant(CoulombContact):
    """Compliant contact, |p_nu| = reference_pressure * (closure / reference_closure)^exponent, 0 in open gaps.

    Attributes
    ----------
    reference_pressure, reference_closure, exponent : float
        Pressure [Pa] and closure [m] of a reference state, and exponent, all > 0.
    mu : float
        Coefficient of Coulomb friction on the pressure, inf allowed.

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    Notes
    -----
    The closure is the overlap of the nominal surfaces, -g_nu, by which the asperities of a rough interface are
    compressed. Exponents of machined metal surfaces are 2 to 3.3 (Back, Burdekin & Cowley); 1 is a layer of springs,
    1.5 a layer of equal spheres. The contact becomes unilateral as the reference closure tends to zero.

    References
    ----------
    Oden & Martins, Comput. Methods Appl. Mech. Eng. 52 (1985) 527.
    """

    reference_pressure: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)]
    reference_closure: Annotated[float, Quantity("m", gt=0, lt=math.inf)]
    exponent: Annotated[float, Quantity("", gt=0, lt=math.inf)] = 2.0

    def __post_init__(self) -> None:
        check_quantities(self)

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the traction (n, 3) with p_nu + r_nu g_nu(p_nu) = trial, after radial return to radius mu |p_nu|."""
        return self.project(self._with_pressure(trial, r))

    def tangents(self, trial: Array, gap: Array, r: StepLengths) -> tuple[Array, Array]:
        """Return the derivatives by the trial, (n, 3, 3), and zero for those by the gap."""
        resolved = self._with_pressure(trial, r)
        pressure = -resolved[:, 2]
        in_contact = pressure > 0.0
        closure = self._closure(np.where(in_contact, pressure, self.reference_pressure))
        softness = closure / (self.exponent * np.where(in_contact, pressure, self.reference_pressure))
        by_trial = self.tangent(resolved)
        by_trial[:, :, 2] /= (1.0 + r[0] * softness)[:, None]
        by_trial[~in_contact] = 0.0
        return by_trial, np.zeros_like(by_trial)

    def _closure(self, pressure: Array) -> Array:
        """Return the overlap (n,) [m] under pressures (n,) [Pa]."""
        return np.asarray(self.reference_closure * (pressure / self.reference_pressure) ** (1.0 / self.exponent))

    def _with_pressure(self, trial: Array, r: StepLengths) -> Array:
        """Return the trial (n, 3) with the normal traction of the law in its last column."""
        trial_pressure = np.maximum(-trial[:, 2], 0.0) / self.reference_pressure
        spring = r[0] * self.reference_closure / self.reference_pressure
        resolved = np.array(trial)
        resolved[:, 2] = -self.reference_pressure * _solve_power_sum(trial_pressure, spring, self.exponent)
        return resolved


def _solve_power_sum(total: Array, spring: float, exponent: float) -> Array:
    """Return x^exponent, (n,), of the x >= 0 with x^exponent + spring x = total (n,) >= 0.

    Newton's method in x or x^exponent, whichever makes the sum convex, decreases from above to the root.
    """
    steeper = max(exponent, 1.0 / exponent)
    power, linear = (1.0, spring) if exponent >= 1.0 else (spring, 1.0)
    x = np.minimum((total / power) ** (1.0 / steeper), total / linear)
    for _ in range(_MAX_STEPS):
        excess = power * x**steeper + linear * x - total
        next_x = x - excess / (steeper * power * x ** (steeper - 1.0) + linear)
        if (next_x >= x).all():
            break
        x = np.minimum(next_x, x)
    return np.asarray(x**exponent if exponent >= 1.0 else x)
