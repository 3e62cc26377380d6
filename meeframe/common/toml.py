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
from meeframe.common.files import MAX_TEXT_BYTES, check_file

_MAX_BITS: Final = 10_000
"""Bits of the largest integer accepted; Python prints no integer of more than 4300 decimal digits."""
_MAX_DEPTH: Final = 50
"""Largest depth of nested tables and lists; a case file has five at most, and Python writes a few hundred."""
_DIGIT_RUNS: Final = re.compile(
    r'"{3}(?:[^\\]|\\.)*?"{3}|\'{3}.*?\'{3}|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'|#[^\n]*|([0-9_]+)', re.DOTALL
)
"""Matches digits outside strings and comments, as a group."""
_BARE_KEY: Final = re.compile(r"[A-Za-z0-9_-]+")


def read_toml(file: Path) -> tuple[str, dict[str, Any]]:
    """Return the text and the tables of a TOML file.

    Parameters
    ----------
    file : Path
        The file.

    Returns
    -------
    str
        The text of the file.
    dict
        Its tables.

    Raises
    ------
    CaseError
        If the file cannot be read or is not a TOML file.
    """
    try:
        check_file(file, MAX_TEXT_BYTES)
        text = file.read_text(encoding="utf-8-sig")  # editors on Windows write a byte order mark first
        return text, toml_tables(text)
    except OSError as error:
        raise CaseError(f"{file}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise CaseError(f"{file}: is not a TOML file: its text is not encoded in UTF-8") from None
    except (ValueError, RecursionError) as error:  # syntax, integers that are too long, nesting that is too deep
        raise CaseError(f"{file}: is not a TOML file: {error}") from None


def toml_tables(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Raises
    ------
    ValueError
        If the text is not valid, or as `check_values`.
    RecursionError
        If it is nested too deeply to be read.
    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # raised by Python for an integer of too many decimal digits
        limit = sys.get_int_max_str_digits()
        too_long = [run for run in _DIGIT_RUNS.finditer(text) if len((run[1] or "").replace("_", "")) > limit]
        digits = f"more than {limit} digits"
        if len(too_long) == 1:  # several: some may belong to a float or a key
            (run,) = too_long
            line = text.count("\n", 0, run.start()) + 1
            digits = f"{len(run[1].replace('_', ''))} digits (at line {line})"
        raise ValueError(f"an integer of {digits}; allowed: at most {_MAX_BITS} binary digits") from None
    check_values(tables)  # Python reads any number of hexadecimal digits
    return tables


def check_values(tables: Mapping[str, Any]) -> None:
    """Check that tables can be written as text.

    Parameters
    ----------
    tables : mapping
        Tables, in which mappings and lists may be nested.

    Raises
    ------
    ValueError
        For an integer of more digits than Python prints, and for nesting that is too deep; the message names the key.
    """
    values: list[tuple[str, int, Any]] = [("", 0, tables)]
    for key, depth, value in values:
        if depth > _MAX_DEPTH:
            raise ValueError(f"{key[1:]}: tables or lists are nested {depth} deep; allowed: at most {_MAX_DEPTH}")
        if isinstance(value, int) and value.bit_length() > _MAX_BITS:
            digits = f"{value.bit_length()} binary digits"
            raise ValueError(f"{key[1:]}: an integer of {digits}; allowed: at most {_MAX_BITS}")
        if isinstance(value, Mapping):
            values += ((f"{key}.{name}", depth + 1, entry) for name, entry in value.items())
        if isinstance(value, list | tuple):
            values += ((f"{key}[{number}]", depth + 1, entry) for number, entry in enumerate(value, 1))


def toml_text(tables: Mapping[str, Any]) -> str:
    """Return TOML text that gives these tables when it is read.

    Parameters
    ----------
    tables : mapping
        The tables. NumPy numbers and arrays become numbers and lists.

    Returns
    -------
    str
        The text, with one header for each top-level table; inner tables are inline.

    Raises
    ------
    TypeError
        For values that TOML does not support, such as None; the message names the key.
    ValueError
        For an integer of more digits than Python prints; the message names its key.
    """
    check_values(tables)
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


def _entry(key: str, value: Any, prefix: str = "") -> str:
    return f"{_key(key)} = {_value(value, prefix + key)}"


def _key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")  # JSON and TOML have the same escapes


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
        return repr(float(value))  # NumPy floats, too
    raise TypeError(f"{key}: TOML does not support values of type {type(value).__name__}: {value!r}")
