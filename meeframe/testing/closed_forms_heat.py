"""Closed forms of frictionless indentation by a hot axisymmetric indenter in perfect thermal contact.

The half space is that of `meeframe.testing.closed_forms`. The indenter has the temperature theta above that of the
distant body; the surface beside the contact is insulated. With rho = r / a and c = 2 kappa theta / pi the heat flux
into the body is c / sqrt(a^2 - r^2), and its effect on u3, phi and psi in the contact is level - delta c a Phi(rho),
with Phi = integral from 0 to rho of (1 - sqrt(1 - s^2)) ds / s. The density J(rho) / pi^2 has the potential
a (ln 2 - Phi), J = integral from 0 to 1 of artanh(s) / s sqrt(1 - rho^2) / sqrt(1 - rho^2 + rho^2 s^2) ds.

References
----------
Derived from Barber, Int. J. Mech. Sci. 15 (1973) 813, and J. Elasticity 8 (1978) 409 (isotropic bodies); Dundurs,
Mech. Res. Commun. 1 (1974) 121 (distortivity).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.fields import Array
from meeframe.testing.closed_forms import Shape

_POINTS: Final = 200


@dataclass(frozen=True, eq=False)
class HotIndentation:
    """Indentation by a hot indenter with a known contact radius.

    Attributes
    ----------
    xi
        Point-source response (3, 3) of (u3, phi, psi).
    distortivity
        delta (3,): curl-free curvature of these fields per outward heat flux, minus the mean of y_h.
    conductivity
        kappa [W/(m K)] of the surface.
    shape
        Shape of the indenter.
    contact_radius
        Contact radius a [m].
    temperature
        Temperature theta of the indenter [K].
    potentials
        Electric and magnetic potential of the indenter [V], [A]; None if it insulates.
    reference_radius
        Distance [m] from a source of heat at which its effect vanishes.
    approach
        Approach [m] of a flat punch; None for shapes whose contact radius determines it.
    """

    xi: Array
    distortivity: Array
    conductivity: float
    shape: Shape
    contact_radius: float
    temperature: float
    potentials: tuple[float | None, float | None] = (None, None)
    reference_radius: float = 1.0
    approach: float | None = None

    @property
    def heat(self) -> float:
        """Heat [W] out of the body, negative from a hot indenter."""
        return -4.0 * self.contact_radius * self.conductivity * self.temperature

    @property
    def solved_approach(self) -> float:
        """Approach g [m]: that of the punch, or that without singular pressure at the contact edge."""
        if self.approach is not None:
            return self.approach
        stiffness, edge = self._stiffness, self._edge(0.0)
        return float(stiffness[0] @ edge / stiffness[0, 0])

    @property
    def totals(self) -> Array:
        """Integrals (3,) of the outward extended tractions t3, q and s; zero for fields that the indenter insulates."""
        a, c, stiffness = self.contact_radius, self._flux_scale, self._stiffness
        bounded = stiffness[:, 0] * self.shape.total(a)
        heat = c * a**2 / np.pi * stiffness @ self.distortivity[self._fields]
        totals = np.zeros(3)
        totals[self._fields] = 2.0 * a / np.pi * stiffness @ self._edge(self.solved_approach) - bounded - heat
        return totals

    @property
    def force(self) -> float:
        """Force P with which the indenter presses [N]."""
        return float(-self.totals[0])

    def tractions(self, r: Array) -> Array:
        """Return t3, q and s, (3, n), at distances (n,) r < a from the axis; zero for fields that are insulated."""
        a, stiffness = self.contact_radius, self._stiffness
        singular = stiffness @ self._edge(self.solved_approach)
        heat = stiffness @ self.distortivity[self._fields] * self._flux_scale
        tractions = np.zeros((3, len(r)))
        tractions[self._fields] = (
            np.outer(singular, 1.0 / np.sqrt(a**2 - r**2)) - np.outer(heat, heat_density(r / a))
        ) / np.pi**2 - np.outer(stiffness[:, 0], self.shape.density(r, a))
        return tractions

    def values(self, r: Array) -> Array:
        """Return u3, phi and psi of the surface, (3, n), at distances (n,) r <= a from the axis.

        Fields that the indenter does not insulate have its height and potentials.
        """
        a, stiffness = self.contact_radius, self._stiffness
        root = np.sqrt(1.0 - (r / a) ** 2)
        bulge = np.log((1.0 + root) / 2.0) + 1.0 - root  # Phi
        heat = self._flux_scale * a * self.distortivity
        densities = (
            (stiffness @ self._edge(self.solved_approach))[:, None]
            - np.outer(stiffness[:, 0], self.shape.potential(r, a))
            - np.outer(stiffness @ heat[self._fields], np.log(2.0) - bulge)
        )
        level = 1.0 - np.log(2.0) + np.log(self.reference_radius / a)
        return np.asarray(self.xi[:, self._fields] @ densities + np.outer(heat, level - bulge))

    def pressure(self, r: Array) -> Array:
        """Return the pressure [Pa] at distances (n,) r < a from the axis."""
        return np.asarray(-self.tractions(r)[0])

    @property
    def _fields(self) -> list[int]:
        return [0, *(field for field, value in enumerate(self.potentials, 1) if value is not None)]

    @property
    def _stiffness(self) -> Array:
        return np.asarray(np.linalg.inv(self.xi[np.ix_(self._fields, self._fields)]))

    @property
    def _flux_scale(self) -> float:
        return 2.0 * self.conductivity * self.temperature / np.pi

    def _edge(self, approach: float) -> Array:
        """Return B, (fields,): displacement and potentials that remain for the singular density."""
        a, c = self.contact_radius, self._flux_scale
        level = 1.0 - 2.0 * np.log(2.0) + np.log(self.reference_radius / a)
        prescribed = [
            self.shape.flat_approach(a) - approach,
            *(value for value in self.potentials if value is not None),
        ]
        return np.asarray(np.array(prescribed) - self.distortivity[self._fields] * c * a * level)


def heat_density(rho: Array) -> Array:
    """Return J(rho), (n,), for rho < 1."""
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    u = (nodes + 1.0) / 2.0
    s, step = 1.0 - u**4, 2.0 * u**3 * weights  # the logarithm at s = 1 needs points that crowd there
    t = np.sqrt(1.0 - rho[:, None] ** 2)
    kernel = t / np.sqrt(t**2 + (rho[:, None] * s) ** 2)
    # artanh(s) of s = 1 - u^4 without cancellation
    artanh = 0.5 * np.log((2.0 - u**4) / u**4)
    return np.asarray(kernel @ (step * artanh / s))


def hot_punch_force(
    modulus: float, distortivity: float, conductivity: float, radius: float, temperature: float
) -> float:
    """Return the force [N] above which a hot flat punch touches over its whole face, for an isotropic body.

    modulus: E / (1 - nu^2) [Pa]; the product of distortivity and conductivity is alpha (1 + nu).
    """
    return 2.0 / np.pi * modulus * distortivity * conductivity * temperature * radius**2
