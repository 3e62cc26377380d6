"""Faults of the system around a command: folders that vanish, closed pipes, clocks, limits of memory, slow locks."""

import itertools
import os
import random
import resource
import shutil
import subprocess
import sys
import threading
import time

import pytest

import meeframe
from meeframe.common.errors import ResultError
from meeframe.model.load import load_case
from meeframe.results import output

COMMAND = [sys.executable, "-c", "from meeframe.cli import main; main()"]
BARE = "\n[output]\nfigures = false\nvtu = false\n"
HALF_SPACE = """
material = { name = "pzt-4" }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 4 }
formulation = { name = "half-space" }
indenter = { name = "sphere", radius = "100 mm" }
steps = [{ approach = "10 um" }]
"""
WINKLER = 'name = "winkler"\nstiffness = "1e14 Pa/m"'


@pytest.fixture
def two_increments(write_case, registry):
    """Return a case of two increments on springs."""
    return load_case(write_case(("[[steps]]", "[[steps]]\nincrements = 2"), more=BARE), registry)


def test_a_folder_that_vanishes(two_increments, tmp_path):
    out, written = tmp_path / "out", itertools.count()

    def remove(stage, _fraction):
        if stage == "writing" and next(written) == 1:
            shutil.rmtree(out)

    with pytest.raises(ResultError, match=rf"{out}.* cannot be written: No such file or directory"):
        meeframe.run(two_increments, out, progress=remove)


def test_a_clock_that_goes_back(two_increments, tmp_path, monkeypatch):
    backward = itertools.count(1.7e9, -3600.0)
    monkeypatch.setattr(time, "time", lambda: next(backward))
    result = meeframe.run(two_increments, tmp_path / "out")
    assert [step.status for step in result.steps] == ["converged"] * 2
    assert all(0.0 <= seconds < 60.0 for seconds in result.timings.values())
    assert len(meeframe.read_result(tmp_path / "out").steps) == 2


@pytest.mark.full
def test_a_reader_that_closes_its_pipe():
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([*COMMAND, "materials"], stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, "")


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("command", ["--version", "--help", "doctor", "materials"])
def test_a_full_or_closed_standard_output(command):
    """Python writes what is left in its buffer at the end."""
    with open("/dev/full", "w") as full:
        done = subprocess.run([*COMMAND, command], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "error: the standard output cannot be written: no space is left on its device\n"
    script = "import os, sys; os.close(1); os.execv(sys.argv[1], sys.argv[1:])"
    closed = [sys.executable, "-c", script, *COMMAND, command]
    done = subprocess.run(closed, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.full
def test_a_full_standard_error(tmp_path):
    """Its messages are lost; results and status are not."""
    path, out = tmp_path / "case.toml", tmp_path / "out"
    for text, status in ((HALF_SPACE + BARE, 0), (HALF_SPACE.replace("10 um", "10 u"), 2)):
        path.write_text(text, encoding="utf-8")
        with open("/dev/full", "w") as full:
            command = [*COMMAND, "run", str(path), "--out", str(out), "--overwrite"]
            done = subprocess.run(command, stdout=subprocess.PIPE, stderr=full, text=True, check=False)
        assert done.returncode == status
        assert ("converged" in done.stdout) == (status == 0)
    assert str(meeframe.read_result(out).status) == "converged"


@pytest.mark.full
def test_a_reader_that_closes_its_pipe_during_a_run(tmp_path):
    """Results are written before the summary is printed."""
    path = tmp_path / "case.toml"
    path.write_text(HALF_SPACE + BARE, encoding="utf-8")
    reading, writing = os.pipe()
    os.close(reading)
    arguments = ["run", str(path), "--out", str(tmp_path / "out")]
    done = subprocess.run([*COMMAND, *arguments], stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writing)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert str(meeframe.read_result(tmp_path / "out").status) == "converged"


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    "variables", [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}]
)
def test_titles_that_the_encoding_lacks(tmp_path, variables):
    """They appear as escape sequences."""
    path = tmp_path / "case.toml"
    path.write_text('title = "Kugel auf B\u00f6den"\n' + HALF_SPACE + BARE, encoding="utf-8")
    meeframe.run(path, tmp_path / "out")
    command = [*COMMAND, "show", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | variables, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Kugel auf B\\xf6den")


@pytest.mark.full
def test_an_unknown_threading_layer(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(HALF_SPACE + BARE, encoding="utf-8")
    environment = os.environ | {"NUMBA_THREADING_LAYER": "none", "NUMBA_NUM_THREADS": "2"}
    command = [*COMMAND, "run", str(path), "--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1].startswith("error: environment variable NUMBA_THREADING_LAYER = 'none': ")


@pytest.mark.full
def test_without_a_home(write_case, tmp_path):
    """Neither kernels nor pictures need one; nor can it be created here."""
    path = write_case((WINKLER, 'name = "dense-bem"\nquadrature_tolerance = 1e-3'))
    environment = {"PATH": os.environ["PATH"], "HOME": "/dev/null/none", "OMP_NUM_THREADS": "1"}
    arguments = ["run", str(path), "--out", str(tmp_path / "out")]
    done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "pressure.png").exists()


def test_a_limit_of_memory_below_the_libraries():
    """OpenBLAS would ask for memory again and again, and take notice of no signal but SIGKILL."""

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (400 << 20, 400 << 20))

    done = subprocess.run(
        [*COMMAND, "check", "case.toml"], capture_output=True, text=True, preexec_fn=limit, timeout=60, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith("error: the address space is limited to 400 MiB (ulimit -v); allowed: at least 1024")


@pytest.mark.full
def test_a_limit_of_memory(write_case, tmp_path):
    """Matrices that do not fit, after `ulimit -v`, are invalid input, with one message."""
    path = write_case((WINKLER, 'name = "dense-bem"'), ("divisions = 4", "divisions = 80"), more=BARE)
    gigabytes = 3 << 30

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (gigabytes, gigabytes))

    arguments = ["run", str(path), "--out", str(tmp_path / "out")]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    done = subprocess.run(
        [*COMMAND, *arguments], capture_output=True, text=True, env=environment, preexec_fn=limit, check=False
    )
    assert done.returncode == 2, done.stderr
    assert "memory" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_locks_on_a_slow_file_system(tmp_path, monkeypatch):
    """Whatever the delays of its operations, as over a network, at most one holds the folder."""
    chance, holders, held, refused = random.Random(1), [], [], []

    def delayed(function):
        def call(*arguments, **options):
            time.sleep(chance.choice([0.0, 0.0, 0.001, 0.005]))
            return function(*arguments, **options)

        return call

    def compete():
        for _ in range(40):
            try:
                with output.locked(tmp_path / "out"):
                    holders.append(1)
                    held.append(len(holders))
                    time.sleep(0.001)
                    holders.pop()
            except ResultError as error:
                refused.append(str(error))

    threads = [threading.Thread(target=compete) for _ in range(4)]
    with monkeypatch.context() as patch:
        for module, name in ((output.fcntl, "flock"), (output.os, "open"), (output.os, "stat"), (output.os, "fstat")):
            patch.setattr(module, name, delayed(getattr(module, name)))
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert set(held) == {1}
    assert len(held) + len(refused) == 160
    assert len(held) > 20
    assert [text for text in refused if "in use" not in text] == []
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []
