"""Contact with limited pressure: its symmetry, the plastic limit of the area, hard contact, and all solvers."""

import numpy as np
import pytest
from meeframe_laws.interface import Hardness

import meeframe
from meeframe.laws.base import ContactLaw
from meeframe.testing.contact import check_associated, check_monotone

YOUNG, POISSON, PERIOD, N = 200e9, 0.3, 1e-3, 32
MODULUS = YOUNG / (1 - POISSON**2)
HARDNESS = 0.03 * MODULUS
AXIS = PERIOD * ((np.arange(N) + 0.5) / N - 0.5)


def rough_heights(seed=4):
    """Return heights with waves down to a quarter of the period, rms slope about 0.1, (N, N) [m]."""
    random = np.random.default_rng(seed)
    waves = np.zeros((N, N), complex)
    numbers = np.fft.fftfreq(N, 1 / N)
    size = np.hypot(numbers[:, None], numbers)
    band = (size > 0) & (size <= 4)
    waves[band] = random.standard_normal(band.sum()) + 1j * random.standard_normal(band.sum())
    heights = np.fft.ifft2(waves / np.maximum(size, 1.0) ** 1.8).real
    return heights / heights.std() * 8e-6


def press(heights, mean_pressures, law, solver="auto", periodic=True, approaches=()):
    """Press rigid heights (N, N) [m], peaks towards the body, with mean pressures [Pa], or approaches [m] if given."""
    side = PERIOD if periodic else PERIOD * (N - 1) / N
    forces = [meeframe.Step(normal_force=mean * side**2) for mean in mean_pressures]
    case = meeframe.Case(
        material={"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": POISSON},
        mesh=meeframe.mesh.half_space(PERIOD * (N - 1) / N, divisions=N - 1),
        formulation=meeframe.formulation("half-space", periodic=periodic, density="constant"),
        indenter=meeframe.SampledHeights.on_grid(AXIS, AXIS, -heights),
        contact=law,
        solver=meeframe.solver(solver),
        steps=[meeframe.Step(approach=approach) for approach in approaches] or forces,
    )
    return case.solve()


def pressure(step):
    return -step.traction[:, 2]


def test_conformance():
    """Properties beyond those that test_interface.py checks for all laws."""
    for check in (check_monotone, check_associated):
        check(Hardness(5e5, mu=0.3))


def test_tangents_match_finite_differences():
    law, trial = Hardness(1e6, mu=0.3), 1e6 * np.random.default_rng(1).normal(size=(200, 3))
    smooth = (np.abs(trial[:, 2]) > 1e3) & (np.abs(trial[:, 2] + 1e6) > 1e3)
    np.testing.assert_allclose(law.tangent(trial)[smooth], ContactLaw.tangent(law, trial)[smooth], atol=1e-6)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan])
def test_hardness_must_be_positive(bad):
    with pytest.raises(meeframe.CaseError, match="hardness"):
        Hardness(bad)


def test_exchange_of_open_and_yielded_contact():
    """Turned upside down, with H - p for p, the problem is the same: open nodes become yielded ones."""
    heights, share = rough_heights(), (0.25, 0.75)
    law = Hardness(HARDNESS)
    result = press(heights, [share[0] * HARDNESS], law)
    mirrored = press(-heights, [share[1] * HARDNESS], law)
    assert result.status == mirrored.status == "converged"
    np.testing.assert_allclose(pressure(mirrored[0]), HARDNESS - pressure(result[0]), atol=1e-7 * HARDNESS)
    yielded, opened = (pressure(result[0]) >= HARDNESS).sum(), (pressure(mirrored[0]) <= 0.0).sum()
    assert yielded == opened > 0


def test_area_up_to_full_contact():
    """Every load up to 99 % of the limit converges, and the area tends to F / H as all of the contact yields."""
    shares = np.array([0.05, 0.3, 0.6, 0.9, 0.99])
    for hardness, close in ((HARDNESS, 0.35), (0.02 * HARDNESS, 0.02)):
        result = press(rough_heights(), shares * hardness, Hardness(hardness))
        assert [step.status for step in result] == ["converged"] * 5
        fractions = np.array([(pressure(step) > 0.0).mean() for step in result])
        assert (fractions >= shares).all()
        np.testing.assert_allclose(fractions, shares, rtol=close, atol=2 / N**2)
        for step in result:
            assert pressure(step).max() <= hardness * (1 + 1e-12)
            assert step.gap[pressure(step) >= hardness].max() <= 1e-12


def test_infinite_hardness_is_hard_contact():
    loads = [0.1 * HARDNESS]
    capped, hard = (press(rough_heights(), loads, law)[0] for law in (Hardness(np.inf), meeframe.Signorini()))
    np.testing.assert_allclose(capped.traction, hard.traction, atol=1e-8 * HARDNESS)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", ["newton", "uzawa-bb", "uzawa-nesterov"])
def test_solvers_agree(solver):
    loads, law = [0.4 * HARDNESS], Hardness(HARDNESS)
    result, reference = (press(rough_heights(), loads, law, name)[0] for name in (solver, "auto"))
    assert result.status == "converged"
    np.testing.assert_allclose(pressure(result), pressure(reference), atol=1e-7 * HARDNESS)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("hardness", [HARDNESS, 0.02 * HARDNESS])
def test_conjugate_gradients_agree_with_newton(hardness, periodic):
    """Pressures agree for forces up to 99 % of the largest one, where 99 % of the area yield, and for approaches."""
    law, means = Hardness(hardness), np.array([0.05, 0.5, 0.99]) * hardness
    by_force = [press(rough_heights(), means, law, name, periodic) for name in ("projected-cg", "newton")]
    approaches = [step.loading.approach for step in by_force[1]]
    by_approach = [press(rough_heights(), (), law, name, periodic, approaches) for name in ("projected-cg", "newton")]
    assert (pressure(by_force[0][-1]) >= hardness).mean() >= 0.97
    for gradients, newton in (by_force, by_approach, (by_force[0], by_approach[0])):
        assert gradients.status == newton.status == "converged"
        for step, reference in zip(gradients, newton, strict=True):
            np.testing.assert_allclose(pressure(step), pressure(reference), rtol=0.0, atol=1e-8 * hardness)


def test_projected_cg_refuses_friction():
    with pytest.raises(meeframe.CaseError, match=r"projected-cg.*Hardness"):
        press(rough_heights(), [HARDNESS / 2], Hardness(HARDNESS, mu=0.1), "projected-cg")


def test_forces_beyond_the_hardness_have_no_solution():
    result = press(rough_heights(), [0.5 * HARDNESS, 1.01 * HARDNESS], Hardness(HARDNESS))
    assert [step.status for step in result] == ["converged", "stalled"]
    assert "more than the contact law admits" in result[1].message
