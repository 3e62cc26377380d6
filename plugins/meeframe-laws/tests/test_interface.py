"""Test all interface laws: conformance, registration, tables, agreement of solvers, prescribed
forces, example cases."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from meeframe_laws.interface import DMT, RECORDS, Compliant, DMTCoulomb, Dugdale, Hardness, SignoriniGap

from meeframe.common.errors import CaseError
from meeframe.indenters import Sphere
from meeframe.laws import Insulating, IsotropicCoulomb, StepConductivity
from meeframe.laws.base import ContactLaw
from meeframe.material import library_material
from meeframe.model.kinematics import IndenterKinematics
from meeframe.model.load import load_case
from meeframe.plugin.registry import Kind, load
from meeframe.solvers import Auto, SemismoothNewton, Uzawa
from meeframe.testing.closed_forms_adhesion import quarter_half_space
from meeframe.testing.contact import check_contact_law, check_isotropic
from meeframe.testing.contact_cases import SphereCase
from meeframe.testing.force_control import TIGHT_CRITERIA, balanced_solution, check_same, released
from meeframe.testing.matrix_free import MatrixFree

NAMES = {
    "compliant": Compliant,
    "dmt": DMT,
    "dmt-coulomb": DMTCoulomb,
    "dugdale": Dugdale,
    "hardness": Hardness,
    "signorini-gap": SignoriniGap,
}
# for pressures near 1 MPa and gaps near 10 um
KIT = [
    Compliant(1e6, 1e-6, 2.0, mu=0.3),
    Compliant(1e6, 1e-5, 0.4),
    Compliant(1e6, 1e-5, 1.0, mu=np.inf),
    DMT(1.0, 1e-6, mu=0.3),
    DMTCoulomb(0.3, 5e5),
    Dugdale(1.0, 1e5, mu=np.inf),
    Dugdale(0.0, 1e5),
    Hardness(5e5, mu=0.3),
    SignoriniGap(amplitude=1e-6, wavelength_1=1e-3, mu=0.4),
    SignoriniGap(surface=Sphere(0.1), phase_2=0.3, wavelength_2=2e-3),
]
# for pressures near 1.5 GPa and approaches of 50 um, as under the sphere
LARGE = {
    "compliant": Compliant(1e9, 5e-6, 2.0, mu=0.3),
    "dmt": DMT(100.0, 2e-5, mu=0.3),
    "dmt-coulomb": DMTCoulomb(0.3, 2e8),
    "dugdale": Dugdale(300.0, 3e7, transition=1.0, mu=0.3),
    "hardness": Hardness(8e8, mu=0.3),
    "signorini-gap": SignoriniGap(amplitude=2e-6, wavelength_1=2e-3, wavelength_2=3e-3, mu=0.3),
}


def sphere(law: ContactLaw, cells: int = 10, kappa: float = 0.0):
    """Return a problem of a sphere dragged over a fully coupled medium with the initial gap of the law; `kappa` is
    magnetic [H/m^2]."""
    medium = library_material("orthotropic-mee")
    problem = SphereCase(medium, law, Insulating(), StepConductivity(kappa), cells, 0.3).problem()
    return replace(problem, gap=problem.gap + law.initial_gap(problem.system.points))


def test_registration():
    assert {record.name: record.factory for record in RECORDS} == NAMES
    ours = {entry.record.name for entry in load().entries if entry.provider.name == "meeframe-laws"}
    assert set(NAMES) <= ours


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("law", KIT, ids=repr)
def test_kit(law):
    check_contact_law(law, pressure=1e6, gap=1e-5)
    check_isotropic(law)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("name", LARGE)
def test_solvers_agree(name):
    problem = sphere(LARGE[name])
    solved = balanced_solution(problem, SemismoothNewton()).state
    assert np.abs(solved.load[:, :3]).max() > 0.0
    for solver in (Uzawa(), Auto()):
        check_same(balanced_solution(problem, solver).state, solved)
    hidden = replace(problem, system=MatrixFree.of(problem.system))
    check_same(balanced_solution(hidden, SemismoothNewton()).state, solved)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("name", LARGE)
def test_solvers_agree_with_conduction(name):
    """Flux attracted by contact lifts the surface, which leads to several solutions, so each run starts near one of
    them."""
    problem = sphere(LARGE[name], kappa=np.inf)
    solved = balanced_solution(problem, SemismoothNewton()).state
    assert np.abs(solved.load[:, 4]).max() > 0.0
    near = replace(solved, load=0.999 * solved.load)
    for solver in (SemismoothNewton(), Uzawa()):
        check_same(balanced_solution(problem, solver, start=near).state, solved)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("name", LARGE)
def test_prescribed_forces_recover_the_motion(name):
    given = sphere(LARGE[name], 8)
    state = balanced_solution(given, SemismoothNewton()).state
    problem, motion = released(given, state, "approach", "translation")
    # with attraction there may be other solutions, also without contact
    near = replace(state, load=0.999 * state.load, motion=1.001 * motion)
    # gradient iterations do not converge with attraction at all distances and two free slips
    gradient = () if name == "dmt" else (Uzawa(),)
    for solver in (SemismoothNewton(), Auto(), *gradient):
        computed = balanced_solution(problem, solver, TIGHT_CRITERIA, near).state
        check_same(computed, state)
        np.testing.assert_allclose(computed.motion, motion, rtol=1e-7)


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize(
    "law",
    [DMT(0.0, 1e-6, mu=0.3), Dugdale(0.0, 1e6, mu=0.3), DMTCoulomb(0.3, 0.0), SignoriniGap(mu=0.3)],
    ids=repr,
)
def test_each_law_reduces_to_coulomb(law):
    solver = SemismoothNewton()
    state, coulomb = (balanced_solution(sphere(each), solver).state for each in (law, IsotropicCoulomb(0.3)))
    off = np.abs(state.load - coulomb.load).max(axis=0)
    assert (off <= 1e-9 * np.abs(coulomb.load).max(axis=0)).all()


def test_tables_with_units():
    registry = load()
    table = {"name": "dugdale", "work_of_adhesion": "50 mJ/m^2", "adhesive_stress": "20 MPa", "mu": 0.2}
    assert registry.create(Kind.CONTACT_LAW, table) == Dugdale(0.05, 2e7, mu=0.2)
    table = {"name": "compliant", "reference_pressure": "1 GPa", "reference_closure": "2 um", "exponent": 3}
    assert registry.create(Kind.CONTACT_LAW, table) == Compliant(1e9, 2e-6, 3.0)
    surface = {"name": "sphere", "radius": "1 m"}
    table = {"name": "signorini-gap", "surface": surface, "amplitude": "1 um", "phase_1": "180 deg"}
    made = registry.create(Kind.CONTACT_LAW, table)
    assert made == SignoriniGap(surface=Sphere(1.0), amplitude=1e-6, phase_1=np.pi)


@pytest.mark.parametrize(
    ("name", "good", "key", "bad"),
    [
        ("compliant", {"reference_pressure": 1.0, "reference_closure": 1.0}, "exponent", 0.0),
        ("compliant", {"reference_pressure": 1.0, "reference_closure": 1.0}, "mu", -0.1),
        ("compliant", {"reference_pressure": 1.0}, "reference_closure", 0.0),
        ("dmt", {"work_of_adhesion": 1.0}, "equilibrium_distance", 0.0),
        ("dmt", {"equilibrium_distance": 1.0}, "work_of_adhesion", -1.0),
        ("dmt-coulomb", {"mu": 0.1}, "adhesive_pressure", -1.0),
        ("dmt-coulomb", {"adhesive_pressure": 1.0}, "mu", float("inf")),
        ("dugdale", {"work_of_adhesion": 1.0}, "adhesive_stress", float("inf")),
        ("dugdale", {"work_of_adhesion": 1.0, "adhesive_stress": 1.0}, "transition", 2.5),
        ("signorini-gap", {}, "amplitude", -1e-6),
        ("signorini-gap", {}, "wavelength_2", 0.0),
    ],
)
def test_invalid_values_name_their_key(name, good, key, bad):
    with pytest.raises(CaseError, match=key):
        load().create(Kind.CONTACT_LAW, {"name": name, **good, key: bad})
    with pytest.raises(CaseError, match=key):
        NAMES[name](**good, **{key: bad})


def test_initial_gap_is_measured_from_first_contact():
    case = load_case(Path(__file__).parents[1] / "cases" / "signorini-gap.toml")
    points = 1e-3 * np.array([[x, y, 0.0] for x in (-2.0, -1.0, 0.0, 0.6, 2.0) for y in (-1.0, 0.0)])
    flat = replace(quarter_half_space(1e11, 1e-3, 2), points=points, frames=np.tile(np.eye(3), (len(points), 1, 1)))
    expected = 2e-6 * (1.0 - np.cos(2.0 * np.pi * points[:, 0] / case.contact_law.wavelength_1))
    np.testing.assert_allclose(IndenterKinematics(case, flat).touching_gap, expected, atol=1e-12)
    trough = replace(case, contact_law=replace(case.contact_law, phase_1=np.pi))
    nearest = 2e-6 * (1.0 + np.cos(2.0 * np.pi * points[:, 0] / case.contact_law.wavelength_1))
    assert nearest.min() > 1e-7
    np.testing.assert_allclose(IndenterKinematics(trough, flat).touching_gap, nearest - nearest.min(), atol=1e-12)
