"""Newton's method and `auto` solve for motions and potentials of the indenter under prescribed resultants."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.contact.problem import (
    ContactProblem,
    ContactState,
    Iterate,
    PrescribedResultant,
    Solver,
    Status,
    resultant,
    unbalance,
)
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.solvers import Auto, SemismoothNewton, StoppingCriteria, residual, solve
from meeframe.testing.closed_forms import Sphere, indent
from meeframe.testing.contact import rescaled
from meeframe.testing.contact_cases import APPROACH, RADIUS
from meeframe.testing.half_space import half_space_system, indentation_problem

SOLVERS = [SemismoothNewton(), Auto()]
TIGHT = StoppingCriteria(tolerance=1e-11, max_iterations=100)
MOTIONS = ("x", "y", "press", "roll", "pitch", "twist")
LAWS = [Signorini(), IsotropicCoulomb(0.3), OrthotropicCoulomb(0.06, 0.6, 0.3), IsotropicCoulomb(np.inf)]
XI = axisymmetric_compliance(library_material("batio3-cofe2o4").stiffness)


def name(value) -> str:
    return type(value).__name__ if isinstance(value, Solver) else str(value)


def modes(system):
    """Return unit motions of an indenter on a flat zone, small rotations about the axes of the frames, and unit
    potentials."""
    x, y, _ = system.points.T
    mode = dict.fromkeys((*MOTIONS, "electric", "magnetic"))
    axes = {"x": (0, 1.0), "y": (1, 1.0), "press": (2, -1.0), "electric": (3, -1.0), "magnetic": (4, -1.0)}
    for key in mode:
        mode[key] = np.zeros((len(x), 5))
    for key, (column, sign) in axes.items():
        mode[key][:, column] = sign
    mode["roll"][:, 2], mode["pitch"][:, 2] = y, -x
    mode["twist"][:, 0], mode["twist"][:, 1] = -y, x
    return mode


def prescribe_resultant(system, key, total):
    """Return a prescribed resultant; `total` is a force or moment along the mode, or an outward charge or flux."""
    mode = modes(system)[key]
    sign = -1.0 if key in ("electric", "magnetic") else 1.0
    return PrescribedResultant(mode, sign * mode, system.weights, total)


def total_of(problem, key, load):
    return float((prescribe_resultant(problem.system, key, 0.0).measure * load).sum())


def freed(problem, **totals):
    return replace(
        problem,
        prescribed_resultants=tuple(prescribe_resultant(problem.system, key, total) for key, total in totals.items()),
    )


def solve_problem(problem, solver=SOLVERS[0], limits=TIGHT, start=None):
    solution = solve(problem, solver, limits, start)
    assert solution.status is Status.CONVERGED, f"{name(solver)}: {solution.message}"
    assert residual(problem, solution.state) <= 2.0 * limits.tolerance
    for off, free in zip(unbalance(problem, solution.state.load), problem.prescribed_resultants, strict=True):
        assert abs(off) <= 1e-10 * max(abs(free.total), np.abs(free.measure * solution.state.load).sum())
    return solution


def assert_same(state: ContactState, expected: ContactState):
    size = np.abs(expected.load).max(axis=0)
    assert (np.abs(state.load - expected.load).max(axis=0) <= 1e-8 * size).all()


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("law", LAWS, ids=str)
@pytest.mark.parametrize("material", ["transverse", "orthotropic"])
@pytest.mark.parametrize("lift", [0.0, 7e-5])
def test_resultants_recover_the_motions(sphere, material, law, lift) -> None:
    """The indenter may start above the surface without contact."""
    drag = 0.0 if law == Signorini() else 0.2
    moved = sphere(material, law, cells=10, drag=drag)
    state = solve_problem(moved).state
    total = {key: total_of(moved, key, state.load) for key in MOTIONS}
    keys = ("press", "roll", "pitch") if law == Signorini() else MOTIONS
    still = replace(moved, gap=moved.gap + lift, translation=0.0 * moved.translation)
    for chosen in (("press",), keys):
        start = moved if len(chosen) == 1 else still
        start = replace(start, gap=still.gap)
        got = solve_problem(freed(start, **{key: total[key] for key in chosen})).state
        assert_same(got, state)
        expected = {"x": moved.translation[0, 0], "y": moved.translation[0, 1], "press": lift}
        for key, motion in zip(chosen, got.motion, strict=True):
            goal = 0.0 if len(chosen) == 1 and key != "press" else expected.get(key, 0.0)
            scale = APPROACH if key in ("x", "y", "press") else APPROACH / 5e-3
            assert motion == pytest.approx(goal, abs=1e-7 * scale), key


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("solver", SOLVERS, ids=name)
@pytest.mark.parametrize("kappa", [(1.0, 0.3), (np.inf, 0.5), (np.inf, np.inf)])
def test_floating_conductors_under_a_force(sphere, solver, kappa) -> None:
    given = sphere("transverse", IsotropicCoulomb(0.3), kappa, cells=10, potentials=(2e3, -3.0))
    state = solve_problem(given).state
    total = {key: total_of(given, key, state.load) for key in ("electric", "magnetic", "press")}
    floating = replace(freed(given, **total), potentials=0.0 * given.potentials, gap=given.gap + 1e-5)
    got = solve_problem(floating, solver).state
    assert_same(got, state)
    np.testing.assert_allclose(got.motion, [2e3, -3.0, 1e-5], rtol=1e-7)
    uncharged = solve_problem(freed(given, electric=0.0, magnetic=0.0), solver).state
    charge, flux = resultant(given.system, uncharged.load)[1]
    assert max(abs(charge / total["electric"]), abs(flux / total["magnetic"])) < 1e-9


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0, 2.0])
def test_floating_conductor_whose_conductivity_grows_with_pressure(sphere, growing, share) -> None:
    """Initially there is no pressure and hence no conduction, but the charge is reached."""
    problem = sphere("orthotropic", IsotropicCoulomb(0.3), cells=8, potentials=(2e4, 0.0))
    compliance = problem.system.diagonal_blocks()[0, 3, 3]
    problem = problem.with_laws(electric=growing(1.0 / compliance, 1e7, 1.0))
    state = solve_problem(problem).state
    charge = share * resultant(problem.system, state.load)[1][0]
    solution = solve_problem(freed(problem, electric=charge))
    computed = replace(problem, potentials=problem.potentials + np.append(solution.state.motion, 0.0))
    assert_same(solution.state, solve_problem(computed).state)
    if share == 1.0:
        assert abs(solution.state.motion[0]) < 1e-6 * 2e4


def test_floating_potential_is_unchanged_without_conduction(sphere) -> None:
    problem = sphere("transverse", IsotropicCoulomb(0.3), cells=8)
    for solver in SOLVERS:
        solution = solve_problem(freed(problem, electric=0.0, magnetic=0.0), solver)
        np.testing.assert_array_equal(solution.state.motion, 0.0)
        failed = solve(freed(problem, electric=1e-6), solver)
        assert failed.status is not Status.CONVERGED
        assert "does not conduct" in failed.message


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("share", [0.5, 0.99, 0.9999])
@pytest.mark.parametrize("law", [IsotropicCoulomb(0.6), IsotropicCoulomb(5.0)], ids=str)
def test_force_up_to_the_friction_limit(sphere, law, share) -> None:
    problem = sphere("transverse", law, cells=12, drag=0.0)
    press = 2e4
    totals = {"press": press, "x": share * law.mu * press, "y": 0.0}
    state = solve_problem(freed(problem, **totals)).state
    computed = np.abs(problem.system.weights @ state.load[:, :3])
    np.testing.assert_allclose(computed, [totals["x"], 0.0, press], rtol=1e-7, atol=1e-7 * press)


@pytest.mark.full
@pytest.mark.parametrize("solver", SOLVERS, ids=name)
def test_forces_above_the_friction_limit_are_reported(sphere, solver) -> None:
    problem = sphere("transverse", IsotropicCoulomb(0.6), cells=6, drag=0.0)
    for totals in ({"press": 2e4, "x": 0.65 * 2e4}, {"press": -1.0}):
        solution = solve(freed(problem, **totals), solver)
        assert solution.status is not Status.CONVERGED
        assert "no pressure and friction" in solution.message
        assert solution.residual > 1e-5


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("share", [0.5, 0.95, 1.2])
def test_tangential_force_proportional_to_normal_force(sphere, share) -> None:
    """At prescribed approach, F_x = share mu P, so the resultants add up to zero."""
    problem = sphere("transverse", IsotropicCoulomb(0.6), cells=10, drag=0.0)
    mode, ratio = modes(problem.system), share * 0.6
    density = mode["x"] - ratio * mode["press"]
    problem = replace(
        problem, prescribed_resultants=(PrescribedResultant(mode["x"], density, problem.system.weights, 0.0),)
    )
    if share > 1.0:
        assert "no pressure and friction" in solve(problem, SemismoothNewton()).message
        return
    load = solve_problem(problem).state.load
    assert total_of(problem, "x", load) == pytest.approx(ratio * total_of(problem, "press", load), rel=1e-9)


def test_eccentric_force_tilts_a_flat_punch() -> None:
    """Full contact without friction gives linear equations for pressures, depth and tilt."""
    system = half_space_system(XI, 4e-3, 8)
    problem = indentation_problem(system, np.zeros(64), 0.0)
    x = system.points[:, 0]
    press, eccentricity = 1e3, 3e-4
    loaded = freed(problem, press=press, roll=0.0, pitch=press * eccentricity)
    solution = solve_problem(loaded)
    assert (solution.state.load[:, 2] < 0.0).all()
    rows = np.stack([free.mode[:, 2] for free in loaded.prescribed_resultants])
    matrix = np.block([[problem.system.matrix[:, 2, :, 2], -rows.T], [rows * system.weights, np.zeros((3, 3))]])
    scale = np.append(np.full(64, 1e8), [1e-6, 1e-3, 1e-3])
    expected = np.linalg.solve(matrix * scale, np.append(np.zeros(64), [press, 0.0, press * eccentricity])) * scale
    np.testing.assert_allclose(solution.state.load[:, 2], expected[:64], rtol=1e-8)
    np.testing.assert_allclose(solution.state.motion, expected[64:], rtol=1e-8, atol=1e-12)
    assert system.weights @ (x * solution.state.load[:, 2]) == pytest.approx(-press * eccentricity, rel=1e-9)
    tipping = solve(freed(problem, press=press, pitch=1.1 * press * x.max()), SemismoothNewton())
    assert tipping.status is not Status.CONVERGED
    assert "no pressure and friction" in tipping.message


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", SOLVERS, ids=name)
def test_hertz_at_prescribed_force_with_charged_conductor(solver) -> None:
    """Force, charge and magnetic flux recover the approach and potentials from which they were computed."""
    exact = indent(XI, Sphere(RADIUS), APPROACH, 1e4, -10.0)
    system = half_space_system(XI, 5e-3, 24)
    height = (system.points[:, 0] ** 2 + system.points[:, 1] ** 2) / (2.0 * RADIUS)
    problem = indentation_problem(system, height, 0.0, Signorini(), (np.inf, np.inf))
    totals = {"press": exact.force, "electric": exact.charge, "magnetic": exact.magnetic_flux}
    solution = solve_problem(freed(problem, **totals), solver)
    approach, electric, magnetic = solution.state.motion
    assert approach == pytest.approx(APPROACH, rel=2e-3)
    assert electric == pytest.approx(1e4, rel=0.03)
    assert magnetic == pytest.approx(-10.0, rel=0.03)


def test_matrix_free_systems(sphere, matrixless) -> None:
    problem = sphere("orthotropic", IsotropicCoulomb(0.5), (1.0, np.inf), cells=8, drag=0.0)
    totals = dict.fromkeys(MOTIONS, 0.0) | {"press": 1e4, "x": 3e3, "twist": 1.0, "pitch": 2.0, "electric": 1e-6}
    expected = solve_problem(freed(problem, **totals)).state
    got = solve_problem(freed(replace(problem, system=matrixless(problem.system)), **totals)).state
    assert_same(got, expected)
    np.testing.assert_allclose(got.motion, expected.motion, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_solutions_do_not_depend_on_units(sphere, scale) -> None:
    problem = sphere("orthotropic", IsotropicCoulomb(0.5), (1.0, np.inf), cells=8, drag=0.0)
    problem = freed(problem, press=1e4, x=3e3, pitch=2.0, electric=1e-6)
    reference = solve_problem(problem)
    for displacement, load in ((scale, 1.0), (1.0, scale), (scale, 1.0 / scale)):
        displacements = displacement * np.array([1.0, 1.0, 1.0, scale, 1.0])
        loads = load * np.array([1.0, 1.0, 1.0, 1.0 / scale, 1.0])
        other = solve_problem(rescaled(problem, displacements, loads))
        assert abs(other.iterations - reference.iterations) <= 1
        np.testing.assert_allclose(other.state.motion, reference.state.motion, rtol=1e-7, atol=1e-14)


def test_start_from_converged_state_and_unloading(sphere) -> None:
    problem = sphere("transverse", IsotropicCoulomb(0.5), cells=8, drag=0.0)
    loaded = freed(problem, press=2e4, x=3e3)
    state = solve_problem(loaded).state
    assert solve(loaded, SemismoothNewton(), start=state).iterations == 0
    for share in (1.5, 0.5):
        onward = freed(problem, press=share * 2e4, x=share * 3e3)
        assert_same(solve_problem(onward, start=state).state, solve_problem(onward).state)
    separated = solve(freed(problem, press=0.0), SemismoothNewton(), start=replace(state, motion=state.motion[:1]))
    assert separated.status is Status.CONVERGED
    assert np.abs(separated.state.load[:, :3]).max() <= 1e-10 * np.abs(state.load).max()


@final
@dataclass(frozen=True)
class Motionless(Solver):
    """A solver that does not support free motions."""

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        return Iterate(np.zeros_like(problem.system.offset), np.zeros(len(problem.gap)))

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        return iterate


def test_solvers_without_free_motions_are_rejected(sphere) -> None:
    problem = freed(sphere("transverse", Signorini(), cells=8), press=1e3, electric=0.0)
    with pytest.raises(CaseError, match=r"found 0 of the 2 motions.*auto"):
        solve(problem, Motionless())
