"""Test `meeframe fclib export` and `meeframe fclib solve`."""

import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

import meeframe.plugin.registry as plugins
from meeframe.cli import app
from meeframe.results.fclib import LocalProblem, LocalSolution, read_local, read_solution, write_local


def fclib(*arguments):
    """Return exit status, standard output and standard error."""
    result = CliRunner().invoke(app, ["fclib", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture
def springs(monkeypatch, registry):
    monkeypatch.setattr(plugins, "load", lambda *_: registry)


@pytest.fixture
def frictional(write_case, springs):
    """Return a case of springs with mu = 0.3 that are pressed by 10 um, then dragged by 1 um (stick) and by 20 um
    (slip)."""
    law = '\n[[steps]]\ntranslation = ["1 um", 0]\n[[steps]]\ntranslation = ["20 um", 0]\n'
    return write_case(
        ("[indenter]", '[contact]\nlaw = { name = "isotropic-coulomb", mu = 0.3 }\n\n[indenter]'), more=law
    )


def test_export_and_solve(frictional, tmp_path):
    """On springs of 1e14 Pa/m, contacts are independent: r_N = w k overlap, r_T = -min(w k slip, mu r_N)."""
    path = tmp_path / "springs.hdf5"
    status, out, _ = fclib("export", frictional, path, "--increment", 2)
    assert status == 0
    assert "increment 1 of load step 2: converged" in out
    local, solution = read_local(path), read_solution(path)
    assert local.title == "tiny"
    overlap, own = -local.q[::3], np.diag(local.matrix)[::3]
    normal = np.maximum(overlap, 0.0) / own
    np.testing.assert_allclose(solution.r[::3], normal, rtol=1e-9, atol=1e-12 * normal.max())
    np.testing.assert_allclose(-solution.r[1::3], np.minimum(1e-6 / own, 0.3 * normal), atol=1e-9 * normal.max())
    status, out, _ = fclib("solve", path, "--solver", "newton")
    assert status == 0
    assert "reactions differ from those in the file by" in out
    assert float(out.split("those in the file by ")[1].split(";")[0]) < 1e-8
    assert "the solution in the file is unchanged" in out
    status, out, _ = fclib("solve", path, "--solver", '{ name = "uzawa" }', "--overwrite")
    assert status == 0
    assert "solution written" in out
    np.testing.assert_allclose(read_solution(path).r, solution.r, atol=1e-8 * normal.max())


def test_last_increment_is_the_default(frictional, tmp_path):
    """Slips are measured from the end of the previous increment."""
    path = tmp_path / "springs.hdf5"
    assert fclib("export", frictional, path)[0] == 0
    solution = read_solution(path)
    pressing = solution.r[::3] > 0
    assert (solution.u[1::3][pressing] > 1e-5).all()
    np.testing.assert_allclose(-solution.r[1::3], 0.3 * solution.r[::3], atol=1e-9 * solution.r.max())


def test_free_motion_is_fixed_at_its_solution(write_case, springs, tmp_path):
    path = tmp_path / "springs.hdf5"
    case = write_case(('approach = "10 um"', 'normal_force = "2 kN"'))
    status, out, _ = fclib("export", case, path)
    assert status == 0, out
    local, solution = read_local(path), read_solution(path)
    assert solution.r[::3].sum() == pytest.approx(2000.0, rel=1e-8)
    own = np.diag(local.matrix)[::3]
    np.testing.assert_allclose(solution.r[::3], np.maximum(-local.q[::3], 0.0) / own, rtol=1e-8, atol=1e-9)


def test_orthotropic_friction_is_rejected(write_case, springs, tmp_path):
    law = '[contact]\nlaw = { name = "orthotropic-coulomb", mu1 = 0.3, mu2 = 0.1 }\n\n[indenter]'
    status, _, err = fclib("export", write_case(("[indenter]", law)), tmp_path / "a.hdf5")
    assert status == 2
    assert "FCLIB: contact law OrthotropicCoulomb(mu1=0.3, mu2=0.1, angle=0.0); allowed:" in err
    assert not (tmp_path / "a.hdf5").exists()


def test_invalid_files_are_rejected(frictional, tmp_path):
    path = tmp_path / "a.hdf5"
    assert "--increment 4; allowed: 1 to 3" in fclib("export", frictional, path, "--increment", 4)[2]
    path.write_text("something else")
    status, _, err = fclib("export", frictional, path)
    assert status == 2
    assert "exists; name another file or pass --overwrite" in err
    assert path.read_text() == "something else"
    status, _, err = fclib("solve", path)
    assert status == 2
    assert "cannot be read as HDF5" in err
    write_local(path, LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.array([0.3])))
    status, _, err = fclib("solve", path, "--solver", "nuton")
    assert status == 2
    assert "did you mean 'newton'" in err


def test_unwritable_path_is_rejected_early(frictional, tmp_path, monkeypatch):
    def computed(*_arguments, **_more):
        raise AssertionError("computed all the same")

    monkeypatch.setattr("meeframe.study.fclib.reduce", computed)
    status, _, err = fclib("export", frictional, tmp_path / "none" / "a.hdf5")
    assert status == 2
    assert f"{tmp_path / 'none' / 'a.hdf5'} cannot be written" in err
    status, _, err = fclib("export", frictional, tmp_path, "--overwrite")
    assert status == 2
    assert f"{tmp_path} cannot be written" in err


def test_unreadable_solution_is_an_error_unless_replaced(tmp_path):
    path = tmp_path / "a.hdf5"
    bad = LocalSolution(np.full(3, np.nan), np.zeros(3))
    write_local(path, LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.array([0.3])), bad)
    status, _, err = fclib("solve", path)
    assert status == 2
    assert "its solution cannot be read" in err
    assert "pass --overwrite to replace it" in err
    assert fclib("solve", path, "--overwrite")[0] == 0
    np.testing.assert_allclose(read_solution(path).r, [1.0, 0, 0])


@pytest.mark.full
def test_unconverged_increment_is_not_written(tmp_path):
    path = tmp_path / "a.hdf5"
    rng = np.random.default_rng(1)
    root = rng.normal(size=(9, 9))
    write_local(path, LocalProblem(root @ root.T, rng.normal(size=9), np.full(3, 0.3)))
    before = path.read_bytes()
    status, out, _ = fclib("solve", path, "--solver", '{ name = "uzawa", step_normal = 1e-9, step_tangential = 1e-9 }')
    assert (status, "written" in out) == (1, False)
    assert path.read_bytes() == before
    shutil.copy(path, tmp_path / "b.hdf5")
    assert fclib("solve", tmp_path / "b.hdf5")[0] == 0
    assert read_solution(tmp_path / "b.hdf5") is not None
