"""Pictures of scalar fields on plane sections of a body."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from meeframe.fields import Array
from meeframe.results.canvas import MAP_COLOURS, head, label_panels, map_ticks, prefixed, sheet, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH: Final = 5.2
_MAP_WIDTH: Final = 3.4
"""Width of a map without the bar of colours and the labels [inches]."""
_LABELS: Final = 0.9
"""Height of the labels of a map [inches]."""
_MIN_HEIGHT: Final = 1.6
_MAX_HEIGHT: Final = 6.0
"""Bounds of the height of a map, for the label of the bar of colours and for the screen [inches]."""


@dataclass(frozen=True, eq=False)
class PlaneField:
    """Scalar field on a plane section.

    Attributes
    ----------
    name, unit
        Name of the field and its SI unit.
    values
        (p, q) values.
    axes
        Names of the two axes along the plane and of the one across it.
    coordinates
        Coordinates along the plane, (p,) and (q,) [m].
    position
        Coordinate of the plane along the axis across it [m].
    """

    name: str
    unit: str
    values: Array
    axes: tuple[str, str, str]
    coordinates: tuple[Array, Array]
    position: float

    @property
    def title(self) -> str:
        """Name of the field and position of the plane."""
        factor, unit = prefixed(np.array([self.position]), "m")
        coordinate = f"{self.position / factor:.4g} {unit}" if self.position else "0"
        return f"{self.name}, {self.axes[2]} = {coordinate}"


@styled
def draw_plane(axes: Any, field: PlaneField) -> None:
    """Draw a field on a plane section, with its bar of colours, on axes of matplotlib; a flat one is stretched."""
    length, metre = prefixed(np.concatenate(field.coordinates), "m")
    factor, unit = prefixed(field.values, field.unit)
    x, y = (values / length for values in field.coordinates)
    drawn = axes.pcolormesh(x, y, field.values.T / factor, shading="gouraud", cmap=MAP_COLOURS)
    axes.figure.colorbar(drawn, ax=axes, label=f"{field.name} [{unit}]")
    stretch = max(1.0, _MIN_HEIGHT / _MAP_WIDTH * np.ptp(x) / np.ptp(y))
    axes.set(aspect=stretch, xlabel=f"{field.axes[0]} [{metre}]", ylabel=f"{field.axes[1]} [{metre}]")
    axes.locator_params(nbins=map_ticks(axes))
    axes.set_title(field.title)


@styled
def planes_figure(fields: Sequence[PlaneField], title: str = "") -> "Figure":
    """Return the figure of fields on a plane section, one below the other."""
    figure = sheet((_WIDTH, _height(fields[0]) * len(fields)))
    rows = figure.subplots(len(fields), squeeze=False)[:, 0]
    for axes, field in zip(rows, fields, strict=True):
        draw_plane(axes, field)
    head(rows[0], fields[0].title, title)
    label_panels(rows)
    return figure


def _height(field: PlaneField) -> float:
    """Return the height of a map with its labels [inches], so that the bar of colours is as high as the map."""
    along, up = (float(np.ptp(values)) for values in field.coordinates)
    return _LABELS + min(max(_MAP_WIDTH * up / along, _MIN_HEIGHT), _MAX_HEIGHT)
