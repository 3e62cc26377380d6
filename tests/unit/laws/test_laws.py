"""Built-in laws agree with computed values and with the fixed points of docs/explanation/theory.md, Contact."""

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ContactLaw, contact_conductivity
from meeframe.testing.contact import check_conductivity_law

INF = np.inf


def fixed_point(law: ContactLaw, slip: np.ndarray, pressure: float) -> np.ndarray:
    """Return the tangential traction at the fixed point for a given slip of the indenter relative to the body."""
    traction = np.array([[0.0, 0.0, -pressure]])
    for _ in range(4000):
        traction[:, :2] += 0.5 * slip @ law.tangential_scaling()
        traction = law.project(traction)
    return traction[0, :2]


def test_signorini_computed_values() -> None:
    trial = np.array([[3.0, 4.0, -2.0], [3.0, 4.0, 1.0], [0.0, 0.0, INF], [1.0, 1.0, 0.0]])
    assert np.array_equal(Signorini().project(trial), [[0.0, 0.0, -2.0], [0.0] * 3, [0.0] * 3, [0.0] * 3])


def test_isotropic_friction_computed_values() -> None:
    trial = np.array([[3.0, 4.0, -2.0], [0.3, 0.4, -2.0], [3.0, 4.0, 1.0]])
    expected = [[0.6, 0.8, -2.0], [0.3, 0.4, -2.0], [0.0, 0.0, 0.0]]
    assert IsotropicCoulomb(0.5).project(trial) == pytest.approx(np.array(expected))


def test_orthotropic_slip_follows_the_associated_rule() -> None:
    """Values of docs/explanation/theory.md, Contact; eq. (12): -rho M^2 g / ||g||*."""
    traction = fixed_point(OrthotropicCoulomb(0.1, 0.6), np.array([-1.0, -1.0]), 1.0)
    assert traction == pytest.approx([-0.0164, -0.5918], abs=5e-5)
    rule = -np.array([0.1**2, 0.6**2]) / np.hypot(0.1, 0.6)
    assert traction == pytest.approx(rule, rel=1e-6)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("mu1", "mu2"), [(0.1, 0.6), (0.9, 0.2), (0.3, 0.3)])
def test_euclidean_projection_with_unit_step_has_same_fixed_point(mu1: float, mu2: float) -> None:
    """The other consistent pair of set and metric (docs/explanation/theory.md, Contact) follows by minimisation."""
    slip, rho = np.array([0.7, -0.4]), 2.0
    angles = np.linspace(0.0, 2.0 * np.pi, 2_000_001)
    ellipse = rho * np.array([mu1 * np.cos(angles), mu2 * np.sin(angles)])
    farthest = ellipse[:, np.argmax(slip @ ellipse)]  # the normal cone of the ellipse contains the slip there
    assert fixed_point(OrthotropicCoulomb(mu1, mu2), slip, rho) == pytest.approx(farthest, abs=1e-5)


def test_angle_rotates_the_principal_axes() -> None:
    random = np.random.default_rng(1)
    trial = random.normal(size=(50, 3))
    swapped = OrthotropicCoulomb(0.1, 0.6, np.pi / 2)
    assert swapped.project(trial) == pytest.approx(OrthotropicCoulomb(0.6, 0.1).project(trial))
    assert swapped.tangential_scaling() == pytest.approx(OrthotropicCoulomb(0.6, 0.1).tangential_scaling())
    turn = np.array([[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]])
    rotated = OrthotropicCoulomb(0.1, 0.6, 0.4).project(trial)
    principal = OrthotropicCoulomb(0.1, 0.6).project(np.column_stack([trial[:, :2] @ turn.T, trial[:, 2]]))
    assert rotated[:, :2] @ turn.T == pytest.approx(principal[:, :2])


def test_equal_coefficients_are_isotropic() -> None:
    trial = np.random.default_rng(2).normal(size=(50, 3))
    assert OrthotropicCoulomb(0.4, 0.4, 1.1).project(trial) == pytest.approx(IsotropicCoulomb(0.4).project(trial))


def test_zero_and_infinite_coefficients() -> None:
    trial = np.array([[3.0, 4.0, -2.0], [3.0, 4.0, 1.0]])
    assert np.array_equal(IsotropicCoulomb(0.0).project(trial), Signorini().project(trial))
    assert np.array_equal(IsotropicCoulomb(INF).project(trial), [trial[0], np.zeros(3)])
    assert OrthotropicCoulomb(0.0, 0.5).project(trial)[0] == pytest.approx([0.0, 1.0, -2.0])
    assert OrthotropicCoulomb(INF, 0.5).project(trial)[0] == pytest.approx([3.0, 1.0, -2.0])
    assert not IsotropicCoulomb(0.0).tangential_scaling().any()
    assert OrthotropicCoulomb(INF, 0.5).tangential_scaling() == pytest.approx(np.eye(2))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("kappa", [0.0, 2.5, INF])
def test_step_conductivity(kappa: float) -> None:
    law = StepConductivity(kappa)
    assert np.array_equal(contact_conductivity(law, np.array([-1.0, -1e-300, 0.0])), [kappa, kappa, 0.0])
    check_conductivity_law(law)
    check_conductivity_law(Insulating())
    assert not contact_conductivity(Insulating(), np.array([-1.0, 0.0])).any()


@pytest.mark.parametrize("bad", [-0.1, float("nan")])
def test_invalid_coefficients_are_named(bad: float) -> None:
    for make, name in ((lambda: IsotropicCoulomb(bad), "mu"), (lambda: OrthotropicCoulomb(0.1, bad), "mu2")):
        with pytest.raises(CaseError, match=name):
            make()
    with pytest.raises(CaseError, match="kappa"):
        StepConductivity(bad)
    with pytest.raises(CaseError, match="angle"):
        OrthotropicCoulomb(0.1, 0.2, INF)


@pytest.mark.parametrize(("mu1", "mu2"), [(0.3, 301.0), (1e5, 0.3)])
def test_too_dissimilar_coefficients_are_rejected(mu1, mu2):
    with pytest.raises(CaseError, match="differ by more than a factor of 1000; allowed: less, or 0 or inf"):
        OrthotropicCoulomb(mu1, mu2)


@pytest.mark.parametrize(("mu1", "mu2"), [(0.0, 1e5), (0.3, INF), (0.3, 300.0), (0.0, 0.0)])
def test_zero_infinite_and_equal_coefficients_are_accepted(mu1, mu2):
    assert np.isfinite(OrthotropicCoulomb(mu1, mu2).project(np.array([[1.0, 1.0, -1.0]]))).all()


@pytest.mark.parametrize("beyond", [-1e-6, 1e-6])
def test_differences_do_not_straddle_the_edge_of_the_friction_cone(beyond) -> None:
    """Close to its kink a law without derivatives of its own has those of the side on which the trial lies."""
    law = IsotropicCoulomb(0.3)
    trial = np.array([[0.18, -0.24, -1.0], [-3e5, 0.0, -1e6]]) * [1.0 + beyond, 1.0 + beyond, 1.0]
    np.testing.assert_allclose(ContactLaw.tangent(law, trial), law.tangent(trial), atol=1e-6)
