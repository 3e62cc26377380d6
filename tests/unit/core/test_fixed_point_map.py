"""Derivatives of the fixed-point map agree with finite differences."""

from dataclasses import dataclass
from typing import final

import numpy as np
import pytest

from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw, augmented_traction, fixed_point_map, traction_tangents

R, PRESSURE = (2.0, 0.7), 1.0
"""Steps of normal and tangential gaps [Pa/m], and a characteristic traction [Pa]."""


@final
@dataclass(frozen=True)
class Adhesive(ContactLaw):
    """Coulomb's law under an attraction that decreases with the gap."""

    inner: ContactLaw

    def project(self, trial: Array) -> Array:
        return self.inner.project(trial)

    def tangential_scaling(self) -> Array:
        return self.inner.tangential_scaling()

    def adhesion(self, gap: Array) -> Array:
        return 0.3 * PRESSURE * np.exp(-2.0 * gap)


@final
@dataclass(frozen=True)
class Layered(ContactLaw):
    """A compliant layer whose traction depends on the gap in addition to the trial."""

    inner: ContactLaw

    def project(self, trial: Array) -> Array:
        return self.inner.project(trial)

    def tangential_scaling(self) -> Array:
        return self.inner.tangential_scaling()

    def resolve(self, trial: Array, gap: Array, r: tuple[float, float]) -> Array:
        return self.inner.project(trial) * (1.0 + 0.1 * np.tanh(gap[:, 2:]))


COULOMB = OrthotropicCoulomb(0.2, 0.5)
LAWS = [Signorini(), IsotropicCoulomb(0.4), COULOMB, Adhesive(Signorini()), Adhesive(COULOMB), Layered(COULOMB)]


@pytest.mark.parametrize(
    "law", LAWS, ids=lambda law: f"{type(law).__name__} {type(getattr(law, 'inner', law)).__name__}"
)
def test_derivatives_of_the_fixed_point_map(law: ContactLaw) -> None:
    random, n, width = np.random.default_rng(4), 200, 1e-6
    traction, gap = random.normal(size=(2, n, 3)) * PRESSURE
    traction[:, 2] -= 0.5

    def fixed_point(traction: Array, gap: Array) -> Array:
        return fixed_point_map(law, augmented_traction(law, traction, gap, R), gap, R)

    def differences(change: Array) -> Array:
        return (fixed_point(traction + change, gap) - fixed_point(traction - change, gap)) / (2.0 * width)

    def of_gap(change: Array) -> Array:
        return (fixed_point(traction, gap + change) - fixed_point(traction, gap - change)) / (2.0 * width)

    axes = width * np.eye(3)
    expected = [np.stack([derivative(axis) for axis in axes], axis=2) for derivative in (differences, of_gap)]
    computed = traction_tangents(law, augmented_traction(law, traction, gap, R), gap, R)
    for one, other in zip(computed, expected, strict=True):
        off = np.abs(one - other).max(axis=(1, 2)) > 1e-4
        assert off.sum() <= 2, "but at kinks"
        assert np.abs(other).max() > 0.1


def test_open_nodes_have_zero_derivatives() -> None:
    law, trial, gap = COULOMB, np.tile([0.1, 0.0, -1.0], (4, 1)), np.zeros((4, 3))
    untouched = np.array([True, False, True, False])
    plain, masked = traction_tangents(law, trial, gap, R), traction_tangents(law, trial, gap, R, untouched)
    for one, other in zip(plain, masked, strict=True):
        assert not other[untouched].any()
        np.testing.assert_array_equal(other[~untouched], one[~untouched])
        assert one[untouched].any(), "the law's own derivatives stay as they are"


def test_infinite_slopes_times_zero_scaling_vanish() -> None:
    """A frictionless law whose traction jumps with the tangential trial has zero scaling, so 0 inf must be zero."""

    @dataclass(frozen=True)
    class Jumping(Signorini):
        def tangent(self, trial: Array) -> Array:
            slopes = super().tangent(trial)
            slopes[:, :2, :2] = np.inf
            return slopes

    trial, gap = -np.ones((4, 3)), np.zeros((4, 3))
    _, by_gap = traction_tangents(Jumping(), trial, gap, R)
    _, expected = traction_tangents(Signorini(), trial, gap, R)
    np.testing.assert_array_equal(by_gap, expected)
