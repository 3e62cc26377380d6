"""Solution of a study file by the engine of sweeps, on shared reduced systems."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.plugin.registry import Registry
from meeframe.plugin.validation import TableError
from meeframe.results.records import StepResult, Zone
from meeframe.results.resultants import resultants
from meeframe.study.declare import Changes, PanelTable, StudyTable, changed, load_study
from meeframe.study.quantities import largest, nodal, totals
from meeframe.study.reports.study import Panel, Study
from meeframe.study.sweep.engine import solve_points
from meeframe.study.sweep.points import Outcome, Point, PointStatus
from meeframe.study.sweep.pool import InProcess, Pool
from meeframe.system.reduced import Progress, silent


@dataclass(frozen=True, eq=False)
class Run:
    """Last load step of a run.

    Attributes
    ----------
    zone
        Contact zone.
    step
        Result of the last load step.
    converged
        True if every step converged.
    """

    zone: Zone
    step: StepResult
    converged: bool


@dataclass(frozen=True, eq=False)
class Runs:
    """Factory of the points of a study from labels and changes.

    Attributes
    ----------
    file
        The study file.
    tables
        Tables of its case file.
    folder
        Folder that relative paths in the tables refer to.
    registry
        Registry of plugins; by default everything that is installed.
    """

    file: Path
    tables: Mapping[str, Any]
    folder: Path
    registry: Registry | None = None

    def point(self, label: str, *changes: Changes) -> Point:
        """Return the point of a run. Raises CaseError, naming the study and the run, if the changed case is invalid."""
        try:
            point = Point.of(label, changed(self.tables, *changes), self.folder, self.registry)
            problems = point.problems
        except TableError as error:
            problems = error.problems
        if problems:
            raise CaseError("\n".join(f"{self.file}: {label}: {problem}" for problem in problems))
        return point

    def of(self, study: StudyTable, panel: PanelTable) -> tuple[dict[str, Point], list[Point]]:
        """Return the reference points of a panel by name, and the points of its runs."""
        names = dict.fromkeys(name for name in study.quantities_of(panel).values() if isinstance(name, str))
        references = {name: self.point(f"{panel.title}, {name}", panel.set, study.references[name]) for name in names}
        runs = [self.point(f"{panel.title}, {run.label}", panel.set, run.set) for run in panel.all_runs()]
        return references, runs


def solve_study(
    file: Path,
    cache: Path,
    progress: Progress = silent,
    registry: Registry | None = None,
    pool: Pool | None = None,
    store: Path | None = None,
) -> Study:
    """Solve the study of a file.

    Progress counts runs, each once even if several panels show it. Runs that do not converge are marked in the panel
    and raise no error.

    Parameters
    ----------
    file
        The study file.
    cache
        Folder of reduced systems, see `meeframe.model.cache`.
    progress
        Called with the stage and the fraction of it that is done.
    registry
        Registry of plugins; by default everything that is installed.
    pool
        Pool that solves the runs; by default this process.
    store
        Folder in which finished runs are stored and found again.

    Raises
    ------
    CaseError
        For an invalid study or case, for a run that a formulation, law or solver refuses, or if a quantity would be
        divided by zero.
    MeeframeError
        As `meeframe.model.cache.cached_reduce`.
    """
    table, tables = load_study(file, registry)
    planned = Runs(file, tables, (file.parent / table.case).parent, registry)
    panels = [planned.of(table, panel) for panel in table.panels]
    points = {point.key: point for references, runs in panels for point in (*references.values(), *runs)}

    def count(stage: str, fraction: float) -> None:
        progress(file.stem if stage == "points" else stage, fraction)

    results = {}
    for key, outcome in solve_points(list(points.values()), pool or InProcess(), cache, store, count):
        results[key] = _run(f"{file}: {points[key].label}", outcome)
    solved_panels = [
        _panel(
            file,
            table,
            panel,
            {name: results[point.key] for name, point in references.items()},
            [results[point.key] for point in runs],
        )
        for panel, (references, runs) in zip(table.panels, panels, strict=True)
    ]
    return Study(file.stem, table.title, table.paper, table.kind, table.scale, tuple(solved_panels))


def _run(label: str, outcome: Outcome) -> Run:
    if outcome.result is None:
        raise CaseError(f"{label}: {outcome.message}")
    return Run(outcome.result.zone, outcome.result.steps[-1], outcome.status is PointStatus.CONVERGED)


def _panel(
    file: Path, study: StudyTable, panel: PanelTable, references: Mapping[str, Run], runs: Sequence[Run]
) -> Panel:
    quantities = study.quantities_of(panel)
    tables = panel.all_runs()
    scales = {
        quantity: _scale(study, quantity, references[scale]) if isinstance(scale, str) else scale
        for quantity, scale in quantities.items()
    }
    for quantity, scale in scales.items():
        if scale == 0.0 or not np.isfinite(scale):
            raise CaseError(
                f"{file}: {panel.title}: {quantity} is divided by {quantities[quantity]!r}, where it is {scale:g}; "
                "allowed: references in which it is not zero"
            )
    return Panel(
        title=panel.title,
        axis=panel.axis,
        runs=tuple(run.label for run in tables),
        values=np.array([np.nan if run.value is None else run.value for run in tables]),
        quantities={name: tuple(_values(study, name, run) / scales[name] for run in runs) for name in quantities},
        references=scales,
        converged=tuple(run.converged and all(r.converged for r in references.values()) for run in runs),
        messages=tuple(run.step.message for run in runs),
        zones=tuple(run.zone for run in runs),
    )


def _values(study: StudyTable, quantity: str, run: Run) -> Array:
    if study.kind == "curves":
        return np.array(totals(run.step.fields)[quantity](resultants(run.zone, run.step)))
    return nodal(quantity, run.zone, run.step)


def _scale(study: StudyTable, quantity: str, reference: Run) -> float:
    if study.kind == "curves":
        return totals(reference.step.fields)[quantity](resultants(reference.zone, reference.step))
    return largest(quantity, reference.zone, reference.step)
