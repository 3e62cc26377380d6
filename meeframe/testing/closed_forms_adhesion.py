"""Closed forms of adhesive contact, and a quarter of a half space: what tests and pictures compare the laws with.

A rigid paraboloid of radius R, height r^2 / (2 R), without friction on an elastic half space of plane-strain modulus
E* = E / (1 - nu^2). Forces are positive where they press.
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
    """The theory of Maugis & Dugdale: constant attraction `stress` [Pa] across gaps up to work / stress.

    radius [m], modulus E* [Pa], work of adhesion [J/m^2]. Source: Maugis, J. Colloid Interface Sci. 150 (1992) 243,
    eqs. (6.15)-(6.17), with K = 4 E* / 3.
    """

    radius: float
    modulus: float
    work: float
    stress: float

    @property
    def contact_unit(self) -> float:
        """(pi w R^2 / K)^(1/3) [m], unit of contact radii."""
        return float((np.pi * self.work * self.radius**2 / self._stiffness) ** (1.0 / 3.0))

    @property
    def approach_unit(self) -> float:
        """(pi^2 w^2 R / K^2)^(1/3) [m], unit of approaches."""
        return self.contact_unit**2 / self.radius

    @property
    def force_unit(self) -> float:
        """pi w R [N]: the pull-off force is 2 of it without elasticity (DMT) and 1.5 for soft bodies (JKR)."""
        return float(np.pi * self.work * self.radius)

    @property
    def transition(self) -> float:
        """Maugis' parameter lambda = 2 sigma_0 (R / (pi w K^2))^(1/3): DMT below 0.1, JKR above 5."""
        return float(2.0 * self.stress * (self.radius / (np.pi * self.work * self._stiffness**2)) ** (1.0 / 3.0))

    def at(self, contact_radius: float) -> tuple[float, float, float]:
        """Return (outer radius of the attraction [m], force [N], approach [m]) at a contact radius > 0 [m]."""
        lam, a = self.transition, contact_radius / self.contact_unit

        def opening(m: float) -> float:
            root = np.sqrt(m * m - 1.0)
            angle = np.arctan(root)
            elastic = 0.5 * lam * a**2 * (root + (m * m - 2.0) * angle)
            return float(elastic + 4.0 / 3.0 * lam**2 * a * (root * angle - m + 1.0) - 1.0)

        farthest = 2.0
        while opening(farthest) < 0.0:
            farthest *= 2.0
        m = brentq(opening, 1.0, farthest, xtol=1e-14, rtol=1e-14)
        root = np.sqrt(m * m - 1.0)
        force = a**3 - lam * a**2 * (root + m * m * np.arctan(root))
        approach = a**2 - 4.0 / 3.0 * a * lam * root
        return m * contact_radius, float(force * self.force_unit), float(approach * self.approach_unit)

    @property
    def _stiffness(self) -> float:
        return 4.0 / 3.0 * self.modulus


def bradley_force(work: float, radius: float, distance: float, range_: float) -> float:
    """Return the force [N] between rigid paraboloid and plane at a distance >= 0 [m], for sigma = 2 w / z_0 (1 + g /
    z_0)^-3.

    range_: z_0 [m]. Source: Derjaguin's approximation, 2 pi R times the work from the distance to infinity.
    """
    return float(-2.0 * np.pi * radius * work / (1.0 + distance / range_) ** 2)


def hertz_gap(r: Array, contact_radius: float, radius: float) -> Array:
    """Return the gap (n,) [m] outside of a Hertzian contact at r >= contact_radius [m] (Johnson (1985), section
    4.2)."""
    m = np.maximum(np.asarray(r, float) / contact_radius, 1.0)
    root = np.sqrt(m * m - 1.0)
    return np.asarray(contact_radius**2 / (np.pi * radius) * (root + (m * m - 2.0) * np.arctan(root)))


def weak_attraction(sigma: Callable[[Array], Array], contact_radius: float, radius: float, reach: float) -> float:
    """Pull [N] of an attraction sigma(gap) that is too weak to change the Hertzian gap, at fixed approach.

    Attracted at r, the surface presses on the indenter with 2/pi arcsin(a/r) of the attraction (reciprocity with the
    flat punch), so that 1 - 2/pi arcsin(a/r) of it is left. reach: radius up to which it counts [m].
    """

    def density(t: float) -> float:
        r = np.hypot(contact_radius, t)  # r dr = t dt: smooth at the edge
        left = 1.0 - 2.0 / np.pi * np.arcsin(contact_radius / r)
        return float(2.0 * np.pi * t * left * sigma(hertz_gap(np.array([r]), contact_radius, radius))[0])

    farthest = np.sqrt(reach**2 - contact_radius**2)
    return float(quad(density, 0.0, farthest, limit=500, epsrel=1e-8)[0])


def quarter_half_space(modulus: float, half_side: float, cells: int) -> DenseSystem:
    """Return cells x cells square cells on 0 < x, y < half_side [m] of a half space loaded symmetrically about both
    axes.

    Normal response of modulus E* [Pa]; other fields answer to nothing but themselves. Weights are those of all four
    quarters.
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
    own = np.arange(n)
    for field in (0, 1, 3, 4):
        matrix[own, field, own, field] = matrix[0, 2, 0, 2]
    points = np.column_stack([x, y, np.zeros(n)])
    frames, weights = np.tile(np.eye(3), (n, 1, 1)), np.full(n, len(images) * side**2)
    return DenseSystem(points, frames, weights, (), np.zeros((n, 5)), matrix, _refuse)


def _refuse(_load: Array) -> NodalFields:
    raise MeeframeError("this half space is its contact zone only")
