"""A small made-up result, shared by the tests of files and reports."""

from types import SimpleNamespace

import numpy as np
import pytest

from meeframe.core.contact import Status
from meeframe.core.formulation import NodalFields
from meeframe.core.result import Loading, Provenance, Result, StepResult, Zone

SIDE = 5


def zone() -> Zone:
    """A flat square zone of 4 x 4 cells, 1 mm each, facing +x3."""
    grid = np.arange(SIDE) * 1e-3 - 2e-3
    x, y = np.meshgrid(grid, grid)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(SIDE**2)])
    corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    quads = np.stack([corner, corner + 1, corner + SIDE + 1, corner + SIDE], axis=1)
    weights = np.zeros(SIDE**2)
    np.add.at(weights, quads, 1e-6 / 4)
    return Zone(points, np.tile(np.eye(3), (SIDE**2, 1, 1)), weights, (("quad", quads),))


def step(approach: float, status: Status = Status.CONVERGED) -> StepResult:
    """A step with pressure 1e6 Pa x approach / 1 um inside a circle of 1.5 mm, and a tangential pull."""
    place = zone()
    inside = np.linalg.norm(place.points[:, :2], axis=1) < 1.5e-3
    pressure = 1e12 * approach * inside
    n = len(inside)
    return StepResult(
        loading=Loading(approach, (1e-7, 0.0), 3.0, -2.0),
        initial_gap=np.where(inside, -approach, np.inf),
        traction=np.column_stack([0.1 * pressure, np.zeros(n), -pressure]),
        displacement=np.column_stack([np.zeros(n), np.zeros(n), -approach * inside]),
        potentials=np.column_stack([-5.0 * inside, 7.0 * inside]),
        fluxes=np.column_stack([2.0 * inside, -3.0 * inside]),
        closed=inside.astype(float),
        status=status,
        iterations=12,
        residual=1e-9,
        history=np.array([[1.0, 1e-3], [12.0, 1e-9]]),
        message="",
        boundary=NodalFields(place.points, place.cells, np.full((n, 5), approach), np.full((n, 5), 2 * approach)),
    )


def result(*steps: StepResult, planned: int = 0) -> Result:
    made_by = Provenance("a title", 'title = "a title"\n', {"meeframe": "0.1.0", "python": "3.11"}, 2)
    timings = {"contact": 0.5, "total": 1.5} if steps else {}
    return Result(made_by, zone(), planned or len(steps), steps, timings, 123.0 if steps else 0.0)


@pytest.fixture(scope="session")
def synthetic() -> SimpleNamespace:
    """Makers of the parts of a made-up result."""
    return SimpleNamespace(zone=zone, step=step, result=result)
