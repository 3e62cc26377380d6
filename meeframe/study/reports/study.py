"""Figure of a study: curves of totals, sections through the zone, or maps of it, in panels."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from meeframe.fields import Array
from meeframe.results.canvas import line_style, sheet, styled
from meeframe.results.figures import PRESSURE, contact_edge
from meeframe.results.picture import Picture, lengths
from meeframe.results.records import Zone

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MAX_ARROWS: Final = 9
"""Maximal number of arrows along a side of a map."""
_MIN_MODULUS: Final = 1e-3
"""Relative modulus below which no arrow is drawn."""
_IN_CONTACT: Final = (PRESSURE, "tangential_traction")
"""Fields that are drawn in contact alone, which the pressure shows."""
_TINY: Final = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Panel:
    """Runs that are drawn together.

    Attributes
    ----------
    title
        Title of the panel.
    axis
        Label of the values.
    runs
        Labels of the runs.
    values
        Coordinates of the runs, (m,), nan for a run without one.
    quantities
        For each quantity and run a total (), a field on its zone (n,) or a tangential field (n, 2), divided by its
        reference.
    references
        References of the quantities [SI].
    converged
        Whether a run and its references converged, (m,).
    messages
        Final message of each run.
    zones
        Contact zone of each run, (m,).
    """

    title: str
    axis: str
    runs: tuple[str, ...]
    values: Array
    quantities: Mapping[str, Sequence[Array]]
    references: Mapping[str, float]
    converged: tuple[bool, ...]
    messages: tuple[str, ...]
    zones: tuple[Zone, ...]


@dataclass(frozen=True, eq=False)
class Study:
    """A study with its numbers; texts are as in its file."""

    name: str
    title: str
    paper: str
    kind: Literal["curves", "sections", "maps"]
    scale: Literal["linear", "log"]
    panels: tuple[Panel, ...]

    @property
    def not_converged(self) -> tuple[str, ...]:
        """Runs with a step that did not converge, as `panel, run`."""
        return tuple(
            f"{panel.title}, {run}"
            for panel in self.panels
            for run, converged in zip(panel.runs, panel.converged, strict=True)
            if not converged
        )


def study_json(study: Study) -> str:
    """Return the numbers of a study as JSON: runs, references and quantities of each panel.

    For fields, the distinct zones with points [m] and weights [m^2] and the index of the zone of each run are included.
    """
    panels = [_panel_numbers(panel, study.kind != "curves") for panel in study.panels]
    head = {"name": study.name, "title": study.title, "paper": study.paper, "kind": study.kind}
    return json.dumps({**head, "panels": panels}, indent=1, allow_nan=False) + "\n"


def _panel_numbers(panel: Panel, with_points: bool) -> dict[str, Any]:
    numbers: dict[str, Any] = {
        "title": panel.title,
        "axis": panel.axis,
        "runs": list(panel.runs),
        "values": [value if math.isfinite(value) else None for value in panel.values.tolist()],
        "converged": list(panel.converged),
        "messages": list(panel.messages),
        "references": dict(panel.references),
        "quantities": {name: [value.tolist() for value in values] for name, values in panel.quantities.items()},
    }
    if with_points:
        zones, indices = _distinct(panel.zones)
        numbers["zones"] = [{"points": zone.points.tolist(), "weights": zone.weights.tolist()} for zone in zones]
        numbers["zone_of_run"] = indices
    return numbers


def _distinct(zones: Sequence[Zone]) -> tuple[list[Zone], list[int]]:
    """Return the zones with different points, and for each zone its index among them."""
    distinct: list[Zone] = []
    indices = []
    for zone in zones:
        equal = [index for index, other in enumerate(distinct) if np.array_equal(other.points, zone.points)]
        indices.append(equal[0] if equal else len(distinct))
        if not equal:
            distinct.append(zone)
    return distinct, indices


@styled
def study_figure(study: Study) -> "Figure":
    """Return the figure with a column for each panel, or for maps a column for each run.

    Titles hold the letters of panels, as those of published figures do.
    """
    draw, width, height = {
        "curves": (_curves, min(5.0, 16.0 / len(study.panels)) * len(study.panels), 4.0),
        "sections": (_sections, 4.8 * len(study.panels), 2.6 * _rows(study)),
        "maps": (_maps, 2.4 * sum(len(p.runs) for p in study.panels) + 1.2, 2.3 * _rows(study) + 0.5),
    }[study.kind]
    figure = sheet((width, height))
    draw(figure, study)
    return figure


def _rows(study: Study) -> int:
    return len(_names(study))


def _names(study: Study) -> list[str]:
    """Return all quantities in the order in which the panels show them."""
    return list(dict.fromkeys(name for panel in study.panels for name in panel.quantities))


def _label(study: Study, name: str) -> str:
    """Return the label of a quantity, which is relative to its reference unless that is one."""
    relative = any(panel.references.get(name, 1.0) != 1.0 for panel in study.panels)
    return name.replace("_", " ") + (" / reference" if relative else "")


def _curves(figure: "Figure", study: Study) -> None:
    grid = figure.subplots(1, len(study.panels), squeeze=False, sharey=True)
    names = _names(study)
    for axes, panel in zip(grid[0], study.panels, strict=True):
        by_label = bool(np.isnan(panel.values).any())
        x = np.arange(len(panel.runs)) if by_label else panel.values
        for name, values in panel.quantities.items():
            style = line_style(names.index(name), len(names))
            axes.plot(x, np.array(values), label=name.replace("_", " "), **style)
        axes.set(title=panel.title, xlabel=panel.axis)
        axes.set(xticks=x, xticklabels=panel.runs) if by_label else axes.set(xscale=study.scale)
        axes.grid(visible=True)
        axes.legend(fontsize=8)
    grid[0, 0].set_ylabel("relative to reference")


def _sections(figure: "Figure", study: Study) -> None:
    grid = figure.subplots(_rows(study), len(study.panels), squeeze=False, sharex=True, sharey="row")
    factor, unit = _lengths(study)
    for column, panel in enumerate(study.panels):
        lines = [middle_line(zone) for zone in panel.zones]
        for row, name in enumerate(_names(study)):
            axes = grid[row, column]
            for run, values in enumerate(panel.quantities.get(name, ())):
                nodes, x = lines[run]
                style = line_style(run, len(panel.runs))
                axes.plot(x / factor, values[nodes], label=panel.runs[run], **style)
            axes.grid(visible=True)
            if column == 0:
                axes.set_ylabel(_label(study, name))
        grid[0, column].set_title(panel.title)
        grid[0, column].legend(title=panel.axis or None, fontsize=7, title_fontsize=7)
        grid[-1, column].set_xlabel(f"x [{unit}]")


def _lengths(study: Study) -> tuple[float, str]:
    return lengths(zone for panel in study.panels for zone in panel.zones)


def middle_line(zone: Zone) -> tuple[Any, Array]:
    """Return the nodes on the line y = middle of the zone, and their coordinates.

    Parameters
    ----------
    zone
        The contact zone.

    Returns
    -------
    nodes
        Indices of the nodes, ascending in x.
    x
        Distances along x from the middle of the zone [m].
    """
    x, y = (zone.points[:, i] - (zone.points[:, i].min() + zone.points[:, i].max()) / 2 for i in range(2))
    nodes = np.flatnonzero(np.abs(y) <= np.abs(y).min() + 1e-9 * np.ptp(y))
    nodes = nodes[np.argsort(x[nodes])]
    return nodes, x[nodes]


def _maps(figure: "Figure", study: Study) -> None:
    columns = [(panel, run) for panel in study.panels for run in range(len(panel.runs))]
    scale = _lengths(study)
    grid = figure.subplots(_rows(study), len(columns), squeeze=False, sharex=True, sharey=True)
    figure.get_layout_engine().set(rect=(0.0, 0.0, 0.97, 1.0))  # type: ignore[union-attr, call-arg] # space for the labels of colour bars
    for row, name in enumerate(_names(study)):
        fields = [np.linalg.norm(v, axis=-1) if v.ndim == 2 else v for v in _each(study, name)]
        low, high = min(v.min() for v in fields), max(v.max() for v in fields)
        image: Any = None
        for axes, (panel, run) in zip(grid[row], columns, strict=True):
            values = panel.quantities[name][run]
            in_contact = name in _IN_CONTACT and PRESSURE in panel.quantities
            pressure = panel.quantities[PRESSURE][run] if in_contact else None
            image = _map(axes, panel.zones[run], values, (low, high), scale, pressure)
        figure.colorbar(image, ax=list(grid[row]), label=_label(study, name), shrink=0.9)
        grid[row, 0].set_ylabel(f"y [{scale[1]}]")
    for column, (panel, run) in enumerate(columns):
        several = len(panel.runs) > 1 or len(study.panels) == 1
        title = "\n".join(filter(None, [panel.title, _run_title(panel, run) if several else ""]))
        grid[0, column].set_title(title, fontsize=9)
        grid[-1, column].set_xlabel(f"x [{scale[1]}]")


def _run_title(panel: Panel, run: int) -> str:
    """Return the label of a run, with the axis if it is a number on it."""
    try:
        return f"{panel.axis} = {float(panel.runs[run]):g}" if panel.axis else panel.runs[run]
    except ValueError:
        return panel.runs[run]


def _each(study: Study, name: str) -> Iterator[Array]:
    return (values for panel in study.panels for values in panel.quantities[name])


def _map(
    axes: Any,
    zone: Zone,
    values: Array,
    limits: tuple[float, float],
    scale: tuple[float, str],
    pressure: Array | None,
) -> Any:
    """Draw one map, in contact alone if the pressure (n,) is given; a tangential field by modulus and direction."""
    picture = Picture.of(zone, scale)
    modulus = values if values.ndim == 1 else np.linalg.norm(values, axis=1)
    touching = np.ones(len(modulus), bool) if pressure is None else pressure > 0.0
    if pressure is None or touching.all() or not touching.any():
        image = picture.shade(axes, modulus, vmin=limits[0], vmax=limits[1])
    else:
        image = picture.shade(axes, picture.extended(modulus, touching), touching, vmin=limits[0], vmax=limits[1])
        level = contact_edge(zone, touching, pressure, np.full(len(modulus), np.inf))
        picture.clip(axes, image, level)
    if values.ndim == 2:
        nodes = _sample(picture.points, modulus > _MIN_MODULUS * max(limits[1], _TINY))
        direction = values[nodes] / modulus[nodes, None]
        axes.quiver(*picture.points[nodes].T, *direction.T, color="white", width=0.006, scale=18)
    axes.set(aspect="equal")
    axes.margins(0.0)
    return image


def _sample(points: Array, eligible: Any) -> Any:
    """Return the eligible nodes nearest to the points of a regular grid, few enough to distinguish arrows."""
    from scipy.spatial import KDTree

    x, y = (np.linspace(points[:, i].min(), points[:, i].max(), _MAX_ARROWS) for i in range(2))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    nearest = np.unique(KDTree(points).query(grid)[1])
    return nearest[eligible[nearest]]
