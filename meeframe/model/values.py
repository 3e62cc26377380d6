"""Types of the values in a case file, with units and bounds, and the base of its tables."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Final, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict, TypeAdapter, create_model

from meeframe.fields import MEE, FieldSet
from meeframe.fields.units import MAX_MAGNITUDE, Quantity
from meeframe.plugin.registry import CONTRACTS, registry_of

DEFAULT_FORMULATION: Final = "dense-bem"
DEFAULT_SOLVER: Final = "auto"
FINITE: Final = {"ge": -MAX_MAGNITUDE, "le": MAX_MAGNITUDE}

Text = Annotated[str, Strict(), Field(min_length=1)]
Flag = Annotated[bool, Strict()]
Count = Annotated[int, Strict(), Field(ge=1, le=1000)]  # a thousand per side exceeds any memory
Size = Annotated[float, Quantity("m", gt=0, lt=math.inf)]
Length = Annotated[float, Quantity("m", **FINITE)]
Angle = Annotated[float, Quantity("rad", **FINITE)]
Force = Annotated[float, Quantity("N", **FINITE)]
Moment = Annotated[float, Quantity("N m", **FINITE)]
Pressure = Annotated[float, Quantity("Pa", **FINITE)]
Time = Annotated[float, Quantity("s", gt=0, lt=math.inf)]
Ratio = Annotated[float, Quantity("", **FINITE)]

_FREE: Final = BeforeValidator(lambda value: None if value == "free" else value)
FreeLength = Annotated[Length | None, _FREE]
FreePressure = Annotated[Pressure | None, _FREE]


def by_name(contract: type, unit: str = "", default: str = "") -> BeforeValidator:
    """Return a validator that makes the object that a table names.

    Names are looked up in the registry that is the context of the validation. unit: as in that registry; default: name
    of the object whose keys a table without a name has.
    """
    return BeforeValidator(
        lambda table, info: replace(registry_of(info), unit=unit).create(CONTRACTS[contract], named(table, default))
    )


def named(table: Any, default: str) -> Any:
    """Return the table with the default name, if there is one, unless it has a name; other values unchanged."""
    return {"name": default, **table} if default and isinstance(table, Mapping) else table


Model = TypeVar("Model", bound="Table")


class Table(BaseModel):
    """Base class of all tables: frozen, without unknown keys.

    field_set: the fields of the case, in tables whose keys depend on them.
    """

    field_set: ClassVar[FieldSet] = MEE

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


def finite(unit: str) -> Any:
    """Return the type of a finite quantity in this unit."""
    return Annotated[float, Quantity(unit, **FINITE)]


def with_keys(base: type[Model], fields: FieldSet, keys: Mapping[str, Any]) -> type[Model]:
    """Return a table like `base` for the fields of a case, with further keys: their types and defaults."""
    model = create_model(base.__name__, __base__=base, __doc__=base.__doc__, **keys)
    model.field_set = fields
    return model


def _pair(check: Callable[[Any], Any]) -> BeforeValidator:
    """Return a validator that replaces one number by two equal ones, (x1, x2)."""
    return BeforeValidator(lambda value: value if isinstance(value, list | tuple) else (check(value),) * 2)


SizePair = Annotated[tuple[Size, Size], _pair(Quantity("m", gt=0, lt=math.inf).check)]
CountPair = Annotated[tuple[Count, Count], _pair(TypeAdapter(Count).validate_python)]
_GridCount = Annotated[int, Strict(), Field(ge=1, le=100_000)]
GridCountPair = Annotated[tuple[_GridCount, _GridCount], _pair(TypeAdapter(_GridCount).validate_python)]
"""Divisions of a regular grid, which the memory limits; see meeframe.mesh.half_space_mesh."""
