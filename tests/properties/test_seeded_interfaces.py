"""The conformance check names the fault of laws with more than a projection that are each wrong in one way."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb
from meeframe.laws.base import ContactLaw, StepLengths
from meeframe.testing.contact import (
    check_contact_law,
    check_fading,
    check_homogeneous,
    check_isotropic,
    check_monotone,
    check_orthotropic,
)

MU, LEAST, DISTANCE = 0.4, 0.2, 2e-6
SOFTNESS = 5e-13
"""Closing of the soft surfaces by pressure [m/Pa]."""
HARD = IsotropicCoulomb(MU)


def coefficient(path: Array) -> Array:
    return LEAST + (MU - LEAST) * np.exp(-path / DISTANCE)


def radial_return(trial: Array, mu: Array | float) -> Array:
    """Return the radial return to discs of radius mu |p|."""
    traction = np.column_stack([trial[:, :2], np.minimum(trial[:, 2], 0.0)])
    size = np.linalg.norm(trial[:, :2], axis=1)
    limit = -mu * traction[:, 2]
    traction[:, :2] *= np.divide(limit, size, out=np.ones_like(size), where=size > limit)[:, None]
    return traction


def compliant(trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return tractions of surfaces with compliance and friction; the gap is not used."""
    return HARD.project(np.column_stack([trial[:, :2], np.minimum(trial[:, 2], 0.0) / (1.0 + r[0] * SOFTNESS)]))


def weakening(trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return tractions with a friction coefficient that decreases with the slip."""
    return radial_return(trial, coefficient(np.linalg.norm(gap[:, :2], axis=1)))


def attraction(gap: Array) -> Array:
    return 2e5 * np.exp(-np.maximum(gap, 0.0) / 1e-6)


def waves(points: Array) -> Array:
    return 1e-7 * (1.0 - np.cos(points[:, 0] / 1e-4))


@dataclass(frozen=True)
class Law(ContactLaw):
    """A correct law whose functions are replaced by wrong ones."""

    answer: Callable[[Array, Array, StepLengths], Array] = compliant
    pull: Callable[[Array], Array] = attraction
    rough: Callable[[Array], Array] = waves

    def project(self, trial: Array) -> Array:
        return HARD.project(trial)

    def tangential_scaling(self) -> Array:
        return np.eye(2)

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        return self.answer(trial, gap, r)

    def adhesion(self, gap: Array) -> Array:
        return self.pull(gap)

    def initial_gap(self, points: Array) -> Array:
        return self.rough(points)


@dataclass(frozen=True)
class WeakensWithPath(Law):
    """A law that weakens with the earlier slip path."""

    path: Array | None = field(default=None, compare=False)

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        before = 0.0 if self.path is None else self.path
        return radial_return(trial, coefficient(before + np.linalg.norm(gap[:, :2], axis=1)))

    def for_increment(self, slip_path: Array, duration: float | None) -> ContactLaw:
        return replace(self, path=slip_path)


@pytest.mark.full
def test_correct_laws_pass() -> None:
    for law in (Law(), Law(weakening), WeakensWithPath()):
        check_contact_law(law, reference=law)
        check_fading(law)
        check_monotone(law)


def open_too(trial: Array, gap: Array, r: StepLengths) -> Array:
    return np.where(np.isfinite(trial[:, 2:]), HARD.project(trial - [0.0, 0.0, 1e4]), 0.0)


def pulling(trial: Array, gap: Array, r: StepLengths) -> Array:
    traction = compliant(trial, gap, r)
    traction[:, 2] = np.where(trial[:, 2] < 0.0, traction[:, 2] + 5e5, 0.0)
    return traction


def unlimited(trial: Array, gap: Array, r: StepLengths) -> Array:
    return np.where(trial[:, 2:] < 0.0, trial, 0.0)


def without_step(trial: Array, gap: Array, r: StepLengths) -> Array:
    return compliant(trial, gap, (1e12, r[1]))


def spring_by_the_gap(trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return tractions that use the slip with the length of the trial, for any step length."""
    return radial_return(trial, coefficient(np.linalg.norm(trial[:, :2], axis=1) * 1e-15))


def halving(trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return tractions that weaken with slip and carry half of the normal trial, for any step length."""
    return weakening(trial * [1.0, 1.0, 0.5], gap, r)


def alone(trial: Array, gap: Array, r: StepLengths) -> Array:
    return weakening(trial, gap * np.abs(gap[:, :2]).mean() * 1e6, r)


def zero_by_zero(trial: Array, gap: Array, r: StepLengths) -> Array:
    size = np.linalg.norm(gap[:, :2], axis=1)
    with np.errstate(all="ignore"):
        return weakening(trial, gap, r) * (size / size)[:, None]


def at_the_edge(trial: Array, gap: Array, r: StepLengths) -> Array:
    traction = compliant(trial, gap, r)
    traction[np.isinf(gap[:, 2]), 0] = 1.0
    return traction


def yielding(trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return tractions that decrease under larger pressure."""
    normal = np.minimum(trial[:, 2], 0.0)
    return HARD.project(np.column_stack([trial[:, :2], normal * np.exp(normal / 5e5)]))


def hardening(trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return tractions larger than the pressure."""
    return HARD.project(trial * [1.0, 1.0, 1.5])


def driven(trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return tractions as on a running belt."""
    return HARD.project(np.column_stack([trial[:, 0] + 1e9, trial[:, 1:]]))


def changing(trial: Array, gap: Array, r: StepLengths) -> Array:
    np.maximum(gap[:, 2], 0.0, out=gap[:, 2])
    return compliant(trial, gap, r)


class ReusesItsArray:
    """Fills and returns the same array in every call."""

    def __init__(self) -> None:
        self.kept = np.zeros((0, 3))

    def __call__(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        if self.kept.shape != trial.shape:
            self.kept = np.zeros_like(trial)
        self.kept[:] = compliant(trial, gap, r)
        return self.kept


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (open_too, "traction where the trial is open: for .* it gives"),
        (pulling, "normal traction pulls: for .* it gives"),
        (unlimited, "resolve gives tractions that project does not admit: for .* it gives"),
        (without_step, "solutions depend on the step r: for .* it gives"),
        (spring_by_the_gap, "traction under slip depends on the step|solutions depend on the step r"),
        (halving, "solutions depend on the step r: for .* it gives"),
        (alone, "resolve depends on other nodes"),
        (zero_by_zero, "resolve gives tractions that are not finite: for .* it gives"),
        (at_the_edge, "resolve gives traction where there is no indenter above"),
        (yielding, "normal traction is not monotone in its trial: for .* it gives"),
        (hardening, "normal traction is not monotone in its trial"),
        (driven, "slip gains energy: for .* it gives"),
        (changing, "resolve changes its argument"),
        (ReusesItsArray(), "resolve changes what it gave before"),
    ],
)
def test_wrong_tractions_are_detected(fault: Any, message: str) -> None:
    with pytest.raises(AssertionError, match=rf"(?s){message}.*why it matters"):
        check_contact_law(Law(fault))


@dataclass(frozen=True)
class Tangents(Law):
    """Returns its derivatives, scaled by factors."""

    answer: Callable[[Array, Array, StepLengths], Array] = weakening
    by_trial: float = 1.0
    by_gap: float = 1.0
    inside: bool = True

    def tangents(self, trial: Array, gap: Array, r: StepLengths) -> tuple[Array, Array]:
        first, second = super().tangents(trial, gap, r)
        above = np.isfinite(trial[:, 2])
        first, second[above] = self.by_trial * first, self.by_gap * second[above]
        if not self.inside:
            first[~above] = np.eye(3)
        return first, second


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("law", "message"),
    [
        (Tangents(by_trial=0.9), "tangents are not the derivatives of resolve by the trial: for .* it gives"),
        (Tangents(by_gap=0.0), "tangents are not the derivatives of resolve by the gap: for .* it gives"),
        (Tangents(by_gap=-1.0), "tangents are not the derivatives of resolve by the gap"),
        (Tangents(inside=False), "tangents where there is no indenter above"),
        (Tangents(by_gap=np.nan), "tangents are not the derivatives of resolve by the gap: not finite"),
    ],
)
def test_wrong_tangents_are_detected(law: ContactLaw, message: str) -> None:
    check_contact_law(Tangents())
    with pytest.raises(AssertionError, match=f"(?s){message}"):
        check_contact_law(law)


class GrowsWithCalls:
    """An attraction that grows with each call."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, gap: Array) -> Array:
        self.calls += 1
        return self.calls * attraction(gap)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (lambda gap: -attraction(gap), "adhesion is negative: for .* it gives"),
        (lambda gap: np.full_like(gap, 1e5), "adhesion at an infinite gap"),
        (lambda gap: 2e5 * (gap < 1e-6), "adhesion jumps with the gap: for .*e-0[67] it gives"),
        (lambda gap: attraction(gap) / (1.0 + np.nanmin(gap)), "adhesion depends on other nodes"),
        (lambda gap: np.where(gap == 0.0, np.nan, attraction(gap)), "adhesion is not finite: for 0.0 it gives nan"),
        (
            lambda gap: 2e5 * np.exp(-np.maximum(gap, -1e-6) / 1e-6),
            "adhesion of overlapping surfaces is not that of contact",
        ),
        (lambda gap: attraction(gap)[:, None], r"adhesion has another shape than \(n,\)"),
        (GrowsWithCalls(), "adhesion depends on earlier calls"),
    ],
)
def test_wrong_attractions_are_detected(fault: Any, message: str) -> None:
    with pytest.raises(AssertionError, match=rf"(?s){message}.*why it matters"):
        check_contact_law(Law(pull=fault))


def test_growing_attraction_is_a_separate_check() -> None:
    law = Law(pull=lambda gap: np.where(np.isfinite(gap), attraction(gap) * np.maximum(gap, 0.0) / 1e-6, 0.0))
    with np.errstate(invalid="ignore"):
        check_contact_law(law)
        with pytest.raises(AssertionError, match=r"(?s)attraction grows with the gap: for .* it gives"):
            check_fading(law)


def test_traction_against_the_trial_is_a_separate_check() -> None:
    with pytest.raises(AssertionError, match=r"(?s)resolve is not monotone: for .* it gives"):
        check_monotone(Law(lambda trial, gap, r: compliant(trial, gap, r) * [-1.0, 1.0, 1.0]))


def weaker_along_one_axis(trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return a coefficient that depends on the slip along e1 only."""
    return radial_return(trial, coefficient(np.abs(gap[:, 0])))


def weaker_one_way(trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return a coefficient that depends on slip in the positive direction of e1 only."""
    return radial_return(trial, coefficient(np.maximum(gap[:, 0], 0.0)))


@pytest.mark.full
def test_dependence_on_the_gap_is_a_separate_check() -> None:
    for law in (Law(weakening), Law(weaker_along_one_axis), Law(weaker_one_way)):
        check_contact_law(law)
        check_homogeneous(law)
    check_isotropic(Law(weakening))
    check_orthotropic(Law(weaker_along_one_axis), (MU, MU))
    with pytest.raises(AssertionError, match="resolve: friction depends on the direction"):
        check_isotropic(Law(weaker_along_one_axis))
    with pytest.raises(AssertionError, match="resolve: not symmetric about its principal axes"):
        check_orthotropic(Law(weaker_one_way), (MU, MU))
    with pytest.raises(AssertionError, match="resolve is not homogeneous"):
        check_homogeneous(Law(compliant))


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (lambda points: waves(points) - waves(points).mean(), "initial_gap depends on other nodes"),
        (lambda points: np.sqrt(points[:, 0] - 1.0), "initial_gap is not finite: for .* it gives nan"),
        (lambda points: points[:, :2], r"initial_gap has another shape than \(n,\)"),
        (lambda points: np.multiply(points, 2.0, out=points)[:, 0], "initial_gap changes its argument"),
    ],
)
def test_wrong_gaps_are_detected(fault: Any, message: str) -> None:
    with np.errstate(invalid="ignore"), pytest.raises(AssertionError, match=rf"(?s){message}.*why it matters"):
        check_contact_law(Law(rough=fault))


class Melted:
    """An object that is no contact law."""


@dataclass(frozen=True)
class Ageing(WeakensWithPath):
    """A law that weakens with a wrong slip path."""

    wrong: Callable[[Array, float | None], Any] = field(default=lambda path, duration: path)

    def for_increment(self, slip_path: Array, duration: float | None) -> ContactLaw:
        given = self.wrong(slip_path, duration)
        return replace(self, path=given) if isinstance(given, np.ndarray) else given


@dataclass(frozen=True)
class Timeless(Law):
    """A law that requires a duration without using it."""

    needs_duration: ClassVar[bool] = True


@dataclass(frozen=True)
class Wearing(WeakensWithPath):
    """A law whose friction decreases with every increment requested."""

    worn: list[float] = field(default_factory=list, compare=False)

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        return radial_return(trial, MU / (1.0 + len(self.worn)))

    def for_increment(self, slip_path: Array, duration: float | None) -> ContactLaw:
        self.worn.append(0.0)
        return self


@dataclass(frozen=True)
class WornOut(WeakensWithPath):
    """A law whose friction changes sign after a long slip path."""

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        path = np.zeros(len(trial)) if self.path is None else self.path
        return radial_return(trial, MU * (1.0 - 2.0 * path / (path + 1.0)))


def cleared(path: Array, duration: float | None) -> Array:
    path[:] = 0.0
    return path


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("law", "message"),
    [
        (Ageing(wrong=lambda path, duration: Melted()), "for_increment does not return a contact law"),
        (Ageing(wrong=cleared), "for_increment changes its argument"),
        (Ageing(wrong=lambda path, duration: path + (duration or 0.0)), "for_increment uses a duration"),
        (Ageing(wrong=lambda path, duration: path - path[0]), "for_increment .*: resolve depends on other nodes"),
        (Timeless(), "needs_duration, but for_increment does not use it"),
        (Wearing(), "for_increment changes the law itself"),
        (WornOut(), "for_increment with slip paths up to .* m, duration .*: slip gains energy"),
    ],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_wrong_increments_are_detected(law: ContactLaw, message: str) -> None:
    with pytest.raises(AssertionError, match=rf"(?s){message}.*why it matters"):
        check_contact_law(law)


@dataclass(frozen=True)
class Rested(WeakensWithPath):
    """Friction that depends on the duration of the increment."""

    needs_duration: ClassVar[bool] = True
    healing: float = 0.1

    def for_increment(self, slip_path: Array, duration: float | None) -> ContactLaw:
        assert duration is not None
        return replace(self, path=slip_path / (1.0 + self.healing * duration))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("law", "reference", "message"),
    [
        (Law(), Law(without_step), "^resolve differs from the reference law"),
        (Law(), Law(pull=lambda gap: 1.01 * attraction(gap)), "^adhesion differs from the reference law"),
        (Law(), Law(rough=lambda points: 1.01 * waves(points)), "^initial_gap differs from the reference law"),
        (
            Ageing(wrong=lambda path, duration: 1.01 * path),
            WeakensWithPath(),
            "^for_increment with slip paths up to .*: resolve differs from the reference law",
        ),
        (Rested(), Rested(healing=0.2), "^for_increment .* duration 1.0: resolve differs from the reference law"),
        (Rested(), WeakensWithPath(), "^needs_duration differs from the reference law"),
    ],
)
def test_deviation_from_the_reference_is_detected(law: ContactLaw, reference: ContactLaw, message: str) -> None:
    check_contact_law(law, reference=law)
    with pytest.raises(AssertionError, match=message):
        check_contact_law(law, reference=reference)
