"""Wear: checks of wear laws and load steps, and the law of an increment in which surfaces wear."""

from dataclasses import replace
from typing import Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.contact.problem import ContactProblem, ContactState, contact_gap
from meeframe.fields import Array
from meeframe.laws.base import ContactLaw, has_friction, is_adhesive, resolve
from meeframe.laws.wear import WearingContact, WearLaw
from meeframe.model.step import Step

_PRESSURES: Final = np.array([0.0, 1e5, 1e6, 1e7])
"""Pressures with which laws are tested [Pa]."""


def check_wear(law: WearLaw | None, contact_law: ContactLaw) -> None:
    """Raise CaseError unless a wear law returns valid rates, and the contact law is one of surfaces that can wear."""
    if law is None:
        return
    arguments = _PRESSURES, np.ones_like(_PRESSURES), np.zeros_like(_PRESSURES)
    copies = tuple(array.copy() for array in arguments)
    with np.errstate(all="ignore"):
        rate = law.rate(*copies)
    what = f"rate of the wear law {type(law).__name__}"
    if not all(map(np.array_equal, copies, arguments)):
        raise CaseError(f"{what} changes its arguments; allowed: a new array")
    if type(rate) is not np.ndarray or rate.dtype.kind not in "fiu" or rate.shape != _PRESSURES.shape:
        raise CaseError(f"{what} is {rate!r}; allowed: an array of real numbers, one for each pressure")
    wrong = ~(np.isfinite(rate) & (rate >= 0.0))
    if wrong.any():
        raise CaseError(f"{what} is {rate[wrong][0]} at {_PRESSURES[wrong][0]:g} Pa; allowed: finite numbers >= 0")
    if is_adhesive(contact_law) or not _is_hard(contact_law):
        raise CaseError(
            f"wear under the contact law {type(contact_law).__name__} is not available; allowed: contact laws of "
            "surfaces that neither attract each other nor overlap, such as those with Coulomb friction"
        )


def _is_hard(law: ContactLaw) -> bool:
    """Return whether surfaces bear any pressure without overlap."""
    trial = np.zeros((len(_PRESSURES), 3))
    trial[:, 2] = -_PRESSURES
    with np.errstate(all="ignore"):
        traction = resolve(law, trial, np.zeros_like(trial), (1e12, 1e12))
    return bool(np.allclose(traction[:, 2], trial[:, 2], rtol=1e-12, atol=0.0))


def check_sliding(step: Step, number: int, contact_law: ContactLaw, law: WearLaw | None) -> None:
    """Raise CaseError if a load step, number from 1, cannot wear surfaces as it says."""
    if law is not None and law.needs_duration and step.duration is None:
        raise CaseError(
            f"load step {number} has no duration, which the wear law {type(law).__name__} needs; "
            "allowed: a duration > 0 [s]"
        )
    extent = "sliding distance" if step.sliding else "max_pressure_change" if step.max_pressure_change else ""
    if step.rolling is not None:
        if extent:
            raise CaseError(f"load step {number} has a {extent} and rolls; allowed: one of both, or sliding = 0")
        if step.rolling.cycles is not None:
            extent = "number of cycles"
    if law is None and extent:
        raise CaseError(f"load step {number} has a {extent}, which concerns wear alone; allowed: with [contact.wear]")
    if step.sliding and has_friction(contact_law):
        raise CaseError(
            f"load step {number} has a sliding distance, which has no direction, under friction, which needs one; "
            "allowed: a translation or a twist in its place, whose slip wears too, or a contact law without friction"
        )


def without_wear(problem: ContactProblem, state: ContactState) -> tuple[ContactProblem, Array | None]:
    """Return the contact problem of the worn surfaces, and the depth (n,) [m] that wears off in the increment.

    Parameters
    ----------
    problem : ContactProblem
        Problem as it was solved.
    state : ContactState
        Its solution, which also is that of the returned problem.
    """
    law = problem.contact_law
    if not isinstance(law, WearingContact):
        return problem, None
    with np.errstate(all="ignore"):  # the state may come from a diverged iteration
        gap = contact_gap(problem, state.displacement, state.motion)
        depth = np.nan_to_num(law.depth(np.maximum(-state.load[:, 2], 0.0), law.slip(gap)), posinf=0.0)
    return replace(problem, contact_law=law.law, gap=problem.gap + depth), depth
