"""HDF5 files that refer to other files, or declare more data than they contain, are rejected."""

import tracemalloc
import zlib

import h5py
import numpy as np
import pytest

from meeframe.common import hdf5
from meeframe.common.errors import MeshError, ResultError
from meeframe.common.hdf5 import MAX_DEFLATE, open_hdf5
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


@pytest.mark.parametrize(
    ("shape", "options"),
    [
        ((11_000, 11_000), {"dtype": "f8", "chunks": (1000, 1000)}),
        ((11_000, 11_000), {"dtype": "u1", "chunks": (1000, 1000)}),  # becomes doubles
        ((4096, 4097), {"dtype": "f8", "chunks": (4096, 4097), "compression": "gzip"}),
        ((2, 2), {"dtype": "f8", "chunks": (5000, 5000), "maxshape": (None, None)}),  # a chunk is read as a whole
    ],
)
def test_arrays_that_are_hardly_stored_are_not_read(tmp_path, shape, options):
    path = tmp_path / "unwritten.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("heights", shape, **options)
    message = r"'/heights' of shape .* takes 0\.\d+ GiB, of which the file stores 0 bytes; allowed: .* 16777216 numbers"
    with pytest.raises(ValueError, match=message), open_hdf5(path):
        pass


def test_flat_arrays_of_moderate_size_are_read(tmp_path):
    path = tmp_path / "flat.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("flat", data=np.zeros((4096, 4096), "u1"), chunks=(4096, 4096), compression="gzip")
        file.create_dataset("unwritten", (4096, 4096), "f8", chunks=(4096, 4096))
    with open_hdf5(path) as file:
        assert file["flat"].shape == file["unwritten"].shape


@pytest.mark.parametrize("is_compressed", [False, True])
def test_large_arrays_are_read_if_they_are_stored(tmp_path, monkeypatch, is_compressed):
    """The limit of size is lowered here, so that the array is large."""
    monkeypatch.setattr(hdf5, "ALWAYS_ALLOWED", 2**12)
    path, heights = tmp_path / "map.h5", np.random.default_rng(1).normal(size=(200, 200))
    options = {"compression": "gzip", "shuffle": True} if is_compressed else {}
    with h5py.File(path, "w") as file:
        file.create_dataset("heights", data=np.round(heights, 1) if is_compressed else heights, **options)
    with open_hdf5(path) as file:
        stored = file["heights"].id.get_storage_size()
        assert (stored < heights.nbytes / 4) == is_compressed
    with h5py.File(path, "r+") as file:
        file["heights"][...] = 0.0
    if is_compressed:
        message = r"'/heights' of shape .* allowed: 32 times what it stores"
        with pytest.raises(ValueError, match=message), open_hdf5(path):
            pass
        with open_hdf5(path, max_compression=MAX_DEFLATE) as file:
            assert file["heights"][0, 0] == 0.0


def deflated_zeros(number):
    """Return a deflate stream of zero bytes, a multiple of 16 MiB."""
    stream = zlib.compressobj(9)
    return b"".join([stream.compress(bytes(2**24)) for _ in range(number // 2**24)]) + stream.flush()


def put_chunk(file, name, content, filters, mask=0):
    """Create a dataset of 16 x 16 numbers in one chunk, whose stored bytes are given."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_chunk((16, 16))
    for code, values in filters:
        properties.set_filter(code, h5py.h5z.FLAG_OPTIONAL, values)
    space = h5py.h5s.create_simple((16, 16))
    dataset = h5py.h5d.create(file.id, name.encode(), h5py.h5t.IEEE_F64LE, space, properties)
    dataset.write_direct_chunk((0, 0), content, filter_mask=mask)


DEFLATE, SHUFFLE, FLETCHER32 = (h5py.h5z.FILTER_DEFLATE, (4,)), (h5py.h5z.FILTER_SHUFFLE, (8,)), (3, ())
LZF, SCALE_OFFSET = (h5py.h5z.FILTER_LZF, ()), (h5py.h5z.FILTER_SCALEOFFSET, (0,) * 20)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("filters", [(DEFLATE,), (SHUFFLE, DEFLATE, FLETCHER32)])
def test_chunks_that_expand_beyond_their_size_are_not_expanded(tmp_path, filters):
    """HDF5 would take as much memory as the stream expands to, 512 MiB here."""
    path = tmp_path / "expands.h5"
    with h5py.File(path, "w") as file:
        put_chunk(file, "heights", deflated_zeros(2**29), filters)
    tracemalloc.start()
    message = r"the chunk at \(0, 0\) of '/heights' expands to more than its 2048 bytes"
    with pytest.raises(ValueError, match=message), open_hdf5(path):
        pass
    assert tracemalloc.get_traced_memory()[1] < 2**24
    tracemalloc.stop()


def test_large_chunks_of_lzf_are_rejected(tmp_path):
    """It expands 88 times, and no function tells how far a chunk does."""
    path = tmp_path / "expands.h5"
    with h5py.File(path, "w") as file:
        put_chunk(file, "heights", bytes(2**21), (LZF,))
    with pytest.raises(ValueError, match=r"the chunk at .* has 2097152 bytes; allowed: 2052, or gzip"), open_hdf5(path):
        pass


@pytest.mark.parametrize("filters", [(DEFLATE, DEFLATE), (LZF, DEFLATE), (SCALE_OFFSET,), (SHUFFLE, SHUFFLE)])
def test_other_filters_are_rejected(tmp_path, filters):
    """A file of some kilobytes could expand to gigabytes, however small the array."""
    path = tmp_path / "filters.h5"
    with h5py.File(path, "w") as file:
        put_chunk(file, "heights", bytes(100), filters)
    message = (
        r"'/heights' is compressed twice, or by other filters of HDF5 than gzip and lzf \(.*\); allowed: these, once"
    )
    with pytest.raises(ValueError, match=message), open_hdf5(path):
        pass


@pytest.mark.parametrize("compression", ["gzip", "lzf"])
def test_large_chunks_are_read(tmp_path, compression):
    """Chunks of whole maps are checked as they are read, and those that are stored as they are have no compression."""
    path = tmp_path / "map.h5"
    heights = np.random.default_rng(1).normal(size=(512, 512)).cumsum(axis=0).round(1)
    options = {"compression": compression, "fletcher32": True}
    with h5py.File(path, "w") as file:
        file.create_dataset("heights", data=heights, chunks=(256, 256), shuffle=True, **options)
        file.create_dataset("noise", data=np.frombuffer(np.random.default_rng(1).bytes(2**21)), chunks=2**18, **options)
    with open_hdf5(path) as file:
        assert file["heights"].id.get_storage_size() > 2**17
        assert np.array_equal(file["heights"], heights)
        assert file["noise"].shape == (2**18,)


def test_compressed_texts_are_read(tmp_path):
    """Elements of variable length take twice as much in a file as in memory."""
    path = tmp_path / "texts.h5"
    texts = np.array([f"line {number}" for number in range(200_000)], object)
    with h5py.File(path, "w") as file:
        file.create_dataset("log", data=texts, dtype=h5py.string_dtype(), compression="gzip")
    with open_hdf5(path) as file:
        assert file["log"].id.get_storage_size() > 2**17
        assert file["log"].asstr()[199_999] == "line 199999"


def test_results_may_hold_fields_that_are_zero_nearly_everywhere(tmp_path, synthetic):
    folder = tmp_path / "run"
    folder.mkdir()
    write_result(folder, synthetic.result(synthetic.step(1e-6)))
    with h5py.File(folder / "result.h5", "r+") as file:
        file.create_dataset("other", data=np.zeros((4200, 4200), "u1"), chunks=(4200, 4200), compression="gzip")
    assert len(read_result(folder).steps) == 1
    with h5py.File(folder / "result.h5", "r+") as file:
        file.create_dataset("unwritten", (4200, 4200), "u1", chunks=(4200, 4200))
    with pytest.raises(ResultError, match=r"result\.h5 .*'/unwritten' of shape .* of which the file stores 0 bytes"):
        read_result(folder)
