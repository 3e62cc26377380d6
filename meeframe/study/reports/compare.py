"""Table, figure and JSON of a comparison."""

import json
import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from meeframe.common.literal import LiteralTable
from meeframe.contact.problem import Status
from meeframe.fields import MEE, Array, FieldSet
from meeframe.results import schema
from meeframe.results.canvas import label_panels, line_style, prefixed, sheet, styled
from meeframe.results.picture import lengths
from meeframe.results.records import StepResult, Zone
from meeframe.results.schema import NodalField, Total
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
    """

    title: str
    text: str
    versions: Mapping[str, str]
    runs: tuple[ComparedRun, ...] = ()

    @property
    def first(self) -> ComparedRun:
        """The reference run, which is the first one that is not refused."""
        return next((run for run in self.runs if not run.refusal), self.runs[0])

    @property
    def fields(self) -> FieldSet:
        """Field set of the case."""
        return next((run.fields for run in self.runs if run.steps), MEE)


def differences(run: ComparedRun, first: ComparedRun) -> dict[str, float | None]:
    """Return the relative differences of the last increment of a run from that of the first run, by quantity.

    Parameters
    ----------
    run
        The run.
    first
        The reference run.

    Returns
    -------
    dict of str to float or None
        For totals the modulus of the difference over the modulus in the first run; for fields the largest difference
        over the largest modulus. None if the first is zero and the other is not, or if there is nothing to compare.
    """
    if not run.steps or len(run.steps) != len(first.steps):
        return dict.fromkeys([*_totals(first.fields), *_fields(first.fields)])
    state, reference_state = ((r.zone, r.steps[-1]) for r in (run, first))
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

    Each run has choices, status, times and increments, and for its last increment the fields on the zone and the
    differences from the reference run. Numbers that are not finite become null.
    """
    runs = [_numbers(run, comparison.first) for run in comparison.runs]
    head = {"title": comparison.title, "case": comparison.text, "versions": dict(comparison.versions)}
    return json.dumps({**head, "runs": runs}, indent=1, allow_nan=False) + "\n"


def _numbers(run: ComparedRun, first: ComparedRun) -> dict[str, Any]:
    last = run.steps[-1] if run.steps else None
    return {
        "label": run.label,
        "choices": dict(run.choices),
        "status": run.status,
        "message": run.refusal or (last.message if last else ""),
        "seconds": run.seconds,
        "system_seconds": run.system_seconds,
        "iterations": sum(step.iterations for step in run.steps),
        "increments": [_increment(run.zone, step) for step in run.steps],
        "differences": differences(run, first),
        "points": run.zone.points.tolist(),
        "fields": {name: _plain(field.values(run.zone, last)) for name, field in _fields(run.fields).items()}
        if last
        else {},
    }


def _increment(zone: Zone, step: StepResult) -> dict[str, Any]:
    totals = schema.totals(zone, step)
    return {
        "step": step.step,
        "increment": step.increment,
        "status": str(step.status),
        "iterations": step.iterations,
        "residual": _plain(step.residual),
        **{name: _plain(totals[name]) for name in _totals(step.fields)},
    }


def _plain(value: Any) -> Any:
    """Return a value as lists and numbers of JSON."""
    if isinstance(value, np.ndarray | list):
        return [_plain(item) for item in value]
    return float(value) if math.isfinite(value) else None


def comparison_table(comparison: Comparison) -> RenderableType:
    """Return tables with a column for each run: totals of the last increment, work, and relative differences."""
    runs = comparison.runs
    blocks = [runs[begin : begin + _RUNS_PER_TABLE] for begin in range(0, len(runs), _RUNS_PER_TABLE)]
    done = [run for run in runs if run.steps]
    last = [schema.totals(run.zone, run.steps[-1]) for run in done]
    selected = schema.shown_totals(schema.View.COMPARISON, last, comparison.fields)
    known = _fields(comparison.fields).values()
    fields = [field for field in known if any(field.values(run.zone, run.steps[-1]).any() for run in done)]
    titles = [comparison.title, *[""] * (len(blocks) - 1)]
    tables = [
        _table(title, block, comparison.first, selected, fields) for title, block in zip(titles, blocks, strict=True)
    ]
    return Group(
        *tables, *(Text(f"{run.label}: {run.refusal}") for run in runs if run.refusal), *_notes(done, comparison.first)
    )


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
    title: str, runs: Sequence[ComparedRun], first: ComparedRun, totals: Sequence[Total], fields: Sequence[NodalField]
) -> LiteralTable:
    table = LiteralTable(title)
    table.add_column("")
    table.add_column("unit")
    for run in runs:
        table.add_column("\n".join(run.choices.values()), justify="right")
    for total in totals:
        for i, label in enumerate(total.labels):
            values = [float(_total(total.name, run)[i]) if run.steps else None for run in runs]
            table.add_row(label, total.unit, *map(_format, values))
    columns = [differences(run, first) for run in runs]
    for name, words in (("force", "force"), *((field.name, field.label) for field in fields)):
        table.add_row(f"difference in {words}", "%", *(_format(column[name], 100.0, ".3g") for column in columns))
    table.add_row("iterations", "", *(str(sum(step.iterations for step in run.steps)) for run in runs))
    table.add_row("time of the steps", "s", *(f"{run.seconds:.3g}" for run in runs))
    table.add_row("time of the reduced system", "s", *(f"{run.system_seconds:.3g}" for run in runs))
    table.add_row("status", "", *(run.status for run in runs))
    return table


def _total(name: str, run: ComparedRun) -> Array:
    """Return a total at the end of a run, (1,) or (k,) for k components."""
    return np.atleast_1d(schema.totals(run.zone, run.steps[-1])[name])


def _format(value: float | None, factor: float = 1.0, form: str = ".6g") -> str:
    return "-" if value is None else f"{factor * value:{form}}"


@styled
def comparison_figure(comparison: Comparison) -> "Figure | None":
    """Return sections along x through the middle of the zone with all runs; None if no increment is finished."""
    done = [run for run in comparison.runs if run.steps]
    selected = [field for field in _fields(comparison.fields).values() if _visible(field, done)]
    if not selected:
        return None
    labels = [textwrap.fill(run.label, _LEGEND_WIDTH) for run in done]
    lines = sum(label.count("\n") + 1 for label in labels)
    figure = sheet((9.0, 3.2 * math.ceil(len(selected) / 2) + 0.2 * lines))
    grid = figure.subplots(math.ceil(len(selected) / 2), 2, squeeze=False).ravel()
    length, of_length = lengths(run.zone for run in done)
    for axes, field in zip(grid, selected, strict=False):
        values = [field.values(run.zone, run.steps[-1]) for run in done]
        factor, unit = prefixed(np.concatenate(values), field.unit)
        for number, (run, nodal) in enumerate(zip(done, values, strict=True)):
            nodes, x = middle_line(run.zone)
            axes.plot(x / length, nodal[nodes] / factor, label=labels[number], **line_style(number, len(done)))
        axes.set(xlabel=f"x [{of_length}]", ylabel=f"{field.label} [{unit}]")
        axes.grid(visible=True)
    for axes in grid[len(selected) :]:
        axes.remove()
    label_panels(grid[: len(selected)])
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", fontsize=8)
    figure.suptitle(comparison.title)
    return figure


def _visible(field: NodalField, runs: list[ComparedRun]) -> bool:
    """Return whether a field exceeds round-off on the section; tractions are compared with the pressure."""
    measure = _fields(MEE)["pressure"] if field.name.startswith("traction") else field
    largest, scale = (
        max(
            (np.abs(each.values(run.zone, run.steps[-1])[middle_line(run.zone)[0]]).max() for run in runs),
            default=0,
        )
        for each in (field, measure)
    )
    return bool(largest > _ROUND_OFF * scale)
