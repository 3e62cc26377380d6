"""The contract of wear laws, and Archard's law."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar, final

import numpy as np

from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities


@dataclass(frozen=True)
class WearLaw(ABC):
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
        """Return k p, (n,)."""
        return self.coefficient * pressure


def wear_compliance(law: WearLaw, pressure: Array, slip: Array, duration: float | None, worn: Array) -> Array:
    """Return the depth worn off in an increment over the pressure: the compliance of a layer of springs.

    With the pressure at the end of the increment it is the implicit Euler method. For a law in proportion to the
    pressure it does not depend on it.

    Parameters
    ----------
    law : WearLaw
        The law.
    pressure : Array
        Pressures, (n,) > 0 [Pa].
    slip : Array
        Length of the slip in the increment, (n,) >= 0 [m].
    duration : float or None
        Duration of the increment [s], None if it has none.
    worn : Array
        Depth that is worn off before, (n,) [m].

    Returns
    -------
    Array
        Compliance, (n,) >= 0 [m/Pa].
    """
    speed = np.zeros_like(slip) if duration is None else slip / duration
    compliance: Array = slip * law.rate(pressure, speed, worn) / pressure
    return compliance
