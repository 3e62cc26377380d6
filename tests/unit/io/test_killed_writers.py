"""Processes that are killed at random moments while writing results lose nothing that was finished."""

import os
import signal
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from meeframe.common.errors import ResultError
from meeframe.results.files import ResultWriter, read_result
from meeframe.results.output import INCREMENTS, LOCK_FILE, RESULT_FILE, clear_output, locked

RANDOM = np.random.default_rng(7)
INCREMENTS_OF_A_RUN = 5


def write_forever(folder: Path, synthetic, pipe: int) -> None:
    """Write one run after another, and report each cleared folder and finished increment to the pipe."""
    steps = [synthetic.step(number * 1e-6, increment=number) for number in range(1, INCREMENTS_OF_A_RUN + 1)]
    while True:
        os.write(pipe, b"c")
        clear_output(folder)
        os.write(pipe, b"s")
        writer = ResultWriter(folder, synthetic.result(planned=INCREMENTS_OF_A_RUN))
        for step in steps:
            writer.append(step)
            os.write(pipe, b"i")
        writer.finish(lambda: synthetic.result(*steps))
        os.write(pipe, b"f")


def kill_after(words: int, seconds: float, task) -> bytes:
    """Return what a child process reported before it was killed, a given time after a given number of reports."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            task(writing)
        finally:
            os._exit(1)
    os.close(writing)
    reports = b""
    while len(reports) < words:
        reports += os.read(reading, 1)
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    while more := os.read(reading, 65536):
        reports += more
    os.close(reading)
    return reports


@pytest.mark.full
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_killed_run_keeps_finished_increments(tmp_path, synthetic):
    expected = [synthetic.step(number * 1e-6, increment=number) for number in range(1, INCREMENTS_OF_A_RUN + 1)]
    computed, unfinished = set(), 0
    for trial in range(30):
        folder = tmp_path / str(trial)
        folder.mkdir()
        words, seconds = RANDOM.integers(1, 2 * INCREMENTS_OF_A_RUN), RANDOM.uniform(0.0, 0.02)
        reports = kill_after(words, seconds, partial(write_forever, folder, synthetic))
        done = reports.rpartition(b"s")[2].count(b"i")
        steps = read_result(folder).steps if (folder / RESULT_FILE).exists() else ()
        if reports[-1:] != b"c":  # the folder may or may not be cleared
            # the last increment may be finished but not reported
            assert len(steps) in (done, min(done + 1, INCREMENTS_OF_A_RUN))
        for step, whole in zip(steps, expected, strict=False):
            assert step.increment == whole.increment
            for name in ("traction", "displacement", "slip", "region", "contact_fraction"):
                np.testing.assert_array_equal(getattr(step, name), getattr(whole, name))
            np.testing.assert_array_equal(step.boundary.values, whole.boundary.values)
        computed.add(len(steps))
        unfinished += (folder / INCREMENTS).exists()
        clear_output(folder)
        assert list(folder.iterdir()) == []
    assert len(computed) > 3
    assert unfinished > 5


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_lock_of_a_folder_ends_with_its_process(tmp_path):
    def hold(pipe):
        with locked(tmp_path / "out"):
            os.write(pipe, b"h")
            time.sleep(60.0)

    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            hold(writing)
        finally:
            os._exit(1)
    os.read(reading, 1)
    with pytest.raises(ResultError, match="out is in use: another process writes there"), locked(tmp_path / "out"):
        pass
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    assert [path.name for path in (tmp_path / "out").iterdir()] == [LOCK_FILE]
    with locked(tmp_path / "out"), pytest.raises(ResultError, match="in use"), locked(tmp_path / "out"):
        pass
    assert list((tmp_path / "out").iterdir()) == []


def test_unused_folder_is_removed(tmp_path):
    with locked(tmp_path / "a" / "b"):
        assert (tmp_path / "a" / "b").is_dir()
    assert list(tmp_path.iterdir()) == []
    with locked(tmp_path / "a" / "b"):
        (tmp_path / "a" / "b" / "kept.txt").touch()
    assert [path.name for path in (tmp_path / "a" / "b").iterdir()] == ["kept.txt"]


def test_increments_are_written_once(tmp_path, synthetic):
    """A finished increment is not modified until the run ends."""
    writer = ResultWriter(tmp_path, synthetic.result(planned=9))
    written = {}
    for number in range(1, 10):
        writer.append(synthetic.step(number * 1e-6, increment=number))
        there = {path.name: path.stat() for path in (tmp_path / INCREMENTS).iterdir()} | {
            "result.h5": (tmp_path / "result.h5").stat()
        }
        for name, before in written.items():
            assert (there[name].st_ino, there[name].st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
        written = there
    assert len(written) == 11
