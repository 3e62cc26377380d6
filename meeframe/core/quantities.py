"""Numbers with units in case files: `Quantity("m")` annotates a field that takes '5 mm' or a plain SI number."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import pint
from pydantic import BeforeValidator, Field


@lru_cache(maxsize=1)
def unit_registry() -> Any:
    """The one registry of units."""
    return pint.UnitRegistry()


@dataclass(frozen=True)
class Unit:
    """Marks an annotated field with its SI unit, for documentation."""

    symbol: str


def Quantity(unit: str, **bounds: Any) -> Any:
    """Annotated float in a unit: plain numbers are SI, text such as '5 mm' is converted. bounds as of pydantic.Field.

    Infinity is written inf, NaN is refused. Example: `radius: Quantity("m", gt=0)`.
    """

    def convert(value: Any) -> Any:
        if isinstance(value, bool):
            raise ValueError(f"expected a number or a text with a unit of {unit or 'none'}")
        if isinstance(value, str):
            value = _parse(value, unit)
        if isinstance(value, int | float) and value != value:
            raise ValueError("not a number (NaN)")
        return value

    return Annotated[float, BeforeValidator(convert), Field(**bounds), Unit(unit)]


def _parse(text: str, unit: str) -> float:
    wanted = unit or "dimensionless"
    try:
        quantity: Any = unit_registry().Quantity(text)
        return float(quantity.to(unit_registry().Unit(unit)).magnitude)
    except pint.DimensionalityError:
        raise ValueError(f"{text!r} is not in units of {wanted}") from None
    except (pint.UndefinedUnitError, pint.DefinitionSyntaxError, ValueError, TypeError, AttributeError):
        raise ValueError(f"{text!r} is not a number with a unit; wanted units of {wanted}") from None
