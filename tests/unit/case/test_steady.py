"""Steady rolling under laws that depend on the slip path."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.contact.problem import Status
from meeframe.indenters.base import IndenterMotions
from meeframe.model.history import at_rest
from meeframe.model.kinematics import Solution
from meeframe.model.steady import solve_steady
from meeframe.system.rolling import CellShift


@pytest.mark.parametrize("failing", [1, 2, None])
def test_the_state_before_remains_if_none_is_steady(synthetic, failing):
    """The slip path of a trial is not that of the material; failing: number of the state that does not converge."""
    step, zone = synthetic.step(1e-6), synthetic.zone()
    before = replace(at_rest(IndenterMotions(), {}, 25), slip_path=np.full(25, 1e-3))
    numbers = iter(range(1, 1000))

    def solve(state):
        number = next(numbers)
        slip = np.full((25, 2), 1e-6 * number)
        status = Status.STALLED if number == failing else Status.CONVERGED
        return Solution(None, replace(state, total_slip=slip), replace(step, slip=slip, status=status))

    shift = CellShift.of(zone.points, zone.frames, np.array([1.0, 0.0, 0.0]))
    _, end, result = solve_steady(solve, before, shift, has_memory=True)
    assert result.status is Status.STALLED
    assert end is before
    assert result.iterations == step.iterations * (next(numbers) - 1)
