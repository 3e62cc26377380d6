"""What the study file of a sweep may say, and the points that it stands for. Documented in docs/sweep.md."""

from collections.abc import Callable, Iterator, Mapping
from itertools import product
from typing import Any, Final, Literal

import numpy as np
from pydantic import Field, model_validator

from meeframe.core.fields import Array
from meeframe.core.quantities import unit_registry
from meeframe.core.sweep import INCREMENT, POINT, SweepAxis
from meeframe.io.sweep import NODE
from meeframe.plugin.validation import choices
from meeframe.study.declare import Changes, CheckedChanges, RunTable, Table, Text, checked_keys, place_of, words
from meeframe.study.sweep_numbers import FIELD_UNITS, NUMBERS

_SPACING: Final = {"from", "to", "count", "scale"}
_SCALES: Final[Mapping[str, Callable[..., Array]]] = {"linear": np.linspace, "log": np.geomspace}
RESERVED: Final = ("status", "message", "key", "x", "y", "z", INCREMENT, NODE, POINT, *NUMBERS)
"""Names in sweep.h5 that no axis may have."""


class PlotTable(Table):
    """[[plots]]: one row of sweep.png.

    quantities: a picture for each; x: axis along which, by default the first with several numbers; lines: axis with a
    line for each value; kind: curves, or a map over the axes x and lines; scale: of x; at: labels of values at which
    the other axes stand, by default their first.
    """

    quantities: tuple[Text, ...] = Field(min_length=1)
    kind: Literal["curves", "map"] = "curves"
    x: Text | None = None
    lines: Text | None = None
    scale: Literal["linear", "log"] = "linear"
    at: dict[str, Any] = Field(default_factory=dict)


class SweepTable(Table):
    """The study file of a sweep.

    case: the case file that every point starts from, relative to this one; set: changed in all points; axes: every
    combination of their values is a point; points: more points, each with changes of its own; fields: nodal fields of
    the last increment that go into the result; every_increment: gather numbers of every increment, not of the last
    alone; plots: what sweep.png shows.
    """

    title: Text = "sweep"
    case: Text
    set: CheckedChanges = Field(default_factory=dict)
    axes: dict[Text, list[Any] | dict[str, Any]] = Field(default_factory=dict)
    points: tuple[RunTable, ...] = ()
    fields: tuple[Text, ...] = ()
    every_increment: bool = False
    plots: tuple[PlotTable, ...] = ()

    @model_validator(mode="after")
    def _fits_together(self) -> "SweepTable":
        if not self.axes and not self.points:
            raise ValueError("nothing to run: give [axes], [[points]] or both")
        axes = self.varied()
        for axis, _ in axes:
            if axis.name in RESERVED or "/" in axis.name:
                raise ValueError(f"axes: {axis.name!r} is the name of something else in sweep.h5; allowed: another one")
        _check_distinct("points", [run.label for run in self.points])
        _check_names("fields: unknown field", self.fields, FIELD_UNITS)
        shown = {axis.name: axis for axis in self.result_axes()}
        for number, plot in enumerate(self.plots, 1):
            place = f"plots[{number}]"
            _check_names(f"{place}.quantities: unknown quantity", plot.quantities, NUMBERS)
            _check_names(f"{place}: unknown axis", [name for name in (plot.x, plot.lines, *plot.at) if name], shown)
            for name, value in plot.at.items():
                _check_names(f"{place}.at.{name}: unknown value", [words(value)], shown[name].labels)
        return self

    def varied(self) -> list[tuple[SweepAxis, tuple[Changes, ...]]]:
        """The axes, each with the changes that its values make. Raises ValueError."""
        return [_axis(name, values) for name, values in self.axes.items()]

    def result_axes(self) -> tuple[SweepAxis, ...]:
        """Those of the result: with points of their own all points stand on one axis."""
        if not self.points:
            return tuple(axis for axis, _ in self.varied())
        values = [run.value for run in self.points if run.value is not None]
        placed = not self.axes and len(values) == len(self.points)
        return (SweepAxis(POINT, tuple(label for label, _ in self.changes()), np.array(values) if placed else None),)

    def changes(self) -> Iterator[tuple[str, Changes]]:
        """Label and changes of every point: the product of the axes, the last of which varies fastest; then points."""
        axes = self.varied()
        for places in product(*(range(len(axis.labels)) for axis, _ in axes)) if axes else ():
            chosen = [(axis, changes, place) for (axis, changes), place in zip(axes, places, strict=True)]
            label = ", ".join(f"{axis.name} = {axis.labels[place]}" for axis, _, place in chosen)
            yield label, self.set | {k: v for _, changes, place in chosen for k, v in changes[place].items()}
        for run in self.points:
            yield run.label, self.set | run.set


def _axis(name: str, values: list[Any] | dict[str, Any]) -> tuple[SweepAxis, tuple[Changes, ...]]:
    """An axis of the study file and its changes. Raises ValueError that names it."""
    try:
        if isinstance(values, list) or values.keys() & _SPACING:
            return _of_lists(name, {name: values if isinstance(values, list) else _spaced(values)})
        if values and all(isinstance(item, list) for item in values.values()):
            return _of_lists(name, values)
        if values and all(isinstance(item, Mapping) for item in values.values()):
            return SweepAxis(name, tuple(values)), tuple(checked_keys(dict(item)) for item in values.values())
    except ValueError as error:
        raise ValueError(f"axes.{name}: {error}") from None
    raise ValueError(
        f"axes.{name}: allowed: a list of values, {{from, to, count}}, a table of keys with lists of values side by "
        "side, or a table of names with tables of changes"
    )


def _of_lists(name: str, lists: Mapping[str, list[Any]]) -> tuple[SweepAxis, tuple[Changes, ...]]:
    """Of keys whose values change together; numbers of the first one are where they stand on the axis."""
    lengths = {key: len(values) for key, values in lists.items()}
    if len(set(lengths.values())) > 1 or not all(lengths.values()):
        told = ", ".join(f"{key} has {length}" for key, length in lengths.items())
        raise ValueError(f"allowed: lists of one length that are not empty, {told}")
    changes = tuple(checked_keys(dict(zip(lists, values, strict=True))) for values in zip(*lists.values(), strict=True))
    first = next(iter(lists.values()))
    labels = [words(value) for value in first]
    if len(set(labels)) < len(labels) and len(lists) > 1:
        labels, first = [", ".join(map(words, change.values())) for change in changes], []
    _check_distinct("values", labels)
    places = [place for place in map(place_of, first) if place is not None]
    placed = len(places) == len(labels)
    return SweepAxis(name, tuple(labels), np.array(places) if placed else None, _unit(first) if placed else ""), changes


def _spaced(table: Mapping[str, Any]) -> list[float]:
    """Numbers from, to, count of them, at equal distances or ratios. Raises ValueError."""
    scale, ends = table.get("scale", "linear"), (table.get("from"), table.get("to"))
    if unknown := table.keys() - _SPACING:
        raise ValueError(f"unknown key {min(unknown)!r}; allowed: {', '.join(sorted(_SPACING))}")
    if scale not in _SCALES:
        raise ValueError(f"scale = {scale!r}: allowed: {', '.join(_SCALES)}")
    numbers = [end for end in ends if isinstance(end, int | float) and not isinstance(end, bool) and np.isfinite(end)]
    if len(numbers) < 2:
        raise ValueError(f"from = {ends[0]!r}, to = {ends[1]!r}: allowed: two finite numbers, SI units")
    if scale == "log" and min(numbers) <= 0:
        raise ValueError(f"from = {ends[0]!r}, to = {ends[1]!r}: allowed with scale = 'log': positive numbers")
    count = table.get("count")
    if not isinstance(count, int) or isinstance(count, bool) or count < 2:
        raise ValueError(f"count = {count!r}: allowed: a whole number from 2")
    # as one would write them, so that those of a longer axis are the same numbers
    return [float(f"{number:.14g}") for number in _SCALES[scale](*numbers, count)]


def _unit(values: list[Any]) -> str:
    """Of values that all have their place on an axis: in SI, as place_of gives them."""
    text = next((value for value in values if isinstance(value, str)), None)
    return "" if text is None else f"{unit_registry().Quantity(text).to_base_units().units:~}"


def _check_distinct(what: str, labels: list[str]) -> None:
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise ValueError(f"{what}: {twice!r} is given twice")


def _check_names(what: str, names: Any, known: Any) -> None:
    for name in names:
        if name not in known:
            raise ValueError(f"{what} {name!r}; {choices(name, tuple(known))}")
