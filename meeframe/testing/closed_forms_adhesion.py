"""Closed forms of adhesive contact and a quarter of a half space, references for contact laws with adhesion.

A rigid paraboloid of radius R, height r^2 / (2 R), without friction on an elastic half space of plane-strain modulus E*
= E / (1 - nu^2). Forces are positive in compression.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from meeframe.common.errors import MeeframeError
from meeframe.fields import Array
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import NodalFields
from meeframe.testing.half_space import inverse_distance_integral


@dataclass(frozen=True)
class Maugis:
    """Theory of Maugis and Dugdale: constant attraction across gaps up to work / stress.

    Attributes
    ----------
    radius : float
        Radius of the paraboloid [m].
    modulus : float
        Plane-strain modulus E* [Pa].
    work : float
        Work of adhesion [J/m^2].
    stress : float
        Attraction [Pa].

    References
    ----------
    Maugis, J. Colloid Interface Sci. 150 (1992) 243, eqs. (6.15)-(6.17), with K = 4 E* / 3.
    """

    radius: float
    modulus: float
    work: float
    stress: float

    @property
    def contact_unit(self) -> float:
        """Unit of contact radii, (pi w R^2 / K)^(1/3) [m]."""
        return float((np.pi * self.work * self.radius**2 / self._stiffness) ** (1.0 / 3.0))

    @property
    def approach_unit(self) -> float:
        """Unit of approaches, (pi^2 w^2 R / K^2)^(1/3) [m]."""
        return self.contact_unit**2 / self.radius

    @property
    def force_unit(self) -> float:
        """Unit of forces, pi w R [N]; the pull-off force is 2 units for rigid (DMT) and 1.5 for soft bodies (JKR)."""
        return float(np.pi * self.work * self.radius)

    @property
    def transition(self) -> float:
        """Transition parameter lambda = 2 sigma_0 (R / (pi w K^2))^(1/3): DMT below 0.1, JKR above 5."""
        return float(2.0 * self.stress * (self.radius / (np.pi * self.work * self._stiffness**2)) ** (1.0 / 3.0))

    def at(self, contact_radius: float) -> tuple[float, float, float]:
        """Return the state at a contact radius.

        Parameters
        ----------
        contact_radius : float
            Contact radius > 0 [m].

        Returns
        -------
        float
            Outer radius of the attraction [m].
        float
            Force [N].
        float
            Approach [m].
        """
        lam, a = self.transition, contact_radius / self.contact_unit

        def opening(m: float) -> float:
            root = np.sqrt(m * m - 1.0)
            angle = np.arctan(root)
            elastic = 0.5 * lam * a**2 * (root + (m * m - 2.0) * angle)
            return float(elastic + 4.0 / 3.0 * lam**2 * a * (root * angle - m + 1.0) - 1.0)

        upper = 2.0
        while opening(upper) < 0.0:
            upper *= 2.0
        m = brentq(opening, 1.0, upper, xtol=1e-14, rtol=1e-14)
        root = np.sqrt(m * m - 1.0)
        force = a**3 - lam * a**2 * (root + m * m * np.arctan(root))
        approach = a**2 - 4.0 / 3.0 * a * lam * root
        return m * contact_radius, float(force * self.force_unit), float(approach * self.approach_unit)

    @property
    def _stiffness(self) -> float:
        return 4.0 / 3.0 * self.modulus


def bradley_force(work: float, radius: float, distance: float, range_: float) -> float:
    """Return the force [N] between a rigid paraboloid and a plane at a distance >= 0 [m].

    Parameters
    ----------
    work : float
        Work of adhesion w [J/m^2].
    radius : float
        Radius of the paraboloid [m].
    distance : float
        Distance [m].
    range_ : float
        Range z_0 [m] of the attraction sigma = 2 w / z_0 (1 + g / z_0)^-3.

    References
    ----------
    Derjaguin's approximation: 2 pi R times the work from the distance to infinity.
    """
    return float(-2.0 * np.pi * radius * work / (1.0 + distance / range_) ** 2)


def hertz_gap(r: Array, contact_radius: float, radius: float) -> Array:
    """Return the gap outside a Hertzian contact.

    Parameters
    ----------
    r : Array
        Radii >= contact_radius, (n,) [m].
    contact_radius : float
        Contact radius [m].
    radius : float
        Radius of the sphere [m].

    Returns
    -------
    Array
        Gaps, (n,) [m].

    References
    ----------
    Johnson (1985), section 4.2.
    """
    m = np.maximum(np.asarray(r, float) / contact_radius, 1.0)
    root = np.sqrt(m * m - 1.0)
    return np.asarray(contact_radius**2 / (np.pi * radius) * (root + (m * m - 2.0) * np.arctan(root)))


def weak_attraction(
    sigma: Callable[[Array], Array], contact_radius: float, radius: float, outer_radius: float
) -> float:
    """Return the pull [N] of an attraction that is too weak to change the Hertzian gap, at fixed approach.

    Parameters
    ----------
    sigma : callable
        Attraction [Pa] as a function of the gap [m].
    contact_radius : float
        Contact radius [m].
    radius : float
        Radius of the paraboloid [m].
    outer_radius : float
        Radius up to which the attraction is integrated [m].

    Notes
    -----
    Attracted at r, the surface presses on the indenter with 2/pi arcsin(a/r) of the attraction (reciprocity with the
    flat punch), so that 1 - 2/pi arcsin(a/r) of it remains.
    """

    def density(t: float) -> float:
        r = np.hypot(contact_radius, t)  # r dr = t dt: smooth at the edge
        remainder = 1.0 - 2.0 / np.pi * np.arcsin(contact_radius / r)
        return float(2.0 * np.pi * t * remainder * sigma(hertz_gap(np.array([r]), contact_radius, radius))[0])

    upper = np.sqrt(outer_radius**2 - contact_radius**2)
    return float(quad(density, 0.0, upper, limit=500, epsrel=1e-8)[0])


def quarter_half_space(modulus: float, half_side: float, cells: int) -> DenseSystem:
    """Return the system of square cells on a quarter of a half space loaded symmetrically about both axes.

    Only the normal response is coupled between nodes. Weights are those of all four quarters.

    Parameters
    ----------
    modulus : float
        Modulus E* of the normal response [Pa].
    half_side : float
        Side of the quarter 0 < x, y < half_side [m].
    cells : int
        Number of cells along a side.

    Returns
    -------
    DenseSystem
        The system of cells^2 nodes.
    """
    side = half_side / cells
    centres = (np.arange(cells) + 0.5) * side
    x, y = (grid.ravel() for grid in np.meshgrid(centres, centres))
    n = len(x)
    images = [(i, j) for i in (1.0, -1.0) for j in (1.0, -1.0)]
    matrix = np.zeros((n, 5, n, 5))
    for i, j in images:
        matrix[:, 2, :, 2] += inverse_distance_integral(x[:, None] - i * x, y[:, None] - j * y, side / 2)
    matrix[:, 2, :, 2] /= np.pi * modulus
    diagonal = np.arange(n)
    for field in (0, 1, 3, 4):
        matrix[diagonal, field, diagonal, field] = matrix[0, 2, 0, 2]
    points = np.column_stack([x, y, np.zeros(n)])
    frames, weights = np.tile(np.eye(3), (n, 1, 1)), np.full(n, len(images) * side**2)
    return DenseSystem(points, frames, weights, (), np.zeros((n, 5)), matrix, _refuse)


def _refuse(_load: Array) -> NodalFields:
    raise MeeframeError("this half space is its contact zone only")
