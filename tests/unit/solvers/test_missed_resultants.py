"""Forces above the friction limit at a prescribed approach are reported early; forces just below it converge."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from meeframe_laws.friction import CappedCoulomb

from meeframe.contact.problem import PrescribedResultant, Status
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb
from meeframe.solvers import Auto, BarzilaiBorwein, Nesterov, SemismoothNewton, StoppingCriteria, Uzawa, solve
from meeframe.testing.half_space import half_space_system, indentation_problem

MU, CELLS, APPROACH = 0.3, 8, 2e-5
X, Y, PRESS = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0])
SOLVERS = [BarzilaiBorwein(), Nesterov(), Uzawa(), SemismoothNewton(), Auto()]
SOON = 100
"""Steps; the patience of most solvers is 2000."""


@cache
def pressed_sphere(law):
    """Return a sphere at a prescribed approach, and its normal force, which friction does not change here."""
    system = half_space_system(np.diag([2.4e-12, 2.2e-12, 2e-12, 1.0, 1.0]), 5e-3, CELLS)
    height = (system.points[:, :2] ** 2).sum(axis=1) / 0.2
    problem = indentation_problem(system, height, APPROACH, law)
    return problem, -float(system.weights @ solve(problem, Uzawa()).state.load[:, 2])


def driven(problem, *resultants):
    """Return a problem with prescribed resultants (mode (3,) or (n, 3), total)."""
    prescribed_resultants = []
    for motion, total in resultants:
        mode = np.zeros((len(problem.gap), 5))
        mode[:, :3] = motion
        prescribed_resultants.append(PrescribedResultant(mode, mode, problem.system.weights, total))
    return replace(problem, prescribed_resultants=tuple(prescribed_resultants))


def reported(message):
    """Return the prescribed and the computed resultants named in a message."""
    number = r"(-?[\d.e+-]+(?:, -?[\d.e+-]+)*)"
    match = re.search(rf"prescribed \({number} N, N m\) are more than friction bears.*they reach {number} \(", message)
    assert match, message
    return tuple(np.array([float(value) for value in part.split(", ")]) for part in match.groups())


@pytest.mark.parametrize(("share", "missed"), [(0.5, False), (2.0, True)])
def test_missed_resultants_are_reported_before_convergence(share, missed):
    problem, force = pressed_sphere(IsotropicCoulomb(MU))
    solution = solve(driven(problem, (X, share * MU * force)), Uzawa(), StoppingCriteria(max_iterations=4))
    assert solution.status is Status.ITERATION_LIMIT
    assert ("the loads found miss the prescribed resultants" in solution.message) == missed


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("solver", SOLVERS, ids=str)
@pytest.mark.parametrize("share", [1.02, 1.3, 2.4, 1e3])
def test_force_above_friction_limit_is_detected_early(solver, share):
    problem, force = pressed_sphere(IsotropicCoulomb(MU))
    solution = solve(driven(problem, (X, share * MU * force), (Y, 0.0)), solver)
    assert solution.status is Status.STALLED
    assert solution.iterations <= SOON
    prescribed, borne = reported(solution.message)
    np.testing.assert_allclose(prescribed, [share * MU * force, 0.0], rtol=1e-3)
    np.testing.assert_allclose(borne, [MU * force, 0.0], rtol=1e-2, atol=1e-2 * MU * force)


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("solver", SOLVERS, ids=str)
@pytest.mark.parametrize("share", [0.9, 0.98, 0.999])
def test_force_just_below_friction_limit_converges(solver, share):
    problem, force = pressed_sphere(IsotropicCoulomb(MU))
    solution = solve(driven(problem, (X, share * MU * force), (Y, 0.0)), solver)
    assert solution.status is Status.CONVERGED
    np.testing.assert_allclose(problem.system.weights @ solution.state.load[:, 0], share * MU * force, rtol=1e-8)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", SOLVERS, ids=str)
@pytest.mark.parametrize("direction", [0.3, 1.2])
def test_orthotropic_friction_ellipse(solver, direction):
    """Forces outside the ellipse are reported with a limit on it; forces inside converge."""
    mu, angle = np.array([0.2, 0.5]), 0.4
    problem, force = pressed_sphere(OrthotropicCoulomb(*mu, angle))
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    limit = force * (mu * [np.cos(direction), np.sin(direction)]) @ axes
    far = solve(driven(problem, (X, 1.5 * limit[0]), (Y, 1.5 * limit[1])), solver)
    assert far.iterations <= SOON
    _, borne = reported(far.message)
    assert np.linalg.norm(axes @ borne / mu) == pytest.approx(force, rel=1e-2)
    near = solve(driven(problem, (X, 0.98 * limit[0]), (Y, 0.98 * limit[1])), solver)
    assert near.status is Status.CONVERGED


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", [BarzilaiBorwein(), SemismoothNewton(), Auto()], ids=str)
def test_torque_above_friction_limit_under_prescribed_force(solver):
    """Pressure at the corners could carry it, so preflight does not reject it; the pressure of the sphere cannot."""
    problem, force = pressed_sphere(IsotropicCoulomb(MU))
    x, y, _ = problem.system.points.T
    state = solve(problem, Uzawa()).state
    limit = MU * float(problem.system.weights @ (-state.load[:, 2] * np.hypot(x, y)))
    twist = np.column_stack([-y, x, 0.0 * x])
    solution = solve(driven(problem, (PRESS, force), (twist, 1.3 * limit)), solver)
    assert solution.iterations <= SOON
    _, borne = reported(solution.message)
    np.testing.assert_allclose(borne, [limit], rtol=1e-2)
    assert solve(driven(problem, (PRESS, force), (twist, 0.98 * limit)), solver).status is Status.CONVERGED


def test_full_stick_carries_any_force():
    problem, force = pressed_sphere(IsotropicCoulomb(np.inf))
    solution = solve(driven(problem, (X, 3.0 * force)), SemismoothNewton(), StoppingCriteria(max_iterations=60))
    assert "more than friction bears" not in solution.message


def test_ratio_of_forces_above_the_friction_limit_is_called_a_ratio():
    limit = 1e5
    problem, force = pressed_sphere(CappedCoulomb(MU, limit))
    area = float(problem.system.weights @ (solve(problem, Uzawa()).state.load[:, 2] < 0.0))
    mode, density = np.zeros((2, len(problem.gap), 5))
    mode[:, 0] = 1.0
    density[:, 0], density[:, 2] = 1.0, 0.9 * MU
    ratio = PrescribedResultant(mode, density, problem.system.weights, 0.0)
    solution = solve(replace(problem, prescribed_resultants=(ratio,)), Auto())
    words = r"ratio of tangential to normal force prescribed is more than friction bears.*missed by (-?[\d.]+) N"
    missed = re.search(words, solution.message)
    assert missed, solution.message
    np.testing.assert_allclose(float(missed.group(1)), limit * area - 0.9 * MU * force, rtol=2e-2)
