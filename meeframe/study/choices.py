"""Choices of a comparison from the command line, and the case of each of their combinations."""

import dataclasses
import re
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, Final

from meeframe.common.errors import CaseError, listed
from meeframe.common.toml import toml_tables
from meeframe.fields import MEE, THERMAL_FIELD, FieldSet
from meeframe.model.case import Case
from meeframe.model.load import case_from_tables
from meeframe.model.values import DEFAULT_FORMULATION
from meeframe.plugin.registry import Kind, Registry
from meeframe.plugin.validation import TableError, choices
from meeframe.solvers import StoppingCriteria
from meeframe.study.declare import words

# options that change the reduced system come first and vary slowest, so that one system is in memory at a time
OPTIONS: Final = {
    "formulation": Kind.FORMULATION,
    "fundamental-solution": Kind.FUNDAMENTAL_SOLUTION,
    "contact-law": Kind.CONTACT_LAW,
    "conductivity-law": Kind.CONDUCTIVITY_LAW,
    "wear-law": Kind.WEAR_LAW,
    "solver": Kind.SOLVER,
}
"""Kinds that can be varied, by option of the command line."""

NOTHING: Final = "-"
"""Choice of a fundamental solution where no formulation takes one."""

_SOLUTION: Final = "fundamental_solution"
_BODIES: Final = ("body", "second_body")
_CONTACT_KEYS: Final = {"contact-law": "law", "wear-law": "wear"}
"""Keys of the table [contact] that options set."""


@dataclass(frozen=True)
class Choice:
    """One value of an option.

    Attributes
    ----------
    label
        The choice in words, for tables and figures.
    value
        Name of a registered object, or a table as in a case file.
    """

    label: str
    value: str | Mapping[str, Any]

    @classmethod
    def read(cls, option: str, text: str) -> "Choice":
        """Read a choice from the command line.

        Parameters
        ----------
        option
            Name of the option, for messages.
        text
            A name, or an inline table of TOML.

        Raises
        ------
        CaseError
            If the text starts an inline table that is not valid TOML.
        """
        if not text.strip().startswith("{"):
            return cls(text, text)
        try:
            table = toml_tables(f"value = {text}")["value"]
        except (ValueError, RecursionError) as error:
            raise CaseError(f"--{option} {text}: is not an inline table of TOML: {error}") from None
        return cls(words(table), table)


def read_choices(options: Mapping[str, Sequence[str]]) -> dict[str, list[Choice]]:
    """Return the choices of all options that are used, in the order of OPTIONS.

    Raises
    ------
    CaseError
        If a choice is invalid or repeated, or if there are no choices at all.
    """
    chosen = {option: [Choice.read(option, text) for text in options.get(option, ())] for option in OPTIONS}
    for option, entries in chosen.items():
        labels = [choice.label for choice in entries]
        duplicate = next((label for label in labels if labels.count(label) > 1), None)
        if duplicate is not None:
            raise CaseError(f"--{option} {duplicate}: is given twice")
    chosen = {option: entries for option, entries in chosen.items() if entries}
    if not chosen:
        raise CaseError(f"nothing to compare; give at least one of {', '.join(f'--{option}' for option in OPTIONS)}")
    return chosen


@dataclass(frozen=True, eq=False)
class Combination:
    """A combination of choices.

    Attributes
    ----------
    labels
        Labels of the choices, by option.
    case
        The case with these choices; None if they do not fit together.
    refusal
        The reason if they do not fit together.
    """

    labels: Mapping[str, str]
    case: Case | None
    refusal: str = ""


def combinations(
    file: Path, tables: Mapping[str, Any], chosen: Mapping[str, list[Choice]], registry: Registry
) -> list[Combination]:
    """Return every combination of choices with the tables of a case.

    Formulations that take no fundamental solution appear once, with NOTHING for it.

    Parameters
    ----------
    file
        The case file, which messages name.
    tables
        Tables of the case file.
    chosen
        Choices by option, from `read_choices`.
    registry
        The registry that the choices are looked up in.

    Raises
    ------
    CaseError
        For an unknown name in a table, or if no combination fits; the message names the file and the combination.
    PluginError
        For any other unknown name.
    """
    entries: list[Combination] = []
    problems: dict[str, str] = {}
    cause: BaseException | None = None
    for combination in product(*chosen.values()):
        changed = deepcopy(dict(tables))
        labels = {option: choice.label for option, choice in zip(chosen, combination, strict=True)}
        for option, choice in zip(chosen, combination, strict=True):
            if not enter(changed, option, choice.value, registry):
                labels[option] = NOTHING
        if any(labels == other.labels for other in entries):
            continue
        try:
            entries.append(Combination(labels, case_from_tables(changed, registry, file.parent)))
        except TableError as error:
            messages = {str(problem): f"{file}: {', '.join(labels.values())}: {problem}" for problem in error.problems}
            if any(problem.unknown for problem in error.problems):
                raise CaseError("\n".join(messages.values())) from None
            cause = cause or error.__cause__
            problems |= {text: line for text, line in messages.items() if text not in problems}
            entries.append(Combination(labels, None, str(error)))
    if all(combination.case is None for combination in entries):
        raise CaseError(listed(problems.values())) from cause
    if all(combination.labels.get("fundamental-solution") == NOTHING for combination in entries):
        raise CaseError(
            f"{file}: --fundamental-solution: the formulation takes no fundamental solution; omit this option"
        )
    return entries


def enter(tables: dict[str, Any], option: str, value: str | Mapping[str, Any], registry: Registry) -> bool:
    """Enter a choice into the tables of a case; return False if the case has no place for it."""
    if option == "formulation":
        _enter_formulation(tables, value, registry)
    elif option == "fundamental-solution":
        results = [_enter_solution(body, value, registry) for body in bodies_of(tables).values()]
        return any(results)
    elif option in _CONTACT_KEYS:
        contact, key = tables.setdefault("contact", {}), _CONTACT_KEYS[option]
        contact[key] = _fit(value, contact.get(key), OPTIONS[option], registry)
    elif option == "conductivity-law":
        _enter_conductivity(tables, value, registry)
    else:
        tables[option] = _fit(value, tables.get(option), OPTIONS[option], registry)
    return True


def bodies_of(tables: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the tables that contain the formulations of a case, by name of the body."""
    second_body = tables.get("second_body")
    return dict(zip(_BODIES, [tables, *([second_body] if isinstance(second_body, dict) else [])], strict=False))


def _enter_formulation(tables: dict[str, Any], value: str | Mapping[str, Any], registry: Registry) -> None:
    """Enter the formulation of both bodies, or of each body if the table has keys of _BODIES.

    Raises CaseError for an unknown body, and for a table without a name that has a key which is neither a body nor a
    parameter of the default formulation.
    """
    bodies = bodies_of(tables)
    formulations: dict[str, Any] = dict.fromkeys(bodies, value)
    if isinstance(value, Mapping) and not value.keys().isdisjoint(_BODIES):
        formulations = dict(value)
    elif isinstance(value, Mapping) and "name" not in value:
        keys = _keys(Kind.FORMULATION, DEFAULT_FORMULATION, registry)
        if unknown := value.keys() - keys:
            allowed = choices(min(unknown), ("name", *bodies, *sorted(keys)))
            raise CaseError(f"--formulation {words(value)}: unknown key {min(unknown)!r}; {allowed}")
    for name, formulation in formulations.items():
        if name not in bodies:
            raise CaseError(f"--formulation {words(value)}: no body {name!r}; allowed: a name, or {', '.join(bodies)}")
        body = bodies[name]
        body["formulation"] = _fit(formulation, body.get("formulation"), Kind.FORMULATION, registry)


def _enter_solution(body: dict[str, Any], value: str | Mapping[str, Any], registry: Registry) -> bool:
    """Enter the fundamental solution of the formulation of a body; return False if the formulation takes none."""
    formulation = _table(body.get("formulation", DEFAULT_FORMULATION))
    name = formulation.get("name", DEFAULT_FORMULATION)
    takes = isinstance(name, str) and _SOLUTION in _keys(Kind.FORMULATION, name, registry)
    if takes:
        solution = _fit(value, formulation.get(_SOLUTION), Kind.FUNDAMENTAL_SOLUTION, registry)
        body["formulation"] = formulation | {_SOLUTION: solution}
    return takes


def _enter_conductivity(tables: dict[str, Any], value: str | Mapping[str, Any], registry: Registry) -> None:
    """Enter the conductivity law of all scalar fields, or of each in a table that replaces that of the case."""
    if isinstance(value, Mapping) and "name" not in value:
        tables["conductivity"] = dict(value)
        return
    conductivity = tables.setdefault("conductivity", {})
    material = _table(tables.get("material"))
    has_heat = material.get("thermal") or any(re.match("k_?[0-9]", name) for name in _table(material.get("components")))
    further = (
        scalar
        for scalar in registry.scalar_fields
        if scalar.coefficient in material or (scalar == THERMAL_FIELD and has_heat)
    )
    for field in FieldSet((*MEE.scalars, *further)).names:
        conductivity[field] = _fit(value, conductivity.get(field), Kind.CONDUCTIVITY_LAW, registry)


def _fit(value: str | Mapping[str, Any], present: Any, kind: Kind, registry: Registry) -> dict[str, Any]:
    """Return the table of a choice; a name takes present parameters that apply to it. Raises PluginError."""
    if not isinstance(value, str):
        return dict(value)
    keys = _keys(kind, value, registry)
    return {"name": value, **{key: item for key, item in _table(present).items() if key in keys}}


def _keys(kind: Kind, name: str, registry: Registry) -> set[str]:
    """Return the keys of the table of a registered object."""
    factory = registry.get(kind, name).factory
    records = [factory, StoppingCriteria] if kind is Kind.SOLVER else [factory]
    return {
        field.name for record in records if dataclasses.is_dataclass(record) for field in dataclasses.fields(record)
    }


def _table(value: Any) -> dict[str, Any]:
    """Return a table for a name, a table or None."""
    if isinstance(value, str):
        return {"name": value}
    return dict(value) if isinstance(value, Mapping) else {}
