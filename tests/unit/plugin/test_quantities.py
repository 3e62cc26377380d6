"""Test quantities: numbers with units in case files."""

import math
import re
from typing import Annotated

import pytest
from pydantic import TypeAdapter, ValidationError

from meeframe.fields.units import Quantity, unit_registry
from meeframe.study.declare import coordinate_of

LENGTH = TypeAdapter(Annotated[float, Quantity("m", gt=0)])


@pytest.mark.parametrize(
    ("quantity", "metres"),
    [
        (2, 2.0),
        (0.5, 0.5),
        ("5 mm", 5e-3),
        ("3 um", 3e-6),
        ("1e-4 m", 1e-4),
        ("2 inch", 0.0508),
        (math.inf, math.inf),
        ("2e4 mm^2/m", 0.02),
        ("3 1/km^-1", 3e3),
    ],
)
def test_numbers_and_texts(quantity, metres):
    assert LENGTH.validate_python(quantity) == pytest.approx(metres, rel=1e-12)


@pytest.mark.parametrize("unit", ["m", "rad", "s", "N", "Pa", "V", "A", "C", "Wb"])
@pytest.mark.parametrize("prefix", ["", *"nuµμmckMG"])
@pytest.mark.parametrize("number", ["50", "-2.5", ".5e-3 ", "+7.E2"])
def test_prefixes_match_pint(unit, prefix, number):
    """Common units are read without pint, whose import is slow."""
    text = f"{number}{prefix}{unit}"
    expected = unit_registry().Quantity(text).to_base_units()
    assert expected.check(unit)
    assert Quantity(unit).convert(text) == pytest.approx(float(expected.magnitude), rel=1e-15)


@pytest.mark.parametrize(("unit", "quantity", "number"), [("m/s", "2 mm/s", 2e-3), ("N m", "2 mN m", 2e-3)])
def test_prefixes_of_compound_units(unit, quantity, number):
    assert Quantity(unit).convert(quantity) == pytest.approx(number, rel=1e-12)


@pytest.mark.parametrize(("unit", "quantity"), [("", "inf"), ("m", "inf m"), ("Pa", "+inf GPa"), ("1/m", "inf / mm")])
def test_infinity(unit, quantity):
    assert Quantity(unit).convert(quantity) == float("inf")


def test_scales_of_temperature_are_refused_and_their_degrees_are_not():
    for text in ("100 degC", "0 celsius", "212 degF"):
        with pytest.raises(ValueError, match="names a scale whose zero"):
            Quantity("K").convert(text)
    assert Quantity("W/m/K").convert("40 W/m/degC") == Quantity("1/K").convert("40 1/degC") == 40.0
    assert Quantity("K").convert("5 delta_degC") == 5.0


def test_prefixed_numbers_are_correctly_rounded():
    assert [Quantity("m").convert(f"{number} um") for number in (3, 0.7, 50)] == [3e-6, 0.7e-6, 50e-6]


@pytest.mark.parametrize(
    ("unit", "quantity", "number"),
    [
        ("m^2/s^2", "5 (mm/s)^2", 5e-6),
        ("Pa", "5 N/(mm)^2", 5e6),
        ("1/m^2", "5 mm^(-2)", 5e6),
        ("1/m^2", "5 mm**(-2)", 5e6),
        ("1/m^3", "5 cm^{-3}", 5e6),
        ("m^2", "5 mm^+2", 5e-6),
        ("m^2", "5 mm²", 5e-6),
        ("1/m^2", "5 (mm)⁻²", 5e6),
        ("Pa m^.5", "5 MPa m^(1/2)", 5e6),
        ("m^0.5", "5 m^.5", 5.0),
        ("m^12", "5 dm^12", 5e-12),
        ("m", "5 (m^(1/3))^3", 5.0),
        ("m", "5 (mm^3)^(1/3)", 5e-3),
        ("m", "5 m (mm^(1/3))^3 (mm^(1/3))^-3", 5.0),
        ("J^(1/3)", "5 kg^(1/3) m^(2/3) s^(-2/3)", 5.0),
        ("Pa", "2 cmH2O", 196.133),
        ("Pa", "2 inH2O", 498.17782),
        ("S/m^2", "inf S/m^2", math.inf),
        ("N m", "5 N.mm", 5e-3),
        ("N m", "5 N·mm", 5e-3),
        ("m", "5 * mm", 5e-3),
        ("1/m", "5 /mm", 5e3),
        ("rad", "0.5 pi rad", math.pi / 2),
        ("rad", "0.3", 0.3),
        ("rad", "5 mm/m", 5e-3),
        ("rad", "10 %", 0.1),
        ("", "50 %", 0.5),
    ],
)
def test_units_of_many_kinds(unit, quantity, number):
    """Expected values are computed manually; a column of water at 4 degrees exerts 98.0665 Pa per centimetre."""
    assert Quantity(unit).convert(quantity) == pytest.approx(number, rel=1e-5)


NEITHER = [
    *("mm", "inf2 mm", "50,5 mm", "1,000 mm", "1_000 mm", "- 5 mm", "1/2 mm", "5٥ mm", "5⅓ mm", "5 mm!", "5 mm 2"),
    *("5 1 mm", "5 2 mm/2", "5 mm # 3", "5 mm = 3", "5 mm +/- 1 mm", "5 -mm", "5 1/2 mm"),
    *("1e400 m", "1e310 km", "1e9999 m", "1e99999999999999999999 inch"),
    *("5 mm + 3 mm", "5 mm - um", "2 * 5 mm", "5 * 1e-3 m", "5² mm", "9⁹⁹⁹⁹⁹⁹⁹⁹ m", "9**9**9**9 mm"),
    *("1 m**9**9**9**9", "1 m^(9^9^9^9)", "1 m^(9)^9^9^9", "1 m^9⁹⁹⁹⁹⁹⁹⁹", "1 (9)^99999999 m"),
]
"""What pint would make of these is something else, or never ends."""


@pytest.mark.parametrize("quantity", NEITHER)
def test_quantities_are_one_number_followed_by_units(quantity):
    with pytest.raises(ValidationError, match="cannot be read as one number and then units; expected a number in m"):
        LENGTH.validate_python(quantity)
    assert coordinate_of(quantity) is None


def test_long_texts_are_read_in_linear_time():
    """Quadratic time in the number of blanks or digits would take minutes."""
    many = 100_000
    assert LENGTH.validate_python("5" + " " * many + "mm" + " " * many) == 5e-3
    for quantity in ("5" + " " * many, "5" + " " * many + "!", "5" * many + "!", "5 1" + " " * many + "/mm!"):
        with pytest.raises(ValidationError):
            LENGTH.validate_python(quantity)


@pytest.mark.parametrize(
    "quantity",
    ["20 dBm/m", "1 (km^99)^99", "1 (minute^99)^99", "1 ((((minute^99)^99)^99)^99)^99", "1 hour^99"],
)
def test_overflowing_powers_and_products(quantity):
    """pint raises various errors, or returns infinity."""
    with pytest.raises(ValueError, match="cannot be read as one number and then units; expected a number in m"):
        Quantity("m").convert(quantity)
    assert coordinate_of(quantity) is None


@pytest.mark.parametrize(
    ("quantity", "message"),
    [
        ("5 Gpa", "unknown unit 'Gpa'; did you mean 'GPa'?; expected a number in Pa"),
        ("5 N/mm2", "unknown unit 'mm2'; did you mean 'mm^2'?; expected"),
        ("5 Newton/m^2", "unknown unit 'Newton'; did you mean 'newton'?; expected"),
        ("5 mmm", "unknown unit 'mmm'; expected"),
        ("5 foo123", "unknown unit 'foo123'; expected"),
    ],
)
def test_unknown_units(quantity, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        Quantity("Pa").convert(quantity)
    assert coordinate_of(quantity) is None


@pytest.mark.parametrize(
    ("quantity", "position"), [("5 mm", 5e-3), ("2 N/(mm)^2", 2e6), ("30", 30.0), ("inf m", math.inf)]
)
def test_values_on_axes_are_read_alike(quantity, position):
    assert coordinate_of(quantity) == pytest.approx(position)


@pytest.mark.parametrize("quantity", ["5 V", "1 (m^10)^10", "1 m⁹⁹⁹⁹⁹⁹⁹⁹^99"])
def test_units_of_another_dimension(quantity):
    with pytest.raises(ValidationError, match="has the wrong unit; expected a number in m"):
        LENGTH.validate_python(quantity)


@pytest.mark.parametrize("quantity", ["5", "inf", "30 %"])
def test_texts_without_a_unit(quantity):
    with pytest.raises(ValidationError, match="has no unit; expected a number in m or a text with such a unit"):
        LENGTH.validate_python(quantity)


@pytest.mark.parametrize("quantity", ["17 deg", "95 deg", "-5 deg", "inf deg", "1 rad", "1 sr"])
def test_angles_are_rejected_as_pure_numbers(quantity):
    """A friction coefficient is the tangent of the friction angle: 0.306 for 17 degrees, not 0.297."""
    with pytest.raises(ValueError, match="has the wrong unit; expected a number without unit"):
        Quantity("", ge=0).check(quantity)


@pytest.mark.parametrize("quantity", ["5", "mm mm?", "", "nan m", "-1 mm", math.nan, True, None, [1.0], 0])
def test_invalid_quantities_are_rejected(quantity):
    with pytest.raises(ValidationError):
        LENGTH.validate_python(quantity)


def test_texts_are_never_evaluated():
    with pytest.raises(ValidationError, match="cannot be read"):
        LENGTH.validate_python("__import__('os').getcwd()")


def test_unknown_bounds_raise_type_error():
    with pytest.raises(TypeError, match="minimum"):
        Quantity("m", minimum=0)
