"""The conformance checks name the fault of contact laws that are each wrong in one way."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb
from meeframe.laws.base import ContactLaw
from meeframe.testing.contact import (
    check_associated,
    check_contact_law,
    check_homogeneous,
    check_isotropic,
    check_orthotropic,
)

RIGHT = OrthotropicCoulomb(0.1, 0.6, 0.3)


@dataclass(frozen=True)
class WrongLaw(ContactLaw):
    """Correct orthotropic friction; subclasses introduce errors."""

    def project(self, trial: Array) -> Array:
        return RIGHT.project(trial)

    def tangential_scaling(self) -> Array:
        return RIGHT.tangential_scaling()


class SlipSign(WrongLaw):
    """Traction against the motion of the indenter, the sign of eq. (28)."""

    def project(self, trial: Array) -> Array:
        return RIGHT.project(trial) * [-1.0, -1.0, 1.0]


@dataclass(frozen=True)
class Mixed(WrongLaw):
    """The projection of one law with the metric of another."""

    projection: ContactLaw
    metric: ContactLaw

    def project(self, trial: Array) -> Array:
        return self.projection.project(trial)

    def tangential_scaling(self) -> Array:
        return self.metric.tangential_scaling()


SWAPPED = OrthotropicCoulomb(0.6, 0.1, 0.3)
"""A sound law, but not the one it says it is; so are the next two."""
TURNED_BACK = OrthotropicCoulomb(0.1, 0.6, -0.3)
UNTURNED = OrthotropicCoulomb(0.1, 0.6)
RADIAL_WITH_UNIT_STEP = Mixed(RIGHT, IsotropicCoulomb(1.0))
"""Traction opposite to slip: another law (docs/explanation/theory.md, Set and metric)."""
ALMOST_ISOTROPIC_WITH_UNIT_STEP = Mixed(OrthotropicCoulomb(0.5, 0.6), IsotropicCoulomb(1.0))


@dataclass(frozen=True)
class Scaled(WrongLaw):
    """The scaling factor * M^2 / max(mu)^2 + skew."""

    factor: float = 1.0
    skew: float = 0.0

    def tangential_scaling(self) -> Array:
        return self.factor * RIGHT.tangential_scaling() + np.array([[0.0, self.skew], [0.0, 0.0]])


def closest_on_ellipse(point: Array, half_axes: Array) -> Array:
    """Return the closest points (n, 2) of ellipses with semi-axes (n, 2) to points (n, 2); points inside are
    unchanged."""
    inside = ((point / half_axes) ** 2).sum(axis=1) <= 1.0
    low = np.zeros(len(point))
    high = np.linalg.norm(half_axes * point, axis=1)
    for _ in range(200):
        middle = 0.5 * (low + high)
        beyond = ((half_axes * point / (half_axes**2 + middle[:, None])) ** 2).sum(axis=1) > 1.0
        low, high = np.where(beyond, middle, low), np.where(beyond, high, middle)
    closest = half_axes**2 * point / (half_axes**2 + high[:, None])
    return np.where(inside[:, None], point, closest)


class EuclideanProjection(WrongLaw):
    """The closest point of the ellipse with the step M^2, which is inconsistent (docs/explanation/theory.md,
    Contact)."""

    def project(self, trial: Array) -> Array:
        pressure = np.maximum(-trial[:, 2:], 0.0)
        half_axes = np.where(pressure > 0.0, pressure, 1.0) * [0.1, 0.6]
        closest = closest_on_ellipse(trial[:, :2], half_axes)
        return np.concatenate([np.where(pressure > 0.0, closest, 0.0), -pressure], axis=1)

    def tangential_scaling(self) -> Array:
        return OrthotropicCoulomb(0.1, 0.6).tangential_scaling()


@dataclass(frozen=True)
class StalePressure(WrongLaw):
    """A friction limit with the pressures of the previous call."""

    seen: list[Array] = field(default_factory=list, compare=False)

    def project(self, trial: Array) -> Array:
        pressure = np.minimum(trial[:, 2], 0.0)
        before = self.seen[-1] if self.seen and len(self.seen[-1]) == len(trial) else pressure
        self.seen[:] = [pressure]
        traction = RIGHT.project(np.column_stack([trial[:, :2], before]))
        traction[:, 2] = pressure
        traction[pressure == 0.0] = 0.0
        return traction


class LimitOfTheTrial(WrongLaw):
    """Pressure limited by a hardness, with the friction limit of the unlimited pressure."""

    def project(self, trial: Array) -> Array:
        traction = RIGHT.project(trial)
        traction[:, 2] = np.maximum(traction[:, 2], -5e5)
        return traction


class FrictionOfTension(WrongLaw):
    """A friction limit of |trial|, also where contact is open."""

    def project(self, trial: Array) -> Array:
        traction = RIGHT.project(np.column_stack([trial[:, :2], -np.abs(trial[:, 2])]))
        traction[:, 2] = np.minimum(trial[:, 2], 0.0)
        return traction


class Adhesive(WrongLaw):
    """A law that transmits tension up to a stress."""

    def project(self, trial: Array) -> Array:
        traction = RIGHT.project(trial)
        traction[:, 2] = np.where(trial[:, 2] < 1e5, trial[:, 2], 0.0)
        return traction


class Shrinking(WrongLaw):
    """Tractions reduced by a tenth."""

    def project(self, trial: Array) -> Array:
        return RIGHT.project(trial) * [0.9, 0.9, 1.0]


class Coupled(WrongLaw):
    """A friction limit by the mean pressure of all nodes."""

    def project(self, trial: Array) -> Array:
        pressure = np.minimum(trial[:, 2], 0.0)
        mean = np.where(pressure < 0.0, pressure.mean(), 0.0)
        traction = RIGHT.project(np.column_stack([trial[:, :2], mean]))
        traction[:, 2] = pressure
        return traction


class Driven(WrongLaw):
    """Admissible tractions in a disc off the origin, as on a running belt: slip may gain energy."""

    def project(self, trial: Array) -> Array:
        pressure = np.minimum(trial[:, 2], 0.0)
        centre = -0.5 * pressure[:, None] * [1.0, 0.0]
        traction = IsotropicCoulomb(0.3).project(np.column_stack([trial[:, :2] - centre, pressure]))
        traction[:, :2] += centre
        return traction

    def tangential_scaling(self) -> Array:
        return np.eye(2)


class Swirling(WrongLaw):
    """Tractions rotated in proportion to the step: admissible, idempotent, non-expansive, but no projection."""

    def project(self, trial: Array) -> Array:
        traction = IsotropicCoulomb(0.3).project(trial)
        limit = np.maximum(-0.3 * trial[:, 2], 1e-3)
        distance = np.maximum(np.linalg.norm(trial[:, :2], axis=1) / limit, 1.0)
        angle = 0.8 * (np.sqrt(distance**2 - 1.0) - np.arccos(1.0 / distance)) / distance
        c, s = np.cos(angle), np.sin(angle)
        x, y = traction[:, 0].copy(), traction[:, 1].copy()
        traction[:, 0], traction[:, 1] = c * x - s * y, s * x + c * y
        return traction

    def tangential_scaling(self) -> Array:
        return np.eye(2)


class NotANumber(WrongLaw):
    """NaN for large trials."""

    def project(self, trial: Array) -> Array:
        traction = RIGHT.project(trial)
        traction[np.abs(trial[:, 0]) > 2e6] = np.nan
        return traction


class FrictionWithoutIndenter(WrongLaw):
    def project(self, trial: Array) -> Array:
        traction = RIGHT.project(trial)
        traction[np.isinf(trial[:, 2]), 0] = 1.0
        return traction


class ChangesItsArgument(WrongLaw):
    def project(self, trial: Array) -> Array:
        trial[:, 2] = np.minimum(trial[:, 2], 0.0)
        return RIGHT.project(trial)


@dataclass(frozen=True)
class ReusesItsArray(WrongLaw):
    """A law that returns the same array in every call."""

    kept: list[Array] = field(default_factory=list, compare=False)

    def project(self, trial: Array) -> Array:
        traction = RIGHT.project(trial)
        if not self.kept or self.kept[0].shape != traction.shape:
            self.kept[:] = [traction]
        self.kept[0][:] = traction
        return self.kept[0]


class TangentWithoutPressure(WrongLaw):
    """A tangent that neglects the dependence of the friction limit on the pressure."""

    def tangent(self, trial: Array) -> Array:
        tangent = RIGHT.tangent(trial)
        tangent[:, :2, 2] = 0.0
        return tangent


class TangentOfStick(WrongLaw):
    """A tangent that treats slipping nodes as sticking."""

    def tangent(self, trial: Array) -> Array:
        finite = np.isfinite(trial[:, 2])
        return np.where((finite & (trial[:, 2] < 0.0))[:, None, None], np.eye(3), 0.0)


class TangentTransposed(WrongLaw):
    def tangent(self, trial: Array) -> Array:
        return RIGHT.tangent(trial).swapaxes(1, 2)


class WithAThreshold(WrongLaw):
    """Cohesion, a friction limit that does not vanish with the pressure; valid, but not homogeneous."""

    def project(self, trial: Array) -> Array:
        pressure = np.minimum(trial[:, 2], 0.0)
        more = np.where(pressure < 0.0, pressure - 1.0, 0.0)
        traction = RIGHT.project(np.column_stack([trial[:, :2], more]))
        traction[:, 2] = pressure
        return traction


class EqualToNone(WrongLaw):
    """A law that is not equal to another one with the same parameters."""

    def __eq__(self, other: object) -> bool:
        return self is other

    __hash__ = object.__hash__


EXPANSIVE = "project is expansive in the metric of tangential_scaling"


def name(value: object) -> str:
    return value if isinstance(value, str) else type(value).__name__


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (SlipSign(), "project is not idempotent"),
        (Scaled(-1.0), "tangential_scaling has eigenvalues outside"),
        (Scaled(3.0), "tangential_scaling has eigenvalues outside"),
        (Scaled(skew=0.1), "tangential_scaling is not symmetric"),
        (Mixed(SWAPPED, RIGHT), EXPANSIVE),
        (Mixed(RIGHT, UNTURNED), EXPANSIVE),
        (RADIAL_WITH_UNIT_STEP, EXPANSIVE),
        (ALMOST_ISOTROPIC_WITH_UNIT_STEP, EXPANSIVE),
        (EuclideanProjection(), EXPANSIVE),
        (StalePressure(), "project depends on earlier calls"),
        (LimitOfTheTrial(), "project is not idempotent"),
        (FrictionOfTension(), "traction where the trial is open"),
        (Adhesive(), "normal traction pulls"),
        (Shrinking(), "project is not idempotent"),
        (Coupled(), "project depends on other nodes"),
        (Driven(), "slip gains energy"),
        (Swirling(), "traction under slip depends on the step"),
        (NotANumber(), "project gives tractions that are not finite"),
        (FrictionWithoutIndenter(), "traction where there is no indenter above"),
        (ChangesItsArgument(), "project changes its argument"),
        (ReusesItsArray(), "project changes what it gave before"),
        (TangentWithoutPressure(), "tangent is not the derivative"),
        (TangentOfStick(), "tangent is not the derivative"),
        (TangentTransposed(), "tangent is not the derivative"),
        (EqualToNone(), "is not equal to its copy"),
    ],
    ids=name,
)
def test_wrong_laws_are_detected(law: ContactLaw, message: str) -> None:
    with pytest.raises(AssertionError, match=message):
        check_contact_law(law)


@pytest.mark.full
def test_optional_properties_are_separate_checks() -> None:
    for law in (SWAPPED, TURNED_BACK, UNTURNED, WithAThreshold()):
        check_contact_law(law)
        check_associated(law)
    with pytest.raises(AssertionError, match="friction limit along the first axis"):
        check_orthotropic(SWAPPED, (0.1, 0.6), 0.3)
    for law in (TURNED_BACK, UNTURNED):
        with pytest.raises(AssertionError, match="not symmetric about its principal axes"):
            check_orthotropic(law, (0.1, 0.6), 0.3)
    with pytest.raises(AssertionError, match="project is not homogeneous"):
        check_homogeneous(WithAThreshold())
    with pytest.raises(AssertionError, match="friction depends on the direction"):
        check_isotropic(RIGHT)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("law", [RADIAL_WITH_UNIT_STEP, EuclideanProjection(), Swirling(), SlipSign()], ids=name)
def test_non_associated_rules_are_detected(law: ContactLaw) -> None:
    with pytest.raises(AssertionError, match=r"slip does not dissipate the most|does not become stationary"):
        check_associated(law)


def test_correct_law_passes() -> None:
    law = WrongLaw()
    check_contact_law(law)
    check_homogeneous(law)
    check_associated(law)
    check_orthotropic(law, (0.1, 0.6), 0.3)
