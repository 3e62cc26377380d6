"""Conversion of case-file tables to objects, and of pydantic's errors to located messages."""

import dataclasses
import types
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import date, time
from functools import lru_cache
from typing import Annotated, Any, Final, Union, get_args, get_origin, get_type_hints

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    PydanticUserError,
    Strict,
    ValidationError,
    ValidationInfo,
    create_model,
)

from meeframe.common.arguments import most_similar
from meeframe.common.errors import MAX_PROBLEMS, CaseError, MeeframeError, listed
from meeframe.common.renamed import RENAMED, renaming
from meeframe.fields import ELECTRIC_FIELD, THERMAL_FIELD
from meeframe.fields.units import Quantity
from meeframe.plugin.aliases import ALIASES, names_for
from meeframe.plugin.sources import faults_of_plugins

Converters = Callable[[Any], Callable[[Any, ValidationInfo], Any] | None]
"""Function that returns, for a type hint, the converter of table values to it; None if pydantic needs no converter.

Models are kept for each of these functions, so that converters take what differs between calls from the context.
"""

_MISSING = object()
_MAX_INTEGER: Final = 10**300  # larger integers cannot be converted to float
_CONFIG = ConfigDict(extra="forbid", arbitrary_types_allowed=True, frozen=True)

_HEAT: Final = {
    getattr(THERMAL_FIELD, attribute): getattr(ELECTRIC_FIELD, attribute)
    for attribute in ("name", "value_name", "flux_name", "resultant")
}
"""Keys of the temperature, which tables of bodies without heat lack, and of the electric field in the same tables."""

# texts for errors of pydantic whose messages use terms of Python instead of TOML
_TEXTS = {
    "dict_type": "should be a table",
    "model_type": "should be a table",
    "dataclass_type": "should be a table",
    "tuple_type": "should be a list",
    "too_short": "should not be empty",
    "too_long": "should have {max_length} entries",
    "string_type": "should be a text",
    "string_too_short": "should not be empty",
    "int_type": "should be a whole number",
    "int_from_float": "should be a whole number",
    "bool_type": "should be true or false",
}


@dataclass(frozen=True)
class Problem:
    """One invalid entry.

    Attributes
    ----------
    location
        Keys from the outermost table inwards.
    text
        Description of the allowed values.
    value
        The invalid value.
    unknown
        Whether it is a name that is not registered.
    cause
        Exception in the code of a plugin that caused the problem, if any.
    """

    location: tuple[str | int, ...]
    text: str
    value: Any = _MISSING
    unknown: bool = False
    cause: BaseException | None = dataclasses.field(default=None, compare=False)

    def inside(self, *outer: str | int) -> "Problem":
        """Return the problem with its location relative to an enclosing table."""
        return replace(self, location=(*outer, *self.location))

    def quoting(self, tables: Mapping[str, Any]) -> "Problem":
        """Return the problem with the value at its location in the tables, if there is one."""
        value: Any = tables
        try:
            for key in self.location:
                value = value[key]
        except (LookupError, TypeError):
            return self
        return self if self.value is _MISSING else replace(self, value=value)

    def __str__(self) -> str:
        path = ""
        for key in self.location:
            path += f"[{key + 1}]" if isinstance(key, int) else f".{key}"
        if not path:
            return self.text if self.value is _MISSING else f"{self.text}, not {_brief(self.value)}"
        assignment = "" if self.value is _MISSING else f" = {_brief(self.value)}"
        return f"{path.lstrip('.')}{assignment}: {self.text}"


class TableError(CaseError, ValueError):  # a ValueError passes through validators of pydantic
    """A table has invalid entries, listed in `problems`; `__cause__` is the first cause among them."""

    def __init__(self, *problems: Problem) -> None:
        super().__init__(listed(problems, "; "))
        self.problems = problems
        self.__cause__ = next((problem.cause for problem in problems if problem.cause is not None), None)


def build(
    factory: Callable[..., Any],
    table: Mapping[str, Any],
    converters: Converters = lambda _hint: None,
    other_keys: tuple[str, ...] = (),
    unit: str = "",
    context: object = None,
) -> Any:
    """Return factory(**table) after checking every entry against the fields of the dataclass `factory`.

    Parameters
    ----------
    factory
        The dataclass.
    table
        Entries of the table.
    converters
        Converters for types unknown to pydantic.
    other_keys
        Further keys that the table can contain, listed in messages on unknown keys.
    unit
        The only accepted unit of quantities that allow it among others.
    context
        Context of the validation, for the converters.

    Raises
    ------
    TableError
        With the location of each problem.
    """
    try:
        model = _model(factory, converters, unit)
    except (NameError, TypeError, PydanticUserError) as error:
        raise TableError(Problem((), f"its class {factory!r} cannot be used: {error}", cause=error)) from error
    try:
        checked = model.model_validate(dict(table), context=context)
    except ValidationError as error:
        raise TableError(*problems_of(error, model, other_keys)) from None
    try:
        with faults_of_plugins(ValueError):
            return factory(**{name: getattr(checked, name) for name in checked.model_fields_set})
    except (MeeframeError, ValueError) as error:
        raise TableError(Problem((), str(error), cause=error.__cause__)) from error.__cause__


@lru_cache(maxsize=256)
def _model(factory: Callable[..., Any], converters: Converters, unit: str) -> type[BaseModel]:
    if not (isinstance(factory, type) and dataclasses.is_dataclass(factory)):
        return create_model("NoKeys", __config__=_CONFIG)
    hints = get_type_hints(factory, include_extras=True)
    fields: dict[str, Any] = {}
    for field in dataclasses.fields(factory):
        if not field.init:
            continue
        # the dataclass supplies defaults: only keys in the table are passed on
        required = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        fields[field.name] = (_strict(_with_unit(hints[field.name], unit), converters), ... if required else None)
    return create_model(factory.__name__, __config__=_CONFIG, **fields)


def _with_unit(hint: Any, unit: str) -> Any:
    """Return the hint with every quantity restricted to a unit if it allows this unit."""
    if get_origin(hint) is Annotated:
        marks = [mark.only(unit) if isinstance(mark, Quantity) else mark for mark in hint.__metadata__]
        return Annotated[(hint.__origin__, *marks)]
    if get_origin(hint) in (Union, types.UnionType):
        return Union[tuple(_with_unit(alternative, unit) for alternative in get_args(hint))]  # noqa: UP007  # alternatives known at run time
    return hint


def _strict(hint: Any, converters: Converters) -> Any:
    """Return the hint without silent conversions: true is not a number, 3.0 not an integer, 5 not a text."""
    convert = converters(hint)
    if convert is not None:
        return Annotated[hint, BeforeValidator(convert)]
    if hint in (int, bool, str):
        return Annotated[hint, Strict()]
    if hint is float:
        return Annotated[float, Strict(), BeforeValidator(_no_nan)]
    if get_origin(hint) is Annotated and hint.__origin__ in (int, bool, str):
        return Annotated[hint, Strict()]
    if get_origin(hint) in (Union, types.UnionType):
        return Annotated[
            Any, BeforeValidator(_one_of([_strict(alternative, converters) for alternative in get_args(hint)]))
        ]
    return hint


def _one_of(hints: list[Any]) -> Callable[[Any, ValidationInfo], Any]:
    """Return the validator of a union, whose message lists what all alternatives allow.

    The validator of pydantic gives one error for each alternative.
    """
    models = [
        create_model("Alternative", __config__=_CONFIG, alternative=(hint, ...))
        for hint in hints
        if hint is not type(None)
    ]

    def choose(value: Any, info: ValidationInfo) -> Any:
        if value is None and len(models) < len(hints):
            return None
        problems: list[Problem] = []
        for model in models:
            try:
                return model.model_validate({"alternative": value}, context=info.context).alternative  # type: ignore[attr-defined]
            except ValidationError as error:
                problems += problems_of(error, model)
        inner = [replace(problem, location=problem.location[1:]) for problem in problems if len(problem.location) > 1]
        if inner:
            raise TableError(*inner)
        raise ValueError("; or ".join(problem.text for problem in problems))

    return choose


def _no_nan(value: Any) -> Any:
    if isinstance(value, float) and value != value:
        raise ValueError("is not a number (NaN)")
    return value


def problems_of(error: ValidationError, model: type[BaseModel], other_keys: tuple[str, ...] = ()) -> list[Problem]:
    """Return the located problems of a pydantic error, including those of nested tables.

    Unknown keys come first, as they often are misspelt missing keys. Those after the first `MAX_PROBLEMS`, which no
    message shows, have no suggestions: these take far longer than all else.

    Parameters
    ----------
    error
        The error.
    model
        The pydantic model of the table.
    other_keys
        Further keys that the table can contain.
    """
    items = sorted(error.errors(), key=lambda item: item["type"] != "extra_forbidden")
    # pydantic also calls a list too short if its entries are wrong
    wrong_lists = {item["loc"][: len(item["loc"]) - k] for item in items for k in range(1, len(item["loc"]))}
    items_to_report = [item for item in items if item["type"] != "too_short" or item["loc"] not in wrong_lists]
    return [
        problem
        for number, item in enumerate(items_to_report)
        for problem in _problems(item, model, other_keys, number < MAX_PROBLEMS)
    ]


def _problems(item: Any, model: type[BaseModel], other_keys: tuple[str, ...], suggests: bool) -> Iterator[Problem]:
    location, kind, value = tuple(item["loc"]), item["type"], item["input"]
    inner = item.get("ctx", {}).get("error")
    if isinstance(inner, TableError):
        for problem in inner.problems:
            yield problem.inside(*location)
    elif kind == "extra_forbidden":
        yield Problem(location, _unknown_key(location, model, other_keys) if suggests else "unknown key", value)
    elif kind == "missing":
        yield Problem(location, "missing key" if isinstance(location[-1], str) else "missing entry")
    elif kind == "value_error":
        yield Problem(location, str(inner), value)
    elif kind == "tuple_type" and isinstance(value, Mapping) and _model_in(_hint_at(location, model)):
        header = ".".join(key for key in location if isinstance(key, str))
        yield Problem(location, f"should be a list of tables, each under a header [[{header}]]", value)
    else:
        text = item["msg"].replace("Input should", "should", 1)
        yield Problem(location, _TEXTS[kind].format(**item.get("ctx", {})) if kind in _TEXTS else text, value)


def _unknown_key(location: tuple[str | int, ...], model: type[BaseModel], other_keys: tuple[str, ...]) -> str:
    """Return the message for an unknown key: its new name if it was renamed, else the allowed keys."""
    current = _model_in(_hint_at(location[:-1], model))
    fields = {} if current is None else current.model_fields
    keys = [*(field.alias or key for key, field in fields.items()), *other_keys]
    return f"unknown key; {choices(str(location[-1]), keys) if keys else 'no keys are allowed here'}"


def choices(name: str, names: Collection[str]) -> str:
    """Return 'did you mean ...? allowed: ...' for an unknown name, or its new name if it was renamed.

    Parameters
    ----------
    name
        The unknown name.
    names
        Allowed names. Those for which `name` is another term, or that have it as a word, or else the most similar one,
        are suggested.
    """
    if RENAMED.get(str(name)) in names:
        return renaming(str(name))
    close = names_for(str(name), names) or [other for other in names if str(name) in other.split("-")]
    if not close:
        terms = [*names, *(term for term in ALIASES if names_for(term, names))]
        similar = most_similar(str(name), terms)
        if similar is not None:
            close = [similar] if similar in names else names_for(similar, names)
    hint = f"did you mean {' or '.join(map(repr, close))}? " if close else ""
    if _HEAT.get(str(name)) in names:
        hint = "it needs a material with thermal_conductivity; otherwise "
    return f"{hint}allowed: {', '.join(names) or 'none'}"


def field_choices(name: str, names: Collection[str]) -> str:
    """Return `choices` for an unknown name of a field; also the new name of one that cannot be chosen any more."""
    if name in RENAMED and RENAMED[name] not in names:
        return f"{renaming(name)}, which cannot be chosen here; allowed: {', '.join(names)}"
    return choices(name, names)


def _hint_at(location: tuple[str | int, ...], model: type[BaseModel]) -> Any:
    """Return the type hint at a location in nested pydantic models; None if there is none."""
    hint: Any = model
    for key in location:
        if isinstance(key, str):
            field = getattr(_model_in(hint), "model_fields", {}).get(key)
            hint = field and field.annotation
    return hint


def _model_in(hint: Any) -> type[BaseModel] | None:
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        return hint
    return next((nested for alternative in get_args(hint) if (nested := _model_in(alternative)) is not None), None)


def _brief(value: Any) -> str:
    if isinstance(value, date | time):
        return value.isoformat()  # as in TOML
    if isinstance(value, float | int) and not isinstance(value, bool) and abs(value) < _MAX_INTEGER:
        text = f"{value:.12g}"
        return f"{text}.0" if isinstance(value, float) and text.lstrip("-").isdigit() else text
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
