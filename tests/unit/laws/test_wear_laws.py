"""Wear laws conform, wrong ones are detected, and contact laws of worn surfaces satisfy both laws."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import pytest
from meeframe_laws.evolving import SlipWeakening

from meeframe.fields import Array
from meeframe.laws import Archard, IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw, for_increment
from meeframe.laws.wear import WearingContact, WearLaw
from meeframe.testing import check_wear_law
from meeframe.testing.contact import check_contact_law

RANDOM = np.random.default_rng(5)


@pytest.mark.parametrize("coefficient", [0.0, 1e-16, 1e-9])
def test_archard(coefficient: float) -> None:
    check_wear_law(Archard(coefficient))
    rate = Archard(coefficient).rate(np.array([0.0, 1e6, 3e8]), np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(rate, [0.0, 1e6 * coefficient, 3e8 * coefficient], rtol=1e-15)


@dataclass(frozen=True)
class WrongWear(WearLaw):
    """Archard's law with a single error."""

    fault: str
    seen: list[None] = field(default_factory=list, compare=False)
    needs_duration: ClassVar[bool] = False

    def rate(self, pressure: Array, speed: Array, worn: Array) -> Array:
        rate = 1e-13 * pressure
        self.seen.append(None)
        match self.fault:
            case "negative":
                return -rate
            case "nan":
                return np.where(pressure > 1e7, np.nan, rate)
            case "offset":
                return rate + 1e-9
            case "jump":
                return np.where(pressure > 1e6, 2.0 * rate, rate)
            case "falls":
                return 1e-7 * pressure * np.exp(-pressure / 1e6)
            case "nonlocal":
                return 1e-13 * pressure * np.sort(pressure)[::-1] / pressure.max()
            case "speed":
                return rate * (1.0 + speed)
            case "changes":
                pressure *= 2.0
            case "remembers":
                return rate * len(self.seen)
            case "shape":
                return rate[:, None]
        return rate


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("negative", "wear rate is negative"),
        ("nan", "wear rate is not finite"),
        ("offset", "wear rate is positive without pressure"),
        ("jump", "wear rate jumps under pressure"),
        ("falls", "wear rate falls while the pressure grows"),
        ("nonlocal", "wear rate depends on other nodes"),
        ("speed", "wear rate depends on the speed"),
        ("changes", "wear rate changes its argument"),
        ("remembers", "wear rate depends on earlier calls"),
        ("shape", "wear rate has another shape than the pressure"),
    ],
)
def test_wrong_wear_laws_are_detected(fault: str, message: str) -> None:
    check_wear_law(WrongWear("none"))
    with pytest.raises(AssertionError, match=message):
        check_wear_law(WrongWear(fault))


@dataclass(frozen=True)
class Threshold(WearLaw):
    """A rate that grows with a power of the pressure above a threshold."""

    exponent: float

    def rate(self, pressure: Array, speed: Array, worn: Array) -> Array:
        return 1e-4 * np.maximum(pressure / 1e6 - 0.5, 0.0) ** self.exponent / (1.0 + worn / 1e-6)


@pytest.mark.parametrize("law", [Archard(1e-11), Threshold(0.5), Threshold(1.0), Threshold(3.0)], ids=str)
@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_worn_surfaces_overlap_by_the_worn_depth(law: WearLaw, friction: float) -> None:
    """Tractions of resolve satisfy p + r depth(p) = trial for all r, and the friction limit of this pressure."""
    base = IsotropicCoulomb(friction) if friction else Signorini()
    n, worn = 300, RANDOM.uniform(0.0, 1e-6, 300)
    trial = RANDOM.normal(size=(n, 3)) * 10.0 ** RANDOM.uniform(3.0, 9.0, (n, 1))
    gap = RANDOM.normal(size=(n, 3)) * 1e-6
    trial[:3, 2], trial[3] = np.inf, 0.0
    for r in ((1e12, 1e12), (1e14, 1e10)):
        contact = WearingContact(base, law, worn, None, None)
        traction = contact.resolve(trial, gap, r)
        pressure, slip = -traction[:, 2], np.hypot(gap[:, 0], gap[:, 1])
        highest = np.maximum(-trial[:, 2], 0.0)
        depth = slip * law.rate(pressure, np.zeros(n), worn)
        np.testing.assert_allclose(pressure + r[0] * depth, highest, rtol=1e-12, atol=1e-12)
        limited = base.project(np.column_stack([trial[:, :2], np.where(highest > 0.0, -pressure, 0.0)]))
        np.testing.assert_array_equal(traction[:, :2], limited[:, :2])


@pytest.mark.full
@pytest.mark.parametrize("sliding", [pytest.param(0.0, marks=pytest.mark.full), 0.3])
def test_contact_law_of_worn_surfaces_conforms(sliding: float) -> None:
    """With a prescribed distance it has the properties of a compliant law, as its gap follows from its traction."""
    for base in (Signorini(), IsotropicCoulomb(0.3)):
        check_contact_law(WearingContact(base, Archard(1e-12), np.zeros(1), sliding, None))


@dataclass(frozen=True)
class Fast(WearLaw):
    """A rate that grows with the speed, and ever less with the pressure."""

    needs_duration: ClassVar[bool] = True

    def rate(self, pressure: Array, speed: Array, worn: Array) -> Array:
        return 1e-3 * np.tanh(pressure / 1e7) * speed**0.7 / (1.0 + worn / 1e-6)


BASES = [
    Signorini(),
    IsotropicCoulomb(0.4),
    IsotropicCoulomb(np.inf),
    OrthotropicCoulomb(0.2, 0.6, 0.3),
    SlipWeakening(0.6, 0.2, 3e-6),
]


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("law", [Archard(1e-11), Threshold(1.0), Threshold(3.0), Fast()], ids=str)
@pytest.mark.parametrize("base", BASES, ids=str)
def test_tangents_are_those_of_the_base_by_the_chain_rule(base: ContactLaw, law: WearLaw) -> None:
    """They agree with central differences of `resolve`, by the trial and by the gap, also without slip or pressure."""
    n, random = 300, np.random.default_rng(7)
    trial = random.normal(size=(n, 3)) * 10.0 ** random.uniform(4.0, 8.0, (n, 1))
    gap = random.normal(size=(n, 3)) * 10.0 ** random.uniform(-8.0, -5.0, (n, 1))
    gap[::5, :2], trial[:3, 2], gap[:3, 2] = 0.0, np.inf, np.inf
    law_of_increment = for_increment(base, np.zeros(n), None)
    for sliding in (None, 1e-5):
        contact = WearingContact(law_of_increment, law, random.uniform(0.0, 1e-6, n), sliding, 0.1)
        for r in ((1e12, 1e12), (1e14, 1e10)):
            differences = ContactLaw.tangents(contact, trial, gap, r)
            for exact, expected, unit in zip(contact.tangents(trial, gap, r), differences, (1.0, max(r)), strict=True):
                size = np.maximum(np.abs(expected).max(axis=(1, 2)), unit)
                np.testing.assert_allclose(exact / size[:, None, None], expected / size[:, None, None], atol=1e-4)
