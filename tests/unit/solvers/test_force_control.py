"""Gradient iterations solve for motions of the indenter under prescribed forces and moments."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.contact.problem import ContactProblem, ContactState, Status, resultant
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.solvers import Auto, BarzilaiBorwein, Nesterov, ProjectedCG, StoppingCriteria, Uzawa, solve
from meeframe.testing.closed_forms import FlatPunch, Sphere, indent
from meeframe.testing.contact_cases import APPROACH, RADIUS
from meeframe.testing.force_control import (
    PRESS,
    SLIDE,
    balanced_solution,
    check_same,
    conducting_sphere,
    prescribe_resultant,
    released,
)
from meeframe.testing.half_space import half_space_system, indentation_problem

GRADIENT = [Uzawa(), BarzilaiBorwein(), Nesterov()]
ALL = [*GRADIENT, ProjectedCG()]
MU = 0.3
FRICTION = [IsotropicCoulomb(MU), OrthotropicCoulomb(0.06, 0.6, 0.3)]
XI = axisymmetric_compliance(library_material("batio3-cofe2o4").stiffness)


@cache
def dragged(law: ContactLaw) -> tuple[ContactProblem, ContactState]:
    """Return a conducting sphere that is dragged, and its solution."""
    problem = conducting_sphere(law, (1.0, 0.3), drag=0.4)
    return problem, balanced_solution(problem, Uzawa()).state


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    "given", [("approach",), ("approach", "translation"), ("translation", "potentials")], ids="-".join
)
@pytest.mark.parametrize("law", FRICTION, ids=str)
def test_resultants_recover_the_motions_with_friction(law, given) -> None:
    problem, expected = dragged(law)
    free, motion = released(problem, expected, *given)
    for solver in GRADIENT:
        solution = balanced_solution(free, solver, start=replace(expected, load=1.001 * expected.load))
        check_same(solution.state, expected)
        np.testing.assert_allclose(solution.state.motion, motion, rtol=1e-8)


@pytest.mark.full
@pytest.mark.parametrize("solver", [Uzawa(step_normal=6e11, step_tangential=4e11), *GRADIENT[1:]], ids=str)
@pytest.mark.parametrize("share", [0.5, 0.98])
def test_tangential_force_proportional_to_normal_force(solver, share) -> None:
    """F_x = share mu P, by a measure with a normal component, at a prescribed approach and at a prescribed force."""
    problem = conducting_sphere(IsotropicCoulomb(MU))
    system = problem.system
    ratio = prescribe_resultant(system, SLIDE, 0.0, density=SLIDE - share * MU * PRESS)
    at_depth = balanced_solution(replace(problem, prescribed_resultants=(ratio,)), solver).state
    force = resultant(system, at_depth.load)[0]
    assert force[0] == pytest.approx(-share * MU * force[2], rel=1e-9)
    moved = replace(problem, translation=problem.translation + at_depth.motion * SLIDE[:2])
    check_same(balanced_solution(moved, Uzawa()).state, at_depth)
    lifted = replace(
        problem,
        gap=problem.gap + APPROACH,
        prescribed_resultants=(prescribe_resultant(system, PRESS, -force[2]), ratio),
    )
    at_force = balanced_solution(lifted, solver).state
    check_same(at_force, at_depth)
    np.testing.assert_allclose(at_force.motion, [APPROACH, at_depth.motion[0]], rtol=1e-8)


def flat_punch(law, cells=9):
    """Return a problem and its rigid modes (6, n, 5): approach, tilts, translations, twist."""
    problem = conducting_sphere(law, cells=cells)
    x, y, _ = problem.system.points.T
    zero, one = np.zeros_like(x), np.ones_like(x)
    normal = [np.stack([zero, zero, -part, zero, zero], axis=1) for part in (one, x, y)]
    planar = [np.stack([*part, zero, zero, zero], axis=1) for part in ((one, zero), (zero, one), (-y, x))]
    gap = np.where(np.hypot(x, y) < 0.8 * x.max(), 0.0, np.inf)
    return replace(problem, gap=gap), [*normal, *planar]


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("solver", ALL, ids=str)
def test_eccentric_force_tilts_the_punch(solver) -> None:
    """The linear system of full contact gives pressures and three motions."""
    problem, modes = flat_punch(Signorini())
    system = problem.system
    inside = np.isfinite(problem.gap)
    compliance = system.dense()[:, 2, :, 2][np.ix_(inside, inside)]
    totals = 1e3 * np.array([1.0, 2e-4, -1e-4])
    shapes = np.stack([mode[inside, 2] for mode in modes[:3]], axis=1)
    k = len(compliance)
    units = 1.0 / np.abs(compliance).max()
    system_matrix = np.zeros((k + 3, k + 3))
    system_matrix[:k, :k], system_matrix[:k, k:] = units * compliance, -shapes
    system_matrix[k:, :k] = (system.weights[inside, None] * shapes).T
    right = np.concatenate([np.zeros(k), totals])
    expected = np.linalg.solve(system_matrix, right)
    assert (expected[:k] < 0.0).all()
    free = tuple(prescribe_resultant(system, mode, total) for mode, total in zip(modes[:3], totals, strict=True))
    state = balanced_solution(replace(problem, prescribed_resultants=free), solver).state
    assert np.abs(state.load[inside, 2] - expected[:k]).max() <= 1e-8 * np.abs(expected[:k]).max()
    np.testing.assert_allclose(state.motion, expected[k:] / units, rtol=1e-8)


@pytest.mark.parametrize("solver", ALL, ids=str)
def test_three_points_carry_the_statically_determinate_forces(solver) -> None:
    """The resultants alone determine the forces."""
    problem, modes = flat_punch(Signorini(), cells=7)
    feet = [10, 25, 36]
    gap = np.full(49, 1e-4)
    gap[feet] = [0.0, 1e-6, -2e-6]
    x, y, _ = problem.system.points[feet].T
    forces = np.array([100.0, 60.0, 40.0])
    totals = [forces.sum(), forces @ x, forces @ y]
    free = tuple(
        prescribe_resultant(problem.system, mode, total) for mode, total in zip(modes[:3], totals, strict=True)
    )
    state = balanced_solution(replace(problem, gap=gap, prescribed_resultants=free), solver).state
    assert list(np.flatnonzero(state.load[:, 2])) == feet
    np.testing.assert_allclose(-state.load[feet, 2] * problem.system.weights[feet], forces, rtol=1e-9)


@pytest.mark.full
def test_tilt_of_the_punch_matches_closed_form() -> None:
    """M = (4/3) E* a^3 angle: the pressure (2 E* angle/pi) x / sqrt(a^2 - r^2) has a potential that is linear in x."""
    system = half_space_system(XI, 4.2e-3, 28)
    x, y, _ = system.points.T
    n = len(x)
    inside = np.hypot(x, y) < 2e-3
    radius = np.sqrt(system.weights[inside].sum() / np.pi)
    tilt = np.stack([np.zeros(n), np.zeros(n), -x, np.zeros(n), np.zeros(n)], axis=1)
    force = indent(XI, FlatPunch(radius), APPROACH).force
    angle = 0.3 * APPROACH / radius
    moment = 4.0 / 3.0 * radius**3 / (np.pi * XI[0, 0]) * angle
    free = prescribe_resultant(system, PRESS, force), prescribe_resultant(system, tilt, moment)
    punch = indentation_problem(system, np.where(inside, 0.0, np.inf), approach=0.0)
    problem = replace(punch, prescribed_resultants=free)
    motion = balanced_solution(problem, ProjectedCG(), StoppingCriteria()).state.motion
    assert motion == pytest.approx([APPROACH, angle], rel=0.03)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", GRADIENT, ids=str)
def test_six_motions_at_once(solver) -> None:
    problem, modes = flat_punch(IsotropicCoulomb(0.4), cells=8)
    size = np.abs(problem.system.points).max()
    motion = APPROACH * np.array([0.3, 0.3, 0.1, 0.3, 0.1, 0.4]) / np.array([1.0, size, size, 1.0, 1.0, size])
    position = np.einsum("k,kni->ni", motion, modes)
    prescribed = replace(problem, gap=problem.gap + position[:, 2], translation=position[:, :2])
    expected = balanced_solution(prescribed, Uzawa()).state
    pressed = expected.load[:, 2] < 0.0
    assert 0 < pressed.sum() < np.isfinite(problem.gap).sum()
    totals = [(problem.system.weights[:, None] * mode * expected.load).sum() for mode in modes]
    free = [prescribe_resultant(problem.system, mode, total) for mode, total in zip(modes, totals, strict=True)]
    state = balanced_solution(replace(problem, prescribed_resultants=tuple(free)), solver).state
    check_same(state, expected)
    np.testing.assert_allclose(state.motion, motion, rtol=1e-7)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", ALL, ids=str)
def test_hertz_at_prescribed_force(solver) -> None:
    exact = indent(XI, Sphere(RADIUS), APPROACH)
    system = half_space_system(XI, 5e-3, 20)
    touching = indentation_problem(system, (system.points**2).sum(axis=1) / (2.0 * RADIUS), approach=0.0)
    problem = replace(touching, prescribed_resultants=(prescribe_resultant(system, PRESS, exact.force),))
    state = balanced_solution(problem, solver, StoppingCriteria()).state
    assert state.motion == pytest.approx([APPROACH], rel=2e-3)
    assert -state.load[:, 2].min() == pytest.approx(exact.pressure(np.zeros(1))[0], rel=0.01)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("solver", ALL, ids=str)
@pytest.mark.parametrize("lift", [1e-6, 1e-3, 0.1])
def test_indenter_above_the_body_is_lowered(solver, lift) -> None:
    problem = conducting_sphere(Signorini())
    touching = replace(
        problem, gap=problem.gap + APPROACH, prescribed_resultants=(prescribe_resultant(problem.system, PRESS, 500.0),)
    )
    above = replace(touching, gap=touching.gap + lift)
    reference, computed = (
        balanced_solution(touching, solver, StoppingCriteria()),
        balanced_solution(above, solver, StoppingCriteria()),
    )
    assert computed.state.motion == pytest.approx(reference.state.motion + lift, rel=1e-9)
    assert computed.iterations <= reference.iterations + 2 * solver.check_interval


IMPOSSIBLE = {
    "more than friction carries": (IsotropicCoulomb(MU), (PRESS, 500.0), (SLIDE, 1.2 * MU * 500.0)),
    "tangential force without friction": (Signorini(), (PRESS, 500.0), (SLIDE, 50.0)),
    "pull": (Signorini(), (PRESS, -500.0)),
}


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("name", IMPOSSIBLE)
@pytest.mark.parametrize("solver", ALL, ids=str)
def test_infeasible_resultants_do_not_converge(solver, name) -> None:
    law, *totals = IMPOSSIBLE[name]
    if law != Signorini() and solver == ProjectedCG():
        pytest.skip("frictionless contact only")
    problem = conducting_sphere(law, cells=6)
    free = tuple(prescribe_resultant(problem.system, mode, total) for mode, total in totals)
    solution = solve(
        replace(problem, prescribed_resultants=free), solver, StoppingCriteria(max_iterations=400, stall_window=60)
    )
    assert solution.status not in (Status.CONVERGED, Status.DIVERGED)
    assert np.isfinite(solution.state.load).all()
    assert np.isfinite(solution.state.motion).all()
    assert solution.residual > 1e-4
    if name == "more than friction carries":
        force = resultant(problem.system, solution.state.load)[0]
        assert np.hypot(force[0], force[1]) <= -MU * force[2] * (1.0 + 1e-9)


@pytest.mark.full
def test_forces_cost_no_more_iterations_than_motions() -> None:
    problem = conducting_sphere(IsotropicCoulomb(MU), drag=0.4)
    expected = balanced_solution(problem, Uzawa()).state
    free, _ = released(problem, expected, "approach", "translation")
    for solver in GRADIENT:
        assert (
            balanced_solution(free, solver).iterations
            <= balanced_solution(problem, solver).iterations + solver.check_interval
        )


def test_conjugate_gradients_reject_nonconjugate_measures() -> None:
    problem = conducting_sphere(Signorini())
    ratio = prescribe_resultant(problem.system, SLIDE, 0.0, density=SLIDE - 0.1 * PRESS)
    with pytest.raises(CaseError, match=r"free motion 1 of the indenter.*weights \* mode"):
        solve(
            replace(problem, prescribed_resultants=(prescribe_resultant(problem.system, PRESS, 500.0), ratio)),
            ProjectedCG(),
        )


class ConductingUnderPressure(ConductivityLaw):
    """Conducts where the pressure exceeds a threshold [Pa]."""

    def __init__(self, threshold: float) -> None:
        self.threshold = threshold

    def conductivity(self, normal_traction, gap, drop):
        return 1e-6 * np.clip((-normal_traction - self.threshold) / 1e6, 0.0, 1.0)


@pytest.mark.parametrize(
    ("charge", "threshold", "converges"), [(1e-9, 1e12, False), (1e-15, 1e12, False), (1e-9, 0.0, True)]
)
def test_a_charge_that_no_node_conducts_has_its_reason(charge, threshold, converges) -> None:
    """A threshold above all pressures insulates: pressures are those of an insulating contact."""
    problem = conducting_sphere(IsotropicCoulomb(MU), cells=6)
    channels = (replace(problem.channels[0], law=ConductingUnderPressure(threshold)), *problem.channels[1:])
    free = prescribe_resultant(problem.system, np.array([0.0, 0.0, 0.0, 1.0, 0.0]), charge)
    solution = solve(replace(problem, channels=channels, prescribed_resultants=(free,)), Auto())
    assert (solution.status is Status.CONVERGED) == converges, solution.message
    if not converges:
        assert "no node conducts it" in solution.message
        insulated = solve(problem, Auto()).state.load[:, 2]
        np.testing.assert_allclose(solution.state.load[:, 2], insulated, atol=1e-8 * np.abs(insulated).max())
