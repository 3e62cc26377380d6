"""Quantities: what case files may write for a number with a unit."""

import math
from typing import Annotated

import pytest
from pydantic import TypeAdapter, ValidationError

from meeframe.core.quantities import Quantity

LENGTH = TypeAdapter(Annotated[float, Quantity("m", gt=0)])


@pytest.mark.parametrize(
    ("given", "metres"),
    [(2, 2.0), (0.5, 0.5), ("5 mm", 5e-3), ("3 um", 3e-6), ("1e-4 m", 1e-4), ("2 inch", 0.0508), (math.inf, math.inf)],
)
def test_numbers_and_texts(given, metres):
    assert LENGTH.validate_python(given) == pytest.approx(metres, rel=1e-12)


@pytest.mark.parametrize("given", ["5 V", "5", "mm mm?", "", "nan m", "-1 mm", math.nan, True, None, [1.0], 0])
def test_refused(given):
    with pytest.raises(ValidationError):
        LENGTH.validate_python(given)


def test_text_is_data_and_never_code():
    with pytest.raises(ValidationError, match="cannot be read"):
        LENGTH.validate_python("__import__('os').getcwd()")


def test_unknown_bounds_are_a_defect_of_the_caller():
    with pytest.raises(TypeError, match="minimum"):
        Quantity("m", minimum=0)
