"""Choices of a comparison from the command line, and the case of each of their combinations."""

import dataclasses
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, Final

from meeframe.common.errors import CaseError
from meeframe.common.toml import toml_tables
from meeframe.fields import MEE
from meeframe.model.case import Case
from meeframe.model.load import case_from_tables
from meeframe.model.values import DEFAULT_FORMULATION
from meeframe.plugin.registry import Kind, Registry
from meeframe.plugin.validation import TableError, choices
from meeframe.solvers import StoppingCriteria
from meeframe.study.declare import words

# what decides on the reduced system comes first, so that it varies slowest and one system is held at a time
OPTIONS: Final = {
    "formulation": Kind.FORMULATION,
    "fundamental-solution": Kind.FUNDAMENTAL_SOLUTION,
    "contact-law": Kind.CONTACT_LAW,
    "conductivity-law": Kind.CONDUCTIVITY_LAW,
    "solver": Kind.SOLVER,
}
"""What can be varied, by the option of the command line."""

NOTHING: Final = "-"
"""Choice of a fundamental solution where no formulation takes one."""

_SOLUTION: Final = "fundamental_solution"
_FIELDS: Final = MEE.names
_BODIES: Final = ("body", "second_body")


@dataclass(frozen=True)
class Choice:
    """One value of an option: the name of what is registered, or a table as in a case file. label: both in words."""

    label: str
    value: str | Mapping[str, Any]

    @classmethod
    def read(cls, option: str, text: str) -> "Choice":
        """Read a choice from the command line: a name, or an inline table of TOML. Raises CaseError."""
        if not text.strip().startswith("{"):
            return cls(text, text)
        try:
            table = toml_tables(f"value = {text}")["value"]
        except (ValueError, RecursionError) as error:
            raise CaseError(f"--{option} {text}: is no inline table of TOML: {error}") from None
        return cls(words(table), table)


def read_choices(options: Mapping[str, Sequence[str]]) -> dict[str, list[Choice]]:
    """Return the choices of the options that have any, in the order of OPTIONS. Raises CaseError, also if there are
    none."""
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


@dataclass(frozen=True, eq=False)
class Combination:
    """labels: of its choices, by option; case: with them, None if they do not fit together; refusal: why not, if so."""

    labels: Mapping[str, str]
    case: Case | None
    refusal: str = ""


def combinations(
    file: Path, tables: Mapping[str, Any], chosen: Mapping[str, list[Choice]], registry: Registry
) -> list[Combination]:
    """Return every combination of choices with the tables of a case, at least one of which fits.

    Formulations that take no fundamental solution appear once, with NOTHING for it. Raises CaseError that names the
    file and the combination for unknown names in tables and if no combination fits, PluginError for other unknown ones.
    """
    found: list[Combination] = []
    problems: dict[str, str] = {}
    cause: BaseException | None = None
    for combination in product(*chosen.values()):
        changed = deepcopy(dict(tables))
        labels = {option: choice.label for option, choice in zip(chosen, combination, strict=True)}
        for option, choice in zip(chosen, combination, strict=True):
            if not enter(changed, option, choice.value, registry):
                labels[option] = NOTHING
        if any(labels == other.labels for other in found):
            continue
        try:
            found.append(Combination(labels, case_from_tables(changed, registry, file.parent)))
        except TableError as error:
            told = {str(problem): f"{file}: {', '.join(labels.values())}: {problem}" for problem in error.problems}
            if any(problem.unknown for problem in error.problems):
                raise CaseError("\n".join(told.values())) from None
            cause = cause or error.__cause__
            problems |= {text: line for text, line in told.items() if text not in problems}
            found.append(Combination(labels, None, str(error)))
    if all(combination.case is None for combination in found):
        raise CaseError("\n".join(problems.values())) from cause
    if all(combination.labels.get("fundamental-solution") == NOTHING for combination in found):
        raise CaseError(f"{file}: --fundamental-solution: the formulation takes none; allowed: without this option")
    return found


def enter(tables: dict[str, Any], option: str, value: str | Mapping[str, Any], registry: Registry) -> bool:
    """Put a choice into the tables of a case; false if there is no place for it."""
    if option == "formulation":
        _enter_formulation(tables, value, registry)
    elif option == "fundamental-solution":
        entered = [_enter_solution(body, value, registry) for body in bodies_of(tables).values()]
        return any(entered)
    elif option == "contact-law":
        contact = tables.setdefault("contact", {})
        contact["law"] = _fitted(value, contact.get("law"), OPTIONS[option], registry)
    elif option == "conductivity-law":
        _enter_conductivity(tables, value, registry)
    else:
        tables[option] = _fitted(value, tables.get(option), OPTIONS[option], registry)
    return True


def bodies_of(tables: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the tables in which the formulations of a case are, one for each body."""
    second_body = tables.get("second_body")
    return dict(zip(_BODIES, [tables, *([second_body] if isinstance(second_body, dict) else [])], strict=False))


def _enter_formulation(tables: dict[str, Any], value: str | Mapping[str, Any], registry: Registry) -> None:
    """Enter the formulation of both bodies, or of each in a table by _BODIES. Raises CaseError for another body, and
    for a key that is neither a body nor, without a name, one of the default formulation."""
    bodies = bodies_of(tables)
    each: dict[str, Any] = dict.fromkeys(bodies, value)
    if isinstance(value, Mapping) and not value.keys().isdisjoint(_BODIES):
        each = dict(value)
    elif isinstance(value, Mapping) and "name" not in value:
        keys = _keys(Kind.FORMULATION, DEFAULT_FORMULATION, registry)
        if unknown := value.keys() - keys:
            allowed = choices(min(unknown), ("name", *bodies, *sorted(keys)))
            raise CaseError(f"--formulation {words(value)}: unknown key {min(unknown)!r}; {allowed}")
    for name, formulation in each.items():
        if name not in bodies:
            raise CaseError(f"--formulation {words(value)}: no body {name!r}; allowed: a name, or {', '.join(bodies)}")
        body = bodies[name]
        body["formulation"] = _fitted(formulation, body.get("formulation"), Kind.FORMULATION, registry)


def _enter_solution(body: dict[str, Any], value: str | Mapping[str, Any], registry: Registry) -> bool:
    """Enter the fundamental solution of the formulation of a body; return False if it takes none."""
    formulation = _table(body.get("formulation", DEFAULT_FORMULATION))
    name = formulation.get("name", DEFAULT_FORMULATION)
    takes = isinstance(name, str) and _SOLUTION in _keys(Kind.FORMULATION, name, registry)
    if takes:
        solution = _fitted(value, formulation.get(_SOLUTION), Kind.FUNDAMENTAL_SOLUTION, registry)
        body["formulation"] = formulation | {_SOLUTION: solution}
    return takes


def _enter_conductivity(tables: dict[str, Any], value: str | Mapping[str, Any], registry: Registry) -> None:
    """Enter the conductivity law of both fields, or of each in a table that replaces the case's."""
    if isinstance(value, Mapping) and "name" not in value:
        tables["conductivity"] = dict(value)
        return
    conductivity = tables.setdefault("conductivity", {})
    for field in _FIELDS:
        conductivity[field] = _fitted(value, conductivity.get(field), Kind.CONDUCTIVITY_LAW, registry)


def _fitted(value: str | Mapping[str, Any], present: Any, kind: Kind, registry: Registry) -> dict[str, Any]:
    """Return the table of a choice: a name takes those keys present that it has. Raises PluginError if it is
    unknown."""
    if not isinstance(value, str):
        return dict(value)
    keys = _keys(kind, value, registry)
    return {"name": value, **{key: item for key, item in _table(present).items() if key in keys}}


def _keys(kind: Kind, name: str, registry: Registry) -> set[str]:
    """Return the keys of the table of what is registered under a name."""
    factory = registry.get(kind, name).factory
    records = [factory, StoppingCriteria] if kind is Kind.SOLVER else [factory]
    return {
        field.name for record in records if dataclasses.is_dataclass(record) for field in dataclasses.fields(record)
    }


def _table(value: Any) -> dict[str, Any]:
    """Return a name, a table or nothing as a table."""
    if isinstance(value, str):
        return {"name": value}
    return dict(value) if isinstance(value, Mapping) else {}
