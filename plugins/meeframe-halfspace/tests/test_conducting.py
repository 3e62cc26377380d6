"""Test frictionless conducting contact, with and without biactive nodes at the contact edge."""

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

import meeframe
from meeframe.contact.problem import Solver, Status
from meeframe.elements import Quad4
from meeframe.laws import Signorini
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import BarzilaiBorwein, Nesterov, SemismoothNewton, StoppingCriteria, solve
from meeframe.testing.half_space import indentation_problem
from meeframe.testing.operation_counter import OperationCounter

WIDTH, RADIUS, CONTACT = 1e-2, 0.1, 3e-3


def sphere(n: int, kappa: float, potentials: tuple[float, float] = (0.0, 0.0), material: str = "batio3-cofe2o4"):
    mesh = half_space_mesh(4.0 * WIDTH, WIDTH, n - 1, 1, Quad4())
    body = Body(library_material(material).stiffness, mesh, (), "contact")
    system = OperationCounter.of(HalfSpace("constant", matrix_up_to=0).reduce(body))
    height = (system.points[:, :2] ** 2).sum(axis=1) / (2.0 * RADIUS)
    return indentation_problem(system, height, CONTACT**2 / RADIUS, Signorini(), (kappa, kappa), potentials)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("n", "potentials"), [(128, (5.0, 1.0)), (80, (50.0, 5.0))])
def test_many_biactive_nodes(n: int, potentials: tuple[float, float]):
    solution = solve(
        sphere(n, np.inf, potentials, "orthotropic-mee"), SemismoothNewton(), StoppingCriteria(tolerance=1e-8)
    )
    assert solution.status is Status.CONVERGED
    assert ((solution.state.contact_fraction > 0.0) & (solution.state.contact_fraction < 1.0)).sum() >= 20


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("kappa", "potentials", "material", "has_biactive"),
    [
        (np.inf, (2.0, 0.5), "batio3-cofe2o4", False),
        (1e-5, (2e4, 0.0), "batio3-cofe2o4", True),
        (np.inf, (2e4, 0.0), "batio3-cofe2o4", True),
        (np.inf, (50.0, 5.0), "orthotropic-mee", True),
    ],
)
def test_solvers_agree(kappa, potentials, material, has_biactive):
    """Newton's method and gradient steps agree, with and without biactive nodes."""
    problem = sphere(48, kappa, potentials, material)
    limits = StoppingCriteria(tolerance=1e-9)
    ours, theirs = (solve(problem, solver, limits) for solver in (Nesterov(), SemismoothNewton()))
    assert ours.status is Status.CONVERGED
    assert theirs.status is Status.CONVERGED
    assert ((ours.state.contact_fraction > 0.0) & (ours.state.contact_fraction < 1.0)).any() == has_biactive
    forces = [problem.system.weights @ solution.state.load[:, 2] for solution in (ours, theirs)]
    assert forces[0] == pytest.approx(forces[1], rel=1e-6)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", [Nesterov(), BarzilaiBorwein()])
@pytest.mark.parametrize("kappa", [3e-7, 1e-6])
def test_convergence_with_large_contact_resistance(solver: Solver, kappa: float):
    """Resistances are about a million times the nodal compliance; inexact fluxes still reduce the residual."""
    problem = sphere(16, kappa, (2.0, 0.5), "orthotropic-mee")
    ours, theirs = (solve(problem, one, StoppingCriteria(tolerance=1e-8)) for one in (solver, SemismoothNewton()))
    assert ours.status is Status.CONVERGED, ours.message
    assert theirs.status is Status.CONVERGED
    largest = np.abs(theirs.state.load).max(axis=0)
    assert (np.abs(ours.state.load - theirs.state.load) <= 1e-6 * largest).all()


def test_the_potential_of_a_grounded_conductor_is_exactly_zero():
    """Under a conducting sphere without friction the potential vanishes on the whole surface, without noise."""
    case = meeframe.Case(
        material="pzt-4",
        mesh=meeframe.mesh.half_space(contact_width="5 mm", divisions=32),
        indenter=meeframe.Sphere("100 mm"),
        conductivity={"electric": meeframe.StepConductivity(float("inf"))},
        formulation=HalfSpace(),
        steps=[
            meeframe.Step(approach="20 um", increments=6),
            meeframe.Step(approach="20 um", electric_potential="1 V"),
        ],
    )
    *grounded, charged = case.solve()
    assert all(step.fluxes[:, 0].any() for step in grounded)
    assert not any(step.potentials.any() for step in grounded)
    np.testing.assert_allclose(charged.potentials[charged.touching, 0], 1.0, rtol=1e-3)
