"""Tables, datasets, figures and scenes of a result agree with its arrays."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import meeframe
from meeframe.contact.problem import Status
from meeframe.results.figures import figures
from meeframe.results.files import write_result
from meeframe.results.overview import overview
from meeframe.results.selection import Choice, has_increment, load_steps_in_words, select
from meeframe.results.vtk import write_fields


@pytest.fixture
def result(synthetic):
    """Return a result with two increments of loading, one tangential and one of unloading; the pressure is 1 MPa /
    µm in all of them."""
    steps = [
        synthetic.step(1e-6, increment=1),
        synthetic.step(3e-6, increment=2),
        synthetic.step(3e-6, number=2),
        synthetic.step(2e-6, number=3),
    ]
    return meeframe.Result.of(synthetic.result(*steps))


def axes():
    return Figure().subplots()


def test_a_result_is_a_sequence_of_increments(result):
    assert len(result) == 4
    assert list(result) == list(result.steps)
    assert result[-1] is result.steps[-1]
    assert result[:2] == result.steps[:2]


@pytest.mark.parametrize(
    ("which", "index"),
    [(None, 2), ("peak", 2), ("last", 3), (1, 1), ((1, 1), 0), ("1.1", 0), ("1", 1), (3, 3), ("3", 3)],
)
def test_selection_of_increments(result, which, index):
    assert result.select(which) is result.steps[index]
    assert result.select(result[index]) is result[index]


@pytest.mark.parametrize("which", [4, (1, 3), "1.3", "one", "1.2.3", ""])
def test_missing_increment_is_rejected(result, which):
    with pytest.raises(
        meeframe.MeeframeError, match=r"no such increment; allowed: peak, last, .* 1 \(increments 1 to 2\)"
    ):
        select(result, which)


def test_load_steps_in_words():
    counts = {1: 2, 2: 1, 3: 1, 4: 1, 5: 3}
    assert (
        load_steps_in_words(counts)
        == "load steps 1 (increments 1 to 2), 2 to 4 (increment 1 of each), 5 (increments 1 to 3)"
    )


def test_dataframe_has_a_row_for_each_increment(result):
    table = result.to_dataframe()
    assert list(zip(table["step"], table["increment"], strict=True)) == [(1, 1), (1, 2), (2, 1), (3, 1)]
    totals = [meeframe.resultants(result.zone, step) for step in result]
    np.testing.assert_array_equal(table["approach"], [step.loading.approach for step in result])
    for name in ("normal_force", "charge", "magnetic_flux", "contact_area", "max_pressure", "dissipated_energy"):
        np.testing.assert_array_equal(table[name], [getattr(total, name) for total in totals])
    np.testing.assert_array_equal(table[["force_x", "force_y", "force_z"]], [total.force for total in totals])
    np.testing.assert_array_equal(table["tilt_1"], [step.loading.tilt[0] for step in result])
    assert set(table["status"]) == {"converged"}
    units = table.attrs["units"]
    assert {units[name] for name in ("approach", "charge", "contact_area")} == {"m", "C", "m^2"}
    assert set(units) | {"step", "increment", "status"} == set(table.columns)


def test_dataframe_omits_fixed_zero_rotations(result):
    def columns(**loading):
        steps = (dataclasses.replace(step, loading=dataclasses.replace(step.loading, **loading)) for step in result)
        return set(dataclasses.replace(result, steps=tuple(steps)).to_dataframe().columns)

    nothing = {"tilt": np.zeros(2), "twist": 0.0}
    assert not {"tilt_1", "moment_1", "twist", "torque"} & columns(**nothing)
    assert {"twist", "torque"} <= columns(**nothing, prescribed={"torque": np.zeros(1)})


def changed(result, fluxes=None, **scalars):
    """Return a result without the magnetic field but for these fluxes and potentials of the indenter."""
    steps = []
    for step in result:
        loading = dataclasses.replace(
            step.loading, scalars={**step.loading.scalars, "magnetic_potential": 0.0, **scalars}
        )
        new = np.zeros(len(step.fluxes)) if fluxes is None else fluxes
        values = {name: getattr(step, name).copy() for name in ("potentials", "fluxes")}
        values["potentials"][:, 1], values["fluxes"][:, 1] = 0.0, new
        steps.append(dataclasses.replace(step, loading=loading, **values))
    return dataclasses.replace(result, steps=tuple(steps))


def test_absent_scalar_fields_are_left_out(result):
    """A field is shown if it has fluxes without a sum, or a potential of the indenter alone."""

    def magnetic(shown):
        names = [*shown.to_dataframe().columns, *shown.to_xarray().variables]
        return {name for name in names if "magnetic" in name}

    assert not magnetic(changed(result))
    assert {"charge", "electric_potential"} <= set(changed(result).to_dataframe().columns)
    balanced = np.zeros(len(result.zone.points))
    balanced[:2] = np.array([1.0, -1.0]) / result.zone.weights[:2]
    for shown in (changed(result, balanced), changed(result, magnetic_potential=1.0)):
        assert {"magnetic_potential", "magnetic_flux", "total_magnetic_flux"} <= magnetic(shown)
    assert "magnetic_conductance" not in magnetic(changed(result, balanced))
    assert "magnetic_conductance" in magnetic(changed(result, magnetic_potential=1.0))


def test_absent_wear_and_friction_are_left_out(result):
    """Columns of friction remain in tables, in which runs with and without it are compared."""
    changes = {"wear": np.zeros(25), "dissipation": np.zeros(25)}
    smooth = [
        dataclasses.replace(step, traction=step.traction * [0, 0, 1], region=np.minimum(step.region, 1), **changes)
        for step in result
    ]
    slips = {"slip", "total_slip", "slip_path"}
    for shown, fields, columns in (
        (smooth, set(), set()),
        ([dataclasses.replace(step, wear=np.full(25, 1e-9)) for step in smooth], {"wear", *slips}, {"worn_volume"}),
        ([dataclasses.replace(step, **changes) for step in result], {"dissipation", *slips}, set()),
    ):
        one = dataclasses.replace(result, steps=tuple(shown))
        variables = set(one.to_xarray().variables)
        assert variables & {"wear", "dissipation", *slips} == fields
        for names in (variables, set(one.to_dataframe().columns)):
            assert names & {"worn_volume", "dissipated_energy", "stick_area"} == columns | {
                "dissipated_energy",
                "stick_area",
            }


def test_dataset_of_a_grid_has_x_and_y(result):
    data = result.to_xarray()
    assert dict(data.sizes) == {"increment": 4, "x": 5, "y": 5, "component": 3, "tangent": 2}
    assert data["pressure"].dims == ("increment", "x", "y")
    for number, point in enumerate(result.zone.points):
        here = data.sel(x=point[0], y=point[1], method="nearest").isel(increment=1)
        assert float(here["pressure"]) == -result[1].traction[number, 2]
        assert float(here["electric_potential"]) == result[1].potentials[number, 0]
        np.testing.assert_array_equal(here["traction"], result[1].traction[number])
        np.testing.assert_array_equal(here["total_slip"], result[1].total_slip[number])
    assert float((data["weights"] * data["pressure"]).sum(["x", "y"])[1]) == pytest.approx(
        float(data["normal_force"][1])
    )
    assert (data["pressure"].attrs["units"], data["x"].attrs["units"]) == ("Pa", "m")
    assert (data["magnetic_flux"].attrs["units"], data["total_magnetic_flux"].attrs["units"]) == ("Wb/m^2", "Wb")
    np.testing.assert_array_equal(data["indenter_electric_potential"], 3.0)
    assert list(data["step"].values) == [1, 1, 2, 3]


def test_dataset_of_scattered_nodes_has_nodes(result):
    moved = result.zone.points + np.random.default_rng(1).uniform(-1e-4, 1e-4, result.zone.points.shape)
    data = dataclasses.replace(result, zone=dataclasses.replace(result.zone, points=moved)).to_xarray()
    assert data["pressure"].dims == ("increment", "node")
    np.testing.assert_array_equal(data["pressure"][2], -result[2].traction[:, 2])
    np.testing.assert_array_equal(data["x"], moved[:, 0])


def test_tables_of_a_stored_result(result, tmp_path):
    write_result(tmp_path, result)
    read = meeframe.Result.load(tmp_path)
    assert read.to_dataframe().equals(result.to_dataframe())
    assert read.to_xarray().equals(result.to_xarray())
    assert read._repr_html_().startswith("<div><table><caption>a title")


def test_tables_without_their_libraries_name_the_extra(result, monkeypatch):
    for name in ("pandas", "xarray", "pyvista"):
        monkeypatch.setitem(sys.modules, name, None)
    for make, extra in ((result.to_dataframe, "data"), (result.to_xarray, "data"), (result.to_pyvista, "interactive")):
        with pytest.raises(meeframe.MeeframeError, match=rf"pip install 'meeframe\[{extra}\]'"):
            make()


def test_force_over_approach_in_three_lines(result):
    table = result.to_dataframe()
    line = table.plot(x="approach", y="normal_force", ax=axes()).lines[0]
    np.testing.assert_allclose(line.get_xydata(), np.column_stack([[1e-6, 3e-6, 3e-6, 2e-6], [9, 27, 27, 18]]))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("size", [(6.4, 4.8), (10.0, 3.0), (5.0, 2.5)])
def test_legends_lie_within_narrow_axes(result, size):
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, 4, figsize=size)
    result.plot.stick_slip(panels[0])
    result.plot.convergence(panels[1])
    result.plot.history(ax=panels[2])
    for panel in (one for one in panels if one.get_legend()):
        figure.draw_without_rendering()
        legend, inside = panel.get_legend().get_window_extent(), panel.get_window_extent()
        assert inside.x0 - 1 <= legend.x0
        assert legend.x1 <= inside.x1 + 1
    assert panels[0].get_legend()
    pyplot.close(figure)


def test_figures_on_given_axes(result):
    on = axes()
    assert result.plot.pressure(on) is on
    assert on.get_aspect() == 1.0
    assert (on.get_xlabel(), on.get_title()) == ("x [mm]", "a title\nstep 2, approach 3 µm\ncontact pressure")
    bar = on.figure.axes[1]
    assert bar.get_ylabel() == "contact pressure [MPa]"
    assert on.collections[0].get_array().max() == pytest.approx(3.0)
    assert result.plot.pressure(axes(), step=3).collections[0].get_array().max() == pytest.approx(2.0)
    section = result.plot.section("electric_potential", axes(), step=(1, 1))
    assert section.get_ylabel() == "electric potential\n[V]"
    np.testing.assert_allclose(section.lines[1].get_ydata(), result[0].potentials[result.zone.points[:, 1] == 0.0, 0])
    labels = [text.get_text() for text in result.plot.stick_slip(axes()).get_legend().get_texts()]
    assert labels == ["slip, 8 mm²", "stick, 1 mm²"]
    convergence = result.plot.convergence(axes())
    assert (convergence.get_xlabel(), convergence.get_yscale()) == ("iteration", "log")
    np.testing.assert_array_equal(convergence.lines[0].get_xydata(), result[2].history)
    with pytest.raises(meeframe.MeeframeError, match=r"unknown field 'presure'; .*pressure"):
        result.plot.map("presure", axes())


def test_figures_without_axes_use_pyplot(result):
    from matplotlib import pyplot

    new = result.plot.pressure()
    assert new.figure.number in pyplot.get_fignums()
    pyplot.close(new.figure)


def test_history_marks_unloading(result):
    curve = result.plot.history(ax=axes())
    np.testing.assert_allclose(curve.lines[0].get_xydata(), [[1, 9], [3, 27], [3, 27], [2, 18]])
    np.testing.assert_allclose(curve.lines[1].get_xydata(), [[2, 18]])
    # dots at the increments of loading, which remain visible in the rings of unloading
    assert curve.lines[0].get_markevery() == [0, 1, 2]
    assert curve.lines[1].get_markerfacecolor() == "none"
    assert curve.lines[1].get_markersize() > curve.lines[0].get_markersize()
    assert [text.get_text() for text in curve.get_legend().get_texts()] == ["loading", "unloading"]
    area = result.plot.history("contact area", axes())
    assert (area.get_ylabel(), area.lines[0].get_ydata()[0]) == ("contact area [mm²]", pytest.approx(9.0))
    assert result.plot.history("charge", axes()).get_xlabel() == "normal force [N]"
    with pytest.raises(meeframe.MeeframeError, match="no curve 'heat'; allowed: normal force, tangential force"):
        result.plot.history("heat", axes())


def test_open_nodes_have_no_colour(result):
    """A uniform pressure is drawn uniformly up to the contact edge, without interpolation to zero."""
    values = result.plot.pressure(axes()).collections[0].get_array()
    drawn = result.plot.pressure(axes()).collections[0]
    used = np.unique(drawn._triangulation.triangles)
    np.testing.assert_allclose(values[used], 3.0)


def test_round_off_is_drawn_as_zero(result, synthetic):
    """A potential of 1e-12 of its peak value has no map after unloading."""
    last = dataclasses.replace(result[-1], potentials=1e-12 * result[-1].potentials)
    unloaded = dataclasses.replace(result, steps=(*result.steps[:-1], last))
    assert "electric_potential" in figures(unloaded)
    assert "electric_potential" not in figures(unloaded, "last")


def test_no_stick_and_slip_without_friction(result):
    smooth = [
        dataclasses.replace(step, traction=step.traction * [0, 0, 1], region=np.minimum(step.region, 1))
        for step in result
    ]
    without = dataclasses.replace(result, steps=tuple(smooth))
    assert "stick_slip" not in figures(without)
    with pytest.raises(meeframe.MeeframeError, match="no friction"):
        without.plot.stick_slip(axes())


def test_failed_increments_are_not_selected_as_peak(result):
    broken = dataclasses.replace(result[2], traction=np.full_like(result[2].traction, np.nan), status=Status.DIVERGED)
    assert select(dataclasses.replace(result, steps=(*result[:2], broken, result[3]))) is result[1]


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("which", ["peak", "last", "1", "1.3", "2", "7"])
def test_choice_of_passing_increments_agrees_with_select(synthetic, which):
    """Among random loads are nearly equal ones, and some that are not finite."""
    random = np.random.default_rng(5)
    for _ in range(50):
        loads = random.choice([1.0, 1.0004, 1.0008, 1.0012, 0.5, np.nan], 8) * 1e-6
        steps = [synthetic.step(load, number=1 + i // 5, increment=1 + i % 5) for i, load in enumerate(loads)]
        result, choice = synthetic.result(*steps), Choice(which)
        for step in steps:
            choice.add(step, overview(step, result.zone))
        assert choice.step is select(result, which if has_increment(result, which) else "peak")


def test_peak_load_is_the_last_one_near_the_largest(synthetic):
    """A load that is near the largest one so far, but not near that of all increments, is not the peak load."""
    loads = [1.0, 2.0, 1.999, 1.9979, 0.1, 2.0015, 2.0001, 1.0]
    result = synthetic.result(*(synthetic.step(1e-6 * load, number=i) for i, load in enumerate(loads, 1)))
    assert select(result).step == 7


@pytest.fixture(scope="module")
def indented():
    """Return two load steps on a small block, with boundary fields."""
    return meeframe.Case(
        material="batio3-cofe2o4",
        mesh=meeframe.mesh.block("50 mm", "120 mm", "5 mm", divisions=4, rings=2, layers=1),
        boundary=[meeframe.Boundary("base", displacement=[0, 0, 0], electric_potential=0, magnetic_potential=0)],
        indenter=meeframe.Sphere("100 mm"),
        steps=[meeframe.Step(approach="20 um"), meeframe.Step(approach="10 um")],
    ).solve()


@pytest.mark.full
def test_scene_of_body_and_zone(indented):
    pytest.importorskip("pyvista")
    scene = indented.to_pyvista(1, warp=2.0)
    step = indented[0]
    np.testing.assert_allclose(
        scene["body"].points, step.boundary.points + 2.0 * step.boundary.values[:, :3], atol=1e-7
    )
    np.testing.assert_array_equal(scene["zone"]["contact pressure [Pa]"], -step.traction[:, 2])
    assert scene["body"]["displacement [m]"].shape == (len(step.boundary.points), 3)
    assert scene["body"].n_cells == sum(len(nodes) for _, nodes in step.boundary.cells)
    assert scene["zone"].n_cells == sum(len(nodes) for _, nodes in indented.zone.cells)
    zone, frames = indented.zone, indented.zone.frames
    shift = np.einsum("nk,nki->ni", step.displacement, frames)
    np.testing.assert_allclose(scene["zone"].points, zone.points + 2.0 * shift, atol=1e-7)
    np.testing.assert_array_equal(scene["zone"]["electric potential [V]"], step.potentials[:, 0])
    assert scene["zone"].field_data["warp factor"] == [2.0]


_PICTURE = """
import sys
import numpy, pyvista, meeframe
scene = meeframe.read_result(sys.argv[1]).to_pyvista(1)
plotter = pyvista.Plotter(off_screen=True, window_size=(200, 200))
plotter.add_mesh(scene["zone"], scalars="contact pressure [Pa]", show_scalar_bar=False)
numpy.save(sys.argv[2], plotter.screenshot(return_img=True))
"""


@pytest.mark.full
def test_scene_is_rendered_off_screen(indented, tmp_path):
    """The picture shows the pressure in many colours; a separate process renders it, because OpenGL may be missing."""
    pytest.importorskip("pyvista")
    sphere = "import pyvista; pyvista.Sphere().plot(off_screen=True, window_size=(9, 9))"
    if subprocess.run([sys.executable, "-c", sphere], capture_output=True).returncode:
        pytest.skip("VTK finds no OpenGL on this machine")
    write_result(tmp_path, indented, {"boundary"})
    image = tmp_path / "image.npy"
    subprocess.run([sys.executable, "-c", _PICTURE, tmp_path, image], check=True, capture_output=True)
    assert len(np.unique(np.load(image).reshape(-1, 3), axis=0)) > 20


def test_series_of_boundary_fields(indented, tmp_path):
    import meshio

    write_fields(indented, tmp_path)
    text = (tmp_path / "fields.pvd").read_text(encoding="utf-8")
    for number, step in enumerate(indented, 1):
        assert f'timestep="{number}" part="0" file="fields.series/{number:04d}.vtu"' in text
        mesh = meshio.read(tmp_path / "fields.series" / f"{number:04d}.vtu")
        np.testing.assert_allclose(mesh.point_data["displacement [m]"], step.boundary.values[:, :3])


def test_style_is_available_in_matplotlib():
    from matplotlib import pyplot

    with pyplot.style.context(meeframe.STYLE):
        assert pyplot.rcParams["image.cmap"] == "cividis"
