"""Test the status of synthetic iterations, the paper's criterion, and invalid input."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import final

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver, Status
from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.solvers import (
    BarzilaiBorwein,
    Nesterov,
    ProjectedCG,
    SemismoothNewton,
    StoppingCriteria,
    Uzawa,
    residual,
    solve,
)
from meeframe.system.capabilities import FieldwiseApply
from meeframe.system.reduced import NodalFields, ReducedSystem
from meeframe.testing.contact import check_solver, exact_pressure
from meeframe.testing.half_space import half_space_system, indentation_problem


def problem(approach: float = 5e-5, **options: object) -> ContactProblem:
    xi = np.diag([2.4e-12, 2.2e-12, 2e-12, -2e7, -1e3])
    xi[2, 3] = xi[3, 2] = 2e-3
    system = half_space_system(xi, 5e-3, 8)
    height = (system.points[:, 0] ** 2 + system.points[:, 1] ** 2) / 0.2
    return indentation_problem(system, height, approach, **options)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Prescribed(Solver):
    """Iterations with given loads p(k), uniform normal traction [Pa]."""

    kind: str

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        n = len(problem.gap)
        return Iterate(np.zeros((n, 5)), np.zeros(n), 0)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        k = iterate.memory + 1
        pressure = {
            "cycle": [1e9, 2e9, 3e9][k % 3],
            "grow": 1e8 * 3.0**k,
            "nan": 1e9 if k < 7 else np.nan,
            "rest": 1e9,
            "creep": 1e9 * (2.0 - 1.0 / k),
            "wander": 1e9 * (1.0 + np.sin(k**2)),
        }[self.kind]
        load = np.zeros_like(iterate.load)
        load[:, 2] = -pressure
        return Iterate(load, np.ones(len(load)), k)


@pytest.mark.parametrize(
    ("kind", "status", "text"),
    [
        ("cycle", Status.CYCLING, "return"),
        ("grow", Status.DIVERGED, "grew"),
        ("nan", Status.DIVERGED, "not a finite number at iteration 7"),
        ("rest", Status.STALLED, "stayed"),
        ("creep", Status.STALLED, "stayed"),
        ("wander", Status.STALLED, "stayed"),
    ],
)
def test_status_of_iterations_that_fail(kind: str, status: Status, text: str) -> None:
    solution = solve(problem(), Prescribed(kind), StoppingCriteria(stall_window=100, max_iterations=500))
    assert solution.status is status
    assert text in solution.message
    assert solution.iterations < 500
    assert solution.history[-1, 0] == solution.iterations


@final
@dataclass(frozen=True, eq=False)
class WrongProducts(ReducedSystem, FieldwiseApply):
    """A system whose products in chosen fields are larger than those of `apply`."""

    inner: ReducedSystem

    @classmethod
    def of(cls, inner: ReducedSystem) -> "WrongProducts":
        return cls(inner.points, inner.frames, inner.weights, inner.cells, inner.offset, inner)

    def apply(self, load: Array) -> Array:
        return self.inner.apply(load)

    def apply_fields(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        whole = np.zeros_like(self.offset)
        whole[:, list(loaded)] = load
        return 1.001 * self.apply(whole)[:, list(fields)]

    def diagonal(self, fields: Sequence[int]) -> Array:
        return self.diagonal_blocks()[:, list(fields), list(fields)]

    def diagonal_blocks(self) -> Array:
        return self.inner.diagonal_blocks()

    def dense(self) -> Array | None:
        return None

    def recover(self, load: Array) -> NodalFields:
        return self.inner.recover(load)


@pytest.mark.parametrize("solver", [ProjectedCG(), SemismoothNewton()], ids=["projected-cg", "newton"])
def test_residual_uses_apply(solver: Solver) -> None:
    """If products in chosen fields are wrong, the solver's solution does not converge, and the exact solution does."""
    honest = replace(problem(), contact_law=Signorini())
    misled = replace(honest, system=WrongProducts.of(honest.system))
    solution = solve(misled, solver, StoppingCriteria(stall_window=20))
    assert solution.residual == pytest.approx(residual(honest, solution.state), abs=1e-14)
    assert (solution.status is Status.CONVERGED) == (solution.residual <= 1e-10)
    assert (solution.residual > 1e-5) == isinstance(solver, ProjectedCG)  # states of Newton's method follow from apply
    solution = solve(honest, solver)
    assert solution.status is Status.CONVERGED
    assert solution.residual == pytest.approx(residual(honest, solution.state), abs=1e-14)


def test_iteration_limit_returns_the_last_state() -> None:
    solution = solve(problem(), Uzawa(), StoppingCriteria(max_iterations=13))
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.iterations == 13
    assert solution.residual == pytest.approx(residual(problem(), solution.state))


def test_unstable_step_length_does_not_converge() -> None:
    """For r above 2/lambda_max, the pressure of the stiffest mode grows until it leaves contact, repeatedly."""
    solution = solve(problem(), Uzawa(step_normal=5e14), StoppingCriteria(max_iterations=3000))
    assert solution.status in (Status.DIVERGED, Status.CYCLING, Status.STALLED)
    assert solution.residual > 1e-3


@pytest.mark.full
def test_step_length_of_the_paper_gives_same_solution() -> None:
    """The step length is 5e3 GPa/m; lambda_max of this zone is near 3e-14 m/Pa."""
    automatic = solve(problem(), Uzawa())
    fixed = solve(problem(), Uzawa(step_normal=5e12, step_tangential=3e12))
    assert automatic.status is fixed.status is Status.CONVERGED
    assert fixed.state.load == pytest.approx(automatic.state.load, rel=1e-7, abs=1.0)


@pytest.mark.full
def test_criterion_of_the_paper() -> None:
    """Changes are in m, GV, GA and GPa over one step; the residual is reported, too."""
    limits = StoppingCriteria(criterion="paper", tolerance=1e-6)
    solution = solve(problem(), Uzawa(step_normal=5e12), limits)
    assert solution.status is Status.CONVERGED
    before = solve(problem(), Uzawa(step_normal=5e12), replace(limits, max_iterations=solution.iterations - 1))
    assert before.status is Status.ITERATION_LIMIT
    change = np.linalg.norm((solution.state.load - before.state.load)[:, 2]) / 1e9
    assert solution.history[-1, 1] == pytest.approx(change, rel=1e-6)
    assert change <= 1e-6 < before.history[-1, 1]
    assert solution.residual == pytest.approx(residual(problem(), solution.state))
    exact = exact_pressure(problem())
    assert -solution.state.load[:, 2] == pytest.approx(exact, abs=2e-4 * exact.max())


def test_small_changes_do_not_imply_convergence() -> None:
    """With the paper's step length in Pa/m, tractions hardly change, and nothing is solved."""
    solution = solve(problem(), Uzawa(step_normal=5e3), StoppingCriteria(criterion="paper", tolerance=1e-6))
    assert solution.status is Status.STALLED
    assert "a longer step is needed" in solution.message
    assert solution.residual > 0.5


def test_progress_rises_to_one() -> None:
    calls: list[tuple[str, float]] = []
    solve(problem(), Uzawa(), progress=lambda stage, fraction: calls.append((stage, fraction)))
    assert {stage for stage, _ in calls} == {"contact"}
    assert all(a <= b for (_, a), (_, b) in pairwise(calls))
    assert calls[-1][1] == 1.0


def test_no_contact_converges_at_once() -> None:
    solution = solve(problem(approach=-1e-6, conductivity=(np.inf, np.inf), potentials=(1e3, 1.0)), Uzawa())
    assert solution.status is Status.CONVERGED
    assert solution.iterations == 0
    assert not solution.state.load.any()


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize(
    ("solver", "steps"),
    [(Uzawa(), 100), (BarzilaiBorwein(), 100), (Nesterov(), 100), (SemismoothNewton(), 20)],
    ids=str,
)
def test_loads_whose_squares_underflow(solver: Solver, steps: int) -> None:
    """Round-off that an increment without load leaves may be as small.

    Newton steps at round-off include gradient steps, which take longer.
    """
    system = half_space_system(np.diag([2.4e-12, 2.2e-12, 2e-12, -2e7, -1e3]), 5e-3, 4)
    loads = []
    for depth in (1e-5, 1e-160):
        punch = indentation_problem(system, np.zeros(16), depth, IsotropicCoulomb(0.3), translation=(depth, 0.0))
        iterate = solver.init(punch, None)
        for _ in range(steps):
            iterate = solver.step(punch, iterate)
        loads.append(iterate.load / depth)
    assert np.allclose(loads[1], loads[0], rtol=1e-9, atol=0.0)


def test_continuation_from_a_smaller_load() -> None:
    law = IsotropicCoulomb(0.3)
    first = solve(problem(4e-5, contact_law=law), Uzawa())
    second = solve(problem(5e-5, contact_law=law), Uzawa(), start=first.state)
    direct = solve(problem(5e-5, contact_law=law), Uzawa())
    assert second.status is Status.CONVERGED
    assert second.history[0, 1] < 0.5 * direct.history[0, 1]
    assert second.state.load == pytest.approx(direct.state.load, rel=1e-7, abs=1.0)


def test_residual_detects_every_kind_of_violation() -> None:
    case = problem(conductivity=(1e-5, 0.0))
    good = solve(case, Uzawa()).state
    assert residual(case, good) < 1e-9
    pressure = np.abs(good.load[:, 2]).max()

    def perturbed(array: np.ndarray, node: int, field: int, by: float) -> np.ndarray:
        other = array.copy()
        other[node, field] += by
        return other

    centre = int(np.argmin(good.load[:, 2]))
    corner = 0
    outside = good.contact_fraction.copy()
    outside[corner] = 1.0
    inside = good.contact_fraction.copy()
    inside[centre] = 0.5
    wrong = [
        replace(good, displacement=perturbed(good.displacement, centre, 2, 1e-8)),
        replace(good, displacement=perturbed(good.displacement, corner, 4, 1.0)),
        replace(good, load=perturbed(good.load, centre, 2, 1e-3 * pressure)),
        replace(good, load=perturbed(good.load, corner, 2, -1e-3 * pressure)),
        replace(good, load=perturbed(good.load, centre, 0, 1e-3 * pressure)),
        replace(good, load=perturbed(good.load, corner, 3, 1e-3 * np.abs(good.load[:, 3]).max())),
        replace(good, load=perturbed(good.load, centre, 4, 1e-6)),
        replace(good, contact_fraction=outside),
        replace(good, contact_fraction=inside),
    ]
    assert [residual(case, state) > 1e-7 for state in wrong] == [True] * len(wrong)
    assert residual(case, replace(good, load=perturbed(good.load, corner, 0, np.nan))) == np.inf


@pytest.mark.full
def test_uzawa_conformance() -> None:
    check_solver(Uzawa())


@pytest.mark.parametrize(
    ("name", "value"), [("gap", np.zeros(3)), ("gap", np.full(64, np.nan)), ("potentials", np.full((64, 2), np.inf))]
)
def test_invalid_arrays_are_named(name: str, value: np.ndarray) -> None:
    with pytest.raises(CaseError, match=name):
        replace(problem(), **{name: value})


def test_invalid_options_are_named() -> None:
    with pytest.raises(CaseError, match="step_normal"):
        Uzawa(step_normal=-1.0)
    with pytest.raises(CaseError, match="step_tangential"):
        Uzawa(step_tangential="fast")  # type: ignore[arg-type]
    with pytest.raises(CaseError, match="tolerance"):
        StoppingCriteria(tolerance=0.0)
    with pytest.raises(CaseError, match="criterion"):
        StoppingCriteria(criterion="hope")  # type: ignore[arg-type]
    with pytest.raises(CaseError, match="max_iterations"):
        StoppingCriteria(max_iterations=-1)
