"""Tables of rich whose texts appear literally."""

from typing import Any

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text


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
