"""Full stick jumps at zero pressure: on nine nodes, all 512 combinations of open and closed nodes give all
solutions."""

from itertools import product

import numpy as np
import pytest

from meeframe.contact.problem import ContactProblem, Solver, Status
from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb
from meeframe.solvers import Auto, BarzilaiBorwein, Nesterov, SemismoothNewton, StoppingCriteria, Uzawa, solve

STICK = IsotropicCoulomb(np.inf)
SOLVERS = [SemismoothNewton(), BarzilaiBorwein(), Nesterov(), Uzawa(), Auto()]
GRADIENT = StoppingCriteria(max_iterations=1000, stall_window=1000)
"""Enough for gradient iterations by far: those that converge here do so within 300 steps."""
NEWTON = StoppingCriteria(max_iterations=100, stall_window=100)


def limits(solver: Solver) -> StoppingCriteria:
    return GRADIENT if solver.check_interval > 1 else NEWTON


def name(solver: Solver) -> str:
    return type(solver).__name__


def solutions(problem: ContactProblem) -> list[Array]:
    """Return the tractions (n, 3) of all solutions under full stick and insulation: closed nodes stick under
    pressure, open nodes do not overlap; both include biactive nodes."""
    n = len(problem.gap)
    matrix = problem.system.matrix[:, :3, :, :3].reshape(3 * n, 3 * n)
    target = np.column_stack([problem.translation, problem.gap]).ravel()
    computed = []
    for contact_fraction in map(np.array, product([False, True], repeat=n)):
        rows, traction = np.repeat(contact_fraction, 3), np.zeros(3 * n)
        traction[rows] = np.linalg.solve(matrix[np.ix_(rows, rows)], target[rows])
        gap = problem.gap - (matrix @ traction)[2::3]
        if (traction[2::3][contact_fraction] < 0.0).all() and (gap[~contact_fraction] >= 0.0).all():
            computed.append(traction.reshape(n, 3))
    return computed


@pytest.mark.full
@pytest.mark.parametrize("solver", SOLVERS, ids=name)
def test_no_solver_converges_without_a_solution(sphere, solver) -> None:
    """The translation is several approaches: some node is in tension if it sticks and overlaps if it opens."""
    problem = sphere("orthotropic", STICK, drag=5.0, cells=3)
    assert not solutions(problem)
    solution = solve(problem, solver, limits(solver))
    assert solution.status is not Status.CONVERGED
    assert solution.residual > 1e-3


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("solver", SOLVERS, ids=name)
@pytest.mark.parametrize(("material", "drag"), [("transverse", 2.0), ("orthotropic", 1.0)])
def test_all_solvers_find_a_unique_solution(sphere, solver, material, drag) -> None:
    """The translation is smaller than in the previous test."""
    problem = sphere(material, STICK, drag=drag, cells=3)
    (expected,) = solutions(problem)
    solution = solve(problem, solver, limits(solver))
    assert solution.status is Status.CONVERGED, solution.message
    assert np.abs(solution.state.load[:, :3] - expected).max() <= 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("solver", SOLVERS, ids=name)
@pytest.mark.parametrize(("material", "drag"), [("transverse", 7.5), ("orthotropic", 5.0)])
def test_finite_friction_has_a_solution(sphere, solver, material, drag) -> None:
    problem = sphere(material, IsotropicCoulomb(5.0), drag=drag, cells=3)
    solution = solve(problem, solver, limits(solver))
    assert solution.status is Status.CONVERGED, solution.message
