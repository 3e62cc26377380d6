"""Schema of study files, with one frozen model for each table; documented in docs/howto/reproduce.md."""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    Strict,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from meeframe.common.errors import CaseError, listed
from meeframe.common.toml import read_toml
from meeframe.fields import MEE, FieldSet
from meeframe.fields.units import read_quantity
from meeframe.model.schema import StepTable
from meeframe.plugin.describe import unit_of
from meeframe.plugin.registry import Registry
from meeframe.plugin.validation import Problem, TableError, choices, problems_of
from meeframe.results import schema
from meeframe.study.quantities import totals

Changes = dict[str, Any]
"""Keys of a case file, written as in its error messages (steps[1].translation), with their new values."""

_COMPONENT: Final = re.compile(r"\.?([A-Za-z_][\w-]*)|\[([1-9]\d{0,8})\]")
_MAX_COMPONENTS: Final = 20
"""Largest number of components of a key; a case file has five at most."""

Model = TypeVar("Model", bound=BaseModel)


def _without_nul(text: str) -> str:
    if "\0" in text:  # neither paths nor names in result files can contain it
        raise ValueError("contains the character NUL; allowed: any other")
    return text


Text = Annotated[str, Strict(), Field(min_length=1), AfterValidator(_without_nul)]


def key_parts(key: str) -> list[str | int]:
    """Split a dotted key into its components.

    Parameters
    ----------
    key
        Key as in error messages, such as ``steps[1].translation``.

    Returns
    -------
    list of str or int
        Names and indices; indices count from 1 in the key and from 0 in the list.

    Raises
    ------
    ValueError
        If the text is not a key.
    """
    components: list[str | int] = []
    position = 0
    while position < len(key):
        match = _COMPONENT.match(key, position)
        if match is None or len(components) == _MAX_COMPONENTS:
            raise ValueError(f"{key!r} is not a key of a case file such as contact.law.mu or steps[1].translation")
        components.append(match[1] or int(match[2]) - 1)
        position = match.end()
    return components


def checked_keys(changes: Changes) -> Changes:
    """Return the changes after checking their keys. Raises ValueError for an invalid key."""
    for key in changes:
        key_parts(key)
    return changes


CheckedChanges = Annotated[Changes, AfterValidator(checked_keys)]


def words(value: Any) -> str:
    """Return a value of a case file in one line.

    A table is its name followed by its other keys, with nested tables in brackets.
    """
    if isinstance(value, Mapping):
        items = ((key, item) for key, item in value.items() if key != "name")
        items_in_words = (
            f"{key}=({words(item)})" if isinstance(item, Mapping) else f"{key}={item}" for key, item in items
        )
        return " ".join(filter(None, [str(value.get("name", "")), *items_in_words]))
    return f"{value:g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def coordinate_of(value: Any) -> float | None:
    """Return the coordinate of a value on an axis: a number, or a text with a unit in SI units; otherwise None."""
    if isinstance(value, str):
        with suppress(ValueError):
            return float(read_quantity(value).magnitude)
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


class Table(BaseModel):
    """A table of a study file that refuses unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class RunTable(Table):
    """[[panels.runs]]: one run.

    Attributes
    ----------
    label
        Name of the run in the figure.
    set
        Changed keys.
    value
        Coordinate of the run on the axis.
    """

    label: Text
    set: CheckedChanges = Field(default_factory=dict)
    value: float | None = None


class PanelTable(Table):
    """[[panels]]: runs that are drawn together.

    Attributes
    ----------
    set
        Keys changed in all runs and in the references.
    vary, values
        Key that varies, and its values with a run for each; texts with units are converted to SI.
    runs
        Further runs, each with a label.
    axis
        Label of the axis of values.
    quantities
        As in StudyTable, which has the default.
    """

    title: Text
    set: CheckedChanges = Field(default_factory=dict)
    vary: Text | None = None
    values: tuple[Any, ...] = ()
    runs: tuple[RunTable, ...] = ()
    axis: str = ""
    quantities: dict[str, Text | float] | None = None

    @model_validator(mode="after")
    def _something_runs(self) -> "PanelTable":
        if (self.vary is None) != (not self.values):
            raise ValueError("vary and values belong together")
        if not self.values and not self.runs:
            raise ValueError("nothing to run; give vary and values, or runs")
        key_parts(self.vary or "")
        return self

    def all_runs(self) -> tuple[RunTable, ...]:
        """Return the runs of `vary` and `values`, then the others."""
        varied = (
            RunTable(label=words(value), set={self.vary: value}, value=coordinate_of(value))
            for value in self.values
            if self.vary
        )
        return (*varied, *self.runs)


class StudyTable(Table):
    """A study file.

    Attributes
    ----------
    title
        Title of the figure.
    paper
        Statement of the paper about the figure.
    case
        Case file that every run starts from, relative to the study file.
    kind
        Curves of totals over the varied value, sections along x through the middle of the zone, or maps of the zone.
    scale
        Scale of the axis of values.
    quantities
        Quantities shown, each with the number [SI] or the reference run that divides it. A nodal quantity is divided by
        its largest value in the reference run.
    references
        Changes that define the reference runs.
    panels
        The panels of the figure.
    """

    title: Text
    paper: str = ""
    case: Text
    kind: Literal["curves", "sections", "maps"]
    scale: Literal["linear", "log"] = "linear"
    quantities: dict[str, Text | float] = Field(default_factory=dict)
    references: dict[str, CheckedChanges] = Field(default_factory=dict)
    panels: tuple[PanelTable, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _quantities_are_known(self, info: ValidationInfo) -> "StudyTable":
        fields = fields_of(info)
        names = totals(fields) if self.kind == "curves" else schema.nodal(schema.View.STUDY, fields)
        for panel in self.panels:
            quantities = self.quantities_of(panel)
            if not quantities:
                raise ValueError(f"panel {panel.title!r} shows no quantities")
            for quantity, reference in quantities.items():
                if quantity not in names:
                    raise ValueError(f"quantities: unknown quantity {quantity!r}; {choices(quantity, tuple(names))}")
                if isinstance(reference, str) and reference not in self.references:
                    known = choices(reference, tuple(self.references))
                    raise ValueError(f"references: unknown reference {reference!r}; {known}")
        if self.kind == "maps" and len({tuple(self.quantities_of(panel)) for panel in self.panels}) > 1:
            raise ValueError("maps: all panels must show the same quantities")
        return self

    def quantities_of(self, panel: PanelTable) -> dict[str, str | float]:
        """Return the quantities of a panel and the scales that divide them."""
        return self.quantities if panel.quantities is None else panel.quantities


def load_study(file: Path, registry: Registry | None = None) -> tuple[StudyTable, dict[str, Any]]:
    """Return the study of a file, and the tables of its case file.

    Raises CaseError with a line for each problem.
    """
    study = checked(StudyTable, file, registry)
    return study, case_tables(file, study.case)


def case_tables(file: Path, case: str) -> dict[str, Any]:
    """Return the tables of the case file that a study file names. Raises CaseError if it is no TOML file."""
    try:
        return read_toml(file.parent / case)[1]
    except CaseError as error:
        raise CaseError(f"{file}: case: {error}") from None


def checked(model: type[Model], file: Path, registry: Registry | None = None) -> Model:
    """Return the tables of a file as a model. Raises CaseError with a line for each problem.

    registry: of the scalar fields that materials may have; by default only those of the default field set.
    """
    _, tables = read_toml(file)
    if {"material", "mesh"} <= tables.keys():
        raise CaseError(
            f"{file}: is a case file; allowed: a study file, whose key `case` names a case file (docs/howto/sweep.md)"
        )
    try:
        return model.model_validate(tables, context={"fields": MEE if registry is None else registry.fields})
    except ValidationError as error:
        problems = (_brief(problem) for problem in problems_of(error, model))
        raise CaseError(listed(f"{file}: {problem}" for problem in problems)) from None


def fields_of(info: ValidationInfo) -> FieldSet:
    """Return the field set of a validation."""
    fields: FieldSet = (info.context or {}).get("fields", MEE)
    return fields


def _brief(problem: Problem) -> Problem:
    """Return the problem without a location if it concerns the study as a whole."""
    return problem if problem.location else Problem((), problem.text)


def changed(tables: Mapping[str, Any], *changes: Changes) -> dict[str, Any]:
    """Return a copy of the tables of a case with changed keys.

    Later arguments take precedence; absent tables are created.

    Raises
    ------
    TableError
        If a key leads into something that is not a table or list, or past the end of a list.
    """
    result = deepcopy(dict(tables))
    for key, value in _items(changes):
        *path, last = key_parts(key)
        inner: Any = result
        for component in path:
            inner = _descend(inner, component, key)
        _enter(inner, last, key, deepcopy(value))
    return result


def unit_at(key: str, tables: Mapping[str, Any], registry: Registry) -> str:
    """Return the SI unit of a number at a key of a load step or of a registered object of a case.

    It is "" for pure numbers, for quantities with several possible units, and for all other keys.
    """
    *path, last = key_parts(key)
    table: Any = tables
    for component in path:
        table = table[component]
    factories = {entry.record.name: entry.record.factory for entry in registry.entries}
    name = table.get("name") if isinstance(table, Mapping) else None
    owner: Any = StepTable.of(registry.fields) if path[:1] == ["steps"] else factories.get(str(name))
    if not isinstance(owner, type):
        return ""
    unit = unit_of(get_type_hints(owner, include_extras=True).get(str(last)))
    return "" if unit == "1" or " or " in unit else unit


def _items(changes: tuple[Changes, ...]) -> Iterator[tuple[str, Any]]:
    for group in changes:
        yield from group.items()


def _descend(table: Any, component: str | int, key: str) -> Any:
    if isinstance(table, dict) and isinstance(component, str):
        return table.setdefault(component, {})
    _check_index(table, component, key)
    return table[component]


def _enter(table: Any, component: str | int, key: str, value: Any) -> None:
    if not (isinstance(table, dict) and isinstance(component, str)):
        _check_index(table, component, key)
    table[component] = value


def _check_index(table: Any, component: str | int, key: str) -> None:
    if not (isinstance(table, list) and isinstance(component, int)):
        expected = "table" if isinstance(component, str) else "list"
        actual = "a table" if isinstance(table, dict) else "a list" if isinstance(table, list) else repr(table)
        raise TableError(Problem((key,), f"leads into {actual}, not into a {expected}"))
    if component >= len(table):
        count = "is 1 entry" if len(table) == 1 else f"are {len(table)} entries"
        raise TableError(Problem((key,), f"there {count} only"))
