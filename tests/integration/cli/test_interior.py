"""Test interior fields of a finished run: command line, Python, rejected input."""

import re
import shutil
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

import meeframe
from meeframe import PointGrid
from meeframe.cli import app
from meeframe.common.errors import CaseError, ResultError
from meeframe.contact.problem import Status
from meeframe.model.solve import reduce
from meeframe.results.interior import interior, write_interior
from meeframe.results.records import Region

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


@pytest.mark.full
@pytest.mark.parametrize("named", [True, False])
def test_show_interior(run, named):
    """The default box contains the largest shear and von Mises stress under Hertz's pressure, near 0.310 and 0.620
    p0."""
    out = run / "out"
    suffix = "pdf" if named else "png"
    options = ("--case", run / "case.toml", "--format", suffix) if named else ()
    status, text, err = invoke("show", out, "--interior", *options)
    assert status == 0, err
    assert "steel" in text
    assert "von Mises stress" in text
    assert "electric" not in text, "no fields in a body that couples nothing"
    assert f"fields: {out / 'interior.vtu'}, section: {out / 'interior'}.{suffix}" in text
    assert (out / f"interior.{suffix}").is_file()
    mesh = meshio.read(out / "interior.vtu")
    assert mesh.cells[0].type == "hexahedron"
    assert mesh.point_data["max_shear [Pa]"].max() / PRESSURE == pytest.approx(0.310, abs=0.01)
    assert mesh.point_data["von_mises [Pa]"].max() / PRESSURE == pytest.approx(0.620, abs=0.02)
    (corners,) = [cells.data for cells in mesh.cells]
    volumes = np.linalg.det(np.stack([mesh.points[corners[:, k]] - mesh.points[corners[:, 0]] for k in (1, 3, 4)], 1))
    assert (volumes > 0.0).all()
    assert volumes.sum() == pytest.approx(np.prod(np.ptp(mesh.points, axis=0)))


@pytest.mark.full
def test_show_interfaces(tmp_path):
    """A table lists the largest tractions on each interface of a layered body."""
    layers = '[[layers]]\nmaterial = "pzt-4"\nthickness = "0.3 mm"\n\n[base]\nthickness = "1 mm"\n'
    case = CASE.replace("divisions = 20", "divisions = 6").replace("[mesh]", layers + "[mesh]")
    (tmp_path / "case.toml").write_text(case)
    meeframe.run(tmp_path / "case.toml", out=tmp_path / "out")
    status, text, err = invoke("show", tmp_path / "out", "--interior")
    assert status == 0, err
    table = text[text.index("largest tractions on interfaces") :]
    for number, depth in (("1", "0.0003"), ("2", "0.0013")):
        assert re.search(rf"{number}[ │]+{depth}[ │]+shear[ │]+Pa", table)


@pytest.mark.full
def test_interior_of_a_run_on_a_section(run, tmp_path):
    grid = PointGrid.along_global_axes(np.linspace(-5e-4, 5e-4, 5), 0.0, np.linspace(-1e-3, -1e-4, 4))
    from_folder = meeframe.interior(run / "out", grid)
    np.testing.assert_array_equal(from_folder.points, grid.points)
    case = meeframe.load_case(run / "case.toml")
    result = meeframe.read_result(run / "out")
    in_memory = meeframe.interior(result, grid, case=case, step=(1, 1))
    np.testing.assert_array_equal(in_memory.stress, from_folder.stress)
    assert from_folder.grid.cells()[0] == "quad"
    write_interior(tmp_path / "section.vtu", from_folder)
    read = meshio.read(tmp_path / "section.vtu")
    np.testing.assert_allclose(read.point_data["stress [Pa]"][:, 2], from_folder.stress[:, 2, 2])
    # no electric field in an uncoupled body
    assert not from_folder.electric_field.any()
    np.testing.assert_allclose(from_folder.strain, np.swapaxes(from_folder.strain, 1, 2))


@pytest.mark.full
def test_picture_of_a_section(run):
    """The picture shows the values at the points of the plane, on axes in the unit of its labels."""
    section = PointGrid.along_global_axes(np.linspace(-5e-4, 5e-4, 5), 0.0, np.linspace(-1e-3, -1e-4, 4))
    fields = meeframe.interior(run / "out", section)
    axes = fields.plot("stress_zz", Figure().subplots())
    (drawn,) = axes.collections
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("x [mm]", "z [mm]", "stress zz, y = 0")
    assert axes.figure.axes[1].get_ylabel() == "stress zz [MPa]"
    np.testing.assert_allclose(drawn.get_array().T, fields.stress[:, 2, 2].reshape(5, 4) / 1e6)
    np.testing.assert_allclose(drawn.get_coordinates()[0, :, 0], 1e3 * section.coordinates[0])
    with pytest.raises(ResultError, match="unknown field 'von_misses'; did you mean 'von_mises'"):
        fields.plot("von_misses")
    box = meeframe.interior(run / "out")
    assert [axes.get_title() for axes in box.figure("steel").axes[::2]] == ["steel\nvon Mises stress, y = 0"]
    middle = box.plot(ax=Figure().subplots()).collections[0].get_array()
    assert middle.max() * 1e6 / PRESSURE == pytest.approx(0.620, abs=0.02)


@pytest.mark.full
def test_progress_of_a_request(run):
    stages = []
    meeframe.interior(run / "out", progress=lambda stage, fraction: stages.append((stage, fraction)))
    fractions = [fraction for stage, fraction in stages if stage == "interior fields"]
    assert fractions == sorted(fractions)
    assert len(fractions) == 15, "one for each depth of the box"
    assert fractions[-1] == 1.0


PAIR = """
title = "two piezoelectric bodies"
formulation = "half-space"

[material]
name = "pzt-4"

[mesh]
type = "half-space"
contact_width = "1.4 mm"
divisions = 24
rings = 1

[second_body]
formulation = "half-space"

[second_body.material]
name = "batio3-cofe2o4"

[second_body.mesh]
type = "half-space"
contact_width = "1.4 mm"
divisions = 24
rings = 1

[contact]
law = { name = "isotropic-coulomb", mu = 0.3 }

[conductivity.electric]
name = "step"
kappa = inf

[indenter]
name = "paraboloid"
radius_x = "100 mm"
radius_y = "100 mm"

[[steps]]
approach = "2.5 um"
translation = ["0.2 um", "0.1 um"]
"""


def solve_case_text(text, folder):
    (folder / "case.toml").write_text(text)
    result = meeframe.solve_case(meeframe.load_case(folder / "case.toml"))
    assert {step.status for step in result.steps} == {Status.CONVERGED}
    return result


@pytest.mark.full
def test_tractions_and_fluxes_are_continuous_across_the_interface(tmp_path):
    """At interface nodes well inside the contact, t = sigma.n and D.n agree in both bodies."""
    result = solve_case_text(PAIR, tmp_path)
    (step,) = result.steps
    nodes = np.linalg.norm(result.zone.points, axis=1) < 0.25e-3
    assert step.touching[nodes].all()
    points = result.zone.points[nodes]
    fields = {body: meeframe.interior(result, points, body=body) for body in ("first", "second")}
    assert np.abs(step.fluxes[nodes, 0]).max() > 0.0
    scale, largest = np.abs(step.traction).max(), np.abs(step.fluxes[:, 0]).max()
    for one in fields.values():
        np.testing.assert_allclose(one.stress[:, :, 2], step.traction[nodes], rtol=0.0, atol=0.02 * scale)
        flux = one.electric_displacement[:, 2]
        np.testing.assert_allclose(flux, step.fluxes[nodes, 0], rtol=0.0, atol=0.05 * largest)
    # nodes stick: the first body moves relative to the second by the translation, and until the gap is closed
    relative = fields["first"].displacement - fields["second"].displacement
    overlap = 2.5e-6 - np.sum(points[:, :2] ** 2, axis=1) / 0.2
    expected = np.stack([np.full(len(points), 0.2e-6), np.full(len(points), 0.1e-6), -overlap], axis=1)
    np.testing.assert_allclose(fields["first"].displacement, step.displacement[nodes], rtol=0.0, atol=2.5e-9)
    assert (step.region[nodes] == Region.STICK).all()
    np.testing.assert_allclose(relative, expected, rtol=0.0, atol=2.5e-9)


@pytest.mark.full
def test_equal_bodies_are_mirror_images(tmp_path):
    """In bodies of the same piezoelectric material, the stress at +z in the second is the rotated stress at -z in
    the first."""
    text = PAIR.replace("batio3-cofe2o4", "pzt-4").replace('translation = ["0.2 um", "0.1 um"]', "")
    result = solve_case_text(text, tmp_path)
    points = np.array([[0.1, 0.2, -0.1], [-0.3, 0.05, -0.3], [0.0, 0.0, -0.2]]) * 1e-3
    turn = np.array([1.0, -1.0, -1.0])
    first = meeframe.interior(result, points)
    second = meeframe.interior(result, points * turn, body="second")
    scale = np.abs(first.stress).max()
    np.testing.assert_allclose(second.stress, first.stress * turn[:, None] * turn, rtol=0.0, atol=1e-6 * scale)
    with_load = PointGrid.below_contact(result.zone, result.steps[0], "second").points
    assert (with_load[:, 2] > 0.0).all()


def test_invalid_requests_are_rejected(run, tmp_path):
    result = meeframe.read_result(run / "out")
    with pytest.raises(ResultError, match=r"step 2: no such increment; allowed: .* and load step 1 \(increment 1\)$"):
        meeframe.interior(result, step=2)
    with pytest.raises(CaseError, match="there is no second body"):
        meeframe.interior(result, body="second")
    with pytest.raises(CaseError, match="body 'third': allowed: first, second"):
        meeframe.interior(result, body="third")
    scattered = meeframe.interior(result, np.array([[0.0, 0.0, -1e-3]]))
    with pytest.raises(ResultError, match="not on a grid"):
        write_interior(tmp_path / "points.vtu", scattered)
    with pytest.raises(ResultError, match="not on a grid"):
        scattered.plot()
    line = meeframe.interior(result, PointGrid.along_global_axes(0.0, 0.0, np.array([-1e-3, -5e-4])))
    with pytest.raises(ResultError, match="on a line"):
        line.plot()
    status, _, err = invoke("show", run / "out", "--interior", "--case", tmp_path / "none.toml")
    assert status == 2
    assert "none.toml" in err


def test_stored_case_that_is_no_case(run, tmp_path):
    """Results of others may hold any text."""
    shutil.copytree(run / "out", tmp_path / "out")
    for text in ("x = \x1b[31m", "x = " + 2_000 * "["):
        with h5py.File(tmp_path / "out" / "result.h5", "r+") as file:
            file.attrs["case"] = text
        status, _, err = invoke("show", tmp_path / "out", "--interior")
        assert status == 2
        assert err.startswith("error: the case stored with the result is not a TOML file: ")
        assert err.endswith("; allowed: name the case\n")
        with pytest.raises(ResultError, match="is not a TOML file"):
            meeframe.interfaces(tmp_path / "out")


def test_formulation_without_interior_fields(write_case, registry):
    """The message states that the formulation `winkler` of the tests provides no interior fields."""
    case = meeframe.load_case(write_case(), registry)
    system = reduce(case)
    with pytest.raises(CaseError, match="there are no fields inside the body"):
        interior(system, np.zeros(system.offset.shape), np.array([[0.0, 0.0, -1e-3]]))


@pytest.mark.full
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


def test_box_has_points_in_all_layers(run):
    """A box under the contact ends on a rigid base, and has points on interfaces and in thin layers."""
    result = meeframe.read_result(run / "out")
    whole = PointGrid.below_contact(result.zone, result[0]).coordinates[2]
    depths = np.array([0.01, 0.02, 0.3]) * -whole[0]
    grid = PointGrid.below_contact(result.zone, result[0], interface_depths=depths, thickness=depths[-1])
    layered = -grid.coordinates[2]
    assert layered.max() == pytest.approx(depths[-1])
    assert all(np.isclose(layered, depth).any() for depth in depths)
    assert (np.histogram(layered, [1e-9, *(depths - 1e-9)])[0] > 0).all()
