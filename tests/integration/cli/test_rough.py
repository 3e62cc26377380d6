"""The command `rough`: its files, options, messages and interruption."""

import importlib
import json
import os
import signal
import subprocess
import sys

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from meeframe import topography
from meeframe.cli import app

STUDY = """
title = "A study"
pressures = ["0.5 GPa", "1 GPa"]

[material]
name = "isotropic"
young_modulus = "120 GPa"
poisson_ratio = 0.34

[surface]
name = "self-affine"
period = "1 mm"
shortest = "0.25 mm"
hurst = 0.8
rms_slope = 0.1
samples = 32
"""


def invoke(*arguments):
    return CliRunner().invoke(app, ["rough", *map(str, arguments)])


@pytest.fixture
def study(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    return tmp_path / "study.toml"


def heights(path, n=24):
    """Write a matrix of heights with a spacing of half a micrometre, in nanometres."""
    x = np.arange(n) / n
    waves = np.cos(2 * np.pi * 2 * x)[:, None] + np.sin(2 * np.pi * 3 * x)
    np.save(path, 20.0 * waves)
    return path


def test_study_file(study, tmp_path):
    out = tmp_path / "out"
    done = invoke(study, "--out", out, "--conductivity", "58 MS/m", "--format", "pdf")
    assert done.exit_code == 0, done.output
    assert "A study" in done.output
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(out / "rough.h5", engine="h5netcdf") as data:
        np.testing.assert_allclose(data.pressure, [0.5e9, 1e9])
        ratio = data.conductance / (2 * 5.8e7 / data.attrs["contact_modulus"] * data.stiffness)
        np.testing.assert_allclose(ratio, 1.0, rtol=1e-3)
    assert json.loads((out / "surface.json").read_text())["rms_slope_spectrum"] == pytest.approx(0.1)
    assert (out / "rough.csv").read_text().startswith("pressure [Pa],area_fraction [1],")
    assert {path.suffix for path in out.iterdir()} == {".h5", ".csv", ".json", ".pdf"}
    again = invoke(study, "--out", out)
    assert again.exit_code == 2
    assert "is not empty" in again.output


def show(folder, *options):
    return CliRunner().invoke(app, ["show", str(folder), *options])


def test_show_prints_the_table_of_the_study(study, tmp_path):
    out = tmp_path / "out"
    done, shown = invoke(study, "--out", out, "--material", "steel"), show(out)
    assert done.exit_code == shown.exit_code == 0, shown.output
    table = done.stdout.partition("dataset: ")[0]
    assert "A study" in table
    assert shown.stdout.partition("files: ")[0] == table
    for name in ("rough.h5", "rough.csv", "surface.json", "rough.png", "surface.png"):
        assert str(out / name) in shown.output.replace("\n", "")
    refused = show(out, "--interior")
    assert refused.exit_code == 2
    assert "holds a study of a rough surface" in refused.output


@pytest.mark.parametrize("change", ["format", "pressure", "text"])
def test_show_reports_damaged_datasets(study, tmp_path, change):
    out = tmp_path / "out"
    out.mkdir()
    with h5py.File(out / "rough.h5", "w") as file:
        file.attrs.update({"format": "meeframe-rough 9" if change == "format" else "meeframe-rough 1", "title": "A"})
        file["status"] = file["message"] = ["converged"]
    if change == "text":
        (out / "rough.h5").write_text("no HDF5")
    done = show(out)
    assert done.exit_code == 2
    assert {"format": "'meeframe-rough 9' is unknown", "pressure": "is damaged", "text": "cannot be read"}[
        change
    ] in done.output.replace("\n", " ")


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("options", "count"), [([], 0), (["--contact-conductance", "30 GS/m^2"], 1), (["--contact-conductance", "inf"], 1)]
)
def test_law_of_charges_is_not_that_of_currents(study, tmp_path, options, count):
    """A study file of earlier versions is refused with the new name of its key, which an option may give."""
    study.write_text(f'{STUDY}[conductivity]\nelectric = {{ name = "step", kappa = 3e10 }}\n', encoding="utf-8")
    done = invoke(study, "--out", tmp_path / "out", "--conductivity", "58 MS/m", "--pressure", "1 GPa", *options)
    assert done.exit_code == (0 if count else 2), done.output
    message = "study.toml: conductivity.electric: for currents it is now called 'contact_conductance' [S/m^2]"
    assert (message in done.output) == (not count)
    assert len(list((tmp_path / "out").glob("rough.csv"))) == count


@pytest.mark.full
def test_height_map_with_options(tmp_path):
    done = invoke(
        *(heights(tmp_path / "map.npy"), "--out", tmp_path / "out", "--modulus", "70 GPa", "--unit", "1 nm"),
        *("--spacing", "0.5 um", "--from", "20 MPa", "--to", "80 MPa", "--count", 3, "--periodic"),
        *("--samples", 32, "--hardness", "1 GPa", "--levelled", "plane", "--missing", "nearest"),
    )
    assert done.exit_code == 0, done.output
    rows = (tmp_path / "out" / "rough.csv").read_text().splitlines()
    np.testing.assert_allclose([float(row.split(",")[0]) for row in rows[1:]], [20e6, 40e6, 80e6])
    facts = json.loads((tmp_path / "out" / "surface.json").read_text())
    assert facts["contact_modulus"] == pytest.approx(70e9)
    assert facts["is_periodic"] == 1
    # resampling preserves all waves of the levelled map but part of its shortest ones
    x, heights_nm = np.arange(24.0), np.load(tmp_path / "map.npy")
    levelled = topography.detrend(topography.HeightMap(x, x, heights_nm.T), "plane")
    assert facts["rms_height"] == pytest.approx(1e-9 * levelled.rms_height, rel=2e-3)


def test_files_with_coordinates_and_several_matrices(tmp_path):
    matrix, points, both = tmp_path / "matrix.npy", tmp_path / "points.txt", tmp_path / "both.h5"
    heights(matrix)
    values = np.load(matrix)
    y, x = np.mgrid[:24, :24] * 0.5
    np.savetxt(points, np.column_stack([x.ravel(), y.ravel(), values.ravel()]))
    with h5py.File(both, "w") as file:
        file["first"], file["second"] = values, 2.0 * values
    steel = ("--material", "steel", "--pressure", "50 MPa", "--unit", "1 nm")
    facts = []
    for file, options in (
        (matrix, ("--spacing", "0.5 um")),
        (points, ("--lateral-unit", "1 um")),
        (both, ("--spacing", "0.5 um", "--dataset", "first")),
    ):
        done = invoke(file, "--out", tmp_path / file.stem, *steel, *options)
        assert done.exit_code == 0, done.output
        facts.append(json.loads((tmp_path / file.stem / "surface.json").read_text()))
    for other in facts[1:]:
        assert other == pytest.approx(facts[0], rel=1e-12)
    done = invoke(both, "--out", tmp_path / "out", *steel, "--spacing", "0.5 um")
    assert done.exit_code == 2
    assert "must name one of the matrices in the file: first, second" in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--material", "steel", "--modulus", "1 GPa"], "allowed: one of them"),
        (["--pressure", "1 MPa", "--from", "2 MPa"], "allowed: one of them"),
        (["--modulus", "1 GPa", "--pressure", "1 m"], "study.toml: pressures[1] = '1 m': has the wrong unit"),
        (["--modulus", "1 GPa", "--pressure", "nan Pa"], "study.toml: pressures[1] = 'nan Pa': "),
        (
            ["--modulus", "1 GPa", "--count", "3"],
            "study.toml: pressures: is not a range, of which count could be replaced",
        ),
        (["--modulus", "-200 GPa"], "--modulus -200 GPa: must be > 0"),
        (["--material", "stel"], "steel"),
        (["--modulus", "1 GPa", "--samples", "2"], "samples"),
        (
            ["--modulus", "1 GPa", "--samples", "100000000"],
            "samples = 100000000: a run with 200000000 nodes needs at least ",
        ),
        (["--modulus", "1 GPa", "--hardness", "soft"], "hardness"),
        (
            ["--modulus", "1 GPa", "--contact-conductance", "1e12 S/m^2"],
            "study.toml: contact_conductance: needs electrical_conductivity",
        ),
        (
            ["--modulus", "1 GPa", "--conductivity", "58 MS/m", "--contact-conductance", "1 F/m^2"],
            "study.toml: contact_conductance = '1 F/m^2': has the wrong unit; expected a number in S/m^2",
        ),
        ([], "material: missing"),
    ],
)
def test_messages(study, tmp_path, options, message):
    text = study.read_text().replace(
        '[material]\nname = "isotropic"\nyoung_modulus = "120 GPa"\npoisson_ratio = 0.34\n', ""
    )
    study.write_text(text)
    done = invoke(study, "--out", tmp_path / "out", *options)
    assert done.exit_code == 2, done.output
    assert message in done.output
    assert "Traceback" not in done.output
    assert not (tmp_path / "out").exists()


def test_other_files_are_refused(tmp_path, study):
    missing = invoke(tmp_path / "none.npy", "--out", tmp_path / "out", "--modulus", "1 GPa")
    assert missing.exit_code == 2
    assert "does not exist" in missing.output
    matrix = invoke(heights(tmp_path / "map.npy"), "--out", tmp_path / "out", "--modulus", "1 GPa")
    assert matrix.exit_code == 2
    assert "spacing" in matrix.output
    (tmp_path / "case.toml").write_text("[mesh]\n[material]\n")
    case = invoke(tmp_path / "case.toml", "--out", tmp_path / "out")
    assert case.exit_code == 2
    assert "is a case file" in case.output


def test_loads_beyond_the_hardness_are_refused(study, tmp_path):
    done = invoke(study, "--out", tmp_path / "out", "--hardness", "0.8 GPa")
    assert done.exit_code == 2, done.output
    assert "pressures: 1e+09 Pa; allowed: less than the hardness of the contact law, 8e+08 Pa" in done.output
    assert not (tmp_path / "out").exists()


@pytest.mark.full
def test_exit_status_without_convergence(study, tmp_path):
    study.write_text(study.read_text() + "[solver]\nmax_iterations = 1\n")
    done = invoke(study, "--out", tmp_path / "out", "--hardness", "inf")
    assert done.exit_code == 1, done.output
    rows = (tmp_path / "out" / "rough.csv").read_text().splitlines()
    assert all(row.split(",")[1] == "nan" and not row.endswith(",converged") for row in rows[1:])


@pytest.mark.full
def test_options_replace_keys_of_a_range(study, tmp_path):
    text = study.read_text().replace('["0.5 GPa", "1 GPa"]', '{ from = "0.5 GPa", to = "2 GPa", count = 9 }')
    study.write_text("stiffness = false\n" + text)
    done = invoke(study, "--out", tmp_path / "out", "--count", 3, "--to", "1 GPa")
    assert done.exit_code == 0, done.output
    rows = (tmp_path / "out" / "rough.csv").read_text().splitlines()
    np.testing.assert_allclose([float(row.split(",")[0]) for row in rows[1:]], [0.5e9, 0.5e9 * 2**0.5, 1e9])


@pytest.mark.full
def test_implausible_units_are_warned_of(tmp_path):
    """Heights in nanometres that are read as metres have a slope far beyond that of any surface."""
    path = heights(tmp_path / "map.npy", 8)
    done = invoke(path, "--out", tmp_path / "out", "--modulus", "70 GPa", "--spacing", "0.5 um", "--pressure", "1 MPa")
    assert "warning: the root mean square slope" in done.output
    assert "another unit" in done.output


def test_pressures_of_full_contact_are_warned_of(tmp_path):
    """Coordinates in micrometres that are read as metres make the surface flat."""
    path = heights(tmp_path / "map.npy", 8)
    options = ("--modulus", "70 GPa", "--spacing", "0.5 m", "--unit", "1 nm", "--pressure", "1 MPa")
    done = invoke(path, "--out", tmp_path / "out", *options)
    assert "warning: the smallest pressure, 1e+06 Pa, is " in done.output
    assert "nearly the whole surface is in contact" in " ".join(done.output.split())


@pytest.mark.full
@pytest.mark.parametrize(
    ("end", "status", "message"),
    [
        ("os.kill(os.getpid(), signal.SIGKILL)", -signal.SIGKILL, ""),
        ("raise MemoryError", 1, "error: not enough memory; 2 of 3 pressures are finished and in "),
    ],
)
def test_ended_processes_leave_finished_pressures(study, tmp_path, end, status, message):
    """A process that is killed, or runs out of memory, at its third pressure leaves two, and no picture of a study
    before."""
    out, three = tmp_path / "out", ["--pressure", "1 GPa", "--pressure", "1.5 GPa", "--pressure", "2 GPa"]
    assert invoke(study, "--out", out, "--pressure", "3 GPa").exit_code == 0
    script = (
        "import os, signal\n"
        "from meeframe.study.rough import run, study\n"
        "study.INTERVAL = 0.0\n"
        "points = run._Solution.points\n"
        "def ended(self):\n"
        "    for number, point in enumerate(points(self)):\n"
        "        if number == 2:\n"
        f"            {end}\n"
        "        yield point\n"
        "run._Solution.points = ended\n"
        "from meeframe.cli import main\n"
        "main()\n"
    )
    arguments = [sys.executable, "-c", script, "rough", str(study), "--out", str(out), "--overwrite", *three]
    environment = os.environ | {"NUMBA_NUM_THREADS": "1"}
    done = subprocess.run(arguments, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == status, done.stderr
    assert message in done.stderr
    assert {path.name for path in out.iterdir()} - {".lock"} == {"rough.h5", "rough.csv", "surface.json"}
    assert [row.split(",")[0] for row in (out / "rough.csv").read_text().splitlines()[1:]] == [
        "1000000000",
        "1500000000",
    ]
    shown = show(out)
    assert shown.exit_code == 0, shown.output
    assert "2 of 3 pressures are finished" in shown.output
    again = invoke(study, "--out", out, "--overwrite", *three)
    assert again.exit_code == 0, again.output
    assert "pressures are finished" not in show(out).output
    assert not (out / ".lock").exists()


@pytest.mark.full
def test_quick_pressures_are_written_once(study, tmp_path, monkeypatch):
    """Finished pressures are written every two seconds, not after each of those that take less."""
    files, seconds = importlib.import_module("meeframe.study.rough.study"), iter([0.0, 1.0, 2.5, 2.6, 4.0, 5.0])
    written, original = [], files.write_tables
    monkeypatch.setattr(files, "monotonic", lambda: next(seconds))
    monkeypatch.setattr(
        files, "write_tables", lambda folder, result: (written.append(len(result.status)), original(folder, result))
    )
    options = [text for pressure in (1.0, 1.2, 1.4, 1.6) for text in ("--pressure", f"{pressure} GPa")]
    done = invoke(study, "--out", tmp_path / "out", *options)
    assert done.exit_code == 0, done.output
    assert written == [2]
    assert len((tmp_path / "out" / "rough.csv").read_text().splitlines()) == 5


@pytest.mark.full
def test_interruption_leaves_finished_pressures(study, tmp_path):
    """A process that is interrupted at its second pressure reports what is in the folder."""
    script = (
        "import os, signal, sys\n"
        "from meeframe.study.rough import run\n"
        "points = run._Solution.points\n"
        "def interrupted(self):\n"
        "    yield next(points(self))\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "run._Solution.points = interrupted\n"
        "from meeframe.cli import main\n"
        "main()\n"
    )
    arguments = [sys.executable, "-c", script, "rough", str(study), "--out", str(tmp_path / "out")]
    environment = os.environ | {"NUMBA_NUM_THREADS": "1"}
    done = subprocess.run(
        arguments, capture_output=True, text=True, env=environment, check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    assert done.returncode == 130, done.stderr
    assert "1 of 2 pressures are finished and in" in done.stderr
    assert len((tmp_path / "out" / "rough.csv").read_text().splitlines()) == 2
