"""Tables of numbers in text files, with any separators, decimal points or commas, and marks of missing numbers."""

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from meeframe.plugin import Array

_NUMBER: Final = re.compile(r"(?<!\w)[-+]?\.?\d")
"""The begin of a number in a line; not of a name such as X1."""
_MISSING: Final = re.compile(r"bad|nan|null|none|void|missing|n/?a|nodata|-{1,2}|[*?]+|", re.IGNORECASE)
"""Entries of missing heights."""
_NO_DATA: Final = re.compile(r"\bno data\b", re.IGNORECASE)
"""The mark of a missing height that has a blank."""


def read_text(path: Path) -> str:
    """Return the text of a file, in UTF-8 with or without a byte order mark, or else in Latin-1."""
    content = path.read_bytes()
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


@dataclass(frozen=True)
class TextTable:
    """Lines of a text from the first row of numbers on.

    Attributes
    ----------
    lines
        Text by number of the line, without comments and empty lines.
    decimal_commas
        Whether commas are decimal ones.
    unknown
        Number and text of the first line before that has a number, which may be a unit or a size; None without any.
    """

    lines: dict[int, str]
    decimal_commas: bool
    unknown: str | None

    @classmethod
    def of(cls, text: str) -> "TextTable":
        """Return the table in a text, in which # starts a comment. Raises ValueError if there is none."""
        text = _NO_DATA.sub("nodata", text)
        # tabs at both ends separate empty entries, except in empty lines after the last row
        parts = {n: full.partition("#")[0].strip(" ") for n, full in enumerate(text.splitlines(), 1)}
        last = max((n for n, line in parts.items() if line.strip()), default=0)
        lines = {n: line for n, line in parts.items() if line and n <= last}
        commas = _has_decimal_commas(lines.values())
        first = next((n for n, line in lines.items() if _is_row(_entries(line, commas))), None)
        if first is None:
            raise ValueError("no row of numbers in it")
        unknown = (_named(n, line) for n, line in lines.items() if n < first and _NUMBER.search(line))
        return cls({n: line for n, line in lines.items() if n >= first}, commas, next(unknown, None))

    def numbers(self) -> Array:
        """Return the rows as an array, nan for entries that are not numbers. Raises ValueError, naming a line."""
        rows = {n: _entries(line, self.decimal_commas) for n, line in self.lines.items()}
        if all(row[-1] == "" for row in rows.values()):  # separators at the ends of lines
            rows = {n: row[:-1] for n, row in rows.items()}
        if all(row[0] == "" for row in rows.values()):
            rows = {n: row[1:] for n, row in rows.items()}
        ((most, _),) = Counter(len(row) for row in rows.values()).most_common(1)
        for n, row in rows.items():
            if len(row) != most:
                raise ValueError(f"{_named(n, self.lines[n])}: {len(row)} entries, where most lines have {most}")
        try:
            return np.array(list(rows.values()), float)
        except ValueError:
            array = np.array(
                [[float(entry) if _is_number(entry) else np.nan for entry in row] for row in rows.values()]
            )
        for (n, row), values in zip(rows.items(), array, strict=True):
            if np.isnan(values).all() and not _is_row(row):
                raise ValueError(f"{_named(n, self.lines[n])}: no number in it")
        return array


def _named(number: int, line: str) -> str:
    return f"line {number}, {line.strip()[:80]!r}"


def _has_decimal_commas(texts: Iterable[str]) -> bool:
    """Return whether commas in rows are decimal ones. Raises ValueError if that is uncertain.

    Only lines without words count, as headers may have other commas. Commas between blanks or semicolons are decimal,
    and those beside blanks, or alone in a line, separate numbers.
    """
    numbers = [text.strip() for text in texts if "," in text and _is_row(_entries(text, False))]
    words = [word for text in numbers if len(row := re.split(r"[;\s]+", text)) > 1 for word in row if "," in word]
    inside = [word for word in words if "," in word.strip(",")]
    if not inside:
        return False
    has_points = any("." in text for text in numbers)
    if any(word.startswith(",") or word.endswith(",") for word in words) and has_points:
        return False  # some commas are followed by blanks
    if has_points or len(inside) < len(words) or any(word.count(",") > 1 for word in inside):
        raise ValueError(f"commas in {inside[0][:40]!r} are decimal, or separate numbers; write decimal points")
    return True


def _entries(text: str, decimal_commas: bool) -> list[str]:
    """Return the entries of a line; "" between two separators, which tabs are if there are no others."""
    if decimal_commas:
        text = text.replace(",", ".")
    if ";" in text or "," in text:
        return re.split(r"\s*[;,]\s*|\s+", text.strip())
    return re.split(r"[^\S\t]*\t[^\S\t]*|\s+", text) if "\t" in text else text.split()


def _is_row(entries: list[str]) -> bool:
    """Return whether a line consists of numbers and missing heights, which may be empty but for one."""
    return any(entries) and all(not entry or _is_number(entry) or _MISSING.fullmatch(entry) for entry in entries)


def _is_number(token: str) -> bool:
    try:
        float(token)
    except ValueError:
        return False
    return True
