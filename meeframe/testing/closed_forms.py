"""Closed forms for frictionless indentation of an axisymmetric magneto-electro-elastic half space.

The half space lies at x3 < 0 and is poled along x3, its outward normal; t3, q and s are the extended tractions on that
normal, and xi (3, 3) is its point-source response (see `meeframe.material.half_space.axisymmetric_compliance`).
Indentation is described by positive numbers: approach g, force P, pressure p = -t3. Charge and magnetic flux are
outward fluxes, the limit of q = +kappa (phi - phi_o) for kappa -> inf.

Each density is a combination of two axisymmetric ones on the disc of radius a: a singular one, 1/sqrt(a^2 - r^2), and a
bounded one that belongs to the shape of the indenter. Both have elementary potentials, integrals of density/|x - y|.

References
----------
Paper, eqs. (33)-(36), with the corrections of docs/explanation/theory.md; basic potentials from Johnson, Contact
Mechanics (1985), chapter 3, and Sneddon, Int. J. Eng. Sci. 3 (1965) 47.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.common.errors import MeeframeError
from meeframe.fields import Array

_NORMAL, _ELECTRIC, _MAGNETIC = range(3)
CONDITIONS: Final = {
    "EMII": (None, None),
    "ECMII": (0.0, None),
    "EIMCI": (None, 0.0),
    "EMCI": (0.0, 0.0),
}
"""The four conditions of the paper as (electric, magnetic) potential of the indenter; None if it insulates."""


class Shape(ABC):
    """Abstract axisymmetric indenter: its contact radius, and the bounded density due to its curvature."""

    @abstractmethod
    def contact_radius(self, approach: float) -> float:
        """Return the radius for which an uncharged indenter has no singularity at the contact edge.

        Parameters
        ----------
        approach : float
            Approach g [m].

        Returns
        -------
        float
            Contact radius a [m].
        """

    @abstractmethod
    def flat_approach(self, a: float) -> float:
        """Return the approach due to the bounded density; the remainder acts like that of a flat punch.

        Parameters
        ----------
        a : float
            Contact radius [m].

        Returns
        -------
        float
            Approach [m].
        """

    @abstractmethod
    def density(self, r: Array, a: float) -> Array:
        """Return the bounded density whose potential inside is the flat approach minus the height.

        Parameters
        ----------
        r : Array
            Radii < a, (n,) [m].
        a : float
            Contact radius [m].

        Returns
        -------
        Array
            Dimensionless densities, (n,).
        """

    @abstractmethod
    def potential(self, r: Array, a: float) -> Array:
        """Return the integral of density/|x - y| over the disc.

        Parameters
        ----------
        r : Array
            Radii >= 0, (n,) [m].
        a : float
            Contact radius [m].

        Returns
        -------
        Array
            Potentials, (n,) [m].
        """

    @abstractmethod
    def total(self, a: float) -> float:
        """Return the integral of the density over the disc.

        Parameters
        ----------
        a : float
            Contact radius [m].

        Returns
        -------
        float
            The integral [m^2].
        """


@dataclass(frozen=True)
class FlatPunch(Shape):
    """A flat-ended cylinder.

    Attributes
    ----------
    radius : float
        Radius [m].
    """

    radius: float

    def contact_radius(self, approach: float) -> float:
        """Return the radius of the punch."""
        return self.radius

    def flat_approach(self, a: float) -> float:
        """Return zero, because all of the approach acts at the flat end."""
        return 0.0

    def density(self, r: Array, a: float) -> Array:
        """Return zeros."""
        return np.zeros_like(r)

    def potential(self, r: Array, a: float) -> Array:
        """Return zeros."""
        return np.zeros_like(r)

    def total(self, a: float) -> float:
        """Return zero."""
        return 0.0


@dataclass(frozen=True)
class Sphere(Shape):
    """A paraboloid r^2/(2 R), the sphere of small contacts.

    Attributes
    ----------
    radius : float
        Radius R [m].
    """

    radius: float

    def contact_radius(self, approach: float) -> float:
        """Return sqrt(R g)."""
        return float(np.sqrt(self.radius * approach))

    def flat_approach(self, a: float) -> float:
        """Return a^2/R."""
        return a**2 / self.radius

    def density(self, r: Array, a: float) -> Array:
        """Return 2 sqrt(a^2 - r^2)/(pi^2 R)."""
        return 2.0 * np.sqrt(a**2 - r**2) / (np.pi**2 * self.radius)

    def potential(self, r: Array, a: float) -> Array:
        """Return (2 a^2 - r^2)/(2 R) inside, and its continuation outside."""
        angle = _contact_angle(r, a)
        outside = np.sqrt(np.maximum(r**2 - a**2, 0.0))
        return ((2.0 * a**2 - r**2) * angle + a * outside) / (np.pi * self.radius)

    def total(self, a: float) -> float:
        """Return 4 a^3/(3 pi R)."""
        return 4.0 * a**3 / (3.0 * np.pi * self.radius)


@dataclass(frozen=True)
class Cone(Shape):
    """A cone of height r tan(angle).

    Attributes
    ----------
    angle : float
        Angle between its side and the surface [rad].
    """

    angle: float

    def contact_radius(self, approach: float) -> float:
        """Return 2 g/(pi tan(angle))."""
        return 2.0 * approach / (np.pi * float(np.tan(self.angle)))

    def flat_approach(self, a: float) -> float:
        """Return pi a tan(angle)/2."""
        return np.pi * a * float(np.tan(self.angle)) / 2.0

    def density(self, r: Array, a: float) -> Array:
        """Return tan(angle) arcosh(a/r)/(2 pi), infinite at the tip."""
        with np.errstate(divide="ignore"):
            spike: Array = float(np.tan(self.angle)) * np.arccosh(a / r) / (2.0 * np.pi)
        return spike

    def potential(self, r: Array, a: float) -> Array:
        """Return tan(angle) (pi a/2 - r) inside, and its continuation outside."""
        outside = np.sqrt(np.maximum(r**2 - a**2, 0.0))
        return float(np.tan(self.angle)) * (a * _contact_angle(r, a) + outside - r)

    def total(self, a: float) -> float:
        """Return a^2 tan(angle)/2."""
        return a**2 * float(np.tan(self.angle)) / 2.0


@dataclass(frozen=True, eq=False)
class Indentation:
    """A solved indentation; radii r (n,) [m] are distances from the axis on the surface.

    Attributes
    ----------
    xi : Array
        Point-source response, (3, 3).
    shape : Shape
        Shape of the indenter.
    contact_radius : float
        Contact radius [m].
    shift : float
        Contribution of the potentials to the approach that determines the contact radius [m].
    edge, bounded : Array
        Amplitudes (3,) of the singular and the bounded density in the outward extended tractions (t3, q, s).

    Notes
    -----
    A negative shift under a sphere or cone makes the surface rise like a square root just outside the contact, through
    the indenter: the published form, used here, is then only an approximation, and conditions that switch from
    insulating to perfectly conducting at the contact edge have no exact solution. Thermoelastic contact has the same
    property for one direction of heat flow: Barber, J. Elasticity 8 (1978) 409.
    """

    xi: Array
    shape: Shape
    contact_radius: float
    shift: float
    edge: Array
    bounded: Array

    @property
    def force(self) -> float:
        """Force P with which the indenter presses [N], positive in compression (eqs. 33-36)."""
        return -self._total(_NORMAL)

    @property
    def charge(self) -> float:
        """Integral Q of the electric flux q = D.nu [C]."""
        return self._total(_ELECTRIC)

    @property
    def magnetic_flux(self) -> float:
        """Integral M of the magnetic flux s = B.nu [Wb]."""
        return self._total(_MAGNETIC)

    def pressure(self, r: Array) -> Array:
        """Return the contact pressure p = -t3.

        Parameters
        ----------
        r : Array
            Radii, (n,) [m].

        Returns
        -------
        Array
            Pressures, (n,) >= 0 [Pa], zero outside the contact.
        """
        return -self._density(r)[:, _NORMAL]

    def electric_flux(self, r: Array) -> Array:
        """Return the outward electric flux q = D.nu.

        Parameters
        ----------
        r : Array
            Radii, (n,) [m].

        Returns
        -------
        Array
            Fluxes, (n,) [C/m^2], zero outside the contact.
        """
        return self._density(r)[:, _ELECTRIC]

    def magnetic_flux_density(self, r: Array) -> Array:
        """Return the outward magnetic flux density s = B.nu.

        Parameters
        ----------
        r : Array
            Radii, (n,) [m].

        Returns
        -------
        Array
            Flux densities, (n,) [Wb/m^2], zero outside the contact.
        """
        return self._density(r)[:, _MAGNETIC]

    def displacement(self, r: Array) -> Array:
        """Return the normal displacement u3 of the surface.

        Parameters
        ----------
        r : Array
            Radii, (n,) [m].

        Returns
        -------
        Array
            Displacements, (n,) [m], negative where the surface is pressed in.
        """
        return self._values(r)[:, _NORMAL]

    def electric_potential(self, r: Array) -> Array:
        """Return the electric potential phi of the surface.

        Parameters
        ----------
        r : Array
            Radii, (n,) [m].

        Returns
        -------
        Array
            Potentials, (n,) [V].
        """
        return self._values(r)[:, _ELECTRIC]

    def magnetic_potential(self, r: Array) -> Array:
        """Return the magnetic potential psi of the surface.

        Parameters
        ----------
        r : Array
            Radii, (n,) [m].

        Returns
        -------
        Array
            Potentials, (n,) [A].
        """
        return self._values(r)[:, _MAGNETIC]

    def _total(self, field: int) -> float:
        a = self.contact_radius
        return float(self.edge[field] * 2.0 * np.pi * a + self.bounded[field] * self.shape.total(a))

    def _density(self, r: Array) -> Array:
        radii, a = np.asarray(r, dtype=float), self.contact_radius
        densities = np.zeros((len(radii), 3))
        inside = radii < a
        radii_inside = radii[inside]
        singular = 1.0 / np.sqrt(a**2 - radii_inside**2)
        densities[inside] = np.outer(singular, self.edge)
        # a bounded density that is infinite at a cone's tip must not meet an amplitude of zero
        fields = np.flatnonzero(self.bounded)
        densities[np.ix_(inside, fields)] += np.outer(self.shape.density(radii_inside, a), self.bounded[fields])
        return densities

    def _values(self, r: Array) -> Array:
        radii, a = np.asarray(r, dtype=float), self.contact_radius
        edge = 2.0 * np.pi * _contact_angle(radii, a)
        densities = np.outer(edge, self.edge) + np.outer(self.shape.potential(radii, a), self.bounded)
        values: Array = densities @ self.xi.T
        return values


def indent(
    xi: Array,
    shape: Shape,
    approach: float,
    electric_potential: float | None = None,
    magnetic_potential: float | None = None,
) -> Indentation:
    """Return the indentation by a rigid shape.

    Parameters
    ----------
    xi : Array
        Point-source response (3, 3) in SI units.
    shape : Shape
        Shape of the indenter.
    approach : float
        Approach > 0 [m].
    electric_potential, magnetic_potential : float, optional
        Potentials of a conducting indenter [V], [A]; None if it insulates (EMII: None, None).

    Returns
    -------
    Indentation
        The indentation.

    Raises
    ------
    MeeframeError
        If the potentials push the indenter off.
    """
    prescribed = (electric_potential, magnetic_potential)
    conducting = [field for field, value in enumerate(prescribed, start=1) if value is not None]
    potentials = np.array([value for value in prescribed if value is not None])
    active = [_NORMAL, *conducting]
    inverse = _inverse(xi[np.ix_(active, active)])
    # a flat punch at approach g and these potentials: u3 = -g
    shift = -float(inverse[0, 1:] @ potentials) / inverse[0, 0]
    if approach + shift <= 0.0:
        raise MeeframeError(f"no contact: approach {approach:g} m, and the potentials lift the surface by {-shift:g} m")
    a = shape.contact_radius(approach + shift)
    edge, bounded = np.zeros(3), np.zeros(3)
    flat = np.concatenate(([-(approach - shape.flat_approach(a))], potentials))
    edge[active] = inverse @ flat / np.pi**2
    bounded[active] = -inverse[:, 0]
    if not isinstance(shape, FlatPunch):
        edge[_NORMAL] = 0.0  # zero by definition of the contact radius; remove the round-off
    return Indentation(xi, shape, a, shift, edge, bounded)


def _inverse(matrix: Array) -> Array:
    """Return the inverse of a block of xi, whose diagonal spans twenty decades."""
    scale = np.abs(np.diag(matrix)) ** -0.5
    inverse: Array = scale[:, None] * np.linalg.inv(scale[:, None] * matrix * scale) * scale
    return inverse


def _contact_angle(r: Array, a: float) -> Array:
    """Return asin(a/r) outside the contact, pi/2 inside."""
    angle: Array = np.arcsin(a / np.maximum(r, a))
    return angle
