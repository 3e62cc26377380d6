"""Curves of a run with several increments: forces, area, total fluxes and energy dissipated by friction."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.contact.problem import Status
from meeframe.fields import Array, FieldSet
from meeframe.results.canvas import (
    CONSTANT_RANGE,
    LINE_COLOURS,
    add_legend,
    head,
    label_panels,
    limit_constant,
    prefixed,
    prefixed_area,
    sheet,
    styled,
)
from meeframe.results.overview import FLUX_MODULI, digests, fields_of
from meeframe.results.records import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_ZERO_RATIO: Final = 1e-6
"""Motion or force that counts as zero, as a fraction of that along the other axis, or of the normal force."""
_ROUND_OFF: Final = 1e-12
"""Total flux over capacity that counts as zero."""
_SHOWN: Final = (
    "approach",
    "translation",
    "normal_force",
    "tangential_force",
    "contact_area",
    "stick_area",
    "dissipated_energy",
    "worn_volume",
)
_MODULUS: Final = "modulus of "
"""Prefix of the integral of the modulus of a flux."""
_WIDTH: Final = 5.6
_MAX_ROWS: Final = 3
"""Largest number of panels in one column."""
_DOT: Final = 4.0
_RING: Final = 7.5
"""Diameters of the markers of increments and of unloading in points."""
_MAX_FULL_SIZE: Final = 60
_MIN_SCALE: Final = 0.3
"""Largest number of increments with markers of full size; smallest size of those of longer histories."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Curve of a history: a quantity over another, each with name, unit and values (increments, components).

    Components are along e1 and e2 where there are two. covers_all: whether it is of all converged increments.
    """

    name: str
    across: tuple[str, str, Array]
    up: tuple[str, str, Array]
    components: tuple[str, ...] = field(default=("",))
    covers_all: bool = True


def curves(result: Result) -> list[Curve]:
    """Return the curves of the converged increments; those of absent phenomena are left out."""
    table, fields = _Table(result), fields_of(result)
    if len(table) < 2:
        return []
    approach, forces = table["approach"], table["normal_force"]
    translation, tangential = table["translation"], table["tangential_force"]
    over_approach, over_force = _across("approach", "m", approach), _across("normal force", "N", forces)
    drawn = [Curve("normal force", over_approach, ("normal force", "N", forces))]
    # rounding of a vanishing force is no curve
    if np.abs(tangential).max() > _ZERO_RATIO * np.abs(forces).max():
        components: tuple[str, ...] = ("along e1", "along e2")
        if all(np.abs(v[:, 1]).max() <= _ZERO_RATIO * np.abs(v[:, 0]).max() for v in (translation, tangential)):
            components = components[:1]
        curve = _across("translation", "m", translation), ("tangential force", "N", tangential)
        drawn.append(Curve("tangential force", *curve, components))
    drawn.append(Curve("contact area", over_approach, ("contact area", "m²", table["contact_area"])))
    for scalar in fields.scalars:
        flux = table[scalar.resultant]
        if np.abs(flux).max() > _ROUND_OFF * table[_MODULUS + scalar.resultant].max() and flux.any():
            name = scalar.resultant.replace("_", " ")
            drawn.append(Curve(name, over_force, (name, scalar.resultant_unit, flux)))
    drawn += _rolling_curves(table, fields)
    dissipated = np.cumsum(table["dissipated_energy"], axis=0)
    if dissipated.any():
        words = "dissipated energy\nsince the beginning"
        drawn.append(Curve("dissipated energy", _numbers("increment", len(table)), (words, "J", dissipated)))
    volumes = table["worn_volume"]
    if volumes.any():
        drawn.append(Curve("worn volume", _numbers("increment", len(table)), ("worn volume", "m³", volumes)))
    return drawn


class _Table:
    """Numbers of the converged increments, (increments, components) by name; nan where the contact does not roll."""

    def __init__(self, result: Result) -> None:
        rows: list[Array] = []
        self._columns: dict[str, slice] = {}
        for digest in digests(result):
            if digest["status"] != Status.CONVERGED:
                continue
            entries = {name: np.atleast_1d(value) for name, value in _numbers_of(digest, fields_of(result))}
            if not rows:
                ends = np.cumsum([len(entry) for entry in entries.values()]).tolist()
                self._columns = {
                    name: slice(end - len(entries[name]), end) for name, end in zip(entries, ends, strict=True)
                }
            rows.append(np.concatenate(list(entries.values()), dtype=float))  # little memory for each of thousands
        self._rows = np.array(rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, name: str) -> Array:
        return self._rows[:, self._columns[name]]


def _numbers_of(digest: Mapping[str, Any], fields: FieldSet) -> Iterator[tuple[str, Any]]:
    """Yield the numbers of an increment that curves show, and their names."""
    yield from ((name, digest[name]) for name in _SHOWN)
    for scalar, modulus in zip(fields.scalars, digest[FLUX_MODULI], strict=True):
        yield scalar.resultant, digest[scalar.resultant]
        yield _MODULUS + scalar.resultant, modulus
        yield scalar.value_name, digest[scalar.value_name]
    rolling = digest["rolling"] or {}
    for name, components in (("rolled_distance", 1), ("creep_force", 2), ("creepage", 2)):
        yield name, rolling.get(name, np.full(components, np.nan))


def _rolling_curves(table: _Table, fields: FieldSet) -> Iterator[Curve]:
    """Yield the curves of increments in which the contact rolls, over the rolled distance if it grows.

    Those of steady rolling, without a distance, are over their number.
    """
    rolls = np.isfinite(table["rolled_distance"][:, 0])
    if rolls.sum() < 2:
        return
    across = _across("rolled distance", "m", table["rolled_distance"][rolls], "steady increment")
    for name, unit in (("creep_force", "N"), ("creepage", "")):
        words = name.replace("_", " ")
        yield Curve(words, across, (words, unit, table[name][rolls]), ("longitudinal", "lateral"), covers_all=False)
    for scalar in fields.scalars:
        for name, unit in ((scalar.resultant, scalar.resultant_unit), (scalar.value_name, scalar.value_unit)):
            values = table[name][rolls]
            if np.ptp(values) > CONSTANT_RANGE * np.abs(values).max():
                words = name.replace("_", " ")
                yield Curve(f"{words} in rolling", across, (words, unit, values), covers_all=False)
    yield Curve("sticking area", across, ("sticking area", "m²", table["stick_area"][rolls]), covers_all=False)


def _across(name: str, unit: str, values: Array, numbered: str = "increment") -> tuple[str, str, Array]:
    """Return values (increments, components) across a curve, or the numbers of the increments if they are constant."""
    varies = np.ptp(values, axis=0).max() > CONSTANT_RANGE * np.abs(values).max()
    return (name, unit, values) if varies else _numbers(numbered, len(values))


def _numbers(name: str, count: int) -> tuple[str, str, Array]:
    """Return the numbers of increments from 1, across a curve."""
    return name, "", np.arange(1.0, count + 1)[:, None]


def unloading(drawn: Sequence[Curve], curve: Curve) -> NDArray[np.bool_]:
    """Return a mask of the increments of a curve in which both normal force and approach decrease, (increments,).

    None is marked on curves of some of the increments. drawn: all curves, of which the first is that of the force.
    """
    if not curve.covers_all:
        return np.zeros(len(curve.up[2]), bool)
    return np.asarray(_falls(drawn[0].up[2][:, 0]) & _falls(drawn[0].across[2][:, 0]))


def _falls(values: Array) -> NDArray[np.bool_]:
    return np.asarray(np.diff(values, prepend=0.0) < -CONSTANT_RANGE * np.max(np.abs(values), initial=0.0))


@styled
def history(result: Result) -> "Figure | None":
    """Return the figure of all curves of a history; None with fewer than two converged increments."""
    drawn = curves(result)
    if not drawn:
        return None
    n_columns = 1 if len(drawn) <= _MAX_ROWS else 2
    n_rows = -(-len(drawn) // n_columns)
    figure = sheet((_WIDTH * n_columns, 0.6 + 2.5 * n_rows))
    panels = [figure.add_subplot(n_rows, n_columns, number) for number in range(1, len(drawn) + 1)]
    for axes, curve in zip(panels, drawn, strict=True):
        draw_curve(axes, curve, unloading(drawn, curve))
    head(figure if n_columns > 1 else panels[0], "history", result.provenance.title)
    label_panels(panels)
    return figure


def draw_curve(axes: Any, curve: Curve, falls: NDArray[np.bool_]) -> None:
    """Draw a curve of a history; falls: (increments,) mask of those with rings as markers."""
    (x_name, x_unit, x), (y_name, y_unit, y) = curve.across, curve.up
    (x_factor, x_unit), (y_factor, y_unit) = prefixed(x, x_unit) if x_unit else (1.0, ""), prefixed_area(y, y_unit)
    scale = min(max(_MAX_FULL_SIZE / len(y), _MIN_SCALE), 1.0)
    for column, (label, colour) in enumerate(zip(curve.components, LINE_COLOURS, strict=False)):
        points = np.column_stack([x[:, min(column, x.shape[1] - 1)] / x_factor, y[:, column] / y_factor])
        dots = {"markersize": scale * _DOT, "markevery": np.flatnonzero(~falls).tolist(), "label": label or "loading"}
        axes.plot(*points.T, "o-", color=colour, **dots)
        if falls.any():  # rings, in which the dots of a path that coincides remain visible
            ring = {"markerfacecolor": "none", "markersize": scale * _RING, "label": "_" * bool(label) + "unloading"}
            axes.plot(*points[falls].T, "o", color=colour, **ring)
    x_label, y_label = (f"{name} [{unit}]" if unit else name for name, unit in ((x_name, x_unit), (y_name, y_unit)))
    axes.set(xlabel=x_label, ylabel=y_label)
    axes.ticklabel_format(useOffset=False)
    if not x_unit:
        axes.xaxis.get_major_locator().set_params(integer=True)
    limit_constant(axes.set_xlim, x / x_factor)
    limit_constant(axes.set_ylim, y / y_factor)
    axes.grid(visible=True)
    if y.shape[1] == 2 or falls.any():
        add_legend(axes)
