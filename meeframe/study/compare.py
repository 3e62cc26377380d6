"""Comparison of one case with all combinations of laws, formulations and solvers on shared reduced systems."""

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
from meeframe.results.figures import check_format, write_figure
from meeframe.results.output import open_output, rewriting
from meeframe.results.records import Zone, zone_of
from meeframe.study.choices import Combination, combinations, read_choices
from meeframe.study.reports.compare import ComparedRun, Comparison, comparison_figure, comparison_json
from meeframe.system.reduced import Progress, ReducedSystem, silent

NUMBERS_FILE: Final = "compare.json"
FIGURE: Final = "sections"


def compare(
    file: Path,
    options: Mapping[str, Sequence[str]],
    out: Path,
    overwrite: bool = False,
    registry: Registry | None = None,
    progress: Progress = silent,
    warn: Warn = ignore,
    step: str | None = None,
    suffix: str = "png",
) -> Comparison:
    """Run all combinations of choices for a case; write compare.json and a figure of sections.

    compare.json is rewritten after every increment. A conductivity law applies to all scalar fields unless it is a
    table with their names as keys. A formulation or fundamental solution applies to both bodies unless it is a
    formulation table with the keys body and second_body. Combinations that do not fit together, or that a formulation,
    solver or law refuses, are marked in the comparison.

    Parameters
    ----------
    file : Path
        The case file.
    options : dict of str to sequence of str
        Names or inline tables by option, see `meeframe.study.choices.OPTIONS`. A table replaces that of the case; a
        name takes the parameters in the case file that apply to it.
    out : Path
        Output folder; created if it does not exist.
    overwrite : bool, optional
        Whether earlier results in `out` are replaced.
    registry : Registry, optional
        Registry of plugins; by default everything that is installed.
    progress : callable, optional
        Called with the stage and the fraction of it that is done.
    warn : callable, optional
        Called first, with each warning of formulations and cases once.
    step : str, optional
        Increment whose fields and totals are compared, see `Comparison`.
    suffix : str, optional
        Format of the figure, of meeframe.results.figures.FORMATS.

    Returns
    -------
    Comparison
        All runs.

    Raises
    ------
    CaseError, PluginError
        Before anything is computed, for invalid options, unknown names, and if no combination fits.
    ResultError
        For an unknown format, if `out` cannot be written, or if it is not empty and overwrite is false.
    """
    check_format(suffix)
    registry = registry or plugins.load()
    text, tables = read_toml(file)
    if step is not None:  # checked as that of the figures
        tables = {**tables, "output": {**tables.get("output", {}), "step": step}}
    chosen = combinations(file, tables, read_choices(options), registry)
    with open_output(out, overwrite):
        return _run_all(chosen, str(tables.get("title", "")), text, out, progress, warn, step, suffix)


def _run_all(
    chosen: Sequence[Combination],
    title: str,
    text: str,
    out: Path,
    progress: Progress,
    warn: Warn,
    step: str | None,
    suffix: str,
) -> Comparison:
    """Run all combinations of a case into a locked output folder."""
    cases = [combination.case for combination in chosen if combination.case is not None]
    preflight = dict.fromkeys(warning for case in cases for warning in case.preflight)
    for warning in (*warnings_of(distinct_bodies(cases).values()), *preflight):
        warn(warning)
    versions = {name: version for case in cases for name, version in provenance(case).versions.items()}
    comparison = Comparison(title, text, versions, which=step)
    with rewriting(out / NUMBERS_FILE) as write:
        for runs in _solve(chosen, cases[0], progress):
            comparison = replace(comparison, runs=runs)
            out.mkdir(parents=True, exist_ok=True)
            write(comparison_json(comparison))
    write_figure(comparison_figure(comparison), out, FIGURE, suffix)
    return comparison


def _solve(chosen: Sequence[Combination], model: Case, progress: Progress) -> Iterator[tuple[ComparedRun, ...]]:
    """Yield the runs so far after every increment and every run; `model` is any case, for zone and steps."""
    done: tuple[ComparedRun, ...] = ()
    cache = _SystemCache({})
    contact_zone = find_contact_zone(model.mesh, model.zone)
    zone = Zone(contact_zone.points, contact_zone.frames, contact_zone.weights, contact_zone.cells)
    for number, combination in enumerate(chosen):
        case = combination.case
        run = ComparedRun(combination.labels, zone, model.n_increments, refusal=combination.refusal)
        try:
            if case is not None:
                cache = cache.next(case, progress)
                system = joined(case, map(cache.of, bodies_of(case)))
                run = replace(run, zone=zone_of(system), system_seconds=cache.seconds)
                progress("combinations", number / len(chosen))
                for run_so_far in _increments(run, case, system):
                    run = run_so_far
                    yield (*done, run)
        except MeeframeError as error:
            run = replace(run, refusal=str(error))
        if run.refusal:
            yield (*done, run)
        done = (*done, run)
    progress("combinations", 1.0)


@dataclass(frozen=True, eq=False)
class _SystemCache:
    """Reduced systems of the bodies of a case by key, which the next case reuses; seconds: time to compute them."""

    systems: Mapping[str, ReducedSystem]
    seconds: float = 0.0

    def of(self, body: tuple[Formulation, Body]) -> ReducedSystem:
        """Return the system of a body with its formulation."""
        return self.systems[system_key(*body)]

    def next(self, case: Case, progress: Progress) -> "_SystemCache":
        """Return the cache with the reduced systems of a case. Raises as meeframe.model.solve.reduce."""
        keyed = {system_key(*body): body for body in bodies_of(case)}
        if keyed.keys() == self.systems.keys():
            return self
        begin = time.perf_counter()
        reused = {key: system for key, system in self.systems.items() if key in keyed}
        computed = {key: reduce_for_contact(*body, progress) for key, body in keyed.items() if key not in reused}
        return _SystemCache(reused | computed, time.perf_counter() - begin)


def _increments(run: ComparedRun, case: Case, system: ReducedSystem) -> Iterator[ComparedRun]:
    """Yield the run after every increment. Raises CaseError if a solver or law refuses it."""
    begin = time.perf_counter()
    for step in solve_steps(case, system, boundary=False):
        run = replace(run, steps=(*run.steps, step), seconds=run.seconds + time.perf_counter() - begin)
        yield run
        begin = time.perf_counter()
