"""Inputs that are damaged, endless or beyond anything physical: one clear message and exit status 2, at once."""

import os
import subprocess
import sys
import time
import tracemalloc
import zlib
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.common.errors import CaseError, MeshError, ResultError
from meeframe.indenters.heights import Heights, SampledHeights
from meeframe.mesh.reader import read_any
from meeframe.results.fclib import LocalProblem, read_local, write_local
from meeframe.results.files import ResultWriter, read_result, write_result
from meeframe.results.output import replacing

CASE = """
[material]
name = "isotropic"
young_modulus = "200 GPa"
poisson_ratio = 0.2

[mesh]
type = "half-space"
contact_width = "5 mm"
divisions = 8

[formulation]
name = "half-space"

[indenter]
name = "sphere"
radius = "100 mm"

[[steps]]
approach = "10 um"
"""


@pytest.fixture
def check(tmp_path):
    def run(path):
        return CliRunner().invoke(app, ["check", str(path)])

    return run


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"10 um"', "1e200", "steps[1].approach = 1e+200: must be >= -1e+60 and <= 1e+60"),
        ('"10 um"', "-1e200", "steps[1].approach = -1e+200: must be >= -1e+60 and <= 1e+60"),
        (
            '"100 mm"',
            "1e200",
            "indenter.radius = 1e+200: is too large to compute with; allowed: magnitudes from 1e-60 to 1e+60 m",
        ),
        (
            '"100 mm"',
            "1e-200",
            "indenter.radius = 1e-200: is too small to compute with; allowed: magnitudes from 1e-60 to 1e+60 m",
        ),
        ('"100 mm"', '"1e300 km"', "indenter.radius = '1e300 km': is too large to compute with; allowed: "),
        (
            '"5 mm"',
            "1e-310",
            "mesh.contact_width = 1e-310: is too small to compute with; allowed: magnitudes from 1e-60",
        ),
    ],
)
def test_magnitudes_beyond_anything_physical(tmp_path, check, old, new, message):
    path = tmp_path / "case.toml"
    path.write_text(CASE.replace(old, new), encoding="utf-8")
    done = check(path)
    assert done.exit_code == 2
    assert f"{path}: {message}" in done.stderr


@pytest.mark.parametrize("modulus", ["1e+308", "1e-308"])
def test_moduli_beyond_anything_physical(tmp_path, check, modulus):
    path = tmp_path / "case.toml"
    path.write_text(CASE.replace('"200 GPa"', modulus), encoding="utf-8")
    done = check(path)
    assert done.exit_code == 2
    bounds = "must be positive and finite, at least 1e-60 and at most 1e+60 Pa"
    assert f"young_modulus is {modulus} Pa, {bounds}" in done.stderr


@pytest.mark.parametrize(
    ("motion", "message"),
    [
        ("approach = 1e60", "approach = 1e+60: allowed: at most 5e+06 m, 1e+09 times the width of the contact zone"),
        ("approach = -1e8", "approach = -100000000.0: allowed: at most 5e+06 m"),
        ("translation = [0, 1e20]", "translation = [0, 1e+20]: allowed: at most 5e+06 m"),
        ("tilt = [1e20, 0]", "tilt = [1e+20, 0]: allowed: at most 1e+09 rad"),
        ("twist = -1e20", "twist = -1e+20: allowed: at most 1e+09 rad"),
    ],
)
def test_motions_beyond_anything_physical(tmp_path, check, motion, message):
    path = tmp_path / "case.toml"
    path.write_text(f"{CASE}\n[[steps]]\n{motion}\n", encoding="utf-8")
    done = check(path)
    assert done.exit_code == 2
    assert f"{path}: steps[2].{message}" in done.stderr


@pytest.mark.parametrize(
    ("old", "new", "begin", "end"),
    [
        (
            '"10 um"',
            f'"1 {"m" * 50_000}"',
            "steps[1].approach = '1 mmm",
            "expected a number in m or a text with such a unit",
        ),
        ('"isotropic"', f'"{"n" * 50_000}"', "material: unknown material 'nnn", "zno, isotropic"),
        ("radius", "r" * 50_000, "indenter.rrr", "unknown key; allowed: radius, profile"),
        ("[mesh]", f"rotation = {{ axis = [0, 1, '{'z' * 50_000}'], angle = 1 }}\n[mesh]", "material", "of shape (3,)"),
    ],
    ids=["unit", "name", "key", "list"],
)
def test_very_long_words(tmp_path, check, old, new, begin, end):
    path = tmp_path / "case.toml"
    path.write_text(CASE.replace(old, new), encoding="utf-8")
    before = time.process_time()
    done = check(path)
    assert time.process_time() - before < 10  # pint takes the square of the length of units: half a minute
    assert done.exit_code == 2
    lines = done.stderr.splitlines()
    assert max(map(len, lines)) < 2_500
    assert any(f"{path}: {begin}" in line and end in line for line in lines)


@pytest.mark.parametrize(
    "text",
    [
        CASE + "".join(f"k{number} = 1\n" for number in range(2_000)),
        "steps = [" + 2_000 * "{ bad = 1 }, " + "]\n" + CASE.partition("[[steps]]")[0],
    ],
    ids=["keys", "entries of a list"],
)
def test_many_problems_are_counted(tmp_path, check, monkeypatch, text):
    """Suggestions, which take most of the time, are made for those only that the message shows."""
    suggested = []
    monkeypatch.setattr("meeframe.plugin.validation.choices", lambda name, _: suggested.append(name) or "allowed: none")
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    done = check(path)
    assert len(suggested) == 50
    assert done.exit_code == 2
    assert done.stderr.count("\n") == 51
    assert done.stderr.endswith("and 1950 more problems\n")


@pytest.mark.parametrize("kind", ["device", "pipe", "folder"])
def test_case_files_that_are_no_files(tmp_path, check, kind):
    path = tmp_path / "case.toml"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        path = "/dev/zero"
    done = check(path)
    assert done.exit_code == 2
    assert f"error: {path}: cannot be read: " in done.stderr


@pytest.mark.parametrize("kind", ["device", "pipe"])
def test_material_files_that_are_no_files(tmp_path, check, write_case, kind):
    file = Path("/dev/zero") if kind == "device" else tmp_path / "material.toml"
    if kind == "pipe":
        os.mkfifo(file)
    done = check(write_case(('name = "batio3-cofe2o4"', f'file = "{file}"')))
    assert done.exit_code == 2
    assert f"{file}: cannot be read: is a device or a pipe; allowed: a regular file" in done.stderr


def test_results_and_local_problems_that_are_no_files(tmp_path):
    os.mkfifo(tmp_path / "result.h5")
    for command in (["show", tmp_path], ["fclib", "solve", tmp_path / "result.h5"]):
        done = CliRunner().invoke(app, list(map(str, command)))
        assert done.exit_code == 2
        assert f"{tmp_path / 'result.h5'}" in done.stderr
        assert "cannot be read as HDF5" in done.stderr


@pytest.mark.parametrize("name", ["map.txt", "map.npy"])
def test_heights_that_are_no_files(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(CaseError, match=rf"{name}: cannot be read: is a device or a pipe"):
        Heights(tmp_path / name).height(np.zeros(1), np.zeros(1))


def test_large_case_files(tmp_path, check):
    path = tmp_path / "case.toml"
    with path.open("wb") as file:
        file.truncate(2**40)  # takes no place on the disk
    done = check(path)
    assert done.exit_code == 2
    assert "has 1099511627776 bytes; allowed: at most 67108864" in done.stderr


def test_flipped_bits_of_npy_headers(tmp_path):
    np.save(tmp_path / "a.npy", np.random.default_rng(1).random((25, 3)))
    content = (tmp_path / "a.npy").read_bytes()
    refused = 0
    for position in range(128):
        for bit in (0x01, 0x08, 0x40):
            path = tmp_path / f"{position}-{bit}.npy"
            path.write_bytes(content[:position] + bytes([content[position] ^ bit]) + content[position + 1 :])
            with suppress(CaseError):  # any other exception is a defect
                Heights(path).height(np.zeros(1), np.zeros(1))
                continue
            refused += 1
    assert refused > 200


def test_arrays_larger_than_their_file(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.zeros((25, 3)))
    path.write_bytes(path.read_bytes().replace(b"(25, 3), }       ", b"(99999999999, 3),}"[:17].ljust(17)))
    with pytest.raises(CaseError, match=r"a\.npy: its header"):
        Heights(path).height(np.zeros(1), np.zeros(1))


def test_shapes_that_are_no_numbers(tmp_path):
    """NumPy reads True as a length, but makes no array of it."""
    path = tmp_path / "a.npy"
    np.save(path, np.zeros((1, 1)))
    path.write_bytes(path.read_bytes().replace(b"(1, 1), }      ", b"(True, True), }"))
    with pytest.raises(CaseError, match=r"a\.npy: its header declares an array of shape \(True, True\)"):
        Heights(path).height(np.zeros(1), np.zeros(1))


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "nodes"])
def test_heights_beyond_anything_physical(interpolation):
    """Differences of heights up to 1e308 overflow."""
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0))
    rows = np.column_stack([x.ravel(), y.ravel(), 1e308 * np.cos(np.arange(16))])
    with pytest.raises(CaseError, match=r"heights of 1e\+308 m; allowed: at most 1e\+60 m"):
        SampledHeights(rows, interpolation).height(np.zeros(1), np.zeros(1))


def test_headers_longer_than_their_file(tmp_path):
    """Nothing of the declared length, here 2 GiB, is allocated."""
    path = tmp_path / "a.npy"
    path.write_bytes(b"\x93NUMPY\x02\x00" + (2**31).to_bytes(4, "little") + b"{'descr': '<f8'}")
    tracemalloc.start()
    try:
        with pytest.raises(CaseError, match=r"a\.npy: .*array header"):
            Heights(path).height(np.zeros(1), np.zeros(1))
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()


def test_infinite_entries_of_fclib_files(tmp_path):
    import h5py

    path = tmp_path / "problem.hdf5"
    write_local(path, LocalProblem(np.eye(3), -np.ones(3), np.array([0.3])))
    with h5py.File(path, "r+") as file:
        del file["fclib_local/W/m"]
        file["fclib_local/W/m"] = np.array([np.inf])
    with pytest.raises(CaseError, match=r"problem\.hdf5: "):
        read_local(path)


@pytest.mark.parametrize("structure", [b"HEAP", b"SNOD", b"TREE"])
def test_damaged_structure_of_fclib_files(tmp_path, structure):
    path = tmp_path / "problem.hdf5"
    write_local(path, LocalProblem(np.eye(3), -np.ones(3), np.array([0.3])))
    path.write_bytes(path.read_bytes().replace(structure, b"XXXX"))
    with pytest.raises(ResultError, match=r"problem\.hdf5: cannot be read as HDF5: is damaged"):
        read_local(path)


@pytest.mark.parametrize("change", ["no length", "too long", "cut off"])
def test_damaged_heaps(tmp_path, synthetic, change):
    """HDF5 itself searches for a text in the first of them without end."""
    write_result(tmp_path, synthetic.result(synthetic.step(1e-6)))
    path = tmp_path / "result.h5"
    content = bytearray(path.read_bytes())
    heap = content.index(b"GCOL")
    if change == "no length":
        content[heap + 16 : heap + 32] = bytes(16)
    elif change == "too long":
        content[heap + 24 : heap + 32] = b"\xf0" + 7 * b"\xff"
    else:
        content[heap + 8 : heap + 16] = (2**40).to_bytes(8, "little")
    path.write_bytes(content)
    with pytest.raises(ResultError, match=r"result\.h5 cannot be read as HDF5"):
        read_result(tmp_path)


def test_meshes_in_wkt(tmp_path):
    path = tmp_path / "mesh.wkt"
    path.write_text("TIN (((0 0 0, 1 0 0, 0 1 0, 0 0 0)))", encoding="utf-8")
    with pytest.raises(MeshError, match="format wkt"):
        read_any(path)


MAIN = """
import atexit
from meeframe.cli import main
from meeframe.model.clock import peak_memory_mb
atexit.register(lambda: print(peak_memory_mb()))
main()
"""
"""Program of a command that prints its largest memory [MB] at the end."""


@pytest.mark.full
def test_height_maps_that_expand_beyond_their_size(tmp_path):
    """HDF5 alone would expand 0.5 MB to 512 MiB for an array of 2 kB."""
    stream = zlib.compressobj(9)
    content = b"".join([stream.compress(bytes(2**24)) for _ in range(32)]) + stream.flush()
    with h5py.File(tmp_path / "map.h5", "w") as file:
        heights = file.create_dataset("heights", (16, 16), float, chunks=(16, 16), compression="gzip")
        heights.id.write_direct_chunk((0, 0), content)
    path = tmp_path / "case.toml"
    indenter = 'name = "height-map"\nfile = "map.h5"\nspacing = ["1 um", "1 um"]'
    path.write_text(CASE.replace('name = "sphere"\nradius = "100 mm"', indenter), encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", MAIN, "check", path], capture_output=True, text=True)
    assert done.returncode == 2
    message = " ".join(done.stderr.split())
    assert "map.h5: the chunk at (0, 0) of '/heights' expands to more than its 2048 bytes" in message
    assert float(done.stdout) < 500.0, "MB, of which Python and its libraries take 200"


def replace_by_file(folder, path):
    folder.rmdir()
    folder.touch()
    path.write_text("")


def test_a_folder_that_becomes_a_file(tmp_path, synthetic):
    folder = tmp_path / "out"
    folder.mkdir()
    step = synthetic.step(1e-6)
    writer = ResultWriter(folder, synthetic.result(step))
    with (
        pytest.raises(ResultError, match=r"summary\.json cannot be written"),
        replacing(folder / "summary.json") as path,
    ):
        replace_by_file(folder, path)
    with pytest.raises(ResultError, match=r"out.* cannot be written: Not a directory"):
        writer.append(step)


@pytest.mark.parametrize("threads", ["0", "-1", "x", "1.5"])
def test_numbers_of_threads_in_the_environment(threads):
    done = CliRunner().invoke(app, ["materials"], env={"NUMBA_NUM_THREADS": threads})
    assert done.exit_code == 2
    assert f"NUMBA_NUM_THREADS = '{threads}'; allowed: an integer > 0" in done.stderr
