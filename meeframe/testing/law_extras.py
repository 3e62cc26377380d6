"""Conformance of optional methods of contact laws: attraction, initial gap and memory; see meeframe.testing.contact."""

from collections.abc import Callable
from typing import cast

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array
from meeframe.laws.base import AdhesiveLaw, ContactLaw, for_increment, has_memory, is_adhesive, resolve
from meeframe.testing.jumps import steepest
from meeframe.testing.law_maps import SAMPLES, Units, check_maps
from meeframe.testing.requirements import each, pure, require


def check_adhesion(law: ContactLaw, units: Units, random: np.random.Generator) -> None:
    """Check that adhesion is pure, local, finite, >= 0, zero at infinity, constant in overlap, and continuous."""
    if is_adhesive(law):
        _check_attraction(cast(AdhesiveLaw, law), units, random)


def _check_attraction(law: AdhesiveLaw, units: Units, random: np.random.Generator) -> None:
    """Check the attraction of a law that has one."""
    gap = np.concatenate([[0.0], np.sort(units.gap * 10.0 ** random.uniform(-6.0, 4.0, SAMPLES)), [np.inf]])
    pull = pure(law.adhesion, gap, "adhesion")
    _check_numbers("adhesion", gap, pull, lambda sample: law.adhesion(gap[sample]), random)
    each(pull >= 0.0, "adhesion is negative", gap, pull)
    require(pull[-1] == 0.0, "adhesion at an infinite gap", pull[-1])
    overlap = law.adhesion(-gap[:-1])
    each(overlap == pull[0], "adhesion of overlapping surfaces is not that of contact", -gap[:-1], overlap)
    largest = float(pull.max()) or 1.0
    start, end, jumps = steepest(lambda gaps: law.adhesion(gaps) / largest, gap[:-2], gap[1:-1])
    each(~jumps, "adhesion jumps with the gap", start, law.adhesion(end) - law.adhesion(start))


def check_initial_gap(law: ContactLaw, units: Units, random: np.random.Generator) -> None:
    """Check that initial_gap is pure, local and finite."""
    points = units.extent * random.uniform(-1.0, 1.0, (SAMPLES, 3))
    gap = pure(law.initial_gap, points, "initial_gap")
    _check_numbers("initial_gap", points, gap, lambda sample: law.initial_gap(points[sample]), random)


def check_increments(law: ContactLaw, units: Units, random: np.random.Generator) -> None:
    """Check that for_increment is pure and local and returns contact laws with all properties of the law.

    It must not depend on a duration that the law does not need.
    """
    require(has_memory(law) or not law.needs_duration, "needs_duration, but for_increment does not use it", law)
    if not has_memory(law):
        return
    slip_path = units.gap * 10.0 ** random.uniform(-3.0, 3.0, SAMPLES)
    slip_path[::3] = 0.0
    durations = (units.duration, 1e-3 * units.duration) if law.needs_duration else (None, units.duration)
    for path, duration in (
        (np.zeros(SAMPLES), durations[0]),
        (slip_path, durations[1]),
        (1e6 * slip_path, durations[0]),
    ):
        _check_increment(law, path, duration, units, random)
    if not law.needs_duration:
        trial, gap, r = _states(units, random)
        no_duration, with_duration = (
            resolve(for_increment(law, slip_path, duration), trial, gap, r) for duration in durations
        )
        equal = (no_duration == with_duration).all(axis=1)
        each(equal, "for_increment uses a duration, but the law says that it needs none", slip_path, with_duration)


def _states(units: Units, random: np.random.Generator) -> tuple[Array, Array, tuple[float, float]]:
    trial, gap = (size * random.normal(size=(SAMPLES, 3)) for size in (units.pressure, units.gap))
    return trial, gap, units.lengths()[0]


def _check_increment(
    law: ContactLaw, path: Array, duration: float | None, units: Units, random: np.random.Generator
) -> None:
    """Check one increment in full, and that the original law is unchanged."""
    trial, gap, r = _states(units, random)
    before, copy_of_path = resolve(law, trial, gap, r).copy(), path.copy()
    law_of_increment = for_increment(law, path, duration)
    require(isinstance(law_of_increment, ContactLaw), "for_increment does not return a contact law", law_of_increment)
    first = resolve(law_of_increment, trial, gap, r).copy()
    other = for_increment(law, 0.5 * path[::-1] + units.gap, duration)
    resolve(other, trial, gap, r)
    require(np.array_equal(path, copy_of_path), "for_increment changes its argument", path)
    unchanged = (resolve(law, trial, gap, r) == before).all(axis=1)
    each(unchanged, "for_increment changes the law itself", trial, before)
    again = resolve(law_of_increment, trial, gap, r), resolve(for_increment(law, path, duration), trial, gap, r)
    each(((again[0] == first) & (again[1] == first)).all(axis=1), "for_increment depends on earlier calls", path, first)
    try:
        check_maps(law_of_increment, lambda sample: for_increment(law, path[sample], duration), units, random)
        check_adhesion(law_of_increment, units, random)
    except AssertionError as error:
        text = f"for_increment with slip paths up to {path.max():g} m, duration {duration}: {error}"
        raise AssertionError(text) from None


def _check_numbers(
    name: str, states: Array, values: Array, evaluate: Callable[[NDArray[np.int_]], Array], random: np.random.Generator
) -> None:
    """Check that there is one finite number for each node, which depends on that node alone."""
    require(np.shape(values) == (len(states),), f"{name} has another shape than (n,)", np.shape(values))
    each(np.isfinite(values), f"{name} is not finite", states, values)
    sample = random.permutation(len(states))[: len(states) // 3]
    each(evaluate(sample) == values[sample], f"{name} depends on other nodes", states[sample], values[sample])
