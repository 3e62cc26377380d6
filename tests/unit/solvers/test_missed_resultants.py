"""What friction cannot bear at a prescribed approach is told soon; what it just bears converges as ever."""

import re
from dataclasses import replace

import numpy as np
import pytest

from meeframe.contact.problem import PrescribedResultant, Status
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb
from meeframe.solvers import Auto, BarzilaiBorwein, Nesterov, SemismoothNewton, StoppingCriteria, Uzawa, solve
from meeframe.testing.half_space import half_space_system, indentation_problem

MU, CELLS, APPROACH = 0.3, 8, 2e-5
X, Y, PRESS = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0])
SOLVERS = [BarzilaiBorwein(), Nesterov(), Uzawa(), SemismoothNewton(), Auto()]
SOON = 100
"""Steps; the patience of most solvers is 2000."""


def pressed(law):
    """A sphere at a given approach, and the normal force on it: friction does not change that here."""
    system = half_space_system(np.diag([2.4e-12, 2.2e-12, 2e-12, 1.0, 1.0]), 5e-3, CELLS)
    height = (system.points[:, :2] ** 2).sum(axis=1) / 0.2
    problem = indentation_problem(system, height, APPROACH, law)
    return problem, -float(system.weights @ solve(problem, Uzawa()).state.load[:, 2])


def driven(problem, *given):
    """given: (mode (3,) or (n, 3), total)."""
    prescribed_resultants = []
    for motion, total in given:
        mode = np.zeros((len(problem.gap), 5))
        mode[:, :3] = motion
        prescribed_resultants.append(PrescribedResultant(mode, problem.system.weights[:, None] * mode, total))
    return replace(problem, prescribed_resultants=tuple(prescribed_resultants))


def told(message):
    """Resultants prescribed and borne, as a message names them."""
    number = r"(-?[\d.e+-]+(?:, -?[\d.e+-]+)*)"
    found = re.search(rf"prescribed \({number} N, N m\) are more than friction bears.*they reach {number};", message)
    assert found, message
    return tuple(np.array([float(value) for value in part.split(", ")]) for part in found.groups())


@pytest.mark.parametrize(("share", "missed"), [(0.5, False), (2.0, True)])
def test_resultants_that_are_missed_before_the_laws_hold(share, missed):
    problem, force = pressed(IsotropicCoulomb(MU))
    found = solve(driven(problem, (X, share * MU * force)), Uzawa(), StoppingCriteria(max_iterations=4))
    assert found.status is Status.ITERATION_LIMIT
    assert ("the loads found miss the prescribed resultants" in found.message) == missed


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("solver", SOLVERS, ids=str)
@pytest.mark.parametrize("share", [1.02, 1.3, 2.4, 1e3])
def test_a_force_beyond_friction_is_recognised_early(solver, share):
    problem, force = pressed(IsotropicCoulomb(MU))
    found = solve(driven(problem, (X, share * MU * force), (Y, 0.0)), solver)
    assert found.status is Status.STALLED
    assert found.iterations <= SOON
    prescribed, borne = told(found.message)
    np.testing.assert_allclose(prescribed, [share * MU * force, 0.0], rtol=1e-3)
    np.testing.assert_allclose(borne, [MU * force, 0.0], rtol=1e-2, atol=1e-2 * MU * force)


@pytest.mark.full(except_for=7)
@pytest.mark.parametrize("solver", SOLVERS, ids=str)
@pytest.mark.parametrize("share", [0.9, 0.98, 0.999])
def test_a_force_that_friction_just_bears_is_found(solver, share):
    problem, force = pressed(IsotropicCoulomb(MU))
    found = solve(driven(problem, (X, share * MU * force), (Y, 0.0)), solver)
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(problem.system.weights @ found.state.load[:, 0], share * MU * force, rtol=1e-8)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("solver", SOLVERS, ids=str)
@pytest.mark.parametrize("direction", [0.3, 1.2])
def test_the_ellipse_of_orthotropic_friction(solver, direction):
    """Beyond it, and what is borne lies on it; within it, the force is found."""
    mu, angle = np.array([0.2, 0.5]), 0.4
    problem, force = pressed(OrthotropicCoulomb(*mu, angle))
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    limit = force * (mu * [np.cos(direction), np.sin(direction)]) @ axes
    far = solve(driven(problem, (X, 1.5 * limit[0]), (Y, 1.5 * limit[1])), solver)
    assert far.iterations <= SOON
    _, borne = told(far.message)
    assert np.linalg.norm(axes @ borne / mu) == pytest.approx(force, rel=1e-2)
    near = solve(driven(problem, (X, 0.98 * limit[0]), (Y, 0.98 * limit[1])), solver)
    assert near.status is Status.CONVERGED


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", [BarzilaiBorwein(), SemismoothNewton(), Auto()], ids=str)
def test_a_torque_beyond_friction_under_a_prescribed_force(solver):
    """Pressure at the corners would bear it, so that it is not known beforehand: that of the sphere does not."""
    problem, force = pressed(IsotropicCoulomb(MU))
    x, y, _ = problem.system.points.T
    state = solve(problem, Uzawa()).state
    limit = MU * float(problem.system.weights @ (-state.load[:, 2] * np.hypot(x, y)))
    twist = np.column_stack([-y, x, 0.0 * x])
    found = solve(driven(problem, (PRESS, force), (twist, 1.3 * limit)), solver)
    assert found.iterations <= SOON
    _, borne = told(found.message)
    np.testing.assert_allclose(borne, [limit], rtol=1e-2)
    assert solve(driven(problem, (PRESS, force), (twist, 0.98 * limit)), solver).status is Status.CONVERGED


def test_full_stick_bears_any_force():
    problem, force = pressed(IsotropicCoulomb(np.inf))
    found = solve(driven(problem, (X, 3.0 * force)), SemismoothNewton(), StoppingCriteria(max_iterations=60))
    assert "more than friction bears" not in found.message
