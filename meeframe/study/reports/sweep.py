"""Figure and table of a sweep."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from meeframe.common.errors import CaseError
from meeframe.common.literal import LiteralTable
from meeframe.fields import ELECTRIC_FIELD, MEE, Array
from meeframe.results import schema
from meeframe.results.canvas import MAP_COLOURS, label_panels, limit_constant, line_style, prefixed_area, sheet, styled
from meeframe.results.sweep_records import SweepAxis, SweepResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PlotAxes = tuple[SweepAxis, SweepAxis | None]
"""Axis of abscissae, and axis of lines or ordinates if there is one."""
DEFAULT: Final = ("normal_force", "contact_area", "max_pressure")
"""Quantities shown by default, to which the potentials of scalar fields are added."""
_AT_BOUNDARY: Final = "contact_at_zone_boundary"
_LABEL_CHARACTERS: Final = 42
"""Characters of horizontal labels that fit below a picture."""
_LABEL_GAP: Final = 2
"""Blanks between two labels."""
_MAX_LABELS: Final = 20
"""Maximal number of labels along a picture, and maximal characters of each."""
_MAX_LEGEND_LINES: Final = 20
"""Maximal number of lines in a column of the legend next to a picture."""
_MAX_DEFAULT_ROWS: Final = 4
"""Maximal number of rows of pictures that are drawn by default, one for each value of the other axes."""
_MAX_TABLE_ROWS: Final = 40
"""Maximal number of rows of the table on the terminal."""


@dataclass(frozen=True)
class SweepPlot:
    """A row of pictures, one for each quantity.

    Attributes
    ----------
    quantities
        Names of the quantities; by default those of `default_quantities`.
    kind
        Curves, or a map over both axes.
    x
        Axis of abscissae; by default the first one with several numbers, or else with several values.
    lines
        Axis with a line for each value; by default another one with several values.
    scale
        Scale of x.
    at
        Labels of the values of the other axes, by default their first.
    """

    quantities: tuple[str, ...] = ()
    kind: Literal["curves", "map"] = "curves"
    x: str | None = None
    lines: str | None = None
    scale: Literal["linear", "log"] = "linear"
    at: Mapping[str, str] = field(default_factory=dict)

    def plot_axes(self, axes: Sequence[SweepAxis]) -> PlotAxes:
        """Return the axis of abscissae and the axis of lines of the plot.

        Parameters
        ----------
        axes
            Axes of the sweep.

        Raises
        ------
        CaseError
            If the plot cannot be drawn over these axes.
        """
        x, lines = self._chosen(axes)
        for axis in (x, lines) if lines is not None else (x,):
            if axis.name in self.at:
                raise CaseError(f"at.{axis.name}: the plot already uses this axis; allowed: other axes")
        if lines is x:
            raise CaseError(f"x and lines are both {x.name!r}; allowed: two axes")
        if self.kind == "map" and lines is None:
            raise CaseError("kind = 'map': needs two axes with several values each")
        if self.scale == "log" and (_coordinates(x)[1] or _coordinates(x)[0].min() <= 0):
            raise CaseError(f"scale = 'log': needs positive numbers; {x.name} has {', '.join(x.labels[:3])} ...")
        return x, lines

    def _chosen(self, axes: Sequence[SweepAxis]) -> PlotAxes:
        named = {axis.name: axis for axis in axes}
        free = [axis for axis in axes if axis.name not in (self.x, self.lines, *self.at)]
        several = [axis for axis in free if len(axis.labels) > 1]
        first = next((axis for axis in several if axis.values is not None), (several or free or [*axes])[0])
        x = named[self.x] if self.x else first
        others = (axis for axis in several if axis is not x)
        return x, named[self.lines] if self.lines else next(others, None)


def default_quantities(sweep: SweepResult) -> tuple[str, ...]:
    """Return the quantities that a sweep shows unless its study selects others."""
    shown = (scalar for scalar in sweep.field_set.scalars if scalar == ELECTRIC_FIELD or scalar not in MEE.scalars)
    potentials = (f"max_abs_{scalar.value_name}" for scalar in shown)
    return (*DEFAULT, *(name for name in potentials if np.nan_to_num(sweep.quantities.get(name, np.nan)).any()))


@styled
def sweep_figure(sweep: SweepResult, plots: Sequence[SweepPlot] = ()) -> "Figure":
    """Return the figure of a sweep with a row for each plot. Raises CaseError if one cannot be drawn over its axes."""
    plots = plots or _default_plots(sweep)
    rows = [plot if plot.quantities else replace(plot, quantities=default_quantities(sweep)) for plot in plots]
    columns = max(len(plot.quantities) for plot in rows)
    figure = sheet((4.0 * columns, 3.4 * len(rows) + 0.4))
    widest, panels = 0.0, list[Any]()
    for row, plot in zip(figure.subfigures(len(rows), 1, squeeze=False)[:, 0], rows, strict=True):
        line = row.subplots(1, columns, squeeze=False)[0]
        x, lines = plot.plot_axes(sweep.axes)
        for axes, quantity in zip(line, plot.quantities, strict=False):
            values, unit = _scaled(_section(sweep, plot, quantity, x, lines), sweep.units[quantity])
            draw = _map if plot.kind == "map" else _curves
            draw(axes, plot, (x, lines), values, f"{schema.label_of(quantity, sweep.field_set)} {unit}".rstrip())
            axes.set_xlabel(_heading(x))
        panels += list(line[: len(plot.quantities)])
        for axes in line[len(plot.quantities) :]:
            axes.remove()
        if plot.kind == "curves" and lines is not None:
            widest = max(widest, _legend(row, line[0], lines))
        if fixed := _fixed(sweep, plot, (x, lines)):
            row.suptitle(fixed, fontsize=10)
    label_panels(panels)
    figure.set_figwidth(figure.get_figwidth() + widest)
    figure.suptitle(sweep.title)
    return figure


def _default_plots(sweep: SweepResult) -> list[SweepPlot]:
    """Return one plot for each combination of values of the other axes, or one alone if these are too many."""
    plot_axes = SweepPlot().plot_axes(sweep.axes)
    others = [axis for axis in sweep.axes if axis not in plot_axes]
    if math.prod(len(axis.labels) for axis in others) > _MAX_DEFAULT_ROWS:
        return [SweepPlot()]
    names = [axis.name for axis in others]
    combinations = product(*(axis.labels for axis in others))
    return [SweepPlot(at=dict(zip(names, labels, strict=True))) for labels in combinations]


def _section(sweep: SweepResult, plot: SweepPlot, quantity: str, x: SweepAxis, lines: SweepAxis | None) -> Array:
    """Return the quantity over x and lines, (m,) or (m, k), at the values of the plot on all other axes."""
    values = sweep.last(quantity)
    for index in reversed(range(len(sweep.axes))):
        axis = sweep.axes[index]
        if axis is not x and axis is not lines:
            values = np.asarray(values.take(_at(plot, axis), axis=index))
    if lines is not None and sweep.axes.index(lines) < sweep.axes.index(x):
        values = values.T
    return values


def _at(plot: SweepPlot, axis: SweepAxis) -> int:
    return axis.labels.index(plot.at[axis.name]) if axis.name in plot.at else 0


def _fixed(sweep: SweepResult, plot: SweepPlot, plot_axes: Sequence[SweepAxis | None]) -> str:
    """Return the values of all other axes in words."""
    others = (axis for axis in sweep.axes if axis not in plot_axes and len(axis.labels) > 1)
    return ", ".join(f"{axis.name} = {axis.labels[_at(plot, axis)]}" for axis in others)


def _scaled(values: Array, unit: str) -> tuple[Array, str]:
    """Return values as displayed and their unit as a label, with a prefix; the largest area is 0.01 to 10^4 units."""
    finite = values[np.isfinite(values)]
    symbol = unit.replace("^2", "²")
    if symbol.removesuffix("²").isalpha() and finite.size:
        factor, unit = prefixed_area(finite, symbol)
        values = values / factor
    return values, "" if unit == "1" else f"[{unit}]"


def _curves(axes: Any, plot: SweepPlot, over: PlotAxes, values: Array, label: str) -> None:
    x, lines = over
    coordinates, labelled = _coordinates(x)
    columns = values[:, None] if lines is None else values
    for number, column in enumerate(columns.T):
        style = line_style(number, columns.shape[1])
        order = np.argsort(coordinates)
        axes.plot(coordinates[order], column[order], label=lines.labels[number] if lines else None, **style)
    _ticks(axes.xaxis, x) if labelled else axes.set(xscale=plot.scale)
    axes.set_ylabel(label)
    axes.ticklabel_format(axis="y", useOffset=False)
    limit_constant(axes.set_ylim, columns)
    axes.grid(visible=True)


def _legend(row: Any, axes: Any, lines: SweepAxis) -> float:
    """Draw the legend of the lines next to the pictures of a row; return its width in inches."""
    legend = row.legend(
        *axes.get_legend_handles_labels(),
        title=lines.name,
        fontsize=7,
        title_fontsize=7,
        loc="outside right upper",
        ncols=math.ceil(len(lines.labels) / _MAX_LEGEND_LINES),
    )
    return float(legend.get_window_extent().width / row.dpi)


def _map(axes: Any, plot: SweepPlot, over: PlotAxes, values: Array, label: str) -> None:
    x, y = over
    assert y is not None
    (horizontal, _), (vertical, _) = _coordinates(x), _coordinates(y)
    columns, rows = np.argsort(horizontal), np.argsort(vertical)
    shown_values = values[np.ix_(columns, rows)].T
    image = axes.pcolormesh(horizontal[columns], vertical[rows], shown_values, cmap=MAP_COLOURS, shading="nearest")
    for axis, ticks in ((x, axes.xaxis), (y, axes.yaxis)):
        if _coordinates(axis)[1]:
            _ticks(ticks, axis)
    if not _coordinates(x)[1]:
        axes.set(xscale=plot.scale)
    axes.set_ylabel(_heading(y))
    axes.figure.colorbar(image, ax=axes, label=label)


def _coordinates(axis: SweepAxis) -> tuple[Array, bool]:
    """Return the coordinates of the values of an axis in figures, and whether they need labels."""
    if axis.values is None or not np.isfinite(axis.values).all():
        return np.arange(1.0, len(axis.labels) + 1.0), True
    return _scaled(axis.values, axis.unit)[0], False


def _ticks(ticks: Any, axis: SweepAxis) -> None:
    """Draw labels horizontally if they fit, otherwise vertically, and numbers if they are too many or too long."""
    if _numbered(axis):
        ticks.get_major_locator().set_params(integer=True)
        return
    crowded = ticks.axis_name == "x" and sum(len(label) + _LABEL_GAP for label in axis.labels) > _LABEL_CHARACTERS
    ticks.set_ticks(_coordinates(axis)[0], axis.labels, rotation="vertical" if crowded else "horizontal")


def _numbered(axis: SweepAxis) -> bool:
    """Return whether labels are too many or too long to be written along a picture."""
    return max(len(axis.labels), *map(len, axis.labels)) > _MAX_LABELS


def _heading(axis: SweepAxis) -> str:
    if axis.values is None or _coordinates(axis)[1]:
        return f"{axis.name}, numbered in order" if _numbered(axis) else axis.name
    return f"{axis.name} {_scaled(axis.values, axis.unit)[1]}".rstrip() if axis.unit else axis.name


def sweep_table(sweep: SweepResult) -> RenderableType:
    """Return the status and plotted values of the first points, and the messages of points that did not converge."""
    names = sweep.plotted or default_quantities(sweep)
    table = LiteralTable(sweep.title)
    for axis in sweep.axes:
        table.add_column(axis.name)
    table.add_column("status")
    for name in names:
        unit = sweep.units[name]
        label = schema.label_of(name, sweep.field_set)
        table.add_column(f"{label} [{unit}]" if unit != "1" else label, justify="right")
    numbers_by_name = {name: sweep.last(name) for name in names}
    for index in list(np.ndindex(sweep.shape))[:_MAX_TABLE_ROWS]:
        numbers = (f"{numbers_by_name[name][index]:.6g}" for name in names)
        table.add_row(*_labels(sweep, index), _status(sweep, index), *(n if n != "nan" else "-" for n in numbers))
    rest = math.prod(sweep.shape) - _MAX_TABLE_ROWS
    more = [Text(f"and {rest} more")] if rest > 0 else []
    return Group(table, *more, *(Text(line) for line in failures(sweep)))


def _status(sweep: SweepResult, index: tuple[int, ...]) -> str:
    """Return the status of a point, and whether the contact extends to the boundary of its zone in any increment."""
    at_edge = np.any(sweep.quantities[_AT_BOUNDARY][index] > 0.0) if _AT_BOUNDARY in sweep.quantities else False
    return f"{sweep.status[index]}{', at the zone boundary' * bool(at_edge)}"


def failures(sweep: SweepResult) -> Iterator[str]:
    """Yield a line for each point that did not converge, with its status and message."""
    for index in np.ndindex(sweep.shape):
        if sweep.status[index] != "converged":
            yield f"{', '.join(_labels(sweep, index))}: {sweep.status[index]}: {sweep.message[index]}"


def _labels(sweep: SweepResult, index: tuple[int, ...]) -> list[str]:
    return [axis.labels[number] for axis, number in zip(sweep.axes, index, strict=True)]
