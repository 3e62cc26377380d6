"""Test coarser grids, products in chosen fields, preconditioning and nested grids of half spaces."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace, SelfAffine
from meeframe_halfspace.system import dense_matrix

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, PrescribedResultant, Status
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.laws import Insulating, Signorini
from meeframe.material import Material, library_material, rotation_about
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import ProjectedCG, StoppingCriteria, residual, solve
from meeframe.system.capabilities import apply_load
from meeframe.system.reduced import ReducedSystem
from meeframe.system.rotated import rotate_frames
from meeframe.system.two_body import combine_bodies
from meeframe.testing.closed_forms_friction import contact_modulus
from meeframe.testing.matrix_free import MatrixFree

YOUNG, POISSON = 200e9, 0.3
MODULUS = contact_modulus(YOUNG, POISSON)
ISOTROPIC = Material.isotropic(YOUNG, POISSON).stiffness
ANISOTROPIC = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
WIDTH, RADIUS, CONTACT = 1e-2, 0.1, 3e-3
FORCE = 4.0 * MODULUS * CONTACT**3 / (3.0 * RADIUS)
GRIDS = [
    (HalfSpace(matrix_up_to=0), (63, 80)),
    (HalfSpace("constant", matrix_up_to=0), (64, 69)),
    (HalfSpace("trigonometric", periodic=True, matrix_up_to=0), (63, 79)),
]


def system_of(formulation: HalfSpace, divisions: tuple[int, int], stiffness: Array = ANISOTROPIC) -> ReducedSystem:
    width = tuple(WIDTH * count / divisions[0] for count in divisions)
    mesh = half_space_mesh(10.0 * max(width), width, divisions, 1, Quad4())  # type: ignore[arg-type]
    return formulation.reduce(Body(stiffness, mesh, (), "contact"))


def random_load(system: ReducedSystem) -> Array:
    compliance = np.abs(system.diagonal_blocks()[len(system.points) // 2])
    return np.random.default_rng(3).normal(size=system.offset.shape) / np.sqrt(np.diag(compliance))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("formulation", "divisions"), GRIDS)
def test_coarse_system_converges_with_second_order(formulation: HalfSpace, divisions: tuple[int, int]) -> None:
    """A smooth load on every second node causes nearly the same displacement as its interpolation on the fine grid."""
    errors = []
    for refined in (1, 2):
        fine = system_of(formulation, tuple(refined * (count + 1) - 1 for count in divisions))  # type: ignore[arg-type]
        coarse = fine.coarsen()
        assert coarse is not None
        np.testing.assert_array_equal(coarse.system.points, fine.points[coarse.nodes])
        position = coarse.system.points[:, :2] / np.ptp(fine.points[:, :2], axis=0)
        unit = 1.0 / np.sqrt(np.abs(np.diagonal(fine.diagonal_blocks()[0])))
        bump = np.where((np.abs(position) < 0.45).all(axis=1), np.cos(position / 0.9 * np.pi).prod(axis=1) ** 4, 0.0)
        load = bump[:, None] * unit
        expected = fine.apply(coarse.prolong(load))[coarse.nodes]
        errors.append((np.abs(coarse.system.apply(load) - expected) / np.abs(expected).max(axis=0)).max())
        np.testing.assert_allclose(coarse.prolong(load)[coarse.nodes], load, rtol=1e-15)
        assert fine.weights @ coarse.prolong(load) == pytest.approx(coarse.system.weights @ load, rel=1e-12)
    assert errors[1] < max(0.3 * errors[0], 1e-12)  # bilinear densities agree exactly
    assert errors[0] < 0.03


@pytest.mark.parametrize("density", ["bilinear", "constant"])
def test_coarse_system_equals_system_of_coarser_mesh(density: Literal["bilinear", "constant"]) -> None:
    """A grid of 65 x 81 nodes is coarsened to 33 x 41 nodes."""
    fine = system_of(HalfSpace(density, matrix_up_to=0), (64, 80))
    made = system_of(HalfSpace(density, matrix_up_to=0), (32, 40))
    coarse = fine.coarsen()
    assert coarse is not None
    order, other = (np.lexsort(np.round(s.points[:, :2] / WIDTH, 9).T) for s in (coarse.system, made))
    load = random_load(made)
    moved = np.empty_like(load)
    moved[order] = load[other]
    expected = made.apply(load)
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(coarse.system.apply(moved)[order] - expected[other]) / scale).max() < 1e-12
    np.testing.assert_allclose(coarse.system.weights[order], made.weights[other], rtol=1e-12)
    blocks, compliance = coarse.system.diagonal_blocks()[order], made.diagonal_blocks()[other]
    np.testing.assert_allclose(blocks, compliance, rtol=1e-12, atol=1e-12 * np.abs(compliance).min(axis=0).max())


@pytest.mark.parametrize("fields", [(2,), (0, 1), (4, 1), (0, 1, 2, 3, 4)])
def test_products_in_chosen_fields_match_matrix(fields: tuple[int, ...]) -> None:
    """Half spaces, rotated frames and two bodies are compared with their matrices."""
    system = system_of(HalfSpace(matrix_up_to=0), (9, 6))
    directions = np.tile([np.cos(0.4), np.sin(0.4), 0.0], (len(system.points), 1))
    load = random_load(system)
    load[:, 0] = 0.0
    expected = np.tensordot(dense_matrix(system), load, 2)
    scale = np.abs(expected).max(axis=0)[list(fields)]
    assert (np.abs(apply_load(system, load, fields) - expected[:, list(fields)]) / scale).max() < 1e-12
    for whole, plain in (
        (rotate_frames(system, directions), rotate_frames(MatrixFree.of(system), directions)),
        (combine_bodies(system, system), combine_bodies(MatrixFree.of(system), MatrixFree.of(system))),
    ):
        expected = plain.apply(load)[:, list(fields)]
        assert (np.abs(apply_load(whole, load, fields) - expected) / np.abs(expected).max(axis=0)).max() < 1e-12


def contact(system: ReducedSystem, gap: Array, force: float) -> ContactProblem:
    press = np.zeros((len(gap), 5))
    press[:, 2] = -1.0
    resultant = PrescribedResultant(press, press, system.weights, force)
    none = np.zeros((len(gap), 2))
    return ContactProblem(system, Signorini(), flux_channels(Insulating(), Insulating()), gap, none, none, (resultant,))


def hertz(n: int) -> ContactProblem:
    system = system_of(HalfSpace(matrix_up_to=0), (n - 1, n - 1), ISOTROPIC)
    return contact(system, (system.points[:, :2] ** 2).sum(axis=1) / (2.0 * RADIUS), FORCE)


def test_hertz_iterations_nearly_independent_of_grid() -> None:
    errors, steps = [], []
    for n in (64, 128, 256):
        solution = solve(hertz(n), ProjectedCG(), StoppingCriteria(tolerance=1e-10))
        assert solution.status is Status.CONVERGED
        errors.append(abs(float(solution.state.motion[0]) / (CONTACT**2 / RADIUS) - 1.0))
        steps.append(solution.iterations)
    assert errors[-1] < 3e-5
    assert errors[0] > 4.0 * errors[1] > 12.0 * errors[2]  # converges to the closed form, faster than the spacing
    assert max(steps) < 1.3 * min(steps) < 26.0


@pytest.mark.full
def test_steps_on_surface_rougher_than_grid_do_not_cycle() -> None:
    """Every eighth height of 4096 x 4096, with waves down to a spacing: steps that raise the energy would cycle."""
    n, fine = 512, 4096
    system = system_of(HalfSpace("trigonometric", periodic=True, matrix_up_to=0), (n - 1, n - 1), ISOTROPIC)
    rough = SelfAffine(WIDTH, 8 * WIDTH / fine, 0.8, rms_slope=0.1, roll_off=WIDTH / 2, seed=11, samples=fine)
    heights = rough.surface()[:: fine // n, :: fine // n]
    problem = contact(system, (heights - heights.min()).ravel(), 0.004 * MODULUS * WIDTH**2)
    solution = solve(problem, ProjectedCG(), StoppingCriteria(tolerance=1e-10))
    assert solution.status is Status.CONVERGED
    assert solution.iterations < 30


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("periodic", [False, True])
def test_preconditioner_and_nested_grids_do_not_change_solution(periodic: bool) -> None:
    """Rough contact: the pressures are the same without preconditioner and nested grids."""
    n = 96
    formulation = HalfSpace("trigonometric" if periodic else "constant", periodic=periodic, matrix_up_to=0)
    system = system_of(formulation, (n - 1, n - 1), ANISOTROPIC)
    heights = SelfAffine(WIDTH, 8 * WIDTH / n, 0.8, rms_slope=0.1, roll_off=WIDTH / 2, seed=5, samples=n).surface()
    gap = np.empty(n * n)
    gap[np.lexsort((system.points[:, 1], system.points[:, 0]))] = (heights - heights.min()).ravel()
    problem = contact(system, gap, 0.004 * MODULUS * WIDTH**2)
    fast = solve(problem, ProjectedCG(), StoppingCriteria(tolerance=1e-11))
    slow = solve(replace(problem, system=MatrixFree.of(system)), ProjectedCG(), StoppingCriteria(tolerance=1e-11))
    assert fast.status is slow.status is Status.CONVERGED
    pressures = [-solution.state.load[:, 2] for solution in (fast, slow)]
    assert np.abs(pressures[0] - pressures[1]).max() < 1e-8 * pressures[1].max()
    assert fast.state.motion == pytest.approx(slow.state.motion, rel=1e-10)
    # the independent residual evaluates large problems on a coarser grid, and the state unchanged
    for state in (fast.state, slow.state):
        assert residual(replace(problem, system=MatrixFree.of(system)), state) < 1e-10
