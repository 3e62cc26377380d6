"""Schema of the study file of a sweep and expansion into points; documented in docs/howto/sweep.md."""

import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import cache
from itertools import combinations, product
from typing import Any, Final, Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from meeframe.common.errors import CaseError
from meeframe.fields import MEE, Array, FieldSet
from meeframe.fields.units import read_quantity
from meeframe.plugin.validation import choices, field_choices
from meeframe.results.sweep_files import NODE
from meeframe.results.sweep_records import INCREMENT, POINT, SweepAxis
from meeframe.study.declare import (
    Changes,
    CheckedChanges,
    RunTable,
    Table,
    Text,
    checked_keys,
    coordinate_of,
    fields_of,
    key_parts,
    words,
)
from meeframe.study.reports.sweep import SweepPlot
from meeframe.study.sweep.numbers import field_units, units

_SPACING: Final = {"from", "to", "count", "scale"}
_SCALES: Final[Mapping[str, Callable[..., Array]]] = {"linear": np.linspace, "log": np.geomspace}
_UNITS: Final = ("N", "Pa", "V", "C", "Wb", "N m")
"""Derived units of prescribed quantities in case files."""
MAX_POINTS: Final = 100_000
"""Maximal number of points of the axes of a study."""


class PlotTable(Table):
    """[[plots]]: one row of sweep.png.

    Attributes
    ----------
    quantities
        Quantities, with a picture for each.
    kind
        Curves, or a map over the axes x and lines.
    x
        Axis of abscissae; by default the first one with several numbers.
    lines
        Axis with a line for each value.
    scale
        Scale of x.
    at
        Labels of the values of the other axes, by default their first.
    """

    quantities: tuple[Text, ...] = Field(min_length=1)
    kind: Literal["curves", "map"] = "curves"
    x: Text | None = None
    lines: Text | None = None
    scale: Literal["linear", "log"] = "linear"
    at: dict[str, Any] = Field(default_factory=dict)

    def over(self, axes: Sequence[SweepAxis], fields: FieldSet = MEE) -> SweepPlot:
        """Return the plot over these axes. Raises ValueError for unknown quantities, axes or values."""
        named = {axis.name: axis for axis in axes}
        _check_names("quantities: unknown quantity", self.quantities, units(fields))
        for key, name in {"x": self.x, "lines": self.lines, **{f"at.{name}": name for name in self.at}}.items():
            _check_names(f"{key}: unknown axis", [name] if name else [], named)
        positions = {name: _label_of(value, named[name]) for name, value in self.at.items()}
        return SweepPlot(self.quantities, self.kind, self.x, self.lines, self.scale, positions)


class SweepTable(Table):
    """The study file of a sweep.

    Attributes
    ----------
    title
        Title of the sweep.
    case
        Case file that every point starts from, relative to the study file.
    set
        Keys changed in all points.
    axes
        Axes; every combination of their values is a point.
    points
        Further points, each with its changes.
    fields
        Nodal fields of the last increment that are stored in the result.
    every_increment
        Whether numbers of every increment are stored instead of the last one only.
    plots
        Rows of sweep.png.
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
    def _fits_together(self, info: ValidationInfo) -> "SweepTable":
        fields = fields_of(info)
        if not self.axes and not self.points:
            raise ValueError("nothing to run; give [axes], [[points]] or both")
        _check_axes(self.varied(), fields)
        _check_distinct("points", [run.label for run in self.points])
        names = field_units(fields)
        for name in self.fields:
            if name not in names:
                raise ValueError(f"fields: unknown field {name!r}; {field_choices(name, tuple(names))}")
        axes = self.result_axes()
        for number, plot in enumerate(self.plots, 1):
            try:
                plot.over(axes, fields).plot_axes(axes)
            except (ValueError, CaseError) as error:
                raise ValueError(f"plots[{number}].{error}") from None
        return self

    def varied(self) -> list[tuple[SweepAxis, tuple[Changes, ...]]]:
        """Return the axes, each with the changes of its values. Raises ValueError."""
        return [_axis(name, values) for name, values in self.axes.items()]

    def result_axes(self) -> tuple[SweepAxis, ...]:
        """Return the axes of the result; a study that lists points has one axis."""
        if not self.points:
            return tuple(axis for axis, _ in self.varied())
        values = [run.value for run in self.points if run.value is not None]
        has_values = not self.axes and len(values) == len(self.points)
        return (
            SweepAxis(POINT, tuple(label for label, _ in self.changes()), np.array(values) if has_values else None),
        )

    def changes(self) -> Iterator[tuple[str, Changes]]:
        """Yield the label and changes of every point.

        Points of the axes come first, with the last axis varying fastest, then the listed points.
        """
        axes = self.varied()
        for indices in product(*(range(len(axis.labels)) for axis, _ in axes)) if axes else ():
            chosen = [(axis, changes, index) for (axis, changes), index in zip(axes, indices, strict=True)]
            label = ", ".join(f"{axis.name} = {axis.labels[index]}" for axis, _, index in chosen)
            yield label, self.set | {k: v for _, changes, index in chosen for k, v in changes[index].items()}
        for run in self.points:
            yield run.label, self.set | run.set


def _axis(name: str, values: list[Any] | dict[str, Any]) -> tuple[SweepAxis, tuple[Changes, ...]]:
    """Return an axis of the study file and its changes. Raises ValueError that names the axis."""
    try:
        if isinstance(values, list) or _is_spaced(values):
            return _axis_of_lists(name, {name: _listed(values)})
        if values and all(isinstance(item, list) or _is_spaced(item) for item in values.values()):
            return _axis_of_lists(name, {key: _listed(item) for key, item in values.items()})
        if values and all(isinstance(item, Mapping) for item in values.values()):
            return SweepAxis(name, tuple(values)), tuple(checked_keys(dict(item)) for item in values.values())
    except (ValueError, OverflowError) as error:
        raise ValueError(f"axes.{name}: {error}") from None
    raise ValueError(
        f"axes.{name}: allowed: a list of values, {{from, to, count}}, a table of keys with lists of values of equal "
        "length or {from, to, count}, or a table of names with tables of changes"
    )


def _axis_of_lists(name: str, lists: Mapping[str, list[Any]]) -> tuple[SweepAxis, tuple[Changes, ...]]:
    """Return the axis of keys whose values change together; numbers of the first key are its coordinates."""
    lengths = {key: len(values) for key, values in lists.items()}
    if len(set(lengths.values())) > 1 or not all(lengths.values()):
        details = ", ".join(f"{key} has {length}" for key, length in lengths.items())
        raise ValueError(f"allowed: non-empty lists of equal length, {details}")
    changes = tuple(checked_keys(dict(zip(lists, values, strict=True))) for values in zip(*lists.values(), strict=True))
    first = next(iter(lists.values()))
    if len(lists) > 1 and len(set(_identities(first))) < len(first):
        combined = [", ".join(map(_exact, change.values())) for change in changes]
        _check_distinct("values", combined)
        return SweepAxis(name, tuple(combined)), changes
    labels = [words(value) for value in first]
    if len(set(labels)) < len(labels):  # numbers differ by less than the digits of words
        labels = [_exact(value) for value in first]
    _check_distinct("values", labels, _identities(first))
    coordinates = _coordinates(first)
    if coordinates is None:
        return SweepAxis(name, tuple(labels)), changes
    return SweepAxis(name, tuple(labels), coordinates, _unit(first)), changes


def _exact(value: Any) -> str:
    """Return a value in words, with all digits of a number."""
    return repr(value) if isinstance(value, float) and not value.is_integer() else words(value)


def _coordinates(values: Sequence[Any]) -> Array | None:
    """Return the coordinates of values on an axis; None unless all have one."""
    coordinates = [coordinate for coordinate in map(coordinate_of, values) if coordinate is not None]
    return np.array(coordinates) if len(coordinates) == len(values) else None


def _identities(values: Sequence[Any]) -> list[Hashable]:
    """Return identities of values: their coordinates, or else their words.

    Numbers with units are compared to 12 digits because unit conversion loses the last ones.
    """
    coordinates = _coordinates(values)
    if coordinates is None:
        return [_exact(value) for value in values]
    digits = 12 if any(isinstance(value, str) for value in values) else 17
    return [f"{coordinate:.{digits}g}" for coordinate in coordinates]


def _label_of(value: Any, axis: SweepAxis) -> str:
    """Return the label of a value on an axis. Raises ValueError if it has none."""
    matching = next((label for label in (_exact(value), words(value)) if label in axis.labels), None)
    if matching is None:
        _check_names(f"at.{axis.name}: unknown value", [words(value)], axis.labels)
    return str(matching)


def _is_spaced(values: Any) -> bool:
    """Return whether a table describes spaced numbers; case files have no top-level key with the name of its keys."""
    return isinstance(values, Mapping) and bool(values.keys() & _SPACING)


def _listed(values: list[Any] | Mapping[str, Any]) -> list[Any]:
    """Return the values of a list or of a description of spaced numbers."""
    return values if isinstance(values, list) else _spaced(values)


def _spaced(table: Mapping[str, Any]) -> list[float]:
    """Return `count` numbers with equal differences or ratios. Raises ValueError."""
    scale, ends = table.get("scale", "linear"), (table.get("from"), table.get("to"))
    if unknown := table.keys() - _SPACING:
        raise ValueError(f"unknown key {min(unknown)!r}; allowed: {', '.join(sorted(_SPACING))}")
    if not isinstance(scale, str) or scale not in _SCALES:
        raise ValueError(f"scale = {scale!r}: allowed: {', '.join(_SCALES)}")
    numbers = [end for end in ends if isinstance(end, int | float) and not isinstance(end, bool) and math.isfinite(end)]
    if len(numbers) < 2:
        raise ValueError(f"from = {ends[0]!r}, to = {ends[1]!r}: allowed: two finite numbers, SI units")
    if scale == "log" and min(numbers) <= 0:
        raise ValueError(f"from = {ends[0]!r}, to = {ends[1]!r}: allowed with scale = 'log': positive numbers")
    count = table.get("count")
    if not isinstance(count, int) or isinstance(count, bool) or not 2 <= count <= MAX_POINTS:
        raise ValueError(f"count = {count!r}: allowed: a whole number from 2 to {MAX_POINTS}")
    # rounded as users would write them, so that numbers of a longer axis are identical
    return [float(f"{number:.14g}") for number in _SCALES[scale](*numbers, count)]


def _unit(values: Sequence[Any]) -> str:
    """Return the common SI unit of values with coordinates. Raises ValueError for several units."""
    units: dict[str, str] = {}
    for value in values:
        if isinstance(value, str):
            units.setdefault(_unit_name(read_quantity(value)), value)
    if "rad" in units:
        units.pop("", None)  # "5 mm/m" is an angle like "1 deg"
    if len(units) > 1:
        details = ", ".join(f"{value!r} is in {unit or '1'}" for unit, value in units.items())
        raise ValueError(f"values: {details}; allowed: units of one quantity")
    return next(iter(units), "")


def _unit_name(quantity: Any) -> str:
    """Return the SI unit of a quantity in base units, by name if case files use it: "N", not "kg*m/s^2"."""
    name = _unit_names().get(quantity.dimensionality)
    return name or f"{quantity.units:~C}".replace("**", "^")


@cache
def _unit_names() -> dict[Any, str]:
    """Return the names of units by dimension."""
    return {read_quantity(f"1 {name}").dimensionality: name for name in _UNITS}


def _check_axes(axes: Sequence[tuple[SweepAxis, tuple[Changes, ...]]], fields: FieldSet) -> None:
    """Raise ValueError for names that sweep.h5 cannot store, for conflicting axes, and for too many points."""
    reserved = ("status", "message", "key", *"xyz", INCREMENT, NODE, POINT, *units(fields))
    for axis, _ in axes:
        if axis.name in reserved or axis.name in (".", "..") or "/" in axis.name:
            raise ValueError(f"axes: {axis.name!r} is reserved in sweep.h5; allowed: another name")
        invalid = next((label for label in axis.labels if "\0" in label), None)
        if invalid is not None:
            raise ValueError(f"axes.{axis.name}: {invalid!r} contains the character NUL; allowed: any other")
    _check_conflicts(axes)
    count = math.prod(len(axis.labels) for axis, _ in axes)
    if count > MAX_POINTS:
        raise ValueError(f"axes: {count} points; allowed: at most {MAX_POINTS}")


def _check_conflicts(axes: Sequence[tuple[SweepAxis, tuple[Changes, ...]]]) -> None:
    """Raise ValueError if two axes change the same key, or one changes a table and the other a key in it."""
    keys = [(axis.name, {key for change in changes for key in change}) for axis, changes in axes]
    for (name, keys_of_axis), (other, others) in combinations(keys, 2):
        for first, second in product(sorted(keys_of_axis), sorted(others)):
            if all(a == b for a, b in zip(key_parts(first), key_parts(second), strict=False)):
                raise ValueError(
                    f"axes: {name!r} changes {first} and {other!r} changes {second}: one would override the "
                    "other; allowed: axes with distinct keys"
                )


def _check_distinct(what: str, labels: Sequence[str], identities: Sequence[Hashable] = ()) -> None:
    """Raise ValueError for duplicate labels, or duplicate identities under different labels."""
    seen: dict[Hashable, str] = {}
    for label, identity in zip(labels, identities or labels, strict=True):
        if identity in seen:
            same = "" if seen[identity] == label else f", also as {seen[identity]!r}"
            raise ValueError(f"{what}: {label!r} is given twice{same}")
        seen[identity] = label


def _check_names(what: str, names: Any, known: Any) -> None:
    for name in names:
        if name not in known:
            raise ValueError(f"{what} {name!r}; {choices(name, tuple(known))}")
