"""Numbers with units in case files: `Annotated[float, Quantity("m")]` accepts '5 mm' or a plain SI number."""

import math
import re
from decimal import Decimal
from functools import cache, lru_cache
from numbers import Real
from types import NoneType
from typing import TYPE_CHECKING, Any, Final, Literal, get_args, get_origin, get_type_hints

from meeframe.common.errors import CaseError

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

BOUNDS: Final = ("gt", "ge", "lt", "le")
# a number; a sign between, or the 1 of "1/mm"; allowed characters of units, since pint skips those it does not know
# possessive matching: with backtracking, blanks or digits without end would take the square of their number
_TEXT: Final = re.compile(
    r"\s*+((?:[-+]?(?:[0-9]++\.?+[0-9]*+|\.[0-9]++)(?:[eE][-+]?[0-9]{1,3})?+|[-+]?inf(?!\w))(?![\d.,_]))"
    r"\s*+(?:[*·×](?!\*)|1?\s*+(?=/))?(?!\s*+\d)([\w\s()*/^.·×⋅{}%°+⁻-]*+)"
)
_MAX_UNITS: Final = 200
"""Largest number of characters of units; pint takes the square of their number."""
_DIGITS: Final = 20
"""Number of digits of rounded exponents: a decimal third has 28, and three of them do not add up to one."""
_OTHER: Final = "cannot be read as one number and then units"
_SCALE: Final = "names a scale whose zero is not that of the unit; temperatures count from the reference, so give K"
_PREFIXES: Final = {"": 0, "n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}

MAX_MAGNITUDE: Final = 1e60
"""Largest magnitude of finite quantities and material constants in SI units; products of some stay finite."""
MIN_MAGNITUDE: Final = 1e-60
"""Smallest magnitude of positive quantities, moduli and the like in SI units; products of some do not vanish."""


class Quantity:
    """Annotation of a float as a quantity; the field holds numbers in SI units.

    Case files may give a number in SI units or a text with a unit of the same dimension; infinity is written inf, and
    NaN is refused. Example: `radius: Annotated[float, Quantity("m", gt=0)]`.

    Parameters
    ----------
    unit : str
        The SI unit, "" for pure numbers.
    *alternatives : str
        Further SI units, for a key whose dimension depends on its use.
    **bounds : float
        Bounds gt, ge, lt and le in these units.

    Raises
    ------
    TypeError
        For a bound of another name.
    """

    __slots__ = ("bounds", "units")

    def __init__(self, unit: str, *alternatives: str, **bounds: float) -> None:
        unknown = set(bounds) - set(BOUNDS)
        if unknown:
            raise TypeError(f"bounds of a quantity are {', '.join(BOUNDS)}, not {', '.join(sorted(unknown))}")
        self.units = (unit, *alternatives)
        self.bounds = bounds

    def __get_pydantic_core_schema__(self, source: Any, handler: "GetCoreSchemaHandler") -> "CoreSchema":
        """Return the validation of a quantity by pydantic."""
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(self.check)

    def only(self, settled: str) -> "Quantity":
        """Return the quantity restricted to some units.

        Parameters
        ----------
        settled : str
            The units, separated by blanks.

        Returns
        -------
        Quantity
            The restricted quantity, or the quantity itself if it has none of these units.
        """
        fitting = [unit for unit in self.units if unit in settled.split()]
        return Quantity(fitting[0], *fitting[1:], **self.bounds) if fitting else self

    def convert(self, value: Any) -> float:
        """Return the SI number of a value of a case file.

        Parameters
        ----------
        value : object
            A number or a text with a unit.

        Returns
        -------
        float
            The number in SI units.

        Raises
        ------
        ValueError
            If it is neither a number nor a text with a unit of this dimension.
        """
        if isinstance(value, str):
            value = self._parse(value)
        elif isinstance(value, bool) or not isinstance(value, Real):
            raise ValueError(f"expected {self.expected}")
        if value != value:
            raise ValueError(f"is not a number (NaN); expected {self.expected}")
        try:
            return float(value)
        except OverflowError:
            raise ValueError(f"is too large; expected {self.expected}") from None

    @property
    def expected(self) -> str:
        """Description of the accepted values in a case file."""
        if self.units == ("",):
            return "a number without unit"
        return f"a number in {' or '.join(self.units)} or a text with such a unit"

    def check(self, value: Any) -> float:
        """Return the SI number of a value of a case file after checking its bounds.

        Parameters
        ----------
        value : object
            A number or a text with a unit.

        Returns
        -------
        float
            The number in SI units.

        Raises
        ------
        ValueError
            As `convert`, and if the number is out of bounds.
        """
        number = self.convert(value)
        holds = {"gt": number.__gt__, "ge": number.__ge__, "lt": number.__lt__, "le": number.__le__}
        if not all(holds[name](bound) for name, bound in self.bounds.items()):
            raise ValueError(f"must be {self.range}; expected {self.expected}")
        smallest = MIN_MAGNITUDE if self.bounds.get("gt") == 0 else 0.0
        if not smallest <= abs(number) <= MAX_MAGNITUDE and math.isfinite(number):
            size = "small" if abs(number) < smallest else "large"
            allowed = f"magnitudes from {smallest:g} to {MAX_MAGNITUDE:g} {self.units[0]}".rstrip()
            raise ValueError(f"is too {size} to compute with; allowed: {allowed}")
        return number

    @property
    def range(self) -> str:
        """Bounds in words, "" if there are none."""
        signs = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
        finite = {name: bound for name, bound in self.bounds.items() if abs(bound) != math.inf}
        bounds = [f"{signs[name]} {bound:g}" for name, bound in finite.items()]
        return " and ".join([*bounds, *(["finite"] if len(finite) < len(self.bounds) else [])])

    def _parse(self, text: str) -> float:
        number = self._prefixed(text)
        if number is not None:
            return number
        try:
            quantity = read_quantity(text)
        except ValueError as error:
            raise ValueError(f"{error}; expected {self.expected}") from None
        for unit in self.units:
            one = _in_base_units(unit_registry().Quantity(Decimal(1), unit))
            # angles have no dimension either; a pure number is a slope or its angle, and friction is the slope
            if one.dimensionality == quantity.dimensionality and (unit or quantity.unitless):
                return float(quantity.magnitude / one.magnitude)
        what = "has no unit" if quantity.unitless else "has the wrong unit"
        raise ValueError(f"{what}; expected {self.expected}")

    def _prefixed(self, text: str) -> float | None:
        """Return the SI number of a text such as '5 mm', one unit with a prefix; None for any other text."""
        match = _TEXT.fullmatch(text)
        if match is None:
            return None
        name = match[2].strip()
        for unit in self.units:
            prefix = name.removesuffix(unit)
            if unit.isalpha() and name.endswith(unit) and prefix in _PREFIXES:
                number = float(Decimal(match[1]).scaleb(_PREFIXES[prefix]))
                return number if math.isfinite(number) else None
        return None


@lru_cache(maxsize=1)
def unit_registry() -> Any:
    """Return the common registry of units, with decimal numbers.

    Powers of powers overflow at once with decimal numbers, and never with int.
    """
    # pint takes half a second to start: imported at the first text of another kind
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


def read_quantity(text: str) -> Any:
    """Return the quantity, of pint and in base units, of a text that is one number followed by units.

    Raises ValueError for any other text. The units contain no further numbers than powers: pint would evaluate sums,
    and multiply "50,5" out to 505. The magnitude is a Decimal.
    """
    match = _TEXT.fullmatch(text)
    if match is None or len(match[2]) > _MAX_UNITS:
        raise ValueError(_OTHER)
    registry, number = unit_registry(), Decimal(match[1])
    try:
        units = registry.parse_units(re.sub(r"^\s*/", "1/", match[2]))
        quantity = _in_base_units(registry.Quantity(number, units))
        finite = math.isfinite(float(quantity.magnitude))
        zero = registry.Quantity(Decimal(0), units).to_base_units().magnitude
    except Exception as error:  # pint raises many kinds of exceptions
        name = next(iter(getattr(error, "unit_names", ())), "")
        raise ValueError(_unknown(name) if name and name in text else _OTHER) from None
    if zero:  # degC and degF; 1/degC is a difference
        raise ValueError(_SCALE)
    if number.is_finite() and not finite:
        raise ValueError(_OTHER)
    return quantity


def _in_base_units(quantity: Any) -> Any:
    """Return a quantity of pint in base units, with exponents free of the round-off of fractions."""
    base = quantity.to_base_units()
    rounded = {name: _rounded(Decimal(power)) for name, power in base.unit_items()}
    units = unit_registry().UnitsContainer({name: power for name, power in rounded.items() if power})
    return unit_registry().Quantity(base.magnitude, units)


def _rounded(power: Decimal) -> Decimal:
    return round(power, _DIGITS).normalize() if abs(power) < 1e6 else power  # more digits than decimals have


def _unknown(name: str) -> str:
    """Return the message for an unknown unit, with a suggestion where exponent or capitals differ.

    The suggestion has an exponent without sign or other capitals.
    """
    registry = unit_registry()
    stem = name.rstrip("0123456789")
    result = [f"{stem}^{name[len(stem) :]}"] if stem in registry else []
    for prefix, unit, _ in registry.parse_unit_name(name, case_sensitive=False):
        unit = registry.Unit(prefix + unit)
        result += [same for same in (f"{unit:~}", f"{unit}") if same.lower() == name.lower()]
    return f"unknown unit {name!r}" + (f"; did you mean {result[0]!r}?" if result else "")


@cache
def _hints_of(kind: type) -> dict[str, Any]:
    """Return the types of the fields of a class; laws are made thousands of times in a solution."""
    return get_type_hints(kind, include_extras=True)


def check_quantities(record: Any) -> None:
    """Check the quantities of a frozen dataclass like entries of a case file.

    Call it in `__post_init__`. Quantities become SI numbers; optional ones may be None.

    Parameters
    ----------
    record : object
        The dataclass instance.

    Raises
    ------
    CaseError
        If a quantity is not valid or out of bounds, or if a Literal is none of the allowed values.
    """
    for name, hint in _hints_of(record.__class__).items():
        value = getattr(record, name)
        if NoneType in get_args(hint):
            if value is None:
                continue
            hint = next(kind for kind in get_args(hint) if kind is not NoneType)
        try:
            for mark in getattr(hint, "__metadata__", ()):
                if isinstance(mark, Quantity):
                    object.__setattr__(record, name, mark.check(value))
            if get_origin(hint) is Literal and value not in get_args(hint):
                raise ValueError(f"allowed: {', '.join(map(str, get_args(hint)))}")
        except ValueError as error:
            raise CaseError(f"{type(record).__name__}: {name} = {value!r}: {error}") from None
