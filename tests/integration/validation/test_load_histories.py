"""Test the hysteresis loop of validation/load_histories on a coarser mesh by boundary elements."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from meeframe.model.load import case_from_tables
from meeframe.model.solve import solve_case
from meeframe.results.records import RunStatus
from meeframe.results.resultants import resultants

CASE = Path(__file__).parents[3] / "validation" / "load_histories" / "loop.toml"


@pytest.fixture(scope="module")
def loop():
    tables = tomllib.loads(CASE.read_text(encoding="utf-8"))
    tables["mesh"] |= {"divisions": 6, "rings": 3, "layers": 1}
    tables["formulation"] = {"name": "dense-bem", "quadrature_tolerance": 1e-3}
    return solve_case(case_from_tables(tables))


@pytest.mark.full
def test_all_increments_converge_and_dissipate(loop):
    assert loop.status is RunStatus.CONVERGED
    totals = [resultants(loop.zone, step) for step in loop.steps]
    assert min(total.dissipated_energy for total in totals) >= 0.0
    assert totals[-2].normal_force > 0.0
    assert not loop.steps[-1].traction.any()


def test_loop_area_equals_dissipated_energy(loop):
    """Over a closed loop, the work of the indenter less the stored energy equals the work of friction.

    The equality holds to second order in the increments, up to the slight asymmetry of the collocation compliance.
    """
    turn = [(step.step, step.increment) for step in loop.steps].index((2, 6))
    steps = [step for step in loop.steps[turn:] if step.step < 5]
    totals = [resultants(loop.zone, step) for step in steps]
    forces = np.array([[total.normal_force, *total.tangential_force] for total in totals])
    motions = np.array([step.loading.motion[:3] for step in steps])
    work = ((forces[1:] + forces[:-1]) / 2 * np.diff(motions, axis=0)).sum()
    ends = [loop.zone.weights @ (step.traction * step.displacement).sum(axis=1) / 2 for step in (steps[0], steps[-1])]
    dissipated = sum(total.dissipated_energy for total in totals[1:])
    assert dissipated == pytest.approx(work - (ends[1] - ends[0]), rel=0.03)
