"""Test interior fields of a finished run: command line, Python, rejected input."""

import re
from pathlib import Path

import meshio
import numpy as np
import pytest
from typer.testing import CliRunner

import meeframe
from meeframe import PointGrid
from meeframe.cli import app
from meeframe.common.errors import CaseError, ResultError
from meeframe.model.solve import reduce
from meeframe.results.interior import interior, write_interior

CASE = """
title = "steel"
formulation = { name = "half-space" }

[material]
name = "isotropic"
young_modulus = "210 GPa"
poisson_ratio = 0.3

[mesh]
type = "half-space"
half_width = "20 mm"
contact_width = "1.4 mm"
divisions = 20
rings = 1

[indenter]
name = "paraboloid"
radius_x = "100 mm"
radius_y = "100 mm"

[[steps]]
approach = "2.5 um"
"""
# contact radius sqrt(R approach), largest pressure 2 E* a / (pi R)
RADIUS = np.sqrt(0.1 * 2.5e-6)
PRESSURE = 2.0 * 210e9 / (1.0 - 0.3**2) * RADIUS / (np.pi * 0.1)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("steel")
    (folder / "case.toml").write_text(CASE)
    meeframe.run(folder / "case.toml", out=folder / "out")
    return folder


def invoke(*arguments):
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize("named", [True, False])
def test_show_interior(run, named):
    """The default box contains the largest shear and von Mises stress under Hertz's pressure, near 0.310 and 0.620
    p0."""
    out = run / "out"
    status, text, err = invoke("show", out, "--interior", *(("--case", run / "case.toml") if named else ()))
    assert status == 0, err
    assert "steel" in text
    assert "von mises" in text
    assert f"fields: {out / 'interior.vtu'}" in text
    mesh = meshio.read(out / "interior.vtu")
    assert mesh.cells[0].type == "hexahedron"
    assert mesh.point_data["max_shear [Pa]"].max() / PRESSURE == pytest.approx(0.310, abs=0.01)
    assert mesh.point_data["von_mises [Pa]"].max() / PRESSURE == pytest.approx(0.620, abs=0.02)
    (corners,) = [cells.data for cells in mesh.cells]
    volumes = np.linalg.det(np.stack([mesh.points[corners[:, k]] - mesh.points[corners[:, 0]] for k in (1, 3, 4)], 1))
    assert (volumes > 0.0).all()
    assert volumes.sum() == pytest.approx(np.prod(np.ptp(mesh.points, axis=0)))


def test_interior_of_a_run_on_a_section(run, tmp_path):
    grid = PointGrid.along_global_axes(np.linspace(-5e-4, 5e-4, 5), 0.0, np.linspace(-1e-3, -1e-4, 4))
    from_folder = meeframe.interior(run / "out", grid)
    np.testing.assert_array_equal(from_folder.points, grid.points)
    case = meeframe.load_case(run / "case.toml")
    result = meeframe.read_result(run / "out")
    in_memory = meeframe.interior(result, grid, case=case, increment=0)
    np.testing.assert_array_equal(in_memory.stress, from_folder.stress)
    assert from_folder.grid.cells()[0] == "quad"
    write_interior(tmp_path / "section.vtu", from_folder)
    read = meshio.read(tmp_path / "section.vtu")
    np.testing.assert_allclose(read.point_data["stress [Pa]"][:, 2], from_folder.stress[:, 2, 2])
    # no electric field in an uncoupled body
    assert not from_folder.electric_field.any()
    np.testing.assert_allclose(from_folder.strain, np.swapaxes(from_folder.strain, 1, 2))


def test_invalid_requests_are_rejected(run, tmp_path):
    result = meeframe.read_result(run / "out")
    with pytest.raises(ResultError, match="increment 1 of a run with 1 increments; allowed: -1 to 0"):
        meeframe.interior(result, increment=1)
    scattered = meeframe.interior(result, np.array([[0.0, 0.0, -1e-3]]))
    with pytest.raises(ResultError, match="not on a grid"):
        write_interior(tmp_path / "points.vtu", scattered)
    status, _, err = invoke("show", run / "out", "--interior", "--case", tmp_path / "none.toml")
    assert status == 2
    assert "none.toml" in err


def test_formulation_without_interior_fields(write_case, registry):
    """The message states that the formulation `winkler` of the tests provides no interior fields."""
    case = meeframe.load_case(write_case(), registry)
    system = reduce(case)
    with pytest.raises(CaseError, match="has no fields inside the body"):
        interior(system, np.zeros(system.offset.shape), np.array([[0.0, 0.0, -1e-3]]))


def test_example_of_the_page(tmp_path, monkeypatch, capsys):
    """The case and the Python code of docs/howto/interior.md run as printed and give Hertz's largest shear."""
    page = (Path(__file__).parents[3] / "docs" / "howto" / "interior.md").read_text(encoding="utf-8")
    case, code = (
        re.search(rf"^```{kind}\n(.*?)^```", page, re.DOTALL | re.MULTILINE)[1] for kind in ("toml", "python")
    )
    monkeypatch.chdir(tmp_path)
    Path("case.toml").write_text(case, encoding="utf-8")
    names = {}
    exec(code, names)
    assert names["depth"] == pytest.approx(0.481 * RADIUS, abs=0.1 * RADIUS)
    assert names["shear"].shape == (17, 1, 20)
    assert names["shear"].max() / PRESSURE == pytest.approx(0.310, abs=0.01)
    assert "von_mises" in capsys.readouterr().out
    assert Path("section.vtu").exists()
