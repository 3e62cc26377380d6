"""Solvers use the requested tolerance to save work and reach it."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.contact.problem import ContactProblem, Solver, Status
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini
from meeframe.solvers import (
    Auto,
    BarzilaiBorwein,
    Nesterov,
    SemismoothNewton,
    StoppingCriteria,
    Uzawa,
    residual,
    solve,
)
from meeframe.testing.operation_counter import OperationCounter

DRAGGED = (3e-6, 1e-6)


def count_products(problem: ContactProblem, solver: Solver, tolerance: float) -> int:
    """Return the number of products of a converged solution."""
    counting = replace(problem, system=OperationCounter.of(problem.system))
    solution = solve(counting, solver, StoppingCriteria(tolerance))
    products = len(counting.system.products)
    assert solution.status is Status.CONVERGED, solution.message
    assert residual(problem, solution.state) <= tolerance
    return products


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", [SemismoothNewton(), Auto()], ids=["newton", "auto"])
def test_less_accuracy_costs_less(solver: Solver, conducting) -> None:
    problem = conducting(48, 0.3, IsotropicCoulomb(0.3), Insulating(), dragged=DRAGGED)
    assert count_products(problem, solver, 1e-3) < count_products(problem, solver, 1e-10)


@pytest.mark.parametrize("solver", [SemismoothNewton(), Auto(), BarzilaiBorwein(), Nesterov(), Uzawa()])
def test_first_iterate_does_not_depend_on_the_tolerance(solver: Solver, conducting) -> None:
    problem = conducting(32, 0.3, Signorini())
    strict, loose = (solver.init(problem, None, tolerance) for tolerance in (1e-10, 1e-3))
    for name in ("load", "contact_fraction", "motion"):
        np.testing.assert_array_equal(getattr(loose, name), getattr(strict, name))
    assert loose.estimate == strict.estimate
