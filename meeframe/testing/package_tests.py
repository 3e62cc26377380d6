"""Helpers for the tests of plugin packages: objects as in case files, providers, and solved example cases."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from meeframe.model.load import load_case
from meeframe.model.solve import reduce, solve_steps
from meeframe.plugin.registry import Kind, load
from meeframe.results.records import StepResult


def create(kind: str, table: Any) -> Any:
    """Return the object that a name or a table of a case file describes.

    Parameters
    ----------
    kind : str
        Kind of the object, such as 'contact law'.
    table : object
        A table with the key `name`, or a name alone.

    Returns
    -------
    object
        The object, such as a `ContactLaw`.

    Raises
    ------
    CaseError
        If a key is unknown, missing or invalid; the message names it.
    """
    return load().create(Kind(kind), table)


def provider_of(kind: str, name: str) -> str:
    """Return the distribution that provides a name.

    Parameters
    ----------
    kind, name : str
        Kind and name of the object.

    Returns
    -------
    str
        Its name, '' if nothing of this name is installed.
    """
    entries = (entry for entry in load().entries if (str(entry.kind), entry.record.name) == (kind, name))
    return next((entry.provider.name for entry in entries), "")


def solve_example(file: Path, *solvers: str) -> list[StepResult]:
    """Return the last increment of a case with its solver, and with each of the given ones.

    The reduced system is computed once.

    Parameters
    ----------
    file : Path
        The case file.
    *solvers : str
        Names of further solvers.

    Returns
    -------
    list of StepResult
        The increments, first that of the solver of the case.
    """
    case = load_case(file)
    system = reduce(case)
    choices = [case.solver, *(create("solver", name) for name in solvers)]
    return [list(solve_steps(replace(case, solver=solver), system, boundary=False))[-1] for solver in choices]
