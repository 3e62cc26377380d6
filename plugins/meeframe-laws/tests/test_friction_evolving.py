"""Slip-weakening and rate- and pressure-dependent friction agree with springs, closed forms and their formulas."""

import numpy as np
import pytest
from meeframe_laws.evolving import RateAndPressure, SlipWeakening

from meeframe.common.errors import CaseError
from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, Status, contact_gap
from meeframe.laws import Insulating
from meeframe.solvers import SemismoothNewton, solve
from meeframe.solvers.gradient.accelerated import BarzilaiBorwein
from meeframe.testing.cells import cell_system
from meeframe.testing.closed_forms_friction import HertzContact
from meeframe.testing.elastic_half_space import elastic_half_space
from meeframe.testing.force_control import TIGHT_CRITERIA

PRESSURE, STIFFNESS = 1e8, 1e13
"""Pressure on the springs [Pa], and their stiffness [Pa/m]."""
WEAK = SlipWeakening(0.6, 0.2, 1e-5)  # softens at 4e12 Pa/m under that pressure, less than the stiffness of the springs
BRITTLE = SlipWeakening(0.6, 0.2, 2e-6)  # at 2e13 Pa/m, more than the stiffness of the springs


def springs():
    """Return a system of four independent cells."""
    compliance = np.zeros((4, 5, 4, 5))
    for cell in range(4):
        compliance[cell, :, cell, :] = np.eye(5) / STIFFNESS
    return cell_system(compliance, 2e-2)


def step(system, law, gap, translation, slip_path, duration=None, start=None, slipped=0.0, solver=None):
    """Return state and slip (n, 2) of an increment to a translation (n, 2); slip is measured from `slipped`."""
    n = len(system.points)
    bound = law.for_increment(np.broadcast_to(slip_path, n), duration)
    moved = np.broadcast_to(translation, (n, 2)) - slipped
    problem = ContactProblem(system, bound, flux_channels(Insulating(), Insulating()), gap, moved, np.zeros((n, 2)))
    solution = solve(problem, solver or SemismoothNewton(), TIGHT_CRITERIA, start)
    assert solution.status is Status.CONVERGED, solution.message
    return solution.state, contact_gap(problem, solution.state.displacement)[:, :2]


def follow(system, law, gap, path, duration=None):
    """Return states and slips of the increments of a path (m, 2) of translations, with accumulating slip."""
    length, slipped, start = 0.0, 0.0, None
    for translation in path:
        start, slip = step(system, law, gap, translation, length, duration, start, slipped)
        slipped, length = slipped + slip, length + np.linalg.norm(slip, axis=1)
        yield start, slip


def test_weakening_computed_values():
    law = SlipWeakening(0.6, 0.2, 4.0)
    np.testing.assert_allclose(law.coefficient(np.array([0.0, 1.0, 2.0, 4.0, 9.0])), [0.6, 0.5, 0.4, 0.2, 0.2])
    trial = np.array([[30.0, 40.0, -10.0]] * 4)
    gap = np.array([[0.6, 0.8, 0.0], [0.0, 3.0, 0.0], [30.0, 40.0, 0.0], [0.0, 0.0, np.inf]])
    paths = np.array([0.0, 1.0, 0.0, 0.5])
    computed = law.for_increment(paths, None).resolve(trial, gap, (1.0, 1.0))
    np.testing.assert_allclose(np.hypot(*computed[:, :2].T), [5.0, 2.0, 2.0, 5.5])
    np.testing.assert_allclose(np.hypot(*law.resolve(trial, gap, (1.0, 1.0))[:, :2].T), [5.0, 3.0, 2.0, 6.0])


def softening_spring(law, translation):
    """Return the slip g of a spring k pulled by U over a softening contact: k (U - g) = mu_s p - w g, at least mu_k
    p."""
    onset = translation - law.mu_static * PRESSURE / STIFFNESS
    softening = (law.mu_static - law.mu_kinetic) * PRESSURE / law.slip_distance
    weakening = onset / (1.0 - softening / STIFFNESS)
    return np.where(
        onset <= 0.0,
        0.0,
        np.where(weakening < law.slip_distance, weakening, translation - law.mu_kinetic * PRESSURE / STIFFNESS),
    )


@pytest.mark.parametrize("solver", [SemismoothNewton(), BarzilaiBorwein()], ids=["newton", "uzawa-bb"])
def test_stiff_springs_weaken_steadily(solver):
    """Each cell is displaced by another amount in one step, from stick to complete weakening."""
    pull = np.array([4e-6, 7e-6, 1e-5, 2e-5])
    expected = softening_spring(WEAK, pull)
    assert 0.0 == expected[0] < expected[1] < expected[2] < WEAK.slip_distance < expected[3]
    along = np.array([0.6, -0.8])
    gap = np.full(4, -PRESSURE / STIFFNESS)
    state, slip = step(springs(), WEAK, gap, pull[:, None] * along, 0.0, solver=solver)
    np.testing.assert_allclose(slip, expected[:, None] * along, atol=1e-10 * pull.max())
    np.testing.assert_allclose(state.load[:, :2], STIFFNESS * (pull - expected)[:, None] * along, atol=1e-9 * PRESSURE)


def test_increments_match_one_step_and_do_not_heal():
    pull = np.linspace(0.0, 1.2e-5, 7)[1:]
    path = np.column_stack([pull, np.zeros(6)])
    gap = np.full(4, -PRESSURE / STIFFNESS)
    steps = list(follow(springs(), WEAK, gap, [*path, [-1.2e-5, 0.0]]))
    slips = np.cumsum([slip[0, 0] for _, slip in steps])
    np.testing.assert_allclose(slips[:-1], softening_spring(WEAK, pull), atol=1e-9 * pull.max())
    # reversal: the path is already 1.2e-5 - 2e-6, and the remaining weakening follows
    assert steps[-1][0].load[0, 0] == pytest.approx(-0.2 * PRESSURE, rel=1e-9)


def test_compliant_springs_jump_to_kinetic_friction():
    """The softening rate exceeds the stiffness: just above mu_s p the spring slips until kinetic friction balances
    it."""
    gap = np.full(4, -PRESSURE / STIFFNESS)
    onset = BRITTLE.mu_static * PRESSURE / STIFFNESS
    # large slip is also a solution below that; increments that are small compared with slip_distance continue to stick
    path = onset * np.append(np.linspace(0.04, 0.92, 23), 1.001)
    *_, (before, stuck), (after, slip) = follow(springs(), BRITTLE, gap, np.column_stack([path, 0.0 * path]))
    np.testing.assert_allclose(stuck, 0.0, atol=1e-9 * onset)
    np.testing.assert_allclose(before.load[:, 0], 0.92 * 0.6 * PRESSURE, rtol=1e-9)
    np.testing.assert_allclose(after.load[:, 0], 0.2 * PRESSURE, rtol=1e-9)
    np.testing.assert_allclose(slip[:, 0], 1.001 * onset - 0.2 * PRESSURE / STIFFNESS, rtol=1e-9)


def test_rate_and_pressure_computed_values():
    law = RateAndPressure(0.5, 0.1, 2e-3, 2.0, 1e6, 0.75)
    static, at, above = law.coefficient(np.array([0.0, 2e-3, 4e-3]))
    assert (static, at, above) == pytest.approx((0.5, 0.1 + 0.4 * np.exp(-1.0), 0.1 + 0.4 * np.exp(-4.0)), rel=1e-14)
    trial = np.array([[9e9, 0.0, -1e6], [9e9, 0.0, -16e6], [9e9, 0.0, 1e6], [9e9, 0.0, np.inf]])
    gap = np.array([[6e-4, 8e-4, 0.0]] * 4)
    computed = law.for_increment(np.zeros(4), 0.5).resolve(trial, gap, (1.0, 1.0))
    # 1 mm in half a second is the reference speed; 16 times the pressure gives 16^0.75 = 8 times the friction
    np.testing.assert_allclose(computed[:, 0], [at * 1e6, at * 8e6, 0.0, 0.0], rtol=1e-13)
    np.testing.assert_allclose(law.project(trial)[:, 0], [0.5e6, 4e6, 0.0, 0.0], rtol=1e-13)


@pytest.mark.parametrize("coefficients", [(0.4, 0.2), (0.2, 0.4)], ids=["falls with speed", "rises with speed"])
@pytest.mark.parametrize("duration", [0.1, 10.0])
@pytest.mark.parametrize("exponent", [0.5, 1.5, 3.0])
def test_steady_sliding_force_depends_on_speed(coefficients, duration, exponent):
    """In full slip the surface stops moving, so slip equals the motion of the indenter and T = mu(v) P."""
    law = RateAndPressure(*coefficients, reference_speed=1e-3, speed_exponent=exponent)
    system = elastic_half_space(1e11, 0.3, 2e-2, 12, goodman=True)
    height = (system.points[:, 0] ** 2 + system.points[:, 1] ** 2) / 2.0
    advance = 1e-3
    path = advance * np.outer(np.arange(1, 5), [0.8, -0.6])
    *_, (state, slip) = follow(system, law, height - 2.5e-5, path, duration)
    speed = advance / duration
    mu = coefficients[1] + (coefficients[0] - coefficients[1]) * np.exp(-((speed / 1e-3) ** exponent))
    force = system.weights @ state.load[:, :3]
    np.testing.assert_allclose(force[:2], mu * -force[2] * np.array([0.8, -0.6]), rtol=1e-9)
    np.testing.assert_allclose(
        slip[state.load[:, 2] < 0.0], np.tile(path[0], (int((state.load[:, 2] < 0).sum()), 1)), rtol=1e-9
    )


def test_sliding_sphere_with_pressure_exponent():
    """For n = 2/3 under Hertz's pressure, T = mu p_0 pi a^2 (p_max/p_0)^n / (1 + n/2)."""
    hertz = HertzContact(1e11, 0.3, 1.0, 2.5e-5)
    law = RateAndPressure(0.3, 0.3, 1.0, 1.0, 1e8, 2.0 / 3.0)
    system = elastic_half_space(1e11, 0.3, 1.4e-2, 24, goodman=True)
    height = (system.points[:, 0] ** 2 + system.points[:, 1] ** 2) / 2.0
    state, _ = step(system, law, height - hertz.approach, [1e-3, 0.0], 0.0, 1.0)
    share = (hertz.peak_pressure / 1e8) ** (2.0 / 3.0)
    exact = 0.3 * 1e8 * share * np.pi * hertz.contact_radius**2 / (1.0 + 1.0 / 3.0)
    assert system.weights @ state.load[:, 0] == pytest.approx(exact, rel=1e-2)


@pytest.mark.parametrize("duration", [None, 0.0, -1.0, np.inf, np.nan])
def test_rate_dependence_requires_a_duration(duration):
    assert RateAndPressure.needs_duration
    with pytest.raises(CaseError, match="duration"):
        RateAndPressure(0.3, 0.2, 1.0).for_increment(np.zeros(3), duration)


def test_law_of_an_increment_accepts_another_increment():
    gap, trial = np.array([[0.0, 2.0, 0.0]]), np.array([[30.0, 40.0, -10.0]])
    again = SlipWeakening(0.6, 0.2, 4.0).for_increment(np.array([9.0]), None).for_increment(np.array([1.0]), None)
    np.testing.assert_allclose(np.hypot(*again.resolve(trial, gap, (1.0, 1.0))[:, :2].T), 3.0)
    law = RateAndPressure(0.6, 0.2, 1.0)
    again = law.for_increment(gap[:, 0], 1e9).for_increment(gap[:, 0], 2.0)
    np.testing.assert_allclose(np.hypot(*again.resolve(trial, gap, (1.0, 1.0))[:, :2].T), 2.0 + 4.0 * np.exp(-1.0))
