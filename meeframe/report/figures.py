"""Figures of the last finished increment: maps over the contact zone, sections through its centre; and its history."""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from meeframe.core.fields import Array
from meeframe.core.result import Region, Result, StepResult, resultants
from meeframe.report.canvas import LINE_COLOURS, MAP_COLOURS, head, prefixed, sheet
from meeframe.report.history import history, name_of
from meeframe.report.picture import Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class _Quantity:
    """A nodal quantity to draw. file: stem of the figure's name."""

    file: str
    label: str
    unit: str

    def values(self, step: StepResult) -> Array:
        """Nodal values, (n,), SI."""
        if self.file == "pressure":
            return -step.traction[:, 2]
        return step.potentials[:, 0 if self.file == "electric_potential" else 1]


_QUANTITIES: Final = (
    _Quantity("pressure", "contact pressure", "Pa"),
    _Quantity("electric_potential", "electric potential", "V"),
    _Quantity("magnetic_potential", "magnetic potential", "A"),
)


def figures(result: Result) -> "dict[str, Figure]":
    """Figures of the last finished increment by file name; none if there is none or if not all in it is finite.

    With several increments that converged, their history besides.
    """
    if not result.steps:
        return {}
    step = result.steps[-1]
    if not np.isfinite(step.traction).all() or not np.isfinite(step.potentials).all():
        return {}
    picture = Picture.of(result.zone)
    title = _title(result)
    drawn = {f"{q.file}.png": _map(q, step, picture, title) for q in _QUANTITIES}
    drawn |= {"sections.png": _sections(result, picture, title), "stick_slip.png": _regions(result, picture, title)}
    past = history(result)
    return drawn if past is None else drawn | {"history.png": past}


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure as PNG. Dollars in texts are dollars; characters that the font lacks are boxes."""
    from matplotlib.text import Text

    figure.set_dpi(150)
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        if "$" in text.get_text():  # numbers along axes are typeset when they are drawn
            text.set_parse_math(False)
    # the same picture as by savefig, which draws twice, once for the layout alone; light compression: files a third
    # larger, written in two thirds of the time
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        figure.canvas.print_png(path, pil_kwargs={"compress_level": 1})  # type: ignore[attr-defined]  # of Agg's canvas


def _title(result: Result) -> str:
    """Title of the case, and the increment where there are several."""
    step = f"{name_of(result, result.steps[-1])}, approach {result.steps[-1].loading.approach * 1e6:.6g} µm"
    parts = [result.provenance.title, step if result.planned_steps > 1 else ""]
    return "\n".join(filter(None, parts))


def _map(quantity: _Quantity, step: StepResult, picture: Picture, title: str) -> "Figure":
    values = quantity.values(step)
    factor, unit = prefixed(values, quantity.unit)
    figure = sheet((5.6, 4.6))
    axes = figure.subplots()
    shown = picture.values(values / factor)
    drawn = axes.tripcolor(picture.triangulation, shown, shading="gouraud", cmap=MAP_COLOURS)
    figure.colorbar(drawn, ax=axes, label=f"{quantity.label} [{unit}]")
    touching = step.touching
    if touching.any() and not touching.all():  # the edge of the contact, half way between nodes
        axes.tricontour(picture.triangulation, picture.values(touching.astype(float)), [0.5], colors="white")
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    head(axes, quantity.label, title)
    return figure


def _regions(result: Result, picture: Picture, title: str) -> "Figure":
    """Where the contact sticks and where it slips; edges half way between nodes."""
    step, totals = result.steps[-1], resultants(result.zone, result.steps[-1])
    figure = sheet((5.6, 4.6))
    axes = figure.subplots()
    shown = (
        (step.region != Region.OPEN, "slip", totals.slip_area),
        (step.region == Region.STICK, "stick", totals.stick_area),
    )
    for (inside, name, area), colour in zip(shown, LINE_COLOURS, strict=False):
        axes.fill([], [], color=colour, label=f"{name}, {area * 1e6:.4g} mm²")
        axes.tricontourf(picture.triangulation, picture.values(inside.astype(float)), [0.5, 1.5], colors=[colour])
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    axes.legend(loc="upper right")
    head(axes, "stick and slip", title)
    return figure


def _sections(result: Result, picture: Picture, title: str) -> "Figure":
    """Along x through the middle; with friction the tangential traction, too."""
    from matplotlib.tri import LinearTriInterpolator

    flat = picture.triangulation
    x = np.linspace(flat.x.min(), flat.x.max(), 401)
    on_axis = np.abs(picture.points[:, 1]) < 1e-6 * np.ptp(flat.y)
    step = result.steps[-1]
    shown = [(quantity.label, quantity.unit, quantity.values(step)) for quantity in _QUANTITIES]
    if step.traction[:, :2].any():
        along = np.einsum("nk,nka,a->n", step.traction[:, :2], result.zone.frames[:, :2], picture.axes[0])
        shown.insert(1, ("traction along x", "Pa", along))
    figure = sheet((6.0, 2.4 * len(shown)))
    rows = figure.subplots(len(shown), sharex=True)
    for axes, (label, unit, values), colour in zip(rows, shown, LINE_COLOURS, strict=False):
        factor, unit = prefixed(values, unit)
        section = LinearTriInterpolator(flat, picture.values(values / factor))(x, np.zeros_like(x))
        axes.plot(x, section, color=colour, linewidth=1.8)
        axes.plot(picture.points[on_axis, 0], values[on_axis] / factor, "o", color=colour, markersize=3.5)
        axes.set_ylabel(f"{label}\n[{unit}]")
        axes.grid(alpha=0.3)
    rows[-1].set_xlabel("x [mm]")
    head(rows[0], "sections y = 0", title)
    figure.align_ylabels(rows)
    return figure
