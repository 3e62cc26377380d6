"""The figure of a study and its numbers."""

import json

import numpy as np
import pytest

from meeframe.report.study import Panel, Study, middle_line, study_figure, study_json


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
        zone=zone,
    )


SHAPES = {"curves": (), "sections": (25,), "maps": (25, 2)}


@pytest.mark.parametrize("kind", SHAPES)
def test_every_kind_is_drawn_and_told(synthetic, kind):
    study = Study(
        "fig-00", "a study", "the paper's words", kind, "linear", (panel(synthetic.zone(), SHAPES[kind]),) * 2
    )
    figure = study_figure(study)
    figure.canvas.draw()
    axes = [axes for axes in figure.axes if axes.get_title()]
    assert len(axes) == (4 if kind == "maps" else 2)
    assert all("a panel" in a.get_title() for a in axes)
    told = json.loads(study_json(study))
    assert told["kind"] == kind
    (first, _) = told["panels"]
    np.testing.assert_array_equal(first["quantities"]["force"], study.panels[0].quantities["force"])
    assert first["values"] == [0.1, None]
    assert first["messages"] == ["well", "not well"]
    assert ("points" in first) == (kind != "curves")


def test_curves_go_through_the_values(synthetic):
    figure = study_figure(Study("fig-00", "a study", "", "curves", "linear", (panel(synthetic.zone(), ()),)))
    (line,) = figure.axes[0].lines
    np.testing.assert_array_equal(line.get_xydata()[0], [0.1, 0.0])


def test_runs_that_did_not_converge(synthetic):
    study = Study("fig-00", "", "", "curves", "linear", (panel(synthetic.zone(), (), converged=False),))
    assert study.not_converged == ("a panel, free",)


def test_the_middle_line_runs_along_x(synthetic):
    zone = synthetic.zone()
    nodes, x = middle_line(zone)
    np.testing.assert_allclose(x, [-2e-3, -1e-3, 0, 1e-3, 2e-3], atol=1e-18)
    np.testing.assert_array_equal(zone.points[nodes, 1], 0)
