"""Hypothesis looks for single tractions that break a law, and hands over the simplest it finds."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from hypothesis import HealthCheck, currently_in_test_context, find, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from meeframe.core.fields import Array
from meeframe.core.law import ConductivityLaw, ContactLaw, contact_conductivity
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


def search_conductivities(law: ConductivityLaw, pressure: float, gap: float, drop: float) -> None:
    """States of zero, tiny and huge numbers, in units of a pressure [Pa], a gap [m] and a drop [V] or [A], at which
    kappa is none or changes though the law is not across_gap. As search_trials."""
    units = np.array([pressure, gap, drop])

    def state(numbers: Any) -> Array:
        traction, apart, dropping = numbers
        closed = traction < 0.0
        given: Array = units * np.array([traction if closed else 0.0, 0.0 if closed else abs(apart), dropping])
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


def _search(strategy: st.SearchStrategy[Any], fault: Callable[[Any], str], shown: Callable[[Any], object]) -> None:
    if currently_in_test_context():
        return
    try:
        simplest = find(strategy, lambda given: bool(fault(given)), settings=_SETTINGS)
    except NoSuchExample:
        return
    require(False, fault(simplest), f"for {shown(simplest)}")
