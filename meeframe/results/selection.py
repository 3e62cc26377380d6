"""Choice of an increment of a result."""

from collections.abc import Sequence
from typing import Final, Protocol

import numpy as np

from meeframe.common.errors import ResultError
from meeframe.results.records import StepResult, Zone
from meeframe.results.resultants import resultants

Which = int | tuple[int, int] | str | StepResult | None
"""Increment of a result, see `select`."""

NAMED: Final = ("peak", "last")
"""Increments that have a name."""
ALLOWED: Final = "allowed: peak, last, a load step such as 2, or an increment such as 2.5, its fifth"
"""Part of messages about texts that name no increment."""
_PEAK: Final = 1e-3
"""Relative difference of normal forces that count as the same peak load."""


class Increments(Protocol):
    """Result, or any other record with the finished increments of a case."""

    @property
    def zone(self) -> Zone:
        """Nodes of the contact zone."""

    @property
    def steps(self) -> tuple[StepResult, ...]:
        """Finished increments, in order."""


def select(result: Increments, which: Which = None) -> StepResult:
    """Return an increment of a result.

    Parameters
    ----------
    result : Increments
        The result.
    which : int, tuple of int, str or StepResult, optional
        Number of a load step, from 1, for its last finished increment; (step, increment), also as a text such as '2.5';
        'last' for the last finished increment; 'peak', the default, for the last one of those with the largest normal
        force; or the increment itself.

    Raises
    ------
    ResultError
        If there is no such increment; the message names those that exist.
    """
    if isinstance(which, StepResult):
        return which
    if not result.steps:
        raise ResultError("no increment of the run is finished")
    if which is None or which == "peak":
        forces = np.array([abs(resultants(result.zone, step).normal_force) for step in result.steps])
        forces[~np.isfinite(forces)] = -1.0
        return result.steps[int(np.flatnonzero(forces >= forces.max() - _PEAK * abs(forces.max()))[-1])]
    if which == "last":
        return result.steps[-1]
    numbers = step_numbers(which)
    matches = [step for step in result.steps if numbers == (step.step, step.increment)[: len(numbers)]]
    if not numbers or not matches:
        last: dict[int, int] = {step.step: step.increment for step in result.steps}
        steps = ", ".join(f"{step} (increments 1 to {count})" for step, count in last.items())
        raise ResultError(f"step {which!r}: no such increment; allowed: peak, last, and load steps {steps}")
    return matches[-1]


def has_increment(result: Increments, which: str) -> bool:
    """Return whether a result has the increment that a text names."""
    numbers = step_numbers(which)
    return which in NAMED or any(numbers == (step.step, step.increment)[: len(numbers)] for step in result.steps)


def step_numbers(which: int | tuple[int, int] | str) -> Sequence[int]:
    """Return the numbers of a load step and, if there is one, an increment; () if the text has none."""
    if isinstance(which, str):
        parts = which.split(".")
        return tuple(map(int, parts)) if len(parts) <= 2 and all(part.isdigit() for part in parts) else ()
    return tuple(which) if isinstance(which, tuple) else (int(which),)
