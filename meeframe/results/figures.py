"""Figures of the last finished increment: maps, sections through the centre, and history."""

import warnings
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array
from meeframe.results import schema
from meeframe.results.canvas import LINE_COLOURS, head, prefixed, sheet
from meeframe.results.history import history, name_of
from meeframe.results.picture import Picture
from meeframe.results.records import Region, Result, StepResult, Zone, resultants
from meeframe.results.schema import NodalField

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_PRESSURE: Final = "pressure"
_BETWEEN: Final = (0.1, 2.0)
"""Bounds of the weights that locate the contact edge between two nodes."""
_SEEN: Final = 0.01
"""Least attraction that is shown, as a fraction of the largest traction; it decays with the distance without end."""


def figures(result: Result) -> "dict[str, Figure]":
    """Return the figures of the last finished increment by file name.

    There are none if there is no finished increment, if not all in it is finite, or if the zone has neither cells nor
    nodes that span an area. A potential that is zero throughout has none. With several converged increments, their
    history is included.
    """
    if not result.steps:
        return {}
    step = result.steps[-1]
    if not np.isfinite(step.traction).all() or not np.isfinite(step.potentials).all():
        return {}
    if not result.zone.cells and np.linalg.matrix_rank(result.zone.points - result.zone.points[0]) < 2:
        return {}
    picture = Picture.of(result.zone)
    title = _title(result)
    drawn = {f"{row.name}.png": _map(row, result, picture, title) for row in _shown(result.zone, step)}
    drawn |= {"sections.png": _sections(result, picture, title), "stick_slip.png": _regions(result, picture, title)}
    past = history(result)
    return drawn if past is None else drawn | {"history.png": past}


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure as PNG; dollar signs are literal, characters that the font lacks are boxes."""
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


def _shown(zone: Zone, step: StepResult) -> list[NodalField]:
    """Return the pressure, and the other fields with maps that are not zero throughout."""
    rows = schema.nodal(schema.View.MAP, step.fields).values()
    return [row for row in rows if row.name == _PRESSURE or row.values(zone, step).any()]


def _title(result: Result) -> str:
    """Return the title of the case, and the increment where there are several."""
    factor, unit = prefixed(np.array([result.steps[-1].loading.approach]), "m")
    approach = f"{result.steps[-1].loading.approach / factor:.4g} {unit}"
    step = f"{name_of(result, result.steps[-1])}, approach {approach}"
    parts = [result.provenance.title, step if result.planned_steps > 1 else ""]
    return "\n".join(filter(None, parts))


def _edge(zone: Zone, step: StepResult) -> Array:
    """Return a function of the nodes, (n,), that is positive in contact, negative elsewhere, and zero at the edge.

    Along a smooth contact edge p^2 grows linearly inwards, and gap^(2/3) outwards. Each is divided by its mean at the
    nodes next to the edge: on average the line lies half way between two nodes, but close to a node that hardly
    touches.
    """
    touching, edge = step.touching, np.zeros(len(step.touching), bool)
    for _, nodes in zone.cells:
        edge[nodes[touching[nodes].any(axis=1) & ~touching[nodes].all(axis=1)]] = True
    level = np.where(touching, np.maximum(-step.traction[:, 2], 0.0) ** 2, np.maximum(step.gap, 0.0) ** (2 / 3))
    for side in (touching, ~touching):
        mean = level[side & edge & np.isfinite(level)].mean() if (side & edge & np.isfinite(level)).any() else 0.0
        level[side] = np.clip(
            np.where(np.isfinite(level[side]) & (mean > 0), level[side] / (mean or 1.0), 1.0), *_BETWEEN
        )
    return np.where(touching, level, -level)


def _map(row: NodalField, result: Result, picture: Picture, title: str) -> "Figure":
    figure = sheet((5.6, 4.6))
    axes = figure.subplots()
    zone, step = result.zone, result.steps[-1]
    touching = step.touching
    of_contact = row.name == _PRESSURE
    axes.set(aspect="equal", xlabel=f"x [{picture.unit}]", ylabel=f"y [{picture.unit}]")
    head(axes, row.label, title)
    felt = _felt(step)
    if of_contact and not felt.any():
        _no_contact(axes, picture)
        return figure
    values = row.values(zone, step)
    factor, unit = prefixed(values, row.unit)
    drawn = picture.shade(axes, values / factor)
    figure.colorbar(drawn, ax=axes, label=f"{row.label} [{unit}]")
    if touching.any() and not touching.all():
        edge = picture.values(_edge(zone, step))
        rim = picture.beside(touching, ~touching)
        if of_contact and not (felt & ~touching).any():
            # between nodes the shading continues beyond the contact edge, where there is no pressure
            nothing = drawn.to_rgba(np.zeros(1))[0]
            axes.tricontourf(rim, edge, [-2 * _BETWEEN[1], 0], colors=[nothing])
        axes.tricontour(rim, edge, [0.0], colors="white")
    if of_contact:
        _zoom(axes, picture, felt)
    return figure


def _felt(step: StepResult) -> NDArray[np.bool_]:
    """Return the nodes (n,) in contact, and those whose attraction across the gap is visible in a figure."""
    size = np.abs(step.traction[:, 2])
    return np.asarray(step.touching | (size > _SEEN * size.max()))


def _zoom(axes: Any, picture: Picture, touching: NDArray[np.bool_]) -> None:
    x, y = picture.around(touching)
    axes.set(xlim=x, ylim=y)


def _no_contact(axes: Any, picture: Picture) -> None:
    (left, right), (below, above) = picture.around(np.ones(len(picture.points), bool))
    axes.set(xlim=(left, right), ylim=(below, above))
    axes.text((left + right) / 2, (below + above) / 2, "no contact", ha="center", va="center")


def _regions(result: Result, picture: Picture, title: str) -> "Figure":
    """Return the map of stick and slip."""
    step, totals = result.steps[-1], resultants(result.zone, result.steps[-1])
    figure = sheet((5.6, 4.9))
    axes = figure.subplots()
    axes.set(aspect="equal", xlabel=f"x [{picture.unit}]", ylabel=f"y [{picture.unit}]")
    head(axes, "stick and slip", title)
    if not step.touching.any():
        _no_contact(axes, picture)
        return figure
    edge, contact = _edge(result.zone, step), picture.beside(step.touching)
    sticking = np.where(step.region == Region.STICK, 1.0, -1.0) * np.abs(edge)
    shown = ((edge, "slip", totals.slip_area), (sticking, "stick", totals.stick_area))
    for (level, name, area), colour in zip(shown, LINE_COLOURS, strict=False):
        axes.fill([], [], color=colour, label=f"{name}, {area / picture.factor**2:.4g} {picture.unit}²")
        axes.tricontourf(contact, picture.values(level), [0.0, 2.0 * _BETWEEN[1]], colors=[colour])
    _zoom(axes, picture, step.touching)
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _sections(result: Result, picture: Picture, title: str) -> "Figure":
    """Return sections along x through the middle; with friction the tangential traction, too."""
    x = np.linspace(picture.points[:, 0].min(), picture.points[:, 0].max(), 401)
    on_axis = np.abs(picture.points[:, 1]) < 1e-6 * np.ptp(picture.points[:, 1])
    step = result.steps[-1]
    shown = [(row.label, row.unit, row.values(result.zone, step)) for row in _shown(result.zone, step)]
    if step.traction[:, :2].any():
        along = np.einsum("nk,nka,a->n", step.traction[:, :2], result.zone.frames[:, :2], picture.axes[0])
        shown.insert(1, ("traction along x", "Pa", along))
    figure = sheet((6.0, 2.4 * len(shown)))
    rows = figure.subplots(len(shown), sharex=True, squeeze=False)[:, 0]
    sections = picture.section(x, *(values for _, _, values in shown))
    for axes, (label, unit, values), section, colour in zip(rows, shown, sections, cycle(LINE_COLOURS), strict=False):
        factor, unit = prefixed(values, unit)
        axes.plot(x, section / factor, color=colour, linewidth=1.8)
        axes.plot(picture.points[on_axis, 0], values[on_axis] / factor, "o", color=colour, markersize=3.5)
        axes.set_ylabel(f"{label}\n[{unit}]")
        axes.grid(alpha=0.3)
    rows[-1].set_xlabel(f"x [{picture.unit}]")
    head(rows[0], "sections y = 0", title)
    figure.align_ylabels(rows)
    return figure
