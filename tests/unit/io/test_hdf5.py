"""HDF5 files on a disk without room: one error of files, and no crash of HDF5."""

import resource
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest

from meeframe.core.errors import ResultError
from meeframe.io.hdf5 import changed_file
from meeframe.io.output import replacing
from meeframe.io.results import append_step, create_result, finish_result, read_result
from meeframe.io.systems import read_kept, write_kept


@pytest.fixture
def room():
    """Sets how large a file may become [bytes]."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


def test_the_same_file_as_by_hdf5_alone(tmp_path):
    values = np.random.default_rng(1).random((300, 200))
    with h5py.File(tmp_path / "plain.h5", "w") as plain, changed_file(tmp_path / "own.h5", "w") as own:
        for file in (plain, own):
            file.create_dataset("values", data=values, chunks=True, fletcher32=True)
    with changed_file(tmp_path / "own.h5", "r+") as own, h5py.File(tmp_path / "plain.h5", "r+") as plain:
        for file in (plain, own):
            file["values"][3] = 7.0
            file["more"] = np.arange(5)
    with h5py.File(tmp_path / "plain.h5") as plain, h5py.File(tmp_path / "own.h5") as own:
        for name in ("values", "more"):
            np.testing.assert_array_equal(plain[name][()], own[name][()])


@pytest.mark.parametrize("size", [0, 1000, 50_000, 200_000])
def test_a_full_disk_is_one_error(tmp_path, room, size):
    room(size)
    path = tmp_path / "system.h5"
    with pytest.raises(ResultError, match=rf"^{path} cannot be written: File too large$"):
        write_kept(path, "key", {"values": np.random.default_rng(2).random(100_000)})
    assert not list(tmp_path.iterdir())
    room(resource.RLIM_INFINITY)
    write_kept(path, "key", {"values": np.ones(100_000)})
    assert read_kept(path, "key")["values"].sum() == 100_000


def test_finished_steps_stay_where_there_is_no_room_for_more(tmp_path, room, synthetic):
    first, second = synthetic.step(1e-6), synthetic.step(2e-6, increment=2)
    create_result(tmp_path, synthetic.result(first, planned=2))
    size = (tmp_path / "result.h5").stat().st_size
    room(size + 100)
    for change in (
        lambda: append_step(tmp_path, synthetic.zone(), second),
        lambda: create_result(tmp_path, synthetic.result(first, second)),
    ):
        with pytest.raises(ResultError, match=r"result\.h5 cannot be written: File too large$"):
            change()
    assert len(read_result(tmp_path).steps) == 1
    room(resource.RLIM_INFINITY)
    append_step(tmp_path, synthetic.zone(), second)
    finish_result(tmp_path, synthetic.result(first, second))
    assert len(read_result(tmp_path).steps) == 2


def test_what_else_goes_wrong_while_a_file_is_written_passes(tmp_path: Path):
    with pytest.raises(RuntimeError, match="a defect"), replacing(tmp_path / "file"):
        raise RuntimeError("a defect")
    with (
        pytest.raises(ResultError, match="file cannot be written: No space left on device"),
        replacing(tmp_path / "file"),
    ):
        raise RuntimeError("Can't decrement id ref count (file write failed: time = now\n, errno = 28, error message")


@pytest.mark.parametrize("name", ["versions", "timings", "planned_steps"])
def test_a_result_changed_on_the_disk_is_damaged(tmp_path, synthetic, name):
    create_result(tmp_path, synthetic.result(synthetic.step(1e-6)))
    finish_result(tmp_path, synthetic.result(synthetic.step(1e-6)))
    with h5py.File(tmp_path / "result.h5", "r+") as file:
        file.attrs[name] = "{"
    with pytest.raises(ResultError, match=r"result\.h5 is damaged: "):
        read_result(tmp_path)
