"""Texts of others on the terminal: tables of rich whose texts appear literally, and no escape sequences."""

import re
from collections.abc import Iterable
from typing import Any, Final

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

_CONTROL: Final = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Pattern of characters that control a terminal or cannot be printed; not of line feeds and tabs."""


def printable(text: str) -> str:
    """Return a text with control characters as escape sequences of Python, which a terminal does not obey."""
    return _CONTROL.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


class LiteralConsole(Console):
    """A console that passes on no control characters but its own."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Render as `Console.render` does."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=printable(segment.text))


class LiteralTable(Table):
    """A table whose title, headings and cells appear literally, since rich interprets brackets in strings as markup."""

    def __init__(self, title: str = "", **options: Any) -> None:
        super().__init__(title=Text(title, style="table.title") if title else None, title_justify="left", **options)

    def add_column(self, header: RenderableType = "", *arguments: Any, **options: Any) -> None:
        """Add a column, as `Table.add_column` does."""
        super().add_column(_literal(header), *arguments, **options)

    def add_row(self, *cells: RenderableType | None, **options: Any) -> None:
        """Add a row, as `Table.add_row` does."""
        super().add_row(*(cell if cell is None else _literal(cell) for cell in cells), **options)


def _literal(cell: RenderableType) -> RenderableType:
    return Text(cell) if isinstance(cell, str) else cell
