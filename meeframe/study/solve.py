"""From a study file to its numbers: each run solved on the one reduced system that it shares with the others."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meeframe.case.cache import cached_reduce
from meeframe.case.load import case_from_tables
from meeframe.case.solve import solve_steps, zone_of
from meeframe.core.contact import Status
from meeframe.core.errors import CaseError
from meeframe.core.fields import Array
from meeframe.core.formulation import Progress, silent
from meeframe.core.result import StepResult, Zone, resultants
from meeframe.plugin.registry import Registry
from meeframe.plugin.validation import TableError
from meeframe.report.study import Panel, Study
from meeframe.study.declare import Changes, PanelTable, StudyTable, changed, load_study
from meeframe.study.quantities import NODAL, TOTALS, largest


@dataclass(frozen=True, eq=False)
class Run:
    """The last load step of a run, and whether every step converged."""

    zone: Zone
    step: StepResult
    converged: bool


@dataclass(frozen=True, eq=False)
class Runner:
    """Solves a case with keys changed. file: of the study; tables: of its case; folder: of the cache."""

    file: Path
    tables: Mapping[str, Any]
    case_folder: Path
    folder: Path
    registry: Registry | None = None
    progress: Progress = silent

    def __call__(self, label: str, *changes: Changes) -> Run:
        """Raises CaseError that names the study and the run if the changed case is not one; else as cached_reduce."""
        try:
            case = case_from_tables(changed(self.tables, *changes), self.registry, self.case_folder)
        except TableError as error:
            raise CaseError("\n".join(f"{self.file}: {label}: {problem}" for problem in error.problems)) from None
        system = cached_reduce(case, self.folder, self.progress)
        steps = tuple(solve_steps(case, system, boundary=False))
        return Run(zone_of(system), steps[-1], all(step.status is Status.CONVERGED for step in steps))


def solve_study(file: Path, cache: Path, progress: Progress = silent, registry: Registry | None = None) -> Study:
    """The study of a file, solved; cache: folder of reduced systems, see meeframe.case.cache.

    Progress counts panels. Runs that do not converge raise nothing: the panel says so.
    Raises CaseError for a study or a case with problems, or if a quantity would be divided by zero; else as
    cached_reduce.
    """
    table, tables = load_study(file)
    runner = Runner(file, tables, (file.parent / table.case).parent, cache, registry, progress)
    panels, total = [], len(table.panels)
    for number, panel in enumerate(table.panels):
        progress(file.stem, number / total)
        panels.append(_panel(table, panel, runner))
    progress(file.stem, 1.0)
    return Study(file.stem, table.title, table.paper, table.kind, table.scale, tuple(panels))


def _panel(study: StudyTable, panel: PanelTable, runner: Runner) -> Panel:
    shown = study.shown(panel)
    names = dict.fromkeys(name for name in shown.values() if isinstance(name, str))
    references = {name: runner(f"{panel.title}, {name}", panel.set, study.references[name]) for name in names}
    tables = panel.all_runs()
    runs = [runner(f"{panel.title}, {run.label}", panel.set, run.set) for run in tables]
    scales = {
        quantity: _scale(study, quantity, references[scale]) if isinstance(scale, str) else scale
        for quantity, scale in shown.items()
    }
    for quantity, scale in scales.items():
        if scale == 0.0 or not np.isfinite(scale):
            raise CaseError(
                f"{runner.file}: {panel.title}: {quantity} is divided by {shown[quantity]!r}, where it is {scale:g}; "
                "allowed: references in which it is not zero"
            )
    return Panel(
        title=panel.title,
        axis=panel.axis,
        runs=tuple(run.label for run in tables),
        values=np.array([np.nan if run.value is None else run.value for run in tables]),
        quantities={name: tuple(_values(study, name, run) / scales[name] for run in runs) for name in shown},
        references=scales,
        converged=tuple(run.converged and all(r.converged for r in references.values()) for run in runs),
        messages=tuple(run.step.message for run in runs),
        zones=tuple(run.zone for run in runs),
    )


def _values(study: StudyTable, quantity: str, run: Run) -> Array:
    if study.kind == "curves":
        return np.array(TOTALS[quantity](resultants(run.zone, run.step)))
    return NODAL[quantity](run.zone, run.step)


def _scale(study: StudyTable, quantity: str, reference: Run) -> float:
    if study.kind == "curves":
        return TOTALS[quantity](resultants(reference.zone, reference.step))
    return largest(quantity, reference.zone, reference.step)
