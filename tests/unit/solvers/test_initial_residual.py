"""The driver does not evaluate the initial residual if the solver's estimate is far from convergence."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver, Status
from meeframe.elements import Quad4
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import Auto, ProjectedCG, SemismoothNewton, StoppingCriteria, Uzawa, residual, solve
from meeframe.testing.half_space import half_space_system, indentation_problem
from meeframe.testing.operation_counter import OperationCounter

TOLERANCE = 1e-8
LIMITS = StoppingCriteria(TOLERANCE)


@pytest.fixture
def problem() -> ContactProblem:
    """Return a sphere on a few cells, whose products are counted."""
    system = half_space_system(np.diag([2.4e-12, 2.2e-12, 2e-12, -2e7, -1e3]), 5e-3, 8)
    height = (system.points[:, :2] ** 2).sum(axis=1) / 0.2
    return indentation_problem(OperationCounter.of(system), height, 5e-5)


@pytest.fixture
def solution(problem: ContactProblem) -> ContactState:
    state = solve(problem, Uzawa(), StoppingCriteria(1e-10)).state
    products(problem).clear()
    return state


def products(problem: ContactProblem) -> list[None]:
    assert isinstance(problem.system, OperationCounter)
    return problem.system.products


@dataclass(frozen=True, eq=False)
class Estimating(Solver):
    """A solver without products. `estimates` are those of the start and after each step; `found` is the state after
    the last step, `unloaded` before, or the same if `still`; `before` counts products at the beginning of steps;
    `aims` are the tolerances received."""

    found: ContactState
    estimates: tuple[float | None, ...]
    still: bool = False
    before: list[int] = field(default_factory=list)
    aims: list[float] = field(default_factory=list)

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        self.aims.append(tolerance)
        return self._at(0)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        self.before.append(len(products(problem)))
        assert isinstance(iterate.memory, int)
        return self._at(iterate.memory + 1)

    def _at(self, step: int) -> Iterate:
        last = len(self.estimates) - 1
        share = float(step >= last or self.still)
        return Iterate(
            share * self.found.load, share * self.found.contact_fraction, step, estimate=self.estimates[min(step, last)]
        )


def unloaded(problem: ContactProblem, solution: ContactState) -> float:
    """Return the residual without load."""
    return residual(
        problem, ContactState(*(0.0 * part for part in (solution.load, solution.load, solution.contact_fraction)))
    )


@pytest.mark.parametrize("estimate", [2.0 * TOLERANCE, 0.7, 1e30])
def test_initial_estimate_saves_a_product(problem, solution, estimate: float) -> None:
    """The history contains the estimate instead, and progress starts from it."""
    fractions: list[float] = []
    solver = Estimating(solution, (estimate, 0.5 * TOLERANCE))
    computed = solve(problem, solver, LIMITS, progress=lambda _, fraction: fractions.append(fraction))
    assert solver.before == [0]
    assert len(products(problem)) == 1  # the independent residual
    assert computed.status is Status.CONVERGED
    assert computed.iterations == 1
    assert computed.residual == pytest.approx(residual(problem, solution), abs=1e-14)
    np.testing.assert_array_equal(computed.history, [[0, estimate], [1, computed.residual]])
    assert fractions == [1.0]


@pytest.mark.parametrize("estimate", [None, np.nan, np.inf, -np.inf, TOLERANCE, 0.0])
def test_other_initial_states_are_evaluated(problem, solution, estimate: float | None) -> None:
    """The residual is evaluated for possible solutions and without an estimate."""
    expected = unloaded(problem, solution)
    products(problem).clear()
    solver = Estimating(solution, (estimate, 0.0))
    computed = solve(problem, solver, LIMITS)
    assert solver.before[0] > 0
    assert computed.status is Status.CONVERGED
    assert computed.iterations == 1
    assert expected > 0.1
    assert computed.history[0] == pytest.approx([0, expected])


@pytest.mark.parametrize("estimate", [None, 0.1 * TOLERANCE])
def test_initial_state_may_be_the_solution(problem, solution, estimate: float | None) -> None:
    solver = Estimating(solution, (estimate,), still=True)
    computed = solve(problem, solver, LIMITS)
    assert computed.status is Status.CONVERGED
    assert computed.iterations == 0
    assert not solver.before
    assert computed.residual == pytest.approx(residual(problem, solution), abs=1e-14)
    np.testing.assert_array_equal(computed.history, [[0, computed.residual]])
    np.testing.assert_array_equal(computed.state.load, solution.load)


def test_solution_with_pessimistic_estimate(problem, solution) -> None:
    computed = solve(problem, Estimating(solution, (0.5, 0.0), still=True), LIMITS)
    assert (computed.status, computed.iterations) == (Status.CONVERGED, 1)


def test_iterations_that_end_between_checks_are_evaluated(problem, solution) -> None:
    """At the iteration limit, the laws determine the status and not the estimate."""
    estimates = (0.7, *np.full(9, 0.5), 0.0)
    computed = solve(problem, Estimating(solution, estimates), replace(LIMITS, max_iterations=4))
    assert (computed.status, computed.iterations) == (Status.ITERATION_LIMIT, 4)
    assert computed.residual == pytest.approx(unloaded(problem, solution))
    assert computed.history == pytest.approx(np.array([[0, 0.7], [4, computed.residual]]))


@pytest.mark.parametrize("estimate", [None, 0.5, 0.0])
def test_criterion_of_the_paper_evaluates_each_state(problem, solution, estimate: float | None) -> None:
    """The first change is that of the first step; solvers receive the default tolerance."""
    solver = Estimating(solution, (estimate, estimate))
    computed = solve(problem, solver, StoppingCriteria(1e-6, criterion="paper"))
    assert solver.before[0] == 1
    assert computed.status is Status.CONVERGED
    np.testing.assert_array_equal(computed.history[:, 0], [1, 2])
    pressures = np.linalg.norm(solution.load[:, :3]) / 1e9
    assert computed.history[:, 1] == pytest.approx([pressures, 0.0])
    assert solver.aims == [StoppingCriteria().tolerance]


def test_solvers_receive_the_tolerance_once(problem, solution) -> None:
    solver = Estimating(solution, (0.7, 0.5, 0.0))
    solve(problem, solver, LIMITS)
    assert solver.aims == [TOLERANCE]


@dataclass(frozen=True, eq=False)
class Watched(Solver):
    """Another solver; `between` records the products after its start and before its steps."""

    solver: Solver
    between: list[int] = field(default_factory=list)

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        iterate = self.solver.init(problem, start, tolerance)
        self.between.append(len(products(problem)))
        return iterate

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        self.between.append(len(products(problem)))
        return self.solver.step(problem, iterate)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("solver", "law"),
    [(SemismoothNewton(), IsotropicCoulomb(0.3)), (Auto(), IsotropicCoulomb(0.3)), (ProjectedCG(), Signorini())],
    ids=["newton", "auto", "projected-cg"],
)
def test_solvers_with_estimates(solver: Solver, law: ContactLaw) -> None:
    """Without a matrix, from zero load and from a smaller approach; the independent residual decides about
    convergence."""
    mesh = half_space_mesh(0.05, 5e-3, 31, 1, Quad4())
    body = Body(library_material("orthotropic-mee").stiffness, mesh, (), "contact")
    system = OperationCounter.of(HalfSpace(matrix_up_to=0).reduce(body))
    height = (system.points[:, :2] ** 2).sum(axis=1) / 0.2
    less, more = (indentation_problem(system, height, approach, law) for approach in (2e-5, 3e-5))
    for start in (None, solve(less, solver, LIMITS).state):
        watched, estimate = Watched(solver), solver.init(more, start).estimate
        computed = solve(more, watched, LIMITS, start)
        assert computed.status is Status.CONVERGED, computed.message
        assert watched.between[0] == watched.between[1]
        assert estimate is not None
        assert computed.history[0] == pytest.approx([0, estimate], rel=1e-12)
        assert computed.residual == pytest.approx(residual(more, computed.state), abs=1e-14)
        assert computed.residual <= TOLERANCE
