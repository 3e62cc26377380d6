"""Direction fields of the friction axes: which way the first principal direction lies at each point."""

import math
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.fields.units import Quantity

Vector = tuple[float, float, float]
Length = Annotated[float, Quantity("m", gt=-math.inf, lt=math.inf)]

ON_AXIS: Final = 1e-9
"""Points nearer to the axis than this fraction of the zone's extent lie on it."""


@dataclass(frozen=True)
class FrictionAxes:
    """Direction of the local axis e1 on the contact zone, from which a contact law measures its angle.

    Either direction: one vector in global axes, the same everywhere, of which e1 is the projection on the tangent
    plane; or around: an axis in global axes through `centre` [m], from which e1 points away. Lengths of the vectors do
    not matter. Raises CaseError unless one of the two is given, centre with `around` only, all three components finite
    and not all zero.
    """

    direction: Vector | None = None
    around: Vector | None = None
    centre: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if (self.direction is None) == (self.around is None):
            given = "neither" if self.around is None else "both"
            raise CaseError(f"FrictionAxes: {given} of direction and around is given; allowed: one of them")
        for name in ("direction", "around", "centre"):
            value = getattr(self, name)
            if value is not None:
                _check_vector(name, value)
        if self.around is None and any(self.centre):
            raise CaseError(f"FrictionAxes: centre = {self.centre!r} has no meaning without around")

    def directions(self, points: Array) -> Array:
        """Return the direction of e1 at points (n, 3) [m], (n, 3) in global axes, not normalised; zero on the axis
        `around`."""
        if self.direction is not None:
            return np.tile(_unit(self.direction), (len(points), 1))
        assert self.around is not None
        axis = _unit(self.around)
        arms = points - np.array(self.centre)
        away: Array = arms - (arms @ axis)[:, None] * axis
        extent = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
        away[np.linalg.norm(away, axis=1) <= ON_AXIS * extent] = 0.0
        return away


def _unit(vector: Vector) -> Array:
    length = math.hypot(*vector)
    return np.array(vector) / length


def _check_vector(name: str, value: Vector) -> None:
    numbers = len(value) == 3 and all(isinstance(x, int | float) and math.isfinite(x) for x in value)
    if not numbers or (name != "centre" and not any(value)):
        allowed = "three finite numbers" + ("" if name == "centre" else ", not all zero")
        raise CaseError(f"FrictionAxes: {name} = {value!r}; allowed: {allowed}")
