"""Plugin files are loaded by --plugin only; errors in them are reported with file, line and cause."""

import hashlib
import json
import textwrap
from functools import partial

import numpy as np
import pytest
from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.common.errors import PluginError, PluginFault
from meeframe.laws.base import contact_conductivity
from meeframe.plugin.describe import find, parameters
from meeframe.plugin.registry import Kind, load
from meeframe.plugin.sources import faults_of_plugins, load_file
from meeframe.results.files import read_result

LAW = """
    import math
    from dataclasses import dataclass, field
    from pathlib import Path
    from typing import Annotated, Literal

    import numpy as np
    from pydantic import Field

    from meeframe.plugin import Array, ConductivityLaw, Quantity, Record, hookimpl


    @dataclass(frozen=True)
    class Linear(ConductivityLaw):
        '''kappa = slope p.'''

        slope: Annotated[float, Quantity("F/m^2/Pa", "H/m^2/Pa", gt=0, lt=math.inf)]
        table: Path | None = None
        order: Annotated[int, Field(ge=1, le=3)] = 2
        way: Literal["up", "down"] = "up"
        inner: ConductivityLaw | None = None

        def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
            return np.maximum(-normal_traction, 0.0) * self.slope


    @hookimpl
    def meeframe_conductivity_laws():
        return [Record("linear", Linear, "linear in the pressure", "nobody")]
"""


BARE = "[output]\nfigures = false\nvtu = false\n"


@pytest.fixture
def write(tmp_path):
    def make(text, name="laws.py"):
        path = tmp_path / name
        path.write_text(textwrap.dedent(text), encoding="utf-8")
        return path

    return make


def test_file_registers_only_where_it_is_named(write):
    registry = load(write(LAW))
    law = registry.create(Kind.CONDUCTIVITY_LAW, {"name": "linear", "slope": 2})
    np.testing.assert_allclose(contact_conductivity(law, np.array([-3.0, 1.0])), [6.0, 0.0])
    assert "linear" not in load().names(Kind.CONDUCTIVITY_LAW)
    (entry,) = find(registry, "linear")
    assert entry.provider.name.endswith("laws.py")
    assert entry.provider.version.startswith("sha256:")


def test_changed_file_is_read_again(write):
    assert load(write(LAW)).names(Kind.CONDUCTIVITY_LAW).count("linear") == 1
    changed = load(write(LAW.replace('Record("linear"', 'Record("straight"')))
    assert "straight" in changed.names(Kind.CONDUCTIVITY_LAW)
    assert "linear" not in changed.names(Kind.CONDUCTIVITY_LAW)


def test_description_of_parameters(write):
    registry = load(write(LAW))
    shown = {p.name: (p.unit, p.allowed, p.default) for p in parameters(find(registry, "linear")[0], registry)}
    assert shown == {
        "slope": ("F/m^2/Pa or H/m^2/Pa", "> 0 and finite", "required"),
        "table": ("", "path of a file or nothing", "None"),
        "order": ("", "whole number >= 1 <= 3", "2"),
        "way": ("", "'up' or 'down'", "up"),
        "inner": ("", "conductivity law, name or table or nothing", "None"),
    }
    (built_in,) = find(registry, "dense-bem")
    assert [p.default for p in parameters(built_in, registry)] == ["tabulated", "1e-05", "0.523599"]


def test_result_records_the_plugin_file(write, case_file, tmp_path):
    file = write(LAW)
    with case_file.open("a", encoding="utf-8") as text:
        text.write('[conductivity]\nelectric = {name = "linear", slope = 1e-12}\n' + BARE)
    arguments = ["run", str(case_file), "--out", str(tmp_path / "out"), "--plugin", str(file)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    versions = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["versions"]
    assert versions["laws.py"] == f"sha256:{hashlib.sha256(file.read_bytes()).hexdigest()[:12]}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n\nlaw = (", r"line 3: SyntaxError: '\(' was never closed"),
        ("import math\nslope = math.sine(1)\n", "line 2: AttributeError: module 'math' has no attribute 'sine'"),
        ("import nobody_has_this\n", "line 1: ModuleNotFoundError: No module named 'nobody_has_this'"),
        ("import sys\nsys.exit(3)\n", "line 2: SystemExit: 3"),
        ("x = 1\n", ": it implements no hook of meeframe"),
        ("from meeframe.plugin import hookimpl\n@hookimpl\ndef meeframe_solvers():\n    return 1 / 0\n",
         "line 4: meeframe_solvers: ZeroDivisionError"),
        ("from meeframe.plugin import hookimpl\n@hookimpl\ndef meeframe_solver():\n    return []\n",
         r"unknown hook 'meeframe_solver'; did you mean 'meeframe_solvers'\? allowed: meeframe_f"),
        (LAW.replace("ConductivityLaw):", "object):"), "class Linear is not a meeframe.laws.base.ConductivityLaw"),
        (LAW.replace("def conductivity", "def kappa"), "class Linear lacks conductivity, which meeframe"),
    ],
)  # fmt: skip
def test_invalid_file_is_reported_with_line_and_cause(write, text, message):
    with pytest.raises(PluginError, match=f"plugin file .*laws.py.*{message}"):
        load(write(text))


def test_command_line_reports_without_traceback(write, tmp_path):
    for arguments in (["plugins"], ["check", "case.toml"], ["run", "case.toml", "--out", str(tmp_path / "out")]):
        faults = (
            (tmp_path / "missing.py", "cannot be read"),
            (tmp_path / "case.toml", "is not a Python file; allowed: names that end in .py"),
            (write("1 / 0\n"), "line 1: ZeroDivisionE"),
        )
        for file, message in faults:
            done = CliRunner().invoke(app, [*arguments, "--plugin", str(file)])
            assert done.exit_code == 2
            assert done.stderr.startswith(f"error: plugin file {file}")
            assert message in done.stderr


WORN = """
    from dataclasses import dataclass

    from meeframe.laws import IsotropicCoulomb
    from meeframe.plugin import ContactLaw, Record, hookimpl


    @dataclass(frozen=True)
    class Worn(ContactLaw):
        mu: float = 0.1
        lasts: bool = True

        def project(self, trial):
            return IsotropicCoulomb(self.mu if self.lasts else "none").project(trial)

        def tangential_scaling(self):
            return IsotropicCoulomb(self.mu).tangential_scaling()

        def for_increment(self, slip_path, duration):
            assert not slip_path.any(), "worn through"
            return self


    @hookimpl
    def meeframe_contact_laws():
        return [Record("worn", Worn, "for one increment", "nobody")]
"""


def test_failing_law_is_reported_and_finished_steps_are_saved(write, case_file, tmp_path):
    """The law fails in the second increment; a law that fails at once is reported at its key before anything is
    computed."""
    file, case, out = write(WORN), case_file.read_text(encoding="utf-8"), tmp_path / "out"
    drag = '\n[[steps]]\ntranslation = ["1 um", 0]\nincrements = 2\n'
    case_file.write_text(case + drag + '[contact]\nlaw = "worn"\n' + BARE, encoding="utf-8")
    done = CliRunner().invoke(app, ["run", str(case_file), "--out", str(out), "--plugin", str(file)])
    assert done.exit_code == 2
    line = 1 + file.read_text(encoding="utf-8").splitlines().index('        assert not slip_path.any(), "worn through"')
    failed = f"error: plugin file {file}, line {line}, in for_increment: AssertionError: worn through; "
    assert done.stderr.splitlines()[-1] == f"{failed}1 of 4 increments are finished and in {out}"
    assert len(read_result(out).steps) == 1
    case_file.write_text(case + drag + '[contact]\nlaw = {name = "worn", lasts = false}\n', encoding="utf-8")
    done = CliRunner().invoke(app, ["check", str(case_file), "--plugin", str(file)])
    assert (done.exit_code, len(done.stderr.splitlines())) == (2, 1)
    assert f"{case_file}: contact.law: IsotropicCoulomb: mu = 'none': cannot be read" in done.stderr


PASSING = """
    from dataclasses import dataclass
    from pathlib import Path

    from meeframe.laws import Signorini
    from meeframe.plugin import ContactLaw, Record, hookimpl


    @dataclass(frozen=True)
    class Passing(ContactLaw):
        flag: str

        def project(self, trial):
            return Signorini().project(trial)

        def tangential_scaling(self):
            return Signorini().tangential_scaling()

        def for_increment(self, slip_path, duration):
            if slip_path.any() and Path(self.flag).exists():
                FAULT
            return self


    @hookimpl
    def meeframe_contact_laws():
        return [Record("passing", Passing, "fails while there is a file", "nobody")]
"""


@pytest.mark.full
@pytest.mark.parametrize(
    ("fault", "reported", "status"),
    [("1 / 0", "ZeroDivisionError: division by zero", 1), ("raise OSError(28, 'No room')", "[Errno 28] No room", 2)],
)
def test_sweep_retries_failed_laws(write, write_case, tmp_path, fault, reported, status):
    """A full disk ends the sweep."""
    flag, out, study = tmp_path / "flag", tmp_path / "out", tmp_path / "study.toml"
    flag.touch()
    file = write(PASSING.replace("FAULT", fault))
    drag = '\n[[steps]]\ntranslation = ["1 um", 0]\nincrements = 2\n'
    springs = 'name = "winkler"\nstiffness = "1e14 Pa/m"'
    bem = 'name = "dense-bem"\nquadrature_tolerance = 1e-3'
    write_case((springs, bem), more=f'{drag}[contact]\nlaw = {{name = "passing", flag = "{flag}"}}\n')
    study.write_text('case = "case.toml"\n[axes]\n"steps[1].approach" = ["10 um"]\n', encoding="utf-8")
    arguments = ["sweep", str(study), "--out", str(out), "--workers", "1", "--plugin", str(file)]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == status, done.stdout + done.stderr
    assert reported in done.stdout + done.stderr
    flag.unlink()
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.stdout + done.stderr
    assert "converged" in done.stdout


def test_law_that_fails_at_first_use_is_reported_at_its_key(write, case_file):
    file = write(LAW.replace("np.maximum", "np.maxinum"))
    with case_file.open("a", encoding="utf-8") as text:
        text.write('[conductivity]\nelectric = {name = "linear", slope = 1e-12}\n')
    done = CliRunner().invoke(app, ["check", str(case_file), "--plugin", str(file)])
    assert done.exit_code == 2
    assert f"error: {case_file}: conductivity.electric: plugin file {file}, line " in done.stderr
    assert "in conductivity: AttributeError: module 'numpy' has no attribute 'maxinum'" in done.stderr


def test_defects_elsewhere_are_not_attributed_to_plugins():
    with pytest.raises(ZeroDivisionError), faults_of_plugins():
        1 / 0  # noqa: B018


CALLING = """
    class Callers:
        def __init__(self, call):
            self.call = call

        def reduce(self):
            self.call()
"""


def called_from_a_plugin(file, call):
    with faults_of_plugins():
        load_file(file)[1].Callers(call).reduce()


def test_exceptions_of_callbacks_propagate(write, tmp_path):
    (tmp_path / "plugin").mkdir()
    file = write(CALLING, "plugin/calling.py")
    with pytest.raises(ZeroDivisionError):
        called_from_a_plugin(file, lambda: 1 / 0)


def test_faults_name_the_innermost_frame_too(write, tmp_path):
    """The innermost frame may be in a library, or in meeframe code that the plugin called."""
    file = write(CALLING)
    reported = rf"plugin file {file}, line 7, in reduce: LinAlgError: .*; raised in .*linalg.*\.py, line \d+, in \w+"
    with pytest.raises(PluginFault, match=reported) as caught:
        called_from_a_plugin(file, partial(np.linalg.inv, np.zeros((2, 2))))
    assert isinstance(caught.value.__cause__, np.linalg.LinAlgError)


def test_value_error_of_a_constructor_is_reported_at_the_key(write, case_file):
    """A ValueError of __post_init__ is no defect of the plugin; any other error is."""
    method = "def __post_init__(self):\n            CHECK\n\n        def conductivity"
    refusing = LAW.replace("def conductivity", method)
    with case_file.open("a", encoding="utf-8") as text:
        text.write('[conductivity]\nelectric = {name = "linear", slope = 1e-12}\n')
    for number, (check, reported) in enumerate(
        [("raise ValueError('slope is too small')", "slope is too small\n"), ("1 / 0", "plugin file ")]
    ):
        file = write(refusing.replace("CHECK", check), f"laws_{number}.py")
        done = CliRunner().invoke(app, ["check", str(case_file), "--plugin", str(file)])
        assert done.exit_code == 2
        assert f"error: {case_file}: conductivity.electric: {reported}" in done.stderr


def test_duplicate_names_in_a_file_are_rejected(write):
    with pytest.raises(PluginError, match=r"conductivity law 'linear' is provided twice: by .*a.py .*and by .*b.py "):
        load(write(LAW, "a.py"), write(LAW, "b.py"))


def test_show_suggests_similar_names():
    done = CliRunner().invoke(app, ["plugins", "show", "orthotropic-colomb"])
    assert (done.exit_code, done.stdout) == (2, "")
    assert "unknown name 'orthotropic-colomb'; did you mean 'orthotropic-coulomb'? allowed: " in done.stderr


def test_show_prints_parameters_and_formula():
    done = CliRunner().invoke(app, ["plugins", "show", "orthotropic-coulomb"])
    assert done.exit_code == 0
    lines = [line.split() for line in done.stdout.splitlines()]
    assert ["mu1", "1", ">=", "0", "required"] in lines
    assert ["angle", "rad", "finite", "0"] in lines
    assert "source: the reference paper, eqs. 11-16" in done.stdout
    assert "radial return of eq. (16)" in done.stdout
