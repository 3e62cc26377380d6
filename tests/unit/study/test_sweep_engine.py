"""Test the engine of sweeps: groups with shared systems, keys by content, transfer of systems, stored results."""

import errno
import tomllib
from dataclasses import dataclass, field, replace
from threading import Lock
from weakref import WeakSet

import numpy as np
import pytest

from meeframe.common.errors import CaseError, MeshError, PluginFault, ResultError, TooLargeError
from meeframe.common.toml import toml_text
from meeframe.formulations.base import Formulation
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.indenters import Sphere
from meeframe.laws import IsotropicCoulomb
from meeframe.model import solve
from meeframe.model.cache import case_key, code_key, system_key
from meeframe.model.load import load_case
from meeframe.model.solve import bodies_of, reduce, solve_case
from meeframe.results.resultants import resultants
from meeframe.study.declare import changed
from meeframe.study.sweep import dask as sweep_dask
from meeframe.study.sweep.dask import PickledObject, reduced, solve_in_worker
from meeframe.study.sweep.engine import pool_of, solve_points
from meeframe.study.sweep.points import Outcome, Point, PointStatus, read_outcome, write_outcome
from meeframe.study.sweep.pool import InProcess, grouped
from meeframe.system.reduced import NodalFields, ReducedSystem


@pytest.fixture
def tables(write_case):
    return tomllib.loads(write_case().read_text())


@pytest.fixture
def point(tables, registry, tmp_path):
    return lambda label="", **changes: Point.of(label, changed(tables, changes), tmp_path, registry)


@dataclass(frozen=True)
class Hidden(Formulation):
    """Springs without a matrix, whose system holds a lock and cannot be pickled."""

    portable: bool

    def check(self, body):
        pass

    def reduce(self, body, progress=None):
        from meeframe.mesh import find_contact_zone

        zone = find_contact_zone(body.mesh, body.contact_group)
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


def test_toml_round_trip(tables):
    odd = {
        "a": True, "b": [1, 2.5, float("inf"), "x\"\\\n\x7fµ"], "c": {"d e": {"f": [{"g": 1}, {}]}}, "h": [[1], []],
        "i": 1e-300, "j": [{"k": "l", "m": {"n": -1}}], "o": [], "p": {},
    }  # fmt: skip
    for given in (odd, tables):
        assert tomllib.loads(toml_text(given)) == given


def test_key_of_a_point_contains_everything_relevant(point):
    key = point().key
    assert point("a label", title="another title", **{"output": {"figures": False}}).key == key
    for change in (
        {"steps[1].approach": "11 um"}, {"contact.law": "signorini-gap"}, {"material.name": "pzt-4"},
        {"solver": {"name": "auto", "tolerance": 1e-9}}, {"indenter.radius": 0.2}, {"mesh.rings": 3},
        {"formulation.stiffness": 2e14}, {"indenter.electric_potential": 1.0},
    ):  # fmt: skip
        changed_key = point(**change).key
        assert changed_key != key, change


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (None, "indenter.radius: TOML does not support values of type NoneType: None"),
        ([10**5000], "indenter.radius[1]: an integer of 16610 binary digits"),
        (np.array([0.1, 0.2]), "radius"),
    ],
)
def test_invalid_values_reject_their_point(point, value, message):
    refused = point(**{"indenter.radius": value})
    assert refused.case is None
    assert message in str(refused.problems[0])


def test_numpy_numbers_are_values(point):
    case = point(**{"indenter.radius": np.float32(0.5)}).case
    assert case.indenter == Sphere(0.5)


def test_points_are_grouped_by_bodies(point):
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
    solution = dict(solve_points(points, InProcess(), tmp_path / "systems", tmp_path / "points"))
    assert solution.keys() == {points[0].key, points[1].key}
    assert {path.name for path in (tmp_path / "points").iterdir()} == solution.keys()


def test_stored_outcome_is_bitwise_identical(point, tmp_path):
    here = point(**{"contact.law": {"name": "isotropic-coulomb", "mu": 0.3}})
    ((_, made),) = solve_points([here], InProcess(), tmp_path / "systems")
    write_outcome(tmp_path / "point", made)
    computed = read_outcome(tmp_path / "point")
    assert (computed.status, computed.message) == (made.status, made.message)
    for name in ("traction", "displacement", "potentials", "slip", "region"):
        values = [getattr(outcome.result.steps[-1], name) for outcome in (computed, made)]
        np.testing.assert_array_equal(*values, strict=True)
    assert computed.result.provenance == made.result.provenance
    assert case_key(here.case) == here.key


def test_finished_points_are_reused_and_failed_ones_repeated(tmp_path):
    for status, kept in ((PointStatus.REFUSED, True), (PointStatus.FAILED, False)):
        write_outcome(tmp_path / status, Outcome(status, "why"))
        computed = read_outcome(tmp_path / status)
        assert (computed is not None) is kept
    assert read_outcome(tmp_path / "refused").message == "why"
    for damaged in ('{"mess', "[]", '"message"', 100_000 * "["):
        (tmp_path / "refused" / "refused.json").write_text(damaged)
        assert read_outcome(tmp_path / "refused") is None, "a damaged file is none"


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("seen", [True, False])
def test_dense_system_is_sent_to_workers(point, tmp_path, seen):
    """`seen` tells whether the worker can access the folder of systems; if not, the system itself is sent."""
    here = point(**{"formulation": {"name": "dense-bem", "quadrature_tolerance": 1e-2}})
    folder = tmp_path / "systems"
    if seen:
        folder.mkdir()
    ((key, body),) = ((system_key(*body), body) for body in bodies_of(here.case))
    reference = reduced(key, PickledObject.of(body, ()), str(folder))
    assert folder.exists() is seen
    assert [path.stem for path in folder.glob("*")] == [key] * seen
    outcome = solve_in_worker(PickledObject.of(here.case, ()), reference)
    expected = solve_case(here.case).steps[-1]
    np.testing.assert_array_equal(outcome.result.steps[-1].traction, expected.traction)
    system = sweep_dask._open_system(reference)
    load = np.ones_like(system.offset)
    np.testing.assert_allclose(system.recover(load).values, reduce(here.case).recover(load).values, rtol=1e-12)


@pytest.mark.parametrize("portable", [True, False])
def test_matrix_free_system_is_sent_or_recomputed(point, monkeypatch, tmp_path, portable):
    case = replace(point().case, formulation=Hidden(portable))
    made = []
    original = sweep_dask.reduce_body
    for module in (sweep_dask, solve):
        monkeypatch.setattr(module, "reduce_body", lambda *given: made.append(1) or original(*given))
    (body,) = bodies_of(case)
    reference = reduced(f"key {portable}", PickledObject.of(body, ()), str(tmp_path / "absent"))
    for _ in range(2):
        outcome = solve_in_worker(PickledObject.of(case, ()), reference)
        step = outcome.result.steps[-1]
        assert resultants(outcome.result.zone, step).max_pressure == pytest.approx(1e14 * 1e-5)
    assert len(made) == (1 if portable else 2), "once in each process"


@dataclass(frozen=True)
class Ending(Formulation):
    """Springs whose reductions raise an error, or of which only one may exist at a time."""

    error: type[BaseException] | None = None
    alive: WeakSet = field(default_factory=WeakSet)

    def check(self, body):
        pass

    def reduce(self, body, progress=None):
        assert not self.alive, "the system of the points before is still held"
        if self.error is not None:
            raise self.error("no")
        system = Hidden(True).reduce(body)
        self.alive.add(system)
        return system


def group_of(point, formulation, **changes):
    """Return a point whose case has this formulation."""
    given = point(**changes)
    case = replace(given.case, formulation=formulation)
    return replace(given, case=case, key=case_key(case))


ENDS = [
    (CaseError, PointStatus.REFUSED),
    (MeshError, PointStatus.REFUSED),
    (TooLargeError, PointStatus.FAILED),
    (PluginFault, PointStatus.FAILED),
    (MemoryError, PointStatus.FAILED),
]


@pytest.mark.parametrize(("error", "status"), ENDS)
def test_failed_reduction_affects_only_its_points(point, tmp_path, error, status):
    points = [group_of(point, Ending(error)), point()]
    solution = dict(solve_points(points, InProcess(), tmp_path / "systems", tmp_path / "points"))
    assert [solution[each.key].status for each in points] == [status, PointStatus.CONVERGED]
    assert "no" in solution[points[0].key].message
    files = {path.name for path in (tmp_path / "points").iterdir()}
    assert files == {each.key for each in points if solution[each.key].status is not PointStatus.FAILED}


@pytest.mark.parametrize(("error", "status"), ENDS)
def test_failed_reduction_on_a_worker(point, tmp_path, error, status):
    case = group_of(point, Ending(error)).case
    (body,) = bodies_of(case)
    reference = reduced("key", PickledObject.of(body, ()), str(tmp_path / "absent"))
    outcome = solve_in_worker(PickledObject.of(point().case, ()), reference)
    assert outcome.status is status
    assert "no" in outcome.message


@pytest.mark.parametrize("module", ["meeframe.model.cache.read_system", "meeframe.model.cache.write_system"])
def test_memory_error_during_reduction(point, tmp_path, monkeypatch, module):
    def end(*_):
        raise MemoryError("no")

    monkeypatch.setattr(module, end)
    ((_, outcome),) = solve_points([point()], InProcess(), tmp_path / "systems")
    assert outcome.status is PointStatus.FAILED
    (tmp_path / "systems").mkdir(exist_ok=True)
    ((key, body),) = ((system_key(*body), body) for body in bodies_of(point().case))
    assert reduced(key, PickledObject.of(body, ()), str(tmp_path / "systems")).instead.status is PointStatus.FAILED


def test_full_disk_ends_the_sweep(point, tmp_path, monkeypatch):
    """With space available again, the same points are solved."""

    def full(*_):
        raise ResultError("no space left")

    here, folders = point(), (tmp_path / "systems", tmp_path / "points")
    folders[0].mkdir()
    ((key, body),) = ((system_key(*body), body) for body in bodies_of(here.case))
    with monkeypatch.context() as patch:
        patch.setattr("meeframe.model.cache.write_system", full)
        with pytest.raises(ResultError, match="no space left"):
            list(solve_points([here], InProcess(), *folders))
        with pytest.raises(ResultError, match="no space left"):
            reduced(key, PickledObject.of(body, ()), str(folders[0]))
    ((_, outcome),) = solve_points([here], InProcess(), *folders)
    assert outcome.status is PointStatus.CONVERGED


@pytest.mark.parametrize(("number", "ends"), [(errno.ENOSPC, True), (errno.EIO, True), (errno.ENOENT, False)])
def test_file_errors_of_a_plugin(number, ends):
    """A missing file fails its point, which is tried again; a full disk ends the sweep."""
    fault = PluginFault("no")
    fault.__cause__ = OSError(number, "no")
    if ends:
        with pytest.raises(PluginFault) as raised:
            Outcome.without_result(fault)
        assert raised.value is fault
    else:
        assert Outcome.without_result(fault).status is PointStatus.FAILED


def test_only_one_group_holds_systems_at_a_time(point, tmp_path):
    alive = WeakSet()
    points = [group_of(point, Ending(None, alive), **{"mesh.rings": rings}) for rings in (2, 3)]
    assert len(grouped(points)) == 2
    solution = dict(solve_points(points, InProcess(), tmp_path / "systems"))
    assert [outcome.status for outcome in solution.values()] == [PointStatus.CONVERGED] * 2


def test_workers_with_different_code_are_detected(point, monkeypatch):
    case = point().case
    pickled = PickledObject.of(case, (), code_key(case))
    assert case_key(pickled.open()) == case_key(case)
    monkeypatch.setattr("meeframe.model.cache._sources", lambda _: b"of another version")
    with pytest.raises(CaseError, match="runs other code than this command: sources or versions differ; allowed: the"):
        solve_in_worker(pickled)
    with pytest.raises(CaseError, match="runs other code than this command: No module named 'absent_plugin'"):
        PickledObject((), b"cabsent_plugin\nSprings\n.").open()


def test_key_of_code_depends_on_classes_only(point):
    key = code_key(point().case)
    assert code_key(point(**{"steps[1].approach": "11 um"}).case) == key
    assert code_key(group_of(point, Hidden(True)).case) != key


@pytest.mark.parametrize(
    ("workers", "scheduler", "text"),
    [
        (0, None, "workers = 0: allowed: 1 or more"),
        (2, "tcp://a:1", "allowed: one of them"),
        (None, "", "scheduler = '': allowed: the address of a running scheduler"),
        (None, " ", "scheduler = ' ': allowed: the address of a running scheduler"),
    ],
)
def test_invalid_pools(workers, scheduler, text):
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
