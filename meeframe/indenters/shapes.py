"""Shapes of rigid indenters in closed form."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, final

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.indenters.base import Indenter

Profile = Literal["parabolic", "exact"]

BORDER_FACTOR = 1 + 1e-9  # nodes on the border of a punch belong to it in spite of round-off


@final
@checked_arguments
@dataclass(frozen=True)
class Sphere(Indenter):
    """Sphere.

    Attributes
    ----------
    radius : float
        Radius R [m].
    profile : {'parabolic', 'exact'}
        r^2 / (2 R), as in the theory of Hertz, or R - sqrt(R^2 - r^2), which has no surface beyond its equator.

    Raises
    ------
    CaseError
        If the radius is not positive and finite.
    """

    radius: Annotated[float, Quantity("m", gt=0, lt=math.inf)]
    profile: Profile = "parabolic"

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest point.

        Parameters
        ----------
        x, y : Array
            Coordinates from the axis of the indenter, (n,) each [m].

        Returns
        -------
        Array
            Heights, (n,) >= 0 [m], inf beyond the equator with the exact profile.
        """
        return _circle_height(np.hypot(x, y), self.radius, self.profile)


@final
@checked_arguments
@dataclass(frozen=True)
class Paraboloid(Indenter):
    """Paraboloid x^2 / (2 radius_x) + y^2 / (2 radius_y), as in the theory of Hertz.

    Attributes
    ----------
    radius_x, radius_y : float
        Principal radii [m]. The placement rotates the axes.

    Raises
    ------
    CaseError
        If a radius is not positive and finite.
    """

    radius_x: Annotated[float, Quantity("m", gt=0, lt=math.inf)]
    radius_y: Annotated[float, Quantity("m", gt=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest point, x^2 / (2 radius_x) + y^2 / (2 radius_y).

        Parameters
        ----------
        x, y : Array
            Coordinates from the axis of the indenter, (n,) each [m].

        Returns
        -------
        Array
            Heights, (n,) >= 0 [m].
        """
        return x**2 / (2 * self.radius_x) + y**2 / (2 * self.radius_y)


@final
@checked_arguments
@dataclass(frozen=True)
class FlatPunch(Indenter):
    """Flat circular end of a punch, without surface beyond its radius.

    Attributes
    ----------
    radius : float
        Radius [m].

    Raises
    ------
    CaseError
        If the radius is not positive.
    """

    radius: Annotated[float, Quantity("m", gt=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the end face.

        Parameters
        ----------
        x, y : Array
            Coordinates from the axis of the indenter, (n,) each [m].

        Returns
        -------
        Array
            Heights, (n,) [m]: 0 on the end face, inf outside.
        """
        return np.where(np.hypot(x, y) <= self.radius * BORDER_FACTOR, 0.0, np.inf)


@final
@checked_arguments
@dataclass(frozen=True)
class RectangularPunch(Indenter):
    """Flat rectangular end of a punch, without surface beyond it.

    Attributes
    ----------
    half_width_x, half_width_y : float
        Half widths along x and y [m]. The placement rotates the axes.

    Raises
    ------
    CaseError
        If a half width is not positive.
    """

    half_width_x: Annotated[float, Quantity("m", gt=0)]
    half_width_y: Annotated[float, Quantity("m", gt=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the end face.

        Parameters
        ----------
        x, y : Array
            Coordinates from the axis of the indenter, (n,) each [m].

        Returns
        -------
        Array
            Heights, (n,) [m]: 0 on the end face, inf outside.
        """
        is_inside = (np.abs(x) <= self.half_width_x * BORDER_FACTOR) & (np.abs(y) <= self.half_width_y * BORDER_FACTOR)
        return np.where(is_inside, 0.0, np.inf)


@final
@checked_arguments
@dataclass(frozen=True)
class Cone(Indenter):
    """Cone with its apex down.

    Attributes
    ----------
    angle : float
        Angle between its side and the plane of the surface [rad].

    Raises
    ------
    CaseError
        If the angle does not lie between 0 and pi / 2.
    """

    angle: Annotated[float, Quantity("rad", gt=0, lt=math.pi / 2)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the tip, r tan(angle).

        Parameters
        ----------
        x, y : Array
            Coordinates from the axis of the indenter, (n,) each [m].

        Returns
        -------
        Array
            Heights, (n,) >= 0 [m].
        """
        rise: Array = np.hypot(x, y) * math.tan(self.angle)
        return rise


@final
@checked_arguments
@dataclass(frozen=True)
class Cylinder(Indenter):
    """Cylinder that lies on the surface.

    Attributes
    ----------
    radius : float
        Radius [m].
    direction : float
        Angle of its axis from x in the plane of the surface [rad].
    profile : {'parabolic', 'exact'}
        Profile, as for the sphere.
    half_length : float
        Half of its length [m]. There is no surface beyond the flat ends.

    Raises
    ------
    CaseError
        If the radius is not positive and finite, the half length is not positive, or the direction is not finite.
    """

    radius: Annotated[float, Quantity("m", gt=0, lt=math.inf)]
    direction: Annotated[float, Quantity("rad", gt=-math.inf, lt=math.inf)] = 0.0
    profile: Profile = "parabolic"
    half_length: Annotated[float, Quantity("m", gt=0)] = math.inf

    def __post_init__(self) -> None:
        check_quantities(self)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest line.

        Parameters
        ----------
        x, y : Array
            Coordinates from the axis of the indenter, (n,) each [m].

        Returns
        -------
        Array
            Heights, (n,) >= 0 [m], inf beyond the ends, and beyond the radius with the exact profile.
        """
        cos, sin = math.cos(self.direction), math.sin(self.direction)
        rise = _circle_height(np.abs(cos * y - sin * x), self.radius, self.profile)
        return np.where(np.abs(cos * x + sin * y) <= self.half_length * BORDER_FACTOR, rise, np.inf)


def _circle_height(r: Array, radius: float, profile: Profile) -> Array:
    """Return the height at distance r >= 0 from the lowest point of a circle."""
    if profile == "parabolic":
        return r**2 / (2 * radius)
    depth = np.sqrt(np.maximum(radius**2 - r**2, 0.0))
    # equal to radius - depth, without cancellation near the lowest point
    return np.where(r <= radius * BORDER_FACTOR, r**2 / (radius + depth), np.inf)
