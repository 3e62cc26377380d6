"""The command line as its own process: start, signals, sudden death."""

import json
import signal
import subprocess
import sys

import pytest
from typer.testing import CliRunner

import meeframe
from meeframe.cli import app

AT_SECOND_STEP = """
import os, signal, sys, time
from contextlib import contextmanager
from meeframe.cli import console, main

# a shell's background job is born deaf to SIGINT, and so are its children
signal.signal(signal.SIGINT, signal.default_int_handler)

class Kept:
    def __del__(self):
        os.kill(os.getpid(), signal.{signal})

@contextmanager
def deadly():
    written = []
    def show(stage, fraction):
        written.append(stage == "writing")
        if stage == "contact" and any(written):
            {end}
    yield show

console.progress = deadly
main()
"""


def python(*arguments):
    return subprocess.run([sys.executable, *map(str, arguments)], capture_output=True, text=True, timeout=300)


def test_the_module_of_the_console_script_runs(case_file):
    done = python("-c", "from meeframe.cli import main; main()", "check", case_file)
    assert (done.returncode, done.stderr) == (0, "")
    assert "ok: material batio3-cofe2o4" in done.stdout


END = "os.kill(os.getpid(), signal.{signal})"
END_WHILE_LETTING_GO = "Kept(); time.sleep(1)"  # Python ignores what is raised there


@pytest.mark.parametrize(
    ("name", "end", "status"),
    [
        ("SIGINT", END, 130),
        ("SIGINT", END_WHILE_LETTING_GO, 130),
        ("SIGTERM", END_WHILE_LETTING_GO, 130),
        ("SIGKILL", END, -signal.SIGKILL),
    ],
)
def test_finished_steps_survive(case_file, tmp_path, name, end, status):
    out = tmp_path / "out"
    script = AT_SECOND_STEP.replace("{end}", end).format(signal=name)
    done = python("-c", script, "run", case_file, "--out", out)
    assert done.returncode == status
    assert "Traceback" not in done.stderr
    result = meeframe.read_result(out)
    assert (str(result.status), len(result.steps), result.planned_steps) == ("unfinished", 1, 2)
    assert meeframe.resultants(result.zone, result.steps[0]).force[2] < 0
    if status == 130:
        assert done.stderr == f"interrupted; 1 of 2 increments are finished and in {out}\n"
        assert json.loads((out / "summary.json").read_text())["status"] == "unfinished"
    assert "unfinished: 1 of 2 increments" in CliRunner().invoke(app, ["show", str(out)]).stdout


def test_bare_import_is_light():
    heavy = "numba", "matplotlib", "pint", "h5py", "meshio", "scipy"
    done = python("-c", f"import sys, meeframe; print([m for m in {heavy} if m in sys.modules])")
    assert done.stdout == "[]\n"
