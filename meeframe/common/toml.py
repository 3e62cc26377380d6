"""Reading of TOML files and writing of tables as TOML text."""

import json
import re
import sys
import tomllib
from collections.abc import Mapping
from datetime import date, time
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Final

import numpy as np

from meeframe.common.errors import CaseError

_MOST_BITS: Final = 10_000
"""Bits of the largest whole number accepted: Python prints none of more than 4300 decimal digits."""
_DIGITS: Final = re.compile(
    r'"{3}(?:[^\\]|\\.)*?"{3}|\'{3}.*?\'{3}|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'|#[^\n]*|([0-9_]+)', re.DOTALL
)
"""Matches digits, as a group, outside strings and comments."""
_BARE: Final = re.compile(r"[A-Za-z0-9_-]+")


def read_toml(file: Path) -> tuple[str, dict[str, Any]]:
    """Return text and tables of a TOML file; raise CaseError if it cannot be read."""
    try:
        text = file.read_text(encoding="utf-8-sig")  # Windows' editors put a mark first
        return text, toml_tables(text)
    except OSError as error:
        raise CaseError(f"{file}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise CaseError(f"{file}: is not a TOML file: it is no text in UTF-8") from None
    except (ValueError, RecursionError) as error:  # its own, of digits without end, of depth
        raise CaseError(f"{file}: is not a TOML file: {error}") from None


def toml_tables(text: str) -> dict[str, Any]:
    """Return the tables of TOML text; raise ValueError, or RecursionError for tables nested too deeply."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # of Python's, of more decimal digits than it reads
        most = sys.get_int_max_str_digits()
        too_long = [run for run in _DIGITS.finditer(text) if len((run[1] or "").replace("_", "")) > most]
        digits = f"more than {most} digits"
        if len(too_long) == 1:  # others may belong to a float, or to a key
            (run,) = too_long
            line = text.count("\n", 0, run.start()) + 1
            digits = f"{len(run[1].replace('_', ''))} digits (at line {line})"
        raise ValueError(f"a whole number of {digits}; allowed: {_MOST_BITS} binary digits at most") from None
    check_whole_numbers(tables)  # of hexadecimal digits Python reads as many as one likes
    return tables


def check_whole_numbers(tables: Mapping[str, Any]) -> None:
    """Raise ValueError, naming the key, for a whole number of more digits than Python prints."""
    values: list[tuple[str, Any]] = [("", tables)]
    for key, value in values:
        if isinstance(value, int) and value.bit_length() > _MOST_BITS:
            digits = f"{value.bit_length()} binary digits"
            raise ValueError(f"{key[1:]}: a whole number of {digits}; allowed: {_MOST_BITS} at most")
        if isinstance(value, Mapping):
            values += ((f"{key}.{name}", entry) for name, entry in value.items())
        if isinstance(value, list | tuple):
            values += ((f"{key}[{number}]", entry) for number, entry in enumerate(value, 1))


def toml_text(tables: Mapping[str, Any]) -> str:
    """Return TOML text that gives these tables when it is read.

    There is one header for each top-level table; inner ones are inline. Numbers and arrays of numpy become numbers and
    lists.

    Raises
    ------
    TypeError
        For values that TOML does not have, such as None; the message names the key.
    ValueError
        As `check_whole_numbers`.
    """
    check_whole_numbers(tables)
    plain = {key: value for key, value in tables.items() if not _is_table(value) and not _is_tables(value)}
    lines = [_entry(key, value) for key, value in plain.items()]
    for key, value in tables.items():
        if key in plain:
            continue
        header = f"[{_key(key)}]" if _is_table(value) else f"[[{_key(key)}]]"
        for table in [value] if _is_table(value) else value:
            lines += ["", header, *(_entry(name, entry, f"{key}.") for name, entry in table.items())]
    return "\n".join(lines).lstrip() + "\n"


def _is_table(value: Any) -> bool:
    return isinstance(value, Mapping)


def _is_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(map(_is_table, value))


def _entry(key: str, value: Any, within: str = "") -> str:
    return f"{_key(key)} = {_value(value, within + key)}"


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")  # its escapes are TOML's


def _value(value: Any, key: str) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(_entry(name, entry, f"{key}.") for name, entry in value.items()) + "}"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, bool | np.bool_):
        return str(value).lower()
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(entry, f"{key}[{number}]") for number, entry in enumerate(value, 1)) + "]"
    if isinstance(value, Integral | date | time):
        return str(value)
    if isinstance(value, Real):
        return repr(float(value))  # of numpy's, too
    raise TypeError(f"{key}: TOML has no {type(value).__name__}: {value!r}")
