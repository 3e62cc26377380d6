"""Direction fields of the friction axes on a contact zone."""

import math
from dataclasses import dataclass
from numbers import Real
from typing import Annotated, Final

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.fields.units import Quantity

Vector = tuple[float, float, float]
Length = Annotated[float, Quantity("m", gt=-math.inf, lt=math.inf)]

AXIS_TOLERANCE: Final = 1e-9
"""Largest distance from the axis, relative to the extent of the zone, of points that count as lying on it."""


@checked_arguments
@dataclass(frozen=True)
class FrictionAxes:
    """Direction of the local axis e1 on the contact zone, from which a contact law measures its angle.

    Exactly one of `direction` and `around` is required. The lengths of these vectors do not matter.

    Attributes
    ----------
    direction : tuple of float
        Vector in global axes, the same everywhere; e1 is its projection on the tangent plane.
    around : tuple of float
        Direction of an axis in global axes; e1 points away from that axis.
    centre : tuple of float
        Point on the axis `around` [m].

    Raises
    ------
    CaseError
        If neither or both of `direction` and `around` are present, `centre` is present without `around`, or a vector
        is zero or not three finite numbers.
    """

    direction: Vector | None = None
    around: Vector | None = None
    centre: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if (self.direction is None) == (self.around is None):
            number = "neither" if self.around is None else "both"
            raise CaseError(f"FrictionAxes: {number} of direction and around present; allowed: one of them")
        for name in ("direction", "around", "centre"):
            value = getattr(self, name)
            if value is not None:
                _check_vector(name, value)
        if self.around is None and any(self.centre):
            raise CaseError(f"FrictionAxes: centre = {self.centre!r} requires around")

    def directions(self, points: Array) -> Array:
        """Return the direction of e1 at points.

        Parameters
        ----------
        points : Array
            Positions, (n, 3) [m].

        Returns
        -------
        Array
            Directions in global axes, (n, 3), not normalised; zero on the axis `around`.
        """
        if self.direction is not None:
            return np.tile(_unit(self.direction), (len(points), 1))
        assert self.around is not None
        axis = _unit(self.around)
        arms = points - np.array(self.centre)
        outward: Array = arms - (arms @ axis)[:, None] * axis
        extent = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
        outward[np.linalg.norm(outward, axis=1) <= AXIS_TOLERANCE * extent] = 0.0
        return outward


def _unit(vector: Vector) -> Array:
    length = math.hypot(*vector)
    return np.array(vector) / length


def _check_vector(name: str, value: Vector) -> None:
    is_vector = len(value) == 3 and all(isinstance(x, Real) and math.isfinite(x) for x in value)
    if not is_vector or (name != "centre" and not any(value)):
        allowed = "three finite numbers" + ("" if name == "centre" else ", not all zero")
        raise CaseError(f"FrictionAxes: {name} = {value!r}; allowed: {allowed}")
