"""Figures and tables of sweeps have readable units."""

import dataclasses
import io
from itertools import pairwise

import numpy as np
import pytest
from rich.console import Console

from meeframe.results.sweep_files import dataset
from meeframe.results.sweep_records import SweepAxis, SweepResult
from meeframe.study.reports.sweep import SweepPlot, sweep_figure, sweep_table


@pytest.fixture
def sweep():
    """Return a sweep of pressure and area over friction and two approaches; one point has no result."""
    quantities = {
        "max_pressure": np.array([[1e9, 2e9], [3e9, np.nan], [5e9, 6e9]]),
        "contact_area": np.array([[1e-6, 2e-6], [3e-6, np.nan], [5e-6, 6e-6]]),
    }
    texts = np.full((3, 2), "converged")
    mu = SweepAxis("contact.law.mu", ("0", "0.1", "0.3"), np.array([0.0, 0.1, 0.3]), "1")
    approach = SweepAxis("approach", ("10 um", "20 um"), np.array([1e-5, 2e-5]), "m")
    return SweepResult("", (mu, approach), quantities, {"max_pressure": "Pa", "contact_area": "m^2"}, *[texts] * 3)


def test_curves_have_prefixed_units(sweep):
    pressure, area = sweep_figure(sweep, [SweepPlot(("max_pressure", "contact_area"))]).axes
    assert (pressure.get_ylabel(), area.get_ylabel()) == ("largest pressure [GPa]", "contact area [mm²]")
    np.testing.assert_allclose(pressure.lines[0].get_ydata(), [1.0, 3.0, 5.0])
    np.testing.assert_allclose(area.lines[1].get_ydata(), [2.0, np.nan, 6.0])


def test_legends_are_beside_the_plots(sweep):
    """Legends do not cover points; a row with one plot has the width of a row with two."""
    figure = sweep_figure(sweep, [SweepPlot(("max_pressure", "contact_area")), SweepPlot(("max_pressure",))])
    figure.draw_without_rendering()
    for row in figure.subfigs:
        (legend,) = row.legends
        assert [text.get_text() for text in legend.get_texts()] == ["10 um", "20 um"]
        assert legend.get_window_extent().x0 > max(axes.get_window_extent().x1 for axes in row.axes)
        assert legend.get_window_extent().x1 < figure.bbox.x1
    above, _, below = figure.axes
    assert below.get_window_extent().width == pytest.approx(above.get_window_extent().width, rel=0.1)


@pytest.mark.parametrize(
    ("labels", "upright", "heading"),
    [
        (["EMII", "EMCI", "EIMCI"], False, "point"),
        ([f"isotropic-coulomb {number}" for number in range(6)], True, "point"),
        ([f"contact.law.mu = {number}, condition = EMCI" for number in range(6)], False, "point, numbered in order"),
        ([str(number) for number in range(60)], False, "point, numbered in order"),
    ],
)
def test_axis_labels_do_not_overlap(labels, upright, heading):
    """Labels of 65 letters, as in the study on docs/howto/sweep.md, do not overlap."""
    texts, area = np.full(len(labels), "converged"), {"contact_area": np.arange(1.0, len(labels) + 1.0)}
    points = SweepResult("", (SweepAxis("point", tuple(labels)),), area, {"contact_area": "m^2"}, *[texts] * 3)
    figure = sweep_figure(points, [SweepPlot(("contact_area",))])
    figure.draw_without_rendering()
    (axes,) = figure.axes
    assert axes.get_xlabel() == heading
    labels_drawn = [label for label in axes.get_xticklabels() if label.get_text() in labels]
    assert ([label.get_text() for label in labels_drawn] == labels) == (heading == "point")
    assert {label.get_rotation() for label in labels_drawn} <= {90.0 if upright else 0.0}
    low, high = axes.get_xlim()
    boxes = [label.get_window_extent() for label in axes.get_xticklabels() if low <= label.get_position()[0] <= high]
    assert all(one.x1 < other.x0 for one, other in pairwise(boxes))
    np.testing.assert_allclose(axes.lines[0].get_xdata(), area["contact_area"])


def test_forces_along_an_axis_have_a_prefix(sweep):
    force = SweepAxis("steps[1].normal_force", ("5 N", "1 kN", "20 kN"), np.array([5.0, 1e3, 2e4]), "N")
    figure = sweep_figure(dataclasses.replace(sweep, axes=(force, sweep.axes[1])), [SweepPlot(("max_pressure",))])
    (axes,) = figure.axes
    assert axes.get_xlabel() == "steps[1].normal_force [kN]"
    np.testing.assert_allclose(axes.lines[0].get_xdata(), [0.005, 1.0, 20.0])


def test_maps_have_units(sweep):
    axes, bar = sweep_figure(sweep, [SweepPlot(("max_pressure",), kind="map")]).axes
    assert bar.get_ylabel() == "largest pressure [GPa]"
    assert axes.get_ylabel() == "approach [µm]"
    assert axes.get_ylim() == pytest.approx((5.0, 25.0))
    np.testing.assert_allclose(axes.collections[0].get_array().compressed(), [1.0, 3.0, 5.0, 2.0, 6.0])


def test_quantities_without_values_are_drawn_empty(sweep):
    nothing = {"max_pressure": np.full((3, 2), np.nan)}
    empty = SweepResult("", sweep.axes, nothing, sweep.units, sweep.status, sweep.message, sweep.key)
    (axes,) = sweep_figure(empty, [SweepPlot(("max_pressure",))]).axes
    assert axes.get_ylabel() == "largest pressure [Pa]"


def test_prescribed_values_are_level_lines(sweep):
    """The last digits of a force that every point reaches are no curve."""
    force = 1e-3 * (1.0 + 1e-12 * np.arange(6.0).reshape(3, 2))
    prescribed = dataclasses.replace(sweep, quantities={"normal_force": force}, units={"normal_force": "N"})
    (axes,) = sweep_figure(prescribed, [SweepPlot(("normal_force",))]).axes
    np.testing.assert_allclose(axes.get_ylim(), (0.95, 1.05))
    assert not axes.yaxis.get_major_formatter().get_useOffset()


def test_lines_differ_in_markers_and_the_axis_has_a_prefix(sweep):
    (axes,) = sweep_figure(sweep, [SweepPlot(("max_pressure",), x="approach")]).axes
    assert axes.get_xlabel() == "approach [µm]"
    np.testing.assert_allclose(axes.lines[0].get_xdata(), [10.0, 20.0])
    assert len({line.get_marker() for line in axes.lines}) == 3


@pytest.mark.parametrize(("count", "rows"), [(1, 1), (3, 3), (5, 1)])
def test_every_value_of_a_third_axis_is_shown_by_default(sweep, count, rows):
    """Each value has a row of pictures, whose heading names it; of too many only the first one is shown."""
    condition = SweepAxis("condition", tuple(f"group {number}" for number in range(count)), None, "")
    quantities = {name: values[..., None] * np.arange(1.0, count + 1.0) for name, values in sweep.quantities.items()}
    quantities["normal_force"] = quantities["max_pressure"]
    texts = np.full((3, 2, count), "converged")
    units = {**sweep.units, "normal_force": "N"}
    figure = sweep_figure(SweepResult("", (*sweep.axes, condition), quantities, units, *[texts] * 3))
    assert len(figure.subfigs) == rows
    for number, row in enumerate(figure.subfigs):
        force, *_ = row.axes
        np.testing.assert_allclose(force.lines[0].get_ydata() / force.lines[0].get_ydata()[0], [1.0, 3.0, 5.0])
        assert row.get_suptitle() == (f"condition = group {number}" if count > 1 else "")
    forces = [row.axes[0].lines[0].get_ydata()[0] for row in figure.subfigs]
    np.testing.assert_allclose(forces, forces[0] * np.arange(1.0, rows + 1.0))


def table(sweep):
    console = Console(width=160, record=True, file=io.StringIO())
    console.print(sweep_table(dataclasses.replace(sweep, plotted=("contact_area",))))
    return console.export_text()


def test_contact_at_zone_boundary_is_marked(sweep):
    edge = np.zeros((3, 2, 4))
    edge[2, 1, 3] = 1.0
    computed = table(dataclasses.replace(sweep, quantities=sweep.quantities | {"contact_at_zone_boundary": edge}))
    (marked,) = (line for line in computed.splitlines() if "converged, at the zone boundary" in line)
    assert "6e-06" in marked
    assert "edge" not in table(sweep)


def test_table_lists_plotted_quantities(sweep):
    text = table(sweep)
    assert "contact area [m^2]" in text
    assert "6e-06" in text
    assert "pressure" not in text


def test_nodes_of_a_grid_are_on_x_and_y_in_any_order():
    pytest.importorskip("xarray")
    x, y = (grid.ravel() for grid in np.meshgrid([0.0, 1.0, 3.0], [-1.0, 2.0]))
    shuffled = np.random.default_rng(5).permutation(len(x))
    nodes = {"x": x[shuffled] + 1e-16, "y": y[shuffled], "z": np.full(len(x), 0.5)}
    pressure = nodes["x"] + 10 * nodes["y"]
    axes = (SweepAxis("mu", ("0", "1"), np.array([0.0, 1.0]), "1"),)
    texts = [np.full(2, text) for text in ("converged", "", "0")]
    fields = {"zone_pressure": np.stack([pressure, 2 * pressure])}
    made = SweepResult(
        "title", axes, {"force": np.ones(2)}, {"force": "N", "zone_pressure": "Pa"}, *texts, fields, nodes
    )
    computed = dataset(made)
    assert computed.zone_pressure.dims == ("mu", "y", "x")
    np.testing.assert_allclose(computed.zone_pressure.sel(mu=1), 2 * (computed.x + 10 * computed.y).T)
    assert float(computed.zone_pressure.sel(mu=0, y=2, method="nearest").sel(x=3, method="nearest")) == pytest.approx(
        23
    )
    assert (computed.x.units, computed.z.item(), computed.mu.units) == ("m", 0.5, "1")
    scattered = {**nodes, "x": nodes["x"] + np.array([0, 0, 0, 0, 0, 0.1])}
    assert dataset(dataclasses.replace(made, nodes=scattered)).zone_pressure.dims == ("mu", "node")
