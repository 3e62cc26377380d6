"""Lemke's method against solutions found by enumeration, and on problems with no solution."""

from itertools import product

import numpy as np
import pytest

from meeframe.common.complementarity import solve_complementarity


def enumerated(matrix, right):
    """Return the solution by trying which variables are positive."""
    for positive in product([False, True], repeat=len(right)):
        solution, chosen = np.zeros(len(right)), np.flatnonzero(positive)
        solution[chosen] = np.linalg.solve(matrix[np.ix_(chosen, chosen)], -right[chosen])
        if (solution >= 0.0).all() and (matrix @ solution + right >= -1e-12).all():
            return solution
    raise AssertionError("there is no solution")


@pytest.mark.parametrize("seed", range(20))
def test_solutions_of_positive_definite_problems(seed):
    rng = np.random.default_rng(seed)
    factor, skew, right = rng.normal(size=(6, 6)), rng.normal(size=(6, 6)), rng.normal(size=6)
    matrix = factor @ factor.T + 0.1 * np.eye(6) + 3.0 * (skew - skew.T)
    np.testing.assert_allclose(solve_complementarity(matrix, right), enumerated(matrix, right), atol=1e-9)


def test_a_large_problem_keeps_its_digits():
    rng = np.random.default_rng(0)
    factor, right = rng.normal(size=(500, 500)), rng.normal(size=500)
    matrix = factor @ factor.T / 500.0
    solution = solve_complementarity(matrix, right)
    slack = matrix @ solution + right
    assert solution.min() >= 0.0
    assert slack.min() > -1e-8
    assert np.abs(solution * slack).max() < 1e-8


def test_nothing_is_needed_where_the_right_hand_side_is_positive():
    np.testing.assert_array_equal(solve_complementarity(-np.eye(2), np.array([1.0, 2.0])), [0.0, 0.0])


@pytest.mark.parametrize("matrix", [[[-1.0]], [[0.0]], [[np.nan]]])
def test_problems_without_a_solution(matrix):
    assert solve_complementarity(np.array(matrix), np.array([-1.0])) is None
