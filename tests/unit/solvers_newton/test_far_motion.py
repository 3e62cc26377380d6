"""A Newton step must not move a free indenter away that slides nearly everywhere."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, PrescribedResultant, Status
from meeframe.laws import Insulating, OrthotropicCoulomb, Signorini
from meeframe.solvers import Auto, SemismoothNewton, StoppingCriteria, residual, solve
from meeframe.testing.elastic_half_space import elastic_half_space

MU = 0.6


def sliding(cells, approach, ratio, translation=0.0):
    """Return a problem of a sphere on a few cells with a tangential force in proportion to its normal force."""
    system = elastic_half_space(2e11, 0.3, 5e-3, cells)
    x, y, _ = system.points.T
    n = len(x)
    mode, normal = np.zeros((2, n, 5))
    mode[:, 0], normal[:, 2] = 1.0, -1.0
    free = (PrescribedResultant(mode, mode - ratio * normal, system.weights, 0.0),) if ratio is not None else ()
    gap = (x**2 + y**2) / 0.2 - approach
    slid = np.tile([translation, 0.0], (n, 1))
    law = OrthotropicCoulomb(MU, MU / 2)
    return ContactProblem(system, law, flux_channels(Insulating(), Insulating()), gap, slid, np.zeros((n, 2)), free)


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("solver", [SemismoothNewton(), Auto()])
@pytest.mark.parametrize(
    ("cells", "pressed", "touching", "share"),
    [
        (5, 8e-6, 1.5e-6, 0.9),
        (5, 8e-6, 1.5e-6, 0.95),
        (6, 1.5e-5, 3e-6, -0.9),
        (7, 1.5e-5, 3e-6, 0.9),
        (8, 8e-6, 1.5e-6, 0.95),
        (9, 8e-6, 3e-6, 0.95),
    ],
)
def test_unloading_near_the_friction_limit(solver, cells, pressed, touching, share):
    """A pressed and dragged state is unloaded to a few nodes in contact."""
    start = solve(sliding(cells, pressed, share * MU), solver).state
    problem = sliding(cells, touching, share * MU)
    solution = solve(problem, solver, StoppingCriteria(max_iterations=20), replace(start, motion=np.zeros(1)))
    assert solution.status is Status.CONVERGED, solution.message
    assert residual(problem, solution.state) <= 1e-9
    # prescribing the computed motion recovers the ratio
    driven = solve(sliding(cells, touching, None, solution.state.motion[0]), solver)
    force = driven.state.load[:, :3].sum(axis=0)
    assert driven.status is Status.CONVERGED
    assert force[0] / -force[2] == pytest.approx(share * MU, rel=1e-6)


@pytest.mark.parametrize("force", [1.0, 1e-3, 1e-6])
def test_light_contact_from_a_distance(force):
    """An indenter approaches from 1 mm to a depth of nanometres."""
    system = elastic_half_space(2e11, 0.3, 2e-4, 12)
    x, y, _ = system.points.T
    n = len(x)
    mode = np.zeros((n, 5))
    mode[:, 2] = -1.0
    free = (PrescribedResultant(mode, mode, system.weights, force),)
    gap = (x**2 + y**2) / 2e-2 + 1e-3
    problem = ContactProblem(
        system, Signorini(), flux_channels(Insulating(), Insulating()), gap, np.zeros((n, 2)), np.zeros((n, 2)), free
    )
    solution = solve(problem, Auto())
    assert solution.status is Status.CONVERGED, solution.message
    assert -system.weights @ solution.state.load[:, 2] == pytest.approx(force, rel=1e-6)
