"""Attraction that falls more steeply with the gap than a single node resists."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from meeframe.indenters import longest_side
from meeframe.laws.base import ContactLaw, attracts
from meeframe.results.records import StepResult
from meeframe.system.capabilities import diagonal
from meeframe.system.reduced import ReducedSystem

_NOTICED: Final = 1e-3
"""Of the largest pressure: attraction of less does not matter."""
_GAPS: Final = np.concatenate([[0.0], np.logspace(-15, 1, 1601)])
"""[m], among which the steepest fall is looked for ..."""
_FINER: Final = 100
"""... and then among so many in the interval that has it and in its neighbours, ..."""
_LOOKS: Final = 3
"""... so many times."""


def steepest_fall(law: ContactLaw) -> float:
    """Of the attraction with the gap, [Pa/m] >= 0: the largest chord between gaps that close in on it."""
    gaps = _GAPS
    for _ in range(1 + _LOOKS):
        fall = -np.diff(law.adhesion(gaps)) / np.diff(gaps)
        place = int(fall.argmax())
        gaps = np.linspace(gaps[max(place - 1, 0)], gaps[min(place + 2, len(gaps) - 1)], _FINER)
    return max(float(fall.max()), 0.0)


def remark_on_snapping(system: ReducedSystem, law: ContactLaw, step: StepResult) -> Iterator[str]:
    """That single nodes snap into contact and out of it, and which elements would not let them, in words; if they do.

    law: of the case. A node on its own is unstable where the fall of the attraction times its response to its own load
    is more than one; the response grows like the size of elements.
    """
    if not attracts(law) or law.adhesion(np.maximum(step.gap, 0.0)).max() <= _NOTICED * np.abs(step.traction).max():
        return
    ratio = steepest_fall(law) * float(diagonal(system, (2,)).max())
    if ratio <= 1.0:
        return
    size = longest_side(system.points, system.cells) or float(np.sqrt(system.weights.max()))
    yield (
        f"the attraction falls {ratio:.3g} times as steeply with the gap as single nodes resist: they snap into "
        "contact one by one, forces may be far off and depend on the way; what serves: elements of "
        f"{size / ratio:.2g} m at most, which are {size:.2g} m here, or an attraction that falls over a wider range"
    )
