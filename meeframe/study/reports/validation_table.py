"""Table of a validation for the terminal, and its JSON."""

import json
from collections.abc import Iterator
from textwrap import shorten
from typing import Any, Final, NamedTuple

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from meeframe.common.json_values import plain
from meeframe.common.literal import LiteralTable
from meeframe.results.canvas import prefixed
from meeframe.study.reports.validation import CaseReport, Check, Claim, Row, Skip, Validation, Verdict


class TableCells(NamedTuple):
    """Cells of a row of the table."""

    name: str
    computed: str
    reference: str
    difference: str
    tolerance: str
    seconds: str


def table_cells(row: Row) -> TableCells:
    """Return the cells of a row: values and criterion of a claim, numbers of a check, reason of a skipped check."""
    result, seconds = row.item, f"{row.seconds:.1f}"
    match result:
        case Claim():
            return TableCells(result.name, result.observed, "", "", result.criterion, seconds)
        case Skip():
            return TableCells(result.name, result.reason, "", "", "", seconds)
        case Check():
            return TableCells(result.name, *_numbers(result), seconds)


def reason_of(result: Check | Claim | Skip) -> str:
    """Return the explanation if the outcome is DIFFERS, else an empty text."""
    return result.explained if result.verdict is Verdict.DIFFERS and not isinstance(result, Skip) else ""


def _numbers(result: Check) -> tuple[str, str, str, str]:
    """Return computed value, reference, difference and tolerance, without prefixes if the check is absolute."""
    if result.absolute:
        values = (result.computed, result.reference, result.difference, result.tolerance)
        computed, reference, difference, tolerance = (f"{value:.6g} {result.unit}".strip() for value in values)
        return computed, reference, difference, tolerance
    # a prefix would be squared with its unit
    scale, unit = 1.0, result.unit
    if unit and "^" not in unit:
        scale, unit = prefixed(np.array([result.reference]), unit)
    computed, reference = (f"{value / scale:.6g} {unit}".strip() for value in (result.computed, result.reference))
    return computed, reference, f"{100 * result.difference:+.3g} %", f"{100 * result.tolerance:.3g} %"


_MAX_WIDTH: Final = 80
"""Maximal number of characters in a cell of the table; the report has the whole text."""
_STYLES: Final = {
    Verdict.PASS: "green",
    Verdict.FAIL: "bold red",
    Verdict.ERROR: "bold red",
    Verdict.DIFFERS: "yellow",
}


def validation_table(validation: Validation) -> RenderableType:
    """Return the table for the terminal, the explanations of differences, and the headline."""
    table = LiteralTable()
    for heading in ("case", "check", "computed", "reference", "difference", "tolerance", "time [s]", ""):
        table.add_column(heading, justify="left" if heading in ("case", "check", "") else "right")
    reasons = []
    for case in validation.cases:
        for number, row in enumerate(case.rows):
            verdict = row.item.verdict
            name = "" if number else case.name
            words = (shorten(word, _MAX_WIDTH, placeholder=" ...") for word in table_cells(row))
            table.add_row(name, *words, Text(str(verdict), style=_STYLES.get(verdict, "")))
            if reason_of(row.item):
                reasons.append(Text(f"{case.name}, {row.item.name}: {reason_of(row.item)}"))
        if case.error:
            last = shorten(case.error.strip().splitlines()[-1], _MAX_WIDTH, placeholder=" ...")
            table.add_row("" if case.rows else case.name, "", last, *[""] * 4, Text("error", style="bold red"))
        table.add_section()
    headline = Text(validation.headline, style="green" if validation.passed else "bold red")
    return Group(table, *reasons, headline)


def validation_json(validation: Validation) -> str:
    """Return everything but the figures as JSON; numbers that are not finite become null."""
    data = {
        "quick": validation.quick,
        "passed": validation.passed,
        "planned_cases": validation.planned,
        "versions": dict(validation.versions),
        "cases": [
            {
                "name": case.name,
                "title": case.title,
                "source": case.source,
                "seconds": round(case.seconds, 3),
                "finished": case.finished,
                "error": case.error,
                "checks": list(_rows(case)),
            }
            for case in validation.cases
        ],
    }
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _rows(case: CaseReport) -> Iterator[dict[str, Any]]:
    for row in case.rows:
        result = row.item
        values = vars(result) | ({"difference": result.difference} if isinstance(result, Check) else {})
        shown = {key: value for key, value in values.items() if value != ""}
        yield {
            "kind": type(result).__name__.lower(),
            **plain(shown),
            "verdict": str(result.verdict),
            "seconds": row.seconds,
        }
