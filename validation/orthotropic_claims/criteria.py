"""Claims of the paper, with words and bounds that several figures share."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from figures import Panel

UNALTERED = 0.05
"""Largest relative change of a quantity described as unaltered or hardly affected."""
CLEARLY = 0.10
"""Smallest relative change of a quantity described as clearly modified."""


class Verdict(StrEnum):
    """Outcome of a claim; NOT_RESOLVED: the mesh is too coarse to decide."""

    HOLDS = "holds"
    DIFFERS = "differs"
    NOT_RESOLVED = "not resolved"


@dataclass(frozen=True)
class Claim:
    """Statement of the paper and its comparison with computed values.

    paper: the statement; observed: the computed values; explained: the reason if it is known not to hold; as_explained:
    True if the values agree with this reason.
    """

    figure: str
    paper: str
    observed: str
    criterion: str
    verdict: Verdict
    explained: str = ""
    as_explained: bool = False


Decision = bool | np.bool_ | Verdict
Observed = Iterator[tuple[str, str, str, Decision] | tuple[str, str, str, Decision, str, bool | np.bool_]]
"""For each claim: statement, computed values, criterion, and whether it holds or the outcome; for a claim that is known
not to hold also the reason, and whether the values agree with it."""


def claim(
    figure: str,
    paper: str,
    result: str,
    criterion: str,
    verdict: Decision,
    explained: str = "",
    as_explained: bool | np.bool_ = False,
) -> Claim:
    """Return a claim from the items of Observed."""
    if not isinstance(verdict, Verdict):
        verdict = Verdict.HOLDS if verdict else Verdict.DIFFERS
    return Claim(figure, paper, result, criterion, verdict, explained, bool(as_explained))


def percent(value: float) -> str:
    """Format a signed change."""
    return f"{100 * value:+.1f} %"


def size(value: float) -> str:
    """Format a bound or the size of a change."""
    return f"{100 * value:.1f} %"


def change(panel: Panel, quantity: str, run: str, of: str) -> float:
    """Return the largest change of a field from run `of` to `run`, relative to its largest value in `of`."""
    before = panel.of(quantity, of)
    return float(np.abs(panel.of(quantity, run) - before).max() / np.abs(before).max())
