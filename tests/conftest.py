"""Shared fixtures: a tiny case, a formulation without boundary elements, a synthetic result."""

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated

import numpy as np
import pytest

from meeframe.contact.problem import Status
from meeframe.fields.units import Quantity
from meeframe.formulations.base import Formulation
from meeframe.mesh import check_supports, find_contact_zone
from meeframe.mesh.body import check_conditions
from meeframe.plugin import registry as plugins
from meeframe.plugin.hookspecs import Record
from meeframe.plugin.registry import Entry, Kind, Provider
from meeframe.results.records import Loading, Provenance, Region, Result, StepResult, Zone
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import NodalFields, silent

CASE = """
title = "tiny"

[material]
name = "batio3-cofe2o4"

[mesh]
half_width = "50 mm"
height = "120 mm"
contact_width = "5 mm"
divisions = 4
rings = 2
layers = 1

[[boundary]]
group = "base"
displacement = [0, 0, 0]
electric_potential = 0
magnetic_potential = 0

[indenter]
name = "sphere"
radius = "100 mm"

[formulation]
name = "winkler"
stiffness = "1e14 Pa/m"

[[steps]]
approach = "10 um"
"""


SECOND_BODY = """
[second_body]
zone = "contact"
formulation = { name = "winkler", stiffness = "3e14 Pa/m" }

[second_body.material]
name = "pzt-4"

[second_body.mesh]
half_width = "40 mm"
height = "60 mm"
contact_width = "5 mm"
divisions = 4
rings = 3
layers = 2

[[second_body.boundary]]
group = "base"
displacement = [0, 0, 0]
electric_potential = 0
magnetic_potential = 0
"""


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Reset RANDOM of the module, so that results do not depend on the order of the tests."""
    random = getattr(getattr(item, "module", None), "RANDOM", None)
    if random is not None:
        begun = random.bit_generator
        begun.state = type(begun)(begun.seed_seq).state


@dataclass(frozen=True)
class Winkler(Formulation):
    """Independent springs: each node responds to its load only, so contact has a closed form."""

    stiffness: Annotated[float, Quantity("Pa/m", gt=0)]

    def check(self, body):
        check_conditions(body)
        check_supports(body)

    def reduce(self, body, progress=silent):
        progress("springs", 0.0)
        zone = find_contact_zone(body.mesh, body.contact_group)
        n = len(zone.points)
        matrix = np.zeros((n, 5, n, 5))
        for node in range(n):
            matrix[node, :, node, :] = np.diag([1, 1, 1, 1e13, 1e8]) / self.stiffness

        def recover(load):
            return NodalFields(zone.points, zone.cells, np.einsum("naNA,NA->na", matrix, load), load)

        return DenseSystem(zone.points, zone.frames, zone.weights, zone.cells, np.zeros((n, 5)), matrix, recover)


@pytest.fixture(scope="session")
def registry():
    """Return the installed plugins and the springs."""
    record = Record("winkler", Winkler, "independent springs", "Winkler (1867)")
    loaded = plugins.load()
    return replace(loaded, entries=(*loaded.entries, Entry(Kind.FORMULATION, record, Provider("tests", "0"))))


@pytest.fixture
def write_case(tmp_path):
    """Return a function that writes the tiny case with replaced and added texts and returns its path."""

    def write(*changes: tuple[str, str], more: str = "") -> Path:
        text = CASE
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "case.toml"
        path.write_text(text + more, encoding="utf-8")
        return path

    return write


@pytest.fixture
def case_file(write_case) -> Path:
    """Return the tiny case in two steps, solved by boundary elements."""
    return write_case(
        ('name = "winkler"\nstiffness = "1e14 Pa/m"', 'name = "dense-bem"\nquadrature_tolerance = 1e-3'),
        ("[[steps]]", '[solver]\nname = "uzawa"\ntolerance = 1e-6\n\n[[steps]]'),
        ('"10 um"', '"20 um"'),
        more='\n[[steps]]\napproach = "40 um"\n',
    )


@pytest.fixture(scope="session")
def second_body():
    """Return tables of a second body for the tiny case, a bed of springs three times as stiff."""
    return SECOND_BODY


SIDE = 5


def zone() -> Zone:
    """Return a flat square zone of 4 x 4 cells, 1 mm each, facing +x3."""
    grid = np.arange(SIDE) * 1e-3 - 2e-3
    x, y = np.meshgrid(grid, grid)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(SIDE**2)])
    corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    quads = np.stack([corner, corner + 1, corner + SIDE + 1, corner + SIDE], axis=1)
    weights = np.zeros(SIDE**2)
    np.add.at(weights, quads, 1e-6 / 4)
    return Zone(points, np.tile(np.eye(3), (SIDE**2, 1, 1)), weights, (("quad", quads),))


def step(approach: float, status: Status = Status.CONVERGED, number: int = 1, increment: int = 1) -> StepResult:
    """Return a step with the pressure 1e6 Pa x approach / 1 um inside a circle of 1.5 mm, and a tangential traction
    with a slip of 10 nm except at the centre."""
    place = zone()
    inside = np.linalg.norm(place.points[:, :2], axis=1) < 1.5e-3
    pressure = 1e12 * approach * inside
    n = len(inside)
    slipping = inside & place.points.any(axis=1)
    slip = np.column_stack([1e-8 * slipping, np.zeros(n)])
    prescribed = {"tangential_force": np.array([0.1 * pressure.sum() * 1e-6, 0.0])}
    scalars = {"electric_potential": 3.0, "magnetic_potential": -2.0}
    return StepResult(
        loading=Loading(approach, np.array([1e-7, 0.0]), np.array([1e-3, -2e-3]), 0.01, scalars, prescribed),
        step=number,
        increment=increment,
        initial_gap=np.where(inside, -approach, np.inf),
        traction=np.column_stack([0.1 * pressure, np.zeros(n), -pressure]),
        displacement=np.column_stack([np.zeros(n), np.zeros(n), -approach * inside]),
        potentials=np.column_stack([-5.0 * inside, 7.0 * inside]),
        fluxes=np.column_stack([2.0 * inside, -3.0 * inside]),
        contact_fraction=inside.astype(float),
        slip=slip,
        total_slip=2.0 * slip,
        slip_path=3.0 * slip[:, 0],
        wear=np.zeros(n),
        dissipation=0.1 * pressure * slip[:, 0],
        region=np.where(inside, np.where(slipping, Region.SLIP, Region.STICK), Region.OPEN).astype(np.int64),
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
    """Return functions that create the parts of a synthetic result."""
    return SimpleNamespace(zone=zone, step=step, result=result)
