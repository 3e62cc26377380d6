"""Test the command line in separate processes: start, signals, kill."""

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
    return subprocess.run([sys.executable, *map(str, arguments)], capture_output=True, text=True, timeout=900)


@pytest.mark.full
def test_the_module_of_the_console_script_runs(case_file):
    done = python("-c", "from meeframe.cli import main; main()", "check", case_file)
    assert (done.returncode, done.stderr) == (0, "")
    assert "ok: material batio3-cofe2o4" in done.stdout


END = "os.kill(os.getpid(), signal.{signal})"
END_WHILE_LETTING_GO = "Kept(); time.sleep(1)"  # Python ignores exceptions raised there


@pytest.mark.full(except_for=1)
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


IN_COMPILED_CODE = """
import os, signal, sys, threading, time
import numba, numpy as np, typer
from meeframe.cli.console import exit_status

signal.signal(signal.SIGINT, signal.default_int_handler)

@numba.njit(nogil=True)
def long(n):
    total = np.zeros(1)
    for i in range(n):
        total[0] += np.sin(i)
    return total

long(1)
try:
    with exit_status():
        threading.Timer(0.05, os.kill, [os.getpid(), signal.{signal}]).start()
        long(20_000_000)
        time.sleep(20)
except typer.Exit as ended:
    sys.exit(ended.exit_code)
"""


@pytest.mark.full
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_interruptions_in_compiled_code(name):
    done = python("-c", IN_COMPILED_CODE.replace("{signal}", name))
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


def test_interrupted_during_import():
    """The command that would print a message does not exist yet."""
    script = "import sys\nclass Stop:\n def find_spec(self, name, *_):\n  if name == 'typer': raise KeyboardInterrupt\n"
    done = python("-c", f"{script}sys.meta_path.insert(0, Stop())\nfrom meeframe.cli import main")
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


STOPS_AT = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
class Stop:
    def find_spec(self, name, *_):
        if name == "{name}":
            os.kill(os.getpid(), signal.{signal})
sys.meta_path.insert(0, Stop())
from meeframe.cli import main
main()
"""
STOPS_AGAIN = """
import atexit, os, signal, sys
import meeframe.cli
signal.signal(signal.SIGINT, signal.default_int_handler)
class Last:
    def __del__(self):
        os.kill(os.getpid(), signal.{signal})
sys.last = Last()  # the last modules that Python clears
atexit.register(lambda: os.kill(os.getpid(), signal.{signal}))
def stop():
    os.kill(os.getpid(), signal.{signal})
meeframe.cli.app = stop
meeframe.cli.main()
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_signals_at_the_start_and_after_the_message(name):
    """Between the first statement and the command, and while Python ends."""
    for script in (
        STOPS_AT.format(name="typer", signal=name),
        STOPS_AT.format(name="typer.main", signal=name),
        STOPS_AGAIN.format(signal=name),
    ):
        done = python("-c", script)
        assert (done.returncode, done.stderr) == (130, "interrupted\n")


def test_the_package_imports_nothing_before_the_command_line():
    """Until signals are handled."""
    done = python("-c", "import sys; sys.modules.pop('typing', None); import meeframe; print('typing' in sys.modules)")
    assert done.stdout == "False\n"


def test_bare_import_is_light():
    heavy = "numba", "matplotlib", "pint", "h5py", "meshio", "scipy"
    done = python("-c", f"import sys, meeframe; print([m for m in {heavy} if m in sys.modules])")
    assert done.stdout == "[]\n"
