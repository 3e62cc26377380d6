"""The hysteresis loop of validation/load_histories on a coarser mesh, by boundary elements from its case file."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from meeframe.model.load import case_from_tables
from meeframe.model.solve import solve_case
from meeframe.results.records import RunStatus, resultants

CASE = Path(__file__).parents[3] / "validation" / "load_histories" / "loop.toml"


@pytest.fixture(scope="module")
def loop():
    tables = tomllib.loads(CASE.read_text(encoding="utf-8"))
    tables["mesh"] |= {"divisions": 6, "rings": 3, "layers": 1}
    tables["formulation"] = {"name": "dense-bem", "quadrature_tolerance": 1e-3}
    return solve_case(case_from_tables(tables))


def test_every_increment_converges_and_friction_takes_energy(loop):
    assert loop.status is RunStatus.CONVERGED
    totals = [resultants(loop.zone, step) for step in loop.steps]
    assert min(total.dissipated_energy for total in totals) >= 0.0
    assert totals[-2].normal_force > 0.0
    assert not loop.steps[-1].traction.any()


def test_area_of_the_loop_is_the_dissipated_energy(loop):
    """From the turn on, forth and back: work of the indenter, less what is stored, is what friction took.

    Up to terms of second order in the increments, and the compliance that collocation leaves slightly unsymmetric.
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
