"""Test the figure of a study and its numbers."""

import json
from dataclasses import replace

import numpy as np
import pytest

from meeframe.study.reports.study import Panel, Study, middle_line, study_figure, study_json


def panel(zone, shape, converged=True):
    values = np.linspace(0.0, 1.0, 2 * int(np.prod(shape, initial=1))).reshape(2, *shape)
    return Panel(
        title="a panel",
        axis="friction",
        runs=("0.1", "free"),
        values=np.array([0.1, np.nan]),
        quantities={"force": values},
        references={"force": 2.0},
        converged=(True, converged),
        messages=("well", "not well"),
        zones=(zone, zone),
    )


SHAPES = {"curves": (), "sections": (25,), "maps": (25, 2)}


@pytest.mark.parametrize("kind", SHAPES)
def test_every_kind_is_drawn_and_described(synthetic, kind):
    study = Study(
        "fig-00", "a study", "the paper's words", kind, "linear", (panel(synthetic.zone(), SHAPES[kind]),) * 2
    )
    figure = study_figure(study)
    figure.canvas.draw()
    axes = [axes for axes in figure.axes if axes.get_title()]
    assert len(axes) == (4 if kind == "maps" else 2)
    assert all("a panel" in a.get_title() for a in axes)
    record = json.loads(study_json(study))
    assert record["kind"] == kind
    (first, _) = record["panels"]
    np.testing.assert_array_equal(first["quantities"]["force"], study.panels[0].quantities["force"])
    assert first["values"] == [0.1, None]
    assert first["messages"] == ["well", "not well"]
    assert ("zones" in first) == (kind != "curves")
    if kind != "curves":
        assert first["zone_of_run"] == [0, 0]
        (zone,) = first["zones"]
        np.testing.assert_array_equal(zone["points"], synthetic.zone().points)
        np.testing.assert_array_equal(zone["weights"], synthetic.zone().weights)


@pytest.mark.parametrize("kind", ["sections", "maps"])
def test_each_run_is_drawn_on_its_zone(synthetic, kind):
    zone = synthetic.zone()
    wide = replace(zone, points=2 * zone.points, weights=4 * zone.weights)
    one = replace(panel(zone, SHAPES[kind]), zones=(zone, wide))
    study = Study("fig-00", "a study", "", kind, "linear", (one,))
    axes = [axes for axes in study_figure(study).axes if axes.get_title()]
    if kind == "sections":
        ends = [line.get_xdata()[-1] for line in axes[0].lines]
    else:
        ends = [a.collections[0].get_datalim(a.transData).x1 for a in axes]
    np.testing.assert_allclose(ends, [2.0, 4.0])
    (record,) = json.loads(study_json(study))["panels"]
    assert record["zone_of_run"] == [0, 1]
    np.testing.assert_array_equal(record["zones"][1]["points"], wide.points)


def curve(synthetic, values):
    one = replace(panel(synthetic.zone(), ()), values=np.array(values))
    return study_figure(Study("fig-00", "a study", "", "curves", "log", (one,))).axes[0]


def test_curves_go_through_the_values(synthetic):
    axes = curve(synthetic, [0.1, 0.4])
    np.testing.assert_array_equal(axes.lines[0].get_xydata(), [[0.1, 0.0], [0.4, 1.0]])
    assert axes.get_xscale() == "log"


def test_runs_without_values_are_placed_by_labels(synthetic):
    axes = curve(synthetic, [0.1, np.nan])
    np.testing.assert_array_equal(axes.lines[0].get_xydata(), [[0.0, 0.0], [1.0, 1.0]])
    assert [label.get_text() for label in axes.get_xticklabels()] == ["0.1", "free"]


def test_runs_that_did_not_converge(synthetic):
    study = Study("fig-00", "", "", "curves", "linear", (panel(synthetic.zone(), (), converged=False),))
    assert study.not_converged == ("a panel, free",)


def test_the_middle_line_runs_along_x(synthetic):
    zone = synthetic.zone()
    nodes, x = middle_line(zone)
    np.testing.assert_allclose(x, [-2e-3, -1e-3, 0, 1e-3, 2e-3], atol=1e-18)
    np.testing.assert_array_equal(zone.points[nodes, 1], 0)
