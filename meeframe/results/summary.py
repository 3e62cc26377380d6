"""Summary of a result: a dictionary for summary.json and a table for the terminal."""

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from textwrap import indent
from typing import Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from meeframe.common.json_values import plain
from meeframe.common.literal import LiteralTable
from meeframe.contact.problem import Status
from meeframe.fields import Array, FieldSet
from meeframe.indenters.base import RIGID_MOTIONS, IndenterMotions
from meeframe.results import schema
from meeframe.results.balance import balanced_names
from meeframe.results.overview import FLUX_MODULI, Overview, digests, fields_of, overviews
from meeframe.results.records import Result, RunStatus, join_sentences, sentences_of
from meeframe.results.selection import Which, name_of, number_of, position

AT_BOUNDARY: Final = (
    "the contact reaches the boundary of its zone and is cut off there: forces and areas are inaccurate"
)
_LABEL_WIDTH: Final = 35
_COLUMN_WIDTH: Final = 15
"""Characters of the labels with their unit (_LABEL_WIDTH) and of the numbers of an increment (_COLUMN_WIDTH)."""
_MIN_COLUMNS: Final = 3
"""Smallest number of increments that a table may show: the first, the peak load and the last."""
_Row = tuple[str, str, list[Any]]
_Entry = Mapping[str, Any]
"""Digest of an increment."""

_ROUND_OFF: Final = 1e-9
"""Fraction of the largest component of a vector below which a component is shown as zero, as in figures."""
_ENERGY: Final = "dissipated_energy"
_ABOUT: Final = {"tilt": "moment", "twist": "torque"}
"""Resultants that the table shows with their conjugate motion; the others always have rows."""


def summary(result: Result) -> dict[str, Any]:
    """Return the content of summary.json, of plain Python types; see docs/reference/results.md.

    Parameters
    ----------
    result : Result
        The result.

    Returns
    -------
    dict of str to object
        The content. Numbers that are not finite are None.
    """
    return _run(result) | {"steps": list(_entries(result))}


def summary_json(result: Result) -> Iterator[str]:
    """Yield the text of summary.json, increment by increment: the whole of a long history takes much memory.

    Parameters
    ----------
    result : Result
        The result.

    Yields
    ------
    str
        The next part of the text.
    """
    yield _json(_run(result) | {"steps": []}).removesuffix("[]\n}") + "["
    separator = "\n"
    for entry in _entries(result):
        yield separator + indent(_json(entry), "    ")
        separator = ",\n"
    yield "]\n}\n" if separator == "\n" else "\n  ]\n}\n"


def _json(data: Mapping[str, Any]) -> str:
    return json.dumps(data, indent=2, allow_nan=False)


def _run(result: Result) -> dict[str, Any]:
    """Return the summary of a run but for its increments."""
    made = result.provenance
    data = {
        "title": made.title,
        "status": str(result.status),
        "timings": dict(result.timings),
        "peak_memory_mb": result.peak_memory_mb,
        "versions": dict(made.versions),
        "threads": made.threads,
        "contact_at_zone_boundary": any(step.contact_at_zone_boundary for step in overviews(result)),
        "planned_increments": result.planned_steps,
        "load_steps": _load_steps(result),
    }
    return {name: plain(value) for name, value in data.items()}


def _entries(result: Result) -> Iterator[dict[str, Any]]:
    """Yield the entries of all increments."""
    for digest in digests(result):
        yield {name: plain(value) for name, value in digest.items() if name != FLUX_MODULI}


def _load_steps(result: Result) -> list[dict[str, Any]]:
    """Return the data of each load step as a whole.

    These are its finished increments, and the energy that friction dissipates in it.
    """
    counts = Counter(step.step for step in overviews(result))
    energies = _dissipated(result)
    return [
        {"step": number, "increments": count, "dissipated_energy": energies[number]}
        for number, count in sorted(counts.items())
    ]


def summary_table(result: Result, which: Sequence[Which] = (), width: int = 120) -> RenderableType:
    """Return the summary for the terminal: a line on the run and a table with a column for each of some increments.

    Parameters
    ----------
    result : Result
        The result.
    which : sequence of int, tuple, str or StepResult, optional
        The increments (see `select`); by default the last one of each load step, and that of the peak load, or as many
        of them as fit into the width.
    width : int, optional
        Width of the terminal in characters.

    Returns
    -------
    rich.console.RenderableType
        The table, with the messages of increments below it.
    """
    table = LiteralTable(result.provenance.title)
    table.add_column("")
    table.add_column("unit")
    numbers = [number_of(result, one) for one in which] or _ends_and_peak(
        result, (width - _LABEL_WIDTH) // _COLUMN_WIDTH
    )
    shown, names = list(digests(result, numbers)), [overviews(result)[number] for number in numbers]
    for one in names:
        table.add_column(name_of(result, one), justify="right")
    fields, energies = fields_of(result), _dissipated(result)
    rows: list[_Row] = [
        ("approach", "m", [entry["approach"] for entry in shown]),
        *_motions(shown, fields),
        *_totals([{**entry, _ENERGY: energies[entry["step"]]} for entry in shown], fields),
        *_rolling(shown),
        *_unbalances(shown, fields),
        *_durations(result, shown),
        *((name, "", [entry[name] for entry in shown]) for name in ("iterations", "residual", "status")),
    ]
    for label, unit, values in rows:
        table.add_row(label, unit, *(f"{value:.6g}" if isinstance(value, float) else str(value) for value in values))
    reporting = [
        one for one in overviews(result) if one.message and (one in names or one.status is not Status.CONVERGED)
    ]
    return Group(table, *_omission(result, names, which), *_messages(result, reporting), _headline(result))


def _omission(result: Result, shown: Sequence[Overview], which: Sequence[Which]) -> Iterator[Text]:
    """Yield a line on the load steps whose ends the table does not show."""
    count, n_shown = (len({step.step for step in steps}) for steps in (overviews(result), shown))
    if not which and n_shown < count:
        yield Text(f"{n_shown} of {count} load steps are shown; `meeframe show --step N` shows another one")


def _messages(result: Result, reporting: Sequence[Overview]) -> Iterator[Text]:
    """Yield the messages of increments; what several of them share is written once, after the others."""
    numbers: dict[str, list[int]] = {}
    for number, step in enumerate(reporting):
        for sentence in sentences_of(step.message):
            numbers.setdefault(sentence, []).append(number)
    sentences: dict[tuple[int, ...], list[str]] = {}
    for sentence, where in numbers.items():
        sentences.setdefault(tuple(dict.fromkeys(where)), []).append(sentence)
    for positions in sorted(sentences, key=lambda each: (len(each) > 1, each)):
        names = _names(result, [reporting[number] for number in positions], reporting)
        yield Text(f"{names}: {join_sentences(*sentences[positions])}")


def _names(result: Result, steps: Sequence[Overview], reporting: Sequence[Overview]) -> str:
    """Return the names of increments; their load steps suffice if only one increment of each reports."""
    names = [name_of(result, step) for step in steps]
    if len(steps) > 1 and len({step.step for step in reporting}) == len(reporting):
        names = [f"steps {steps[0].step}", *(str(step.step) for step in steps[1:])]
    separator = "; " if any("," in name for name in names) else ", "
    return f"{separator.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0]


def _unbalances(shown: Sequence[_Entry], fields: FieldSet) -> Iterator[_Row]:
    """Yield rows on the unbalance of the body, for closed boundaries whose fields are known."""
    for number, name in enumerate(balanced_names(fields)):
        balances = (entry["unbalance"] for entry in shown)
        relative = [math.nan if one is None else one["relative"][number] for one in balances]
        if any(value > 0.0 for value in relative):
            yield f"unbalanced {name}", "%", [100.0 * value if math.isfinite(value) else "-" for value in relative]


def _totals(totals: Sequence[_Entry], fields: FieldSet) -> Iterator[_Row]:
    """Yield rows of the totals of present phenomena; the dissipated energy is that of the whole load step."""
    for row in schema.shown_totals(schema.View.SUMMARY, totals, fields):
        columns = np.array([np.atleast_1d(total[row.name]) for total in totals])
        columns = without_round_off(columns, np.abs(columns).max(initial=0.0))
        for i, label in enumerate(row.labels):
            words = f"{label}, whole step" if row.name == _ENERGY else label
            yield words, row.unit, columns[:, i].tolist()


def _rolling(shown: Sequence[_Entry]) -> Iterator[_Row]:
    """Yield rows of the numbers of rolling, if the contact rolls in any of the increments."""
    rolling = [entry["rolling"] or {} for entry in shown]
    for row in schema.ROLLING_TOTALS if any(rolling) else ():
        values = np.array([np.broadcast_to(numbers.get(row.name, math.nan), len(row.names)) for numbers in rolling])
        values = without_round_off(values, np.abs(values[np.isfinite(values)]).max(initial=0.0))
        for i, label in enumerate(row.labels):
            column = [value if math.isfinite(value) else "-" for value in values[:, i].tolist()]
            if column != ["-"] * len(column):
                yield label, row.unit, column


def without_round_off(values: Array, largest: float) -> Array:
    """Return values with zeros in place of those that are negligible.

    Parameters
    ----------
    values : Array
        Values of any shape.
    largest : float
        Largest modulus in all increments or runs, in the unit of the values.

    Returns
    -------
    Array
        Values, of the same shape.
    """
    return np.where(np.abs(values) < _ROUND_OFF * largest, 0.0, values)


def _motions(shown: Sequence[_Entry], fields: FieldSet) -> Iterator[_Row]:
    """Yield rows of the indenter's motions that were free or are not zero, and of their moments.

    The approach is not among them.
    """
    motions = IndenterMotions(fields)
    for name, columns in list(motions.motions.items())[1:]:
        free = any(motions.columns[key] == columns for entry in shown for key in entry["prescribed"])
        values = [np.atleast_1d(entry[name]) for entry in shown]
        if not free and not np.any(values):
            continue
        yield from _components(name + " of the indenter" * (name not in RIGID_MOTIONS), motions.units[name], values)
        if name in _ABOUT:
            about = _ABOUT[name]
            yield from _components(about, motions.units[about], [np.atleast_1d(entry[about]) for entry in shown])


def _components(name: str, unit: str, values: list[Any]) -> Iterator[_Row]:
    """Yield rows of a quantity with one component, or with those along, or about, e1 and e2."""
    words = (name.replace("_", " "),) if len(values[0]) == 1 else (f"{name} e1", f"{name} e2")
    columns = without_round_off(np.array(values), np.abs(values).max(initial=0.0))
    for i, word in enumerate(words):
        yield word, unit, columns[:, i].tolist()


def _ends_and_peak(result: Result, columns: int) -> list[int]:
    """Return the numbers of the last increment of each load step so far, and of that of the peak load, from 0.

    If there are more than fit into the columns, these are spread evenly from the first to the last.
    """
    finished = overviews(result)
    if not finished:
        return []
    peak = position(finished)
    numbers = np.array(sorted({*{step.step: number for number, step in enumerate(finished)}.values(), peak}))
    columns = max(columns, _MIN_COLUMNS)
    if len(numbers) > columns:
        numbers = np.union1d(numbers[np.linspace(0, len(numbers) - 1, columns - 1).astype(int)], peak)
    return [int(number) for number in numbers]


def _durations(result: Result, shown: Sequence[_Entry]) -> list[_Row]:
    """Return the row of the time that the finished increments of each load step took.

    There is none unless a step has a duration.
    """
    if all(end["duration"] is None for end in shown):
        return []
    times: dict[int, float] = {}
    for step in overviews(result):
        times[step.step] = times.get(step.step, 0.0) + (step.duration or math.nan)
    sums = [times[end["step"]] for end in shown]
    return [("duration", "s", [total if math.isfinite(total) else "-" for total in sums])]


def _dissipated(result: Result) -> Mapping[int, float]:
    """Return the energy that friction dissipates in the whole of each load step, by its number [J].

    Increments that did not converge do not count.
    """
    energies: dict[int, float] = {}
    for step in overviews(result):
        counts = step.status is Status.CONVERGED
        energies[step.step] = energies.get(step.step, 0.0) + (step.dissipated_energy if counts else 0.0)
    return energies


def _headline(result: Result) -> Text:
    style = {RunStatus.CONVERGED: "green", RunStatus.NOT_CONVERGED: "red", RunStatus.UNFINISHED: "yellow"}
    one_each = all(step.increment == 1 for step in overviews(result)) and len(result.steps) == result.planned_steps
    counted = "steps" if one_each else "increments"
    line = f"{result.status}: {len(result.steps)} of {result.planned_steps} {counted}"
    if result.timings:
        line += (
            f", {result.timings['total']:.1f} s, {result.peak_memory_mb:.0f} MB, {result.provenance.threads} threads"
        )
    return Text(line, style=style[result.status])
