"""Test commands: what they print and write, and their exit status."""

import json
import signal
from importlib import metadata

import numba
import numpy as np
import pytest
from typer.testing import CliRunner

import meeframe
from meeframe.api import progress
from meeframe.cli import app, main
from meeframe.formulations.dense_bem import DenseBEM

BARE = "\n[output]\nfigures = false\nvtu = false\n"
OUTPUT = [
    "electric_potential.png", "fields.pvd", "fields.series", "fields.vtu", "history.png", "magnetic_potential.png",
    "pressure.png", "result.h5", "sections.png", "summary.json",
]  # fmt: skip


def meeframe_command(*arguments):
    """Return exit status, standard output and standard error."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


def test_version():
    status, out, _ = meeframe_command("--version")
    assert (status, out) == (0, f"meeframe {meeframe.__version__}\n")
    assert metadata.version("meeframe") == meeframe.__version__


def test_check(case_file):
    status, out, err = meeframe_command("check", case_file)
    assert (status, err) == (0, "")
    assert out == f"{case_file}: ok: material batio3-cofe2o4, 80 elements, contact zone contact of 25 nodes, 2 steps\n"


@pytest.mark.full
def test_slender_bodies_cause_a_warning(case_file, tmp_path):
    """For a block of 0.1 x 0.1 x 2 m, `check` prints the warning and `run` adds it to the message of the first step."""
    case_file.write_text(case_file.read_text().replace('height = "120 mm"', 'height = "2 m"'))
    status, out, err = meeframe_command("check", case_file)
    assert status == 0
    assert "ok: material" in out
    assert err.startswith("warning: the body extends 2 m from its supports")
    assert err.count("\n") == 1
    assert meeframe_command("run", case_file, "--out", tmp_path / "out")[0] == 0
    first, second = json.loads((tmp_path / "out" / "summary.json").read_text())["steps"]
    assert err.removeprefix("warning: ").strip() in first["message"]
    assert "its bending" not in second["message"]


NOISY = """
import warnings
from dataclasses import dataclass
from meeframe.laws import Signorini
from meeframe.plugin import ContactLaw, Record, hookimpl


@dataclass(frozen=True)
class Noisy(ContactLaw):
    def project(self, trial):
        warnings.warn("of two\\nlines")
        return Signorini().project(trial)

    def tangential_scaling(self):
        return Signorini().tangential_scaling()


@hookimpl
def meeframe_contact_laws():
    return [Record("noisy", Noisy, "warns", "nobody")]
"""


@pytest.mark.filterwarnings("always:of two")
def test_warnings_of_libraries_are_shown_once(case_file, tmp_path):
    plugin = tmp_path / "noisy.py"
    plugin.write_text(NOISY, encoding="utf-8")
    with case_file.open("a", encoding="utf-8") as text:
        text.write('[contact]\nlaw = "noisy"\n' + BARE)
    status, _, errors = meeframe_command("run", case_file, "--plugin", plugin, "--out", tmp_path / "out")
    assert status == 0
    warnings_printed = [line for line in errors.splitlines() if "Warning" in line or "lines" in line]
    assert warnings_printed == [f"warning: {plugin}, line 11: UserWarning: of two lines"]


@pytest.mark.full
def test_studies_warn_once_for_each_body(case_file, tmp_path, monkeypatch):
    """A sweep over two approaches and two widths of a slender block, and a comparison of two solvers, print each
    warning once."""
    case_file.write_text(case_file.read_text().replace('height = "120 mm"', 'height = "2 m"'))
    calls = []
    warnings = DenseBEM.warnings
    monkeypatch.setattr(DenseBEM, "warnings", lambda *given: calls.append(given) or warnings(*given))
    study = case_file.with_name("study.toml")
    axes = '"steps[1].approach" = ["10 um", "20 um"]\n"mesh.half_width" = ["50 mm", "60 mm"]'
    study.write_text(f'case = "{case_file.name}"\n[axes]\n{axes}\n')
    for command in (
        ("sweep", study, "--workers", 1),
        ("compare", case_file, "--solver", "uzawa", "--solver", "newton"),
    ):
        status, _, err = meeframe_command(*command, "--out", tmp_path / command[0])
        assert status == 0
        warnings_printed = [line for line in err.splitlines() if line.startswith("warning: ")]
        widths = ("0.1", "0.12") if command[0] == "sweep" else ("0.1",)
        assert [line.split("thickness of ")[1].split(" m, ")[0] for line in warnings_printed] == list(widths)
        assert len(calls) == len(widths)
        calls.clear()


def test_run_show_and_no_overwriting(case_file, tmp_path):
    folder = tmp_path / "out"
    status, out, err = meeframe_command("run", case_file, "--out", folder)
    assert status == 0
    assert "assembly" in err
    assert sorted(path.name for path in folder.iterdir()) == OUTPUT
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["status"] == "converged"
    assert f"{summary['steps'][1]['force'][2]:.6g}" in out
    assert summary["steps"][1]["force"][2] < 2 * summary["steps"][0]["force"][2] < 0
    assert 0.0 < summary["steps"][1]["unbalance"]["relative"][0] < 0.5
    assert "unbalanced force" in out
    assert meeframe_command("show", folder)[:2] == (0, out)
    status, _, err = meeframe_command("run", case_file, "--out", folder)
    assert status == 2
    assert "is not empty" in err


def test_contact_at_zone_boundary_causes_a_warning(case_file, tmp_path):
    case_file.write_text(case_file.read_text() + "\n[output]\nfigures = false\n")
    assert "edge of its zone" not in meeframe_command("run", case_file, "--out", tmp_path / "within")[2]
    case_file.write_text(case_file.read_text().replace('"40 um"', '"1 mm"').replace('"uzawa"', '"auto"'))
    status, _, err = meeframe_command("run", case_file, "--out", tmp_path / "beyond")
    assert status == 0
    assert "warning: the contact reaches the boundary of its zone and is cut off there" in err


@pytest.mark.full
def test_figures_of_any_increment_in_any_format(case_file, tmp_path):
    case_file.write_text(case_file.read_text() + "\n[output]\nfigures = false\n")
    assert meeframe_command("run", case_file, "--out", tmp_path / "out")[0] == 0
    status, out, _ = meeframe_command("figures", tmp_path / "out", "--step", "1", "--format", "pdf", "--out", tmp_path)
    assert status == 0
    assert (tmp_path / "pressure.pdf").read_bytes().startswith(b"%PDF")
    assert str(tmp_path / "pressure.pdf") in out.splitlines()
    for option, message in ((("--step", "9"), "no such increment"), (("--format", "bmp"), "allowed: png, pdf, svg")):
        status, _, err = meeframe_command("figures", tmp_path / "out", *option)
        assert status == 2
        assert message in err


def test_fields_of_a_run_are_written_again(case_file, tmp_path):
    text, folder, again = case_file.read_text(), tmp_path / "out", tmp_path / "again"
    case_file.write_text(text + "\n[output]\nfigures = false\n")
    assert meeframe_command("run", case_file, "--out", folder)[0] == 0
    status, out, _ = meeframe_command("fields", folder, "--out", again)
    assert (status, out.splitlines()) == (0, [str(again / "fields.vtu"), str(again / "fields.pvd")])
    for name in ("fields.vtu", "fields.pvd", "fields.series/0001.vtu", "fields.series/0002.vtu"):
        assert (again / name).read_bytes() == (folder / name).read_bytes()
    case_file.write_text(text + "\n[output]\nfigures = false\nvtu = false\nfields = []\n")
    assert meeframe_command("run", case_file, "--out", folder, "--overwrite")[0] == 0
    status, _, err = meeframe_command("fields", folder)
    assert status == 2
    assert "the result holds no fields on the whole boundary" in err
    assert sorted(path.name for path in folder.iterdir()) == ["result.h5", "summary.json"]


@pytest.mark.parametrize("command", ["compare", "verify", "sweep", "reproduce"])
def test_unknown_formats_are_refused_before_anything_is_read(command, tmp_path):
    status, _, err = meeframe_command(command, "missing.toml", "--out", tmp_path / "out", "--format", "bmp")
    assert (status, err) == (2, "error: format 'bmp': allowed: png, pdf, svg\n")
    assert not (tmp_path / "out").exists()


def test_status_1_if_a_step_does_not_converge(case_file, tmp_path):
    case_file.write_text(case_file.read_text().replace("tolerance = 1e-6", "tolerance = 1e-6\nmax_iterations = 1"))
    status, out, _ = meeframe_command("run", case_file, "--out", tmp_path / "out")
    assert status == 1
    assert "not-converged: 2 of 2 steps" in out
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert [step["status"] for step in summary["steps"]] == ["iteration-limit"] * 2
    written = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert written == [name for name in OUTPUT if name != "history.png"]  # shows the converged increments


WRONG = {
    "unknown key": (
        "radius =",
        "raduis =",
        "indenter.raduis = '100 mm': unknown key; did you mean 'radius'? allowed: radius, profile, x, y",
    ),
    "missing key": ('radius = "100 mm"', "", "indenter.radius: missing key"),
    "wrong unit": ('"100 mm"', '"100 K"', "indenter.radius = '100 K': has the wrong unit; expected a number in m"),
    "NaN": ('"120 mm"', "nan", "mesh.height = nan: is not a number (NaN)"),
    "negative kappa": (
        "[formulation]",
        '[conductivity.electric]\nname = "step"\nkappa = -2\n[formulation]',
        "conductivity.electric.kappa = -2: must be >= 0",
    ),
    "inadmissible material": (
        'name = "batio3-cofe2o4"',
        'name = "isotropic"\nyoung_modulus = "-1 GPa"\npoisson_ratio = 0.3',
        "material: material 'isotropic': young_modulus is -1000000000.0 Pa, must be positive",
    ),
    "zone outside": ('contact_width = "5 mm"', 'contact_width = "5 m"', "mesh: contact_width = "),
    "unknown name": ('"uzawa"', '"uzava"', "solver.name: unknown solver 'uzava'; did you mean 'uzawa'?"),
}


@pytest.mark.parametrize("command", ["check", "run"])
@pytest.mark.parametrize("kind", WRONG)
def test_invalid_input_gives_one_message_and_status_2(case_file, tmp_path, command, kind):
    old, new, expected = WRONG[kind]
    text = case_file.read_text()
    assert old in text
    case_file.write_text(text.replace(old, new))
    arguments = ["--out", tmp_path / "out"] if command == "run" else []
    status, out, err = meeframe_command(command, case_file, *arguments)
    assert (status, out) == (2, "")
    messages = [line for line in err.splitlines() if line.startswith("error: ")]
    assert len(messages) == 1
    assert messages[0].startswith(f"error: {case_file}: {expected}")
    assert "Traceback" not in err
    assert not (tmp_path / "out").exists()


def test_files_of_the_wrong_kind_are_named(case_file, tmp_path):
    study = tmp_path / "study.toml"
    study.write_text('case = "case.toml"\n[axes]\n"steps[1].approach" = ["1 um"]\n', encoding="utf-8")
    for arguments, reported in (
        (["sweep", case_file, "--out", tmp_path / "out"], f"{case_file}: is a case file; allowed: a study"),
        (["check", study], f"{study}: is a study of the case file 'case.toml'"),
        (["show", case_file], f"no result in {case_file}: it is a file; name the folder of a run"),
    ):
        status, out, err = meeframe_command(*arguments)
        assert (status, out, len(err.splitlines())) == (2, "", 1)
        assert err.startswith(f"error: {reported}")


def test_unwritable_output(case_file, tmp_path):
    (tmp_path / "file").write_text("in the way")
    status, out, err = meeframe_command("run", case_file, "--out", tmp_path / "file")
    assert (status, out) == (2, "")
    assert f"error: output folder {tmp_path / 'file'} cannot be written: it is a file" in err
    assert "assembly" not in err
    assert (tmp_path / "file").read_text() == "in the way"


@pytest.mark.parametrize(
    ("error", "status", "expected"),
    [(KeyboardInterrupt(), 130, "interrupted"), (MemoryError(), 1, "error: not enough memory")],
)
def test_interrupted_run(case_file, tmp_path, monkeypatch, error, status, expected):
    def stop(*_):
        raise error

    monkeypatch.setattr("meeframe.study.run.solve_steps", stop)
    code, out, err = meeframe_command("run", case_file, "--out", tmp_path / "out")
    assert (code, out) == (status, "")
    assert err.splitlines()[-1] == f"{expected}; no increment was finished; nothing was written to {tmp_path / 'out'}"
    assert not (tmp_path / "out").exists()


def test_second_interruption_while_handling_the_first(case_file, tmp_path, monkeypatch):
    """A terminal and a parent process may both send SIGINT; the message must not make wrong statements about the
    folder."""

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("meeframe.study.run.solve_steps", stop)
    monkeypatch.setattr("meeframe.study.run._Run._content", stop)
    code, out, err = meeframe_command("run", case_file, "--out", tmp_path / "out")
    assert (code, out) == (130, "")
    assert err.splitlines()[-1] == "interrupted"


@pytest.fixture
def handlers():
    """Restore the handlers of signals: the process of the tests goes on after `main`."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("name", ["meeframe.cli.console._with_notes", "typer.main.get_command"])
def test_interruptions_outside_the_command_have_a_message(case_file, tmp_path, monkeypatch, capsys, name):
    """One while the message on the first is made, or before the command begins."""

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("meeframe.study.run.solve_steps", stop)
    monkeypatch.setattr(name, stop)
    monkeypatch.setattr("sys.argv", ["meeframe", "run", str(case_file), "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capsys.readouterr()
    assert (ended.value.code, out, err.splitlines()[-1]) == (130, "", "interrupted")


@pytest.mark.parametrize("command", ["check", "show"])
@pytest.mark.parametrize(
    ("error", "status", "expected"),
    [
        (KeyboardInterrupt(), 130, "interrupted\n"),
        (MemoryError(), 2, "error: not enough memory\n"),
        (PermissionError(13, "Permission denied", "folder/file"), 2, "error: folder/file: Permission denied\n"),
        (OSError(36, "File name too long", "xxx"), 2, "error: xxx: File name too long\n"),
        (
            RuntimeError("cannot cache function 'f': no locator available for file 'f.py'"),
            2,
            "error: compiled kernels can be cached neither next to the sources nor in the user's cache folder: set "
            "NUMBA_CACHE_DIR to a writable folder\n",
        ),
    ],
)
def test_interrupted_while_reading(case_file, monkeypatch, command, error, status, expected):
    def stop(*_):
        raise error

    monkeypatch.setattr("meeframe.model.load.load_case", stop)
    monkeypatch.setattr("meeframe.results.files.read_result", stop)
    assert meeframe_command(command, case_file) == (status, "", expected)


def test_os_error_without_a_path_is_a_defect(case_file, monkeypatch):
    """An OSError of a socket or a process keeps its traceback."""

    def stop(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr("meeframe.model.load.load_case", stop)
    with pytest.raises(PermissionError, match="Operation not permitted"):
        meeframe_command("check", case_file)


def test_interrupted_before_the_run(case_file, tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("meeframe.study.run.load_case", stop)
    status, _, err = meeframe_command("run", case_file, "--out", tmp_path / "out")
    assert (status, err.splitlines()[-1]) == (130, f"interrupted; nothing was written to {tmp_path / 'out'}")


@pytest.mark.parametrize("command", ["check", "run"])
def test_mesh_too_large_for_memory(case_file, tmp_path, monkeypatch, command):
    monkeypatch.setattr("meeframe.model.load.block_mesh", lambda *_: np.empty(1 << 59))
    case_file.write_text(case_file.read_text().replace('"120 mm"', '"119 mm"'))  # no other case has this mesh
    arguments = ["--out", tmp_path / "out"] if command == "run" else []
    status, _, err = meeframe_command(command, case_file, *arguments)
    assert status == 2
    assert f"error: {case_file}: mesh: needs more memory than is available: " in err
    assert not (tmp_path / "out").exists()


def test_nothing_to_show(tmp_path):
    status, out, err = meeframe_command("show", tmp_path)
    assert (status, out) == (2, "")
    assert err.startswith(f"error: no result in {tmp_path}")


def test_missing_arguments_are_status_2(case_file):
    assert meeframe_command("run", case_file)[0] == 2
    assert meeframe_command("run")[0] == 2


def list_plugins(*options):
    """Return names by kind, and all lines."""
    status, out, err = meeframe_command("plugins", *options)
    assert (status, err) == (0, "")
    lines = out.splitlines()
    names: dict[str, list[str]] = {}
    kind = ""
    for line in lines[:-1]:
        if line.startswith("  ") and line.strip():
            names[kind].append(line.split()[0])
        elif line.strip():
            kind = line
            names[kind] = []
    return names, lines


def test_plugins_lists_everything_by_kind():
    names, lines = list_plugins()
    assert "power-law" in names["conductivity laws"]
    assert any(line.split()[0] == "power-law" and line.endswith("(meeframe-laws)") for line in lines if line.strip())
    for kind, name in [("solver", "uzawa"), ("formulation", "dense-bem"), ("element", "quad4"), ("indenter", "cone")]:
        assert name in names[f"{kind}s"]
    assert list_plugins("--kind", "contact-law")[0] == {"contact laws": names["contact laws"]}
    status, _, err = meeframe_command("plugins", "--kind", "law")
    assert status == 2
    assert "unknown kind 'law'" in err


def test_help_shows_flags_without_a_value(monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    for command in ("run", "compare", "sweep", "verify"):
        (line,) = [line for line in meeframe_command(command, "--help")[1].splitlines() if "--overwrite" in line]
        assert "<" not in line


def test_threads_of_a_run(case_file, tmp_path):
    case_file.write_text(case_file.read_text() + BARE)
    status, out, _ = meeframe_command("run", case_file, "--out", tmp_path / "out", "--threads", 1)
    assert status == 0
    assert "1 threads" in out
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["threads"] == 1
    assert meeframe_command("run", case_file, "--out", tmp_path / "out", "--threads", 0)[0] == 2
    assert meeframe_command("run", case_file, "--out", tmp_path / "out", "--threads", "9" * 30)[0] == 2


def test_compilation_is_announced_once_for_cached_kernels(tmp_path, monkeypatch):
    """Functions that are compiled in each run, such as those of plugin files, are not announced."""

    def kernel(x):
        return x + 1

    def compile_it(module, cache):
        kernel.__module__ = module
        monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / str(module)))
        numba.njit(kernel, cache=cache)(1)

    reported = []
    with progress._report_compilation(reported.append):
        for module, cache in (("somebody.else", True), ("meeframe.greens._kernels", False), (None, False)):
            compile_it(module, cache)
        compile_it("meeframe_file_rough_0123456789ab", cache=True)
        assert not reported
        for module in ("meeframe_kernels", "meeframe.greens._kernels"):
            compile_it(module, cache=True)
            assert len(reported) == 1
    compile_it("meeframe", cache=True)
    assert len(reported) == 1
