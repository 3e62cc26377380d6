"""Prescribed resultants in the gradient iterations: motions and potentials of the indenter come out of the solution."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from meeframe.core.contact import ContactProblem, ContactSolution, ContactState, Freedom, Status, resultant, unbalance
from meeframe.core.errors import CaseError
from meeframe.core.fields import ELECTRIC, MAGNETIC
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.materials import library_material
from meeframe.materials.half_space import axisymmetric_compliance
from meeframe.solvers import BarzilaiBorwein, Limits, Nesterov, ProjectedCG, Uzawa, residual, solve
from meeframe.solvers.conduction import own_response, resistances
from meeframe.solvers.elimination import KrylovElimination, eliminate
from meeframe.testing.closed_forms import FlatPunch, Sphere, indent
from meeframe.testing.contact import rescaled
from meeframe.testing.contact_cases import APPROACH, RADIUS, SphereCase
from meeframe.testing.half_space import half_space_system
from meeframe.testing.matrix_free import MatrixFree

GRADIENT = [Uzawa(), BarzilaiBorwein(), Nesterov()]
ALL = [*GRADIENT, ProjectedCG()]
MEDIUM = library_material("orthotropic-mee")
XI = axisymmetric_compliance(library_material("batio3-cofe2o4").stiffness)
TIGHT = Limits(tolerance=1e-11, max_iterations=5000)
PRESS, SLIDE, ASIDE = np.diag([-1.0, 1.0, 1.0]) @ np.eye(5)[[2, 0, 1]]
VOLTAGE, MAGNETOMOTIVE = -np.eye(5)[[ELECTRIC, MAGNETIC]]
KAPPA = {"insulated": (0.0, 0.0), "finite": (1.0, 0.3), "mixed": (np.inf, 0.5), "perfect": (np.inf, np.inf)}
MU = 0.3
FRICTION = [IsotropicCoulomb(MU), OrthotropicCoulomb(0.06, 0.6, 0.3)]


def freedom(system, mode, total, measure=None):
    """mode: (5,) or (n, 5); total: force or moment along it, or outward charge or flux."""
    mode = np.broadcast_to(mode, system.offset.shape).copy()
    sign = -1.0 if mode[:, 3:].any() else 1.0
    return Freedom(mode, sign * system.weights[:, None] * (mode if measure is None else measure), float(total))


def sphere(law, condition="insulated", drag=0.0, cells=8, potentials=(2e4, -15.0)):
    """kappa in units of the inverse own response of a node."""
    plain = SphereCase(MEDIUM, law, Insulating(), Insulating(), cells, drag, potentials=potentials)
    own = own_response(plain.problem())[0]
    electric, magnetic = (StepConductivity(float(k / o)) for k, o in zip(KAPPA[condition], own, strict=True))
    return replace(plain, electric=electric, magnetic=magnetic).problem()


def solved(problem, solver, limits=TIGHT, start=None) -> ContactSolution:
    solution = solve(problem, solver, limits, start)
    assert solution.status is Status.CONVERGED, f"{solver}: {solution.message}"
    assert residual(problem, solution.state) <= 2.0 * limits.tolerance
    assert solution.state.motion.shape == (len(problem.freedoms),)
    for off, free in zip(unbalance(problem, solution.state.load), problem.freedoms, strict=True):
        assert abs(off) <= 1e-11 * max(abs(free.total), np.abs(free.measure * solution.state.load).sum())
    return solution


def assert_same(state: ContactState, expected: ContactState):
    size = np.abs(expected.load).max(axis=0)
    assert (np.abs(state.load - expected.load).max(axis=0) <= 1e-8 * size).all()


def released(problem: ContactProblem, state: ContactState, *given: str):
    """The same problem with the resultants of its solution instead of what is named, and the motions expected."""
    system, n = problem.system, len(problem.gap)
    force, charge, flux = resultant(system, state.load)
    freedoms, motions = [], []
    if "approach" in given:
        problem = replace(problem, gap=problem.gap + APPROACH)
        freedoms, motions = [freedom(system, PRESS, -force[2])], [APPROACH]
    if "translation" in given:
        freedoms += [freedom(system, SLIDE, force[0]), freedom(system, ASIDE, force[1])]
        motions += [*problem.translation[0]]
        problem = replace(problem, translation=np.zeros((n, 2)))
    if "potentials" in given:
        freedoms += [freedom(system, VOLTAGE, charge), freedom(system, MAGNETOMOTIVE, flux)]
        motions += [*problem.potentials[0]]
        problem = replace(problem, potentials=np.zeros((n, 2)))
    return replace(problem, freedoms=tuple(freedoms)), np.array(motions)


@pytest.mark.parametrize("given", [("approach",), ("potentials",), ("approach", "potentials")], ids="-".join)
@pytest.mark.parametrize("condition", KAPPA)
def test_resultants_give_the_motions_back(condition, given) -> None:
    if condition == "insulated" and "potentials" in given:
        pytest.skip("nothing determines the potentials")
    problem = sphere(Signorini(), condition)
    expected = solved(problem, Uzawa()).state
    free, motion = released(problem, expected, *given)
    # where a law jumps there may be two solutions; from nearby all find the same
    near = replace(expected, load=1.001 * expected.load) if condition != "insulated" else None
    for solver in ALL:
        state = solved(free, solver, start=near).state
        assert_same(state, expected)
        np.testing.assert_allclose(state.motion, motion, rtol=1e-8)


@pytest.mark.parametrize(
    "given", [("approach",), ("approach", "translation"), ("translation", "potentials")], ids="-".join
)
@pytest.mark.parametrize("law", FRICTION, ids=str)
def test_resultants_give_the_motions_back_with_friction(law, given) -> None:
    problem = sphere(law, "finite", drag=0.4)
    expected = solved(problem, Uzawa()).state
    free, motion = released(problem, expected, *given)
    for solver in GRADIENT:
        solution = solved(free, solver, start=replace(expected, load=1.001 * expected.load))
        assert_same(solution.state, expected)
        np.testing.assert_allclose(solution.state.motion, motion, rtol=1e-8)


@pytest.mark.parametrize("solver", GRADIENT, ids=str)
@pytest.mark.parametrize("share", [0.5, 0.98])
def test_tangential_force_in_proportion_to_the_normal_one(solver, share) -> None:
    """F_x = share mu P by a measure with a normal part, at a given depth and at a given force."""
    problem = sphere(IsotropicCoulomb(MU))
    system = problem.system
    ratio = freedom(system, SLIDE, 0.0, measure=SLIDE - share * MU * PRESS)
    at_depth = solved(replace(problem, freedoms=(ratio,)), solver).state
    force = resultant(system, at_depth.load)[0]
    assert force[0] == pytest.approx(-share * MU * force[2], rel=1e-9)
    moved = replace(problem, translation=problem.translation + at_depth.motion * SLIDE[:2])
    assert_same(solved(moved, Uzawa()).state, at_depth)
    lifted = replace(problem, gap=problem.gap + APPROACH, freedoms=(freedom(system, PRESS, -force[2]), ratio))
    at_force = solved(lifted, solver).state
    assert_same(at_force, at_depth)
    np.testing.assert_allclose(at_force.motion, [APPROACH, at_depth.motion[0]], rtol=1e-8)


def flat_punch(law, cells=9):
    """Problem and rigid modes (6, n, 5): press, tilts, slides, twist."""
    problem = sphere(law, cells=cells)
    x, y, _ = problem.system.points.T
    zero, one = np.zeros_like(x), np.ones_like(x)
    normal = [np.stack([zero, zero, -part, zero, zero], axis=1) for part in (one, x, y)]
    planar = [np.stack([*part, zero, zero, zero], axis=1) for part in ((one, zero), (zero, one), (-y, x))]
    gap = np.where(np.hypot(x, y) < 0.8 * x.max(), 0.0, np.inf)
    return replace(problem, gap=gap), [*normal, *planar]


@pytest.mark.parametrize("solver", ALL, ids=str)
def test_eccentric_force_tilts_the_punch(solver) -> None:
    """Against the linear system of the punch in full contact: pressures and three motions at once."""
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
    free = tuple(freedom(system, mode, total) for mode, total in zip(modes[:3], totals, strict=True))
    state = solved(replace(problem, freedoms=free), solver).state
    assert np.abs(state.load[inside, 2] - expected[:k]).max() <= 1e-8 * np.abs(expected[:k]).max()
    np.testing.assert_allclose(state.motion, expected[k:] / units, rtol=1e-8)


def test_tilt_of_the_punch_against_its_closed_form() -> None:
    """M = (4/3) E* a^3 angle: the pressure (2 E* angle/pi) x / sqrt(a^2 - r^2), whose potential is linear in x."""
    system = half_space_system(XI, 4.2e-3, 28)
    x, y, _ = system.points.T
    n = len(x)
    inside = np.hypot(x, y) < 2e-3
    radius = np.sqrt(system.weights[inside].sum() / np.pi)
    tilt = np.stack([np.zeros(n), np.zeros(n), -x, np.zeros(n), np.zeros(n)], axis=1)
    force = indent(XI, FlatPunch(radius), APPROACH).force
    angle = 0.3 * APPROACH / radius
    moment = 4.0 / 3.0 * radius**3 / (np.pi * XI[0, 0]) * angle
    free = freedom(system, PRESS, force), freedom(system, tilt, moment)
    nothing = np.zeros((n, 2))
    gap = np.where(inside, 0.0, np.inf)
    problem = ContactProblem(system, Signorini(), Insulating(), Insulating(), gap, nothing, nothing, free)
    motion = solved(problem, ProjectedCG(), Limits()).state.motion
    assert motion == pytest.approx([APPROACH, angle], rel=0.03)


@pytest.mark.parametrize("solver", GRADIENT, ids=str)
@pytest.mark.parametrize(
    "amounts", [(1.0, 0.05, 0.02, 0.1, 0.05, 0.1), (0.3, 0.3, 0.1, 0.3, 0.1, 0.4)], ids=["full", "lifting"]
)
def test_six_motions_at_once(solver, amounts) -> None:
    problem, modes = flat_punch(IsotropicCoulomb(0.4), cells=8)
    size = np.abs(problem.system.points).max()
    motion = APPROACH * np.array(amounts) / np.array([1.0, size, size, 1.0, 1.0, size])
    position = np.einsum("k,kni->ni", motion, modes)
    prescribed = replace(problem, gap=problem.gap + position[:, 2], translation=position[:, :2])
    expected = solved(prescribed, Uzawa()).state
    pressed = expected.load[:, 2] < 0.0
    assert (pressed == np.isfinite(problem.gap)).all() == (amounts[0] == 1.0)
    totals = [(problem.system.weights[:, None] * mode * expected.load).sum() for mode in modes]
    free = [freedom(problem.system, mode, total) for mode, total in zip(modes, totals, strict=True)]
    state = solved(replace(problem, freedoms=tuple(free)), solver).state
    assert_same(state, expected)
    np.testing.assert_allclose(state.motion, motion, rtol=1e-7)


def closed_form_problem(*freedoms, kappa=(0.0, 0.0), cells=22):
    """A sphere that just touches the half space of notes section 4; freedoms: (mode, total)."""
    system = half_space_system(XI, 5e-3, cells)
    gap = (system.points[:, 0] ** 2 + system.points[:, 1] ** 2) / (2.0 * RADIUS)
    free = tuple(freedom(system, mode, total) for mode, total in freedoms)
    laws = (StepConductivity(value) for value in kappa)
    nothing = np.zeros((len(gap), 2))
    return ContactProblem(system, Signorini(), *laws, gap, nothing, nothing, free)


@pytest.mark.parametrize("solver", ALL, ids=str)
def test_hertz_at_a_given_force(solver) -> None:
    exact = indent(XI, Sphere(RADIUS), APPROACH)
    state = solved(closed_form_problem((PRESS, exact.force)), solver, Limits()).state
    assert state.motion == pytest.approx([APPROACH], rel=2e-3)
    assert -state.load[:, 2].min() == pytest.approx(exact.pressure(np.zeros(1))[0], rel=0.01)


@pytest.mark.parametrize("solver", [BarzilaiBorwein(), ProjectedCG()], ids=str)
@pytest.mark.parametrize("potential", [2e4, -1.5e4, None])
def test_floating_conductor_against_the_closed_form(solver, potential) -> None:
    """Force and charge given, approach and potential back; None: no charge. The flux is singular at the edge, which a
    grid resolves to first order only."""
    if potential is None:
        potential = brentq(lambda phi: indent(XI, Sphere(RADIUS), APPROACH, phi).charge, -1e5, 1e5)
    exact = indent(XI, Sphere(RADIUS), APPROACH, potential)
    free = (PRESS, exact.force), (VOLTAGE, exact.charge)
    motion = solved(closed_form_problem(*free, kappa=(np.inf, 0.0)), solver, Limits()).state.motion
    assert motion[0] == pytest.approx(APPROACH, rel=5e-3)
    assert motion[1] == pytest.approx(potential, rel=0.03)


@pytest.mark.parametrize("condition", ["finite", "mixed", "perfect"])
@pytest.mark.parametrize("charges", [(0.0, 0.0), (1e-7, -2e-7)], ids=["uncharged", "charged"])
def test_floating_conductor_is_one_with_the_potential_found(condition, charges) -> None:
    problem = sphere(Signorini(), condition, potentials=(0.0, 0.0))
    modes = zip((VOLTAGE, MAGNETOMOTIVE), charges, strict=True)
    floating = replace(problem, freedoms=tuple(freedom(problem.system, mode, total) for mode, total in modes))
    for solver in ALL:
        state = solved(floating, solver).state
        held = replace(problem, potentials=np.tile(state.motion, (len(problem.gap), 1)))
        again = solved(held, Uzawa(), start=replace(state, load=1.001 * state.load, motion=np.zeros(0))).state
        assert_same(state, again)
        totals = problem.system.weights @ again.load[:, 3:]
        assert (np.abs(totals - charges) <= 1e-8 * (problem.system.weights @ np.abs(again.load[:, 3:]))).all()


@pytest.mark.parametrize("kappa", ["finite", "perfect"])
def test_eliminated_potentials_are_those_of_the_whole_system(kappa) -> None:
    """Fluxes and floating potentials as unknowns of one linear system, for tractions that are given."""
    problem = sphere(IsotropicCoulomb(MU), kappa, cells=6)
    system, n = problem.system, len(problem.gap)
    free = freedom(system, VOLTAGE, 1e-8), freedom(system, PRESS, 1.0), freedom(system, MAGNETOMOTIVE, -3e-9)
    problem = replace(problem, freedoms=free)
    random = np.random.default_rng(1)
    load = np.zeros((n, 5))
    load[:, :3] = 1e6 * random.normal(size=(n, 3))
    closed = (random.uniform(size=n) > 0.4).astype(float)
    resistance = resistances(problem, -np.ones(n), closed, own_response(problem))
    pairs = np.flatnonzero(np.column_stack([np.zeros((n, 3), bool), np.isfinite(resistance)]))
    matrix = system.dense().reshape(5 * n, 5 * n)
    scale = np.tile(np.diag(matrix)[:5] ** -0.5, n)[pairs]
    modes = np.stack([f.mode.ravel()[pairs] for f in (free[0], free[2])], axis=1)
    measures = np.stack([f.measure.ravel()[pairs] for f in (free[0], free[2])])
    unit = 1.0 / np.abs(scale[:, None] * modes).max(axis=0)
    k = len(pairs)
    whole = np.zeros((k + 2, k + 2))
    resist = np.diag(np.column_stack([np.zeros((n, 3)), resistance]).ravel()[pairs])
    whole[:k, :k] = scale[:, None] * (matrix[np.ix_(pairs, pairs)] + resist) * scale
    whole[:k, k:] = -scale[:, None] * modes * unit
    whole[k:, :k] = measures * scale / np.abs(measures * scale).max(axis=1, keepdims=True)
    potential = np.column_stack([np.zeros((n, 3)), -problem.potentials]).ravel() - matrix @ load.ravel()
    totals = np.array([free[0].total, free[2].total]) / np.abs(measures * scale).max(axis=1)
    unknown = np.linalg.solve(whole, np.concatenate([scale * potential[pairs], totals]))
    flux = np.zeros((n, 5))
    flux.flat[pairs] = scale * unknown[:k]
    for elimination in (eliminate(problem), KrylovElimination(problem)):
        conductors = elimination.prepare(resistance, None)
        response = elimination.respond(load[:, :3], conductors, np.zeros((n, 2)))
        found = response.flux + conductors.flux
        assert (np.abs(found - flux[:, 3:]).max(axis=0) <= 1e-9 * np.abs(flux[:, 3:]).max(axis=0)).all()
        assert conductors.potential + response.potential == pytest.approx(unit * unknown[k:], rel=1e-9)
        assert list(conductors.floating.numbers) == [0, 2]


@pytest.mark.parametrize("solver", ALL, ids=str)
def test_where_nothing_conducts_the_potential_stays_where_it_was(solver) -> None:
    problem = sphere(Signorini())
    start = ContactState(np.zeros((64, 5)), np.zeros((64, 5)), np.zeros(64), np.array([123.0]))
    floating = replace(problem, freedoms=(freedom(problem.system, VOLTAGE, 0.0),))
    assert solved(floating, solver, start=start).state.motion == [123.0]
    charged = replace(problem, freedoms=(freedom(problem.system, VOLTAGE, 1e-7),))
    assert solve(charged, solver, Limits(max_iterations=200), start).status is not Status.CONVERGED


@pytest.mark.parametrize("solver", ALL, ids=str)
def test_systems_without_a_matrix(solver) -> None:
    law = Signorini() if solver == ProjectedCG() else IsotropicCoulomb(MU)
    problem = sphere(law, "finite", cells=6)
    free = [freedom(problem.system, PRESS, 800.0), freedom(problem.system, VOLTAGE, 1e-7)]
    if law != Signorini():
        free.append(freedom(problem.system, SLIDE, 100.0))
    problem = replace(problem, freedoms=tuple(free))
    dense = solved(problem, solver, Limits())
    bare = solved(replace(problem, system=MatrixFree.of(problem.system)), solver, Limits())
    assert abs(bare.iterations - dense.iterations) <= solver.stride
    np.testing.assert_allclose(bare.state.motion, dense.state.motion, rtol=1e-8)
    np.testing.assert_allclose(
        bare.state.load[:, :3], dense.state.load[:, :3], atol=1e-8 * np.abs(dense.state.load).max()
    )


@pytest.mark.parametrize("solver", ALL, ids=str)
@pytest.mark.parametrize("lift", [1e-6, 1e-3, 0.1])
def test_a_lifted_indenter_is_brought_down(solver, lift) -> None:
    problem = sphere(Signorini())
    touching = replace(problem, gap=problem.gap + APPROACH, freedoms=(freedom(problem.system, PRESS, 500.0),))
    above = replace(touching, gap=touching.gap + lift)
    reference, found = solved(touching, solver, Limits()), solved(above, solver, Limits())
    assert found.state.motion == pytest.approx(reference.state.motion + lift, rel=1e-9)
    assert found.iterations <= reference.iterations + 2 * solver.stride


IMPOSSIBLE = {
    "more than friction carries": (IsotropicCoulomb(MU), (PRESS, 500.0), (SLIDE, 1.2 * MU * 500.0)),
    "tangential force without friction": (Signorini(), (PRESS, 500.0), (SLIDE, 50.0)),
    "pull": (Signorini(), (PRESS, -500.0)),
}


@pytest.mark.parametrize("name", IMPOSSIBLE)
@pytest.mark.parametrize("solver", ALL, ids=str)
def test_what_cannot_be_reached_does_not_converge(solver, name) -> None:
    law, *totals = IMPOSSIBLE[name]
    if law != Signorini() and solver == ProjectedCG():
        pytest.skip("frictionless contact only")
    problem = sphere(law, cells=6)
    free = tuple(freedom(problem.system, mode, total) for mode, total in totals)
    solution = solve(replace(problem, freedoms=free), solver, Limits(max_iterations=400, stall_window=60))
    assert solution.status not in (Status.CONVERGED, Status.DIVERGED)
    assert np.isfinite(solution.state.load).all()
    assert np.isfinite(solution.state.motion).all()
    assert solution.residual > 1e-4
    if name == "more than friction carries":
        force = resultant(problem.system, solution.state.load)[0]
        assert np.hypot(force[0], force[1]) <= -MU * force[2] * (1.0 + 1e-9)


@pytest.mark.parametrize("solver", ALL, ids=str)
@pytest.mark.parametrize("factors", [(1e-9, 1.0), (1.0, 1e9), (1e9, 1e-9)], ids=str)
@pytest.mark.parametrize("potentials", [False, True], ids=["all", "potentials"])
def test_units_do_not_matter(solver, factors, potentials) -> None:
    law = Signorini() if solver == ProjectedCG() else IsotropicCoulomb(MU)
    problem = sphere(law, "finite", cells=7)
    free = [freedom(problem.system, PRESS, 800.0), freedom(problem.system, VOLTAGE, 1e-7)]
    if law != Signorini():
        free.append(freedom(problem.system, SLIDE, 100.0))
    problem = replace(problem, freedoms=tuple(free))
    changed = np.array([not potentials] * 3 + [True] * 2)
    displacement, load = (np.where(changed, factor, 1.0) for factor in factors)
    plain = solved(problem, solver, Limits())
    other = solve(rescaled(problem, displacement, load), solver)
    assert other.status is Status.CONVERGED
    assert abs(other.iterations - plain.iterations) <= solver.stride
    size = np.abs(plain.state.load).max(axis=0)
    assert (np.abs(other.state.load / load - plain.state.load) <= 1e-8 * size).all()
    np.testing.assert_allclose(other.state.motion, plain.state.motion, rtol=1e-8)


def test_forces_cost_no_more_iterations_than_motions() -> None:
    problem = sphere(IsotropicCoulomb(MU), drag=0.4)
    expected = solved(problem, Uzawa()).state
    free, _ = released(problem, expected, "approach", "translation")
    for solver in GRADIENT:
        assert solved(free, solver).iterations <= solved(problem, solver).iterations + solver.stride


def test_conjugate_gradients_refuse_a_force_that_is_not_that_of_its_motion() -> None:
    problem = sphere(Signorini())
    ratio = freedom(problem.system, SLIDE, 0.0, measure=SLIDE - 0.1 * PRESS)
    with pytest.raises(CaseError, match=r"freedom 1 of the indenter.*weights \* mode"):
        solve(replace(problem, freedoms=(freedom(problem.system, PRESS, 500.0), ratio)), ProjectedCG())
