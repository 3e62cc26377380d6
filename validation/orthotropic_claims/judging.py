"""What a claim of the paper is, and the words and bounds that judges of several figures use."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from figures import Panel

UNALTERED = 0.05
"""Largest relative change of what is said to be unaltered or hardly affected."""
CLEARLY = 0.10
"""Least relative change of what is said to be clearly modified."""


class Verdict(StrEnum):
    """What the numbers say of a claim; NOT_RESOLVED: the mesh is too coarse for them to say anything."""

    HOLDS = "holds"
    DIFFERS = "differs"
    NOT_RESOLVED = "not resolved"


@dataclass(frozen=True)
class Claim:
    """paper: what it says; found: our numbers; judged: what decides; explained: why it is known not to hold, if it is;
    as_explained: whether the numbers are what this leads to expect."""

    figure: str
    paper: str
    found: str
    judged: str
    verdict: Verdict
    explained: str = ""
    as_explained: bool = False


Judged = bool | np.bool_ | Verdict
Found = Iterator[tuple[str, str, str, Judged] | tuple[str, str, str, Judged, str, bool | np.bool_]]
"""Of each claim what the paper says, the numbers, what decides, and whether it holds or the verdict; of one that is
known not to hold also why, and whether the numbers are what this leads to expect."""


def claim(
    figure: str,
    paper: str,
    found: str,
    judged: str,
    verdict: Judged,
    explained: str = "",
    as_explained: bool | np.bool_ = False,
) -> Claim:
    """What a judge yields as a claim."""
    if not isinstance(verdict, Verdict):
        verdict = Verdict.HOLDS if verdict else Verdict.DIFFERS
    return Claim(figure, paper, found, judged, verdict, explained, bool(as_explained))


def percent(value: float) -> str:
    """Of a signed change."""
    return f"{100 * value:+.1f} %"


def size(value: float) -> str:
    """Of a bound or of the size of a change."""
    return f"{100 * value:.1f} %"


def change(panel: Panel, quantity: str, run: str, of: str) -> float:
    """Largest change of a field from run `of` to `run`, relative to its largest value there."""
    before = panel.of(quantity, of)
    return float(np.abs(panel.of(quantity, run) - before).max() / np.abs(before).max())
