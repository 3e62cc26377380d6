"""Extrapolation of wear over cycles, against the exponential of a matrix."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from meeframe.contact.problem import Status
from meeframe.indenters.base import IndenterMotions
from meeframe.laws.wear import Archard
from meeframe.model.history import at_rest
from meeframe.model.kinematics import Solution
from meeframe.model.wear_cycles import WearOfCycles, solve_cycles
from meeframe.system.rolling import CellShift

STIFFNESS, SLIP = np.diag([2.0, 4.0, 9.0, 40.0, 100.0]) - 0.3, 1e-3
"""Fall of the pressure on five lines with the worn depth, at rates that differ by 50; slip at each node [m]."""
PRESSURE = np.array([1.0, 2.0, 3.0, 2.0, 1.0])
"""Pressure on the lines before they wear."""


class Lines:
    """Five lines of five nodes each, whose pressures fall with the depth; failures: numbers of states that fail."""

    def __init__(self, synthetic, failures=()):
        self.step, self.zone = synthetic.step(1e-6), synthetic.zone()
        self.shift = CellShift.of(self.zone.points, self.zone.frames, np.array([1.0, 0.0, 0.0]))
        self.failures, self.count = failures, 0

    def solve(self, state):
        self.count += 1
        traction, slip = np.zeros((25, 3)), np.full((25, 2), SLIP * np.sqrt(0.5))
        worn = state.wear[self.shift.grid]
        assert (worn == worn[0]).all(), "uniform along the lines"
        traction[self.shift.grid, 2] = -(PRESSURE - STIFFNESS @ worn[0])
        status = Status.STALLED if self.count in self.failures else Status.CONVERGED
        return Solution(None, state, replace(self.step, traction=traction, slip=slip, status=status))

    def wear(self, cycles, tolerance, coefficient=1.0):
        begin = at_rest(IndenterMotions(), {}, 25)
        law = WearOfCycles(Archard(coefficient), self.shift)
        _, end, result = solve_cycles(self.solve, begin, law, cycles, tolerance)
        return end.wear[self.shift.grid[0]], end, result


def exact(cycles):
    """Return the depth w with dw/dN = 5 k s (p - K w): each particle passes five nodes."""
    final = np.linalg.solve(STIFFNESS, PRESSURE)
    return final - expm(-5.0 * SLIP * cycles * STIFFNESS) @ final


@pytest.mark.parametrize("cycles", [20.0, 400.0])
def test_depth_of_many_cycles(synthetic, cycles):
    """The error stays below the tolerance, and falls with it."""
    errors = []
    for tolerance in (0.1, 0.01, 0.001):
        lines = Lines(synthetic)
        worn, end, result = lines.wear(cycles, tolerance)
        errors.append(np.abs(worn - exact(cycles)).sum() / exact(cycles).sum())
        assert errors[-1] < tolerance
        assert end.cycles == cycles
        assert result.iterations == 12 * lines.count
    assert errors[2] < errors[0] / 10.0


def test_states_that_do_not_converge_shorten_the_steps(synthetic):
    worn, _, result = Lines(synthetic, failures=(3,)).wear(20.0, 0.01)
    assert np.abs(worn - exact(20.0)).sum() < 0.01 * exact(20.0).sum()
    assert result.status is Status.CONVERGED


@pytest.mark.parametrize(("failures", "sentence"), [(range(1, 99), "before the first"), (range(9, 999), "after ")])
def test_states_that_never_converge_end_the_run(synthetic, failures, sentence):
    _, end, result = Lines(synthetic, failures).wear(20.0, 0.01)
    assert result.status is Status.STALLED
    assert sentence in result.message
    assert not end.wear.any(), "the state before"


def test_surfaces_that_do_not_wear(synthetic):
    worn, end, result = Lines(synthetic).wear(1e6, 0.01, coefficient=0.0)
    assert not worn.any()
    assert end.cycles == 1e6
    assert "estimated error 0.00%" in result.message
