"""Test all friction laws: conformance, Newton's method and gradient steps, prescribed forces, case tables."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_laws.directional import NonAssociatedCoulomb, SuperellipticCoulomb
from meeframe_laws.evolving import RateAndPressure, SlipWeakening
from meeframe_laws.friction import RECORDS, CappedCoulomb, RegularisedCoulomb, Tresca

from meeframe.common.errors import CaseError
from meeframe.contact.problem import Status, resultant
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import for_increment, resolve
from meeframe.material import library_material
from meeframe.plugin.registry import Kind, load
from meeframe.solvers import SemismoothNewton, solve
from meeframe.solvers.gradient.accelerated import BarzilaiBorwein
from meeframe.testing.contact import (
    check_associated,
    check_contact_law,
    check_homogeneous,
    check_isotropic,
    check_monotone,
    check_orthotropic,
)
from meeframe.testing.contact_cases import SphereCase
from meeframe.testing.force_control import TIGHT_CRITERIA, balanced_solution, check_same, released

# for pressures near 1 MPa, as in the kit
LAWS = {
    "tresca": Tresca(3e5),
    "capped-coulomb": CappedCoulomb(0.4, 3e5),
    "regularised-coulomb": RegularisedCoulomb(0.4, 1e-6),
    "slip-weakening": SlipWeakening(0.5, 0.2, 4e-5),
    "rate-and-pressure": RateAndPressure(0.5, 0.2, 1e-5, pressure_exponent=0.8),
    "non-associated-coulomb": NonAssociatedCoulomb(0.6, 0.2, 0.5, 0.3, -0.4),
    "superelliptic-coulomb": SuperellipticCoulomb(0.6, 0.2, 3.0, 0.3),
}
SUPERELLIPTIC = [SuperellipticCoulomb(0.6, 0.2, n, 0.3) for n in (1.0, 1.5, 50.0)]
SPEEDS = [RateAndPressure(0.5, 0.2, 1e-5, d) for d in (0.5, 3.0)]
# for pressures near 2 GPa, as under the sphere
LARGE = {
    **LAWS,
    "tresca": Tresca(3e8),
    "capped-coulomb": CappedCoulomb(0.4, 3e8),
    "rate-and-pressure": RateAndPressure(0.5, 0.2, 1e-5, 1.0, 1e9, 0.8),
}


def sphere(law, cells=10):
    """Return a problem of a sphere dragged over a fully coupled anisotropic medium within 1 s."""
    medium = library_material("batio3-cofe2o4")
    here = for_increment(law, np.zeros(cells**2), 1.0)
    return SphereCase(medium, here, Insulating(), StepConductivity(np.inf), cells).problem()


def solve_problem(problem, solver):
    solution = solve(problem, solver, TIGHT_CRITERIA)
    assert solution.status is Status.CONVERGED, solution.message
    return solution.state


def test_all_laws_are_registered_under_their_names():
    assert {record.name: record.factory for record in RECORDS} == {name: type(law) for name, law in LAWS.items()}
    registered = {entry.record.name for entry in load().entries if entry.provider.name == "meeframe-laws"}
    assert set(LAWS) <= registered


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("law", LAWS.values(), ids=repr)
def test_kit(law):
    check_contact_law(law, pressure=1e6, gap=1e-5)


@pytest.mark.full
@pytest.mark.parametrize("law", [*SUPERELLIPTIC, *SPEEDS], ids=repr)
def test_kit_at_other_exponents(law):
    check_contact_law(law, pressure=1e6, gap=1e-5)


@pytest.mark.parametrize("name", ["tresca", "capped-coulomb", "regularised-coulomb", "slip-weakening"])
def test_isotropic(name):
    check_isotropic(LAWS[name])


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("law", [Tresca(3e5), CappedCoulomb(0.4, 3e5), *SUPERELLIPTIC], ids=repr)
def test_associated(law):
    check_associated(law)


@pytest.mark.parametrize("law", [LAWS["regularised-coulomb"], *SUPERELLIPTIC], ids=repr)
def test_monotone(law):
    check_monotone(law, gap=1e-5)


def test_non_associated_is_not_monotone():
    with pytest.raises(AssertionError, match="not monotone"):
        check_monotone(LAWS["non-associated-coulomb"], gap=1e-5)


@pytest.mark.parametrize("law", SUPERELLIPTIC, ids=repr)
def test_superelliptic_is_homogeneous_and_orthotropic(law):
    check_homogeneous(law)
    check_orthotropic(law, (0.6, 0.2), 0.3)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("name", LARGE)
def test_two_solvers_agree(name):
    problem = sphere(LARGE[name])
    newton, gradient = (solve_problem(problem, solver) for solver in (SemismoothNewton(), BarzilaiBorwein()))
    forces = [resultant(problem.system, state.load)[0] for state in (newton, gradient)]
    assert np.abs(forces[1] - forces[0]).max() <= 1e-8 * np.abs(forces[0]).max()
    slip = (problem.translation - newton.displacement[:, :2])[newton.load[:, 2] < 0.0]
    assert np.linalg.norm(slip, axis=1).max() > 1e-6  # friction reached its limit somewhere
    check_same(gradient, newton)


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("name", LARGE)
def test_prescribed_forces_recover_the_motion(name):
    problem = sphere(LARGE[name], 8)
    # unless the limit is reached at all nodes, where a force does not determine the sliding
    problem = replace(problem, translation=0.3 * problem.translation)
    expected = solve_problem(problem, SemismoothNewton())
    forced, motion = released(problem, expected, "approach", "translation")
    computed = balanced_solution(forced, SemismoothNewton(), TIGHT_CRITERIA).state
    check_same(computed, expected)
    np.testing.assert_allclose(computed.motion, motion, rtol=1e-8)


COULOMB = IsotropicCoulomb(0.4)
SAME_AS = {
    "Tresca without limit": (Tresca(np.inf), IsotropicCoulomb(np.inf)),
    "Tresca without friction": (Tresca(0.0), Signorini()),
    "capped without limit": (CappedCoulomb(0.4, np.inf), COULOMB),
    "capped, sticking": (CappedCoulomb(np.inf, 3e8), Tresca(3e8)),
    "capped by nothing": (CappedCoulomb(np.inf, np.inf), IsotropicCoulomb(np.inf)),
    "regularised without friction": (RegularisedCoulomb(0.0, 1e-6), Signorini()),
    "equal coefficients, slip": (SlipWeakening(0.4, 0.4, 1e-6), COULOMB),
    "no weakening yet": (SlipWeakening(0.4, 0.1, 1e8), COULOMB),
    "equal coefficients, speed": (RateAndPressure(0.4, 0.4, 1e-5), COULOMB),
    "slow": (RateAndPressure(0.4, 0.1, 1e8), COULOMB),
    "fast": (RateAndPressure(0.1, 0.4, 1e-25), COULOMB),
    "associated": (NonAssociatedCoulomb(0.6, 0.2, 1 / 3, 0.3, 0.3), OrthotropicCoulomb(0.6, 0.2, 0.3)),
    "associated, axes swapped": (
        NonAssociatedCoulomb(0.6, 0.2, 3.0, 0.3, 0.3 - np.pi / 2),
        OrthotropicCoulomb(0.6, 0.2, 0.3),
    ),
    "ellipse": (SuperellipticCoulomb(0.6, 0.2, 2.0, 0.3), OrthotropicCoulomb(0.6, 0.2, 0.3)),
}


@pytest.mark.full(except_for=7)
@pytest.mark.parametrize("limit", SAME_AS)
def test_limits_equal_built_in_laws(limit):
    law, other = SAME_AS[limit]
    problem = sphere(law)
    if limit == "fast":  # without slip, static friction applies, so all nodes must slip
        problem = replace(problem, translation=20.0 * problem.translation)
    state = solve_problem(problem, SemismoothNewton())
    expected = solve_problem(replace(problem, contact_law=other), SemismoothNewton())
    difference = np.abs(state.load - expected.load).max(axis=0)
    assert (difference <= 1e-9 * np.abs(expected.load).max(axis=0)).all()


BAD = [
    ("tresca", {"limit": -1.0}, "limit"),
    ("tresca", {"limit": "1 m"}, "limit"),
    ("capped-coulomb", {"mu": 0.3, "limit": float("nan")}, "limit"),
    ("capped-coulomb", {"mu": -0.3, "limit": 1.0}, "mu"),
    ("regularised-coulomb", {"mu": 0.3, "slip_length": 0.0}, "slip_length"),
    ("regularised-coulomb", {"mu": float("inf"), "slip_length": 1e-6}, "mu"),
    ("slip-weakening", {"mu_static": 0.2, "mu_kinetic": 0.3, "slip_distance": 1e-6}, "mu_kinetic = 0.3"),
    ("slip-weakening", {"mu_static": 0.3, "mu_kinetic": 0.2, "slip_distance": -1e-6}, "slip_distance"),
    ("rate-and-pressure", {"mu_static": 0.3, "mu_kinetic": 0.2, "reference_speed": 0.0}, "reference_speed"),
    (
        "rate-and-pressure",
        {"mu_static": 0.3, "mu_kinetic": 0.2, "reference_speed": 1.0, "pressure_exponent": 1.2},
        "pressure_exponent",
    ),
    ("non-associated-coulomb", {"mu1": 0.3, "mu2": 0.0}, "mu2"),
    ("non-associated-coulomb", {"mu1": 0.3, "mu2": 0.1, "slip_ratio": -1.0}, "slip_ratio"),
    ("non-associated-coulomb", {"mu1": 0.3, "mu2": 0.1, "slip_ratio": 1e-200}, "slip_ratio .* >= 0.001 and <= 1000"),
    ("non-associated-coulomb", {"mu1": 0.3, "mu2": 0.1, "slip_ratio": 1e200}, "slip_ratio .* >= 0.001 and <= 1000"),
    ("non-associated-coulomb", {"mu1": 0.3, "mu2": 1e-5}, "mu2"),
    ("superelliptic-coulomb", {"mu1": 0.3, "mu2": 0.1, "exponent": 0.9}, "exponent"),
    ("superelliptic-coulomb", {"mu1": 0.3, "mu2": 1e-5, "exponent": 2.0}, "mu2"),
]


@pytest.mark.parametrize(("name", "keys", "shown"), BAD)
def test_invalid_values_are_rejected(name, keys, shown):
    with pytest.raises(CaseError, match=shown):
        load().create(Kind.CONTACT_LAW, {"name": name, **keys})
    factory = type(LAWS[name])
    with pytest.raises(CaseError, match=shown):
        factory(**keys)


def test_case_tables_take_units():
    law = load().create(
        Kind.CONTACT_LAW,
        {"name": "slip-weakening", "mu_static": 0.6, "mu_kinetic": 0.3, "slip_distance": "2 um"},
    )
    assert law == SlipWeakening(0.6, 0.3, 2e-6)
    law = load().create(Kind.CONTACT_LAW, {"name": "capped-coulomb", "mu": 0.6, "limit": "0.2 GPa"})
    assert law == CappedCoulomb(0.6, 2e8)


# extreme, but within bounds: the limit is a law with a name
EXTREME = {
    "no slip length": (RegularisedCoulomb(0.4, 1e-60), COULOMB),
    "endless slip length": (RegularisedCoulomb(0.4, 1e60), Signorini()),
    "no slip distance": (SlipWeakening(0.4, 0.4, 1e-60), COULOMB),
    "no reference speed": (RateAndPressure(0.4, 0.4, 1e-60, 3.0), COULOMB),
    "no reference pressure": (RateAndPressure(0.4, 0.4, 1.0, 1.0, 1e-60), COULOMB),
    "most distorted": (
        NonAssociatedCoulomb(0.6, 0.0006, 0.001, 0.3, 0.3),
        OrthotropicCoulomb(0.6, 0.0006, 0.3),
    ),
}


@pytest.mark.parametrize("limit", EXTREME)
def test_extreme_values_do_not_overflow(limit):
    law, other = EXTREME[limit]
    p = 1e6 * np.logspace(-3.0, 3.0, 7)
    trial = np.column_stack([2.0 * p, -p[::-1], -p])
    gap = 1e-5 * np.column_stack([np.linspace(0.0, 2.0, 7), np.ones(7), np.zeros(7)])
    r = (1e11, 1e11)
    computed = resolve(for_increment(law, np.linspace(0.0, 1e-3, 7), 1e-3), trial, gap, r)
    difference = np.abs(computed - resolve(other, trial, gap, r)).max(axis=1)
    assert (difference <= 1e-12 * np.abs(trial).max(axis=1)).all()
