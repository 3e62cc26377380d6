"""Tables written as TOML are unchanged when they are read again."""

import datetime
import math
import re
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meeframe.common.toml import toml_tables, toml_text

TEXTS = st.text(st.characters(exclude_categories=["Cs"]))
VALUES = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | TEXTS | st.dates() | st.datetimes(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3),
    max_leaves=8,
)


@given(st.dictionaries(TEXTS, VALUES, max_size=4))
def test_tables_round_trip(tables):
    assert tomllib.loads(toml_text(tables)) == tables


@pytest.mark.parametrize("odd", ["a\x7fb", "", "a.b", 'a"b', "a\\b", "a\nb", "a\x00b", "größe"])
def test_special_characters(odd):
    tables = {odd: odd, "table": {odd: {odd: [odd]}}, odd + "s": [{odd: 1}]}
    assert tomllib.loads(toml_text(tables)) == tables


def test_numpy_numbers():
    numbers = {
        "float": np.float64(0.3),
        "single": np.float32(0.5),
        "whole": np.int64(3),
        "infinite": np.float64(-np.inf),
        "flag": np.bool_(True),
        "array": np.array([[1.0, 2.0], [3.0, 4.0]], np.float32),
        "none": np.zeros(0),
        "number": np.array(7),
    }
    assert tomllib.loads(toml_text(numbers)) == {
        "float": 0.3,
        "single": 0.5,
        "whole": 3,
        "infinite": -math.inf,
        "flag": True,
        "array": [[1.0, 2.0], [3.0, 4.0]],
        "none": [],
        "number": 7,
    }
    assert math.isnan(tomllib.loads(toml_text({"nan": np.float64(np.nan)}))["nan"])


def test_times_round_trip():
    tables = {"time": datetime.time(1, 2, 3), "zoned": datetime.datetime(2026, 1, 2, 3, 4, 5, tzinfo=datetime.UTC)}
    assert tomllib.loads(toml_text(tables)) == tables


@pytest.mark.parametrize("value", [None, 1j, b"text", {1, 2}])
@pytest.mark.parametrize(
    ("position", "where"),
    [
        (lambda value: value, "key"),
        (lambda value: [1, value], "key[2]"),
        (lambda value: {"inner": [{"most": value}]}, "key.inner[1].most"),
        (lambda value: [{"inner": value}], "key.inner"),
    ],
)
def test_unsupported_values_are_rejected(value, position, where):
    with pytest.raises(
        TypeError, match=re.escape(f"{where}: TOML does not support values of type {type(value).__name__}")
    ):
        toml_text({"key": position(value)})


@pytest.mark.parametrize("value", ["[" * 60 + "]" * 60, "{a = " * 60 + "1" + "}" * 60])
def test_deep_nesting_is_rejected(value):
    """Python reads it, but the recursion that writes a text exceeds its limit at a few hundred levels."""
    with pytest.raises(ValueError, match=r"^key.*: tables or lists are nested 51 deep; allowed: at most 50"):
        toml_tables(f"key = {value}")
    assert toml_tables(toml_text({"key": [[[{"a": [1]}]]]})) == {"key": [[[{"a": [1]}]]]}


def test_integers_too_long_to_print_are_rejected():
    with pytest.raises(ValueError, match=r"key.inner\[2\]: an integer of 16610 binary digits"):
        toml_text({"key": {"inner": [1, 10**5000]}})


LONG = "1" * 5000


@pytest.mark.parametrize(
    "before",
    [
        "",
        f'text = "{LONG * 2}"',
        f'text = "a \\" {LONG * 2}"',
        f"text = '{LONG * 2}'",
        f'text = """\n"{LONG * 2}\\"\n"""',
        f"text = '''\n'{LONG * 2}\n'''",
        f"# {LONG * 2}",
        f"a = 1 # \" ' {LONG * 2}",
        "a = 1_" + "0_1" * 2000,
    ],
)
def test_line_of_an_overlong_integer(before):
    """Long digit sequences in texts and comments do not matter."""
    line = before.count("\n") + 2
    with pytest.raises(ValueError, match=rf"an integer of 5000 digits \(at line {line}\)"):
        toml_tables(f'{before}\nwhole = {LONG}\nlater = "{LONG * 3}" # {LONG * 3}')


def test_no_line_is_named_if_it_is_ambiguous():
    """Floats may have any number of digits."""
    with pytest.raises(ValueError, match="an integer of more than 4300 digits; allowed"):
        toml_tables(f"float = {LONG * 2}.0\nwhole = {LONG}")
