"""Test Newton's method and `auto` without a stored matrix: cost, and the solver that starts."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, PrescribedResultant, Solver, Status
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.material import Material, library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import (
    Auto,
    BarzilaiBorwein,
    Nesterov,
    ProjectedCG,
    SemismoothNewton,
    StoppingCriteria,
    residual,
    solve,
)
from meeframe.solvers.newton.linear import _krylov_step, coupled_rows, decoupled_rows, newton_step
from meeframe.solvers.newton.residual import ContactResidual
from meeframe.testing.force_control import PRESS, SLIDE, SLIDE_2, prescribe_resultant
from meeframe.testing.half_space import indentation_problem
from meeframe.testing.operation_counter import OperationCounter

WIDTH, RADIUS, FORCE, MU = 7e-3, 0.1, 450.0, 0.3


def dragged(n: int, law: ContactLaw, flux: ConductivityLaw, force: float = FORCE) -> ContactProblem:
    """Return a problem of a sphere on the orthotropic medium under a force and half of the tangential force that
    friction can carry."""
    mesh = half_space_mesh(10.0 * WIDTH, WIDTH * (n - 1) / n, n - 1, 1, Quad4())
    system = HalfSpace(matrix_up_to=0).reduce(Body(library_material("orthotropic-mee").stiffness, mesh, (), "contact"))
    x, y, _ = system.points.T
    prescribed_resultants = [prescribe_resultant(system, PRESS, force)]
    if law.tangential_scaling().any():
        prescribed_resultants += [
            prescribe_resultant(system, SLIDE, 0.5 * MU * force),
            prescribe_resultant(system, SLIDE_2, 0.0),
        ]
    none = np.zeros((len(x), 2))
    gap = (x**2 + y**2) / (2.0 * RADIUS)
    return ContactProblem(
        OperationCounter.of(system), law, flux_channels(flux, flux), gap, none, none, tuple(prescribed_resultants)
    )


def products(problem: ContactProblem) -> int:
    """Return the number of products of a solution."""
    system = problem.system
    assert isinstance(system, OperationCounter)
    return len(system.products)


def test_cost_of_biactive_nodes() -> None:
    """Perfect conductors have biactive edge nodes; insulating contact has none and takes no fewer products."""
    conducting, insulated = (
        dragged(64, IsotropicCoulomb(MU), flux) for flux in (StepConductivity(np.inf), Insulating())
    )
    solution = solve(conducting, SemismoothNewton())
    assert solution.status is Status.CONVERGED, solution.message
    contact_fraction = solution.state.contact_fraction
    assert ((contact_fraction > 0.0) & (contact_fraction < 1.0)).any()
    spent = products(conducting)
    assert residual(conducting, solution.state) <= 1e-10
    assert solve(insulated, SemismoothNewton()).status is Status.CONVERGED
    assert spent <= 2 * products(insulated)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-9])
def test_inexact_steps_meet_their_tolerance(tolerance: float) -> None:
    """The equations in double precision check steps in single and double precision."""
    problem = dragged(32, IsotropicCoulomb(MU), StepConductivity(np.inf))
    near = solve(problem, SemismoothNewton(), StoppingCriteria(1e-2)).state
    equation = ContactResidual.of(problem)
    blocks = equation.at(near.load, near.contact_fraction, np.zeros(32**2, bool), near.motion).linearise()
    step = newton_step(equation, blocks, tolerance)
    moved = problem.system.apply(step.local[:, :5]) - equation.modes @ (step.motion / equation.units)
    product = np.einsum("nij,nj->ni", blocks.a.dense(6), step.local) + np.einsum("nij,nj->ni", blocks.b.dense(5), moved)
    totals = np.einsum("kni,ni->k", equation.measures, step.local[:, :5])

    def size(rows: Array, balance: Array) -> float:
        return float(np.hypot(np.linalg.norm(rows), 32.0 * np.linalg.norm(balance)))

    left = size(blocks.residual + product, blocks.balance + totals)
    assert left <= 1.01 * tolerance * size(blocks.residual, blocks.balance)
    assert left > 1e-3 * tolerance * size(blocks.residual, blocks.balance)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-9])
def test_linearly_dependent_motions(tolerance: float) -> None:
    """A fourth motion is a combination of three others, so nothing resists their difference, up to round-off."""
    problem = dragged(32, IsotropicCoulomb(MU), StepConductivity(np.inf))
    near = solve(problem, SemismoothNewton(), StoppingCriteria(1e-2)).state
    three = ContactResidual.of(problem)
    point = three.at(near.load, near.contact_fraction, np.zeros(32**2, bool), near.motion)
    mixed = np.column_stack([np.eye(3), [0.3, 0.7, -0.2]])
    resultants = [
        PrescribedResultant(
            three.modes @ amounts,
            np.tensordot(amounts, three.measures, axes=1) / problem.system.weights[:, None],
            problem.system.weights,
            0.0,
        )
        for amounts in mixed.T
    ]
    four = replace(
        three,
        problem=replace(problem, prescribed_resultants=tuple(resultants)),
        scales=replace(three.scales, totals=np.ones(4)),
        units=np.ones(4),
    )
    blocks = point.linearise()
    coupled = coupled_rows(blocks)
    given = decoupled_rows(blocks, coupled)
    local, amounts = _krylov_step(three, blocks, coupled, given, tolerance)()
    same, more = _krylov_step(four, replace(blocks, balance=mixed.T @ blocks.balance), coupled, given, tolerance)()
    assert np.abs(more).max() <= 2.0 * np.abs(amounts).max()
    np.testing.assert_allclose(mixed @ more, amounts, atol=2.0 * tolerance * np.abs(amounts).max())
    np.testing.assert_allclose(same, local, atol=2.0 * tolerance * np.abs(local[:, :5]).max())


@final
@dataclass(frozen=True)
class SteadySlip(ContactLaw):
    """Friction that is proportional to the pressure along e1, independently of the gap."""

    def project(self, trial: Array) -> Array:
        pressed = np.minimum(trial[:, 2], 0.0)
        return np.column_stack([MU * pressed, np.zeros_like(pressed), pressed])

    def tangential_scaling(self) -> Array:
        return np.zeros((2, 2))


def test_friction_that_does_not_depend_on_the_gap_is_coupled() -> None:
    mesh = half_space_mesh(10.0 * WIDTH, WIDTH, 15, 1, Quad4())
    body = Body(library_material("orthotropic-mee").stiffness, mesh, (), "contact")
    loads = []
    for nodes in (0, 256):
        system = HalfSpace(matrix_up_to=nodes).reduce(body)
        assert (system.dense() is None) == (nodes == 0)
        height = (system.points[:, :2] ** 2).sum(axis=1) / (2.0 * RADIUS)
        solution = solve(
            indentation_problem(system, height, (0.3 * WIDTH) ** 2 / RADIUS, SteadySlip()), SemismoothNewton()
        )
        assert solution.status is Status.CONVERGED, solution.message
        loads.append(solution.state.load)
    assert loads[0][:, 0].any()
    np.testing.assert_allclose(*loads, atol=1e-8 * np.abs(loads[1]).max())


@pytest.mark.parametrize("solver", [BarzilaiBorwein(), Auto()])
def test_convergence_of_uncoupled_conducting_contact(solver: Solver) -> None:
    """Tractions in single precision, instead of their changes, would leave a residual of 1e-7."""
    mesh = half_space_mesh(10.0 * WIDTH, WIDTH, 23, 1, Quad4())
    system = HalfSpace(matrix_up_to=0).reduce(Body(Material.isotropic(2e11, 0.3).stiffness, mesh, (), "contact"))
    height = (system.points[:, :2] ** 2).sum(axis=1) / (2.0 * RADIUS)
    approach = (0.3 * WIDTH) ** 2 / RADIUS
    problem = indentation_problem(system, height, approach, conductivity=(np.inf, 0.0), potentials=(1.0, 0.0))
    solution = solve(problem, solver, StoppingCriteria(1e-10))
    assert solution.status is Status.CONVERGED, solution.message
    assert residual(problem, solution.state) <= 1e-10


def test_auto_selects_conjugate_gradients_without_friction() -> None:
    pressed = dragged(32, Signorini(), Insulating())
    expected = solve(pressed, ProjectedCG(), StoppingCriteria(1e-12)).state.load
    spent = {}
    for solver in (ProjectedCG(), Auto(), SemismoothNewton()):
        counting = replace(pressed, system=OperationCounter.of(pressed.system))
        solution = solve(counting, solver)
        assert solution.status is Status.CONVERGED, solution.message
        spent[type(solver)] = products(counting)
        np.testing.assert_allclose(solution.state.load, expected, atol=1e-9 * np.abs(expected).max())
    assert spent[Auto] < spent[SemismoothNewton]
    rubbed = dragged(32, IsotropicCoulomb(MU), Insulating())
    by_newton, by_auto = (solve(rubbed, solver) for solver in (SemismoothNewton(), Auto()))
    np.testing.assert_array_equal(by_auto.state.load, by_newton.state.load)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("kappa", [1e-5, np.inf])
def test_auto_selects_newton_with_conduction(kappa: float) -> None:
    """Results are bitwise those of `newton` and agree with gradient steps; one conducting potential suffices."""
    problem = dragged(32, Signorini(), Insulating()).with_laws(magnetic=StepConductivity(kappa))
    by_newton, by_auto, by_gradients = (solve(problem, solver) for solver in (SemismoothNewton(), Auto(), Nesterov()))
    assert by_auto.status is Status.CONVERGED, by_auto.message
    np.testing.assert_array_equal(by_auto.state.load, by_newton.state.load)
    largest = np.abs(by_gradients.state.load).max(axis=0)
    assert (np.abs(by_auto.state.load - by_gradients.state.load) <= 1e-8 * largest).all()


@pytest.mark.full
@pytest.mark.parametrize("exponent", [0.5, 0.95])
def test_conductivities_with_infinite_slope_at_zero_pressure(growing, exponent: float) -> None:
    """A Newton step from zero with the slope at zero pressure would be useless."""
    problem = dragged(32, Signorini(), Insulating())
    compliance = problem.system.diagonal_blocks()[0, [3, 4], [3, 4]]
    laws = [growing(100.0 / float(one), 5e8, exponent) for one in compliance]
    given = np.tile([5.0, 1.0], (32**2, 1))
    problem = replace(problem, channels=flux_channels(laws[0], laws[1]), potentials=given)
    expected = solve(problem, Nesterov())
    assert expected.status is Status.CONVERGED, expected.message
    solution = solve(problem, SemismoothNewton())
    assert solution.status is Status.CONVERGED, solution.message
    largest = np.abs(expected.state.load).max(axis=0)
    assert (np.abs(solution.state.load - expected.state.load) <= 1e-8 * largest).all()


@pytest.mark.parametrize("flux", [Insulating(), StepConductivity(np.inf)], ids=["insulated", "conducting"])
@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(MU)], ids=["smooth", "rough"])
def test_contact_that_opens_completely(law: ContactLaw, flux: ConductivityLaw) -> None:
    """From a state with load, all nodes open and no equation remains."""
    free = dragged(16, law, flux)
    near = ContactProblem(
        free.system, law, flux_channels(flux, flux), free.gap - 1e-5, free.translation, free.potentials
    )
    pressed = solve(near, SemismoothNewton())
    assert pressed.state.load[:, 2].any()
    for lift in (1e-4, 1e-2):
        solution = solve(replace(near, gap=near.gap + lift), SemismoothNewton(), start=pressed.state)
        assert solution.status is Status.CONVERGED, solution.message
        assert (np.abs(solution.state.load).max(axis=0) <= 1e-12 * np.abs(pressed.state.load).max(axis=0)).all()


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("solver", [SemismoothNewton(), Auto()])
@pytest.mark.parametrize(("n", "limits"), [(64, StoppingCriteria()), (24, StoppingCriteria(1e-6, criterion="paper"))])
@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(MU)], ids=["smooth", "rough"])
def test_zero_force(law: ContactLaw, n: int, limits: StoppingCriteria, solver: Solver) -> None:
    """No law is violated initially, on the coarser grid, either."""
    solution = solve(dragged(n, law, Insulating(), 0.0), solver, limits)
    assert solution.status is Status.CONVERGED, solution.message
    assert solution.residual == 0.0
    assert not solution.state.load.any()


@final
@dataclass(frozen=True)
class NanTangent(ContactLaw):
    """A law whose derivative is NaN at the nodes under the highest pressure."""

    whole: ContactLaw

    def project(self, trial: Array) -> Array:
        return self.whole.project(trial)

    def tangential_scaling(self) -> Array:
        return self.whole.tangential_scaling()

    def tangent(self, trial: Array) -> Array:
        tangent = self.whole.tangent(trial)
        tangent[np.argsort(trial[:, 2])[:3]] = np.nan
        return tangent


def test_nan_tangents_lead_to_gradient_steps() -> None:
    given = dragged(16, Signorini(), Insulating())
    expected = solve(given, SemismoothNewton()).state.load
    solution = solve(replace(given, contact_law=NanTangent(Signorini())), SemismoothNewton(), StoppingCriteria(1e-8))
    assert solution.status is Status.CONVERGED, solution.message
    np.testing.assert_allclose(solution.state.load, expected, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(MU)], ids=["smooth", "rough"])
@pytest.mark.parametrize("free", [False, True], ids=["fixed", "free"])
def test_no_newton_step_from_nan_tangents(law: ContactLaw, free: bool) -> None:
    """A zero step would be mistaken for convergence."""
    problem = replace(dragged(16, NanTangent(law), Insulating()), gap=np.full(256, -1e-5))
    problem = problem if free else replace(problem, prescribed_resultants=())
    equation = ContactResidual.of(problem)
    motion, contact_fraction = np.zeros(len(problem.prescribed_resultants)), np.ones(256)
    blocks = equation.at(np.zeros((256, 5)), contact_fraction, np.zeros(256, bool), motion).linearise()
    assert not newton_step(equation, blocks).finite
