"""Search with hypothesis for single inputs that violate an abstract class, reduced to the simplest one."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from hypothesis import HealthCheck, Phase, currently_in_test_context, find, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from meeframe.fields import Array
from meeframe.laws.base import (
    ConductivityLaw,
    ContactLaw,
    attraction,
    contact_conductivity,
    for_increment,
    has_memory,
    is_pure_projection,
    resolve,
)
from meeframe.testing.law_maps import Units
from meeframe.testing.requirements import require

_SETTINGS: Final = settings(
    max_examples=200, deadline=None, database=None, derandomize=True, suppress_health_check=list(HealthCheck)
)
# squares of the smallest numbers do not underflow: laws may compute norms
_SPECIAL: Final = (0.0, -0.0, 1.0, -1.0, 1e-60, -1e-60, 1e-9, -1e-9, 1e9, -1e9)
_NUMBERS: Final = st.sampled_from(_SPECIAL) | st.floats(1e-3, 10.0) | st.floats(-10.0, -1e-3)


def search_trials(law: ContactLaw, pressure: float) -> None:
    """Search for trials on which `project` is not an admissible, idempotent projection.

    The components are zero, equal, tiny and huge numbers in units of a pressure [Pa]. Within another test of hypothesis
    nothing is searched, because that test draws the inputs. Raises AssertionError.
    """

    def fault(trial: Any) -> str:
        trials = pressure * np.array([trial])
        with np.errstate(all="ignore"):
            traction = law.project(trials)
            again = law.project(traction)
        size = np.abs(trials).max()
        if not np.isfinite(traction).all():
            return "project gives tractions that are not finite"
        if traction[0, 2] > 0.0:
            return "normal traction pulls"
        if trials[0, 2] >= 0.0 and traction.any():
            return "traction where the trial is open"
        return "project is not idempotent" if np.abs(again - traction).max() > 1e-9 * size else ""

    _search(st.tuples(_NUMBERS, _NUMBERS, _NUMBERS), fault, lambda trial: pressure * np.array(trial))


def search_states(law: ContactLaw, units: Units) -> None:
    """Search for trials, gaps and slip paths at which `resolve` or `adhesion` are invalid, also during an increment.

    Components are zero, tiny and huge numbers in typical units. Laws that are pure projections are skipped. Behaves
    like `search_trials` otherwise.
    """
    if is_pure_projection(law) and not has_memory(law):
        return
    duration = units.duration if law.needs_duration else None
    r = units.lengths()[0]

    def state(numbers: Any) -> tuple[Array, Array, Array]:
        trial, gap = np.reshape(numbers[:6], (2, 1, 3)) * [[[units.pressure]], [[units.gap]]]
        return trial, gap, units.gap * np.abs(numbers[6:])

    def fault(numbers: Any) -> str:
        trial, gap, path = state(numbers)
        with np.errstate(all="ignore"):
            law_of_increment = for_increment(law, path, duration)
            traction, pull = resolve(law_of_increment, trial, gap, r), attraction(law_of_increment, np.abs(gap[:, 2]))
            again = law_of_increment.project(traction)
        if not np.isfinite(traction).all():
            return "resolve gives tractions that are not finite"
        if not np.isfinite(pull).all() or (pull < 0.0).any():
            return "adhesion is negative or not finite"
        if traction[0, 2] > 0.0:
            return "normal traction pulls"
        if trial[0, 2] >= 0.0 and traction.any():
            return "traction where the trial is open"
        admissible = np.abs(again - traction).max() <= 1e-9 * np.abs(trial).max()
        return "" if admissible else "resolve gives tractions that project does not admit"

    def describe(numbers: Any) -> str:
        trial, gap, path = state(numbers)
        return f"trial {trial[0]}, gap {gap[0]}, slip path {path[0]:g}"

    _search(st.tuples(*[_NUMBERS] * 7), fault, describe)


def search_conductivities(law: ConductivityLaw, pressure: float, gap: float, drop: float) -> None:
    """Search for states with an invalid conductivity, or with one that changes though the law is not across_gap.

    Components are zero, tiny and huge numbers in units of a pressure [Pa], a gap [m] and a drop [V] or [A]. Behaves
    like `search_trials` otherwise.
    """
    units = np.array([pressure, gap, drop])

    def state(numbers: Any) -> Array:
        traction, distance, change = numbers
        closed = traction < 0.0
        values: Array = units * np.array([traction if closed else 0.0, 0.0 if closed else abs(distance), change])
        return values

    def fault(numbers: Any) -> str:
        states = state(numbers)[:, None]
        with np.errstate(all="ignore"):
            kappa = law.conductivity(*states)[0]
            in_contact = contact_conductivity(law, states[0])[0]
        if kappa != in_contact and not law.across_gap:
            return "conductivity changes with gap or drop, but the law is not across_gap"
        return "" if kappa >= 0.0 else "conductivity is negative or NaN"

    _search(st.tuples(_NUMBERS, _NUMBERS, _NUMBERS), fault, lambda numbers: f"traction, gap, drop = {state(numbers)}")


def search_for(
    strategy: st.SearchStrategy[Any], check: Callable[[Any], None], examples: int = 200, simplify: bool = True
) -> None:
    """Raise the AssertionError that `check` raises for the simplest failing input, if there is one.

    Behaves like `search_trials` otherwise.

    Parameters
    ----------
    strategy
        Strategy that draws inputs.
    check
        Check of an input.
    examples
        Number of inputs.
    simplify
        Whether a failing input is simplified, which may take as many inputs again.
    """
    if currently_in_test_context():
        return

    def fails(example: Any) -> bool:
        try:
            check(example)
        except AssertionError:
            return True
        return False

    phases = [Phase.generate, Phase.shrink] if simplify else [Phase.generate]
    try:
        simplest = find(strategy, fails, settings=settings(_SETTINGS, max_examples=examples, phases=phases))
    except NoSuchExample:
        return
    check(simplest)


def _search(strategy: st.SearchStrategy[Any], fault: Callable[[Any], str], describe: Callable[[Any], object]) -> None:
    if currently_in_test_context():
        return
    try:
        simplest = find(strategy, lambda example: bool(fault(example)), settings=_SETTINGS)
    except NoSuchExample:
        return
    require(False, fault(simplest), f"for {describe(simplest)}")
