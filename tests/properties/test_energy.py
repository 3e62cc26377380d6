"""Test the energy balance over load paths, and the balance of actions and reactions on a block."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from meeframe.contact.problem import ContactProblem, Status, resultant
from meeframe.elements import ELEMENTS, Quad4, Quad8
from meeframe.elements.base import SurfaceElement, shape_functions
from meeframe.fields import Array
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.laws import OrthotropicCoulomb
from meeframe.material import library_material, rotation_about
from meeframe.mesh import block_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.measures import VOLUME_ORDER, gauss_rule, normal_vectors
from meeframe.solvers import Auto, solve
from meeframe.system.reduced import NodalFields
from meeframe.testing.contact_cases import periodic_half_space
from meeframe.testing.half_space import indentation_problem
from meeframe.testing.load_path import Position, follow

MATERIAL = library_material("orthotropic-mee")
APPROACH = 3e-5


def cycle(seed: int, mu: tuple[float, float], increments: int) -> tuple[Array, Array, Array]:
    """Return dissipation of each step and node (steps, n), the indenter's work in each step (steps,), and the last
    tractions (n, 3), along a path of approach and translation from first contact to separation."""
    random = np.random.default_rng(seed)
    rotated = MATERIAL.rotated(rotation_about(tuple(random.normal(size=3)), random.uniform(0.0, 6.0)))
    system = periodic_half_space(rotated, 5e-3, 7)
    x, y, _ = system.points.T
    height = 5.0 * x**2 + 8.0 * y**2 + 1e-6 * random.uniform(size=len(x))
    corners = np.concatenate([np.zeros((1, 3)), random.uniform(-1.0, 1.0, (4, 3)), np.zeros((1, 3))]) * APPROACH
    corners[1:, 0] = APPROACH * np.append(random.uniform(0.3, 1.0, 4), -0.01)
    shares = np.arange(1, increments + 1)[:, None] / increments
    path = np.concatenate([a + shares * (b - a) for a, b in pairwise(corners)])
    positions = [Position(height - height.min() - d[0], np.tile(d[1:], (len(x), 1))) for d in path]
    dissipation, work, before = [], [], Position(height - height.min(), np.zeros((len(x), 2)))
    for position, step in zip(positions, follow(system, OrthotropicCoulomb(*mu, 0.4), positions), strict=True):
        load = step.state.load
        dissipation.append(system.weights * (load[:, :2] * step.slip).sum(axis=1))
        moved = np.column_stack([position.translation - before.translation, position.gap - before.gap])
        work.append(float(system.weights @ (load[:, :3] * moved).sum(axis=1)))
        before = position
    return np.array(dissipation), np.array(work), load[:, :3]


MU = st.floats(0.05, 2.0)


@settings(max_examples=6, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(st.integers(0, 2**32 - 1), st.tuples(MU, MU))
def test_slip_dissipates_at_every_node_in_every_step(seed: int, mu: tuple[float, float]) -> None:
    """Over the cycle, the work of the indenter is at least the energy that slip dissipates."""
    dissipation, work, left = cycle(seed, mu, 2)
    scale = np.abs(work).sum()
    assert dissipation.min() >= -1e-9 * scale
    assert dissipation.sum() > 1e-4 * scale
    assert work.sum() >= dissipation.sum() - 1e-9 * scale
    assert np.abs(left).max() < 1.0  # Pa; pressures are near 1e7


@pytest.mark.full
def test_work_over_a_cycle_converges_to_dissipation() -> None:
    excess = []
    for increments in (4, 8, 16):
        dissipation, work, _ = cycle(7, (0.2, 0.6), increments)
        excess.append((work.sum() - dissipation.sum()) / np.abs(work).sum())
    assert excess[0] > excess[1] > excess[2] > 0.0
    assert abs(2.0 * excess[2] - excess[1]) < 0.05 * excess[0]  # of first order in the increment


def integral(fields: NodalFields) -> Array:
    """Return the integral of the extended tractions over the whole boundary, (5,)."""
    by_type = {element.meshio_type: element for element in ELEMENTS.values()}
    total = np.zeros(5)
    for kind, connectivity in fields.cells:
        element = by_type[kind]
        xi, weights = gauss_rule(element.reference, VOLUME_ORDER)
        areas = np.linalg.norm(normal_vectors(fields.points, element, connectivity, xi), axis=-1) * weights
        total += np.einsum("eq,qa,eaJ->J", areas, shape_functions(element, xi), fields.fluxes[connectivity])
    return total


def imbalance(element: SurfaceElement, divisions: int, rings: int, layers: int) -> Array:
    """Return the resultants of force, charge and flux on a block clamped at its base, relative to those of the
    contact, (3,)."""
    mesh = block_mesh(0.02, 0.03, 0.01, divisions, rings, layers, element)
    base = tuple(BoundaryCondition("base", field, "value") for field in range(5))
    system = DenseBEM(quadrature_tolerance=1e-4).reduce(Body(MATERIAL.stiffness, mesh, base, "contact"))
    height = (system.points[:, :2] ** 2).sum(axis=1) / 0.2
    law, perfect = OrthotropicCoulomb(0.2, 0.5, 0.3), (np.inf, np.inf)
    problem = indentation_problem(system, height, 8e-5, law, perfect, (1e3, -1.0), (2e-5, 1e-5))
    load = _solved(problem)
    force, (charge, flux) = resultant(system, load)
    assert np.abs(force).min() > 0.05 * np.linalg.norm(force), "all components act"
    total = integral(system.recover(load))
    return np.abs([np.linalg.norm(total[:3]) / np.linalg.norm(force), total[3] / charge, total[4] / flux])


def _solved(problem: ContactProblem) -> Array:
    solution = solve(problem, Auto())
    assert solution.status is Status.CONVERGED, solution.message
    return solution.state.load


@pytest.mark.full
def test_action_and_reaction_balance_up_to_discretisation() -> None:
    """Force, charge and magnetic flux of contact and supports balance, increasingly so on finer meshes."""
    coarse, fine = imbalance(Quad4(), 4, 2, 1), imbalance(Quad4(), 6, 4, 3)
    assert (fine < 0.6 * coarse).all()
    assert (fine < [0.005, 0.04, 0.04]).all()


@pytest.mark.full
def test_action_and_reaction_balance_better_on_quadratic_elements() -> None:
    assert (imbalance(Quad8(), 4, 3, 2) < [0.01, 0.005, 0.005]).all()
