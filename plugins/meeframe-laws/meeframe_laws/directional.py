"""Friction laws that depend on the direction of slip, beyond associated elliptic friction."""

import math
from dataclasses import dataclass
from typing import Annotated, Final, final

import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import (
    MAX_FRICTION_RATIO,
    Array,
    ContactLaw,
    OrthotropicCoulomb,
    Quantity,
    StepLengths,
    check_quantities,
)
from meeframe_laws.limits import MAX_STEPS, ROUND_OFF, contact_pressure, in_contact

_MAX_CURVED_EXPONENT: Final = 1e6
"""Largest exponent whose curvature is computed: the corners of limits closer to a box are as small as round-off."""


@final
@dataclass(frozen=True)
class NonAssociatedCoulomb(ContactLaw):
    """Elliptic friction limit, ||t||_mu = |p_nu| in slip, with slip normal to another ellipse: g = lambda K^-2 t.

    Attributes
    ----------
    mu1, mu2 : float
        Half axes of the friction limit over |p_nu|, > 0 and finite.
    slip_ratio : float
        Second over first half axis of the ellipse t . K^-2 t = constant that slip is normal to, from 1/1000 to 1000.
        With 1, traction and slip are parallel for any mu1 and mu2.
    angle : float
        Angle of the first axis of the limit from e1 towards e2 [rad].
    slip_angle : float
        Angle of the first axis of the other ellipse [rad].

    Raises
    ------
    CaseError
        If one of them is out of bounds, or as for `OrthotropicCoulomb`.

    Notes
    -----
    With slip_ratio = mu2/mu1 and equal angles this is orthotropic Coulomb friction. Slip always dissipates, but not the
    most that the limit allows. The step is that of the metric of the limit, S = M^2/max(mu)^2, so that t + r S g =
    trial becomes, with y = M^-1 t, (1 + c M K^-2 M) y = M^-1 trial with |y| = |p_nu|: a secular equation for c >= 0.

    References
    ----------
    Michalowski and Mroz, Arch. Mech. 30 (1978) 259. Hjiaj, Feng, de Saxce and Mroz, Int. J. Numer. Methods Eng. 60
    (2004) 2045.
    """

    mu1: Annotated[float, Quantity("", gt=0, lt=math.inf)]
    mu2: Annotated[float, Quantity("", gt=0, lt=math.inf)]
    slip_ratio: Annotated[float, Quantity("", ge=1.0 / MAX_FRICTION_RATIO, le=MAX_FRICTION_RATIO)] = 1.0
    angle: Annotated[float, Quantity("rad", gt=-math.inf, lt=math.inf)] = 0.0
    slip_angle: Annotated[float, Quantity("rad", gt=-math.inf, lt=math.inf)] = 0.0

    def __post_init__(self) -> None:
        check_quantities(self)
        self._associated()

    def project(self, trial: Array) -> Array:
        """Return the radial return to the ellipse with half axes mu1 |p_nu| and mu2 |p_nu|, (n, 3) [Pa]."""
        return self._associated().project(trial)

    def tangential_scaling(self) -> Array:
        """Return M^2 / max(mu)^2 in the axes of the limit, (2, 2)."""
        return self._associated().tangential_scaling()

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the traction with t + r_tau S g(t) = trial, (n, 3) [Pa], for any r."""
        growth, unit = self._modes()
        pressure = contact_pressure(trial)
        traction = np.column_stack([trial[:, :2], -pressure])
        traction[pressure == 0.0, :2] = 0.0
        point = np.linalg.solve(unit, traction[:, :2].T).T
        slips = np.linalg.norm(point, axis=1) > pressure
        traction[slips, :2] = solve_secular_equation(point[slips], growth, pressure[slips]) @ unit.T
        return traction

    def tangents(self, trial: Array, gap: Array, r: StepLengths) -> tuple[Array, Array]:
        """Return the derivatives by the trial, (n, 3, 3), by the secular equation, and zero for those by the gap."""
        traction, slips = self.resolve(trial, gap, r), in_contact(trial)
        growth, unit = self._modes()
        inverse = np.linalg.inv(unit)
        slips[slips] = np.linalg.norm(trial[slips, :2] @ inverse.T, axis=1) > -trial[slips, 2]
        point, y = (array[slips, :2] @ inverse.T for array in (trial, traction))
        grown = growth * y
        c = np.maximum((y * (point - y)).sum(axis=1) / (y * grown).sum(axis=1), 0.0)
        shrink = 1.0 / (1.0 + c[:, None] * growth)
        change = shrink[:, :, None] * np.eye(2)
        change -= (
            (shrink * grown)[:, :, None] * (shrink * y)[:, None, :] / (y * shrink * grown).sum(axis=1)[:, None, None]
        )
        by_trial = _homogeneous_tangent(trial, traction, slips, unit @ change @ inverse)
        return by_trial, np.zeros_like(by_trial)

    def _modes(self) -> tuple[Array, Array]:
        """Return the factors of c, (2,), and the tractions of unit y in the basis of the secular equation, (2, 2)."""
        limit = _half_axes(self.mu1, self.mu2, self.angle)
        # from the root of M K^-2 M, which may be too ill-conditioned for eigenvalues
        _, size, right_vectors = np.linalg.svd(_half_axes(1.0, 1.0 / self.slip_ratio, self.slip_angle) @ limit)
        return (size / size[0]) ** 2, limit @ right_vectors.T

    def _associated(self) -> OrthotropicCoulomb:
        return OrthotropicCoulomb(self.mu1, self.mu2, self.angle)


@final
@dataclass(frozen=True)
class SuperellipticCoulomb(ContactLaw):
    """Superelliptic friction limit (|t1|/mu1)^n + (|t2|/mu2)^n <= |p_nu|^n with slip normal to the limit.

    Attributes
    ----------
    mu1, mu2 : float
        Half axes over |p_nu|, > 0 and finite.
    exponent : float
        n >= 1, finite: 1 is a rhombus, 2 the ellipse of orthotropic friction; large exponents approach a box, in which
        the two directions are independent.
    angle : float
        Angle of the first axis from e1 towards e2 [rad].

    Raises
    ------
    CaseError
        If one of them is out of bounds, or as for `OrthotropicCoulomb`.

    Notes
    -----
    This direction of slip has maximum dissipation.

    References
    ----------
    Limit curves of anisotropic friction: Mroz and Stupkiewicz, Int. J. Solids Struct. 31 (1994) 1113. Their shape is
    the curve of Lame.
    """

    mu1: Annotated[float, Quantity("", gt=0, lt=math.inf)]
    mu2: Annotated[float, Quantity("", gt=0, lt=math.inf)]
    exponent: Annotated[float, Quantity("", ge=1, lt=math.inf)]
    angle: Annotated[float, Quantity("rad", gt=-math.inf, lt=math.inf)] = 0.0

    def __post_init__(self) -> None:
        check_quantities(self)
        self.tangential_scaling()

    def project(self, trial: Array) -> Array:
        """Return the nearest point of the limit in y = M^-1 t, (n, 3) [Pa]: the projection in the metric of S."""
        half_axes, axes = np.array([self.mu1, self.mu2]), _axes(self.angle)
        pressure = contact_pressure(trial)
        point = (trial[:, :2] @ axes.T) / half_axes
        point[pressure == 0.0] = 0.0
        slips = lame_norm(point, self.exponent) > pressure
        point[slips] = nearest_on_lame_curve(point[slips] / pressure[slips, None], self.exponent)
        point[slips] *= pressure[slips, None]
        return np.column_stack([(point * half_axes) @ axes, -pressure])

    def tangential_scaling(self) -> Array:
        """Return M^2 / max(mu)^2 in the axes of the limit, (2, 2)."""
        return OrthotropicCoulomb(self.mu1, self.mu2, self.angle).tangential_scaling()

    def tangent(self, trial: Array) -> Array:
        """Return the derivative of the nearest point, (n, 3, 3), by the curvature of the limit there."""
        if self.exponent > _MAX_CURVED_EXPONENT:
            return super().tangent(trial)
        traction, slips = self.project(trial), in_contact(trial)
        axes, n = _axes(self.angle) / np.array([[self.mu1], [self.mu2]]), self.exponent
        slips[slips] = lame_norm(trial[slips, :2] @ axes.T, n) > -trial[slips, 2]
        point, y = (array[slips, :2] @ axes.T / -trial[slips, 2:] for array in (trial, traction))
        distortion = max(self.mu1, self.mu2) / min(self.mu1, self.mu2)
        y[np.abs(y) <= ROUND_OFF * distortion] = 0.0  # at the corners of a rhombus
        magnitude = np.abs(y) / np.abs(y).max(axis=1, keepdims=True)
        normal, ratio = np.copysign(magnitude ** (n - 1.0), y), magnitude.min(axis=1)
        size, distance = np.linalg.norm(normal, axis=1), np.linalg.norm(point - y, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):  # corners, and curves without curvature
            curvature = (n - 1.0) * ratio ** (n - 2.0) * (1.0 + ratio**n) ** (1.0 + 1.0 / n) / size**3
            share = 1.0 / (1.0 + distance * curvature)
        share = np.where(np.isfinite(curvature), share, 0.0)
        along = normal[:, ::-1] * [-1.0, 1.0] / size[:, None]
        change = share[:, None, None] * along[:, :, None] * along[:, None, :]
        return _homogeneous_tangent(trial, traction, slips, np.linalg.inv(axes) @ change @ axes)


def solve_secular_equation(point: Array, growth: Array, radius: Array) -> Array:
    """Return y with (1 + c growth) y = point, |y| = radius and c >= 0.

    Parameters
    ----------
    point : Array
        Points outside the circle, (m, 2).
    growth : Array
        Factors of the components, (2,) > 0.
    radius : Array
        Radii, (m,) > 0.

    Returns
    -------
    Array
        y, (m, 2).

    Notes
    -----
    1/|y| is a concave function of c, so that Newton's method for 1/|y| = 1/radius increases to the root from c = 0
    (More and Sorensen, SIAM J. Sci. Stat. Comput. 4 (1983) 553).
    """
    point, rate = point / radius[:, None], growth / growth.max()
    c = np.zeros(len(point))
    for _ in range(MAX_STEPS):
        y = point / (1.0 + c[:, None] * rate)
        size = np.linalg.norm(y, axis=1)
        step = size**2 * (size - 1.0) / (y**2 * rate / (1.0 + c[:, None] * rate)).sum(axis=1)
        c = c + np.maximum(step, 0.0)
        if (step <= ROUND_OFF * (1.0 + c)).all():
            break
    y = point / (1.0 + c[:, None] * rate)
    on_circle: Array = y * (radius / np.linalg.norm(y, axis=1))[:, None]
    return on_circle


def lame_norm(point: Array, n: float) -> Array:
    """Return (|x|^n + |y|^n)^(1/n), (m,), at points (m, 2) for n >= 1."""
    small, large = np.sort(np.abs(point), axis=1).T
    share = np.divide(small, large, out=np.zeros_like(large), where=large > 0.0)
    norm: Array = large * (1.0 + share**n) ** (1.0 / n)
    return norm


def nearest_on_lame_curve(point: Array, n: float) -> Array:
    """Return the nearest points (m, 2) on |x|^n + |y|^n = 1, n >= 1, to points (m, 2) outside the curve.

    Notes
    -----
    By symmetry a >= b >= 0 for the point and x >= y = u x for the nearest one, with x = (1 + u^n)^(-1/n). Their
    difference is normal to the curve if h(u) = (a - x) u^(n - 1) - (b - u x) = 0. h(0) <= 0 <= h(1), except for a
    rhombus whose corner is nearest, and there is one root in [0, 1]. It is computed by Newton's method, with bisection
    for steps that leave the interval or are not halved.
    """
    is_swapped = np.abs(point[:, 1]) > np.abs(point[:, 0])
    b, a = np.sort(np.abs(point), axis=1).T
    low, high, u, step = np.zeros_like(a), np.ones_like(a), np.divide(b, a), np.ones_like(a)
    for _ in range(MAX_STEPS):
        with np.errstate(divide="ignore", invalid="ignore"):
            power = u ** (n - 1.0)
            x = (1.0 + u * power) ** (-1.0 / n)
            h = (a - x) * power - (b - u * x)
            slope = x * power / (1.0 + u * power)  # -dx/du
            newton = h / (slope * (power - u) + (a - x) * (n - 1.0) * power / u + x)
        low, high = np.where(h < 0.0, u, low), np.where(h > 0.0, u, high)
        accepted = (u - newton >= low) & (u - newton <= high) & (np.abs(newton) <= 0.5 * np.abs(step) + ROUND_OFF)
        step = np.where(accepted, newton, u - 0.5 * (low + high))
        u = u - step
        if (np.abs(step) <= ROUND_OFF).all():
            break
    x = (1.0 + u**n) ** (-1.0 / n)
    nearest = np.column_stack([x, u * x])
    nearest[is_swapped] = nearest[is_swapped][:, ::-1]
    signed: Array = np.copysign(nearest, point)
    return signed


def _homogeneous_tangent(trial: Array, traction: Array, slips: NDArray[np.bool_], by_tangential: Array) -> Array:
    """Return the derivative (n, 3, 3) of tractions (n, 3) in proportion to the size of the trial (n, 3).

    slips: (n,), where nodes in contact slip; the others stick. by_tangential: (m, 2, 2), derivative of the tangential
    traction of these by the tangential trial. The derivative by the normal trial follows by Euler's theorem.
    """
    tangent = np.zeros((3, 3, len(trial))).transpose(2, 0, 1)
    for i in range(3):
        tangent[:, i, i] = in_contact(trial)
    tangent[slips, :2, :2] = by_tangential
    remainder = traction[slips, :2] - np.einsum("nij,nj->ni", by_tangential, trial[slips, :2])
    tangent[slips, :2, 2] = remainder / trial[slips, 2:]
    return tangent


def _axes(angle: float) -> Array:
    """Return unit vectors at an angle [rad] and at a right angle to it, (2, 2), one in each row."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def _half_axes(first: float, second: float, angle: float) -> Array:
    """Return the symmetric matrix (2, 2) that maps the unit circle to an ellipse with these half axes."""
    axes = _axes(angle)
    ellipse: Array = axes.T @ np.diag([first, second]) @ axes
    return ellipse
