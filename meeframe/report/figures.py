"""Figures of the last finished step: maps over the contact zone and sections through its centre."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from meeframe.core.fields import Array
from meeframe.core.result import Result, StepResult
from meeframe.report.picture import Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PREFIXES: Final = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_MAP_COLOURS: Final = "cividis"  # perceptually uniform, the same to colour-blind readers
_LINE_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73")  # of the Okabe-Ito palette


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
    """Figures of the last finished step by file name; none if there is no step or nothing in it is finite."""
    if not result.steps:
        return {}
    step = result.steps[-1]
    if not all(np.isfinite(quantity.values(step)).all() for quantity in _QUANTITIES):
        return {}
    picture = Picture.of(result.zone)
    title = _title(result)
    drawn = {f"{q.file}.png": _map(q, step, picture, title) for q in _QUANTITIES}
    return drawn | {"sections.png": _sections(step, picture, title)}


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure as PNG."""
    figure.savefig(path, dpi=150, format="png")


def _title(result: Result) -> str:
    """Title of the case, and the step where there are several."""
    number = len(result.steps)
    step = f"step {number} of {result.planned_steps}, approach {result.steps[-1].loading.approach * 1e6:.6g} µm"
    parts = [result.provenance.title, step if result.planned_steps > 1 else ""]
    return ", ".join(filter(None, parts))


def _map(quantity: _Quantity, step: StepResult, picture: Picture, title: str) -> "Figure":
    values = quantity.values(step)
    factor, unit = _prefixed(values, quantity.unit)
    figure = _figure((5.6, 4.6))
    axes = figure.subplots()
    shown = picture.values(values / factor)
    drawn = axes.tripcolor(picture.triangulation, shown, shading="gouraud", cmap=_MAP_COLOURS)
    figure.colorbar(drawn, ax=axes, label=f"{quantity.label} [{unit}]")
    touching = step.traction[:, 2] < 0.0
    if touching.any() and not touching.all():  # the edge of the contact, half way between nodes
        axes.tricontour(picture.triangulation, picture.values(touching.astype(float)), [0.5], colors="white")
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    _head(axes, quantity.label, title)
    return figure


def _sections(step: StepResult, picture: Picture, title: str) -> "Figure":
    from matplotlib.tri import LinearTriInterpolator

    flat = picture.triangulation
    x = np.linspace(flat.x.min(), flat.x.max(), 401)
    on_axis = np.abs(picture.points[:, 1]) < 1e-6 * np.ptp(flat.y)
    figure = _figure((6.0, 7.2))
    rows = figure.subplots(len(_QUANTITIES), sharex=True)
    for axes, quantity, colour in zip(rows, _QUANTITIES, _LINE_COLOURS, strict=True):
        values = quantity.values(step)
        factor, unit = _prefixed(values, quantity.unit)
        section = LinearTriInterpolator(flat, picture.values(values / factor))(x, np.zeros_like(x))
        axes.plot(x, section, color=colour, linewidth=1.8)
        axes.plot(picture.points[on_axis, 0], values[on_axis] / factor, "o", color=colour, markersize=3.5)
        axes.set_ylabel(f"{quantity.label}\n[{unit}]")
        axes.grid(alpha=0.3)
    rows[-1].set_xlabel("x [mm]")
    _head(rows[0], "sections y = 0", title)
    figure.align_ylabels(rows)
    return figure


def _figure(size: tuple[float, float]) -> "Figure":
    # the object interface: no global state, no display, and half the start-up time of pyplot
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _head(axes: Any, what: str, title: str) -> None:
    axes.set_title(f"{title}\n{what}" if title else what, fontsize=10)


def _prefixed(values: Array, unit: str) -> tuple[float, str]:
    """Factor and unit with the SI prefix that brings the largest value between 1 and 1000."""
    largest = float(np.abs(values).max())
    exponent = 3 * int(np.floor(np.log10(largest) / 3)) if largest > 0 else 0
    exponent = min(max(exponent, min(_PREFIXES)), max(_PREFIXES))
    return 10.0**exponent, _PREFIXES[exponent] + unit
