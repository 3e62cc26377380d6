"""Summary of a result as HTML for notebooks."""

from html import escape
from typing import Any

from rich.console import Group
from rich.table import Table

from meeframe.results.records import Result
from meeframe.results.summary import summary_table


def summary_html(result: Result) -> str:
    """Return the summary of `meeframe show` as HTML: a table with a column for the end of each load step."""
    group = summary_table(result)
    assert isinstance(group, Group)
    table, *lines = group.renderables
    assert isinstance(table, Table)
    caption = f"<caption>{escape(result.provenance.title)}</caption>" if result.provenance.title else ""
    head = _row("th", [str(column.header) for column in table.columns])
    cells = zip(*([str(cell) for cell in column.cells] for column in table.columns), strict=True)
    body = "".join(_row("td", row) for row in cells)
    notes = "".join(f"<div>{escape(str(line))}</div>" for line in lines)
    return f"<div><table>{caption}<thead>{head}</thead><tbody>{body}</tbody></table>{notes}</div>"


def _row(tag: str, cells: Any) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"
