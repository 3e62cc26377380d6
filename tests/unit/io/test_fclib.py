"""FCLIB problems: solutions agree with closed forms and with a Gauss-Seidel iteration on W, q and mu; round trips."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import PrescribedResultant, Status
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.results.fclib import (
    MAX_CONTACTS,
    LocalProblem,
    check_size,
    natural_residual,
    project_on_cones,
    read_local,
    read_solution,
    write_local,
    write_solution,
)
from meeframe.results.fclib_contact import (
    contact_problem,
    contacts,
    local_problem,
    local_solution,
    reactions,
    solve_local,
)
from meeframe.solvers import Auto, BarzilaiBorwein, ProjectedCG, SemismoothNewton, Uzawa, residual, solve
from meeframe.testing.elastic_half_space import elastic_half_space
from meeframe.testing.half_space import indentation_problem
from meeframe.testing.matrix_free import MatrixFree

SIDE, CELLS, RADIUS, APPROACH = 5e-3, 6, 0.1, 3e-5
SYSTEM = elastic_half_space(210e9, 0.3, SIDE, CELLS)
HEIGHT = (SYSTEM.points**2).sum(axis=1) / (2 * RADIUS)


def pressed_sphere(law=None, translation=(2e-6, 1e-6), system=SYSTEM, **more):
    return indentation_problem(system, HEIGHT, APPROACH, law or IsotropicCoulomb(0.3), translation=translation, **more)


def coupled_system():
    """Return the elastic half space with potentials that depend on pressures and charges."""
    matrix = SYSTEM.matrix.copy()
    normal = matrix[:, 2, :, 2]
    size = np.array([1.0, 2e-3, 3e-6])  # magnitude of a field of the unit cell, in units of the displacement
    strength = np.array([[1.0, 0.3, 0.2], [0.3, 1.0, 0.1], [0.2, 0.1, 1.0]])
    for i, j in np.ndindex(3, 3):
        if i or j:
            matrix[:, 2 + i, :, 2 + j] = strength[i, j] * normal / (size[i] * size[j])
    offset = np.zeros((len(normal), 5))
    offset[:, :3] = 1e-7
    offset[:, 3] = 1e-3
    return replace(SYSTEM, matrix=matrix, offset=offset)


def gauss_seidel(w, q, mu, sweeps, tolerance):
    """Solve by nonsmooth Gauss-Seidel (Jean, Moreau): contact by contact, with projections onto its cone."""
    r = np.zeros(len(q))
    for _ in range(sweeps):
        moved = 0.0
        for c in range(len(mu)):
            k = 3 * c
            own = w[k : k + 3, k : k + 3]
            free = w[k : k + 3] @ r + q[k : k + 3] - own @ r[k : k + 3]
            rho = 1.0 / np.trace(own)
            here, before = r[k : k + 3].copy(), r[k : k + 3].copy()
            for _ in range(500):
                u = own @ here + free
                u[0] += mu[c] * np.hypot(u[1], u[2])
                new = here - rho * u
                t = np.hypot(new[1], new[2])
                if mu[c] * t <= -new[0]:
                    new[:] = 0.0
                elif t > mu[c] * new[0]:
                    new[0] = (mu[c] * t + new[0]) / (1.0 + mu[c] ** 2)
                    new[1:] *= mu[c] * new[0] / t
                change = np.abs(new - here).max()
                here = new
                if change <= 1e-15 * np.abs(here).max():
                    break
            r[k : k + 3] = here
            moved = max(moved, np.abs(here - before).max())
        if moved <= tolerance * np.abs(r).max():
            break
    return r


def by_gauss_seidel(local):
    return gauss_seidel(np.ascontiguousarray(local.matrix), local.q, local.mu, 20_000, 1e-13)


def differ(computed, expected):
    return np.abs(computed - expected).max() / np.abs(expected).max()


ONE = np.diag([2.0, 1.0, 1.0])
BY_HAND = {
    "open": ([1.0, 3.0, -4.0], 0.3, [0, 0, 0], [1.0, 3.0, -4.0]),
    "stick": ([-1.0, 0.1, -0.05], 0.3, [0.5, -0.1, 0.05], [0, 0, 0]),
    "slip": ([-1.0, 0.6, 0.8], 0.3, [0.5, -0.09, -0.12], [0, 0.51, 0.68]),
    "without friction": ([-1.0, 0.6, 0.8], 0.0, [0.5, 0, 0], [0, 0.6, 0.8]),
}


@pytest.mark.parametrize("name", BY_HAND)
@pytest.mark.parametrize("solver", [Auto(), SemismoothNewton(), BarzilaiBorwein()], ids=lambda s: type(s).__name__)
def test_one_contact_in_closed_form(name, solver):
    q, mu, r, u = BY_HAND[name]
    local = LocalProblem(ONE, np.array(q), np.array([mu]))
    solution, computed = solve_local(local, solver)
    assert computed.status is Status.CONVERGED
    np.testing.assert_allclose(solution.r, r, atol=1e-9)
    np.testing.assert_allclose(solution.u, u, atol=1e-9)
    assert natural_residual(local, np.array(r)) < 1e-14
    assert natural_residual(local, np.array(r) + np.array([0.01, 0.0, 0.0])) > 1e-3
    np.testing.assert_allclose(by_gauss_seidel(local), r, atol=1e-12)


def test_frictionless_solver_is_rejected():
    q, mu, _, _ = BY_HAND["slip"]
    with pytest.raises(CaseError, match=r"solver 'projected-cg' takes frictionless contact only, .* not IsotropicCoul"):
        solve_local(LocalProblem(ONE, np.array(q), np.array([mu])), ProjectedCG())
    solution, _ = solve_local(LocalProblem(ONE, np.array(q), np.zeros(1)), ProjectedCG())
    np.testing.assert_allclose(solution.r, BY_HAND["without friction"][2], atol=1e-9)


def test_contacts_with_different_coefficients():
    rng = np.random.default_rng(5)
    root = rng.normal(size=(12, 12))
    matrix = root @ root.T + 12 * np.eye(12) + 0.5 * (root - root.T)  # unsymmetric and definite
    local = LocalProblem(matrix, rng.normal(size=12) - np.tile([4.0, 0, 0], 4), np.array([0.4, 0.0, 0.1, 0.7]))
    solution, computed = solve_local(local, Auto())
    assert computed.status is Status.CONVERGED
    assert differ(solution.r, by_gauss_seidel(local)) < 1e-9
    assert natural_residual(local, solution.r) < 1e-9
    assert not solution.r[4:6].any()
    np.testing.assert_allclose(solution.u, matrix @ solution.r + local.q)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", [Auto(), BarzilaiBorwein()], ids=lambda s: type(s).__name__)
def test_more_contacts_than_degrees_of_freedom(solver):
    """W is singular and reactions are not unique, as for stacks of rigid bodies, but the laws hold."""
    rng = np.random.default_rng(3)
    shape = rng.normal(size=(30, 75))
    local = LocalProblem(shape.T @ shape, rng.normal(size=75) - np.tile([3.0, 0, 0], 25), np.full(25, 0.5))
    solution, computed = solve_local(local, solver)
    assert computed.status is Status.CONVERGED
    assert natural_residual(local, solution.r) < 1e-9
    r, u = solution.r.reshape(-1, 3), solution.u.reshape(-1, 3)
    size = np.abs(r).max() * np.abs(u).max()
    assert np.abs(r[:, 0] * u[:, 0]).max() < 1e-9 * size
    work = (r[:, 1:] * u[:, 1:]).sum(axis=1)  # friction is at its limit
    np.testing.assert_allclose(work, -0.5 * r[:, 0] * np.hypot(u[:, 1], u[:, 2]), atol=1e-8 * size)


def test_contacts_on_one_rigid_body():
    """Four contacts move together: W is exactly singular, and half of the weight sticks. Warnings are errors here."""
    local = LocalProblem(np.kron(np.ones((4, 4)), np.eye(3)), np.tile([-1.0, 0.2, 0.0], 4), np.full(4, 0.5))
    solution, computed = solve_local(local, Auto())
    assert computed.status is Status.CONVERGED
    np.testing.assert_allclose(solution.r.reshape(4, 3).sum(axis=0), [1.0, -0.2, 0.0], atol=1e-9)
    np.testing.assert_allclose(solution.u, 0.0, atol=1e-9)


def test_contacts_without_friction_have_no_tangential_force():
    """The tangential diagonal of W is replaced by the compliance of the contact."""
    matrix = np.diag([2.0, 1.0, 1.0, 2.0, 1.0, 1.0])
    local = LocalProblem(matrix, np.tile([-1.0, 0.1, 0.0], 2), np.array([0.0, 0.5]))
    before = local.matrix.copy()
    solution, _ = solve_local(local, Auto())
    np.testing.assert_allclose(solution.r, [0.5, 0, 0, 0.5, -0.1, 0], atol=1e-9)
    np.testing.assert_array_equal(local.matrix, before)


def test_projection_onto_cones_is_the_nearest_point():
    rng = np.random.default_rng(6)
    points, mu = rng.normal(size=(200, 3)), rng.uniform(0.0, 2.0, 200) * (np.arange(200) > 5)
    computed = project_on_cones(points, mu)
    assert (np.linalg.norm(computed[:, 1:], axis=1) <= mu * computed[:, 0] * (1 + 1e-12) + 1e-15).all()
    direction = rng.uniform(0.0, 2 * np.pi, (200, 500))
    height = rng.uniform(0.0, 3.0, (200, 500))
    reach = mu[:, None] * height * rng.uniform(0.0, 1.0, (200, 500))
    others = np.stack([height, reach * np.cos(direction), reach * np.sin(direction)], axis=-1)
    # of a convex set: all other points lie on one side of the plane through the nearest point
    assert (np.einsum("nk,npk->np", points - computed, others - computed[:, None]) < 1e-12).all()


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(0.3), IsotropicCoulomb(0.8)], ids=str)
def test_gauss_seidel_on_the_file_agrees(law, tmp_path):
    problem = pressed_sphere(law)
    ours = solve(problem, SemismoothNewton())
    assert ours.status is Status.CONVERGED
    local, expected = local_problem(problem), local_solution(problem, ours.state)
    pressing = expected.r[::3] > 0
    sticking = pressing & (np.hypot(expected.u[1::3], expected.u[2::3]) < 1e-12)
    assert 0 < pressing.sum() < len(pressing)
    assert sticking.any() == (law != Signorini())
    assert differ(by_gauss_seidel(local), expected.r) < 1e-8
    assert differ(local.matrix @ expected.r + local.q, expected.u) < 1e-12
    assert natural_residual(local, expected.r) < 1e-8


def test_slip_and_friction_are_opposite():
    problem = pressed_sphere(translation=(5e-5, 0.0))
    local = local_solution(problem, solve(problem, Auto()).state)
    pressing = local.r[::3] > 0
    r, u = (part.reshape(-1, 3)[pressing] for part in (local.r, local.u))
    assert (u[:, 1] > 0).all()  # the indenter moves farther than the body ...
    assert (r[:, 1] < 0).all()  # ... and pulls it along: -r is the force on the body
    np.testing.assert_allclose(np.hypot(r[:, 1], r[:, 2]), 0.3 * r[:, 0], rtol=1e-7)


def test_nodes_without_indenter_are_excluded():
    problem = pressed_sphere()
    gap = np.where(problem.gap > 0, np.inf, problem.gap)
    problem = replace(problem, gap=gap)
    local = local_problem(problem)
    assert len(local.mu) == len(contacts(problem)) == np.isfinite(gap).sum() < len(gap)
    ours = local_solution(problem, solve(problem, Auto()).state)
    assert differ(by_gauss_seidel(local), ours.r) < 1e-8


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("kappa", [(np.inf, 0.0), (0.0, 0.5), (2.0, np.inf)])
def test_potentials_are_eliminated_with_the_resistances_of_the_state(kappa):
    system = coupled_system()
    kappa = tuple(k and k * 0.1 / own for k, own in zip(kappa, system.matrix[0, [3, 4], 0, [3, 4]], strict=True))
    problem = pressed_sphere(IsotropicCoulomb(0.3), system=system, conductivity=kappa, potentials=(5e-3, -0.2))
    with pytest.raises(CaseError, match="conducts; allowed: insulating laws, or a state"):
        local_problem(problem)
    computed = solve(problem, Auto())
    assert computed.status is Status.CONVERGED
    assert np.abs(computed.state.load[:, 3:]).max() > 0
    local, expected = local_problem(problem, computed.state), local_solution(problem, computed.state)
    assert differ(local.matrix @ expected.r + local.q, expected.u) < 1e-9
    assert differ(by_gauss_seidel(local), expected.r) < 1e-8
    insulated = local_problem(replace(problem, channels=flux_channels(StepConductivity(0), StepConductivity(0))))
    assert differ(local.matrix, insulated.matrix) > 1e-3


def test_free_motions_are_fixed_at_the_state():
    mode = np.zeros((CELLS**2, 5))
    mode[:, 2] = -1.0
    resultant = PrescribedResultant(mode, mode, SYSTEM.weights, 2000.0)
    problem = replace(pressed_sphere(translation=(0.0, 0.0)), prescribed_resultants=(resultant,))
    with pytest.raises(CaseError, match="1 motions or potentials of the indenter are free"):
        local_problem(problem)
    computed = solve(problem, Auto())
    assert abs(computed.state.motion[0]) > 1e-7
    local, expected = local_problem(problem, computed.state), local_solution(problem, computed.state)
    assert expected.r[::3].sum() == pytest.approx(2000.0, rel=1e-8)
    assert differ(by_gauss_seidel(local), expected.r) < 1e-8


@pytest.mark.parametrize("solver", [Auto(), BarzilaiBorwein(), Uzawa()], ids=lambda s: type(s).__name__)
def test_round_trip(solver, tmp_path):
    problem = pressed_sphere()
    ours = local_solution(problem, solve(problem, Auto()).state)
    local = local_problem(problem, title="sphere, µ = 0.3", description="pressed")
    path = tmp_path / "sphere.hdf5"
    write_local(path, local, ours)
    again, stored = read_local(path), read_solution(path)
    for name in ("matrix", "q", "mu", "title", "description", "math_info"):
        assert np.array_equal(getattr(again, name), getattr(local, name)), name
    assert np.array_equal(stored.u, ours.u)
    assert np.array_equal(stored.r, ours.r)
    solution, computed = solve_local(again, solver)
    assert computed.status is Status.CONVERGED
    assert differ(solution.r, ours.r) < 1e-8
    assert differ(solution.u, ours.u) < 1e-8
    imported = contact_problem(again)
    assert residual(imported, computed.state) < 1e-9
    np.testing.assert_array_equal(reactions(again, computed.state).r, solution.r)
    write_solution(path, solution)
    np.testing.assert_array_equal(read_solution(path).r, solution.r)
    np.testing.assert_array_equal(read_local(path).matrix, local.matrix)


@pytest.mark.parametrize("law", [OrthotropicCoulomb(0.2, 0.4), IsotropicCoulomb(np.inf)], ids=str)
def test_laws_outside_the_fclib_format_are_rejected(law):
    with pytest.raises(CaseError, match=r"FCLIB: contact law .* allowed: contact without friction, or isotropic"):
        local_problem(pressed_sphere(law))


def test_orthotropic_law_with_equal_coefficients_is_isotropic():
    assert np.array_equal(local_problem(pressed_sphere(OrthotropicCoulomb(0.4, 0.4))).mu, np.full(CELLS**2, 0.4))


def test_matrix_free_compliance_is_rejected():
    with pytest.raises(CaseError, match="not stored as a matrix"):
        local_problem(pressed_sphere(system=MatrixFree.of(SYSTEM)))


def test_unsupported_problems_are_rejected():
    with pytest.raises(CaseError, match=r"W \(3, 3\), q \(3,\), mu \(2,\)"):
        LocalProblem(ONE, np.zeros(3), np.zeros(2))
    with pytest.raises(CaseError, match="allowed: 1 to"):
        check_size(MAX_CONTACTS + 1)
    for diagonal in (0.0, -1.0):
        with pytest.raises(
            CaseError, match=rf"W of the FCLIB problem has {diagonal} on its diagonal at contact 1; allow"
        ):
            LocalProblem(np.diag([1.0, 1, 1, 1, diagonal, 1]), np.zeros(6), np.zeros(2))
    local = LocalProblem(ONE, np.zeros(3), np.zeros(1))
    with pytest.raises(CaseError, match="has no body"):
        contact_problem(local).system.recover(np.zeros((1, 5)))
