"""One case with all combinations of laws, formulations and solvers, on reduced systems that combinations share."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from meeframe.common.errors import MeeframeError
from meeframe.common.toml import read_toml
from meeframe.formulations.base import Formulation
from meeframe.mesh import find_contact_zone
from meeframe.mesh.body import Body
from meeframe.model.cache import distinct_bodies, system_key
from meeframe.model.case import Case, Warn, ignore, warnings_of
from meeframe.model.solve import bodies_of, joined, provenance, reduce_for_contact, solve_steps
from meeframe.plugin import registry as plugins
from meeframe.plugin.registry import Registry
from meeframe.results.figures import save_figure
from meeframe.results.output import open_output, replacing, rewriting
from meeframe.results.records import Zone, zone_of
from meeframe.study.choices import Combination, combinations, read_choices
from meeframe.study.reports.compare import ComparedRun, Comparison, comparison_figure, comparison_json
from meeframe.system.reduced import Progress, ReducedSystem, silent

NUMBERS_FILE: Final = "compare.json"
FIGURE_FILE: Final = "sections.png"


def compare(
    file: Path,
    options: Mapping[str, Sequence[str]],
    out: Path,
    overwrite: bool = False,
    registry: Registry | None = None,
    progress: Progress = silent,
    warn: Warn = ignore,
) -> Comparison:
    """Run all combinations of a case file; write compare.json, after every increment anew, and sections.png into `out`.

    options: for options of OPTIONS names or inline tables. A table stands for that of the case; a name takes the keys
    of the case's table that fit it. A conductivity law is that of both fields, but for a table with the keys electric
    and magnetic; a formulation or fundamental solution that of both bodies, but for a formulation with the keys body
    and second_body. Combinations that do not fit together, or that a formulation, solver or law refuses, say so in the
    comparison. warn: is told first what formulations and cases warn of, each once.
    Raises CaseError or PluginError, before anything is computed, for options with problems, unknown names, and if no
    combination fits, ResultError if `out` cannot be written or holds anything and overwrite is false.
    """
    registry = registry or plugins.load()
    text, tables = read_toml(file)
    chosen = combinations(file, tables, read_choices(options), registry)
    with open_output(out, overwrite):
        return _compared(chosen, str(tables.get("title", "")), text, out, progress, warn)


def _compared(
    chosen: Sequence[Combination], title: str, text: str, out: Path, progress: Progress, warn: Warn
) -> Comparison:
    """Run all combinations of a case with this title and text, in an output folder that is held."""
    cases = [combination.case for combination in chosen if combination.case is not None]
    foreseen = dict.fromkeys(warning for case in cases for warning in case.preflight)
    for warning in (*warnings_of(distinct_bodies(cases).values()), *foreseen):
        warn(warning)
    versions = {name: version for case in cases for name, version in provenance(case).versions.items()}
    comparison = Comparison(title, text, versions)
    with rewriting(out / NUMBERS_FILE) as write:
        for runs in _solved(chosen, cases[0], progress):
            comparison = replace(comparison, runs=runs)
            out.mkdir(parents=True, exist_ok=True)
            write(comparison_json(comparison))
    figure = comparison_figure(comparison)
    if figure is not None:
        with replacing(out / FIGURE_FILE) as path:
            save_figure(figure, path)
    return comparison


def _solved(chosen: Sequence[Combination], model: Case, progress: Progress) -> Iterator[tuple[ComparedRun, ...]]:
    """Return the runs so far, after every increment and at the end of every run. model: any case, as to its zone and
    steps."""
    done: tuple[ComparedRun, ...] = ()
    shared = _Shared({})
    place = find_contact_zone(model.mesh, model.zone)
    zone = Zone(place.points, place.frames, place.weights, place.cells)
    for number, combination in enumerate(chosen):
        case = combination.case
        run = ComparedRun(combination.labels, zone, model.n_increments, refusal=combination.refusal)
        try:
            if case is not None:
                shared = shared.next(case, progress)
                system = joined(case, map(shared.of, bodies_of(case)))
                run = replace(run, zone=zone_of(system), system_seconds=shared.seconds)
                progress("combinations", number / len(chosen))
                for longer in _increments(run, case, system):
                    run = longer
                    yield (*done, run)
        except MeeframeError as error:
            run = replace(run, refusal=str(error))
        if run.refusal:
            yield (*done, run)
        done = (*done, run)
    progress("combinations", 1.0)


@dataclass(frozen=True, eq=False)
class _Shared:
    """Reduced systems of a case's bodies, which the next case finds again by their keys. seconds: to compute them."""

    systems: Mapping[str, ReducedSystem]
    seconds: float = 0.0

    def of(self, body: tuple[Formulation, Body]) -> ReducedSystem:
        """Return the system of a body with its formulation."""
        return self.systems[system_key(*body)]

    def next(self, case: Case, progress: Progress) -> "_Shared":
        """Return the reduced systems of a case. Raises as meeframe.model.solve.reduce."""
        keyed = {system_key(*body): body for body in bodies_of(case)}
        if keyed.keys() == self.systems.keys():
            return self
        begin = time.perf_counter()
        found = {key: system for key, system in self.systems.items() if key in keyed}
        made = {key: reduce_for_contact(*body, progress) for key, body in keyed.items() if key not in found}
        return _Shared(found | made, time.perf_counter() - begin)


def _increments(run: ComparedRun, case: Case, system: ReducedSystem) -> Iterator[ComparedRun]:
    """Return the run after every increment. Raises CaseError if a solver or law refuses it."""
    begin = time.perf_counter()
    for step in solve_steps(case, system, boundary=False):
        run = replace(run, steps=(*run.steps, step), seconds=run.seconds + time.perf_counter() - begin)
        yield run
        begin = time.perf_counter()
