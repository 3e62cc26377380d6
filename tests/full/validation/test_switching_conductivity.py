"""Under magnetic conduction (Table 3), nodes at the contact edge would switch for ever
(docs/explanation/solvers.md)."""

import numpy as np
import pytest

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, Status, contact_gap, resultant
from meeframe.elements import Quad4
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.laws import Insulating, Signorini, StepConductivity
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import StoppingCriteria, Uzawa, residual, solve

MODERATE = (0.1, 0.2, 1.0)
"""Magnetic conductivities [H/m^2] at which nodes at the contact edge are biactive."""


@pytest.fixture(scope="module")
def system():
    body = Body(
        library_material("orthotropic-mee").stiffness, half_space_mesh(0.1, 0.005, 12, 6, Quad4()), (), "contact"
    )
    return DenseBEM().reduce(body)


def indentation(system, kappa):
    x, y = system.points[:, 0], system.points[:, 1]
    zero = np.zeros((len(x), 2))
    gap = (x**2 + y**2) / 0.2 - 5e-5
    return ContactProblem(system, Signorini(), flux_channels(Insulating(), StepConductivity(kappa)), gap, zero, zero)


def force(system, kappa):
    solution = solve(indentation(system, kappa), Uzawa(), StoppingCriteria())
    assert solution.status is Status.CONVERGED
    return -resultant(system, solution.state.load)[0][2]


@pytest.mark.parametrize("kappa", MODERATE)
def test_switching_nodes_become_biactive(kappa, system):
    problem = indentation(system, kappa)
    solution = solve(problem, Uzawa(), StoppingCriteria())
    state = solution.state
    assert solution.status is Status.CONVERGED
    assert residual(problem, state) < 1e-10
    biactive = (state.contact_fraction > 0) & (state.contact_fraction < 1)
    assert 0 < biactive.sum() < 30
    np.testing.assert_allclose(state.load[biactive, 2], 0, atol=1e-9 * np.abs(state.load[:, 2]).max())
    np.testing.assert_allclose(contact_gap(problem, state.displacement)[biactive, 2], 0, atol=1e-9 * 5e-5)


def test_magnetic_conduction_reduces_force_to_less_than_half(system):
    """The force is 0.43 of the insulated one (docs/explanation/theory.md, Half space); the paper states 'reduced by
    half'."""
    forces = [force(system, kappa) for kappa in (0.0, 0.01, *MODERATE, 10.0, np.inf)]
    assert np.all(np.diff(forces) < 0)
    assert forces[-1] / forces[0] == pytest.approx(0.43, abs=0.005)
