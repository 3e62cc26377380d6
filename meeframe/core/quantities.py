"""Numbers with units in case files: `Annotated[float, Quantity("m")]` takes '5 mm' or a plain SI number."""

import math
import re
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, Literal, get_args, get_origin, get_type_hints

from meeframe.core.errors import CaseError

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

BOUNDS: Final = ("gt", "ge", "lt", "le")
_PREFIXED: Final = re.compile(r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?:[eE]([-+]?[0-9]+))?\s*([A-Za-zµμ]+)\s*")
# a number, and what comes after it; and of that, powers of units by numbers of two digits, then all else in units
_NUMBER: Final = re.compile(
    r"\s*([-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?(?![\d.,_])|inf(?!\w)))\s*(?:[*·×](?!\*))?(.*)",
    re.DOTALL,
)
_FACTOR: Final = r"\s*[-+]?(?:[0-9]{1,2}(?:\.[0-9]*)?|\.[0-9]+)\s*"
_RATIO: Final = f"{_FACTOR}(?:/{_FACTOR})?"
_POWER: Final = re.compile(
    rf"(?:(?:\^|\*\*)(?>\s*(?:\({_RATIO}\)|\{{{_RATIO}\}})\s*|{_FACTOR})|⁻?[⁰¹²³⁴-⁹]{{1,2}})(?![0-9.^⁻⁰¹²³⁴-⁹]|\*\*)"
)
_UNITS: Final = re.compile(r"\s*(?:1?\s*/)?(?:[^\W\d⁰¹²³⁴-⁹]|(?<=[A-Za-z0-9])[0-9]|[\s()/*·×⋅°%.])*")
_HIGHEST: Final = 99
_PREFIXES: Final = {"": 0, "n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}


class Quantity:
    """Marks an annotated float as a quantity; the field holds SI numbers.

    unit: its SI unit, "" for pure numbers; alternatives: further SI units, for a key whose dimension depends on where
    it is used; gt, ge, lt, le: bounds in those units. Case files may give a number in SI or a text with a unit of the
    same dimension; infinity is written inf, NaN is refused.
    Example: `radius: Annotated[float, Quantity("m", gt=0)]`.
    """

    __slots__ = ("bounds", "units")

    def __init__(self, unit: str, *alternatives: str, **bounds: float) -> None:
        unknown = set(bounds) - set(BOUNDS)
        if unknown:
            raise TypeError(f"bounds of a quantity are {', '.join(BOUNDS)}, not {', '.join(sorted(unknown))}")
        self.units = (unit, *alternatives)
        self.bounds = bounds

    def __get_pydantic_core_schema__(self, source: Any, handler: "GetCoreSchemaHandler") -> "CoreSchema":
        """How pydantic validates it."""
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(self.check)

    def only(self, settled: str) -> "Quantity":
        """The same quantity where dimensions are settled on some units, with blanks between; itself if it has none."""
        fitting = [unit for unit in self.units if unit in settled.split()]
        return Quantity(fitting[0], *fitting[1:], **self.bounds) if fitting else self

    def convert(self, value: Any) -> float:
        """SI number of what a case file gives; raises ValueError for anything but a number or a text with this unit."""
        if isinstance(value, str):
            value = self._parse(value)
        elif isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"expected {self.expected}")
        if value != value:
            raise ValueError(f"is not a number (NaN); expected {self.expected}")
        return float(value)

    @property
    def expected(self) -> str:
        """What a case file may give, in words."""
        if self.units == ("",):
            return "a number without unit"
        return f"a number in {' or '.join(self.units)} or a text with such a unit"

    def check(self, value: Any) -> float:
        """convert(value) within the bounds; raises ValueError."""
        number = self.convert(value)
        holds = {"gt": number.__gt__, "ge": number.__ge__, "lt": number.__lt__, "le": number.__le__}
        if not all(holds[name](bound) for name, bound in self.bounds.items()):
            raise ValueError(f"must be {self.range}; expected {self.expected}")
        return number

    @property
    def range(self) -> str:
        """The bounds in words, "" if there are none."""
        signs = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
        finite = {name: bound for name, bound in self.bounds.items() if abs(bound) != math.inf}
        parts = [f"{signs[name]} {bound:g}" for name, bound in finite.items()]
        return " and ".join([*parts, *(["finite"] if len(finite) < len(self.bounds) else [])])

    def _parse(self, text: str) -> float:
        number = self._prefixed(text)
        if number is not None:
            return number
        try:
            quantity = read_quantity(text)
            fitting = next((unit for unit in self.units if quantity.is_compatible_with(unit)), self.units[0])
            return float(quantity.to(fitting).magnitude)
        except ValueError as error:
            raise ValueError(f"{error}; expected {self.expected}") from None
        except TypeError:  # pint's error of dimensions is one
            raise ValueError(f"has the wrong unit; expected {self.expected}") from None

    def _prefixed(self, text: str) -> float | None:
        """SI number of a text such as '5 mm', the name of one of the units behind a prefix; None for any other text."""
        match = _PREFIXED.fullmatch(text)
        if match is None:
            return None
        number, exponent, name = match.groups()
        for unit in self.units:
            prefix = name.removesuffix(unit)
            if unit.isalpha() and name.endswith(unit) and prefix in _PREFIXES:
                return float(f"{number}e{int(exponent or 0) + _PREFIXES[prefix]}")
        return None


@lru_cache(maxsize=1)
def unit_registry() -> Any:
    """The one registry of units."""
    import pint

    return pint.UnitRegistry()


def read_quantity(text: str) -> Any:
    """The quantity, of pint, that a text of one number and then units means. Raises ValueError for any other text.

    Further numbers are only powers of units, of two digits and not of each other: pint would add up, multiply "50,5"
    out to 505 and compute powers of powers without end. It can be converted to base units.
    """
    refused = ValueError("cannot be read as one number and then units")
    match = _NUMBER.fullmatch(text)
    if match is None or not _UNITS.fullmatch(_POWER.sub(" ", match[2])):
        raise refused
    units = re.sub(r"^\s*/", "1/", match[2])
    # pint takes half a second to start: imported when the first text of another kind comes along
    from pint import UndefinedUnitError

    registry = unit_registry()
    try:
        quantity = registry.Quantity(float(match[1]), registry.parse_units(units))
    except UndefinedUnitError as error:
        raise ValueError(_unknown(error.unit_names[0])) from None
    except Exception:  # pint's parser lets many kinds of errors through
        raise refused from None
    # powers of brackets multiply, and conversion raises whole numbers such as 60 to them
    if any(abs(power) > _HIGHEST for _, power in quantity.unit_items()):
        raise refused
    try:
        quantity.to_base_units()
    except Exception:  # decibels in products, factors beyond what floats hold
        raise refused from None
    return quantity


def _unknown(name: str) -> str:
    """That there is no unit of this name, with another where it has an exponent without sign or other capitals."""
    registry = unit_registry()
    stem = name.rstrip("0123456789")
    found = [f"{stem}^{name[len(stem) :]}"] if stem in registry else []
    for prefix, unit, _ in registry.parse_unit_name(name, case_sensitive=False):
        unit = registry.Unit(prefix + unit)
        found += [same for same in (f"{unit:~}", f"{unit}") if same.lower() == name.lower()]
    return f"unknown unit {name!r}" + (f"; did you mean {found[0]!r}?" if found else "")


def check_quantities(record: Any) -> None:
    """For __post_init__ of a frozen dataclass made in Python: the checks that a case file's entries get.

    Quantities become SI numbers within their bounds, choices (Literal) are among the allowed. Raises CaseError.
    """
    for name, hint in get_type_hints(type(record), include_extras=True).items():
        value = getattr(record, name)
        try:
            for mark in getattr(hint, "__metadata__", ()):
                if isinstance(mark, Quantity):
                    object.__setattr__(record, name, mark.check(value))
            if get_origin(hint) is Literal and value not in get_args(hint):
                raise ValueError(f"allowed: {', '.join(map(str, get_args(hint)))}")
        except ValueError as error:
            raise CaseError(f"{type(record).__name__}: {name} = {value!r}: {error}") from None
