"""Descriptions of the parameters of registered things: names, units, allowed values, defaults."""

import dataclasses
import inspect
import types
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin, get_type_hints

from meeframe.common.errors import PluginError
from meeframe.fields.units import Quantity
from meeframe.plugin.registry import CONTRACTS, Entry, Registry
from meeframe.plugin.validation import choices

_WORDS: Final = {float: "number", int: "whole number", str: "text", bool: "true or false", Path: "path of a file"}
_SIGNS: Final = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


@dataclass(frozen=True)
class Parameter:
    """A key of a case file in words. unit: SI, "1" for pure numbers, "" for what is no quantity."""

    name: str
    unit: str
    allowed: str
    default: str


def find(registry: Registry, name: str) -> list[Entry]:
    """Return all entries of a name, of any kind; raise PluginError that lists similar and allowed names if there is
    none."""
    found = [entry for entry in registry.entries if entry.record.name == name]
    if not found:
        names = sorted({entry.record.name for entry in registry.entries})
        broken = "".join(f"; {fault}" for fault in registry.broken)
        raise PluginError(f"unknown name {name!r}; {choices(name, names)}{broken}")
    return found


def parameters(entry: Entry, registry: Registry) -> list[Parameter]:
    """Return the keys that a case file may give; none if the factory is no dataclass."""
    factory = entry.record.factory
    if not (isinstance(factory, type) and dataclasses.is_dataclass(factory)):
        return []
    hints = get_type_hints(factory, include_extras=True)
    fields = [field for field in dataclasses.fields(factory) if field.init]
    return [Parameter(f.name, _unit(hints[f.name]), _allowed(hints[f.name]), _default(f, registry)) for f in fields]


def documentation(entry: Entry) -> str:
    """Return the docstring of the factory, "" if it has none of its own."""
    factory = entry.record.factory
    text = inspect.cleandoc(getattr(factory, "__doc__", None) or "")
    generated = f"{getattr(factory, '__name__', '')}("
    return "" if text.startswith(generated) else text


def _parts(hint: Any) -> Iterable[Any]:
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def _unit(hint: Any) -> str:
    marks = [mark for part in _parts(hint) for mark in getattr(part, "__metadata__", ()) if isinstance(mark, Quantity)]
    return " or ".join(unit or "1" for mark in marks[:1] for unit in mark.units)


def _allowed(hint: Any) -> str:
    return " or ".join(_allowed_part(part) for part in _parts(hint))


def _allowed_part(hint: Any) -> str:
    if get_origin(hint) is Annotated:
        mark = next((mark for mark in hint.__metadata__ if isinstance(mark, Quantity)), None)
        if mark is not None:
            return mark.range or "any"
        return " ".join([_allowed(hint.__origin__), *_bounds(hint.__metadata__)])
    if get_origin(hint) is Literal:
        return " or ".join(repr(value) for value in get_args(hint))
    if get_origin(hint) is tuple:
        inner = [part for part in get_args(hint) if part is not Ellipsis]
        return f"list of {', '.join(_allowed(part) for part in inner)}"
    if hint in CONTRACTS:
        return f"{CONTRACTS[hint]}, name or table"
    if hint is type(None):
        return "nothing"
    return _WORDS[hint] if hint in _WORDS else str(getattr(hint, "__name__", hint))


def _bounds(marks: Iterable[Any]) -> list[str]:
    """Return the bounds of pydantic's Field or of annotated-types."""
    plain = [inner for mark in marks for inner in getattr(mark, "metadata", (mark,))]
    return [f"{sign} {getattr(mark, name):g}" for mark in plain for name, sign in _SIGNS.items() if hasattr(mark, name)]


def _default(field: "dataclasses.Field[Any]", registry: Registry) -> str:
    if field.default_factory is not dataclasses.MISSING:
        value = field.default_factory()
    elif field.default is not dataclasses.MISSING:
        value = field.default
    else:
        return "required"
    named = [entry.record.name for entry in registry.entries if entry.record.factory is type(value)]
    if named:
        return named[0]
    return f"{value:g}" if isinstance(value, float) else str(value)
