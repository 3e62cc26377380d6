"""Table, figure and JSON of a comparison: what its runs share and where they differ."""

import json
import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from meeframe.contact.problem import Status
from meeframe.fields import Array
from meeframe.results.canvas import prefixed, sheet
from meeframe.results.picture import lengths
from meeframe.results.records import Resultants, StepResult, Zone, resultants
from meeframe.study.reports.study import middle_line

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REFUSED: Final = "refused"
UNFINISHED: Final = "unfinished"
_ROUND_OFF: Final = 1e-6
"""Of the largest pressure: smaller tangential tractions are not drawn."""

_TOTALS: Final[Mapping[str, tuple[str, Callable[[Resultants], Any]]]] = {
    "force": ("N", lambda totals: totals.force),
    "charge": ("C", lambda totals: totals.charge),
    "magnetic_flux": ("Wb", lambda totals: totals.magnetic_flux),
    "contact_area": ("m^2", lambda totals: totals.contact_area),
    "max_pressure": ("Pa", lambda totals: totals.max_pressure),
    "max_tension": ("Pa", lambda totals: totals.max_tension),
    "max_abs_electric_potential": ("V", lambda totals: totals.max_abs_electric_potential),
    "max_abs_magnetic_potential": ("A", lambda totals: totals.max_abs_magnetic_potential),
}
_SIDE_BY_SIDE: Final = 4
"""Runs next to each other in the table: more would not fit in a terminal."""
_LEGEND: Final = 100
"""Letters in a line of the figure's legend."""
_STYLES: Final = ("-", "--", ":")
_OCCASIONAL: Final = {
    "max_tension": ("max_tension",),
    "charge": ("charge", "max_abs_electric_potential"),
    "max_abs_electric_potential": ("charge", "max_abs_electric_potential"),
    "magnetic_flux": ("magnetic_flux", "max_abs_magnetic_potential"),
    "max_abs_magnetic_potential": ("magnetic_flux", "max_abs_magnetic_potential"),
}
"""Totals that the table shows only where a run has some of these."""
_FIELDS: Final[Mapping[str, tuple[str, Callable[[Zone, StepResult], Array]]]] = {
    "pressure": ("Pa", lambda _, step: 0.0 - step.traction[:, 2]),
    "traction_x": ("Pa", lambda zone, step: _along(zone, step, 0)),
    "traction_y": ("Pa", lambda zone, step: _along(zone, step, 1)),
    "electric_potential": ("V", lambda _, step: step.potentials[:, 0]),
    "magnetic_potential": ("A", lambda _, step: step.potentials[:, 1]),
}
"""Nodal fields: pressure and tangential tractions on the body along global x1, x2, potentials of the body."""


@dataclass(frozen=True, eq=False)
class ComparedRun:
    """One combination. choices: what was chosen, by option; zone, steps: as in Result; planned: increments of the case;
    seconds: of the increments so far; system_seconds: of the reduced system, which others may share; refusal: why a
    formulation, solver or law cannot take the case, if so."""

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
    def status(self) -> str:
        """'converged' if all increments did; else that of the first that did not, 'refused' or 'unfinished'."""
        failed = next((str(step.status) for step in self.steps if step.status is not Status.CONVERGED), "")
        if self.refusal or failed:
            return REFUSED if self.refusal else failed
        return str(Status.CONVERGED) if len(self.steps) == self.planned else UNFINISHED


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs of one case with combinations of laws, formulations and solvers; title, text: of the case; versions: of the
    software."""

    title: str
    text: str
    versions: Mapping[str, str]
    runs: tuple[ComparedRun, ...] = ()

    @property
    def first(self) -> ComparedRun:
        """The run that the others are measured by: the first that is not refused."""
        return next((run for run in self.runs if not run.refusal), self.runs[0])


def differences(run: ComparedRun, first: ComparedRun) -> dict[str, float | None]:
    """Return how far the last increment of a run is from that of the first one, by quantity.

    Totals: modulus of the difference over that of the first; fields: largest difference over largest modulus. None
    where the first is zero and the run is not, or where there is nothing to compare.
    """
    if not run.steps or len(run.steps) != len(first.steps):
        return dict.fromkeys([*_TOTALS, *_FIELDS])
    mine, others = ((r.zone, r.steps[-1]) for r in (run, first))
    found = {
        name: _relative(np.linalg.norm, np.atleast_1d(of(resultants(*mine))), np.atleast_1d(of(resultants(*others))))
        for name, (_, of) in _TOTALS.items()
    }
    same = run.zone.points.shape == first.zone.points.shape and np.allclose(run.zone.points, first.zone.points)
    for name, (_, of) in _FIELDS.items():
        found[name] = _relative(lambda field: np.abs(field).max(), of(*mine), of(*others)) if same else None
    return found


def _relative(size: Callable[[Array], Any], value: Array, reference: Array) -> float | None:
    difference, scale = float(size(value - reference)), float(size(reference))
    if difference == 0.0:
        return 0.0
    return difference / scale if scale > 0.0 and math.isfinite(difference) else None


def _along(zone: Zone, step: StepResult, axis: int) -> Array:
    along: Array = np.einsum("na,na->n", step.traction[:, :2], zone.frames[:, :2, axis])
    return along


def comparison_json(comparison: Comparison) -> str:
    """Return all numbers: of each run its choices, status, times and increments, and of its last increment the fields
    on the zone and the differences to the first run that is not refused. Numbers that are not finite become null."""
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
        "fields": {name: _plain(of(run.zone, last)) for name, (_, of) in _FIELDS.items()} if last else {},
    }


def _increment(zone: Zone, step: StepResult) -> dict[str, Any]:
    totals = resultants(zone, step)
    return {
        "step": step.step,
        "increment": step.increment,
        "status": str(step.status),
        "iterations": step.iterations,
        "residual": _plain(step.residual),
        **{name: _plain(of(totals)) for name, (_, of) in _TOTALS.items()},
    }


def _plain(value: Any) -> Any:
    """List and numbers of JSON."""
    if isinstance(value, np.ndarray | list):
        return [_plain(item) for item in value]
    return float(value) if math.isfinite(value) else None


def comparison_table(comparison: Comparison) -> RenderableType:
    """Return a column for each run, so many side by side: last increment, work, and differences to comparison.first."""
    runs = comparison.runs
    blocks = [runs[begin : begin + _SIDE_BY_SIDE] for begin in range(0, len(runs), _SIDE_BY_SIDE)]
    done = [run for run in runs if run.steps]
    there = {name for name in _TOTALS if any(_total(name, run).any() for run in done)}
    shown = [name for name in _TOTALS if name not in _OCCASIONAL or there & set(_OCCASIONAL[name])]
    fields = [name for name in _FIELDS if any(_FIELDS[name][1](run.zone, run.steps[-1]).any() for run in done)]
    tables = [_table(block, comparison.first, shown, fields) for block in blocks]
    tables[0].title, tables[0].title_justify = comparison.title or None, "left"
    return Group(*tables, *(Text(f"{run.label}: {run.refusal}") for run in runs if run.refusal), *_remarks(done))


def _remarks(runs: Sequence[ComparedRun]) -> Iterator[Text]:
    """Return what to think of the numbers of the table."""
    yield Text("Times contain the compilation of kernels that nothing before has used: a second time they do not.")
    if len({run.choices.get("formulation") for run in runs}) > 1:
        yield Text(
            "Formulations differ by the errors of this mesh, each by its own: finer meshes bring them together, and "
            "`meeframe verify CASE.toml` tells whether they agree within these errors."
        )


def _table(runs: Sequence[ComparedRun], first: ComparedRun, totals: Sequence[str], fields: Sequence[str]) -> Table:
    table = Table()
    table.add_column("")
    table.add_column("unit")
    for run in runs:
        table.add_column("\n".join(run.choices.values()), justify="right")
    for name in totals:
        parts = ("x", "y", "z") if name == "force" else ("",)
        for i, part in enumerate(parts):
            values = [float(_total(name, run)[i]) if run.steps else None for run in runs]
            table.add_row(f"{_words(name)} {part}".strip(), _TOTALS[name][0], *map(_shown, values))
    apart = [differences(run, first) for run in runs]
    for name in ("force", *fields):
        table.add_row(f"difference in {_words(name)}", "%", *(_shown(d[name], 100.0, ".3g") for d in apart))
    table.add_row("iterations", "", *(str(sum(step.iterations for step in run.steps)) for run in runs))
    table.add_row("time of the steps", "s", *(f"{run.seconds:.3g}" for run in runs))
    table.add_row("time of the reduced system", "s", *(f"{run.system_seconds:.3g}" for run in runs))
    table.add_row("status", "", *(run.status for run in runs))
    return table


def _total(name: str, run: ComparedRun) -> Array:
    """Return one of _TOTALS at the end of a run, (1,) or (3,)."""
    return np.atleast_1d(_TOTALS[name][1](resultants(run.zone, run.steps[-1])))


def _words(name: str) -> str:
    return name.replace("max_abs_", "largest |").replace("max_", "largest ").replace("_", " ") + "|" * ("abs" in name)


def _shown(value: float | None, factor: float = 1.0, form: str = ".6g") -> str:
    return "-" if value is None else f"{factor * value:{form}}"


def comparison_figure(comparison: Comparison) -> "Figure | None":
    """Return the sections along x through the middle of the zone, the runs over each other; None if no increment is
    finished."""
    done = [run for run in comparison.runs if run.steps]
    shown = [name for name in _FIELDS if _visible(name, done)]
    if not shown:
        return None
    labels = [textwrap.fill(run.label, _LEGEND) for run in done]
    lines = sum(label.count("\n") + 1 for label in labels)
    figure = sheet((9.0, 3.2 * math.ceil(len(shown) / 2) + 0.2 * lines))
    grid = figure.subplots(math.ceil(len(shown) / 2), 2, squeeze=False).ravel()
    length, of_length = lengths(run.zone for run in done)
    for axes, name in zip(grid, shown, strict=False):
        fields = [_FIELDS[name][1](run.zone, run.steps[-1]) for run in done]
        factor, unit = prefixed(np.concatenate(fields), _FIELDS[name][0])
        for number, (run, field) in enumerate(zip(done, fields, strict=True)):
            nodes, x = middle_line(run.zone)
            # wide lines below narrow ones, so that those which coincide are seen
            style = {
                "lw": 1.0 + 3.0 * (1.0 - (number + 1) / len(done)),
                "color": f"C{number}",
                "ls": _STYLES[number // 10 % len(_STYLES)],  # there are ten colours
                "marker": "o",
                "ms": 2.5,
            }
            axes.plot(x / length, field[nodes] / factor, label=labels[number], **style)
        axes.set(xlabel=f"x [{of_length}]", ylabel=f"{_words(name)} [{unit}]")
        axes.grid(alpha=0.3)
    for axes in grid[len(shown) :]:
        axes.remove()
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", fontsize=8)
    figure.suptitle(comparison.title)
    return figure


def _visible(name: str, runs: list[ComparedRun]) -> bool:
    """Return whether a field is more than round-off on the section; tractions are measured by the pressure."""
    measure = "pressure" if name.startswith("traction") else name
    largest, scale = (
        max(
            (np.abs(_FIELDS[which][1](run.zone, run.steps[-1])[middle_line(run.zone)[0]]).max() for run in runs),
            default=0,
        )
        for which in (name, measure)
    )
    return bool(largest > _ROUND_OFF * scale)
