"""Figures of the last finished step: maps over the contact zone and sections through its centre."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from meeframe.core.fields import Array
from meeframe.core.mesh import Indices
from meeframe.core.result import Result, StepResult, Zone

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.tri import Triangulation

# fans and splits of meshio's cell types into triangles, by position of the node in the cell
_TRIANGLES: Final = {
    "triangle": ((0, 1, 2),),
    "triangle6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad": ((0, 1, 2), (0, 2, 3)),
    "quad8": ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 7), (5, 6, 7)),
    "quad9": ((0, 4, 8), (0, 8, 7), (4, 1, 5), (4, 5, 8), (8, 5, 2), (8, 2, 6), (7, 8, 6), (7, 6, 3)),
}
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
    triangulation = _triangulation(result.zone)
    title = result.provenance.title
    drawn = {f"{q.file}.png": _map(q, q.values(step), triangulation, title) for q in _QUANTITIES}
    return drawn | {"sections.png": _sections(step, triangulation, title)}


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure as PNG."""
    figure.savefig(path, dpi=150, format="png")


def _triangulation(zone: Zone) -> "Triangulation":
    """The zone seen along its mean normal, coordinates along e1 and e2 from its centre [m]."""
    from matplotlib.tri import Triangulation

    centre = (zone.points.min(axis=0) + zone.points.max(axis=0)) / 2
    e1, e2 = (zone.frames[:, axis].mean(axis=0) for axis in (0, 1))
    flat = (zone.points - centre) @ np.stack([e1, e2], axis=1)
    return Triangulation(flat[:, 0] * 1e3, flat[:, 1] * 1e3, _triangles(zone.cells))


def _triangles(cells: tuple[tuple[str, Indices], ...]) -> Indices:
    parts = [connectivity[:, triangle] for name, connectivity in cells for triangle in _TRIANGLES[name]]
    return np.concatenate(parts)


def _map(quantity: _Quantity, values: Array, triangulation: "Triangulation", title: str) -> "Figure":
    factor, unit = _prefixed(values, quantity.unit)
    figure = _figure((5.6, 4.6))
    axes = figure.subplots()
    drawn = axes.tripcolor(triangulation, values / factor, shading="gouraud", cmap=_MAP_COLOURS, rasterized=True)
    figure.colorbar(drawn, ax=axes, label=f"{quantity.label} [{unit}]")
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    _head(axes, quantity.label, title)
    return figure


def _sections(step: StepResult, triangulation: "Triangulation", title: str) -> "Figure":
    from matplotlib.tri import LinearTriInterpolator

    x = np.linspace(triangulation.x.min(), triangulation.x.max(), 401)
    figure = _figure((6.0, 7.2))
    rows = figure.subplots(len(_QUANTITIES), sharex=True)
    for axes, quantity, colour in zip(rows, _QUANTITIES, _LINE_COLOURS, strict=True):
        values = quantity.values(step)
        factor, unit = _prefixed(values, quantity.unit)
        section = LinearTriInterpolator(triangulation, values / factor)(x, np.zeros_like(x))
        axes.plot(x, section, color=colour, linewidth=1.8)
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
