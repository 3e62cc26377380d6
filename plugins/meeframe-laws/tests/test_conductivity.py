"""Test all conductivity laws: conformance, computed values, limiting cases, case tables, Newton's method and gradient
steps."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meeframe_laws.conductivity import RECORDS, AcrossGap, Breakdown, PowerLaw, Robin, Saturating, Thresholded

from meeframe import load_case
from meeframe.common.errors import CaseError
from meeframe.contact.conduction import potential_diagonal
from meeframe.contact.problem import Status
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import contact_conductivity
from meeframe.material import library_material
from meeframe.plugin.registry import Kind, load
from meeframe.solvers import BarzilaiBorwein, SemismoothNewton, Uzawa, solve
from meeframe.system.two_body import combine_bodies
from meeframe.testing.contact import check_conductivity_law, check_growing_flux
from meeframe.testing.contact_cases import SphereCase, periodic_half_space
from meeframe.testing.force_control import TIGHT_CRITERIA, balanced_solution, check_same, released

AIR = 8.8541878128e-12
LAWS = [
    PowerLaw(2e-3, 1e6),
    PowerLaw(2e-3, 1e6, 0.2),
    Saturating(2e-3, 1e6),
    Thresholded(2e-3, 1e6, 1e4),
    Thresholded(2e-3, 0.0, 1e5),
    AcrossGap(AIR),
    AcrossGap(AIR, 1e-3, 1e-7),
    AcrossGap(0.0, 1.0),
    Breakdown(AIR, 3e6, 1e-3),
    Breakdown(AIR, 3e8, 1.0, 0.0, 1e-7),
    Breakdown(AIR, 3e6, 0.0, 1.0, 1e-7),
    Robin(0.0),
    Robin(2e-3),
    Robin(math.inf),
]
PRESSURE, GAP = 3e7, 5e-6
"""Under the sphere and beside it."""


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("law", LAWS, ids=str)
def test_conformance(law) -> None:
    check_conductivity_law(law)
    check_growing_flux(law)


def test_values_under_pressure() -> None:
    traction = np.array([0.0, -1e6, -2e6, -5e6])
    assert contact_conductivity(PowerLaw(3.0, 2e6, 2.0), traction) == pytest.approx([0.0, 0.75, 3.0, 18.75])
    area_fraction = [0.0, 1.0 - math.exp(-0.5), 1.0 - math.exp(-1.0), 1.0 - math.exp(-2.5)]
    assert contact_conductivity(Saturating(1.0, 2e6), traction) == pytest.approx(area_fraction, rel=1e-14)
    assert contact_conductivity(Thresholded(4.0, 1e6, 2e6), traction) == pytest.approx([0.0, 0.0, 2.0, 4.0])
    assert contact_conductivity(Robin(4.0), traction).tolist() == [4.0] * 4


def test_values_across_the_gap() -> None:
    separated, pressed = np.zeros(3), np.full(3, -1.0)
    gap, drop = np.array([0.0, 1e-6, 3e-6]), np.array([2.0, 20.0, -20.0])
    law = AcrossGap(AIR, 7.0, 1e-6)
    assert law.conductivity(separated, gap, drop) == pytest.approx([AIR / 1e-6, AIR / 2e-6, AIR / 4e-6], rel=1e-14)
    assert law.conductivity(pressed, 0.0 * gap, drop) == pytest.approx(7.0 + AIR / 1e-6, rel=1e-14)
    assert AcrossGap(AIR).conductivity(separated, gap, drop)[0] == math.inf
    # at 4 V/um the gaps withstand 4, 8 and 16 V; the excess adds 1 mF/m^2
    sparking = Breakdown(AIR, 4e6, 1e-3, 7.0, 1e-6)
    flux = np.array([2.0 * AIR / 1e-6, 20.0 * AIR / 2e-6 + 12e-3, -(20.0 * AIR / 4e-6 + 4e-3)])
    assert sparking.conductivity(separated, gap, drop) * drop == pytest.approx(flux, rel=1e-14)
    assert sparking.conductivity(pressed[:1], gap[:1], drop[:1]) == pytest.approx(7.0 + AIR / 1e-6, rel=1e-14)


@settings(deadline=None, max_examples=100)
@given(gap=st.floats(0.0, 1e-3), drop=st.floats(-1e5, 1e5), pressed=st.booleans(), discharge=st.floats(0.0, 1e3))
def test_breakdown_never_conducts_less_than_the_gap(gap, drop, pressed, discharge) -> None:
    """Discharge acts in parallel with the capacitor; without discharge the two laws are bitwise identical."""
    state = (np.array([-1.0 if pressed else 0.0]), np.array([0.0 if pressed else gap]), np.array([drop]))
    for residual_gap, contact in ((0.0, math.inf), (1e-7, 1e-3)):
        across = AcrossGap(AIR, contact, residual_gap).conductivity(*state)
        assert Breakdown(AIR, 3e6, discharge, contact, residual_gap).conductivity(*state) >= across
        assert Breakdown(AIR, 3e6, 0.0, contact, residual_gap).conductivity(*state) == across


def make_problem(electric, magnetic=None, law=None, cells: int = 8):
    """Return a problem of a sphere at 20 kV and -15 A that is pressed on an orthotropic medium and dragged."""
    medium = library_material("orthotropic-mee")
    insulating = Insulating()
    drawn = SphereCase(
        medium, law or Signorini(), electric, magnetic or insulating, cells, 0.4, potentials=(2e4, -15.0)
    )
    return drawn.problem()


OWN = potential_diagonal(make_problem(Insulating()))[0]


def solve_problem(problem, solver=None, start=None):
    solution = solve(problem, solver or SemismoothNewton(), TIGHT_CRITERIA, start)
    assert solution.status is Status.CONVERGED, solution.message
    return solution.state


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("kappa", [1.0, 30.0])
@pytest.mark.parametrize(
    "make",
    [
        lambda kappa: Saturating(kappa, 1e-3),
        lambda kappa: Thresholded(kappa, 0.0, 1e-3),
        lambda kappa: PowerLaw(kappa, PRESSURE, 1e-14),
        lambda kappa: AcrossGap(0.0, kappa),
        lambda kappa: Breakdown(0.0, 1e6, 0.0, kappa),
    ],
    ids=["saturating", "thresholded", "power-law", "across-gap", "breakdown"],
)
def test_limits_equal_the_step_law(make, kappa) -> None:
    """Steep laws under pressure, and without conduction across the gap, tend to `step`."""
    step = solve_problem(make_problem(StepConductivity(kappa / OWN[0])))
    limit = solve_problem(make_problem(make(kappa / OWN[0])), start=replace(step, load=1.001 * step.load))
    np.testing.assert_allclose(limit.load, step.load, atol=1e-9 * np.abs(step.load).max(axis=0).max())
    check_same(limit, step)


def test_limits_across_the_gap() -> None:
    """Laws agree without breakdown, with a residual gap so wide that the gap does not matter, and
    without conduction."""
    constant = 0.3 * GAP / OWN[0]
    across = solve_problem(make_problem(AcrossGap(constant, 1.0, 1e-7)))
    check_same(solve_problem(make_problem(Breakdown(constant, 1e30, 1.0, 1.0, 1e-7))), across)
    layer = solve_problem(make_problem(Robin(0.3 / OWN[0])))
    check_same(solve_problem(make_problem(AcrossGap(0.3e9 / OWN[0], 0.0, 1e9))), layer)
    check_same(solve_problem(make_problem(Robin(0.0))), solve_problem(make_problem(Insulating())))


def laws_of(strength: float):
    """Return (electric, magnetic) pairs of laws whose strength is relative to the nodal compliance."""
    e, m = strength / OWN
    return {
        "power-law": (PowerLaw(e, PRESSURE), PowerLaw(m, PRESSURE)),
        "saturating": (Saturating(e, PRESSURE), Saturating(m, 0.1 * PRESSURE)),
        "thresholded": (Thresholded(e, 0.3 * PRESSURE, 0.1 * PRESSURE), Thresholded(m, 0.1 * PRESSURE, 0.3 * PRESSURE)),
        "across-gap": (AcrossGap(e * GAP), AcrossGap(m * GAP, 0.0, 1e-7)),
        "breakdown": (Breakdown(0.01 * e * GAP, 1e8, e), Breakdown(0.01 * m * GAP, 1e5, m, 0.0, 1e-7)),
        "robin": (Robin(e), Robin(m)),
    }


NAMES = list(laws_of(1.0))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("friction", "strength"), [(Signorini(), 1.0), (IsotropicCoulomb(0.4), 100.0)], ids=str)
@pytest.mark.parametrize("name", NAMES)
def test_solvers_agree(name, friction, strength) -> None:
    """Newton's method and gradient steps agree under EMCI with prescribed potentials.

    Where a strong film breaks, the flux attracts or repels the surfaces and there are several solutions; all solvers
    must then find the nearest one.
    """
    problem = make_problem(*laws_of(strength)[name], friction)
    newton = solve_problem(problem)
    several = name == "thresholded" and strength > 1.0
    start = replace(newton, load=1.0001 * newton.load) if several else None
    for solver in (BarzilaiBorwein(), *([Uzawa()] if strength == 1.0 else [])):
        check_same(solve_problem(problem, solver, start), newton)
    flux = newton.load[:, 3:]
    drop = problem.potentials[0] + newton.displacement[:, 3:]
    assert (flux * -drop >= -1e-9 * np.abs(flux * drop).max()).all()  # conduction dissipates


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("strength", [1e4, 1e6])
@pytest.mark.parametrize("friction", [Signorini(), IsotropicCoulomb(0.4)], ids=str)
def test_solvers_agree_with_strongly_limited_field(friction, strength) -> None:
    """The flux determines the drop only to 1 / strength, so solvers compute both together at each node."""
    problem = make_problem(*laws_of(strength)["breakdown"], friction)
    newton = solve_problem(problem)
    check_same(solve_problem(problem, BarzilaiBorwein()), newton)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("name", NAMES)
def test_prescribed_force_and_floating_conductor(name) -> None:
    """Prescribing the force and the charge of a solution recovers its approach and its potentials, from a distant
    start."""
    problem = make_problem(*laws_of(3.0)[name], IsotropicCoulomb(0.4))
    held = solve_problem(problem)
    free, motion = released(problem, held, "approach", "potentials")
    for solver in (SemismoothNewton(), BarzilaiBorwein()):
        solution = balanced_solution(free, solver)
        check_same(solution.state, held)
        np.testing.assert_allclose(solution.state.motion, motion, rtol=1e-7)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("name", ["across-gap", "breakdown"])
def test_two_bodies_and_exchanged_roles(name) -> None:
    """After an exchange of the bodies, charges and fluxes change sign and pressures are unchanged."""
    media = [library_material(material) for material in ("orthotropic-mee", "batio3-cofe2o4")]
    single = make_problem(*laws_of(1.0)[name])
    side = np.sqrt(single.system.weights.sum())
    first, second = (periodic_half_space(medium, side, 8) for medium in media)
    states = []
    for system, sign in ((combine_bodies(first, second), 1.0), (combine_bodies(second, first), -1.0)):
        x, y = system.points[:, :2].T
        problem = replace(
            single,
            system=system,
            gap=(x**2 + y**2) / 0.2 - 5e-5,
            translation=np.zeros((len(x), 2)),
            potentials=sign * single.potentials,
        )
        newton = solve_problem(problem)
        check_same(solve_problem(problem, BarzilaiBorwein()), newton)
        states.append((newton.load[:, 2].sum(), *(sign * newton.load[:, 3:].sum(axis=0))))
    np.testing.assert_allclose(states[1], states[0], rtol=1e-9)


def test_registration_and_tables() -> None:
    create = load().create
    names = {entry.record.name for entry in load().entries if entry.provider.name == "meeframe-laws"}
    assert {record.name for record in RECORDS} <= names
    gap = {"name": "across-gap", "gap_constant": "1 vacuum_permittivity", "residual_gap": "0.2 um"}
    law = create(Kind.CONDUCTIVITY_LAW, gap)
    assert (law.gap_constant, law.contact_conductivity, law.residual_gap) == pytest.approx((AIR, math.inf, 2e-7))
    magnetic = {**gap, "gap_constant": "1 vacuum_permeability", "contact_conductivity": "3 H/m^2"}
    assert create(Kind.CONDUCTIVITY_LAW, magnetic).gap_constant == pytest.approx(4e-7 * math.pi)
    film = {"name": "thresholded", "contact_conductivity": "2 mF/m^2", "threshold": "1 MPa", "ramp": "10 kPa"}
    assert create(Kind.CONDUCTIVITY_LAW, film) == Thresholded(2e-3, 1e6, 1e4)
    sparks = {**gap, "name": "breakdown", "breakdown_field": "3 MV/m", "breakdown_conductivity": "1 mF/m^2"}
    assert create(Kind.CONDUCTIVITY_LAW, sparks).breakdown_field == 3e6
    assert create(Kind.CONDUCTIVITY_LAW, {"name": "robin", "kappa": math.inf}) == Robin(math.inf)
    table = {"name": "saturating", "largest_conductivity": "1 mF/m^2", "saturation_pressure": "2 GPa"}
    assert create(Kind.CONDUCTIVITY_LAW, table) == Saturating(1e-3, 2e9)


@pytest.mark.parametrize(
    ("factory", "good", "key", "value"),
    [
        (Saturating, (1.0, 1.0), "largest_conductivity", math.inf),
        (Saturating, (1.0, 1.0), "saturation_pressure", 0.0),
        (Thresholded, (1.0, 1.0, 1.0), "contact_conductivity", -1.0),
        (Thresholded, (1.0, 1.0, 1.0), "threshold", -1.0),
        (Thresholded, (1.0, 1.0, 1.0), "ramp", 0.0),
        (AcrossGap, (1.0,), "gap_constant", math.inf),
        (AcrossGap, (1.0,), "contact_conductivity", -1.0),
        (AcrossGap, (1.0,), "residual_gap", math.nan),
        (Breakdown, (1.0, 1.0, 1.0), "breakdown_field", 0.0),
        (Breakdown, (1.0, 1.0, 1.0), "breakdown_conductivity", math.inf),
        (Robin, (1.0,), "kappa", -1.0),
    ],
)
def test_invalid_values_name_their_key(factory, good, key, value) -> None:
    with pytest.raises(CaseError, match=key):
        replace(factory(*good), **{key: value})
    record = next(record for record in RECORDS if record.factory is factory)
    names = list(factory.__dataclass_fields__)
    table = {"name": record.name, **dict(zip(names, good, strict=False)), key: value}
    with pytest.raises(CaseError, match=key):
        load().create(Kind.CONDUCTIVITY_LAW, table)


@pytest.mark.parametrize(
    ("factory", "others"), [(AcrossGap, {}), (Breakdown, {"breakdown_field": 3e6, "breakdown_conductivity": 1e-3})]
)
def test_contact_conductivity_without_residual_gap_is_rejected(factory, others) -> None:
    """A closing gap conducts perfectly, whatever the contact spots add; only without a gap constant do the spots
    matter."""
    for kappa in (0.0, 1.0):
        with pytest.raises(CaseError, match=r"contact_conductivity = .* residual_gap = 0 .* allowed: residual_gap > 0"):
            factory(AIR, **others, contact_conductivity=kappa)
    record = next(record for record in RECORDS if record.factory is factory)
    table = {"name": record.name, "gap_constant": AIR, **others, "contact_conductivity": 1.0}
    with pytest.raises(CaseError, match="residual_gap > 0"):
        load().create(Kind.CONDUCTIVITY_LAW, table)
    pressed = (np.array([-1.0]), np.zeros(1), np.ones(1))
    assert load().create(Kind.CONDUCTIVITY_LAW, {**table, "residual_gap": 1e-6}).conductivity(*pressed) > 1.0
    assert load().create(Kind.CONDUCTIVITY_LAW, {**table, "gap_constant": 0.0}).conductivity(*pressed) >= 1.0
    assert factory(AIR, **others).conductivity(*pressed) == math.inf


CASES = Path(__file__).parents[1] / "cases"


def test_unit_of_the_other_field_is_rejected(tmp_path) -> None:
    text = (CASES / "across-gap.toml").read_text()
    for own, other in (("1 vacuum_permittivity", "1 vacuum_permeability"), ("20 H/m^2", "20 F/m^2")):
        path = tmp_path / "case.toml"
        path.write_text(text.replace(own, other))
        with pytest.raises(CaseError, match="has the wrong unit"):
            load_case(path)
