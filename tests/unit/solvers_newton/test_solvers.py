"""All solvers agree on the same problems; cost, invariance and status are as documented."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.contact.channels import flux_channels
from meeframe.contact.conduction import potential_diagonal
from meeframe.contact.problem import ContactProblem, Iterate, Solver, Status, resultant
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import contact_conductivity
from meeframe.material import library_material
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
from meeframe.system.dense import DenseSystem
from meeframe.testing.contact import check_solver
from meeframe.testing.contact_cases import SphereCase
from meeframe.testing.force_control import released

FRICTIONAL = [SemismoothNewton(), BarzilaiBorwein(), Nesterov(), Auto()]
ALL = [*FRICTIONAL, ProjectedCG()]
CG = Signorini(), (0.0, 0.0)
"""Law and conductivities that conjugate gradients accept."""
CONDITIONS = {"EMII": (0.0, 0.0), "ECMII": (np.inf, 0.0), "EIMCI": (0.0, np.inf), "EMCI": (np.inf, np.inf)}


def name(value) -> str:
    return type(value).__name__ if isinstance(value, Solver) else str(value)


def force(problem, solver, start=None):
    solution = solve(problem, solver, start=start)
    assert solution.status is Status.CONVERGED, f"{name(solver)}: {solution.message}"
    assert residual(problem, solution.state) <= 1e-10
    return resultant(problem.system, solution.state.load)[0], solution


def assert_agree(problem, solvers, tolerance=1e-8):
    """Assert that forces agree with those of Uzawa's method. Under a law that jumps, a node at the edge may have two
    states that are both solutions; from a nearby start, all solvers must then find the same one."""
    reference, solution = force(problem, Uzawa())
    state = solution.state
    for solver in solvers:
        got, other = force(problem, solver)
        differ = np.abs(other.state.contact_fraction - state.contact_fraction) > 0.5
        if differ.any():
            assert not is_insulated(problem), name(solver)
            assert differ.sum() <= 4, name(solver)
            got, _ = force(problem, solver, start=replace(state, load=1.0001 * state.load))
        assert np.linalg.norm(got - reference) <= tolerance * np.linalg.norm(reference), name(solver)


def _rescaled(law, factor):
    return StepConductivity(law.kappa * factor) if isinstance(law, StepConductivity) else law


def is_insulated(problem):
    return all(law == Insulating() for law in (channel.law for channel in problem.channels))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize(
    ("material", "law"),
    [
        ("transverse", Signorini()),
        ("orthotropic", IsotropicCoulomb(0.6)),
        ("transverse", IsotropicCoulomb(5.0)),
        ("orthotropic", OrthotropicCoulomb(0.06, 0.6, 0.3)),
    ],
    ids=str,
)
def test_solvers_agree(sphere, condition, material, law) -> None:
    assert_agree(
        sphere(material, law, CONDITIONS[condition], cells=12),
        ALL if (condition, law) == ("EMII", Signorini()) else FRICTIONAL,
    )


@pytest.mark.full
@pytest.mark.parametrize("kappa", [1e-3, 1e-2, 1e2])
def test_solvers_agree_at_finite_conductivity(sphere, kappa) -> None:
    assert_agree(sphere("orthotropic", IsotropicCoulomb(0.3), (kappa, kappa), cells=12), FRICTIONAL)
    assert_agree(sphere("orthotropic", Signorini(), (kappa, kappa), cells=12), FRICTIONAL)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("exponent", [0.5, 0.95, 2.0])
@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(0.6)], ids=str)
def test_solvers_agree_where_conductivity_grows_with_pressure(sphere, growing, law, exponent) -> None:
    problem = sphere("orthotropic", law, cells=8)
    compliance = np.abs(np.diag(problem.system.diagonal_blocks()[0]))[3:]
    electric, magnetic = (growing(1.0 / o, 1e7, exponent) for o in compliance)
    problem = replace(problem, channels=flux_channels(electric, magnetic))
    _, newton = force(problem, SemismoothNewton())
    conductance = contact_conductivity(electric, newton.state.load[:, 2]) * compliance[0]
    assert 0.1 < conductance.max() < 100.0
    expected, _ = force(problem, Uzawa())
    for solver in FRICTIONAL:
        got, _ = force(problem, solver)
        assert np.linalg.norm(got - expected) <= 1e-8 * np.linalg.norm(expected), name(solver)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(0.3)], ids=str)
def test_every_solver_finds_the_biactive_nodes(sphere, law) -> None:
    """Edge nodes would open and close for ever; some are biactive, and all solvers agree."""
    problem = sphere("orthotropic", law, (0.0, 0.209))
    x, y, _ = problem.system.points.T
    gap = ((x - 2.2e-4) ** 2 + (y + 1.1e-4) ** 2) / 0.2 - 4.1e-5
    problem = replace(problem, gap=gap)
    solutions = [force(problem, solver)[1] for solver in (*FRICTIONAL, Uzawa())]
    contact_fraction = solutions[0].state.contact_fraction
    assert ((contact_fraction > 1e-6) & (contact_fraction < 1.0 - 1e-6)).any()
    for solution in solutions[1:]:
        np.testing.assert_allclose(solution.state.contact_fraction, contact_fraction, atol=1e-6)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("solver", ALL, ids=name)
@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_solutions_do_not_depend_on_units(sphere, solver, scale) -> None:
    """Lengths, stresses and potentials are in other units, and fluxes such that work is unchanged."""
    law, kappa = CG if solver == ProjectedCG() else (IsotropicCoulomb(0.6), (0.3, np.inf))
    problem = sphere("orthotropic", law, kappa, cells=8)
    expected, reference = force(problem, solver)
    for length, stress, electric, magnetic in (scale, 1, 1, 1), (1, scale, 1, 1), (1, 1, scale, 1), (1, 1, 1, scale):
        moved = np.array([length, length, length, electric, magnetic])
        loads = np.array([stress] * 3 + [length * stress / electric, length * stress / magnetic])
        system = problem.system
        scaled = DenseSystem(
            system.points * length,
            system.frames,
            system.weights * length**2,
            (),
            system.offset * moved,
            system.matrix * moved[:, None, None] / loads,
            system.recovery,
        )
        other = ContactProblem(
            scaled,
            law,
            problem.with_laws(electric=_rescaled(problem.law_of("electric"), loads[3] / electric)).channels,
            problem.gap * length,
            problem.translation * length,
            problem.potentials * [electric, magnetic],
        )
        got, solution = force(other, solver)
        np.testing.assert_allclose(got / (stress * length**2), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
        # round-off may change the number of evaluations by one
        assert abs(solution.iterations - reference.iterations) <= (
            1 if solver.check_interval == 1 else solver.check_interval
        )


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("solver", ALL, ids=name)
def test_matrix_free_systems(sphere, matrixless, solver) -> None:
    law, kappa = CG if solver == ProjectedCG() else (IsotropicCoulomb(0.6), (np.inf, 0.3))
    problem = sphere("orthotropic", law, kappa, cells=8)
    expected, _ = force(problem, solver)
    got, _ = force(replace(problem, system=matrixless(problem.system)), solver)
    np.testing.assert_allclose(got, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", ALL, ids=name)
def test_start_from_converged_state(sphere, solver) -> None:
    law, kappa = CG if solver == ProjectedCG() else (IsotropicCoulomb(0.6), (0.3, 0.0))
    problem = sphere("orthotropic", law, kappa, cells=8)
    _, solution = force(problem, solver)
    again = solve(problem, solver, start=solution.state)
    assert (again.status, again.iterations) == (Status.CONVERGED, 0)
    # a further load step gives the same solution as a start from zero
    deeper = replace(problem, gap=problem.gap - 5e-6)
    expected, _ = force(deeper, solver)
    onward = solve(deeper, solver, start=solution.state)
    assert onward.status is Status.CONVERGED
    got = resultant(problem.system, onward.state.load)[0]
    np.testing.assert_allclose(got, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


def test_no_contact_converges_at_once(sphere) -> None:
    problem = sphere("orthotropic", Signorini(), cells=8)
    separated = replace(problem, gap=problem.gap + 1e-4)
    for solver in ALL:
        _, solution = force(separated, solver)
        assert not solution.state.load.any(), name(solver)


def test_conjugate_gradients_without_indenter_above_nodes(sphere) -> None:
    problem = sphere("orthotropic", Signorini(), cells=8)
    hole = np.hypot(*problem.system.points[:, :2].T) < 1e-3
    assert_agree(replace(problem, gap=np.where(hole, np.inf, problem.gap)), ALL)


def test_conjugate_gradients_reject_conduction(sphere) -> None:
    with pytest.raises(CaseError, match=r"projected-cg.*insulating contact only.*newton"):
        ProjectedCG().init(sphere("transverse", Signorini(), (0.0, 1.0), cells=8), None)


@pytest.mark.parametrize("law", [IsotropicCoulomb(0.1), OrthotropicCoulomb(0.0, 0.2)], ids=str)
def test_conjugate_gradients_reject_friction(sphere, law) -> None:
    with pytest.raises(CaseError, match=r"projected-cg.*frictionless.*Coulomb.*newton"):
        ProjectedCG().init(sphere("transverse", law, cells=8), None)


def test_conjugate_gradients_accept_zero_friction(sphere) -> None:
    expected, _ = force(sphere("transverse", Signorini(), cells=8), ProjectedCG())
    got, _ = force(sphere("transverse", IsotropicCoulomb(0.0), cells=8), ProjectedCG())
    np.testing.assert_allclose(got, expected, rtol=1e-10)


def test_conjugate_gradients_with_asymmetric_compliance(sphere) -> None:
    """Collocation gives slightly asymmetric compliances."""
    problem = sphere("transverse", Signorini())
    noise = np.random.default_rng(0).normal(size=problem.system.matrix.shape)
    system = replace(problem.system, matrix=problem.system.matrix * (1.0 + 0.02 * noise))
    assert_agree(replace(problem, system=system), [ProjectedCG()])


@pytest.mark.full
def test_auto_escapes_a_nearly_converged_state() -> None:
    """Newton's method keeps returning to a node that is nearly closed (residual 3e-5), and Uzawa's method stays
    there."""
    law, potentials = OrthotropicCoulomb(5.0, 5.0, 2.7496612910953973), (6803.1263585648885, 38.07439080011234)
    plain = SphereCase(
        library_material("orthotropic-mee"), law, Insulating(), Insulating(), 10, 5.0, 2.3841492026488798
    )
    compliance = potential_diagonal(plain.problem())[0, 1]
    magnetic = StepConductivity(float(0.0003501238946480535 / compliance))
    dragged = replace(plain, electric=StepConductivity(np.inf), magnetic=magnetic, potentials=potentials).problem()
    expected = solve(dragged, Nesterov())
    assert expected.status is Status.CONVERGED
    free, motion = released(dragged, expected.state, "approach", "translation")
    solution = solve(free, Auto())
    assert solution.status is Status.CONVERGED, solution.message
    np.testing.assert_allclose(solution.state.motion, motion, rtol=1e-6)


@pytest.mark.full
@pytest.mark.parametrize("solver", FRICTIONAL, ids=name)
def test_conformance(solver) -> None:
    check_solver(solver)


@pytest.mark.parametrize("solver", ALL, ids=name)
def test_iterates_of_other_solvers_are_rejected(sphere, solver) -> None:
    problem = sphere("transverse", Signorini(), cells=8)
    with pytest.raises(TypeError, match="was not made by"):
        solver.step(problem, Iterate(np.zeros((64, 5)), np.zeros(64)))


def test_solution_without_contact_for_every_criterion(sphere) -> None:
    """Newton's method must make a step although no law is violated."""
    problem = sphere("transverse", IsotropicCoulomb(0.3))
    separated = replace(problem, gap=problem.gap - problem.gap.min() + 1e-3)
    solution = solve(separated, SemismoothNewton(), StoppingCriteria(1e-6, criterion="paper"))
    assert solution.status is Status.CONVERGED, solution.message
    assert solution.residual == 0.0
