"""An iteration that ends far from the prescribed resultants says so, where it was not known beforehand."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.core.contact import Freedom, Status
from meeframe.laws import IsotropicCoulomb
from meeframe.solvers import Limits, Uzawa, solve
from meeframe.testing.half_space import half_space_system, indentation_problem

MU, CELLS, APPROACH = 0.3, 8, 2e-5


def dragged(share):
    """A sphere at a given approach, under a tangential force that is a share of friction times its normal force."""
    system = half_space_system(2e-12 * np.eye(3), 5e-3, CELLS)
    height = (system.points[:, :2] ** 2).sum(axis=1) / 0.2
    problem = indentation_problem(system, height, APPROACH, IsotropicCoulomb(MU))
    normal = -float(system.weights @ solve(problem, Uzawa()).state.load[:, 2])
    mode = np.zeros((CELLS**2, 5))
    mode[:, 0] = 1.0
    return replace(problem, freedoms=(Freedom(mode, system.weights[:, None] * mode, share * MU * normal),))


@pytest.mark.parametrize(("share", "missed"), [(0.5, False), (2.0, True)])
def test_resultants_that_are_missed_are_told(share, missed):
    found = solve(dragged(share), Uzawa(), Limits(max_iterations=10))
    assert found.status is Status.ITERATION_LIMIT
    assert ("the loads found miss the prescribed resultants" in found.message) == missed
