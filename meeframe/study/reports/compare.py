"""Table, figure and JSON of a comparison."""

import json
import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from meeframe.common.json_values import plain
from meeframe.common.literal import LiteralTable
from meeframe.contact.problem import Status
from meeframe.fields import MEE, Array, FieldSet
from meeframe.results import schema
from meeframe.results.canvas import label_panels, line_style, prefixed, sheet, styled
from meeframe.results.picture import lengths
from meeframe.results.records import StepResult, Zone
from meeframe.results.schema import NodalField, Total
from meeframe.results.selection import has_increment, name_of, select
from meeframe.results.summary import without_round_off
from meeframe.study.reports.study import middle_line

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REFUSED: Final = "refused"
UNFINISHED: Final = "unfinished"
_ROUND_OFF: Final = 1e-6
"""Tangential tractions below this fraction of the largest pressure are not drawn."""

_RUNS_PER_TABLE: Final = 4
"""Number of runs side by side that fit in a terminal."""
_LEGEND_WIDTH: Final = 100
"""Characters in a line of the legend."""


def _totals(fields: FieldSet) -> dict[str, Total]:
    """Return the totals that a comparison shows, by name."""
    return {total.name: total for total in schema.total_rows(fields) if schema.View.COMPARISON in total.views}


def _fields(fields: FieldSet) -> dict[str, NodalField]:
    """Return the nodal fields that a comparison shows, by name."""
    return schema.nodal(schema.View.COMPARISON, fields)


@dataclass(frozen=True, eq=False)
class ComparedRun:
    """One combination of a comparison.

    Attributes
    ----------
    choices
        Labels of the choices, by option.
    zone, steps
        As in Result.
    planned
        Number of increments of the case.
    seconds
        Time of the increments so far.
    system_seconds
        Time for the reduced system, which other runs may share.
    refusal
        Reason if a formulation, solver or law refuses the case.
    """

    choices: Mapping[str, str]
    zone: Zone
    planned: int
    steps: tuple[StepResult, ...] = ()
    seconds: float = 0.0
    system_seconds: float = 0.0
    refusal: str = ""

    @property
    def label(self) -> str:
        """The choices in one line."""
        return ", ".join(self.choices.values())

    def at(self, numbers: tuple[int, int] | None) -> StepResult | None:
        """Return the increment with the numbers of its step and its own; None if it is not finished."""
        return next((step for step in self.steps if (step.step, step.increment) == numbers), None)

    @property
    def fields(self) -> FieldSet:
        """Field set of the increments."""
        return self.steps[0].fields if self.steps else MEE

    @property
    def status(self) -> str:
        """Status: 'converged', 'refused', 'unfinished', or the status of the first increment that did not converge."""
        failed = next((str(step.status) for step in self.steps if step.status is not Status.CONVERGED), "")
        if self.refusal or failed:
            return REFUSED if self.refusal else failed
        return str(Status.CONVERGED) if len(self.steps) == self.planned else UNFINISHED


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs of one case with combinations of laws, formulations and solvers.

    Attributes
    ----------
    title, text
        Title and text of the case.
    versions
        Versions of the software.
    runs
        The runs.
    which
        Increment of the reference run that is compared, as for `meeframe.results.selection.select`; by default, or if
        that run has no such increment, its last one, or that of the peak load if nothing touches in the last one.
    """

    title: str
    text: str
    versions: Mapping[str, str]
    runs: tuple[ComparedRun, ...] = ()
    which: str | None = None

    @property
    def first(self) -> ComparedRun:
        """The reference run, which is the first one that is not refused."""
        return next((run for run in self.runs if not run.refusal), self.runs[0])

    @cached_property
    def compared(self) -> tuple[int, int] | None:
        """Numbers of the load step and the increment that are compared; None if no increment is finished."""
        if not self.first.steps:
            return None
        default = "last" if self.first.steps[-1].touching.any() else "peak"
        chosen = self.which if self.which and has_increment(self.first, self.which) else default
        step = select(self.first, chosen)
        return step.step, step.increment

    @property
    def states(self) -> list[tuple[ComparedRun, StepResult]]:
        """Runs that have finished the compared increment, with that."""
        pairs = ((run, run.at(self.compared)) for run in self.runs)
        return [(run, step) for run, step in pairs if step is not None]

    @property
    def heading(self) -> str:
        """Title of the case, and the compared increment where there are several."""
        step = self.first.at(self.compared)
        words = "" if step is None or self.first.planned == 1 else name_of(self.first, step)
        return ", ".join(filter(None, [self.title, words]))

    @property
    def fields(self) -> FieldSet:
        """Field set of the case."""
        return next((run.fields for run in self.runs if run.steps), MEE)


def differences(run: ComparedRun, comparison: Comparison) -> dict[str, float | None]:
    """Return the relative differences of a run from the reference run in the compared increment, by quantity.

    Parameters
    ----------
    run
        The run.
    comparison
        The comparison.

    Returns
    -------
    dict of str to float or None
        For totals the modulus of the difference over the modulus in the first run; for fields the largest difference
        over the largest modulus. None if the first is zero and the other is not, or if there is nothing to compare.
    """
    first = comparison.first
    step, reference_step = run.at(comparison.compared), first.at(comparison.compared)
    if step is None or reference_step is None:
        return dict.fromkeys([*_totals(first.fields), *_fields(first.fields)])
    state, reference_state = (run.zone, step), (first.zone, reference_step)
    totals, reference = schema.totals(*state), schema.totals(*reference_state)
    results = {
        name: _relative(np.linalg.norm, np.atleast_1d(totals[name]), np.atleast_1d(reference[name]))
        for name in _totals(run.fields)
    }
    same = run.zone.points.shape == first.zone.points.shape and np.allclose(run.zone.points, first.zone.points)
    for name, field in _fields(run.fields).items():
        difference = (
            _relative(lambda values: np.abs(values).max(), field.values(*state), field.values(*reference_state))
            if same
            else None
        )
        results[name] = difference
    return results


def _relative(size: Callable[[Array], Any], value: Array, reference: Array) -> float | None:
    difference, scale = float(size(value - reference)), float(size(reference))
    if difference == 0.0:
        return 0.0
    return difference / scale if scale > 0.0 and math.isfinite(difference) else None


def comparison_json(comparison: Comparison) -> str:
    """Return all numbers of a comparison as JSON.

    Each run has choices, status, times and increments, and for the compared increment the fields on the zone and the
    differences from the reference run. Numbers that are not finite become null.
    """
    runs = [_numbers(run, comparison) for run in comparison.runs]
    head = {
        "title": comparison.title,
        "case": comparison.text,
        "versions": dict(comparison.versions),
        "compared": comparison.compared,
    }
    return json.dumps({**head, "runs": runs}, indent=1, allow_nan=False) + "\n"


def _numbers(run: ComparedRun, comparison: Comparison) -> dict[str, Any]:
    last, compared = (run.steps[-1] if run.steps else None), run.at(comparison.compared)
    return {
        "label": run.label,
        "choices": dict(run.choices),
        "status": run.status,
        "message": run.refusal or (last.message if last else ""),
        "seconds": run.seconds,
        "system_seconds": run.system_seconds,
        "iterations": sum(step.iterations for step in run.steps),
        "increments": [_increment(run.zone, step) for step in run.steps],
        "differences": differences(run, comparison),
        "points": run.zone.points.tolist(),
        "fields": {name: plain(field.values(run.zone, compared)) for name, field in _fields(run.fields).items()}
        if compared
        else {},
    }


def _increment(zone: Zone, step: StepResult) -> dict[str, Any]:
    totals = schema.totals(zone, step)
    return {
        "step": step.step,
        "increment": step.increment,
        "status": str(step.status),
        "iterations": step.iterations,
        "residual": plain(step.residual),
        **{name: plain(totals[name]) for name in _totals(step.fields)},
    }


def comparison_table(comparison: Comparison) -> RenderableType:
    """Return tables with a column for each run: totals of the compared increment, work, and relative differences."""
    runs = comparison.runs
    blocks = [runs[begin : begin + _RUNS_PER_TABLE] for begin in range(0, len(runs), _RUNS_PER_TABLE)]
    states = comparison.states
    totals = [schema.totals(run.zone, step) for run, step in states]
    selected = schema.shown_totals(schema.View.COMPARISON, totals, comparison.fields)
    known = _fields(comparison.fields).values()
    fields = [field for field in known if any(field.values(run.zone, step).any() for run, step in states)]
    titles = [comparison.heading, *[""] * (len(blocks) - 1)]
    tables = [_table(title, block, comparison, selected, fields) for title, block in zip(titles, blocks, strict=True)]
    refusals = (Text(f"{run.label}: {run.refusal}") for run in runs if run.refusal)
    return Group(*tables, *refusals, *_notes([run for run in runs if run.steps], comparison.first))


def _notes(runs: Sequence[ComparedRun], first: ComparedRun) -> Iterator[Text]:
    """Yield notes on the numbers of the table."""
    if len(runs) > 1:
        yield Text(
            f"Differences are from the first run ({first.label}): of the force, relative to its modulus there; of a "
            "field, the largest over all nodes relative to the largest modulus there."
        )
    yield Text("Times include the compilation of kernels at their first use.")
    if len({run.choices.get("formulation") for run in runs}) > 1:
        yield Text(
            "Formulations differ by their discretization errors on this mesh; "
            "`meeframe verify CASE.toml` tests whether they agree within these errors."
        )


def _table(
    title: str,
    runs: Sequence[ComparedRun],
    comparison: Comparison,
    totals: Sequence[Total],
    fields: Sequence[NodalField],
) -> LiteralTable:
    table = LiteralTable(title)
    table.add_column("")
    table.add_column("unit")
    for run in runs:
        table.add_column("\n".join(run.choices.values()), justify="right")
    for total in totals:
        states = [(run.zone, step) if (step := run.at(comparison.compared)) else None for run in runs]
        values = [None if state is None else np.atleast_1d(schema.totals(*state)[total.name]) for state in states]
        largest = max((np.abs(value).max() for value in values if value is not None), default=0.0)
        for i, label in enumerate(total.labels):
            components = [None if value is None else without_round_off(value, largest)[i] for value in values]
            table.add_row(label, total.unit, *map(_format, components))
    columns = [differences(run, comparison) for run in runs]
    for name, words in (("force", "force"), *((field.name, field.label) for field in fields)):
        table.add_row(f"difference in {words}", "%", *(_format(column[name], 100.0, ".3g") for column in columns))
    table.add_row("iterations", "", *(str(sum(step.iterations for step in run.steps)) for run in runs))
    table.add_row("time of the steps", "s", *(f"{run.seconds:.3g}" for run in runs))
    table.add_row("time of the reduced system", "s", *(f"{run.system_seconds:.3g}" for run in runs))
    table.add_row("status", "", *(run.status for run in runs))
    return table


def _format(value: float | None, factor: float = 1.0, form: str = ".6g") -> str:
    return "-" if value is None else f"{factor * value:{form}}"


@styled
def comparison_figure(comparison: Comparison) -> "Figure | None":
    """Return sections along x through the middle of the zone with all runs; None if nothing is to be seen."""
    states = comparison.states
    selected = [field for field in _fields(comparison.fields).values() if _visible(field, states)]
    if not selected:
        return None
    labels = [textwrap.fill(run.label, _LEGEND_WIDTH) for run, _ in states]
    lines = sum(label.count("\n") + 1 for label in labels)
    figure = sheet((9.0, 3.2 * math.ceil(len(selected) / 2) + 0.2 * lines))
    grid = figure.subplots(math.ceil(len(selected) / 2), 2, squeeze=False).ravel()
    length, of_length = lengths(run.zone for run, _ in states)
    for axes, field in zip(grid, selected, strict=False):
        values = [field.values(run.zone, step) for run, step in states]
        factor, unit = prefixed(np.concatenate(values), field.unit)
        for number, ((run, _), nodal) in enumerate(zip(states, values, strict=True)):
            nodes, x = middle_line(run.zone)
            axes.plot(x / length, nodal[nodes] / factor, label=labels[number], **line_style(number, len(states)))
        axes.set(xlabel=f"x [{of_length}]", ylabel=f"{field.label} [{unit}]")
        axes.grid(visible=True)
    for axes in grid[len(selected) :]:
        axes.remove()
    label_panels(grid[: len(selected)])
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", fontsize=8)
    figure.suptitle(comparison.heading)
    return figure


def _visible(field: NodalField, states: list[tuple[ComparedRun, StepResult]]) -> bool:
    """Return whether a field exceeds round-off on the section; tractions are compared with the pressure."""
    measure = _fields(MEE)["pressure"] if field.name.startswith("traction") else field
    largest, scale = (
        max((np.abs(each.values(run.zone, step)[middle_line(run.zone)[0]]).max() for run, step in states), default=0)
        for each in (field, measure)
    )
    return bool(largest > _ROUND_OFF * scale)
