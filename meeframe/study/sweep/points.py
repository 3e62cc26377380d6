"""Points of a sweep: cases identified by their content, their outcomes, and the files that store these."""

import errno
import hashlib
import json
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Final

from meeframe.common.errors import MeeframeError, PluginFault, ResultError, TooLargeError
from meeframe.common.files import read_json
from meeframe.common.toml import toml_text
from meeframe.model.cache import case_key
from meeframe.model.case import Case
from meeframe.model.clock import Clock, peak_memory_mb
from meeframe.model.load import case_from_tables
from meeframe.model.solve import joined, provenance, solve_steps
from meeframe.plugin.registry import Registry
from meeframe.plugin.validation import Problem, TableError
from meeframe.results.files import read_result, write_result
from meeframe.results.records import Result, RunStatus, zone_of
from meeframe.system.reduced import ReducedSystem

REFUSED_FILE: Final = "refused.json"

_FATAL_ERRORS: Final = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO)
"""File errors that would affect every other point, too."""


class PointStatus(StrEnum):
    """Status of a point.

    REFUSED: its case is invalid, or a formulation, law or solver does not accept it; FAILED: it ran out of memory, code
    of a plugin failed, or its workers died repeatedly. Failed points are not stored, so that the next run tries them
    again.
    """

    CONVERGED = "converged"
    NOT_CONVERGED = "not-converged"
    REFUSED = "refused"
    FAILED = "failed"


@dataclass(frozen=True, eq=False)
class Point:
    """A case to be solved.

    Attributes
    ----------
    label
        Name of the point.
    case
        The case; None if it is invalid.
    key
        Identity of the point.
    problems
        Problems of an invalid case.
    """

    label: str
    case: Case | None
    key: str
    problems: tuple[Problem, ...] = ()

    @classmethod
    def of(cls, label: str, tables: Mapping[str, Any], folder: Path, registry: Registry | None) -> "Point":
        """Create a point from the tables of a case file; relative paths in them refer to `folder`."""
        try:
            text = toml_text(tables)
        except (TypeError, ValueError) as error:  # tables created in Python
            return cls(label, None, hashlib.sha256(str(error).encode()).hexdigest(), (Problem((), str(error)),))
        try:
            case = case_from_tables(tables, registry, folder, text)
        except TableError as error:
            return cls(label, None, hashlib.sha256(text.encode()).hexdigest(), error.problems)
        return cls(label, case, case_key(case))

    @property
    def faulty(self) -> bool:
        """True if there is no case because the code of a plugin failed."""
        return any(problem.cause is not None for problem in self.problems)


@dataclass(frozen=True, eq=False)
class Outcome:
    """Outcome of a point.

    Attributes
    ----------
    status
        Status of the point.
    message
        Reason if the point did not converge.
    result
        The result; None if there is none.
    """

    status: PointStatus
    message: str = ""
    result: Result | None = None

    @classmethod
    def of(cls, result: Result) -> "Outcome":
        """Create an outcome from a result whose load steps have all been tried."""
        if result.status is RunStatus.CONVERGED:
            return cls(PointStatus.CONVERGED, "", result)
        return cls(PointStatus.NOT_CONVERGED, result.steps[-1].message, result)

    @classmethod
    def without_result(cls, error: MeeframeError | MemoryError) -> "Outcome":
        """Create an outcome from an error that ended a computation.

        Errors that concern files rather than the point, because meeframe or a plugin cannot write them, are raised
        again.
        """
        cause = error.__cause__
        if isinstance(error, ResultError) or (isinstance(cause, OSError) and cause.errno in _FATAL_ERRORS):
            raise error
        if isinstance(error, MemoryError):
            return cls(PointStatus.FAILED, f"not enough memory: {str(error) or 'none left'}")
        temporary = isinstance(error, TooLargeError | PluginFault)
        return cls(PointStatus.FAILED if temporary else PointStatus.REFUSED, str(error))


def solved(case: Case, systems: Iterable[ReducedSystem]) -> Outcome:
    """Return the outcome of a case on the reduced systems of its bodies.

    Systems are in the order of `meeframe.model.solve.bodies_of`. The fields on the whole boundary are not recovered.
    Raises ResultError if a system cannot be stored.
    """
    clock = Clock()
    try:
        system = joined(case, systems)
        steps = tuple(solve_steps(case, system, clock, boundary=False))
    except (MeeframeError, MemoryError) as error:
        return Outcome.without_result(error)
    zone, timings = zone_of(system), clock.timings()
    return Outcome.of(Result(provenance(case), zone, case.n_increments, steps, timings, peak_memory_mb()))


def write_outcome(folder: Path, outcome: Outcome) -> None:
    """Store the outcome of a point in its folder atomically. Raises ResultError."""
    if outcome.status is PointStatus.FAILED:
        return
    unfinished = folder.with_name(f".{folder.name}")
    try:
        unfinished.mkdir(parents=True, exist_ok=True)
        if outcome.result is not None:
            write_result(unfinished, outcome.result)
        else:
            text = json.dumps({"message": outcome.message}) + "\n"
            (unfinished / REFUSED_FILE).write_text(text, encoding="utf-8")
        shutil.rmtree(folder, ignore_errors=True)  # a damaged one
        unfinished.rename(folder)
    except OSError as error:
        raise ResultError(f"folder {folder} cannot be written: {error.strerror or error}") from None


def read_outcome(folder: Path) -> Outcome | None:
    """Return the outcome in the folder of a point; None if it does not contain a complete one."""
    try:
        result = read_result(folder)
        return None if result.status is RunStatus.UNFINISHED else Outcome.of(result)
    except ResultError:
        pass
    try:
        message = read_json(folder / REFUSED_FILE)["message"]
    except (OSError, ValueError, LookupError, TypeError):
        return None
    return Outcome(PointStatus.REFUSED, str(message))
