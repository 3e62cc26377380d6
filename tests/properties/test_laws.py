"""Conformance of the built-in laws for any coefficient, and of the conformance check itself: wrong laws are caught."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meeframe.core.contact import ConductivityLaw, ContactLaw
from meeframe.core.fields import Array
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.testing.contact import check_conductivity_law, check_contact_law, check_homogeneous

COEFFICIENTS = st.one_of(st.just(0.0), st.floats(0.02, 5.0), st.just(np.inf))
SETTINGS = settings(max_examples=25, deadline=None)


@SETTINGS
@given(COEFFICIENTS, COEFFICIENTS, st.floats(-7.0, 7.0), st.integers(0, 1000), st.sampled_from([1e-9, 1.0, 1e9]))
def test_orthotropic_friction(mu1: float, mu2: float, angle: float, seed: int, pressure: float) -> None:
    law = OrthotropicCoulomb(mu1, mu2, angle)
    check_contact_law(law, pressure, seed)
    check_homogeneous(law, seed)


@SETTINGS
@given(COEFFICIENTS, st.integers(0, 1000))
def test_isotropic_friction(mu: float, seed: int) -> None:
    for law in (IsotropicCoulomb(mu), Signorini()):
        check_contact_law(law, 1e6, seed)
        check_homogeneous(law, seed)


RIGHT = OrthotropicCoulomb(0.1, 0.6)


@dataclass(frozen=True)
class Mutant(ContactLaw):
    """Orthotropic friction with one thing wrong."""

    fault: str
    right: ContactLaw = RIGHT

    def project(self, trial: Array) -> Array:
        traction = self.right.project(trial)
        match self.fault:
            case "pulls":
                traction[:, 2] = np.maximum(trial[:, 2], 0.0)
            case "friction when open":
                traction[:, :2] = np.where(trial[:, 2:] > 0.0, 0.1 * trial[:, :2], traction[:, :2])
            case "not idempotent":
                traction[:, :2] *= 0.9
            case "nonlocal":
                traction[:, 2] = traction[:, 2].mean()
            case "wrong sign":
                traction[:, :2] *= -1.0
            case "changes its argument":
                trial[:, 2] = traction[:, 2]
            case "swapped coefficients":
                traction = OrthotropicCoulomb(0.6, 0.1).project(trial)
        return traction

    def tangential_scaling(self) -> Array:
        match self.fault:
            case "no metric":
                return np.eye(2)
            case "metric too large":
                return 2.0 * self.right.tangential_scaling()
            case "metric not symmetric":
                return np.array([[0.5, 0.1], [0.0, 0.5]])
        return self.right.tangential_scaling()


@pytest.mark.parametrize(
    "fault",
    [
        "pulls",
        "friction when open",
        "not idempotent",
        "nonlocal",
        "wrong sign",
        "changes its argument",
        "swapped coefficients",
        "no metric",
        "metric too large",
        "metric not symmetric",
    ],
)
def test_wrong_laws_are_caught(fault: str) -> None:
    with pytest.raises(AssertionError):
        check_contact_law(Mutant(fault))


def test_the_mutant_without_fault_passes() -> None:
    check_contact_law(Mutant("none"))


@dataclass(frozen=True)
class MutantConductivity(ConductivityLaw):
    fault: str

    def conductivity(self, normal_traction: Array) -> Array:
        kappa = StepConductivity(1.0).conductivity(normal_traction)
        match self.fault:
            case "negative":
                return -kappa
            case "nan":
                return np.where(kappa > 0.0, np.nan, 0.0)
            case "jump under pressure":
                return np.where(normal_traction < -1e5, 2.0, kappa) * (
                    1.0 + 1e-3 * np.sign(normal_traction % 1.0 - 0.5)
                )
            case "nonlocal":
                return kappa * normal_traction.argmin()
        return kappa


@pytest.mark.parametrize("fault", ["negative", "nan", "jump under pressure", "nonlocal"])
def test_wrong_conductivities_are_caught(fault: str) -> None:
    check_conductivity_law(MutantConductivity("none"))
    with pytest.raises(AssertionError):
        check_conductivity_law(MutantConductivity(fault))


@SETTINGS
@given(st.one_of(st.floats(0.0, 1e300), st.just(np.inf)))
def test_step_conductivity(kappa: float) -> None:
    check_conductivity_law(StepConductivity(kappa))
