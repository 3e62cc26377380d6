"""HDF5 files that refer to other files, or declare more data than they contain, are rejected."""

import h5py
import numpy as np
import pytest

from meeframe.common.errors import MeshError, ResultError
from meeframe.common.hdf5 import open_hdf5
from meeframe.mesh.reader import read_any
from meeframe.results.fclib import LocalProblem, read_local, write_local
from meeframe.results.files import ResultWriter, read_result, write_result

KINDS = ("link", "linked group", "stored", "virtual")


@pytest.fixture
def private(tmp_path):
    """Return another file with numbers that must not be read."""
    path = tmp_path / "private.h5"
    with h5py.File(path, "w") as file:
        file["data"] = np.full((8, 3), 42.0)
        file["inner/data"] = np.full((8, 3), 42.0)
    return path


def put(file, name, kind, private):
    """Replace a dataset by one whose data are in another file."""
    shape, dtype = ((8, 3), np.dtype(float)) if name not in file else (file[name].shape, file[name].dtype)
    file.pop(name, None)
    if kind == "link":
        file[name] = h5py.ExternalLink(str(private), "data")
    elif kind == "linked group":
        file["group"] = h5py.ExternalLink(str(private), "/")
        file[name] = h5py.SoftLink("/group/data")
    elif kind == "stored":
        file.create_dataset(name, shape, dtype, external=[(str(private), 0, h5py.h5f.UNLIMITED)])
    else:
        layout = h5py.VirtualLayout(shape=(8, 3), dtype=float)
        layout[:] = h5py.VirtualSource(str(private), "data", shape=(8, 3))
        file.create_virtual_dataset(name, layout)


@pytest.mark.parametrize("kind", KINDS)
def test_files_are_rejected(tmp_path, private, kind):
    path = tmp_path / "foreign.h5"
    with h5py.File(path, "w") as file:
        put(file, "a/b", kind, private)
    with pytest.raises(ValueError, match="allowed: data in the file itself"), open_hdf5(path):
        pass
    if kind != "stored":  # the data that HDF5 itself would have read
        with h5py.File(path) as file:
            assert (file["a/b"][()] == 42.0).all()


def test_links_within_a_file_and_cycles_are_allowed(tmp_path):
    path = tmp_path / "own.h5"
    with h5py.File(path, "w") as file:
        file["a/data"] = np.arange(3.0)
        file["soft"], file["hard"], file["a/up"] = h5py.SoftLink("/a/data"), file["a/data"], file["/"]
        file["nowhere"] = h5py.SoftLink("/none")
    with open_hdf5(path) as file:
        assert file["soft"][2] == file["hard"][2] == 2.0


@pytest.mark.parametrize("kind", KINDS)
def test_results_are_rejected(tmp_path, synthetic, private, kind):
    folder = tmp_path / "run"
    folder.mkdir()
    write_result(folder, synthetic.result(synthetic.step(1e-6)))
    with h5py.File(folder / "result.h5", "r+") as file:
        put(file, "zone/points", kind, private)
    with pytest.raises(ResultError, match=r"result\.h5 is damaged: .*allowed: data in the file itself"):
        read_result(folder)


def unfinished(folder, synthetic):
    folder.mkdir()
    step = synthetic.step(1e-6)
    writer = ResultWriter(folder, synthetic.result(step))
    writer.append(step)
    return folder


def test_links_to_the_increments_of_an_unfinished_run_are_followed(tmp_path, synthetic):
    assert len(read_result(unfinished(tmp_path / "run", synthetic)).steps) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_increments_are_checked(tmp_path, synthetic, private, kind):
    folder = unfinished(tmp_path / "run", synthetic)
    with h5py.File(folder / "result.increments/0001.h5", "r+") as file:
        put(file, "history", kind, private)
    with pytest.raises(ResultError, match="allowed: data in the file itself"):
        read_result(folder)


@pytest.mark.parametrize("target", ["{private}", "../private.h5", "result.increments/../../private.h5", "0001.h5"])
def test_increments_elsewhere_are_rejected(tmp_path, synthetic, private, target):
    folder = unfinished(tmp_path / "run", synthetic)
    with h5py.File(folder / "result.h5", "r+") as file:
        del file["steps/0001"]
        file["steps/0001"] = h5py.ExternalLink(target.format(private=private), "/")
    with pytest.raises(ResultError, match="'steps/0001' is a link to another file"):
        read_result(folder)


@pytest.mark.parametrize("kind", KINDS)
def test_fclib_problems_are_rejected(tmp_path, private, kind):
    path = tmp_path / "problem.hdf5"
    write_local(path, LocalProblem(np.eye(3), -np.ones(3), np.array([0.3])))
    with h5py.File(path, "r+") as file:
        put(file, "fclib_local/vectors/q", kind, private)
    with pytest.raises(ResultError, match=r"problem\.hdf5: .*allowed: data in the file itself"):
        read_local(path)


def test_meshes_are_rejected(tmp_path, private):
    path = tmp_path / "mesh.med"
    with h5py.File(path, "w") as file:
        put(file, "ENS_MAA", "link", private)
    with pytest.raises(MeshError, match="allowed: data in the file itself"):
        read_any(path)


@pytest.mark.parametrize("options", [{"chunks": (1000, 1000)}, {"chunks": (1000, 1000), "compression": "gzip"}])
def test_arrays_larger_than_their_file_are_not_read(tmp_path, options):
    path = tmp_path / "huge.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("a/heights", (316_000, 316_000), float, **options)
    with pytest.raises(ValueError, match=r"'/a/heights' of shape \(316000, 316000\) takes 744 GiB"), open_hdf5(path):
        pass
