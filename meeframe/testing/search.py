"""Hypothesis looks for single inputs that break a contract, and hands over the simplest it finds."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from hypothesis import HealthCheck, Phase, currently_in_test_context, find, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from meeframe.fields import Array
from meeframe.laws.base import ConductivityLaw, ContactLaw, contact_conductivity
from meeframe.testing.law_maps import Units
from meeframe.testing.requirements import require

_SETTINGS: Final = settings(
    max_examples=200, deadline=None, database=None, derandomize=True, suppress_health_check=list(HealthCheck)
)
# squares of the smallest numbers are still no zeros: laws may take norms
_SPECIAL: Final = (0.0, -0.0, 1.0, -1.0, 1e-60, -1e-60, 1e-9, -1e-9, 1e9, -1e9)
_NUMBERS: Final = st.sampled_from(_SPECIAL) | st.floats(1e-3, 10.0) | st.floats(-10.0, -1e-3)


def search_trials(law: ContactLaw, pressure: float) -> None:
    """Trials with zeros, equal, tiny and huge components, in units of a pressure [Pa], on which project still is one.

    Inside of another test of hypothesis nothing is searched: that one draws the inputs. Raises AssertionError.
    """

    def fault(trial: Any) -> str:
        given = pressure * np.array([trial])
        with np.errstate(all="ignore"):
            traction = law.project(given)
            again = law.project(traction)
        size = np.abs(given).max()
        if not np.isfinite(traction).all():
            return "project gives tractions that are not finite"
        if traction[0, 2] > 0.0:
            return "normal traction pulls"
        if given[0, 2] >= 0.0 and traction.any():
            return "traction where the trial is open"
        return "project is not idempotent" if np.abs(again - traction).max() > 1e-9 * size else ""

    _search(st.tuples(_NUMBERS, _NUMBERS, _NUMBERS), fault, lambda trial: pressure * np.array(trial))


def search_states(law: ContactLaw, units: Units) -> None:
    """Trials, gaps and slip paths of zero, tiny and huge numbers, in units of what is typical, at which what resolve or
    adhesion give is nothing, during an increment as well; for laws that are more than a projection. As search_trials.
    """
    if all(getattr(type(law), name) is getattr(ContactLaw, name) for name in ("resolve", "adhesion", "for_increment")):
        return
    duration = units.duration if law.needs_duration else None
    r = units.lengths()[0]

    def state(numbers: Any) -> tuple[Array, Array, Array]:
        trial, gap = np.reshape(numbers[:6], (2, 1, 3)) * [[[units.pressure]], [[units.gap]]]
        return trial, gap, units.gap * np.abs(numbers[6:])

    def fault(numbers: Any) -> str:
        trial, gap, path = state(numbers)
        with np.errstate(all="ignore"):
            during = law.for_increment(path, duration)
            traction, pull = during.resolve(trial, gap, r), during.adhesion(np.abs(gap[:, 2]))
            again = during.project(traction)
        if not np.isfinite(traction).all():
            return "resolve gives tractions that are not finite"
        if not np.isfinite(pull).all() or (pull < 0.0).any():
            return "adhesion is negative or not finite"
        if traction[0, 2] > 0.0:
            return "normal traction pulls"
        if trial[0, 2] >= 0.0 and traction.any():
            return "traction where the trial is open"
        admitted = np.abs(again - traction).max() <= 1e-9 * np.abs(trial).max()
        return "" if admitted else "resolve gives tractions that project does not admit"

    def shown(numbers: Any) -> str:
        trial, gap, path = state(numbers)
        return f"trial {trial[0]}, gap {gap[0]}, slip path {path[0]:g}"

    _search(st.tuples(*[_NUMBERS] * 7), fault, shown)


def search_conductivities(law: ConductivityLaw, pressure: float, gap: float, drop: float) -> None:
    """States of zero, tiny and huge numbers, in units of a pressure [Pa], a gap [m] and a drop [V] or [A], at which
    kappa is none or changes though the law is not across_gap. As search_trials."""
    units = np.array([pressure, gap, drop])

    def state(numbers: Any) -> Array:
        traction, apart, dropping = numbers
        contact_fraction = traction < 0.0
        given: Array = units * np.array(
            [traction if contact_fraction else 0.0, 0.0 if contact_fraction else abs(apart), dropping]
        )
        return given

    def fault(numbers: Any) -> str:
        given = state(numbers)[:, None]
        with np.errstate(all="ignore"):
            kappa = law.conductivity(*given)[0]
            alone = contact_conductivity(law, given[0])[0]
        if kappa != alone and not law.across_gap:
            return "conductivity changes with gap or drop, but the law is not across_gap"
        return "" if kappa >= 0.0 else "conductivity is negative or NaN"

    _search(st.tuples(_NUMBERS, _NUMBERS, _NUMBERS), fault, lambda numbers: f"traction, gap, drop = {state(numbers)}")


def search_for(
    strategy: st.SearchStrategy[Any], check: Callable[[Any], None], examples: int = 200, simplify: bool = True
) -> None:
    """Raises the AssertionError that `check` raises for the simplest input found, if any. As search_trials.

    examples: how many are drawn; simplify: whether one that fails is made simpler, which may take as many again.
    """
    if currently_in_test_context():
        return

    def fails(given: Any) -> bool:
        try:
            check(given)
        except AssertionError:
            return True
        return False

    phases = [Phase.generate, Phase.shrink] if simplify else [Phase.generate]
    try:
        simplest = find(strategy, fails, settings=settings(_SETTINGS, max_examples=examples, phases=phases))
    except NoSuchExample:
        return
    check(simplest)


def _search(strategy: st.SearchStrategy[Any], fault: Callable[[Any], str], shown: Callable[[Any], object]) -> None:
    if currently_in_test_context():
        return
    try:
        simplest = find(strategy, lambda given: bool(fault(given)), settings=_SETTINGS)
    except NoSuchExample:
        return
    require(False, fault(simplest), f"for {shown(simplest)}")
