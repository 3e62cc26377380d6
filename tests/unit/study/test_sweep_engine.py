"""The engine of sweeps: groups that share systems, keys by content, systems that travel, what is kept."""

import tomllib
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np
import pytest

from meeframe.case.cache import bodies_of, case_key, system_key
from meeframe.case.load import load_case
from meeframe.case.solve import reduce, solve_case
from meeframe.core.errors import CaseError
from meeframe.core.formulation import Formulation, NodalFields, ReducedSystem
from meeframe.core.result import resultants
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.io.toml import toml_text
from meeframe.laws import IsotropicCoulomb
from meeframe.study import sweep_dask
from meeframe.study.declare import changed
from meeframe.study.sweep_dask import Carried, Sealed, reduced, solved_there
from meeframe.study.sweep_engine import InProcess, grouped, pool_of, solve_points
from meeframe.study.sweep_points import Outcome, Point, PointStatus, read_outcome, write_outcome


@pytest.fixture
def tables(write_case):
    return tomllib.loads(write_case().read_text())


@pytest.fixture
def point(tables, registry, tmp_path):
    return lambda label="", **changes: Point.of(label, changed(tables, changes), tmp_path, registry)


@dataclass(frozen=True)
class Hidden(Formulation):
    """Springs without a matrix, and a system that cannot be pickled as it holds a lock."""

    portable: bool

    def check(self, body):
        pass

    def reduce(self, body, progress=None):
        from meeframe.geometry import zone_frames

        zone = zone_frames(body.mesh, body.contact_group)
        parts = zone.points, zone.frames, zone.weights, zone.cells, np.zeros((len(zone.points), 5))
        return HiddenSystem(*parts, None if self.portable else Lock())


@dataclass(frozen=True, eq=False)
class HiddenSystem(ReducedSystem):
    held: object

    def apply(self, load):
        return load / 1e14

    def diagonal_blocks(self):
        return np.tile(np.eye(5) / 1e14, (len(self.points), 1, 1))

    def dense(self):
        return None

    def recover(self, load):
        return NodalFields(self.points, self.cells, load, load)


def test_toml_is_read_back_the_same(tables):
    odd = {
        "a": True, "b": [1, 2.5, float("inf"), "x\"\\\n\x7fµ"], "c": {"d e": {"f": [{"g": 1}, {}]}}, "h": [[1], []],
        "i": 1e-300, "j": [{"k": "l", "m": {"n": -1}}], "o": [], "p": {},
    }  # fmt: skip
    for given in (odd, tables):
        assert tomllib.loads(toml_text(given)) == given


def test_the_key_of_a_point_is_what_determines_its_result(point):
    key = point().key
    assert point("a label", title="another title", **{"output": {"figures": False}}).key == key
    for change in (
        {"steps[1].approach": "11 um"}, {"contact.law": "signorini-gap"}, {"material.name": "pzt-4"},
        {"solver": {"name": "auto", "tolerance": 1e-9}}, {"indenter.radius": 0.2}, {"mesh.rings": 3},
        {"formulation.stiffness": 2e14}, {"indenter.electric_potential": 1.0},
    ):  # fmt: skip
        changed_key = point(**change).key
        assert changed_key != key, change


def test_points_are_grouped_by_the_bodies_that_they_share(point):
    points = [
        point(f"{stiffness} {approach}", **{"formulation.stiffness": stiffness, "steps[1].approach": approach})
        for approach in (1e-5, 2e-5)
        for stiffness in ("1 GPa/m", "2 GPa/m")
    ]
    groups = grouped(points)
    assert [[p.label for p in group] for _, group in groups] == [
        ["1 GPa/m 1e-05", "1 GPa/m 2e-05"],
        ["2 GPa/m 1e-05", "2 GPa/m 2e-05"],
    ]
    for bodies, group in groups:
        assert [key for key, _ in bodies] == [system_key(*body) for body in bodies_of(group[0].case)]


def test_equal_points_are_solved_once(point, tmp_path):
    points = [point("a"), point("b", **{"steps[1].approach": "20 um"}), point("c", title="c")]
    assert points[0].key == points[2].key
    found = dict(solve_points(points, InProcess(), tmp_path / "systems", tmp_path / "points"))
    assert found.keys() == {points[0].key, points[1].key}
    assert {path.name for path in (tmp_path / "points").iterdir()} == found.keys()


def test_an_outcome_is_read_back_bit_for_bit(point, tmp_path):
    here = point(**{"contact.law": {"name": "isotropic-coulomb", "mu": 0.3}})
    ((_, made),) = solve_points([here], InProcess(), tmp_path / "systems")
    write_outcome(tmp_path / "point", made)
    found = read_outcome(tmp_path / "point")
    assert (found.status, found.message) == (made.status, made.message)
    for name in ("traction", "displacement", "potentials", "slip", "region"):
        values = [getattr(outcome.result.steps[-1], name) for outcome in (found, made)]
        np.testing.assert_array_equal(*values, strict=True)
    assert found.result.provenance == made.result.provenance
    assert case_key(here.case) == here.key


def test_what_is_kept_and_what_is_tried_again(tmp_path):
    for status, kept in ((PointStatus.REFUSED, True), (PointStatus.FAILED, False)):
        write_outcome(tmp_path / status, Outcome(status, "why"))
        found = read_outcome(tmp_path / status)
        assert (found is not None) is kept
    assert read_outcome(tmp_path / "refused").message == "why"
    (tmp_path / "refused" / "refused.json").write_text('{"mess')
    assert read_outcome(tmp_path / "refused") is None, "a damaged file is none"


@pytest.mark.parametrize("seen", [True, False])
def test_a_dense_system_travels(point, tmp_path, seen):
    """seen: whether the worker sees the folder of systems; if not, the system travels alone."""
    here = point(**{"formulation": {"name": "dense-bem", "quadrature_tolerance": 1e-2}})
    folder = tmp_path / "systems"
    if seen:
        folder.mkdir()
    ((key, body),) = ((system_key(*body), body) for body in bodies_of(here.case))
    carried = reduced(key, Sealed.of(body, ()), str(folder))
    assert folder.exists() is seen
    assert [path.stem for path in folder.glob("*")] == [key] * seen
    outcome = solved_there(Sealed.of(here.case, ()), carried)
    expected = solve_case(here.case).steps[-1]
    np.testing.assert_array_equal(outcome.result.steps[-1].traction, expected.traction)
    system = sweep_dask._opened(carried)
    load = np.ones_like(system.offset)
    np.testing.assert_allclose(system.recover(load).values, reduce(here.case).recover(load).values, rtol=1e-12)


@pytest.mark.parametrize("portable", [True, False])
def test_a_system_without_a_matrix_travels_or_is_made_again(point, monkeypatch, tmp_path, portable):
    case = replace(point().case, formulation=Hidden(portable))
    made = []
    original = sweep_dask.reduce_body
    monkeypatch.setattr(sweep_dask, "reduce_body", lambda *given: made.append(1) or original(*given))
    (body,) = bodies_of(case)
    carried = reduced(f"key {portable}", Sealed.of(body, ()), str(tmp_path / "absent"))
    for _ in range(2):
        outcome = solved_there(Sealed.of(case, ()), carried)
        step = outcome.result.steps[-1]
        assert resultants(outcome.result.zone, step).max_pressure == pytest.approx(1e14 * 1e-5)
    assert len(made) == (1 if portable else 2), "once in each process"


def test_refusals_of_a_reduction_are_those_of_its_points(point, tmp_path):
    refused = Carried("key", refusal="no")
    outcome = solved_there(Sealed.of(point().case, ()), refused)
    assert (outcome.status, outcome.message) == (PointStatus.REFUSED, "no")


@pytest.mark.parametrize(
    ("workers", "scheduler", "text"),
    [(0, None, "workers = 0: allowed: 1 or more"), (2, "tcp://a:1", "allowed: one of them")],
)
def test_wrong_pools(workers, scheduler, text):
    with pytest.raises(CaseError, match=text), pool_of(workers, scheduler):
        pass


def test_friction_and_loads_do_not_need_another_system(write_case, registry):
    case = load_case(write_case(), registry)
    other = replace(case, contact_law=IsotropicCoulomb(0.3), formulation=DenseBEM())
    keys = {
        system_key(*body)
        for each in (case, replace(case, contact_law=IsotropicCoulomb(0.3)), other)
        for body in bodies_of(each)
    }
    assert len(keys) == 2
