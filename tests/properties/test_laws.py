"""Built-in laws conform for all coefficients, and wrong conductivity laws are detected (wrong contact laws:
test_seeded_laws.py)."""

from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ConductivityLaw
from meeframe.testing.contact import (
    check_associated,
    check_conductivity_law,
    check_contact_law,
    check_homogeneous,
    check_isotropic,
    check_orthotropic,
)

FINITE = st.floats(-6.0, 6.0).map(lambda power: 10.0**power)
COEFFICIENTS = st.just(0.0) | FINITE | st.just(np.inf)
RATIOS = st.floats(-2.999, 0.0).map(lambda power: 10.0**power)
"""Of finite coefficients: more unequal ones are not allowed."""
PAIRS = st.builds(lambda mu, ratio: (mu, mu * ratio), FINITE, RATIOS)
PAIRS = (PAIRS | st.tuples(st.sampled_from([0.0, np.inf]), COEFFICIENTS)).flatmap(st.permutations).map(tuple)
SETTINGS = settings(max_examples=15, deadline=None)


@SETTINGS
@given(PAIRS, st.floats(-7.0, 7.0), st.integers(0, 1000), st.sampled_from([1e-9, 1.0, 1e9]))
def test_orthotropic_friction(mu: tuple[float, float], angle: float, seed: int, pressure: float) -> None:
    law = OrthotropicCoulomb(*mu, angle)
    check_contact_law(law, pressure, seed)
    check_homogeneous(law, seed)
    check_associated(law, pressure, seed)
    check_orthotropic(law, mu, angle, pressure, seed)


@pytest.mark.full
@SETTINGS
@given(COEFFICIENTS, st.integers(0, 1000))
def test_isotropic_friction(mu: float, seed: int) -> None:
    for law in (IsotropicCoulomb(mu), Signorini()):
        check_contact_law(law, 1e6, seed)
        check_homogeneous(law, seed)
        check_associated(law, 1e6, seed)
        check_isotropic(law, 1e6, seed)


@dataclass(frozen=True)
class WrongConductivity(ConductivityLaw):
    """A step law with a single error."""

    fault: str
    seen: list[None] = field(default_factory=list, compare=False)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        kappa = StepConductivity(1.0).conductivity(normal_traction, gap, drop)
        match self.fault:
            case "negative":
                return -kappa
            case "nan":
                return np.where(kappa > 0.0, np.nan, 0.0)
            case "jump":
                return np.where(normal_traction < -2e6, 2.0, 1.0) * kappa
            case "infinite":
                return np.where(normal_traction < -2e6, np.inf, 1.0) * np.where(kappa > 0.0, 1.0, 0.5)
            case "nonlocal":
                return kappa * np.argmin(normal_traction)
            case "changes":
                normal_traction *= 2.0
            case "changes drop":
                drop *= 2.0
            case "remembers":
                self.seen.append(None)
                return kappa * len(self.seen)
            case "shape":
                return kappa[:, None]
            case "follows gap":
                return kappa + np.where(gap > 0.0, 1e-6 / (gap + 1e-6), 0.0)
            case "follows drop":
                return kappa * (1.0 + (drop / 1e3) ** 2)
        return kappa


@final
@dataclass(frozen=True)
class WrongAcrossGap(ConductivityLaw):
    """A plate capacitor of unit constant with a single error; lengths in micrometres, potentials in kilovolts."""

    across_gap: ClassVar[bool] = True

    fault: str

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        distance, drop = 1e6 * gap + 0.1, 1e-3 * drop
        kappa = np.where(normal_traction < 0.0, 10.0, 1.0 / distance)
        match self.fault:
            case "nan":
                kappa = np.where(normal_traction < 0.0, 10.0, kappa * np.divide(gap, gap))
            case "sparks":
                kappa = np.where(np.abs(drop) > 3.0 * distance, 10.0 * kappa, kappa)
            case "ends":
                kappa = np.where(distance > 5.0, 0.0, kappa)
            case "touches":
                kappa = np.where((distance < 0.2) & (normal_traction == 0.0), np.inf, kappa)
            case "diode":
                kappa = kappa * (2.0 + drop / (1.0 + np.abs(drop)))
            case "falls":
                kappa = kappa / (1.0 + drop**4)
            case "falls where it conducts little":
                kappa = np.where(normal_traction < 0.0, kappa, kappa / (1.0 + np.abs(drop)) ** 1.1)
        return kappa


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("negative", "conductivity is negative or NaN"),
        ("nan", "conductivity is negative or NaN"),
        ("jump", "conductivity jumps under pressure"),
        ("infinite", "conductivity jumps to infinity under pressure"),
        ("nonlocal", "conductivity depends on other nodes"),
        ("changes", "conductivity changes its argument"),
        ("changes drop", "conductivity changes its argument"),
        ("remembers", "conductivity depends on earlier calls"),
        ("shape", "conductivity has another shape than the traction"),
        ("follows gap", "conductivity changes across the gap, but the law is not across_gap"),
        ("follows drop", "conductivity changes with the drop, but the law is not across_gap"),
    ],
)
def test_wrong_conductivities_are_detected(fault: str, message: str) -> None:
    check_conductivity_law(WrongConductivity("none"))
    with pytest.raises(AssertionError, match=message):
        check_conductivity_law(WrongConductivity(fault))


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("nan", "conductivity is negative or NaN"),
        ("sparks", "conductivity jumps (across the gap|with the drop)"),
        ("ends", "conductivity jumps across the gap"),
        ("touches", "conductivity jumps to infinity across the gap"),
        ("diode", "conductivity depends on the sign of the drop"),
        ("falls", "flux falls while the drop grows"),
        ("falls where it conducts little", "flux falls while the drop grows"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_wrong_conductivities_across_the_gap_are_detected(fault: str, message: str) -> None:
    check_conductivity_law(WrongAcrossGap("none"))
    with pytest.raises(AssertionError, match=message):
        check_conductivity_law(WrongAcrossGap(fault))


def test_a_conductivity_law_may_distinguish_the_bodies() -> None:
    check_conductivity_law(WrongAcrossGap("diode"), rectifies=True)


@SETTINGS
@given(st.one_of(st.floats(0.0, 1e60), st.just(np.inf)))
def test_step_conductivity(kappa: float) -> None:
    check_conductivity_law(StepConductivity(kappa))
