"""Figures of an increment: maps, sections through the centre, stick and slip, convergence; and the history."""

import gc
import warnings
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import ResultError
from meeframe.common.memory import MIN_RELEASED_NODES
from meeframe.fields import Array
from meeframe.mesh.regular import nodes_of_mixed_cells
from meeframe.plugin.validation import choices
from meeframe.results import schema
from meeframe.results.canvas import (
    LINE_COLOURS,
    add_legend,
    head,
    house_style,
    label_panels,
    map_ticks,
    prefixed,
    prefixed_area,
    sheet,
    styled,
)
from meeframe.results.history import history
from meeframe.results.output import FORMATS, in_all_formats, make_folder, remove_files, replacing
from meeframe.results.overview import peaks
from meeframe.results.picture import Picture
from meeframe.results.records import Region, Result, StepResult, Zone
from meeframe.results.resultants import resultants
from meeframe.results.schema import NodalField
from meeframe.results.selection import Which, name_of, select

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PRESSURE: Final = "pressure"
TANGENTIAL: Final = "tangential traction"
_WEIGHT_BOUNDS: Final = (0.1, 2.0)
"""Bounds of the weights that locate the contact edge between two nodes."""
_MIN_SHOWN_ATTRACTION: Final = 0.01
"""Least attraction that is shown, as a fraction of the largest traction; it decays with the distance without end."""
_ROUND_OFF: Final = 1e-9
"""Fraction of the largest value over all increments below which a field is drawn as zero."""
_MAP_SIZE: Final = (5.6, 4.6)
_LEGEND_STRIP: Final = 0.25
"""Height of the strip above a map that holds its legend, as a fraction of the height of the map."""


@styled
def figures(result: Result, which: Which = None) -> "dict[str, Figure]":
    """Return the figures of an increment.

    A potential that is zero throughout has no figure, and stick and slip has none without friction. With several
    converged increments, their history is included.

    Parameters
    ----------
    result : Result
        The result.
    which : int, tuple of int, str or StepResult, optional
        Increment, see `select`; that of the peak load by default.

    Returns
    -------
    dict of str to matplotlib.figure.Figure
        Figures by name; none if no increment is finished, if not all in it is finite, or if the zone has neither cells
        nor nodes that span an area.

    Raises
    ------
    ResultError
        If there is no such increment.
    """
    if not result.steps:
        return {}
    step = select(result, which)
    if not np.isfinite(step.traction).all() or not np.isfinite(step.potentials).all():
        return {}
    if not result.zone.cells and np.linalg.matrix_rank(result.zone.points - result.zone.points[0]) < 2:
        return {}
    title = title_of(result, step)
    drawn: dict[str, Figure] = {}
    for field in shown_fields(result, step):
        drawn[field.name] = sheet(_MAP_SIZE)
        draw_map(drawn[field.name].subplots(), result, field.name, step, title)
    drawn["sections"] = _sections(result, step, title)
    if schema.FRICTION in peaks(result).phenomena:
        drawn["stick_slip"] = sheet((_MAP_SIZE[0], _MAP_SIZE[1] + 0.3))
        draw_stick_slip(drawn["stick_slip"].subplots(), result, step, title)
    past = history(result)
    return drawn if past is None else drawn | {"history": past}


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure; dollars in its texts are literal, characters that the font lacks are boxes.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure.
    path : Path
        The file, whose suffix is the format.
    """
    from matplotlib.text import Text

    figure.set_dpi(150)
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        if "$" in text.get_text():  # numbers along axes are typeset when they are drawn
            text.set_parse_math(False)
    with warnings.catch_warnings(), house_style():
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        if path.suffix == ".png":
            # the same picture as by savefig, which draws twice, once for the layout alone; light compression: files a
            # third larger, written in two thirds of the time
            figure.canvas.print_png(path, pil_kwargs={"compress_level": 1})  # type: ignore[attr-defined]  # of Agg
        else:
            figure.savefig(path)


def check_format(suffix: str) -> None:
    """Check that figures can be written in a format.

    Parameters
    ----------
    suffix : str
        The format, such as "png".

    Raises
    ------
    ResultError
        If it is not one of FORMATS.
    """
    if suffix not in FORMATS:
        raise ResultError(f"format {suffix!r}: allowed: {', '.join(FORMATS)}")


def write_figure(figure: "Figure | None", folder: Path, name: str, suffix: str) -> None:
    """Write the figure of a folder if there is one, in place of an earlier one in any format.

    Parameters
    ----------
    figure : matplotlib.figure.Figure or None
        The figure.
    folder : Path
        The folder.
    name : str
        Name of the file without its suffix.
    suffix : str
        The format, such as "png".

    Raises
    ------
    ResultError
        If it cannot be written.
    """
    remove_files(folder, in_all_formats(name))
    if figure is not None:
        with replacing(folder / f"{name}.{suffix}") as path:
            save_figure(figure, path)


def write_figures(result: Result, folder: Path, which: Which = None, suffix: str = "png") -> list[Path]:
    """Write the figures of an increment into a folder.

    Parameters
    ----------
    result : Result
        The result.
    folder : Path
        The folder, created if it does not exist.
    which : int, tuple of int, str or StepResult, optional
        Increment, see `select`; that of the peak load by default.
    suffix : str, optional
        The format.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    ResultError
        If the format is unknown, there is no such increment, or the files cannot be written.
    """
    check_format(suffix)
    drawn = figures(result, select(result, which))
    make_folder(folder, parents=True)
    paths = [folder / f"{name}.{suffix}" for name in drawn]
    for name, target in zip(list(drawn), paths, strict=True):
        with replacing(target) as path:
            save_figure(drawn.pop(name), path)
    if len(result.zone.points) >= MIN_RELEASED_NODES:
        gc.collect()  # images of all nodes, to which axes and artists refer in cycles
    return paths


def shown_fields(result: Result, step: StepResult) -> list[NodalField]:
    """Return the pressure, and the other fields with maps that are not zero throughout.

    Parameters
    ----------
    result : Result
        The result.
    step : StepResult
        One of its increments.

    Returns
    -------
    list of NodalField
        The fields.
    """
    fields = schema.nodal(schema.View.MAP, step.fields).values()
    return [field for field in fields if field.name == PRESSURE or nodal_values(result, field, step).any()]


def nodal_values(result: Result, field: NodalField, step: StepResult) -> Array:
    """Return the values of a nodal field without round-off.

    Parameters
    ----------
    result : Result
        The result.
    field : NodalField
        The field.
    step : StepResult
        One of its increments.

    Returns
    -------
    Array
        Values, (n,) or (n, k), SI units; zero where they are negligible beside the largest of all increments.
    """
    values = field.values(result.zone, step)
    return np.where(np.abs(values) > _ROUND_OFF * peaks(result).values[field.name], values, 0.0)


def title_of(result: Result, step: StepResult) -> str:
    """Return the title of a figure: that of the case, and the increment where there are several.

    Parameters
    ----------
    result : Result
        The result.
    step : StepResult
        One of its increments.

    Returns
    -------
    str
        The title.
    """
    factor, unit = prefixed(np.array([step.loading.approach]), "m")
    words = f"{name_of(result, step)}, approach {step.loading.approach / factor:.4g} {unit}"
    return "\n".join(filter(None, [result.provenance.title, words if result.planned_steps > 1 else ""]))


def contact_edge(zone: Zone, touching: NDArray[np.bool_], pressure: Array, gap: Array) -> Array:
    """Return a level that is positive in contact, negative elsewhere and zero at the contact edge.

    Parameters
    ----------
    zone : Zone
        Contact zone of n nodes.
    touching : ndarray of bool
        Nodes in contact, (n,).
    pressure : Array
        Pressure, (n,) [Pa].
    gap : Array
        Gap, (n,) [m], inf where it is not known.

    Returns
    -------
    Array
        Dimensionless level, (n,).

    Notes
    -----
    Along a smooth contact edge p^2 grows linearly inwards, and gap^(2/3) outwards. Each is divided by its mean at the
    nodes next to the contact edge: on average the line lies half way between two nodes, but close to a node that hardly
    touches.
    """
    adjacent = nodes_of_mixed_cells(zone.cells, touching)
    level = np.where(touching, np.maximum(pressure, 0.0) ** 2, np.maximum(gap, 0.0) ** (2 / 3))
    for side in (touching, ~touching):
        known = side & adjacent & np.isfinite(level)
        mean = level[known].mean() if known.any() else 0.0
        level[side] = np.clip(
            np.where(np.isfinite(level[side]) & (mean > 0), level[side] / (mean or 1.0), 1.0), *_WEIGHT_BOUNDS
        )
    return np.where(touching, level, -level)


def _contact_edge(zone: Zone, step: StepResult) -> Array:
    """Return the level of `contact_edge` of an increment."""
    return contact_edge(zone, step.touching, -step.traction[:, 2], step.gap)


@styled
def draw_map(axes: Any, result: Result, name: str, which: Which = None, title: str = "") -> None:
    """Draw the map of a nodal field, with a bar of colours; the pressure in contact alone, other fields everywhere.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Axes to draw on.
    result : Result
        The result.
    name : str
        Name of a scalar field of meeframe.results.schema.
    which : int, tuple of int, str or StepResult, optional
        Increment, see `select`; that of the peak load by default.
    title : str, optional
        Heading of the map.

    Raises
    ------
    ResultError
        If there is no such field or increment.
    """
    step = select(result, which)
    field, zone = _field(name, step), result.zone
    picture = Picture.of(zone)
    _prepare(axes, picture, field.label, title)
    of_contact = name == PRESSURE
    felt = _felt(step) if of_contact else np.ones(len(zone.points), bool)
    if not felt.any():
        _no_contact(axes, picture)
        return
    values = nodal_values(result, field, step)
    factor, unit = prefixed(values[felt], field.unit)
    if of_contact:
        # open nodes next to the contact take the pressure of their neighbours: no colour fades before the contact edge
        values = picture.extended(values, felt)
    limits = {"vmin": min(values[felt].min() / factor, 0.0)} if of_contact else {}
    drawn = picture.shade(axes, values / factor, felt, vmax=values[felt].max() / factor or 1.0, **limits)
    axes.figure.colorbar(drawn, ax=axes, label=f"{field.label} [{unit}]")
    if step.touching.any() and not step.touching.all():
        level = _contact_edge(zone, step)
        if of_contact and not (felt & ~step.touching).any():
            picture.clip(axes, drawn, level)
        picture.outline(axes, level, "#D55E00" if of_contact else "white")
    if of_contact:
        _zoom(axes, picture, felt)


def _field(name: str, step: StepResult) -> NodalField:
    fields = {
        field.name: field for field in schema.nodal_fields(step.fields) if not field.components and not field.integer
    }
    if name not in fields:
        raise ResultError(f"unknown field {name!r}; {choices(name, tuple(fields))}")
    return fields[name]


def _prepare(axes: Any, picture: Picture, what: str, title: str) -> None:
    axes.set(aspect="equal", xlabel=f"x [{picture.unit}]", ylabel=f"y [{picture.unit}]")
    axes.locator_params(nbins=map_ticks(axes))
    for side in ("top", "right"):
        axes.spines[side].set_visible(True)
    head(axes, what, title)


def _felt(step: StepResult) -> NDArray[np.bool_]:
    """Return the nodes (n,) in contact, and those whose attraction across the gap is visible in a figure."""
    size = np.abs(step.traction[:, 2])
    return np.asarray(step.touching | (size > _MIN_SHOWN_ATTRACTION * size.max()))


def _zoom(axes: Any, picture: Picture, touching: NDArray[np.bool_]) -> None:
    x, y = picture.around(touching)
    axes.set(xlim=x, ylim=y)


def _no_contact(axes: Any, picture: Picture) -> None:
    (left, right), (below, above) = picture.around(np.ones(len(picture.points), bool))
    axes.set(xlim=(left, right), ylim=(below, above))
    axes.text((left + right) / 2, (below + above) / 2, "no contact", ha="center", va="center")


@styled
def draw_stick_slip(axes: Any, result: Result, which: Which = None, title: str = "") -> None:
    """Draw the map of stick and slip, with the areas in a legend.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Axes to draw on.
    result : Result
        The result.
    which : int, tuple of int, str or StepResult, optional
        Increment, see `select`; that of the peak load by default.
    title : str, optional
        Heading of the map.

    Raises
    ------
    ResultError
        If there is no such increment.
    """
    step = select(result, which)
    totals, picture = resultants(result.zone, step), Picture.of(result.zone)
    _prepare(axes, picture, "stick and slip", title)
    if not step.touching.any():
        _no_contact(axes, picture)
        return
    slip = _contact_edge(result.zone, step)
    # open nodes take the mean of their neighbours, so that sticking regions end at the contact edge or half way to slip
    sign = picture.extended(np.where(step.region == Region.STICK, 1.0, -1.0), step.touching)
    shown = ((slip, "slip", totals.slip_area), (sign, "stick", totals.stick_area))
    factor, unit = prefixed_area(np.array([totals.slip_area, totals.stick_area]), "m²")
    for (level, name, area), colour in zip(shown, LINE_COLOURS, strict=False):
        label = f"{name}, {area / factor:.4g} {unit}"
        axes.fill([], [], color=colour, linewidth=0, linestyle="solid", label=label)  # dashes without width are errors
        drawn = picture.fill(axes, level, colour)
        if not step.touching.all():
            picture.clip(axes, drawn, slip)
    _zoom(axes, picture, step.touching)
    below, above = axes.get_ylim()
    axes.set_ylim(below, above + _LEGEND_STRIP * (above - below))
    add_legend(axes, loc="upper left")


@styled
def draw_section(axes: Any, result: Result, name: str = PRESSURE, which: Which = None, colour: str = "") -> None:
    """Draw a nodal field along x through the middle of the zone; dots are nodes.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Axes to draw on.
    result : Result
        The result.
    name : str, optional
        Name of a scalar field of meeframe.results.schema, or 'tangential traction' for the one along x of the picture.
    which : int, tuple of int, str or StepResult, optional
        Increment, see `select`; that of the peak load by default.
    colour : str, optional
        Colour of the line.

    Raises
    ------
    ResultError
        If there is no such field or increment.
    """
    step, picture = select(result, which), Picture.of(result.zone)
    if name == TANGENTIAL:
        label, unit, values = "traction along x", "Pa", _tangential(result, step, picture)
    else:
        field = _field(name, step)
        label, unit, values = field.label, field.unit, nodal_values(result, field, step)
    x = np.linspace(picture.points[:, 0].min(), picture.points[:, 0].max(), 401)
    on_axis = np.abs(picture.points[:, 1]) < 1e-6 * np.ptp(picture.points[:, 1])
    factor, unit = prefixed(values, unit)
    colour = colour or LINE_COLOURS[0]
    axes.plot(x, picture.section(x, values)[0] / factor, color=colour)
    axes.plot(picture.points[on_axis, 0], values[on_axis] / factor, "o", color=colour)
    axes.set(xlabel=f"x [{picture.unit}]", ylabel=f"{label}\n[{unit}]")
    axes.grid(visible=True)


def _tangential(result: Result, step: StepResult, picture: Picture) -> Array:
    traction: Array = np.einsum("nk,nka,a->n", step.traction[:, :2], result.zone.frames[:, :2], picture.axes[0])
    return traction


def _sections(result: Result, step: StepResult, title: str) -> "Figure":
    """Return sections along x through the middle; with friction the tangential traction, too."""
    names = [field.name for field in shown_fields(result, step)]
    if step.traction[:, :2].any():
        names.insert(1, TANGENTIAL)
    figure = sheet((6.0, 2.4 * len(names)))
    rows = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
    for axes, name, colour in zip(rows, names, cycle(LINE_COLOURS), strict=False):
        draw_section(axes, result, name, step, colour)
        axes.set_xlabel("")
    rows[-1].set_xlabel(f"x [{Picture.of(result.zone).unit}]")
    head(rows[0], "sections y = 0", title)
    label_panels(rows)
    figure.align_ylabels(rows)
    return figure


@styled
def draw_convergence(axes: Any, result: Result, which: Which = None) -> None:
    """Draw the monitored quantity of the solver over its iterations, on a logarithmic axis.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Axes to draw on.
    result : Result
        The result.
    which : int, tuple of int, str or StepResult, optional
        Increment, see `select`; that of the peak load by default.

    Raises
    ------
    ResultError
        If there is no such increment.
    """
    step = select(result, which)
    axes.semilogy(*step.history.T, "o-", label=f"{name_of(result, step)}:\n{step.status}")
    axes.set(xlabel="iteration", ylabel="residual")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.grid(visible=True)
    add_legend(axes)
