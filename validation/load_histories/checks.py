"""Check the energy balance of a hysteresis loop under prescribed forces on a block."""

import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from meeframe.model.load import case_from_tables
from meeframe.model.solve import solve_case
from meeframe.results.records import Result, RunStatus
from meeframe.results.resultants import resultants
from meeframe.study.validate import Check, Claim, Curve, Item, Plot

TITLE = "Hysteresis loop on a magneto-electro-elastic block, boundary elements"
SOURCE = "Balance of energy: docs/explanation/theory.md. Case file loop.toml; quick: on a coarser mesh."
RATIO = 0.54
"""Ratio of tangential and normal force at the reversals, as in the case file."""


def run(quick: bool) -> Iterator[Item]:
    """Check one loop from the first reversal on."""
    tables = tomllib.loads((Path(__file__).parent / "loop.toml").read_text(encoding="utf-8"))
    if quick:
        tables["mesh"] |= {"divisions": 6, "rings": 3, "layers": 1}
        tables["formulation"] = {"name": "dense-bem", "quadrature_tolerance": 1e-3}
    result = solve_case(case_from_tables(tables))
    states = f"{result.status}, {len(result.steps)} increments"
    yield Claim("every increment converges", states, "status of the run", result.status is RunStatus.CONVERGED)
    yield from _energy(result)
    totals = [resultants(result.zone, step) for step in result.steps]
    least = min(total.dissipated_energy for total in totals)
    yield Check("least dissipation of an increment", min(least, 0.0), 0.0, 1e-12, "J", absolute=True)
    yield Check("traction after separation", float(np.abs(result.steps[-1].traction).max()), 0.0, 0.0, "Pa", True)
    tangential = [step for step in result.steps if 2 <= step.step <= 4]
    way = np.array([step.loading.translation[0] for step in tangential]) * 1e6
    force = np.array([resultants(result.zone, step).tangential_force[0] for step in tangential]) / 1e3
    curves = (Curve("increments", way, force, joined=True),)
    yield Plot("Tangential force over translation", "translation [µm]", "force [kN]", curves)


def _energy(result: Result) -> Iterator[Check]:
    """Check the dissipation against work minus stored energy; work uses mean tractions of an increment."""
    turn = max(index for index, step in enumerate(result.steps) if step.step == 2)
    steps = [step for step in result.steps[turn:] if step.step < 5]
    totals = [resultants(result.zone, step) for step in steps]
    forces = np.array([[total.normal_force, *total.tangential_force] for total in totals])
    motions = np.array([step.loading.motion[:3] for step in steps])
    work = float(((forces[1:] + forces[:-1]) / 2 * np.diff(motions, axis=0)).sum())
    ends = [result.zone.weights @ (step.traction * step.displacement).sum(axis=1) / 2 for step in (steps[0], steps[-1])]
    dissipated = sum(total.dissipated_energy for total in totals[1:])
    yield Check("dissipation, against work minus stored energy", dissipated, work - float(ends[1] - ends[0]), 0.03, "J")
    ratio = totals[0].tangential_force[0] / totals[0].normal_force
    yield Check("ratio of tangential and normal force at the reversal", float(ratio), RATIO, 1e-6)
