"""Shapes of rigid indenters with closed forms."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, final

import numpy as np

from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.indenters.base import Indenter

Profile = Literal["parabolic", "exact"]

ON_THE_EDGE = 1 + 1e-9  # a node on the edge of a punch belongs to it, whatever its last digits


@final
@dataclass(frozen=True)
class Sphere(Indenter):
    """Sphere. profile: r^2 / (2 R), as in Hertz's theory, or the exact R - sqrt(R^2 - r^2).

    The exact sphere has no surface beyond its equator. Raises CaseError unless 0 < radius < inf.
    """

    radius: Annotated[float, Quantity("m", gt=0, lt=math.inf)]
    profile: Profile = "parabolic"

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest point, (n,) [m]."""
        return _round(np.hypot(x, y), self.radius, self.profile)


@final
@dataclass(frozen=True)
class Paraboloid(Indenter):
    """Paraboloid of two principal radii, x^2 / (2 radius_x) + y^2 / (2 radius_y), as in Hertz's theory.

    Its placement turns it. Raises CaseError unless 0 < radius < inf for both.
    """

    radius_x: Annotated[float, Quantity("m", gt=0, lt=math.inf)]
    radius_y: Annotated[float, Quantity("m", gt=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest point, (n,) [m]."""
        return x**2 / (2 * self.radius_x) + y**2 / (2 * self.radius_y)


@final
@dataclass(frozen=True)
class FlatPunch(Indenter):
    """Flat circular end of a punch; no surface beyond its radius.

    Raises CaseError unless that is above zero.
    """

    radius: Annotated[float, Quantity("m", gt=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return 0 on the end face, inf beside it, (n,) [m]."""
        return np.where(np.hypot(x, y) <= self.radius * ON_THE_EDGE, 0.0, np.inf)


@final
@dataclass(frozen=True)
class RectangularPunch(Indenter):
    """Flat rectangular end of a punch; half widths along x and y of its own plane.

    Raises CaseError unless both are above zero.
    """

    half_width_x: Annotated[float, Quantity("m", gt=0)]
    half_width_y: Annotated[float, Quantity("m", gt=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return 0 on the end face, inf beside it, (n,) [m]."""
        within = (np.abs(x) <= self.half_width_x * ON_THE_EDGE) & (np.abs(y) <= self.half_width_y * ON_THE_EDGE)
        return np.where(within, 0.0, np.inf)


@final
@dataclass(frozen=True)
class Cone(Indenter):
    """Cone, apex down; angle: between its side and the plane of the surface.

    Raises CaseError unless 0 < angle < pi/2.
    """

    angle: Annotated[float, Quantity("rad", gt=0, lt=math.pi / 2)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return r tan(angle), (n,) [m]."""
        rise: Array = np.hypot(x, y) * math.tan(self.angle)
        return rise


@final
@dataclass(frozen=True)
class Cylinder(Indenter):
    """Cylinder lying on the surface. direction: angle of its axis from x in its own plane; profile as of the sphere.

    half_length: along the axis from the middle; no surface beyond flat ends. Raises CaseError unless 0 < radius < inf,
    half_length > 0 and the direction is finite.
    """

    radius: Annotated[float, Quantity("m", gt=0, lt=math.inf)]
    direction: Annotated[float, Quantity("rad", gt=-math.inf, lt=math.inf)] = 0.0
    profile: Profile = "parabolic"
    half_length: Annotated[float, Quantity("m", gt=0)] = math.inf

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest line, (n,) [m]."""
        cos, sin = math.cos(self.direction), math.sin(self.direction)
        rise = _round(np.abs(cos * y - sin * x), self.radius, self.profile)
        return np.where(np.abs(cos * x + sin * y) <= self.half_length * ON_THE_EDGE, rise, np.inf)


def _round(r: Array, radius: float, profile: Profile) -> Array:
    """Return the height at distance r >= 0 from the lowest point of a circle."""
    if profile == "parabolic":
        return r**2 / (2 * radius)
    depth = np.sqrt(np.maximum(radius**2 - r**2, 0.0))
    # the same as radius - depth without cancellation near the lowest point
    return np.where(r <= radius * ON_THE_EDGE, r**2 / (radius + depth), np.inf)
