"""Test load histories on grids: results of increments do not depend on data reused from earlier increments."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.elements import Quad4
from meeframe.indenters import shapes as rigid
from meeframe.laws import IsotropicCoulomb, StepConductivity
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.model.case import Case
from meeframe.model.restart import Restart
from meeframe.model.solve import solve_case
from meeframe.model.step import Step
from meeframe.results.records import Region, Result, StepResult

PRESS, DRAG = 3, 4
"""Increments of the approach and of the tangential motion."""
STEPS = {
    "motions": (Step(approach=3e-5, increments=PRESS), Step(translation=(9e-6, 0.0), increments=DRAG)),
    "forces": (Step(normal_force=600.0, increments=PRESS), Step(force_ratio=(0.25, 0.0), increments=DRAG)),
}


def history(steps: tuple[Step, ...], matrix_up_to: int, kappa: float = 0.0, restart: Restart | None = None) -> Case:
    """Return the case of a sphere pressed on a half space with friction and dragged along it."""
    return Case(
        material=library_material("batio3-cofe2o4"),
        mesh=half_space_mesh(2e-2, 5e-3, 17, 1, Quad4()),
        conditions=(),
        indenter=rigid.Sphere(0.1),
        potentials={"electric_potential": 20.0},
        contact_law=IsotropicCoulomb(0.3),
        conductivity={"electric": StepConductivity(kappa)},
        formulation=HalfSpace(matrix_up_to=matrix_up_to),
        steps=steps,
        restart=restart,
    )


@cache
def solved(control: str, matrix_up_to: int, kappa: float) -> Result:
    """Return the result of a whole history, which several tests compare."""
    return solve_case(history(STEPS[control], matrix_up_to, kappa))


def assert_same(ours: tuple[StepResult, ...], theirs: tuple[StepResult, ...]) -> None:
    """Assert that increments end in the same states, to 1e-8 of the largest value of each field."""
    assert len(ours) == len(theirs)
    for step, other in zip(ours, theirs, strict=True):
        assert step.status == other.status == "converged"
        for name in ("traction", "displacement", "fluxes", "total_slip"):
            expected = getattr(other, name)
            difference = np.abs(getattr(step, name) - expected).max()
            assert difference <= 1e-8 * np.abs(expected).max(initial=0.0), name


def restart_history(whole: Result, steps: tuple[Step, ...], matrix_up_to: int, kappa: float) -> tuple[StepResult, ...]:
    """Return the increments of a history that restarts in the middle of the last step of another one."""
    middle = PRESS + DRAG // 2
    remainder = replace(steps[-1], increments=DRAG - DRAG // 2)
    restart = Restart("", whole.zone.points, whole.zone.frames, whole.steps[middle - 1])
    return solve_case(history((remainder,), matrix_up_to, kappa, restart)).steps


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("kappa", [0.0, np.inf], ids=["insulated", "conducting"])
@pytest.mark.parametrize(("control", "matrix_up_to"), [("motions", 0), ("motions", 400), ("forces", 0)])
def test_restart_within_a_step_gives_same_states(control: str, matrix_up_to: int, kappa: float) -> None:
    whole = solved(control, matrix_up_to, kappa)
    middle = whole.steps[PRESS + DRAG // 2 - 1]
    assert {Region.STICK, Region.SLIP} <= set(middle.region.tolist()), "slip counts from a state with both"
    assert_same(restart_history(whole, STEPS[control], matrix_up_to, kappa), whole.steps[PRESS + DRAG // 2 :])


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("control", STEPS)
def test_stored_matrix_gives_same_history(control: str) -> None:
    assert_same(*(solved(control, matrix_up_to, 0.0).steps for matrix_up_to in (0, 400)))


def test_increments_match_separate_steps() -> None:
    """Separate load steps of one increment each do not extrapolate from earlier increments."""
    steps = tuple(Step(approach=3e-5 * part / PRESS) for part in range(1, PRESS + 1))
    steps += tuple(Step(translation=(9e-6 * part / DRAG, 0.0)) for part in range(1, DRAG + 1))
    assert_same(solve_case(history(steps, 0)).steps, solved("motions", 0, 0.0).steps)
