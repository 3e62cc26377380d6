"""The house style tells curves apart, and figures of sweeps, comparisons and verifications use it."""

from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_hex

import meeframe
from meeframe.contact.problem import Status
from meeframe.results.canvas import LINE_COLOURS, LINE_DASHES, NO_CONTACT, line_style
from meeframe.results.sweep_records import SweepAxis, SweepResult
from meeframe.study.reports.sweep import SweepPlot, sweep_figure
from meeframe.study.reports.verified import MeasuredQuantity, Verification, VerifiedRun
from meeframe.study.reports.verify import verification_figure


def test_eight_default_curves_differ_in_colour_and_most_in_dashes():
    with plt.style.context(meeframe.STYLE):
        axes = plt.figure().subplots()
        curves = [axes.plot([0, 1], [number, number])[0] for number in range(8)]
        looks = [(to_hex(curve.get_color()).upper(), curve.get_linestyle()) for curve in curves]
        assert to_hex(axes.get_facecolor()).upper() == NO_CONTACT
    plt.close("all")
    assert [colour for colour, _ in looks] == list(LINE_COLOURS)
    assert [dashes for _, dashes in looks] == [*LINE_DASHES, *LINE_DASHES]


def test_coinciding_curves_remain_visible():
    """Each curve is narrower than those below it and dashed in another way than its neighbours."""
    styles = [line_style(number, 8) for number in range(8)]
    for below, above in combinations(styles, 2):
        assert below["color"] != above["color"]
        assert below["marker"] != above["marker"]
        assert below["linewidth"] > above["linewidth"]
    for number in range(7):
        assert styles[number]["linestyle"] != styles[number + 1]["linestyle"]


def letters(figure):
    texts = [[text.get_text() for text in axes.texts] for axes in figure.axes]
    return [text for each in texts for text in each]


def test_sweeps_are_drawn_in_the_house_style():
    axis, texts = SweepAxis("mu", ("0", "0.1"), np.array([0.0, 0.1]), "1"), np.full(2, "converged")
    area = {"contact_area": np.array([1e-6, 2e-6]), "max_pressure": np.array([1e9, 2e9])}
    sweep = SweepResult("", (axis,), area, {"contact_area": "m^2", "max_pressure": "Pa"}, *[texts] * 3)
    figure = sweep_figure(sweep, [SweepPlot(("contact_area", "max_pressure"))])
    assert letters(figure) == ["(a)", "(b)"]
    for axes in figure.axes:
        assert to_hex(axes.get_facecolor()).upper() == NO_CONTACT
        assert not axes.spines["top"].get_visible()


def test_verifications_are_drawn_in_the_house_style():
    """Each formulation has one entry in the legend, with its own colour, marker and dashes."""
    runs = tuple(
        VerifiedRun(name, size, 10, str(Status.CONVERGED), steps={1: {"force": measured, "charge": measured}})
        for name in ("dense-bem", "skfem")
        for size in (1 / 4, 1 / 8, 1 / 16)
        for measured in [MeasuredQuantity(1 + 0.1 * size**2, 1.0)]
    )
    figure = verification_figure(Verification("", "", {}, {}, planned=len(runs), runs=runs))
    assert letters(figure) == ["(a)", "(b)"]
    assert to_hex(figure.axes[0].get_facecolor()).upper() == NO_CONTACT
    handles = figure.legends[0].legend_handles
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["dense-bem", "skfem"]
    assert len({(handle.get_color(), handle.get_linestyle(), handle.get_marker()) for handle in handles}) == 2
