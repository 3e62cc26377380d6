"""Exceptions in plugin code are reported as faults of the plugin, wherever meeframe calls it, with the original
exception as cause."""

import traceback
from dataclasses import replace

import pytest

import meeframe
from meeframe.common.errors import CaseError, PluginFault
from meeframe.mesh import FrictionAxes
from meeframe.model.cache import cached_reduce
from meeframe.model.case import warnings_of
from meeframe.model.load import load_case
from meeframe.model.restart import read_restart
from meeframe.model.second_body import SecondBody
from meeframe.model.solve import bodies_of, joined, reduce_for_contact, solve_steps
from meeframe.plugin.registry import load
from meeframe.study.compare import compare
from meeframe.study.sweep.run import sweep
from meeframe.study.validate import validate

SPRINGS = """
from dataclasses import dataclass

import numpy as np

from meeframe.mesh import find_contact_zone
from meeframe.plugin import NodalFields, Persistence, PersistentFormulation, Record, ReducedSystem, hookimpl, silent

COMPLIANCE = 1e-14 * np.array([1.0, 1.0, 1.0, 1e13, 1e8])


def reach(place, fails):
    if place == fails:
        raise ZeroDivisionError(f"in {place}")


@dataclass(frozen=True, eq=False)
class Bed(ReducedSystem, Persistence):
    fails: str

    def apply(self, load):
        reach("apply", self.fails)
        return COMPLIANCE * load

    def diagonal_blocks(self):
        return np.tile(np.diag(COMPLIANCE), (len(self.points), 1, 1))

    def dense(self):
        reach("dense", self.fails)
        return None

    def recover(self, load):
        reach("recover", self.fails)
        return NodalFields(self.points, self.cells, self.apply(load), load)

    def to_arrays(self):
        reach("to_arrays", self.fails)
        return {"nothing": np.zeros(1)}


@dataclass(frozen=True)
class Springs(PersistentFormulation):
    fails: str = ""

    def check(self, body):
        reach("check", self.fails)

    def warnings(self, body):
        reach("warnings", self.fails)
        return ()

    def reduce(self, body, progress=silent):
        reach("reduce", self.fails)
        zone = find_contact_zone(body.mesh, body.contact_group)
        offset = np.zeros((len(zone.points), 5))
        return Bed(zone.points, zone.frames, zone.weights, zone.cells, offset, self.fails)

    def from_arrays(self, body, arrays):
        reach("from_arrays", self.fails)
        return self.reduce(body)


@hookimpl
def meeframe_formulations():
    return [Record("failing-springs", Springs, "independent springs", "nobody")]
"""
RAISES = '        raise ZeroDivisionError(f"in {place}")'
WINKLER = ('name = "winkler"\nstiffness = "1e14 Pa/m"', 'name = "failing-springs"')


@pytest.fixture
def plugin(tmp_path):
    """Return the file of the springs, and the registry with them."""
    file = tmp_path / "springs.py"
    file.write_text(SPRINGS, encoding="utf-8")
    return file, load(file)


@pytest.fixture
def springs(plugin, write_case):
    """Return a function that creates a case on springs that fail at a given place."""
    case = load_case(write_case(WINKLER), plugin[1])
    return lambda fails: replace(case, formulation=replace(case.formulation, fails=fails))


def solve_whole(case, _folder):
    meeframe.solve_case(case)


def rotated_case(case, _folder):
    joined(replace(case, axes=FrictionAxes(direction=(1.0, 1.0, 0.0))), [case.formulation.reduce(case.body)])


def for_contact(case, _folder):
    reduce_for_contact(*bodies_of(case)[0])


def cached(case, folder):
    cached_reduce(case, folder)


def cached_twice(case, folder):
    """Solve a case whose system is found in the cache; the key does not depend on where the formulation fails."""
    cached_reduce(replace(case, formulation=replace(case.formulation, fails="")), folder)
    (file,) = folder.glob("*.h5")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("meeframe.model.cache.system_key", lambda *_: file.stem)
        cached_reduce(case, folder)


def restarted(case, folder):
    """Continue a run of the same springs without failure."""
    meeframe.run(replace(case, formulation=replace(case.formulation, fails="")), folder)
    later = replace(case, restart=read_restart(folder))
    next(solve_steps(later, case.formulation.reduce(case.body)))


def check_warnings(case, _folder):
    warnings_of(bodies_of(case))


@pytest.mark.parametrize(
    ("fails", "use"),
    [
        ("warnings", check_warnings),
        ("reduce", solve_whole),
        ("apply", solve_whole),
        ("recover", solve_whole),
        ("dense", rotated_case),
        ("to_arrays", for_contact),
        ("from_arrays", for_contact),
        ("dense", cached),
        ("from_arrays", cached_twice),
        ("apply", restarted),
    ],
)
def test_fault_of_a_formulation_names_file_line_and_cause(plugin, springs, tmp_path, fails, use):
    case = springs(fails)
    with pytest.raises(PluginFault) as raised:
        use(case, tmp_path / "out")
    check_fault(raised.value, plugin[0], fails)


def check_fault(error, file, position):
    """Check that the message names the location and that the exception has the complete traceback."""
    lines = SPRINGS.splitlines()
    assert f"plugin file {file}, line {1 + lines.index(RAISES)}, in reach: ZeroDivisionError: in {position}" in str(
        error
    )
    assert isinstance(error.__cause__, ZeroDivisionError)
    passed = {(frame.filename, frame.lineno) for frame in traceback.extract_tb(error.__cause__.__traceback__)}
    assert (str(file), 1 + lines.index(f'        reach("{position}", self.fails)')) in passed


def test_fault_of_the_formulation_of_the_second_body(plugin, springs):
    case = springs("")
    parts = case.material, case.mesh, case.conditions, case.zone
    with pytest.raises(PluginFault) as raised:
        SecondBody(*parts, replace(case.formulation, fails="check"))
    check_fault(raised.value, plugin[0], "check")


@pytest.mark.parametrize("table", ["", "second_body."])
def test_fault_while_reading_a_case(plugin, write_case, second_body, table):
    """The message names the key."""
    failing = ('name = "failing-springs"', 'name = "failing-springs"\nfails = "check"')
    if table:
        second_body = second_body.replace(
            'name = "winkler", stiffness = "3e14 Pa/m"', 'name = "failing-springs", fails = "check"'
        )
        path = write_case(WINKLER, more=second_body)
    else:
        path = write_case((WINKLER[0], failing[1]))
    with pytest.raises(CaseError) as raised:
        load_case(path, plugin[1])
    check_fault(raised.value, plugin[0], "check")
    assert f"{path}: {table}formulation: plugin file" in str(raised.value)


REFUSING = """
from dataclasses import dataclass
from meeframe.laws import Signorini
from meeframe.plugin import ContactLaw, Record, hookimpl


@dataclass(frozen=True)
class Refusing(ContactLaw):
    mu: float

    def __post_init__(self):
        1 / self.mu

    def project(self, trial):
        return Signorini().project(trial)

    def tangential_scaling(self):
        return Signorini().tangential_scaling()


@hookimpl
def meeframe_contact_laws():
    return [Record("refusing", Refusing, "not made without friction", "nobody")]
"""


@pytest.fixture
def rejecting(tmp_path):
    file = tmp_path / "refusing.py"
    file.write_text(REFUSING, encoding="utf-8")
    return load(file)


def test_fault_in_a_constructor(rejecting, write_case):
    path = write_case((WINKLER[0], 'name = "dense-bem"'), more='[contact]\nlaw = { name = "refusing", mu = 0.0 }\n')
    with pytest.raises(CaseError, match=rf"{path}: contact\.law: plugin file .*, in __post_init__: ZeroD") as raised:
        load_case(path, rejecting)
    assert isinstance(raised.value.__cause__, ZeroDivisionError)


ACROSS = """
from dataclasses import dataclass

import numpy as np

from meeframe.plugin import ConductivityLaw, Record, hookimpl


@dataclass(frozen=True)
class Across(ConductivityLaw):
    @property
    def across_gap(self):
        return 1 / 0 > 0

    def conductivity(self, normal_traction, gap, drop):
        return np.zeros_like(gap)


@hookimpl
def meeframe_conductivity_laws():
    return [Record("across", Across, "fails where it is asked what it conducts", "nobody")]
"""


@pytest.mark.parametrize("field", ["electric", "magnetic"])
def test_fault_of_a_conductivity_law(write_case, tmp_path, field):
    file = tmp_path / "across.py"
    file.write_text(ACROSS, encoding="utf-8")
    path = write_case((WINKLER[0], 'name = "dense-bem"'), more=f'[conductivity]\n{field} = "across"\n')
    message = rf"{path}: conductivity\.{field}: plugin file .*, in across_gap: ZeroD"
    with pytest.raises(CaseError, match=message) as raised:
        load_case(path, load(file))
    assert isinstance(raised.value.__cause__, ZeroDivisionError)


def test_fault_of_a_plugin_fails_the_points_of_a_sweep(plugin, write_case, tmp_path):
    """Failed points are tried again; if none can be created, the error has the cause."""
    write_case(WINKLER)
    study = tmp_path / "study.toml"
    study.write_text('case = "case.toml"\n[axes]\n"formulation.fails" = ["", "check", "apply"]\n', encoding="utf-8")
    computed = sweep(study, tmp_path / "out", registry=plugin[1])
    assert computed.status.tolist() == ["converged", "failed", "failed"]
    assert len(list((tmp_path / "out" / "points").iterdir())) == 1
    study.write_text('case = "case.toml"\n[axes]\n"formulation.fails" = ["check"]\n', encoding="utf-8")
    with pytest.raises(CaseError) as raised:
        sweep(study, tmp_path / "none", registry=plugin[1])
    check_fault(raised.value, plugin[0], "check")


def test_comparison_without_valid_runs_has_the_cause(plugin, write_case, tmp_path):
    with pytest.raises(CaseError) as raised:
        compare(
            write_case(WINKLER),
            {"formulation": ['{name = "failing-springs", fails = "check"}']},
            tmp_path / "out",
            registry=plugin[1],
        )
    check_fault(raised.value, plugin[0], "check")


LASTING = """
from dataclasses import dataclass
from meeframe.laws import Signorini
from meeframe.plugin import ContactLaw, Record, hookimpl


@dataclass(frozen=True)
class Lasting(ContactLaw):
    def project(self, trial):
        return Signorini().project(trial)

    def tangential_scaling(self):
        return Signorini().tangential_scaling()

    def for_increment(self, slip_path, duration):
        1 / (duration - 2.0)
        return self


@hookimpl
def meeframe_contact_laws():
    return [Record("lasting", Lasting, "for any duration but two seconds", "nobody")]
"""


def test_fault_of_a_law_in_a_later_step(write_case, tmp_path):
    """Preflight checks evaluate the later steps, too."""
    file = tmp_path / "lasting.py"
    file.write_text(LASTING, encoding="utf-8")
    law = '\nduration = 1.0\n[[steps]]\napproach = "-1 um"\nduration = 2.0\n[contact]\nlaw = "lasting"\n'
    case = load_case(write_case(("10 um", "-1 um"), (WINKLER[0], 'name = "dense-bem"'), more=law), load(file))
    with pytest.raises(PluginFault, match=f"plugin file {file}, line 16, in for_increment: ZeroDivisionError"):
        case.warnings  # noqa: B018


CHECKS = """
from pathlib import Path
import meeframe
from meeframe.model.load import load_case
from meeframe.plugin.registry import load

TITLE, SOURCE = "springs", "nobody"

def run(quick):
    meeframe.solve_case(load_case("{case}", load(Path("{file}"))))
    yield
"""


@pytest.mark.parametrize(("fails", "message"), [("apply", True), ("check", False)])
def test_fault_in_a_validation_case(plugin, write_case, tmp_path, fails, message):
    """If an item of a case has a wrong type, the message names the type."""
    case = write_case((WINKLER[0], f'name = "failing-springs"\nfails = "{fails}"'))
    position = tmp_path / "cases" / "springs"
    position.mkdir(parents=True)
    (position / "checks.py").write_text(CHECKS.format(case=case, file=plugin[0]), encoding="utf-8")
    (report,) = validate(tmp_path / "cases", tmp_path / "out").cases
    assert f"in reach: ZeroDivisionError: in {fails}" in report.error
    assert ("Traceback (most recent call last)" in report.error) is message
    assert (f'reach("{fails}", self.fails)' in report.error) is message
