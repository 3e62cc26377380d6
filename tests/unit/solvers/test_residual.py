"""The independent residual includes every node and every field, whatever a solver reports."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver, Status
from meeframe.contact.scales import problem_scales
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini
from meeframe.laws.base import ConductivityLaw, ContactLaw, StepLengths
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import ProjectedCG, SemismoothNewton, StoppingCriteria, residual, solve
from meeframe.testing.half_space import half_space_system, indentation_problem

TOLERANCE = 1e-10
WRONG = 1e-6
"""Of a characteristic magnitude."""


def problem(**options: object) -> ContactProblem:
    xi = np.diag([2.4e-12, 2.2e-12, 2e-12, -2e7, -1e3])
    xi[2, 3] = xi[3, 2] = 2e-3
    system = half_space_system(xi, 5e-3, 8)
    height = (system.points[:, 0] ** 2 + system.points[:, 1] ** 2) / 0.2
    return indentation_problem(system, height, 5e-5, **options)  # type: ignore[arg-type]


FRICTIONLESS = replace(
    problem(),
    contact_law=Signorini(),
    channels=flux_channels(Insulating(), Insulating()),
    potentials=np.zeros((64, 2)),
)
FRICTIONAL = problem(contact_law=IsotropicCoulomb(0.3))
SOLVED = {
    "frictionless": (FRICTIONLESS, solve(FRICTIONLESS, ProjectedCG()).state),
    "frictional": (FRICTIONAL, solve(FRICTIONAL, SemismoothNewton()).state),
}


@dataclass(frozen=True)
class Sure(Solver):
    """A solver that returns a given state as converged."""

    state: ContactState

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        return Iterate(self.state.load, self.state.contact_fraction, motion=self.state.motion, estimate=0.0)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        return iterate


def direct_residual(problem: ContactProblem, state: ContactState) -> float:
    """Return the residual of frictionless insulated contact, evaluated directly: min(p, gap / C) = 0 with all other
    loads zero, at each node."""
    scales = problem_scales(problem)
    worst = 0.0
    for load, displacement, gap, contact_fraction in zip(
        state.load, state.displacement, problem.gap, state.contact_fraction, strict=True
    ):
        pressure, distance = -load[2], (gap - displacement[2]) / scales.normal_compliance
        parts = [load[0], load[1], min(pressure, distance)]
        worst = max(worst, *(abs(part) / scales.pressure for part in parts))
        worst = max(worst, *(abs(load[k]) * scales.compliance[k, k] / scales.displacement[k] for k in (3, 4)))
        fraction = min(max(contact_fraction + (pressure - distance) / scales.pressure, 0.0), 1.0)
        worst = max(worst, abs(contact_fraction - fraction))
    return worst


def perturbed(problem: ContactProblem, state: ContactState, node: int, field: int, by: float) -> ContactState:
    """Return a state whose load in one field at one node is wrong by a fraction of the characteristic load, with the
    displacement that this load causes."""
    scales = problem_scales(problem)
    load = state.load.copy()
    load[node, field] += by * (
        scales.load[field] if field < 3 else scales.displacement[field] / scales.compliance[field, field]
    )
    return replace(state, load=load, displacement=problem.system.offset + problem.system.apply(load))


def node_of(state: ContactState, position: str) -> int:
    """Return the last node in contact, or the last open node."""
    return int(np.flatnonzero((state.load[:, 2] < 0.0) == (position == "closed"))[-1])


@pytest.mark.parametrize("field", range(5))
@pytest.mark.parametrize("position", ["closed", "open"])
@pytest.mark.parametrize("law", SOLVED)
def test_single_wrong_load_is_detected(law: str, position: str, field: int) -> None:
    case, state = SOLVED[law]
    assert residual(case, state) <= TOLERANCE
    wrong = perturbed(case, state, node_of(state, position), field, -WRONG)
    assert residual(case, wrong) > 100.0 * TOLERANCE
    if law == "frictionless":
        assert residual(case, wrong) == pytest.approx(direct_residual(case, wrong), rel=1e-8)
    solution = solve(case, Sure(wrong), StoppingCriteria(max_iterations=1, tolerance=TOLERANCE))
    assert solution.status is not Status.CONVERGED
    assert solution.residual == pytest.approx(residual(case, wrong), rel=1e-8)


@pytest.mark.full(except_for=9)
@pytest.mark.parametrize("part", ["load", "displacement", "contact_fraction"])
@pytest.mark.parametrize("position", ["closed", "open"])
@pytest.mark.parametrize("law", SOLVED)
def test_single_nan_is_detected(law: str, position: str, part: str) -> None:
    case, state = SOLVED[law]
    node = node_of(state, position)
    for field in range(1 if part == "contact_fraction" else 5):
        for value in (np.nan, np.inf):
            values: Array = getattr(state, part).copy()
            values.reshape(len(values), -1)[node, field] = value
            with np.errstate(invalid="ignore"):
                assert residual(case, replace(state, **{part: values})) == np.inf
            if part != "displacement":
                solution = solve(case, Sure(replace(state, **{part: values})), StoppingCriteria(max_iterations=1))
                assert solution.status is Status.DIVERGED


@pytest.mark.parametrize("field", range(5))
@pytest.mark.parametrize("position", ["closed", "open"])
@pytest.mark.parametrize("law", SOLVED)
def test_single_inconsistent_displacement_is_detected(law: str, position: str, field: int) -> None:
    case, state = SOLVED[law]
    displacement = state.displacement.copy()
    displacement[node_of(state, position), field] += WRONG * problem_scales(case).displacement[field]
    assert residual(case, replace(state, displacement=displacement)) >= 0.99 * WRONG


@pytest.mark.parametrize("position", ["closed", "open"])
@pytest.mark.parametrize("law", SOLVED)
def test_single_wrong_contact_fraction_is_detected(law: str, position: str) -> None:
    """Under pressure or across an open gap, the residual exceeds the error of the fraction."""
    case, state = SOLVED[law]
    trial = -state.load[:, 2] if position == "closed" else case.gap - state.displacement[:, 2]
    contact_fraction = state.contact_fraction.copy()
    contact_fraction[np.argmax(trial)] += -WRONG if position == "closed" else WRONG
    solution = solve(case, Sure(replace(state, contact_fraction=contact_fraction)), StoppingCriteria(max_iterations=1))
    assert solution.status is not Status.CONVERGED
    assert solution.residual >= 0.99 * WRONG


@dataclass(frozen=True)
class WithClosure(ContactLaw):
    """A frictionless law with maximum pressures (n,) [Pa] that only a closure holds."""

    least: Callable[[], Array]

    def project(self, trial: Array) -> Array:
        return Signorini().project(trial)

    def tangential_scaling(self) -> Array:
        return np.zeros((2, 2))

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        traction = self.project(trial)
        traction[:, 2] = np.maximum(traction[:, 2], self.least())
        return traction


def test_laws_with_nodal_data_are_evaluated_at_all_nodes() -> None:
    case, state = SOLVED["frictionless"]
    scales, least = problem_scales(case), np.full(len(case.gap), -np.inf)
    law = WithClosure(lambda: least)
    assert residual(replace(case, contact_law=law), state, scales) <= TOLERANCE
    node = node_of(state, "closed")
    least[node] = 0.5 * state.load[node, 2]
    expected = -least[node] / scales.pressure
    assert residual(replace(case, contact_law=law), state, scales) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("position", ["closed", "open"])
def test_single_wrong_load_is_detected_among_many(position: str) -> None:
    """The load is wrong at the last closed or open node, for laws evaluated at some nodes at a time, or at all."""
    n = 130
    mesh = half_space_mesh(0.05, 5e-3, n - 1, 1, Quad4())
    body = Body(library_material("batio3-cofe2o4").stiffness, mesh, (), "contact")
    system = HalfSpace(matrix_up_to=0).reduce(body)
    height = ((system.points[:, :2] - system.points[-1, :2]) ** 2).sum(axis=1) / 0.2
    case = indentation_problem(system, height, 1e-5)
    state = solve(case, ProjectedCG()).state
    assert residual(case, state) <= TOLERANCE
    node = node_of(state, position)
    assert node > n**2 - 400
    wrong = perturbed(case, state, node, 2, -100.0 * WRONG)
    computed = residual(case, wrong)
    assert computed > 100.0 * TOLERANCE
    unbounded = np.full(n**2, -np.inf)
    assert residual(replace(case, contact_law=WithClosure(lambda: unbounded)), wrong) == pytest.approx(
        computed, rel=1e-8
    )


def test_underflowing_coupling_is_zero() -> None:
    xi = np.diag([2.4e-12, 2.2e-12, 2e-12, -2e7, -1e3])
    xi[2, 3] = xi[3, 2] = 1e-320
    system = half_space_system(xi, 5e-3, 8)
    hardly = indentation_problem(system, (system.points[:, :2] ** 2).sum(axis=1) / 0.2, 5e-5)
    assert solve(hardly, ProjectedCG()).status is Status.CONVERGED


@dataclass(frozen=True)
class Undefined(ConductivityLaw):
    """A law that returns NaN at pressures above `most` [Pa]."""

    most: float

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        return np.where(normal_traction < -self.most, np.nan, 1e-6 * (normal_traction < 0.0))


@pytest.mark.full(except_for=1)
def test_law_is_violated_where_it_returns_nan() -> None:
    """The iteration may nevertheless continue from there: larger pressures occur on the way to solutions."""
    pressed = replace(FRICTIONAL.with_laws(electric=Undefined(1.0)), potentials=np.full((64, 2), [1.0, 0.0]))
    state = SOLVED["frictional"][1]
    assert 1.0 <= residual(pressed, state) < np.inf
    defined, criteria = pressed.with_laws(electric=Undefined(1e12)), StoppingCriteria(max_iterations=5)
    assert solve(pressed, SemismoothNewton(), criteria).status is not Status.CONVERGED
    assert solve(defined, SemismoothNewton(), criteria).status is Status.CONVERGED
    assert np.isfinite(residual(defined, state))
