"""Pictures and table of a sweep."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from meeframe.common.errors import CaseError
from meeframe.common.literal import LiteralTable
from meeframe.fields import Array
from meeframe.results import schema
from meeframe.results.canvas import MAP_COLOURS, prefixed, sheet
from meeframe.results.sweep_records import SweepAxis, SweepResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#7F7F7F")
DEFAULT: Final = ("normal_force", "contact_area", "max_pressure", "max_abs_electric_potential")
"""What is shown if the study does not say."""
_MARKERS: Final = "osD^vPX*"
_EDGE: Final = "reaches_edge"
_LETTERS: Final = 42
"""Of labels beside each other below a picture, ..."""
_BETWEEN: Final = 2
"""... each with so many blanks."""
_WRITTEN: Final = 20
"""Labels along a picture, and letters of each, at most."""
_NAMED: Final = 20
"""Lines under each other in a legend, as many as fit beside a picture."""
_LISTED: Final = 40
"""Rows of the table on the terminal, at most."""


@dataclass(frozen=True)
class SweepPlot:
    """A row of pictures, one for each quantity.

    x: name of the axis along which, None: the first that has several numbers, or else several values; lines: of the
    axis with a line for each value, None: another one that has several; kind: curves, or a map over both axes; scale:
    of x; at: labels of the values at which the other axes stand, by default their first.
    """

    quantities: tuple[str, ...] = DEFAULT
    kind: Literal["curves", "map"] = "curves"
    x: str | None = None
    lines: str | None = None
    scale: Literal["linear", "log"] = "linear"
    at: Mapping[str, str] = field(default_factory=dict)

    def shown(self, axes: Sequence[SweepAxis]) -> tuple[SweepAxis, SweepAxis | None]:
        """Return the axis along which, and that of the lines, which each plot finds among those of its sweep.

        Raises CaseError if it cannot be drawn over these.
        """
        x, lines = self._chosen(axes)
        for axis in (x, lines) if lines is not None else (x,):
            if axis.name in self.at:
                raise CaseError(f"at.{axis.name}: the plot goes along this axis; allowed: other axes")
        if lines is x:
            raise CaseError(f"x and lines are both {x.name!r}; allowed: two axes")
        if self.kind == "map" and lines is None:
            raise CaseError("kind = 'map': allowed over two axes with several values each")
        if self.scale == "log" and (_places(x)[1] or _places(x)[0].min() <= 0):
            raise CaseError(f"scale = 'log': allowed over positive numbers; {x.name} has {', '.join(x.labels[:3])} ...")
        return x, lines

    def _chosen(self, axes: Sequence[SweepAxis]) -> tuple[SweepAxis, SweepAxis | None]:
        named = {axis.name: axis for axis in axes}
        free = [axis for axis in axes if axis.name not in (self.x, self.lines, *self.at)]
        several = [axis for axis in free if len(axis.labels) > 1]
        first = next((axis for axis in several if axis.values is not None), (several or free or [*axes])[0])
        x = named[self.x] if self.x else first
        others = (axis for axis in several if axis is not x)
        return x, named[self.lines] if self.lines else next(others, None)


def sweep_figure(sweep: SweepResult, plots: Sequence[SweepPlot] = ()) -> "Figure":
    """Return the figure of a sweep: a row for each plot. Raises CaseError if one cannot be drawn over its axes."""
    rows = plots or (SweepPlot(),)
    columns = max(len(plot.quantities) for plot in rows)
    figure = sheet((4.0 * columns, 3.4 * len(rows) + 0.4))
    widest = 0.0
    for row, plot in zip(figure.subfigures(len(rows), 1, squeeze=False)[:, 0], rows, strict=True):
        line = row.subplots(1, columns, squeeze=False)[0]
        x, lines = plot.shown(sweep.axes)
        for axes, quantity in zip(line, plot.quantities, strict=False):
            values, unit = _scaled(_section(sweep, plot, quantity, x, lines), sweep.units[quantity])
            draw = _map if plot.kind == "map" else _curves
            draw(axes, plot, (x, lines), values, f"{schema.label_of(quantity)} {unit}".rstrip())
            axes.set_xlabel(_heading(x))
        for axes in line[len(plot.quantities) :]:
            axes.remove()
        if plot.kind == "curves" and lines is not None:
            widest = max(widest, _legend(row, line[0], lines))
        line[0].set_title(_fixed(sweep, plot, (x, lines)), fontsize=10)
    figure.set_figwidth(figure.get_figwidth() + widest)
    figure.suptitle(sweep.title)
    return figure


def _section(sweep: SweepResult, plot: SweepPlot, quantity: str, x: SweepAxis, lines: SweepAxis | None) -> Array:
    """Return the quantity over x and lines, (m,) or (m, k), the other axes where the plot has them."""
    values = sweep.last(quantity)
    for place in reversed(range(len(sweep.axes))):
        axis = sweep.axes[place]
        if axis is not x and axis is not lines:
            values = np.asarray(values.take(_at(plot, axis), axis=place))
    if lines is not None and sweep.axes.index(lines) < sweep.axes.index(x):
        values = values.T
    return values


def _at(plot: SweepPlot, axis: SweepAxis) -> int:
    return axis.labels.index(plot.at[axis.name]) if axis.name in plot.at else 0


def _fixed(sweep: SweepResult, plot: SweepPlot, shown: Sequence[SweepAxis | None]) -> str:
    """Return where the other axes stand, in words."""
    others = (axis for axis in sweep.axes if axis not in shown and len(axis.labels) > 1)
    return ", ".join(f"{axis.name} = {axis.labels[_at(plot, axis)]}" for axis in others)


def _scaled(values: Array, unit: str) -> tuple[Array, str]:
    """Return values as displayed and their unit as a label, with a prefix; the largest area is 0.01 to 10^4 of it."""
    finite = values[np.isfinite(values)]
    symbol, power = (unit.removesuffix("^2"), 2) if unit.endswith("^2") else (unit, 1)
    if symbol.isalpha() and finite.size:
        factor, symbol = prefixed(finite if power == 1 else 10.0 * np.sqrt(np.abs(finite)), symbol)
        values = values / factor**power
        unit = f"{symbol}²" if power == 2 else symbol
    return values, "" if unit == "1" else f"[{unit}]"


def _curves(axes: Any, plot: SweepPlot, shown: tuple[SweepAxis, SweepAxis | None], values: Array, label: str) -> None:
    x, lines = shown
    places, labelled = _places(x)
    columns = values[:, None] if lines is None else values
    for number, column in enumerate(columns.T):
        style = {
            "marker": _MARKERS[number % len(_MARKERS)],
            "ms": 3.5,
            "lw": 1.2,
            "color": _COLOURS[number % len(_COLOURS)],
        }
        order = np.argsort(places)
        axes.plot(places[order], column[order], label=lines.labels[number] if lines else None, **style)
    _ticks(axes.xaxis, x) if labelled else axes.set(xscale=plot.scale)
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)


def _legend(row: Any, axes: Any, lines: SweepAxis) -> float:
    """Return the name the lines beside the pictures of a row, where they cover none; the width of that in inches."""
    legend = row.legend(
        *axes.get_legend_handles_labels(),
        title=lines.name,
        fontsize=7,
        title_fontsize=7,
        loc="outside right upper",
        ncols=math.ceil(len(lines.labels) / _NAMED),
    )
    return float(legend.get_window_extent().width / row.dpi)


def _map(axes: Any, plot: SweepPlot, shown: tuple[SweepAxis, SweepAxis | None], values: Array, label: str) -> None:
    x, y = shown
    assert y is not None
    (across, _), (along, _) = _places(x), _places(y)
    columns, rows = np.argsort(across), np.argsort(along)
    shown_values = values[np.ix_(columns, rows)].T
    drawn = axes.pcolormesh(across[columns], along[rows], shown_values, cmap=MAP_COLOURS, shading="nearest")
    for axis, own in ((x, axes.xaxis), (y, axes.yaxis)):
        if _places(axis)[1]:
            _ticks(own, axis)
    if not _places(x)[1]:
        axes.set(xscale=plot.scale)
    axes.set_ylabel(_heading(y))
    axes.figure.colorbar(drawn, ax=axes, label=label)


def _places(axis: SweepAxis) -> tuple[Array, bool]:
    """Return where the values of an axis are drawn, and whether their labels have to say what they are."""
    if axis.values is None or not np.isfinite(axis.values).all():
        return np.arange(1.0, len(axis.labels) + 1.0), True
    return _scaled(axis.values, axis.unit)[0], False


def _ticks(own: Any, axis: SweepAxis) -> None:
    """Place labels beside each other where they fit, otherwise upright, otherwise numbers."""
    if _numbered(axis):
        own.get_major_locator().set_params(integer=True)
        return
    across = own.axis_name == "x" and sum(len(label) + _BETWEEN for label in axis.labels) > _LETTERS
    own.set_ticks(_places(axis)[0], axis.labels, rotation="vertical" if across else "horizontal")


def _numbered(axis: SweepAxis) -> bool:
    """Return whether there are too many labels, or too long ones, to be written along a picture."""
    return max(len(axis.labels), *map(len, axis.labels)) > _WRITTEN


def _heading(axis: SweepAxis) -> str:
    if axis.values is None or _places(axis)[1]:
        return f"{axis.name}, numbered in order" if _numbered(axis) else axis.name
    return f"{axis.name} {_scaled(axis.values, axis.unit)[1]}".rstrip() if axis.unit else axis.name


def sweep_table(sweep: SweepResult) -> RenderableType:
    """Return status and plotted values of every point, of many the first; and the messages of those not converged."""
    names = sweep.plotted or DEFAULT
    table = LiteralTable(sweep.title)
    for axis in sweep.axes:
        table.add_column(axis.name)
    table.add_column("status")
    for name in names:
        unit = sweep.units[name]
        table.add_column(f"{schema.label_of(name)} [{unit}]" if unit != "1" else schema.label_of(name), justify="right")
    shown = {name: sweep.last(name) for name in names}
    for place in list(np.ndindex(sweep.shape))[:_LISTED]:
        numbers = (f"{shown[name][place]:.6g}" for name in names)
        table.add_row(*_labels(sweep, place), _standing(sweep, place), *(n if n != "nan" else "-" for n in numbers))
    rest = math.prod(sweep.shape) - _LISTED
    more = [Text(f"and {rest} more")] if rest > 0 else []
    return Group(table, *more, *(Text(line) for line in failures(sweep)))


def _standing(sweep: SweepResult, place: tuple[int, ...]) -> str:
    """Return the status of a point, and whether the contact reached the border of its zone in any increment."""
    at_edge = np.any(sweep.quantities[_EDGE][place] > 0.0) if _EDGE in sweep.quantities else False
    return f"{sweep.status[place]}{', at the edge' * bool(at_edge)}"


def failures(sweep: SweepResult) -> Iterator[str]:
    """Return the points that did not converge, each with its status and message."""
    for place in np.ndindex(sweep.shape):
        if sweep.status[place] != "converged":
            yield f"{', '.join(_labels(sweep, place))}: {sweep.status[place]}: {sweep.message[place]}"


def _labels(sweep: SweepResult, place: tuple[int, ...]) -> list[str]:
    return [axis.labels[number] for axis, number in zip(sweep.axes, place, strict=True)]
