"""Solvers that know which residual is asked for: they do no more than that, and no less."""

from dataclasses import replace

import numpy as np
import pytest

import meeframe.solvers.auto as auto_module
from meeframe.contact.problem import ContactProblem, Iterate, Solver, Status
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini
from meeframe.solvers import (
    Auto,
    BarzilaiBorwein,
    Nesterov,
    ProjectedCG,
    SemismoothNewton,
    StoppingCriteria,
    Uzawa,
    residual,
    solve,
)
from meeframe.testing.operation_counter import OperationCounter

DRAGGED = (3e-6, 1e-6)


def spent(problem: ContactProblem, solver: Solver, tolerance: float) -> int:
    """How many products a solution took, which is one."""
    counting = replace(problem, system=OperationCounter.of(problem.system))
    solution = solve(counting, solver, StoppingCriteria(tolerance))
    products = len(counting.system.products)
    assert solution.status is Status.CONVERGED, solution.message
    assert residual(problem, solution.state) <= tolerance
    return products


def aims(monkeypatch: pytest.MonkeyPatch, kind: type[Solver]) -> list[float]:
    """What solvers of this kind are told from now on."""
    told, original = list[float](), kind.aimed

    def heard(solver: Solver, iterate: Iterate, residual: float) -> Iterate:
        told.append(residual)
        return original(solver, iterate, residual)

    monkeypatch.setattr(kind, "aimed", heard)
    return told


@pytest.mark.parametrize("solver", [SemismoothNewton(), Auto()], ids=["newton", "auto"])
def test_what_is_not_asked_for_costs_nothing(solver: Solver, conducting, monkeypatch) -> None:
    """Fewer products than for more digits, and than without being told."""
    problems = [conducting(n, 0.3, IsotropicCoulomb(0.3), Insulating(), dragged=DRAGGED) for n in (64, 96)]

    def products(tolerance: float) -> int:
        return sum(spent(problem, solver, tolerance) for problem in problems)

    told = {tolerance: products(tolerance) for tolerance in (1e-4, 1e-7, 1e-10)}
    assert told[1e-4] < told[1e-7] < told[1e-10]
    monkeypatch.setattr(SemismoothNewton, "aimed", Solver.aimed)
    assert told[1e-4] < products(1e-4)
    assert told[1e-7] < 0.95 * products(1e-7)


def test_auto_hands_it_on_to_whom_it_hands_over(conducting, monkeypatch) -> None:
    """Told once at the start, and again when the next stage begins."""
    problem = conducting(32, 0.3, Signorini())
    by_newton, by_gradients = aims(monkeypatch, SemismoothNewton), aims(monkeypatch, ProjectedCG)
    first, second = auto_module.CONDUCTING
    monkeypatch.setattr(
        auto_module, "CONDUCTING", (replace(first, steps=0, stall_window=2), replace(second, stall_window=0))
    )
    monkeypatch.setattr(auto_module, "FALL", 0.0)
    solver = Auto()
    iterate, stages = solver.aimed(solver.init(problem, None), 3e-5), list[Solver]()
    for _ in range(6):
        stages.append(iterate.memory.stages[0].solver)
        before = len(by_newton), len(by_gradients)
        iterate = solver.step(problem, iterate)
        if isinstance(iterate.memory.stages[0].solver, type(stages[-1])):
            assert (len(by_newton), len(by_gradients)) == before
    assert [type(stage) for stage in dict.fromkeys(stages)] == [SemismoothNewton, ProjectedCG]
    assert len({id(stage) for stage in stages}) == 3  # Newton's method again
    assert by_newton == [3e-5, 3e-5]
    assert by_gradients == [3e-5]


def test_auto_that_was_not_told_tells_nobody(conducting, monkeypatch) -> None:
    problem = conducting(32, 0.3, Signorini())
    told = [aims(monkeypatch, kind) for kind in (SemismoothNewton, ProjectedCG)]
    first, second = auto_module.CONDUCTING
    monkeypatch.setattr(auto_module, "CONDUCTING", (replace(first, steps=0, stall_window=1), second))
    solver = Auto()
    iterate = solver.init(problem, None)
    for _ in range(4):
        iterate = solver.step(problem, iterate)
    assert isinstance(iterate.memory.stages[0].solver, ProjectedCG)
    assert told == [[], []]


@pytest.mark.parametrize("solver", [BarzilaiBorwein(), Nesterov(), Uzawa(), ProjectedCG()])
def test_by_default_nobody_cares(solver: Solver, conducting) -> None:
    iterate = solver.init(conducting(16, 0.3, Signorini()), None)
    assert solver.aimed(iterate, 1e-3) is iterate


@pytest.mark.parametrize("solver", [SemismoothNewton(), Auto()], ids=["newton", "auto"])
def test_nothing_but_what_is_remembered_changes(solver: Solver, conducting) -> None:
    iterate = solver.init(conducting(32, 0.3, Signorini()), None)
    aimed = solver.aimed(iterate, 1e-3)
    for name in ("load", "contact_fraction", "motion"):
        np.testing.assert_array_equal(getattr(aimed, name), getattr(iterate, name))
    assert aimed.estimate == iterate.estimate
    with pytest.raises(TypeError, match="was not made by"):
        solver.aimed(replace(iterate, memory=None), 1e-3)
