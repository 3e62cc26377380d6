"""Adhesion agrees with rigid bodies, the theory of Maugis and Dugdale, weak attraction, and the balance of energy."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from meeframe_laws.interface import DMT, DMTCoulomb, Dugdale
from scipy.integrate import quad

from meeframe.contact.problem import ContactState, Status, contact_gap, resultant
from meeframe.solvers import Auto, SemismoothNewton, solve
from meeframe.solvers.gradient.accelerated import BarzilaiBorwein
from meeframe.testing.closed_forms import Sphere, indent
from meeframe.testing.closed_forms_adhesion import Maugis, bradley_force, hertz_gap, quarter_half_space, weak_attraction
from meeframe.testing.elastic_half_space import elastic_half_space
from meeframe.testing.force_control import PRESS, balanced_solution, check_same, prescribe_resultant
from meeframe.testing.half_space import half_space_system, indentation_problem

W, R, MODULUS = 0.05, 1e-6, 4e9


def paraboloid(system, approach, law, radius=R):
    return indentation_problem(system, (system.points**2).sum(axis=1) / (2.0 * radius), approach, law)


def pressing_force(problem, solver=None):
    """Return the force of the indenter on the body [N], positive in compression."""
    solution = solve(problem, solver or SemismoothNewton())
    assert solution.status is Status.CONVERGED, solution.message
    return -float(problem.system.weights @ solution.state.load[:, 2])


def range_of(law):
    return law.equilibrium_distance if isinstance(law, DMT) else 1.5 * law.work_of_adhesion / law.adhesive_stress


def test_computed_values():
    dmt = DMT(0.06, 3e-10)
    np.testing.assert_allclose(dmt.adhesion(np.array([0.0, 3e-10, 6e-10, np.inf])), [4e8, 5e7, 4e8 / 27.0, 0.0])
    dugdale = Dugdale(0.06, 2e8, transition=0.5)  # h_0 = 0.3 nm; the drop extends from 0.225 to 0.375 nm
    gaps = 1e-9 * np.array([0.0, 0.22, 0.2625, 0.3, 0.38, np.inf])
    np.testing.assert_allclose(dugdale.adhesion(gaps), 2e8 * np.array([1.0, 1.0, 27.0 / 32.0, 0.5, 0.0, 0.0]))


@pytest.mark.parametrize("law", [DMT(W, 3e-10), Dugdale(W, 1e8), Dugdale(W, 1e8, transition=2.0)], ids=repr)
def test_work_of_adhesion(law):
    pieces = range_of(law) * np.array([0.0, 0.3, 1.0, 1e2, 1e4, 1e6])
    work = sum(
        quad(lambda gap: law.adhesion(np.array([gap]))[0], low, high, epsrel=1e-10)[0] for low, high in pairwise(pieces)
    )
    assert work == pytest.approx(W, rel=1e-8)


@pytest.mark.full
@pytest.mark.parametrize("distance", [0.0, 0.5, 2.0])
def test_dmt_between_rigid_bodies_matches_bradley(distance):
    """The force is -2 pi R w / (1 + h / z_0)^2, up to the part beyond the grid."""
    z0 = 3e-10
    rigid = np.sqrt(R * W**2 / (1e-5 * z0) ** 3)  # Tabor parameter 1e-5
    errors = []
    for reach, cells in ((3.0, 8), (6.0, 16), (12.0, 32)):
        system = quarter_half_space(rigid, reach * np.sqrt(2.0 * R * z0), cells)
        computed = pressing_force(paraboloid(system, -distance * z0, DMT(W, z0)))
        errors.append(computed / bradley_force(W, R, distance * z0, z0) - 1.0)
    assert abs(errors[2]) < 2e-3
    assert abs(errors[2]) < abs(errors[1]) / 4.0 < abs(errors[0]) / 16.0


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("parameter", [0.1, 0.3, 0.5])
def test_dugdale_matches_maugis(parameter):
    """Force and radii at prescribed approach on 48 x 48 cells."""
    unit = Maugis(R, MODULUS, W, 1.0)
    theory = replace(unit, stress=parameter / unit.transition)
    assert theory.transition == pytest.approx(parameter, rel=1e-12)
    law = Dugdale(W, theory.stress, transition=0.4)
    contact = 1.5 * theory.contact_unit
    outer, force, approach = theory.at(contact)
    system = quarter_half_space(MODULUS, 1.2 * outer, 24)
    problem = paraboloid(system, approach, law)
    state = balanced_solution(problem, SemismoothNewton()).state
    assert -float(system.weights @ state.load[:, 2]) == pytest.approx(force, abs=0.01 * theory.force_unit)
    gap = contact_gap(problem, state.displacement)[:, 2]
    touching = np.sqrt(system.weights @ (gap < 1e-6 * approach) / np.pi)
    attracted = np.sqrt(system.weights @ (gap < W / theory.stress) / np.pi)
    assert touching == pytest.approx(contact, rel=0.03)
    assert attracted == pytest.approx(outer, rel=0.03)
    # the pull is below the pull-off force of rigid bodies; without contact it is the attraction alone
    assert force > -2.0 * theory.force_unit
    open_ = gap > 1e-6 * approach
    np.testing.assert_allclose(state.load[open_, 2], law.adhesion(gap[open_]), atol=1e-8 * theory.stress)


@pytest.mark.full
def test_forces_converge_to_those_of_maugis():
    unit = Maugis(R, MODULUS, W, 1.0)
    theory = replace(unit, stress=0.3 / unit.transition)
    law, errors = Dugdale(W, theory.stress, transition=0.4), []
    half = 1.2 * theory.at(1.8 * theory.contact_unit)[0]
    for cells in (6, 12, 24):
        system = quarter_half_space(MODULUS, half, cells)
        off = []
        for radius in (1.2, 1.4, 1.6, 1.8):
            _, force, approach = theory.at(radius * theory.contact_unit)
            off.append(pressing_force(paraboloid(system, approach, law), Auto()) - force)
        errors.append(np.sqrt(np.mean(np.square(off))) / theory.force_unit)
    assert errors[2] < 0.01
    assert errors[2] < errors[1] / 2.0 < errors[0] / 4.0


@pytest.mark.full
@pytest.mark.parametrize("name", ["dmt", "dugdale"])
def test_weak_attraction_reduces_the_hertz_force(name):
    """The change at prescribed approach is of first order in the work of adhesion and scatters with the position of
    the edge on the grid."""
    depth, pulls = 1e-8, []
    radius = np.sqrt(R * depth)
    peak = 2.0 * MODULUS / np.pi * np.sqrt(depth / R)
    range_ = 0.3 * depth
    law = DMT(1e-5 * peak * range_ / 2.0, range_) if name == "dmt" else Dugdale(1e-5 * peak * range_, 1e-5 * peak)
    half = 3.0 * radius
    system = quarter_half_space(MODULUS, half, 24)
    for approach in depth * np.linspace(0.8, 1.2, 7):
        contact = np.sqrt(R * approach)
        exact = weak_attraction(law.adhesion, contact, R, 2.0 / np.sqrt(np.pi) * half)
        computed = pressing_force(paraboloid(system, approach, None)) - pressing_force(
            paraboloid(system, approach, law)
        )
        pulls.append(computed / exact)
    assert np.mean(pulls) == pytest.approx(1.0, abs=0.03)


def test_hertz_gap_matches_indentation():
    xi = np.diag([1.0 / (np.pi * MODULUS), -1.0, -1.0])
    approach = 1e-8
    form = indent(xi, Sphere(R), approach)
    r = np.sqrt(R * approach) * np.array([1.0, 1.1, 2.0, 5.0])
    gap = r**2 / (2.0 * R) - approach - form.displacement(r)
    np.testing.assert_allclose(hertz_gap(r, np.sqrt(R * approach), R), gap, atol=1e-6 * approach)


@pytest.mark.parametrize("law", [DMT(W, 3e-9), Dugdale(W, 1e7, transition=1.0)], ids=repr)
@pytest.mark.parametrize("approach", [-4e-9, 3e-9])
def test_force_is_the_derivative_of_the_energy(law, approach):
    """dE/d(approach) = P with the energies of the body and of adhesion, for bodies of any stiffness."""
    half = 12.0 * np.sqrt(2.0 * R * range_of(law))
    system = quarter_half_space(1e8, half, 8)

    def energy_to_infinity(gap):
        return quad(lambda at: law.adhesion(np.array([at]))[0], gap, 60.0 * range_of(law), epsrel=1e-12, limit=400)[0]

    def state_at(way):
        return balanced_solution(paraboloid(system, way, law), SemismoothNewton()).state

    def energy(way):
        state = state_at(way)
        gap = np.maximum(contact_gap(paraboloid(system, way, law), state.displacement)[:, 2], 0.0)
        elastic = 0.5 * (state.load[:, 2] * state.displacement[:, 2])
        far = 60.0 * range_of(law)
        adhesive = np.array([energy_to_infinity(g) if g < far else 0.0 for g in gap])
        tail = (
            -law.work_of_adhesion / (1.0 + np.maximum(gap, far) / range_of(law)) ** 2 if isinstance(law, DMT) else 0.0
        )
        return float(system.weights @ (elastic - adhesive + tail))

    step = 1e-4 * range_of(law)
    slope = (energy(approach + step) - energy(approach - step)) / (2.0 * step)
    force = -float(system.weights @ state_at(approach).load[:, 2])
    assert slope == pytest.approx(force, rel=1e-4)


@pytest.mark.parametrize("law", [DMT(600.0, 2e-5, mu=0.3), Dugdale(300.0, 3e7, mu=0.3)], ids=repr)
def test_friction_limit_includes_attraction(law):
    system = elastic_half_space(1e11, 0.3, 5e-3, 12)
    problem = replace(paraboloid(system, 5e-5, law, 0.1), translation=np.tile([1e-3, 0.0], (144, 1)))
    state = balanced_solution(problem, SemismoothNewton()).state
    touching = np.abs(contact_gap(problem, state.displacement)[:, 2]) < 1e-11
    assert 20 < touching.sum() < 144
    pull = law.adhesion(np.zeros(1))[0]
    shear = np.linalg.norm(state.load[:, :2], axis=1)
    limit = np.where(touching, 0.3 * (pull - state.load[:, 2]), 0.0)
    np.testing.assert_allclose(shear, limit, atol=1e-8 * shear.max())
    assert state.load[touching, 2].max() > 0.0, "nowhere in contact is there tension, which friction could overlook"


def test_friction_limit_includes_the_offset():
    law = DMTCoulomb(0.3, 2e8)
    system = elastic_half_space(1e11, 0.3, 5e-3, 12)
    problem = replace(paraboloid(system, 5e-5, law, 0.1), translation=np.tile([1e-3, 0.0], (144, 1)))
    state = balanced_solution(problem, SemismoothNewton()).state
    load, area = state.load, (state.load[:, 2] < 0.0) @ system.weights
    force, _ = resultant(system, load)
    along = np.linalg.norm(load[:, :2], axis=1) @ system.weights
    assert along == pytest.approx(0.3 * (-force[2] + 2e8 * area), rel=1e-9)


@pytest.mark.full
@pytest.mark.parametrize("law", [DMT(W, 3e-9), Dugdale(W, 3e7, transition=0.5)], ids=repr)
def test_prescribed_force_recovers_the_approach(law):
    """Compressive, zero and tensile forces, the latter 0.4 of the pull-off force of rigid bodies,
    start from contact."""
    reach = 6.0 if isinstance(law, DMT) else 2.5
    system = quarter_half_space(MODULUS, reach * np.sqrt(2.0 * R * range_of(law)), 12)
    height = (system.points**2).sum(axis=1) / (2.0 * R)
    unit = np.pi * W * R
    held = balanced_solution(indentation_problem(system, height, 1e-9, law), SemismoothNewton()).state
    start = ContactState(held.load, held.displacement, held.contact_fraction, np.array([1e-9]))
    for total in (1.0, 0.0, -0.8):
        free = replace(
            indentation_problem(system, height, 0.0, law),
            prescribed_resultants=(prescribe_resultant(system, PRESS, total * unit),),
        )
        start = balanced_solution(free, SemismoothNewton(), start=start).state
        near = replace(start, load=0.999 * start.load, motion=1.001 * start.motion)
        check_same(balanced_solution(free, BarzilaiBorwein(), start=near).state, start)
        given = indentation_problem(system, height, float(start.motion[0]), law)
        assert pressing_force(given) == pytest.approx(total * unit, abs=1e-8 * unit)


@pytest.mark.parametrize("law", [DMT(W, 3e-10), Dugdale(W, 1e8)], ids=repr)
def test_attraction_without_contact(law):
    """Attraction is also computed where the body is so stiff that the overlap does not determine the scale of
    tractions."""
    for modulus in (1e11, 1e17):
        system = quarter_half_space(modulus, 5.0 * np.sqrt(2.0 * R * range_of(law)), 8)
        problem = paraboloid(system, -0.3 * range_of(law), law)
        states = [balanced_solution(problem, solver).state for solver in (SemismoothNewton(), BarzilaiBorwein())]
        check_same(*states)
        assert states[0].load[:, 2].max() > 0.0
        assert states[0].load[:, 2].min() == 0.0 or isinstance(law, DMT)


def test_full_grid_matches_symmetric_quarter():
    """A quarter of the grid represents the half space under a symmetric load."""
    half, law = 3e-8, Dugdale(W, 1e7)
    quarter = pressing_force(paraboloid(quarter_half_space(MODULUS, half, 5), 1e-9, law))
    whole = half_space_system(np.diag([1.0 / (np.pi * MODULUS), -1.0, -1.0]), 2.0 * half, 10)
    assert pressing_force(paraboloid(whole, 1e-9, law)) == pytest.approx(quarter, rel=1e-9)
