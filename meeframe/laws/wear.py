"""The contract of wear laws, Archard's law, and contact laws of surfaces that wear."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, final

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.common.timed import TimeLimited
from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.laws.base import ContactLaw, StepLengths, positive_slope, resolve

_ROUND_OFF: Final = 1e-14
"""Relative error of a pressure that counts as zero."""
_MAX_BISECTIONS: Final = 100
"""Largest number of steps towards a pressure."""


@dataclass(frozen=True)
class WearLaw(TimeLimited, ABC):
    """Local wear: the depth that slip removes from the two surfaces together, per length of slip.

    Notes
    -----
    The depth w [m] worn off at a point of the contact follows
        dw/ds = rate(p, v, w),
    with the pressure p, the length s of the slip, its speed v and the depth itself as a memory. The gap between the
    surfaces depends on the sum of what both lose, and so does this law; see docs/explanation/wear.md.
    """

    needs_duration: ClassVar[bool] = False
    """True if `rate` depends on the speed; load steps without a duration are then an error."""

    @abstractmethod
    def rate(self, pressure: Array, speed: Array, worn: Array) -> Array:
        """Return the worn depth per length of slip.

        Parameters
        ----------
        pressure : Array
            Contact pressure, (n,) >= 0 [Pa].
        speed : Array
            Mean speed of the slip in the increment, (n,) >= 0 [m/s]; zero in load steps without a duration.
        worn : Array
            Depth that is worn off before the increment, (n,) >= 0 [m].

        Returns
        -------
        Array
            Rates, (n,) >= 0 [m/m], zero without pressure.

        Notes
        -----
        The rate must be continuous and must not decrease with the pressure: otherwise the pressure at the end of an
        increment, on which its wear depends, is not unique.
        """


@final
@checked_arguments
@dataclass(frozen=True)
class Archard(WearLaw):
    """Wear in proportion to pressure and slip, dw/ds = k p.

    Attributes
    ----------
    coefficient : float
        Wear coefficient over hardness, k >= 0 [1/Pa].

    Raises
    ------
    CaseError
        If it is negative or not finite.

    References
    ----------
    Archard, J. Appl. Phys. 24 (1953) 981-988.
    """

    coefficient: Annotated[float, Quantity("1/Pa", ge=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def rate(self, pressure: Array, speed: Array, worn: Array) -> Array:
        """Return k p.

        Parameters
        ----------
        pressure : Array
            Contact pressure, (n,) >= 0 [Pa].
        speed, worn : Array
            Speed of the slip [m/s] and worn depth [m], (n,) each, on which the rate does not depend.

        Returns
        -------
        Array
            Rates, (n,) >= 0 [m/m].
        """
        return self.coefficient * pressure


@final
@dataclass(frozen=True, eq=False)
class WearingContact(ContactLaw):
    """Contact law during an increment in which the surfaces wear.

    They overlap by the depth that wears off, which is that of the pressure and the slip at the end of the increment:
    the implicit Euler method. The depth grows with the pressure like the shortening of springs.

    Attributes
    ----------
    law : ContactLaw
        Contact law without wear, of surfaces that do not overlap and do not attract each other.
    wear : WearLaw
        Wear law.
    worn : Array
        (n,), depth that is worn off before the increment [m].
    sliding : float or None
        Length of the slip at all nodes [m]; None for that of the contact.
    duration : float or None
        Duration of the increment [s], None if it has none.
    """

    law: ContactLaw
    wear: WearLaw
    worn: Array
    sliding: float | None
    duration: float | None

    def project(self, trial: Array) -> Array:
        """Return the projection of the contact law without wear."""
        return self.law.project(trial)

    def tangential_scaling(self) -> Array:
        """Return that of the contact law without wear."""
        return self.law.tangential_scaling()

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return tractions (n, 3) [Pa] with pressures p that satisfy p + r_nu depth(p) = -trial_nu."""
        return resolve(self.law, self._with_wear(trial, self.slip(gap), r), gap, r)

    def tangents(self, trial: Array, gap: Array, r: StepLengths) -> tuple[Array, Array]:
        """Return the derivatives of `resolve` by the chain rule: by the trial and by the gap [Pa/m], (n, 3, 3) each.

        Nodes without slip are at a kink of the depth, whose derivative by the slip counts as zero.
        """
        slip = self.slip(gap)
        trial_with_wear = self._with_wear(trial, slip, r)
        by_trial, by_gap = (derivative.copy(order="K") for derivative in self.law.tangents(trial_with_wear, gap, r))
        wears = (trial_with_wear[:, 2] < 0.0) & (slip > 0.0) & np.isfinite(slip)
        pressure, length = np.where(wears, -trial_with_wear[:, 2], 1.0), np.where(wears, slip, 1.0)
        by_pressure = positive_slope(lambda pressure: self.depth(pressure, length), pressure)
        share = np.where(wears, 1.0 / (1.0 + r[0] * by_pressure), 1.0)
        if self.sliding is None:
            by_slip = positive_slope(lambda length: self.depth(pressure, length), length)
            for column in range(2):
                direction = np.where(wears, gap[:, column] / length, 0.0)
                by_gap[:, :, column] += by_trial[:, :, 2] * (r[0] * by_slip * share * direction)[:, None]
        by_trial[:, :, 2] *= share[:, None]
        return by_trial, by_gap

    def _with_wear(self, trial: Array, slip: Array, r: StepLengths) -> Array:
        """Return trials (n, 3) [Pa] of surfaces without wear, with the same pressure as under slips (n,) [m]."""
        highest = np.maximum(-trial[:, 2], 0.0)
        pressure = _resolved(highest, lambda pressure: r[0] * self.depth(pressure, slip))
        trial_with_wear = trial.copy(order="K")
        trial_with_wear[:, 2] = np.where(highest > 0.0, -pressure, trial[:, 2])
        return trial_with_wear

    def slip(self, gap: Array) -> Array:
        """Return the length of the slip (n,) [m], for gaps (n, 3) whose tangential part is the slip of the contact."""
        if self.sliding is not None:
            return np.full(len(gap), self.sliding)
        return np.asarray(np.hypot(gap[:, 0], gap[:, 1]))

    def depth(self, pressure: Array, slip: Array) -> Array:
        """Return the depth (n,) [m] that wears off in the increment under pressures (n,) [Pa] by slips (n,) [m]."""
        speed = np.zeros_like(slip) if self.duration is None else slip / self.duration
        return slip * self.wear.rate(pressure, speed, self.worn)


def _resolved(highest: Array, rise: Callable[[Array], Array]) -> Array:
    """Return the p (n,) with p + rise(p) = highest >= 0, for a rise >= 0 that does not fall; by the Illinois method.

    The first step is exact if the rise is in proportion to p.

    References
    ----------
    Dowell & Jarratt, BIT 11 (1971) 168-174.
    """
    low, high = np.zeros_like(highest), highest
    below, above = -highest, rise(highest)
    p = highest
    for _ in range(_MAX_BISECTIONS):
        width = above - below
        p = np.divide(low * above - high * below, width, out=high.copy(), where=width > 0.0)
        error = p + rise(p) - highest
        if (np.abs(error) <= _ROUND_OFF * highest).all():
            break
        is_low = error < 0.0
        # the value at an end that stays is halved
        below, above = np.where(is_low, error, 0.5 * below), np.where(is_low, 0.5 * above, error)
        low, high = np.where(is_low, p, low), np.where(is_low, high, p)
    return p
