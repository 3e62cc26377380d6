"""Figures and table of the study of a rough surface."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from meeframe.common.literal import LiteralTable
from meeframe.fields import Array
from meeframe.indenters.topography import HeightMap, bearing_curve, radial_spectrum, scale_dependent_slope
from meeframe.laws import Signorini
from meeframe.results.canvas import (
    LINE_COLOURS,
    MAP_COLOURS,
    head,
    label_logarithmic,
    label_panels,
    prefixed,
    sheet,
    styled,
)
from meeframe.study.rough.declare import PERFECT, RoughStudy
from meeframe.study.rough.quantities import QUANTITIES
from meeframe.study.rough.run import RoughResult
from meeframe.study.rough.theory import bush_gibson_thomas_area, persson_area

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIZE: Final = (9.6, 7.4)
_COLUMNS: Final = ("area_fraction", "mean_gap", "stiffness", "capacitance", "charge_density", "conductance")
"""Quantities of the table on the terminal."""
_CURVES: Final = ("capacitance", "charge_density", "conductance")


@styled
def surface_figure(result: RoughResult) -> "Figure":
    """Return the figure of the surface: heights, spectrum, bearing ratio and slope by scale."""
    surface = result.study.surface
    figure = sheet(_SIZE)
    panels = figure.subplots(2, 2).ravel()
    _draw_map(panels[0], surface, surface.heights, "m", "height")
    _draw_spectrum(panels[1], surface)
    fractions, levels = bearing_curve(surface)
    factor, unit = prefixed(levels, "m")
    panels[2].plot(100.0 * fractions, levels / factor)
    panels[2].set(xlabel="bearing ratio [%]", ylabel=f"height [{unit}]")
    distances, slopes = scale_dependent_slope(surface)
    factor, unit = prefixed(distances, "m")
    panels[3].loglog(distances / factor, slopes, "o-")
    panels[3].set(xlabel=f"distance [{unit}]", ylabel="r.m.s. slope between\npoints at this distance [1]")
    label_logarithmic(panels[3].xaxis)
    for panel in panels[1:]:
        panel.grid(visible=True)
    head(panels[0], "surface", result.study.table.title)
    label_panels(panels)
    return figure


def _draw_map(axes: Any, surface: HeightMap, values: Array, unit: str, name: str) -> None:
    """Draw values (nx, ny) over the surface, with a bar of colours."""
    shown = values[np.isfinite(values)]
    (factor, value_unit), (scale, length_unit) = prefixed(shown, unit), prefixed(np.array(surface.size), "m")
    x, y = surface.x / scale, surface.y / scale
    (dx, dy) = np.array(surface.spacing) / (2.0 * scale)
    extent = (x[0] - dx, x[-1] + dx, y[0] - dy, y[-1] + dy)
    image = axes.imshow(values.T / factor, cmap=MAP_COLOURS, origin="lower", extent=extent, interpolation="nearest")
    axes.figure.colorbar(image, ax=axes, label=f"{name} [{value_unit}]")
    axes.set(xlabel=f"x [{length_unit}]", ylabel=f"y [{length_unit}]")


def _draw_spectrum(axes: Any, surface: HeightMap) -> None:
    rings = radial_spectrum(surface)
    resolved = rings.density > 1e-14 * rings.density.max()  # beyond a cut-off there is round-off
    axes.loglog(rings.wave_number[resolved], rings.density[resolved], "o-", markersize=3)
    axes.set(xlabel="wave number 2π/λ [1/m]", ylabel="power spectral density [m⁴]")


@styled
def contact_figure(result: RoughResult) -> "Figure":
    """Return the figure of the contact: area beside theories, mean gap, stiffness and electric quantities, pressure."""
    drawn = [name for name in _CURVES if name in result.values]
    count = 3 + ("stiffness" in result.values) + len(drawn)
    columns = 2 if count <= 4 else 3
    rows = -(-count // columns)
    figure = sheet((4.8 * columns, 3.7 * rows))
    panels = figure.subplots(rows, columns).ravel()
    _draw_area(panels[0], result)
    _draw_gap(panels[1], result)
    position = 2
    for name in (*(["stiffness"] if "stiffness" in result.values else []), *drawn):
        _draw_curve(panels[position], result, name)
        position += 1
    pressure = np.where(result.nodal_pressure > 0.0, result.nodal_pressure, np.nan)  # NaN without convergence, too
    _draw_map(panels[position], result.study.surface, pressure, "Pa", "pressure at the last load")
    for panel in panels[position + 1 :]:
        panel.remove()
    head(panels[0], "rough contact", result.study.table.title)
    label_panels(panels[: position + 1])
    return figure


def _relative(result: RoughResult) -> Array:
    """Return the mean pressure over E* h', (m,)."""
    return np.asarray(result.pressures / result.study.pressure_scale)


def _draw_area(axes: Any, result: RoughResult) -> None:
    relative, study = _relative(result), result.study
    fine = np.linspace(0.0, 1.05 * relative.max(), 100)
    linear = bush_gibson_thomas_area(fine)
    axes.plot(fine, np.where(linear <= 1.0, linear, np.nan), "--", color=LINE_COLOURS[1], label="Bush, Gibson, Thomas")
    axes.plot(fine, persson_area(fine), ":", color=LINE_COLOURS[2], label="Persson")
    if np.isfinite(study.bound):
        plastic = np.minimum(fine * study.pressure_scale / study.bound, 1.0)
        axes.plot(fine, plastic, "-.", color=LINE_COLOURS[3], label="perfectly plastic")
    axes.plot(relative, result.values["area_fraction"], "o-", color=LINE_COLOURS[0], label="meeframe")
    axes.set(xlabel="mean pressure / (E* × r.m.s. slope)", ylabel="contact area / nominal area", xlim=(0.0, None))
    axes.set_ylim(0.0, None)
    axes.grid(visible=True)
    axes.legend()


def _draw_gap(axes: Any, result: RoughResult) -> None:
    factor, unit = prefixed(result.pressures, "Pa")
    gap_factor, gap_unit = prefixed(result.values["mean_gap"], "m")
    axes.semilogx(result.pressures / factor, result.values["mean_gap"] / gap_factor, "o-")
    axes.set(xlabel=f"mean pressure [{unit}]", ylabel=f"mean gap [{gap_unit}]")
    axes.set_ylim(0.0, None)
    axes.grid(visible=True)


def _draw_curve(axes: Any, result: RoughResult, name: str) -> None:
    """Draw a quantity over the mean pressure, on logarithmic scales where its values are positive.

    Infinite values, of full contact, are not drawn.
    """
    quantity, values = QUANTITIES[name], _finite(result.values[name])
    factor, unit = prefixed(result.pressures, "Pa")
    shown = values[np.isfinite(values)]
    draw = axes.loglog if shown.size and (shown > 0.0).all() else axes.plot
    draw(result.pressures / factor, values, "o-", label="meeframe")
    if name == "conductance" and "stiffness" in result.values and _has_identity(result.study):
        conductivity = result.study.table.electrical_conductivity or np.nan
        barber = 2.0 * conductivity / result.study.modulus * _finite(result.values["stiffness"])
        draw(result.pressures / factor, barber, "x", color=LINE_COLOURS[1], label="from the stiffness (Barber)")
        axes.legend()
    axes.set(xlabel=f"mean pressure [{unit}]", ylabel=f"{quantity.label} [{_printed(quantity.unit)}]")
    axes.grid(visible=True)


def _finite(values: Array) -> Array:
    return np.where(np.isfinite(values), values, np.nan)


def _has_identity(study: RoughStudy) -> bool:
    """Return whether the stiffness determines the conductance: of hard, perfectly conducting and uncoupled contacts."""
    return isinstance(study.case.contact_law, Signorini) and study.current_law == PERFECT and not study.is_coupled


def _printed(unit: str) -> str:
    return unit.replace("^2", "²")


def rough_table(
    title: str, pressures: Array, values: Mapping[str, Array], status: Sequence[str], message: Sequence[str]
) -> RenderableType:
    """Return the quantities of all pressures as a table, and the messages of those that did not converge.

    Parameters
    ----------
    title : str
        Title of the study.
    pressures : Array
        Mean pressures, (m,) [Pa].
    values : mapping of str to Array
        Quantities by name, (m,) each.
    status, message : sequence of str
        Status and message of each pressure; empty messages are left out.

    Returns
    -------
    RenderableType
        The table, to be printed on a terminal.
    """
    table = LiteralTable(title)
    names = [name for name in _COLUMNS if name in values]
    table.add_column("mean pressure [Pa]", justify="right")
    for name in names:
        unit = QUANTITIES[name].unit
        label = name.replace("_", " ")
        table.add_column(label if unit == "1" else f"{label} [{_printed(unit)}]", justify="right")
    table.add_column("status")
    for number, pressure in enumerate(pressures):
        numbers = (f"{values[name][number]:.5g}" for name in names)
        table.add_row(f"{pressure:.5g}", *numbers, status[number])
    messages = (Text(f"{pressure:.5g} Pa: {text}") for pressure, text in zip(pressures, message, strict=True) if text)
    return Group(table, *messages)
