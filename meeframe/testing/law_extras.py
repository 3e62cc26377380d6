"""Conformance of what a contact law may add: attraction, a gap of its own, memory. See meeframe.testing.contact."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array
from meeframe.laws.base import ContactLaw
from meeframe.testing.jumps import steepest
from meeframe.testing.law_maps import SAMPLES, Units, check_maps
from meeframe.testing.requirements import each, pure, require


def check_adhesion(law: ContactLaw, units: Units, random: np.random.Generator) -> None:
    """Check that adhesion is pure, local, finite, >= 0, zero at infinity, that of contact in overlap, and
    continuous."""
    gap = np.concatenate([[0.0], np.sort(units.gap * 10.0 ** random.uniform(-6.0, 4.0, SAMPLES)), [np.inf]])
    pull = pure(law.adhesion, gap, "adhesion")
    _check_numbers("adhesion", gap, pull, lambda some: law.adhesion(gap[some]), random)
    each(pull >= 0.0, "adhesion is negative", gap, pull)
    require(pull[-1] == 0.0, "adhesion at an infinite gap", pull[-1])
    overlap = law.adhesion(-gap[:-1])
    each(overlap == pull[0], "adhesion of overlapping surfaces is not that of contact", -gap[:-1], overlap)
    most = float(pull.max()) or 1.0
    start, end, jumps = steepest(lambda places: law.adhesion(places) / most, gap[:-2], gap[1:-1])
    each(~jumps, "adhesion jumps with the gap", start, law.adhesion(end) - law.adhesion(start))


def check_initial_gap(law: ContactLaw, units: Units, random: np.random.Generator) -> None:
    """Check that initial_gap is pure, local and finite."""
    points = units.extent * random.uniform(-1.0, 1.0, (SAMPLES, 3))
    gap = pure(law.initial_gap, points, "initial_gap")
    _check_numbers("initial_gap", points, gap, lambda some: law.initial_gap(points[some]), random)


def check_increments(law: ContactLaw, units: Units, random: np.random.Generator) -> None:
    """Check that for_increment gives contact laws with all properties of the law; it is pure, local, and does not see a
    duration that the law does not need."""
    own = type(law).for_increment is not ContactLaw.for_increment
    require(own or not law.needs_duration, "needs_duration, but for_increment makes nothing of it", law)
    if not own:
        return
    way = units.gap * 10.0 ** random.uniform(-3.0, 3.0, SAMPLES)
    way[::3] = 0.0
    durations = (units.duration, 1e-3 * units.duration) if law.needs_duration else (None, units.duration)
    for path, duration in ((np.zeros(SAMPLES), durations[0]), (way, durations[1]), (1e6 * way, durations[0])):
        _check_increment(law, path, duration, units, random)
    if not law.needs_duration:
        trial, gap, r = _states(units, random)
        without, given = (law.for_increment(way, duration).resolve(trial, gap, r) for duration in durations)
        same = (without == given).all(axis=1)
        each(same, "for_increment uses a duration, but the law says that it needs none", way, given)


def _states(units: Units, random: np.random.Generator) -> tuple[Array, Array, tuple[float, float]]:
    trial, gap = (size * random.normal(size=(SAMPLES, 3)) for size in (units.pressure, units.gap))
    return trial, gap, units.lengths()[0]


def _check_increment(
    law: ContactLaw, path: Array, duration: float | None, units: Units, random: np.random.Generator
) -> None:
    """Check one increment in full, and that the original law is unchanged."""
    trial, gap, r = _states(units, random)
    before, kept = law.resolve(trial, gap, r).copy(), path.copy()
    during = law.for_increment(path, duration)
    require(isinstance(during, ContactLaw), "for_increment gives no contact law", during)
    first = during.resolve(trial, gap, r).copy()
    other = law.for_increment(0.5 * path[::-1] + units.gap, duration)
    other.resolve(trial, gap, r)
    require(np.array_equal(path, kept), "for_increment changes its argument", path)
    unmoved = (law.resolve(trial, gap, r) == before).all(axis=1)
    each(unmoved, "for_increment changes the law itself", trial, before)
    again = during.resolve(trial, gap, r), law.for_increment(path, duration).resolve(trial, gap, r)
    each(((again[0] == first) & (again[1] == first)).all(axis=1), "for_increment depends on earlier calls", path, first)
    try:
        check_maps(during, lambda some: law.for_increment(path[some], duration), units, random)
        check_adhesion(during, units, random)
    except AssertionError as error:
        text = f"for_increment with slip paths up to {path.max():g} m, duration {duration}: {error}"
        raise AssertionError(text) from None


def _check_numbers(
    name: str, given: Array, found: Array, of: Callable[[NDArray[np.int_]], Array], random: np.random.Generator
) -> None:
    """Check that there is one finite number for each node, which depends on that node alone."""
    require(np.shape(found) == (len(given),), f"{name} has another shape than (n,)", np.shape(found))
    each(np.isfinite(found), f"{name} is not finite", given, found)
    some = random.permutation(len(given))[: len(given) // 3]
    each(of(some) == found[some], f"{name} depends on other nodes", given[some], found[some])
