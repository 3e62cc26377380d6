"""Tables written as TOML are the same when they are read again."""

import datetime
import math
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meeframe.core.toml import toml_text

TEXTS = st.text(st.characters(exclude_categories=["Cs"]))
VALUES = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | TEXTS | st.dates() | st.datetimes(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3),
    max_leaves=8,
)


@given(st.dictionaries(TEXTS, VALUES, max_size=4))
def test_tables_come_back(tables):
    assert tomllib.loads(toml_text(tables)) == tables


@pytest.mark.parametrize("odd", ["a\x7fb", "", "a.b", 'a"b', "a\\b", "a\nb", "a\x00b", "größe"])
def test_odd_characters_in_keys_and_texts(odd):
    tables = {odd: odd, "table": {odd: {odd: [odd]}}, odd + "s": [{odd: 1}]}
    assert tomllib.loads(toml_text(tables)) == tables


def test_numbers_of_numpy_are_numbers():
    numbers = {"float": np.float64(0.3), "whole": np.int64(3), "infinite": np.float64(-np.inf)}
    assert tomllib.loads(toml_text(numbers)) == {"float": 0.3, "whole": 3, "infinite": -math.inf}
    assert math.isnan(tomllib.loads(toml_text({"nan": np.float64(np.nan)}))["nan"])


def test_times_come_back():
    tables = {"time": datetime.time(1, 2, 3), "zoned": datetime.datetime(2026, 1, 2, 3, 4, 5, tzinfo=datetime.UTC)}
    assert tomllib.loads(toml_text(tables)) == tables


@pytest.mark.parametrize("value", [None, 1j, b"text", {1, 2}])
@pytest.mark.parametrize("place", [lambda value: value, lambda value: [value], lambda value: {"inner": value}])
def test_what_toml_has_not_is_refused(value, place):
    with pytest.raises(TypeError, match=f"TOML has no {type(value).__name__}"):
        toml_text({"key": place(value)})
