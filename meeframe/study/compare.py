"""One case with all combinations of laws, formulations and solvers, on reduced systems that combinations share."""

import dataclasses
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, Final

from meeframe.case.cache import system_key
from meeframe.case.case import Case
from meeframe.case.load import case_from_tables
from meeframe.case.schema import CaseTable
from meeframe.case.solve import joined, provenance, reduce_body, solve_steps, zone_of
from meeframe.core.body import Body
from meeframe.core.errors import CaseError, MeeframeError
from meeframe.core.formulation import Formulation, Progress, ReducedSystem, silent
from meeframe.io.output import check_output, replacing
from meeframe.plugin import registry as plugins
from meeframe.plugin.registry import Kind, Registry
from meeframe.plugin.validation import TableError
from meeframe.report.compare import ComparedRun, Comparison, comparison_figure, comparison_json
from meeframe.report.figures import save_figure
from meeframe.solvers import Limits
from meeframe.study.declare import read_tables, words

NUMBERS_FILE: Final = "compare.json"
FIGURE_FILE: Final = "sections.png"

# what decides on the reduced system comes first, so that it varies slowest and one system is held at a time
OPTIONS: Final = {
    "formulation": Kind.FORMULATION,
    "fundamental-solution": Kind.FUNDAMENTAL_SOLUTION,
    "contact-law": Kind.CONTACT_LAW,
    "conductivity-law": Kind.CONDUCTIVITY_LAW,
    "solver": Kind.SOLVER,
}
"""What can be varied, by the option of the command line."""

_FIELDS: Final = ("electric", "magnetic")


@dataclass(frozen=True)
class Choice:
    """One value of an option: the name of what is registered, or a table as in a case file. label: both in words."""

    label: str
    value: str | Mapping[str, Any]

    @classmethod
    def read(cls, option: str, text: str) -> "Choice":
        """From the command line: a name, or an inline table of TOML. Raises CaseError."""
        if not text.strip().startswith("{"):
            return cls(text, text)
        try:
            table = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError as error:
            raise CaseError(f"--{option} {text}: is no inline table of TOML: {error}") from None
        return cls(words(table), table)


def compare(
    file: Path,
    options: Mapping[str, Sequence[str]],
    out: Path,
    overwrite: bool = False,
    registry: Registry | None = None,
    progress: Progress = silent,
) -> Comparison:
    """Run all combinations of a case file; write compare.json, after every increment anew, and sections.png into `out`.

    options: for options of OPTIONS names or inline tables. A table stands for that of the case; a name takes the keys
    of the case's table that fit it. A conductivity law is that of both fields, but for a table with the keys electric
    and magnetic. Combinations that a solver or law refuses say so in the comparison.
    Raises CaseError, before anything is computed, for options or combinations with problems, ResultError if `out`
    cannot be written or holds anything and overwrite is false; errors of the reduced systems as they come.
    """
    registry = registry or plugins.load()
    tables = read_tables(file)
    cases = _cases(file, tables, _choices(options), registry)
    check_output(out, overwrite)
    versions = {name: version for _, case in cases for name, version in provenance(case).versions.items()}
    comparison = Comparison(str(tables.get("title", "")), file.read_text(encoding="utf-8"), versions)
    for runs in _solved(cases, progress):
        comparison = replace(comparison, runs=runs)
        out.mkdir(parents=True, exist_ok=True)
        with replacing(out / NUMBERS_FILE) as path:
            path.write_text(comparison_json(comparison), encoding="utf-8")
    figure = comparison_figure(comparison)
    if figure is not None:
        with replacing(out / FIGURE_FILE) as path:
            save_figure(figure, path)
    return comparison


def _choices(options: Mapping[str, Sequence[str]]) -> dict[str, list[Choice]]:
    """The choices of the options that have any, in the order of OPTIONS."""
    chosen = {option: [Choice.read(option, text) for text in options.get(option, ())] for option in OPTIONS}
    for option, found in chosen.items():
        labels = [choice.label for choice in found]
        twice = next((label for label in labels if labels.count(label) > 1), None)
        if twice is not None:
            raise CaseError(f"--{option} {twice}: given twice")
    chosen = {option: found for option, found in chosen.items() if found}
    if not chosen:
        raise CaseError(f"nothing to compare; give at least one of {', '.join(f'--{option}' for option in OPTIONS)}")
    return chosen


def _cases(
    file: Path, tables: Mapping[str, Any], chosen: Mapping[str, list[Choice]], registry: Registry
) -> list[tuple[dict[str, str], Case]]:
    """Every combination with its case. Raises CaseError that names the file and the combination."""
    cases = []
    for combination in product(*chosen.values()):
        changed = deepcopy(dict(tables))
        labels = {option: choice.label for option, choice in zip(chosen, combination, strict=True)}
        try:
            for option, choice in zip(chosen, combination, strict=True):
                _enter(changed, option, choice.value, registry)
            cases.append((labels, case_from_tables(changed, registry, file.parent)))
        except TableError as error:
            where = f"{file}: {', '.join(labels.values())}"
            raise CaseError("\n".join(f"{where}: {problem}" for problem in error.problems)) from None
    return cases


def _enter(tables: dict[str, Any], option: str, value: str | Mapping[str, Any], registry: Registry) -> None:
    """Put a choice into the tables of a case."""
    kind = OPTIONS[option]
    if option == "contact-law":
        contact = tables.setdefault("contact", {})
        contact["law"] = _fitted(value, contact.get("law"), kind, registry)
    elif option == "conductivity-law":
        if isinstance(value, Mapping) and "name" not in value:
            tables["conductivity"] = dict(value)
            return
        conductivity = tables.setdefault("conductivity", {})
        for field in _FIELDS:
            conductivity[field] = _fitted(value, conductivity.get(field), kind, registry)
    elif option == "fundamental-solution":
        formulation = _table(tables.get("formulation", CaseTable.model_fields["formulation"].default))
        formulation["fundamental_solution"] = _fitted(value, formulation.get("fundamental_solution"), kind, registry)
        tables["formulation"] = formulation
    else:
        tables[option] = _fitted(value, tables.get(option), kind, registry)


def _fitted(value: str | Mapping[str, Any], present: Any, kind: Kind, registry: Registry) -> dict[str, Any]:
    """The table of a choice: a name takes those keys present that it has. Raises PluginError if it is unknown."""
    if not isinstance(value, str):
        return dict(value)
    factory = registry.get(kind, value).factory
    records = [factory, Limits] if kind is Kind.SOLVER else [factory]
    keys = {
        field.name for record in records if dataclasses.is_dataclass(record) for field in dataclasses.fields(record)
    }
    return {"name": value, **{key: item for key, item in _table(present).items() if key in keys}}


def _table(value: Any) -> dict[str, Any]:
    """A name, a table or nothing as a table."""
    if isinstance(value, str):
        return {"name": value}
    return dict(value) if isinstance(value, Mapping) else {}


def _solved(cases: Sequence[tuple[dict[str, str], Case]], progress: Progress) -> Iterator[tuple[ComparedRun, ...]]:
    """The runs so far, after every increment and at the end of every run."""
    done: tuple[ComparedRun, ...] = ()
    shared = _Shared({})
    for number, (labels, case) in enumerate(cases):
        shared = shared.next(case, progress)
        system = joined(case, shared.of)
        progress("combinations", number / len(cases))
        run = ComparedRun(labels, zone_of(system), case.n_increments, system_seconds=shared.seconds)
        for later in _increments(run, case, system):
            yield (*done, later)
            run = later
        done = (*done, run)
    progress("combinations", 1.0)


@dataclass(frozen=True, eq=False)
class _Shared:
    """Reduced systems of a case's bodies, which the next case finds again by their keys. seconds: to compute them."""

    systems: Mapping[str, ReducedSystem]
    seconds: float = 0.0

    def of(self, formulation: Formulation, body: Body) -> ReducedSystem:
        """The system of a body."""
        return self.systems[system_key(formulation, body)]

    def next(self, case: Case, progress: Progress) -> "_Shared":
        """Those of a case. Raises as meeframe.case.solve.reduce."""
        bodies = [(case.formulation, case.body)]
        if case.counter is not None:
            bodies.append((case.counter.formulation, case.counter.body))
        keyed = {system_key(*body): body for body in bodies}
        if keyed.keys() == self.systems.keys():
            return self
        begin = time.perf_counter()
        found = {key: system for key, system in self.systems.items() if key in keyed}
        made = {key: reduce_body(*body, progress) for key, body in keyed.items() if key not in found}
        return _Shared(found | made, time.perf_counter() - begin)


def _increments(run: ComparedRun, case: Case, system: ReducedSystem) -> Iterator[ComparedRun]:
    """The run after every increment, or with the reason why it cannot be made."""
    begin = time.perf_counter()
    try:
        for step in solve_steps(case, system, boundary=False):
            run = replace(run, steps=(*run.steps, step), seconds=run.seconds + time.perf_counter() - begin)
            yield run
            begin = time.perf_counter()
    except MeeframeError as error:
        yield replace(run, refusal=str(error))
