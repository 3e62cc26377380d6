"""Choice of an increment of a result."""

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Final, final

from meeframe.common.errors import ResultError
from meeframe.results.overview import Increments, Overview, overviews
from meeframe.results.records import StepResult

Which = int | tuple[int, int] | str | StepResult | None
"""Increment of a result, see `select`."""

NAMED: Final = ("peak", "last")
"""Increments that have a name."""
ALLOWED: Final = "allowed: peak, last, a load step such as 2, or an increment such as 2.5, its fifth"
"""Part of messages about texts that name no increment."""
_PEAK: Final = 1e-3
"""Relative difference of normal forces that count as the same peak load."""


@final
class PeakLoad:
    """The largest normal force of increments that pass."""

    def __init__(self) -> None:
        self._largest = -1.0

    def includes(self, force: float) -> bool:
        """Return whether an increment with this normal force is, of those so far, the one with the peak load.

        It is the last one whose force is within `_PEAK` of the largest. Forces that are not finite are less than zero.
        """
        size = abs(force) if math.isfinite(force) else -1.0
        self._largest = max(self._largest, size)
        return size >= self._largest - _PEAK * abs(self._largest)


@final
class Choice:
    """Choice of an increment while increments pass, as by `select`; the peak load if there is none of this name.

    Only the increments that may be the chosen one stay in memory.

    Parameters
    ----------
    which : str
        Name of the increment as in `[output] step`.
    """

    def __init__(self, which: str) -> None:
        self._last, self._numbers = which == "last", step_numbers(which)
        self._peak_load = PeakLoad()
        self._peak: StepResult | None = None
        self._named: StepResult | None = None

    def add(self, step: StepResult, one: Overview) -> None:
        """Consider one more increment, with its overview."""
        if self._peak_load.includes(one.normal_force):
            self._peak = step
        if self._last or (self._numbers and self._numbers == one[: len(self._numbers)]):
            self._named = step

    @property
    def step(self) -> StepResult | None:
        """The chosen increment of those so far, None before the first one."""
        return self._peak if self._named is None else self._named


def name_of(result: Increments, step: StepResult | Overview) -> str:
    """Return an increment in words: 'step 2', or 'step 2, increment 5' where the step has several."""
    several = any(other.step == step.step and other.increment > 1 for other in overviews(result))
    return f"step {step.step}, increment {step.increment}" if several else f"step {step.step}"


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
    return which if isinstance(which, StepResult) else result.steps[number_of(result, which)]


def number_of(result: Increments, which: Which = None) -> int:
    """Return the number of an increment of a result, from 0; as `select`."""
    if not result.steps:
        raise ResultError("no increment of the run is finished")
    numbers = (which.step, which.increment) if isinstance(which, StepResult) else which
    return position(overviews(result), numbers)


def position(steps: Sequence[Overview], which: int | tuple[int, int] | str | None = None) -> int:
    """Return the number of an increment from 0, as in `select`; there is at least one increment."""
    if which is None or which == "peak":
        peak_load = PeakLoad()
        return [number for number, step in enumerate(steps) if peak_load.includes(step.normal_force)][-1]
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
