"""Values as tables, lists and numbers of JSON."""

import json
from enum import StrEnum

import numpy as np
import pytest

from meeframe.common.json_values import plain


class Colour(StrEnum):
    RED = "red"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (np.array([[1.0, np.nan], [-np.inf, 2.0]]), "[[1.0, null], [null, 2.0]]"),
        ({"a": (np.float64(0.5), np.int64(3)), "b": {"c": [np.bool_(True), None, Colour.RED]}},
         '{"a": [0.5, 3], "b": {"c": [true, null, "red"]}}'),
        ((np.float64("nan"), float("inf"), "inf"), '[null, null, "inf"]'),
    ],
)  # fmt: skip
def test_values_are_those_of_json(value, text):
    assert json.dumps(plain(value), allow_nan=False) == text
