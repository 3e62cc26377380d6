"""Interruptions that arrive while HDF5 writes a file, or visits what it contains."""

import io
import signal
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
import typer

from meeframe.cli import console
from meeframe.common.hdf5 import open_hdf5
from meeframe.results import hdf5


def write_and_wait(path):
    with hdf5.changed_file(path, "w") as file:
        for name in "abcdefgh":
            file[name] = np.zeros(100_000)
    for _ in range(200):
        time.sleep(0.01)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(("method", "call"), [*(("write", call) for call in range(1, 6)), ("truncate", 1)])
def test_the_status_is_that_of_an_interruption(tmp_path, monkeypatch, capsys, method, call, number):
    calls = {"write": 0, "truncate": 0}

    class Interrupting(io.FileIO):
        def signalled(self, name):
            calls[name] += 1
            if (name, calls[name]) == (method, call):
                signal.raise_signal(number)

        def write(self, data):
            self.signalled("write")
            return super().write(data)

        def truncate(self, size=None):
            self.signalled("truncate")
            return super().truncate(size)

    signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs ignore it
    monkeypatch.setattr(hdf5, "io", SimpleNamespace(FileIO=Interrupting, BytesIO=io.BytesIO))
    with pytest.raises(typer.Exit) as ended, console.exit_status():
        write_and_wait(tmp_path / "result.h5")
    assert ended.value.exit_code == console.INTERRUPTED
    assert capsys.readouterr().err == "interrupted\n"


def test_interrupted_while_links_are_visited(tmp_path, capsys):
    """h5py turns an exception that is raised meanwhile into a SystemError."""
    path = tmp_path / "result.h5"
    with hdf5.changed_file(path, "w") as file:
        file["a/b"] = np.zeros(3)

    def interrupt(frame, event, _):
        if event == "call" and frame.f_code.co_name == "visit_link":
            sys.setprofile(None)
            signal.raise_signal(signal.SIGINT)

    def read_and_wait():
        sys.setprofile(interrupt)
        with open_hdf5(path):
            for _ in range(200):
                time.sleep(0.01)

    signal.signal(signal.SIGINT, signal.default_int_handler)
    with pytest.raises(typer.Exit) as ended, console.exit_status():
        read_and_wait()
    assert ended.value.exit_code == console.INTERRUPTED
    assert capsys.readouterr().err == "interrupted\n"
