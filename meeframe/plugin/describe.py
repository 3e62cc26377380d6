"""Descriptions of the parameters of registered objects: names, units, allowed values and defaults."""

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
    """A key of a case file in words.

    Attributes
    ----------
    name
        Name of the key.
    unit
        SI unit, "1" for pure numbers, "" if it is not a quantity.
    allowed
        Allowed values.
    default
        Default value, or "required".
    """

    name: str
    unit: str
    allowed: str
    default: str


def find(registry: Registry, name: str) -> list[Entry]:
    """Return all entries of a name, of any kind.

    Raises
    ------
    PluginError
        For an unknown name; the message lists similar and allowed names.
    """
    entries = [entry for entry in registry.entries if entry.record.name == name]
    if not entries:
        names = sorted({entry.record.name for entry in registry.entries})
        broken = "".join(f"; {fault}" for fault in registry.broken)
        raise PluginError(f"unknown name {name!r}; {choices(name, names)}{broken}")
    return entries


def parameters(entry: Entry, registry: Registry) -> list[Parameter]:
    """Return the keys of an entry in case files; none if the factory is not a dataclass."""
    factory = entry.record.factory
    if not (isinstance(factory, type) and dataclasses.is_dataclass(factory)):
        return []
    hints = get_type_hints(factory, include_extras=True)
    fields = [field for field in dataclasses.fields(factory) if field.init]
    return [Parameter(f.name, unit_of(hints[f.name]), _allowed(hints[f.name]), _default(f, registry)) for f in fields]


def documentation(entry: Entry) -> str:
    """Return the docstring of the factory; "" if it has none."""
    factory = entry.record.factory
    text = inspect.cleandoc(getattr(factory, "__doc__", None) or "")
    generated = f"{getattr(factory, '__name__', '')}("
    return "" if text.startswith(generated) else text


def _alternatives(hint: Any) -> Iterable[Any]:
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def unit_of(hint: Any) -> str:
    """Return the SI units of a key with a type hint, "1" for pure numbers, "" if it is not a quantity."""
    metadata = (item for alternative in _alternatives(hint) for item in getattr(alternative, "__metadata__", ()))
    quantity = next((item for item in metadata if isinstance(item, Quantity)), None)
    return "" if quantity is None else " or ".join(unit or "1" for unit in quantity.units)


def _allowed(hint: Any) -> str:
    return " or ".join(_allowed_type(alternative) for alternative in _alternatives(hint))


def _allowed_type(hint: Any) -> str:
    if get_origin(hint) is Annotated:
        quantity = next((item for item in hint.__metadata__ if isinstance(item, Quantity)), None)
        if quantity is not None:
            return quantity.range or "any"
        return " ".join([_allowed(hint.__origin__), *_bounds(hint.__metadata__)])
    if get_origin(hint) is Literal:
        return " or ".join(repr(value) for value in get_args(hint))
    if get_origin(hint) is tuple:
        inner = [alternative for alternative in get_args(hint) if alternative is not Ellipsis]
        return f"list of {', '.join(_allowed(alternative) for alternative in inner)}"
    if hint in CONTRACTS:
        return f"{CONTRACTS[hint]}, name or table"
    if hint is type(None):
        return "nothing"
    return _WORDS[hint] if hint in _WORDS else str(getattr(hint, "__name__", hint))


def _bounds(metadata: Iterable[Any]) -> list[str]:
    """Return the bounds in metadata of pydantic's Field or of annotated-types."""
    items = [inner for item in metadata for inner in getattr(item, "metadata", (item,))]
    return [f"{sign} {getattr(item, name):g}" for item in items for name, sign in _SIGNS.items() if hasattr(item, name)]


def _default(field: "dataclasses.Field[Any]", registry: Registry) -> str:
    if field.default_factory is not dataclasses.MISSING:
        value = field.default_factory()
    elif field.default is not dataclasses.MISSING:
        value = field.default
    else:
        return "required"
    names = [entry.record.name for entry in registry.entries if entry.record.factory is type(value)]
    if names:
        return names[0]
    return f"{value:g}" if isinstance(value, float) else str(value)
