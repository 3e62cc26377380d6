"""Closed forms with friction satisfy their laws: surface displacements, resultants, energy, limits."""

import numpy as np
import pytest
from scipy.integrate import quad

from meeframe.common.errors import MeeframeError
from meeframe.testing.closed_forms import Sphere, indent
from meeframe.testing.closed_forms_friction import (
    FullStick,
    HertzContact,
    PartialSlip,
    SphereTorsion,
    bonding_factor,
    contact_modulus,
    outside_bonded_punch,
    shear_modulus,
)
from meeframe.testing.elastic_half_space import elastic_half_space

YOUNG, RADIUS, APPROACH, FRICTION = 2.0, 0.1, 4e-5, 0.3


CELLS, WITHIN = 32, 9
"""Cells along a side, and points along a side of each, over which a traction is averaged."""


def cell_means(function, x: np.ndarray, y: np.ndarray, step: float) -> np.ndarray:
    """Return the mean of function(x, y) over the cells centred at x, y (n,), which a constant density represents."""
    inner = ((np.arange(WITHIN) + 0.5) / WITHIN - 0.5) * step
    across, along = (grid.ravel() for grid in np.meshgrid(inner, inner))
    points = np.add.outer(x, across).ravel(), np.add.outer(y, along).ravel()
    return function(*points).reshape(len(x), WITHIN**2).mean(axis=1)


def hertz(poisson: float) -> HertzContact:
    return HertzContact(YOUNG, poisson, RADIUS, APPROACH)


def resultant(traction, a: float, *kinks: float, power: int = 1) -> float:
    """Return 2 pi int r^power traction dr."""
    computed, _ = quad(
        lambda r: r**power * traction(np.array([r]))[0], 0.0, a, points=kinks, epsabs=0, epsrel=1e-9, limit=200
    )
    return 2 * np.pi * computed


def test_hertz_matches_frictionless_half_space() -> None:
    exact, other = hertz(0.3), indent(np.eye(3) / (np.pi * contact_modulus(YOUNG, 0.3)), Sphere(RADIUS), APPROACH)
    r = np.linspace(0, 1.2, 8) * exact.contact_radius
    assert exact.contact_radius == pytest.approx(other.contact_radius)
    assert exact.force == pytest.approx(other.force)
    np.testing.assert_allclose(exact.pressure(r), other.pressure(r), atol=1e-12)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("share", [0.3, 0.8])
def test_stick_zone_moves_rigidly_in_partial_slip(poisson: float, share: float) -> None:
    exact = PartialSlip(hertz(poisson), FRICTION)
    force, a = share * exact.limit_force, exact.hertz.contact_radius
    c, moved = exact.stick_radius(force), exact.displacement(force)
    system = elastic_half_space(YOUNG, poisson, 2.1 * a, CELLS)
    x, y, _ = system.points.T
    r, step = np.hypot(x, y), 2.1 * a / CELLS
    load = np.zeros((len(r), 5))
    load[:, 0] = cell_means(lambda x, y: exact.traction(np.hypot(x, y), force), x, y, step)
    u = system.apply(load)
    np.testing.assert_allclose(u[r < c - step, 0], moved, rtol=0.01)
    np.testing.assert_allclose(u[r < c - step, 1], 0.0, atol=0.01 * moved)
    ring = (r > c + step) & (r < a)
    assert (u[ring, 0] < moved).all()
    np.testing.assert_allclose(exact.traction(r[ring], force), FRICTION * exact.hertz.pressure(r[ring]))
    assert resultant(lambda s: exact.traction(s, force), a, c) == pytest.approx(force, rel=1e-6)


def test_partial_slip_limits() -> None:
    exact = PartialSlip(hertz(0.3), FRICTION)
    a, small = exact.hertz.contact_radius, 1e-6 * exact.limit_force
    assert exact.stick_radius(0.0) == a
    assert exact.stick_radius(exact.limit_force) == 0.0
    np.testing.assert_allclose(exact.traction(np.array([0.0]), exact.limit_force), FRICTION * exact.hertz.peak_pressure)
    stiffness = 8 * shear_modulus(YOUNG, 0.3) * a / (2 - 0.3)  # stiffness of a sticking disc (Mindlin)
    assert small / exact.displacement(small) == pytest.approx(stiffness, rel=1e-5)
    assert exact.force(exact.displacement(0.7 * exact.limit_force)) == pytest.approx(0.7 * exact.limit_force)
    for beyond in (-1e-3, 1.1):
        with pytest.raises(MeeframeError, match="out of bounds; allowed: 0 to"):
            exact.stick_radius(beyond * exact.limit_force)


@pytest.mark.parametrize("share", [0.2, 0.7, 1.0])
def test_loop_closes_and_its_area_is_its_dissipation(share: float) -> None:
    exact = PartialSlip(hertz(0.2), FRICTION)
    force = share * exact.limit_force
    turning = exact.displacement(force)
    assert exact.force_after_reversal(turning, turning) == pytest.approx(force)
    assert exact.force_after_reversal(-turning, turning) == pytest.approx(-force)
    back, _ = quad(lambda x: exact.force_after_reversal(x, turning), -turning, turning, epsabs=0, epsrel=1e-11)
    assert exact.loop_dissipation(force) == pytest.approx(-2 * back, rel=1e-8)


def test_reversed_tractions_satisfy_the_law() -> None:
    exact = PartialSlip(hertz(0.0), FRICTION)
    turning = exact.displacement(0.8 * exact.limit_force)
    position, r = 0.2 * turning, np.linspace(0.0, 0.999, 200) * exact.hertz.contact_radius
    traction, bound = exact.traction_after_reversal(r, position, turning), FRICTION * exact.hertz.pressure(r)
    assert (np.abs(traction) <= bound * (1 + 1e-12)).all()
    back = exact.stick_radius(exact.force((turning - position) / 2))
    np.testing.assert_allclose(traction[r > back], -bound[r > back])
    a, rotated = exact.hertz.contact_radius, exact.stick_radius(exact.force(turning))
    total = resultant(lambda s: exact.traction_after_reversal(s, position, turning), a, back, rotated)
    assert total == pytest.approx(exact.force_after_reversal(position, turning), rel=1e-5)


def test_bonding_factor() -> None:
    assert bonding_factor(0.5) == 1.0
    assert bonding_factor(0.0) == pytest.approx(np.log(3.0))
    for poisson in (-0.5, 0.2, 0.3, 0.4, 0.499):
        expected = (1 - poisson) * np.log(3 - 4 * poisson) / (1 - 2 * poisson)
        assert bonding_factor(poisson) == pytest.approx(expected)


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.5])
def test_surface_beside_a_bonded_punch(poisson: float) -> None:
    """The displacement is continuous at the edge, and far away it is that of the load."""
    assert outside_bonded_punch(1.0, poisson) == pytest.approx(1.0)
    far = 2 * bonding_factor(poisson) / (np.pi * 1e3)
    assert outside_bonded_punch(1e3, poisson) == pytest.approx(far, rel=1e-5)
    if poisson == 0.5:
        assert outside_bonded_punch(1.7, poisson) == pytest.approx(2 / np.pi * np.arcsin(1 / 1.7))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("power", [1, 2, 4])
@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.5])
def test_surface_meets_the_indenter_at_the_edge_in_full_stick(power: int, poisson: float) -> None:
    exact = FullStick(YOUNG, poisson, power, 0.02)
    approach = 0.7 * exact.approach_factor
    a = exact.contact_radius(approach)

    def integrand(angle: float) -> float:
        """Return the integrand over contact radii b = a sin(angle), in which it has no root at the edge."""
        share = np.sin(angle)
        slope = power * exact.approach_factor * (a * share) ** (power - 1)
        return outside_bonded_punch(1.0 / share, poisson) * slope * a * np.cos(angle)

    moved, _ = quad(integrand, 0.0, 0.5 * np.pi, epsabs=0.0, epsrel=1e-7)
    assert approach - moved == pytest.approx(0.02 * a**power, rel=1e-6)
    step = 1e-6 * approach
    slope = (exact.force(approach + step) - exact.force(approach - step)) / (2 * step)
    assert slope == pytest.approx(2 * bonding_factor(poisson) * contact_modulus(YOUNG, poisson) * a)
    assert slope == pytest.approx(exact.stiffness(approach))


def test_full_stick_without_coupling_is_frictionless() -> None:
    sphere, cone = FullStick(YOUNG, 0.5, 2, 1 / (2 * RADIUS)), FullStick(YOUNG, 0.5, 1, np.tan(0.1))
    assert sphere.contact_radius(APPROACH) == pytest.approx(hertz(0.5).contact_radius)
    assert sphere.force(APPROACH) == pytest.approx(hertz(0.5).force)
    assert cone.contact_radius(APPROACH) == pytest.approx(2 * APPROACH / (np.pi * np.tan(0.1)))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("share", [0.4, 0.8])
def test_stick_zone_rotates_rigidly_in_torsion(share: float) -> None:
    exact = SphereTorsion(hertz(0.3), FRICTION)
    a, twist = exact.hertz.contact_radius, exact.twist(share)
    system = elastic_half_space(YOUNG, 0.3, 2.1 * a, CELLS)
    x, y, _ = system.points.T
    r = np.hypot(x, y)
    load = np.zeros((len(r), 5))
    load[:, :2] = (exact.traction(r, twist) / r)[:, None] * np.column_stack([-y, x])
    u = system.apply(load)
    rotated = (x * u[:, 1] - y * u[:, 0]) / r**2
    step = 2.1 * a / CELLS
    inside = (r < share * a - step) & (r > 2 * step)
    np.testing.assert_allclose(rotated[inside], twist, rtol=0.01)
    assert (rotated[(r > share * a + step) & (r < a)] < twist).all()
    np.testing.assert_allclose(u[:, 2], 0.0, atol=0.01 * twist * a)
    total = resultant(lambda s: exact.traction(s, twist), a, share * a, power=2)
    assert total == pytest.approx(exact.torque(twist), rel=1e-6)


def test_torsion_limits() -> None:
    exact, stuck = SphereTorsion(hertz(0.3), FRICTION), SphereTorsion(hertz(0.3), np.inf)
    assert exact.stick_share(exact.twist(0.37)) == pytest.approx(0.37)
    assert exact.torque(exact.twist(1e-7)) == pytest.approx(exact.limit_torque)
    small = exact.twist(1 - 1e-6)
    assert exact.torque(small) == pytest.approx(stuck.torque(small), rel=1e-5)
