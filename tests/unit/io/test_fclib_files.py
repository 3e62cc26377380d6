"""Test the layout of FCLIB files with h5py, files written by other programs, and rejected files."""

import h5py
import numpy as np
import pytest
from scipy import sparse

from meeframe.common.errors import CaseError, ResultError
from meeframe.results.fclib import MAX_CONTACTS, LocalProblem, LocalSolution, read_local, read_solution, write_local


def test_layout_of_the_file(tmp_path):
    """Names, types and shapes are those that fclib.h reads."""
    rng = np.random.default_rng(2)
    local = LocalProblem(
        rng.normal(size=(12, 12)) + 9 * np.eye(12), rng.normal(size=12), np.full(4, 0.3), title="a title"
    )
    local.matrix[3, 4] = 0.0
    write_local(tmp_path / "a.hdf5", local)
    assert read_solution(tmp_path / "a.hdf5") is None
    m = len(local.mu)
    with h5py.File(tmp_path / "a.hdf5") as file:
        assert list(file) == ["fclib_local"]
        group = file["fclib_local"]
        assert set(group) == {"spacedim", "W", "vectors", "info"}
        assert set(group["W"]) == {"nzmax", "m", "n", "nz", "p", "i", "x"}
        whole = {name: group["W"][name] for name in ("nzmax", "m", "n", "nz")} | {"spacedim": group["spacedim"]}
        assert all(number.dtype == np.int32 and number.shape == (1,) for number in whole.values())
        computed = {name: int(number[0]) for name, number in whole.items()}
        stored = np.count_nonzero(local.matrix)
        assert computed == {"nzmax": stored, "m": 3 * m, "n": 3 * m, "nz": -1, "spacedim": 3}
        p, i, x = (group["W"][name] for name in "pix")
        assert (p.dtype, i.dtype, x.dtype) == (np.int32, np.int32, np.float64)
        assert (p.shape, i.shape, x.shape) == ((3 * m + 1,), (stored,), (stored,))
        column = slice(p[4], p[5])
        assert np.array_equal(x[column], local.matrix[i[column], 4])
        assert {name: part.shape for name, part in group["vectors"].items()} == {"q": (3 * m,), "mu": (m,)}
        assert all(part.dtype == np.float64 for part in group["vectors"].values())
        title = group["info/title"]
        assert title.shape == ()
        kind = title.id.get_type()
        assert (kind.get_size(), kind.get_strpad()) == (len("a title") + 1, h5py.h5t.STR_NULLTERM)
        assert title[()] == b"a title"


MATRIX = np.array([[2.0, 0, 0.5], [0, 1, 0], [0.1, 0, 1]])


def write_raw(path, w, nz, p, i, x, extra=()):
    with h5py.File(path, "w") as file:
        group = file.create_group("fclib_local")
        group["spacedim"] = np.array([3], np.int32)
        for name, number in {"nzmax": len(x), "m": len(w), "n": len(w), "nz": nz}.items():
            group[f"W/{name}"] = np.array([number], np.int32)
        group["W/p"], group["W/i"], group["W/x"] = np.asarray(p, np.int32), np.asarray(i, np.int32), x
        group["vectors/q"], group["vectors/mu"] = np.array([-1.0, 0.5, 0]), np.array([0.3])
        for name, value in dict(extra).items():
            del group[name]
            group[name] = value


def test_the_three_ways_to_store_a_matrix(tmp_path):
    columns, rows = sparse.csc_array(MATRIX), sparse.csr_array(MATRIX)
    triplets = sparse.coo_array(MATRIX)
    stores = {
        "columns": (-1, columns.indptr, columns.indices, columns.data),
        "rows": (-2, rows.indptr, rows.indices, rows.data),
        "room to spare": (-2, rows.indptr, np.append(rows.indices, 0), np.append(rows.data, 7.0)),
        "triplets": (5, triplets.col, triplets.row, triplets.data),
        "repeated": (6, [*triplets.col, 0], [*triplets.row, 0], np.array([*(triplets.data - [1, 0, 0, 0, 0]), 1.0])),
    }
    for name, store in stores.items():
        write_raw(tmp_path / f"{name}.hdf5", MATRIX, *store)
        np.testing.assert_array_equal(read_local(tmp_path / f"{name}.hdf5").matrix, MATRIX, err_msg=name)
        assert read_local(tmp_path / f"{name}.hdf5").title == ""


BROKEN = {
    "plane": ({"spacedim": np.array([2])}, "spacedim = 2; allowed: 3"),
    "nz": ({"W/nz": np.array([-3])}, "nz = -3 of its matrix; allowed: -2, -1 and numbers >= 0"),
    "row out of range": ({"W/i": np.array([0, 1, 3])}, r"an entry of its matrix is at row 3, column 2 of \(3, 3\)"),
    "negative row": ({"W/i": np.array([0, 1, -1])}, "an entry of its matrix is at row -1, column 2"),
    "pointers too short": ({"W/p": np.array([0, 1, 2])}, "3 pointers for 3 columns or rows"),
    "pointers too long": ({"W/p": np.array([0, 1, 2, 9])}, "is not a complete FCLIB problem"),
    "pointers beyond the entries": ({"W/p": np.array([0, 2**30, 2**30, 2**30])}, "from 0 to 1073741824; it has"),
    "pointers that go back": ({"W/p": np.array([0, 2, 1, 3])}, "is not a complete FCLIB problem"),
    "q too short": ({"vectors/q": np.zeros(2)}, r"q \(2,\)"),
    "negative mu": ({"vectors/mu": np.array([-0.1])}, "mu of the FCLIB problem is -0.1 at contact 0; allowed"),
    "not a number": ({"vectors/q": np.array([0, np.nan, 0])}, "q of the FCLIB problem is not finite"),
    "large": (
        dict.fromkeys(("W/m", "W/n"), np.array([3 * MAX_CONTACTS + 3])),
        f"{MAX_CONTACTS + 1} contacts; allowed: 1 to {MAX_CONTACTS}",
    ),
    "more columns than rows": ({"W/n": np.array([2_000_000_000])}, "W has 3 rows and 2000000000 columns; allowed"),
    "no contacts": ({"W/m": np.array([-3]), "W/n": np.array([-3])}, "with -1 contacts; allowed: 1 to"),
    "infinite mu": ({"vectors/mu": np.array([np.inf])}, "mu of the FCLIB problem is not finite"),
    "complex": ({"W/x": np.ones(3) + 1j}, "x is of type complex128; allowed: whole numbers and floats"),
    "words": ({"vectors/mu": np.array([b"0.3"])}, r"mu is of type .*; allowed: whole numbers and floats"),
    "zeros": ({"W/x": np.zeros(3)}, "W of the FCLIB problem has 0.0 on its diagonal at contact 0"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files(name, tmp_path):
    change, message = BROKEN[name]
    write_raw(tmp_path / "a.hdf5", np.eye(3), -1, [0, 1, 2, 3], [0, 1, 2], np.ones(3), change)
    with pytest.raises(CaseError, match=rf"a\.hdf5: .*{message}"):
        read_local(tmp_path / "a.hdf5")


def damage(path, name):
    """Overwrite bytes of a compressed dataset."""
    with h5py.File(path, "r+") as file:
        values = file[name][()]
        del file[name]
        file.create_dataset(name, data=values, chunks=values.shape, compression="gzip")
        position = file[name].id.get_chunk_info(0)
    with path.open("r+b") as raw:
        raw.seek(position.byte_offset)
        raw.write(b"\xff" * position.size)


def test_damaged_chunks(tmp_path):
    path = tmp_path / "a.hdf5"
    local = LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.array([0.3]))
    write_local(path, local, LocalSolution(np.zeros(3), np.array([1.0, 0, 0])))
    damage(path, "solution/r")
    assert read_local(path).mu == [0.3]
    with pytest.raises(ResultError, match=r"a\.hdf5: its solution cannot be read"):
        read_solution(path)
    damage(path, "fclib_local/W/x")
    with pytest.raises(CaseError, match=r"a\.hdf5: is not a complete FCLIB problem"):
        read_local(path)


@pytest.mark.parametrize(
    ("r", "message"),
    [
        (np.zeros(6), r"u \(3,\), r \(6,\); allowed: finite numbers \(3,\)"),
        (np.array([1.0, np.nan, 0.0]), "allowed: finite numbers"),
        (np.zeros(3, complex), "r is of type complex128"),
        (np.zeros(0), r"r \(0,\)"),
    ],
)
def test_invalid_solutions(tmp_path, r, message):
    path = tmp_path / "a.hdf5"
    local = LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.array([0.3]))
    write_local(path, local)
    with h5py.File(path, "r+") as file:
        file["solution/u"], file["solution/r"] = np.zeros(3), r
    with pytest.raises(ResultError, match=rf"a\.hdf5: its solution cannot be read: .*{message}"):
        read_solution(path)


def test_other_files(tmp_path):
    path = tmp_path / "a.hdf5"
    with pytest.raises(ResultError, match="cannot be read as HDF5"):
        read_local(path)
    with h5py.File(path, "w") as file:
        file.create_group("fclib_global")
    with pytest.raises(CaseError, match="holds a global problem; allowed: a local problem"):
        read_local(path)
    write_raw(path, np.eye(3), -1, [0, 1, 2, 3], [0, 1, 2], np.ones(3))
    with h5py.File(path, "r+") as file:
        file.create_group("fclib_local/V")
    with pytest.raises(CaseError, match="equality constraints"):
        read_local(path)
    with h5py.File(path, "r+") as file:
        del file["fclib_local/V"], file["fclib_local/vectors/mu"]
    with pytest.raises(CaseError, match="not a complete FCLIB problem"):
        read_local(path)
    with h5py.File(path, "r+") as file:
        file["solution/u"] = np.zeros(3)
    with pytest.raises(ResultError, match="its solution cannot be read"):
        read_solution(path)
