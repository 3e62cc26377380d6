"""Closed forms for a rigid indenter with friction on an isotropic elastic half space.

The half space lies at x3 < 0. Indentation is described by positive numbers (approach, force, pressure); tangential
forces and tractions are those of the indenter on the body. E* = E/(1 - nu^2) and G = E/(2 (1 + nu)), as the indenter is
rigid.

References
----------
Johnson, Contact Mechanics (1985), chapters 3 to 7; Spence, Proc. R. Soc. A 305 (1968) 55 and Mossakovskii, J. Appl.
Math. Mech. 27 (1963) 418 for full stick; Lubkin, J. Appl. Mech. 18 (1951) 183 for torsion.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipe, ellipkm1, hyp2f1

from meeframe.common.errors import MeeframeError
from meeframe.fields import Array

_UPPER_LIMIT: Final = 40.0
"""Argument at which 1/cosh is negligible."""


def shear_modulus(young: float, poisson: float) -> float:
    """Return the shear modulus G.

    Parameters
    ----------
    young : float
        Young's modulus [Pa].
    poisson : float
        Poisson's ratio.

    Returns
    -------
    float
        Shear modulus [Pa].
    """
    return young / (2.0 * (1.0 + poisson))


def contact_modulus(young: float, poisson: float) -> float:
    """Return the plane-strain modulus E* of a body in contact with a rigid indenter.

    Parameters
    ----------
    young : float
        Young's modulus [Pa].
    poisson : float
        Poisson's ratio.

    Returns
    -------
    float
        Modulus [Pa].
    """
    return young / (1.0 - poisson**2)


def bonding_factor(poisson: float) -> float:
    """Return the ratio c = (1 - nu) ln(3 - 4 nu)/(1 - 2 nu) of the loads of a bonded and a frictionless flat punch.

    Parameters
    ----------
    poisson : float
        Poisson's ratio in (-1, 1/2]; c = 1 at 1/2.

    Returns
    -------
    float
        The ratio, >= 1.

    Notes
    -----
    Evaluated as x coth(x), tanh(x) = (1 - 2 nu)/(2 (1 - nu)), which has no singular quotient.
    """
    x = _half_logarithm(poisson)
    return float(x / np.tanh(x)) if x > 0.0 else 1.0


def _half_logarithm(poisson: float) -> float:
    """Return ln(3 - 4 nu)/2, which is pi theta in Spence's notation."""
    return 0.5 * float(np.log1p(2.0 - 4.0 * poisson))


@final
@dataclass(frozen=True)
class HertzContact:
    """Hertzian contact of a sphere (paraboloid) without friction or coupling.

    Attributes
    ----------
    young : float
        Young's modulus [Pa].
    poisson : float
        Poisson's ratio.
    radius : float
        Radius of the sphere [m].
    approach : float
        Approach > 0 [m].
    """

    young: float
    poisson: float
    radius: float
    approach: float

    @property
    def contact_radius(self) -> float:
        """Contact radius a = sqrt(R g) [m]."""
        return float(np.sqrt(self.radius * self.approach))

    @property
    def force(self) -> float:
        """Normal force P = 4 E* a^3/(3 R) [N]."""
        return 4.0 * contact_modulus(self.young, self.poisson) * self.contact_radius**3 / (3.0 * self.radius)

    @property
    def peak_pressure(self) -> float:
        """Largest pressure p_0 = 3 P/(2 pi a^2) [Pa]."""
        return 3.0 * self.force / (2.0 * np.pi * self.contact_radius**2)

    def pressure(self, r: Array) -> Array:
        """Return the pressure p_0 sqrt(1 - r^2/a^2).

        Parameters
        ----------
        r : Array
            Radii, (n,) [m].

        Returns
        -------
        Array
            Pressures, (n,) >= 0 [Pa], zero outside the contact.
        """
        return self.peak_pressure * _dome(r, self.contact_radius)


@final
@dataclass(frozen=True)
class PartialSlip:
    """Cattaneo-Mindlin contact: Hertz contact under constant force and a tangential displacement with one reversal.

    Exact if normal and tangential loads are uncoupled (nu = 1/2, or Goodman's approximation) and nu = 0; otherwise the
    small slip across the direction of the force is neglected. The modulus of forces is at most mu P, and displacements
    of the indenter are at most the limit; larger ones raise MeeframeError.

    Attributes
    ----------
    hertz : HertzContact
        The normal contact.
    friction : float
        Coefficient of friction mu > 0.

    References
    ----------
    Johnson (1985), sections 7.2 and 7.4; Mindlin and Deresiewicz, J. Appl. Mech. 20 (1953) 327.
    """

    hertz: HertzContact
    friction: float

    @property
    def limit_force(self) -> float:
        """Largest tangential force mu P [N]."""
        return self.friction * self.hertz.force

    @property
    def limit_displacement(self) -> float:
        """Displacement 3 mu P (2 - nu)/(16 G a) [m] at which full slip begins."""
        shear = shear_modulus(self.hertz.young, self.hertz.poisson)
        return 3.0 * self.limit_force * (2.0 - self.hertz.poisson) / (16.0 * shear * self.hertz.contact_radius)

    def displacement(self, force: float) -> float:
        """Return the displacement of the indenter on first loading.

        Parameters
        ----------
        force : float
            Tangential force >= 0 [N].

        Returns
        -------
        float
            Displacement [m].

        Raises
        ------
        MeeframeError
            If the force exceeds the limit.

        References
        ----------
        Johnson (1985), eq. (7.42).
        """
        return self.limit_displacement * float(1.0 - (1.0 - self._share(force, self.limit_force)) ** (2 / 3))

    def force(self, displacement: float) -> float:
        """Return the tangential force on first loading.

        Parameters
        ----------
        displacement : float
            Displacement of the indenter >= 0 [m].

        Returns
        -------
        float
            Tangential force [N].

        Raises
        ------
        MeeframeError
            If the displacement exceeds the limit.
        """
        return self.limit_force * float(1.0 - (1.0 - self._share(displacement, self.limit_displacement)) ** 1.5)

    def stick_radius(self, force: float) -> float:
        """Return the stick radius c = a (1 - Q/(mu P))^(1/3) on first loading.

        Parameters
        ----------
        force : float
            Tangential force Q >= 0 [N].

        Returns
        -------
        float
            Stick radius [m].

        Raises
        ------
        MeeframeError
            If the force exceeds the limit.
        """
        return self.hertz.contact_radius * float((1.0 - self._share(force, self.limit_force)) ** (1 / 3))

    def traction(self, r: Array, force: float) -> Array:
        """Return the tangential traction on first loading.

        Parameters
        ----------
        r : Array
            Radii, (n,) [m].
        force : float
            Tangential force >= 0 [N].

        Returns
        -------
        Array
            Tractions along the force, (n,) [Pa].

        Raises
        ------
        MeeframeError
            If the force exceeds the limit.
        """
        a, c = self.hertz.contact_radius, self.stick_radius(force)
        return self.friction * self.hertz.peak_pressure * (_dome(r, a) - c / a * _dome(r, c))

    def force_after_reversal(self, displacement: float, amplitude: float) -> float:
        """Return the tangential force after a reversal.

        Parameters
        ----------
        displacement : float
            Displacement of the indenter [m], from -amplitude to amplitude.
        amplitude : float
            Displacement > 0 at the reversal [m].

        Returns
        -------
        float
            Tangential force [N].

        Raises
        ------
        MeeframeError
            If a displacement is out of bounds.
        """
        return self.force(amplitude) - 2.0 * self.force((amplitude - displacement) / 2.0)

    def traction_after_reversal(self, r: Array, displacement: float, amplitude: float) -> Array:
        """Return the tangential traction after a reversal.

        Parameters
        ----------
        r : Array
            Radii, (n,) [m].
        displacement : float
            Displacement of the indenter [m], from -amplitude to amplitude.
        amplitude : float
            Displacement > 0 at the reversal [m].

        Returns
        -------
        Array
            Tractions along the first force, (n,) [Pa].

        Raises
        ------
        MeeframeError
            If a displacement is out of bounds.
        """
        reversal = self.force((amplitude - displacement) / 2.0)
        return self.traction(r, self.force(amplitude)) - 2.0 * self.traction(r, reversal)

    def loop_dissipation(self, force: float) -> float:
        """Return the work of friction in a full loop between two opposite tangential forces.

        Parameters
        ----------
        force : float
            Modulus of the tangential forces [N].

        Returns
        -------
        float
            Work [J].

        Raises
        ------
        MeeframeError
            If the force exceeds the limit.

        References
        ----------
        Johnson (1985), eq. (7.57).
        """
        share = self._share(force, self.limit_force)
        bracket = 1.0 - (1.0 - share) ** (5 / 3) - 5.0 / 6.0 * share * (1.0 + (1.0 - share) ** (2 / 3))
        return 4.8 * self.limit_force * self.limit_displacement * float(bracket)

    @staticmethod
    def _share(value: float, limit: float) -> float:
        if not 0.0 <= value <= limit * (1 + 1e-12):
            raise MeeframeError(f"partial slip: {value:g} is out of bounds; allowed: 0 to {limit:g}")
        return min(value / limit, 1.0)


@final
@dataclass(frozen=True)
class FullStick:
    """A blunt indenter pressed in gradually with full stick where it touches: f(r) = coefficient r^power [m].

    Attributes
    ----------
    young, poisson : float
        Young's modulus [Pa] and Poisson's ratio.
    power : float
        1 (cone, coefficient tan(angle)), 2 (sphere, coefficient 1/(2 R)) or any other positive number.
    coefficient : float
        Coefficient of the shape.

    Notes
    -----
    The contact grows as if by bonded flat punches of increasing radius: dP = 2 c E* a dg. The radius follows from the
    surface outside the contact. Radial tractions do not move it along the normal, so that, with h the Abel transform of
    the pressure under a bonded punch of unit radius,
        W(r) = (2/pi) int_0^1 h(t)/sqrt(r^2 - t^2) dt,   h(t) = cosh(pi theta) cos(theta ln((1 + t)/(1 - t))),
    theta = ln(3 - 4 nu)/(2 pi), is the displacement at r > 1 for a unit one of the punch. A point at r touches when
    g(r) - int_0^r W(r/b) g'(b) db = f(r); for a power of r, g is a power of a.
    """

    young: float
    poisson: float
    power: float
    coefficient: float

    @property
    def approach_factor(self) -> float:
        """Factor K in g = K a^power; without friction it is 2 coefficient (sphere) or pi/2 coefficient (cone)."""
        p = self.power
        # int_0^1 W(1/s) s^(p - 1) ds, integrated over s first
        moment = _bonded_transform(
            self.poisson, lambda t, _: float(hyp2f1(0.5, (p + 1) / 2, (p + 3) / 2, t**2)) / (p + 1)
        )
        return self.coefficient / (1.0 - p * moment)

    def contact_radius(self, approach: float) -> float:
        """Return the contact radius a.

        Parameters
        ----------
        approach : float
            Approach [m].

        Returns
        -------
        float
            Contact radius [m].
        """
        return float((approach / self.approach_factor) ** (1.0 / self.power))

    def stiffness(self, approach: float) -> float:
        """Return the stiffness dP/dg = 2 c E* a.

        Parameters
        ----------
        approach : float
            Approach g [m].

        Returns
        -------
        float
            Stiffness [N/m].
        """
        modulus = bonding_factor(self.poisson) * contact_modulus(self.young, self.poisson)
        return 2.0 * modulus * self.contact_radius(approach)

    def force(self, approach: float) -> float:
        """Return the force P, the integral of the stiffness, proportional to g^(1/power), over the approach.

        Parameters
        ----------
        approach : float
            Approach g [m].

        Returns
        -------
        float
            Force [N], positive in compression.
        """
        return self.stiffness(approach) * approach * self.power / (self.power + 1.0)


def outside_bonded_punch(r: float, poisson: float) -> float:
    """Return the normal displacement W(r) outside a bonded flat punch of unit radius and displacement.

    Parameters
    ----------
    r : float
        Radius >= 1, relative to that of the punch.
    poisson : float
        Poisson's ratio.

    Returns
    -------
    float
        Displacement relative to that of the punch; see the notes of `FullStick`.
    """
    return _bonded_transform(poisson, lambda _, complement: float((r**2 - 1.0 + complement) ** -0.5))


def _bonded_transform(poisson: float, function: Callable[[float, float], float]) -> float:
    """Return (2/pi) int_0^1 h(t) function(t, 1 - t^2) dt.

    With t = tanh(x) the logarithm that oscillates at the edge becomes 2 x, and the integrand decays like 1/cosh(x).
    """
    half = _half_logarithm(poisson)

    def integrand(x: float) -> float:
        complement = np.cosh(x) ** -2
        return float(np.cos(2.0 * half / np.pi * x) * function(np.tanh(x), complement) * complement)

    integral, _ = quad(integrand, 0.0, _UPPER_LIMIT, epsabs=0.0, epsrel=1e-11, limit=200)
    return float(2.0 / np.pi * np.cosh(half) * integral)


@final
@dataclass(frozen=True)
class SphereTorsion:
    """A sphere that is pressed in and then twisted about its axis, with full stick or a slipping annulus (Lubkin).

    Exact if the pressure does not move the surface tangentially (nu = 1/2, or Goodman's approximation). The twist is
    that of the indenter [rad], the torque that on the body [N m].

    Attributes
    ----------
    hertz : HertzContact
        The normal contact.
    friction : float
        Coefficient of friction mu > 0; inf for full stick.

    Notes
    -----
    The tractions are sums of those of rigid discs (Reissner and Sagoci), (4 G/pi) r/sqrt(s^2 - r^2) for a unit twist,
    of radii s from c to a; Coulomb's law on the annulus determines their twists, (mu p_0/(2 G)) E(1 - s^2/a^2)/s ds.
    """

    hertz: HertzContact
    friction: float

    @property
    def initial_stiffness(self) -> float:
        """Ratio of torque and twist without slip, 16 G a^3/3 [N m] (Johnson, section 3.9)."""
        return 16.0 / 3.0 * self._shear * self.hertz.contact_radius**3

    @property
    def limit_torque(self) -> float:
        """Torque of full slip, 3 pi mu P a/16 [N m]."""
        return 3.0 * np.pi / 16.0 * self.friction * self.hertz.force * self.hertz.contact_radius

    def twist(self, stick_share: float) -> float:
        """Return the twist (mu p_0/(2 G)) (K - E)(1 - k^2) at a stick radius.

        Parameters
        ----------
        stick_share : float
            Relative stick radius k = c/a in (0, 1].

        Returns
        -------
        float
            Twist [rad].
        """
        return self._unit_twist * float(ellipkm1(stick_share**2) - ellipe(1.0 - stick_share**2))

    def stick_share(self, twist: float) -> float:
        """Return the relative stick radius k = c/a.

        Parameters
        ----------
        twist : float
            Twist >= 0 [rad].

        Returns
        -------
        float
            Relative stick radius in (0, 1].
        """
        return float(brentq(lambda k: self.twist(k) - twist, 1e-12, 1.0, xtol=1e-14))

    def torque(self, twist: float) -> float:
        """Return the torque of a twist from rest.

        Parameters
        ----------
        twist : float
            Twist >= 0 [rad].

        Returns
        -------
        float
            Torque on the body [N m].
        """
        if np.isinf(self.friction):
            return self.initial_stiffness * twist
        discs, _ = quad(lambda s: s**2 * ellipe(1.0 - s**2), self.stick_share(twist), 1.0, epsabs=0, epsrel=1e-11)
        return float(self.initial_stiffness * self._unit_twist * discs)

    def traction(self, r: Array, twist: float) -> Array:
        """Return the traction along the circles about the axis.

        Parameters
        ----------
        r : Array
            Radii, (n,) [m].
        twist : float
            Twist >= 0 [rad].

        Returns
        -------
        Array
            Tractions, (n,) [Pa], zero outside the contact.
        """
        a = self.hertz.contact_radius
        k = self.stick_share(twist)
        traction = self.friction * self.hertz.pressure(r)
        for index in np.flatnonzero(r < k * a):
            x = float(r[index]) / a
            # the substitution s^2 = x^2 + v^2 removes the root
            limits = (np.sqrt(k**2 - x**2), np.sqrt(1.0 - x**2))
            discs, _ = quad(lambda v, x=x: ellipe(1.0 - x**2 - v**2) / (x**2 + v**2), *limits, epsrel=1e-11)
            traction[index] = 4.0 * self._shear / np.pi * self._unit_twist * x * discs
        return traction

    @property
    def _shear(self) -> float:
        return shear_modulus(self.hertz.young, self.hertz.poisson)

    @property
    def _unit_twist(self) -> float:
        """Unit of twists, mu p_0/(2 G)."""
        return self.friction * self.hertz.peak_pressure / (2.0 * self._shear)


def _dome(r: Array, radius: float) -> Array:
    """Return sqrt(1 - r^2/radius^2) inside, zero outside; zero for a radius of zero."""
    inside = np.asarray(r) < radius
    share = np.divide(r, radius, out=np.ones_like(r, dtype=float), where=inside)
    dome: Array = np.sqrt(1.0 - share**2)
    return dome
