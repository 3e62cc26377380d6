"""Choice of an increment of a result."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Final, Protocol

import numpy as np

from meeframe.common.errors import ResultError
from meeframe.results.records import Overview, StepResult, StoredSteps, Zone
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
    def steps(self) -> Sequence[StepResult]:
        """Finished increments, in order."""


def overview(zone: Zone, step: StepResult) -> Overview:
    """Return the overview of an increment."""
    totals = resultants(zone, step)
    return Overview(
        step.step,
        step.increment,
        step.status,
        step.message,
        step.contact_at_zone_boundary,
        step.loading.duration,
        totals.normal_force,
        totals.dissipated_energy,
    )


def overviews(result: Increments) -> Sequence[Overview]:
    """Return the overviews of all increments, which are in memory even if the increments are not."""
    if isinstance(result.steps, StoredSteps):
        return result.steps.overviews
    return [overview(result.zone, step) for step in result.steps]


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
    return result.steps[position(overviews(result), which)]


def position(steps: Sequence[Overview], which: int | tuple[int, int] | str | None = None) -> int:
    """Return the number of an increment from 0, as in `select`; there is at least one increment."""
    if which is None or which == "peak":
        forces = np.array([abs(step.normal_force) for step in steps])
        forces[~np.isfinite(forces)] = -1.0
        return int(np.flatnonzero(forces >= forces.max() - _PEAK * abs(forces.max()))[-1])
    if which == "last":
        return len(steps) - 1
    numbers = step_numbers(which)
    matches = [number for number, step in enumerate(steps) if numbers == step[: len(numbers)]]
    if not numbers or not matches:
        last = {step.step: step.increment for step in steps}
        raise ResultError(f"step {which!r}: no such increment; allowed: peak, last, and {load_steps_in_words(last)}")
    return matches[-1]


def load_steps_in_words(counts: Mapping[int, int]) -> str:
    """Return load steps and their numbers of increments in words, successive ones with as many increments together."""
    words = []
    for count, group in groupby(counts, counts.__getitem__):
        first, *others = group
        increments = f"increments 1 to {count}" if count > 1 else "increment 1"
        words.append(f"{first} to {others[-1]} ({increments} of each)" if others else f"{first} ({increments})")
    return f"load step{'s' * (len(counts) > 1)} {', '.join(words)}"


def has_increment(result: Increments, which: str) -> bool:
    """Return whether a result has the increment that a text names."""
    numbers = step_numbers(which)
    return which in NAMED or any(numbers == step[: len(numbers)] for step in overviews(result))


def step_numbers(which: int | tuple[int, int] | str) -> Sequence[int]:
    """Return the numbers of a load step and, if there is one, an increment; () if the text has none."""
    if isinstance(which, str):
        parts = which.split(".")
        return tuple(map(int, parts)) if len(parts) <= 2 and all(part.isdigit() for part in parts) else ()
    return tuple(which) if isinstance(which, tuple) else (int(which),)
