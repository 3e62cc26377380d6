"""The work of friction over load paths is known in full slip and in full stick."""

from dataclasses import dataclass
from typing import final

import numpy as np
import pytest

from meeframe.common.errors import MeeframeError
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver
from meeframe.laws import IsotropicCoulomb
from meeframe.testing.elastic_half_space import elastic_half_space
from meeframe.testing.load_path import Position, follow

SYSTEM = elastic_half_space(1.0, 0.0, 2.0, 6, goodman=True)
GAP = np.hypot(*SYSTEM.points.T[:2]) ** 2 / 2 - 0.3


def path(*along_x: float) -> list[Position]:
    return [Position(GAP, np.tile([x, 0.0], (len(GAP), 1))) for x in along_x]


def test_work_of_full_slip_is_friction_times_distance() -> None:
    steps = list(follow(SYSTEM, IsotropicCoulomb(0.2), path(0.0, 1.0, 1.3, -1.0, -1.5)))
    pressed, _, onward, _, back = steps
    assert pressed.dissipation == 0.0
    assert pressed.force[2] < 0
    for step, distance in ((onward, 0.3), (back, 0.5)):
        loaded = step.state.load[:, 2] < 0
        np.testing.assert_allclose(
            step.slip[loaded], [[np.sign(step.force[0]) * distance, 0.0]] * loaded.sum(), rtol=1e-8
        )
        assert step.dissipation == pytest.approx(-0.2 * step.force[2] * distance, rel=1e-8)
    assert back.force[0] == pytest.approx(-onward.force[0], rel=1e-8)


def test_stick_is_reversible() -> None:
    *_, moved, back = follow(SYSTEM, IsotropicCoulomb(np.inf), path(0.0, 0.4, 0.0))
    assert moved.force[0] > 0
    assert abs(back.force[0]) < 1e-9 * moved.force[0]
    assert abs(moved.dissipation) + abs(back.dissipation) < 1e-9 * moved.force[0]


@final
@dataclass(frozen=True)
class Idle(Solver):
    """A solver that changes nothing."""

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        return Iterate(np.zeros((len(problem.gap), 5)), np.zeros(len(problem.gap)))

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        return iterate


@pytest.mark.full
def test_unconverged_step_ends_the_path() -> None:
    with pytest.raises(MeeframeError, match="step 0 of the path: "):
        list(follow(SYSTEM, IsotropicCoulomb(0.2), path(0.0), Idle()))
