"""Plugins whose laws never return: the time limit ends the call, wherever it runs, and what is finished remains."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import pytest

import meeframe
from meeframe.common.errors import PluginFault
from meeframe.model.load import load_case
from meeframe.plugin.registry import load
from meeframe.results.files import read_result
from meeframe.study.sweep.engine import pool_of
from meeframe.study.sweep.run import sweep

PLUGIN = """
import time
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from meeframe.laws import IsotropicCoulomb
from meeframe.plugin import ConductivityLaw, ContactLaw, Indenter, Record, WearLaw, hookimpl

LIMIT = 0.5


def hang(how):
    while how == "stubborn":
        try:
            hang("loop")
        except BaseException:
            how = "loop"
    while how == "loop":
        pass
    if how == "sleep":
        time.sleep(1000.0)


@dataclass(frozen=True)
class Friction(ContactLaw):
    # hangs in increments that begin after slip, so not in the first one
    how: str = "nothing"
    slipped: bool = False
    time_limit: ClassVar[float] = LIMIT

    def project(self, trial):
        if self.slipped:
            hang(self.how)
        return IsotropicCoulomb(0.3).project(trial)

    def tangential_scaling(self):
        return np.eye(2)

    def for_increment(self, slip_path, duration):
        return replace(self, slipped=len(slip_path) == 49 and slip_path.any())


@dataclass(frozen=True)
class Conduction(ConductivityLaw):
    how: str = "nothing"
    time_limit: ClassVar[float] = LIMIT

    def conductivity(self, normal_traction, gap, drop):
        hang(self.how)
        return np.where(normal_traction < 0.0, 1e-6, 0.0)


@dataclass(frozen=True)
class Wear(WearLaw):
    how: str = "nothing"
    time_limit: ClassVar[float] = LIMIT

    def rate(self, pressure, speed, worn):
        hang(self.how)
        return 1e-13 * pressure


@dataclass(frozen=True)
class Ball(Indenter):
    how: str = "nothing"
    time_limit: ClassVar[float] = LIMIT

    def height(self, x, y):
        hang(self.how)
        return (x**2 + y**2) / 0.2


@hookimpl
def meeframe_contact_laws():
    return [Record("friction", Friction, "hangs", "nobody")]


@hookimpl
def meeframe_conductivity_laws():
    return [Record("conduction", Conduction, "hangs", "nobody")]


@hookimpl
def meeframe_wear_laws():
    return [Record("wear", Wear, "hangs", "nobody")]


@hookimpl
def meeframe_indenters():
    return [Record("ball", Ball, "hangs", "nobody")]
"""
CASE = """
material = { name = "pzt-4" }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 6 }
formulation = { name = "half-space" }
output = { figures = false, vtu = false }
steps = [{ approach = "10 um" }, { translation = ["1 um", 0] }]
"""
FRICTION = 'contact = { law = { name = "friction", how = "%s" } }\nindenter = { name = "sphere", radius = "100 mm" }\n'
HOOKS = {
    "project": FRICTION,
    "conductivity": 'conductivity = { electric = { name = "conduction", how = "%s" } }\n'
    'indenter = { name = "sphere", radius = "100 mm" }\n',
    "rate": 'contact = { law = { name = "isotropic-coulomb", mu = 0.1 }, wear = { name = "wear", how = "%s" } }\n'
    'indenter = { name = "sphere", radius = "100 mm" }\n',
    "height": 'indenter = { name = "ball", how = "%s" }\n',
}


@pytest.fixture(autouse=True)
def interruptible():
    """Handle SIGINT as in a foreground process, also where a shell runs the tests in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def plugin(tmp_path):
    file = tmp_path / "hanging.py"
    file.write_text(PLUGIN, encoding="utf-8")
    return file


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a case."""

    def write_case(more):
        path = tmp_path / "case.toml"
        path.write_text(more + CASE, encoding="utf-8")
        return path

    return write_case


def words(plugin, hook):
    return rf"plugin file {plugin}, line \d+, in {hook}: hangs, has not returned within 0\.5 s"


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("hook", HOOKS)
def test_a_hook_that_hangs_is_a_fault_of_the_plugin(plugin, write, hook):
    with pytest.raises(meeframe.MeeframeError, match=words(plugin, hook)):
        meeframe.solve_case(load_case(write(HOOKS[hook] % "loop"), load(plugin)))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("how", ["sleep", "stubborn"])
def test_hooks_that_wait_or_catch_everything(plugin, write, how):
    with pytest.raises(PluginFault, match=words(plugin, "project")):
        meeframe.solve_case(load_case(write(FRICTION % how), load(plugin)))


@pytest.mark.full
@pytest.mark.parametrize("handler", [signal.SIG_IGN, lambda *_: None])
def test_without_an_interrupt_handler(plugin, write, handler):
    """Background jobs of a shell ignore Ctrl-C, and programs may handle it otherwise."""
    before = signal.signal(signal.SIGINT, handler)
    try:
        with pytest.raises(PluginFault, match=words(plugin, "project")):
            meeframe.solve_case(load_case(write(FRICTION % "loop"), load(plugin)))
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.full
def test_another_thread(plugin, write):
    """Workers of sweeps and servers solve in threads of their own."""
    case, errors = load_case(write(FRICTION % "loop"), load(plugin)), []

    def solve():
        try:
            meeframe.solve_case(case)
        except PluginFault as error:
            errors.append(str(error))

    thread = threading.Thread(target=solve)
    thread.start()
    thread.join(60.0)
    assert len(errors) == 1
    assert "has not returned within 0.5 s" in errors[0]


def test_slow_calls_within_the_limit_and_other_code_are_not_interrupted(plugin, write):
    """The limit is of one call, not of their sum, nor of code outside of plugins."""
    path = write(FRICTION % "nothing")
    slow = "if len(CALLS) < 4 and len(trial) == 49:\n            time.sleep(0.2)\n            CALLS.append(1)"
    text = PLUGIN.replace("if self.slipped:\n            hang(self.how)", slow)
    plugin.write_text(text.replace("LIMIT =", "CALLS = []\nLIMIT ="), encoding="utf-8")
    begin = time.monotonic()
    result = meeframe.solve_case(load_case(path, load(plugin)))
    assert [step.status for step in result.steps] == ["converged"] * 2
    assert time.monotonic() - begin > 0.8
    watchdogs = [thread for thread in threading.enumerate() if thread.name == "meeframe-watchdog"]
    for thread in watchdogs:
        thread.join(timeout=60)  # told to end, but perhaps not scheduled yet
    assert not any(thread.is_alive() for thread in watchdogs)


def test_an_interruption_by_the_user_stays_one(plugin, write, tmp_path):
    sleeping = tmp_path / "sleeping"
    text = PLUGIN.replace("LIMIT = 0.5", "LIMIT = 60.0")
    text = text.replace("time.sleep(1000.0)", f"open({str(sleeping)!r}, 'w').close()\n        time.sleep(1000.0)")
    plugin.write_text(text, encoding="utf-8")
    case = load_case(write(FRICTION % "sleep"), load(plugin))

    def interrupt():
        end = time.monotonic() + 60.0
        while not sleeping.exists() and time.monotonic() < end:
            time.sleep(0.02)
        time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        meeframe.solve_case(case)
    thread.join()


@pytest.mark.full
def test_code_under_a_debugger_runs_after_a_fault(plugin, write):
    """An interruption that is still due would keep traced code from ever ending."""
    program = f"""
import sys
from pathlib import Path
import meeframe
from meeframe.model.load import load_case
from meeframe.plugin.registry import load

try:
    meeframe.solve_case(load_case({str(write(FRICTION % "stubborn"))!r}, load(Path({str(plugin)!r}))))
except meeframe.MeeframeError as error:
    sys.settrace(lambda *_: None)
    print((lambda: error)())
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert "in project: hangs" in done.stdout, done.stderr


def test_run_ends_with_status_2_and_keeps_finished_increments(plugin, write, tmp_path):
    arguments = ["run", str(write(FRICTION % "loop")), "--out", str(tmp_path / "out"), "--plugin", str(plugin)]
    done = subprocess.run([sys.executable, "-m", "meeframe", *arguments], capture_output=True, text=True, timeout=120)
    assert done.returncode == 2
    assert "in project: hangs, has not returned within 0.5 s" in done.stderr
    assert "1 of 2 increments are finished" in done.stderr
    assert "Traceback" not in done.stderr
    assert len(read_result(tmp_path / "out").steps) == 1


@pytest.mark.full
@pytest.mark.parametrize("workers", [1, 2])
def test_points_that_hang_fail_and_the_sweep_goes_on(plugin, write, tmp_path, workers):
    write(FRICTION % "nothing")
    study = tmp_path / "study.toml"
    study.write_text(
        textwrap.dedent("""
        case = "case.toml"
        [axes]
        "contact.law.how" = ["nothing", "loop"]
        """),
        encoding="utf-8",
    )
    with pool_of(workers, plugins=[plugin]) as pool:
        computed = sweep(study, tmp_path / "out", registry=load(plugin), pool=pool)
    assert computed.status.tolist() == ["converged", "failed"]
    assert "in project: hangs, has not returned within 0.5 s" in computed.message.tolist()[1]
