"""A full disk causes one file error and never a crash of HDF5."""

import resource
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest

from meeframe.common.errors import ResultError
from meeframe.results.fclib import LocalProblem, LocalSolution, read_local, read_solution, write_local, write_solution
from meeframe.results.files import ResultWriter, read_result, write_result
from meeframe.results.hdf5 import changed_file
from meeframe.results.output import replacing
from meeframe.results.sweep_files import dataset, write_sweep
from meeframe.results.sweep_records import SweepAxis, SweepResult
from meeframe.results.systems import read_arrays, write_arrays


@pytest.fixture
def file_size_limit():
    """Return a function that limits the size of files [bytes]."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


def test_file_is_identical_to_that_of_hdf5(tmp_path):
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
def test_full_disk_causes_one_error(tmp_path, file_size_limit, size):
    file_size_limit(size)
    path = tmp_path / "system.h5"
    with pytest.raises(ResultError, match=rf"^{path} cannot be written: File too large$"):
        write_arrays(path, "key", {"values": np.random.default_rng(2).random(100_000)})
    assert not list(tmp_path.iterdir())
    file_size_limit(resource.RLIM_INFINITY)
    write_arrays(path, "key", {"values": np.ones(100_000)})
    assert read_arrays(path, "key")["values"].sum() == 100_000


def test_finished_steps_survive_a_full_disk(tmp_path, file_size_limit, synthetic):
    first, second = synthetic.step(1e-6), synthetic.step(2e-6, increment=2)
    writer = ResultWriter(tmp_path, synthetic.result(planned=2))
    writer.append(first)
    file_size_limit(5_000)
    with pytest.raises(ResultError, match=r"0002\.h5 cannot be written: File too large$"):
        writer.append(second)
    for whole in (
        lambda: writer.finish(lambda: synthetic.result(first, planned=2)),
        lambda: write_result(tmp_path, synthetic.result(first, second)),
    ):
        with pytest.raises(ResultError, match=r"result\.h5 cannot be written: File too large$"):
            whole()
        assert len(read_result(tmp_path).steps) == 1
    file_size_limit(resource.RLIM_INFINITY)
    writer.append(second)
    assert len(read_result(tmp_path).steps) == 2
    writer.finish(lambda: synthetic.result(first, second))
    assert len(read_result(tmp_path).steps) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["result.h5"]


def make_sweep(count):
    """Return a sweep with two quantities of a given number of values."""
    numbers = np.random.default_rng(3).random((2, count // 2))
    axes = (SweepAxis("law", ("a", "b")), SweepAxis("mu", ("",) * (count // 2), numbers[0], "1"))
    texts = [np.full(numbers.shape, text) for text in ("converged", "é", "0")]
    return SweepResult("title", axes, {"force": numbers}, {"force": "N"}, *texts, notes={"case": "[mesh]"})


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("size", [0, 3000, 20_000])
def test_full_disk_preserves_the_earlier_sweep(tmp_path, file_size_limit, size):
    xarray = pytest.importorskip("xarray")
    write_sweep(tmp_path, make_sweep(4))
    file_size_limit(size)
    with pytest.raises(ResultError, match=r"sweep\.h5 cannot be written: File too large$"):
        write_sweep(tmp_path, make_sweep(40_000))
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.h5"]
    file_size_limit(resource.RLIM_INFINITY)
    for count in (4, 40_000):
        with xarray.open_dataset(tmp_path / "sweep.h5", engine="h5netcdf") as computed:
            xarray.testing.assert_identical(computed.load(), dataset(make_sweep(count)))
        write_sweep(tmp_path, make_sweep(40_000))


@pytest.mark.parametrize("size", [0, 3000, 20_000])
def test_full_disk_preserves_the_earlier_fclib_file(tmp_path, file_size_limit, size):
    def problem(contacts):
        matrix = np.eye(3 * contacts) + np.random.default_rng(4).random((3 * contacts, 3 * contacts))
        return LocalProblem(matrix, np.ones(3 * contacts), np.full(contacts, 0.3))

    path, small, large = tmp_path / "problem.hdf5", problem(1), problem(40)
    solution = LocalSolution(np.ones(120), np.zeros(120))
    file_size_limit(size)
    with pytest.raises(ResultError, match=r"problem\.hdf5 cannot be written: File too large$"):
        write_local(path, large, solution)
    assert not list(tmp_path.iterdir())
    file_size_limit(resource.RLIM_INFINITY)
    write_local(path, large)
    file_size_limit(size)
    with pytest.raises(ResultError, match=r"problem\.hdf5 cannot be written: File too large$"):
        write_solution(path, solution)
    assert [path.name for path in tmp_path.iterdir()] == ["problem.hdf5"]
    file_size_limit(resource.RLIM_INFINITY)
    np.testing.assert_array_equal(read_local(path).matrix, large.matrix)
    assert read_solution(path) is None
    write_solution(path, solution)
    np.testing.assert_array_equal(read_solution(path).u, solution.u)
    write_local(path, small)
    np.testing.assert_array_equal(read_local(path).matrix, small.matrix)


def test_other_errors_while_writing_propagate(tmp_path: Path):
    with pytest.raises(RuntimeError, match="a defect"), replacing(tmp_path / "file"):
        raise RuntimeError("a defect")
    with (
        pytest.raises(ResultError, match="file cannot be written: No space left on device"),
        replacing(tmp_path / "file"),
    ):
        raise RuntimeError("Can't decrement id ref count (file write failed: time = now\n, errno = 28, error message")


@pytest.mark.parametrize("name", ["versions", "timings", "planned_steps"])
def test_modified_result_is_reported_as_damaged(tmp_path, synthetic, name):
    write_result(tmp_path, synthetic.result(synthetic.step(1e-6)))
    with h5py.File(tmp_path / "result.h5", "r+") as file:
        file.attrs[name] = "{"
    with pytest.raises(ResultError, match=r"result\.h5 is damaged: "):
        read_result(tmp_path)
