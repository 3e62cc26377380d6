"""Two deformable bodies agree with Hertz, closed forms of joined half spaces, and themselves after an exchange of
roles."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from meeframe.common.errors import MeshError
from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, ContactState, Status, resultant
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ContactLaw
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.mesh import half_space_mesh, local_frames
from meeframe.mesh.body import Body
from meeframe.solvers import Auto, StoppingCriteria, solve
from meeframe.system.composed import ComposedSystem
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import NodalFields, ReducedSystem
from meeframe.system.two_body import combine_bodies, match_nodes, second_displacement, second_load
from meeframe.testing.closed_forms import CONDITIONS, Sphere, indent
from meeframe.testing.contact_cases import periodic_half_space
from meeframe.testing.half_space import half_space_system, indentation_problem
from meeframe.testing.matrix_free import MatrixFree

RADIUS, APPROACH, SIDE = 0.1, 5e-5, 5e-3
TRANSVERSE, ORTHOTROPIC = library_material("batio3-cofe2o4"), library_material("orthotropic-mee")
STEEL = Material.isotropic(210e9, 0.3)
TURN = np.diag([1.0, -1.0, -1.0])
POLED_UP, POLED_DOWN = TRANSVERSE, TRANSVERSE.rotated(TURN)


def solve_converged(problem: ContactProblem, tolerance: float = 1e-11) -> ContactState:
    solution = solve(problem, Auto(), StoppingCriteria(tolerance=tolerance))
    assert solution.status is Status.CONVERGED, solution.message
    return solution.state


def sphere(system: ReducedSystem) -> Array:
    return (system.points[:, 0] ** 2 + system.points[:, 1] ** 2) / (2.0 * RADIUS)


# Hertz


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("second_body", [(210e9, 0.3), (40e9, 0.05)])
def test_two_elastic_spheres_match_hertz(second_body: tuple[float, float]) -> None:
    """Spheres of R1 = 0.3 m and R2 = 0.15 m have R = 0.1 m; 1/E* is the sum of both bodies."""
    (young, poisson), (other_young, other_poisson) = (210e9, 0.3), second_body
    xi, other = ([[(1.0 - nu**2) / (np.pi * e)]] for e, nu in ((young, poisson), second_body))
    system = combine_bodies(*(half_space_system(_normal_only(x), SIDE, 24) for x in (xi, other)))
    r_squared = system.points[:, 0] ** 2 + system.points[:, 1] ** 2
    height = r_squared / (2 * 0.3) + r_squared / (2 * 0.15)
    load = solve_converged(indentation_problem(system, height, APPROACH)).load
    e_star = 1.0 / ((1.0 - poisson**2) / young + (1.0 - other_poisson**2) / other_young)
    exact = 4.0 / 3.0 * e_star * np.sqrt(0.1 * APPROACH**3)
    assert -resultant(system, load)[0][2] == pytest.approx(exact, rel=1.5e-3)
    a = np.sqrt(0.1 * APPROACH)
    inside = r_squared < (0.9 * a) ** 2
    pressure = 2.0 * e_star * a / (np.pi * 0.1) * np.sqrt(1.0 - r_squared[inside] / a**2)
    assert np.abs(-load[inside, 2] - pressure).max() < 0.01 * pressure.max()


def _normal_only(xi: list[list[float]]) -> Array:
    return np.diag([xi[0][0], -1.0, -1.0])


@pytest.fixture(scope="module")
def steel() -> DenseSystem:
    return half_space_by_elements(STEEL)


def half_space_by_elements(material: Material) -> DenseSystem:
    mesh = half_space_mesh(0.1, SIDE, 10, 6, Quad4())
    system = DenseBEM().reduce(Body(material.stiffness, mesh, (), "contact"))
    assert isinstance(system, DenseSystem)
    return system


@pytest.mark.full
def test_equal_elastic_bodies_by_boundary_elements(steel: DenseSystem) -> None:
    """Hertz with half of E*. Equal bodies do not slip, so friction has no effect; under a rigid sphere there is
    slip."""
    both = combine_bodies(steel, steel)
    smooth, rough = (
        solve_converged(indentation_problem(both, sphere(both), APPROACH, law)).load
        for law in (Signorini(), IsotropicCoulomb(0.3))
    )
    exact = 4.0 / 3.0 * (210e9 / (1.0 - 0.3**2) / 2.0) * np.sqrt(RADIUS * APPROACH**3)
    assert -resultant(both, smooth)[0][2] == pytest.approx(exact, rel=0.015)
    largest = np.abs(smooth[:, 2]).max()
    assert np.abs(rough - smooth)[:, :3].max() < 1e-5 * largest
    rigid = solve_converged(indentation_problem(steel, sphere(steel), APPROACH, IsotropicCoulomb(0.3))).load
    assert np.abs(rigid[:, :2]).max() > 0.05 * largest


def test_equal_anisotropic_bodies_do_not_slip() -> None:
    """Orthotropic magneto-electro-elastic bodies, both poled up, are mirror images of each other in the interface."""
    body = periodic_half_space(ORTHOTROPIC, SIDE, 12)
    both = combine_bodies(body, body)
    smooth, rough = (
        solve_converged(indentation_problem(both, sphere(both), APPROACH, law)).load
        for law in (Signorini(), IsotropicCoulomb(0.3))
    )
    largest = np.abs(smooth[:, 2]).max()
    assert np.abs(rough - smooth)[:, :3].max() < 1e-8 * largest
    rigid = solve_converged(indentation_problem(body, sphere(body), APPROACH, IsotropicCoulomb(0.3))).load
    assert np.abs(rigid[:, :2]).max() > 0.05 * largest


@pytest.mark.full
def test_fields_of_both_bodies(steel: DenseSystem) -> None:
    """The recovered displacements of the bodies in the contact zone differ by the relative displacement, in global
    axes."""
    both = combine_bodies(steel, half_space_by_elements(Material.isotropic(40e9, 0.05)))
    load = solve_converged(indentation_problem(both, sphere(both), APPROACH, LAW, translation=(1e-5, 0.0))).load
    fields, second_body = both.recover(load), both.terms[1].system.recover(second_load(both, load))
    (_, own), (_, other) = (cKDTree(points).query(both.points) for points in (fields.points, second_body.points @ TURN))
    relative = fields.values[own, :3] - second_body.values[other, :3] @ TURN
    np.testing.assert_allclose(relative, (both.offset + both.apply(load))[:, :3], atol=1e-9 * APPROACH)


# potentials


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("condition", list(CONDITIONS))
def test_mirror_images_have_no_jump_of_the_potentials(condition: str) -> None:
    """Bodies poled towards the interface exchange no flux, and P is half of that under an insulating rigid sphere."""
    xi = axisymmetric_compliance(POLED_UP.stiffness)
    body = half_space_system(xi, SIDE, 20)
    both = combine_bodies(body, body)
    kappa = tuple(0.0 if potential is None else np.inf for potential in CONDITIONS[condition])
    state = solve_converged(indentation_problem(both, sphere(both), APPROACH, conductivity=kappa))
    assert -resultant(both, state.load)[0][2] == pytest.approx(indent(xi, Sphere(RADIUS), APPROACH).force / 2, rel=3e-3)
    own = np.abs(second_displacement(both, state.load)[:, 3:]).max(axis=0)
    assert (own > 0.0).all()
    assert (np.abs(state.displacement[:, 3:]).max(axis=0) < 1e-9 * own).all()
    flows = np.abs(xi[0, 1:] / np.diag(xi)[1:]) * np.abs(state.load[:, 2]).max()
    assert (np.abs(state.load[:, 3:]).max(axis=0) <= 1e-9 * flows).all()


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("condition", list(CONDITIONS))
@pytest.mark.parametrize(
    "second_body", [POLED_DOWN, Material.isotropic(100e9, 0.3, 2e-9, 1e-4)], ids=["down", "isotropic"]
)
def test_joined_half_spaces_in_closed_form(condition: str, second_body: Material) -> None:
    """Two axisymmetric half spaces are equivalent to one with xi = xi_A + D xi_B D, D = diag(-1, 1, 1): the loads
    are opposite, and the rotation changes the sign of the displacement only."""
    xi, other = (axisymmetric_compliance(material.stiffness) for material in (POLED_UP, second_body))
    flip = np.array([-1.0, 1.0, 1.0])
    joined = xi + flip[:, None] * other * flip
    both = combine_bodies(*(half_space_system(x, SIDE, 20) for x in (xi, other)))
    kappa = tuple(0.0 if potential is None else np.inf for potential in CONDITIONS[condition])
    state = solve_converged(indentation_problem(both, sphere(both), APPROACH, conductivity=kappa))
    exact = indent(joined, Sphere(RADIUS), APPROACH, *CONDITIONS[condition])
    force, (charge, flux) = resultant(both, state.load)
    assert -force[2] == pytest.approx(exact.force, rel=3e-3)
    assert charge == pytest.approx(exact.charge, rel=3e-3, abs=0.0)
    assert flux == pytest.approx(exact.magnetic_flux, rel=3e-3, abs=0.0)


def test_oppositely_poled_bodies_share_the_gap() -> None:
    """By symmetry, the interface of a body and its copy of opposite poling is at zero potential; a rigid grounded
    sphere indents each body by half of gap and approach."""
    body, opposite = (half_space_system(axisymmetric_compliance(m.stiffness), SIDE, 16) for m in (POLED_UP, POLED_DOWN))
    both = combine_bodies(body, opposite)
    joined, half = (
        solve_converged(
            indentation_problem(system, sphere(system) / parts, APPROACH / parts, conductivity=(np.inf, np.inf))
        )
        for system, parts in ((both, 1.0), (body, 2.0))
    )
    assert (np.abs(joined.load - half.load) <= 1e-8 * np.abs(half.load).max(axis=0)).all()
    inside = joined.load[:, 2] < 0.0
    insulated = np.abs(body.apply(half.load * np.array([1, 1, 1, 0, 0]))[:, 3:]).max(axis=0)
    assert (np.abs(second_displacement(both, joined.load)[inside, 3:]).max(axis=0) <= 1e-8 * insulated).all()


# exchange of roles


CELLS = 12
LAW = OrthotropicCoulomb(0.2, 0.5, 0.6)
MIRRORED_LAW = OrthotropicCoulomb(0.2, 0.5, -0.6)
ROLES = {
    "smooth": (Signorini(), Signorini(), (0.0, 0.0)),
    "orthotropic friction": (LAW, MIRRORED_LAW, (0.0, 0.0)),
    "friction and conduction": (LAW, MIRRORED_LAW, (2e-8, 3e-4)),
    "perfect conduction": (IsotropicCoulomb(0.4), IsotropicCoulomb(0.4), (np.inf, np.inf)),
}


@pytest.fixture(scope="module")
def dissimilar() -> tuple[DenseSystem, DenseSystem]:
    """Return two media without common symmetry about the interface, and with an offset."""
    first, second_body = (
        periodic_half_space(material, 3.2 * np.sqrt(RADIUS * APPROACH), CELLS)
        for material in (
            TRANSVERSE.rotated(rotation_about([1.0, 2.0, -1.0], 0.8)),
            ORTHOTROPIC.rotated(rotation_about([2.0, -1.0, 1.0], 0.5)),
        )
    )
    random = np.random.default_rng(11)
    sizes = 0.05 * APPROACH * np.array([1.0, 1.0, 1.0, 1e9, 1e6])
    return first, replace(second_body, offset=sizes * random.standard_normal(second_body.offset.shape))


def skewed(system: ReducedSystem, sense: float, law: ContactLaw, kappa: tuple[float, float]) -> ContactProblem:
    """Return an elliptic gap off the centre with an oblique motion and a voltage; `sense` -1 is the same seen from
    the other body."""
    x, y = system.points[:, 0], sense * system.points[:, 1]
    height = (
        (x - 2e-4) ** 2 / (2.0 * RADIUS) + (y + 3e-4) ** 2 / (3.0 * RADIUS) + 0.2 * (x - 2e-4) * (y + 3e-4) / RADIUS
    )
    translation = sense * 0.4 * APPROACH * np.array([0.8, sense * 0.6])
    # motion of the second body relative to the first one, or the reverse
    potentials = (sense * 3e3, sense * -5.0)
    return indentation_problem(system, height, APPROACH, law, kappa, potentials, tuple(translation))


def mirrored(values: Array) -> Array:
    """Return values (n, k) on the grid at the nodes with y reversed."""
    return values.reshape(CELLS, CELLS, -1)[::-1].reshape(values.shape)


@pytest.mark.parametrize("role", list(ROLES))
def test_exchange_of_roles(role: str, dissimilar: tuple[DenseSystem, DenseSystem]) -> None:
    """Pressures agree at mirrored nodes, t1 and fluxes are reversed, and t2 is reversed twice."""
    law, other_law, kappa = ROLES[role]
    first, second_body = dissimilar
    systems = combine_bodies(first, second_body), combine_bodies(second_body, first)
    problems = skewed(systems[0], 1.0, law, kappa), skewed(systems[1], -1.0, other_law, kappa)
    state, exchanged = (solve_converged(problem) for problem in problems)
    signs = np.array([-1.0, 1.0, 1.0, -1.0, -1.0])
    expected = mirrored(state.load) * signs
    assert np.abs(state.load[:, 2]).max() > 0.0
    scale = np.abs(state.load).max(axis=0)
    assert (np.abs(exchanged.load - expected) <= 1e-7 * scale).all()
    np.testing.assert_allclose(second_load(systems[0], state.load), expected, rtol=1e-12)
    jump = mirrored(state.displacement) * signs
    assert (np.abs(exchanged.displacement - jump) <= 1e-7 * np.abs(jump).max(axis=0)).all()
    if isinstance(law, OrthotropicCoulomb):
        stuck = _sticking(problems[0], state)
        assert 0 < stuck.sum() < (state.load[:, 2] < 0.0).sum(), "some nodes stick and some slip"
        assert np.array_equal(_sticking(problems[1], exchanged), mirrored(stuck[:, None])[:, 0])
        turned_wrong = solve_converged(skewed(systems[1], -1.0, law, kappa))
        assert np.abs(turned_wrong.load - expected)[:, :2].max() > 0.02 * scale[:2].max(), "the angle matters"


def _sticking(problem: ContactProblem, state: ContactState) -> Array:
    gap = np.linalg.norm(problem.translation - state.displacement[:, :2], axis=1)
    stuck: Array = (state.load[:, 2] < 0.0) & (gap < 1e-6 * APPROACH)
    return stuck


def test_flux_is_conserved_across_the_interface(dissimilar: tuple[DenseSystem, DenseSystem]) -> None:
    first, second_body = dissimilar
    both = combine_bodies(first, second_body)
    load = solve_converged(skewed(both, 1.0, LAW, (2e-8, 3e-4))).load
    force, (charge, flux) = resultant(first, load)
    other_force, (other_charge, other_flux) = resultant(second_body, second_load(both, load))
    np.testing.assert_allclose(TURN @ other_force, -force, rtol=1e-12)
    assert other_charge == pytest.approx(-charge, rel=1e-12)
    assert other_flux == pytest.approx(-flux, rel=1e-12)
    assert min(abs(charge), abs(flux)) > 0.0
    alone = first.offset + first.apply(load)
    displacement = both.offset + both.apply(load)
    np.testing.assert_allclose(displacement, alone - second_displacement(both, load), rtol=1e-9, atol=1e-15)


# a stiff second body


@pytest.mark.parametrize("kappa", [(0.0, 0.0), (2e-8, 3e-4), (np.inf, np.inf)])
def test_stiff_grounded_second_body_equals_rigid_indenter(kappa: tuple[float, float]) -> None:
    body = periodic_half_space(TRANSVERSE, SIDE, CELLS)
    stiff = replace(body, matrix=1e-12 * body.matrix)
    states = [
        solve_converged(
            indentation_problem(system, sphere(system), APPROACH, LAW, kappa, (2e3, -3.0), (2e-5, 1e-5)),
            tolerance=1e-12,
        )
        for system in (body, combine_bodies(body, stiff))
    ]
    scale = np.abs(states[0].load).max(axis=0)
    assert (np.abs(states[1].load - states[0].load) <= 1e-8 * scale).all()


# geometry and algebra


def curved(normals: Array, points: Array, random: np.random.Generator) -> DenseSystem:
    """Return a synthetic body with random frames about given normals and a random positive definite compliance."""
    n = len(points)
    frames = local_frames(normals)
    angle = random.uniform(0.0, 2.0 * np.pi, n)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    frames[:, 0], frames[:, 1] = cos * frames[:, 0] + sin * frames[:, 1], cos * frames[:, 1] - sin * frames[:, 0]
    root = random.standard_normal((5 * n, 5 * n))
    matrix = (root @ root.T).reshape(n, 5, n, 5)
    return DenseSystem(points, frames, np.ones(n), (), random.standard_normal((n, 5)), matrix, _zone_only)


def _zone_only(_load: Array) -> NodalFields:
    raise AssertionError("never called")


def local_to_global(system: ReducedSystem) -> Array:
    """Return the transformation from global to local components, (n, 5, 5)."""
    axes = np.tile(np.eye(5), (len(system.points), 1, 1))
    axes[:, :3, :3] = system.frames
    return axes


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 9))
def test_curved_zones_in_global_axes(seed: int, n: int) -> None:
    """Forces, reactions and displacements agree in global axes for arbitrary frames and orders of nodes of both
    bodies."""
    random = np.random.default_rng(seed)
    normals = np.array([0.0, 0.0, 1.0]) + 0.5 * random.uniform(-1.0, 1.0, (n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = random.standard_normal((n, 3))
    order = random.permutation(n)
    first = curved(normals, points, random)
    second_body = curved(-(normals @ TURN)[order], (points @ TURN)[order], random)
    both = combine_bodies(first, second_body)
    force = random.standard_normal((n, 5))
    load = np.einsum("naj,nj->na", local_to_global(first), force)
    rotated = force.copy()
    rotated[:, :3] = force[:, :3] @ TURN
    reaction = np.einsum("naj,nj->na", local_to_global(second_body), -rotated[order])
    np.testing.assert_allclose(second_load(both, load), reaction, atol=1e-12)
    moved = np.einsum("naj,na->nj", local_to_global(first), first.offset + first.apply(load))
    answer = np.empty((n, 5))
    answer[order] = np.einsum(
        "naj,na->nj", local_to_global(second_body), second_body.offset + second_body.apply(reaction)
    )
    answer[:, :3] = answer[:, :3] @ TURN
    relative = np.einsum("naj,na->nj", local_to_global(both), both.offset + both.apply(load))
    np.testing.assert_allclose(relative, moved - answer, atol=1e-9)
    seen = np.einsum("naj,na->nj", local_to_global(both), second_displacement(both, load))
    np.testing.assert_allclose(seen, answer, atol=1e-9)


def test_with_and_without_matrices(dissimilar: tuple[DenseSystem, DenseSystem]) -> None:
    first, second_body = dissimilar
    whole, hidden, hidden_counter = combine_bodies(first, second_body), MatrixFree.of(first), MatrixFree.of(second_body)
    free: list[ComposedSystem] = [
        combine_bodies(hidden, second_body),
        combine_bodies(first, hidden_counter),
        combine_bodies(hidden, hidden_counter),
    ]
    assert whole.dense() is not None
    load = np.random.default_rng(5).standard_normal(whole.offset.shape)
    blocks = np.stack([whole.dense()[node, :, node, :] for node in range(len(load))])
    for system in (whole, *free):
        np.testing.assert_allclose(system.apply(load), whole.apply(load), rtol=1e-9, atol=1e-25)
        np.testing.assert_allclose(system.diagonal_blocks(), blocks, rtol=1e-9, atol=1e-25)
        np.testing.assert_array_equal(system.offset, whole.offset)
    assert all(system.dense() is None for system in free)
    problems = [skewed(system, 1.0, LAW, (2e-8, 3e-4)) for system in (whole, free[2])]
    dense, krylov = (solve_converged(problem, 1e-10).load for problem in problems)
    assert (np.abs(dense - krylov) <= 1e-6 * np.abs(dense).max(axis=0)).all()


def test_compliance_of_two_bodies_is_positive_definite(dissimilar: tuple[DenseSystem, DenseSystem]) -> None:
    matrix = combine_bodies(*dissimilar).dense()
    assert matrix is not None
    flat = matrix.reshape(5 * CELLS**2, -1)
    scale = np.sqrt(np.diag(flat))
    assert np.linalg.eigvalsh((flat + flat.T) / 2.0 / scale / scale[:, None]).min() > 0.0


# incompatible bodies


def test_nodes_coinciding_to_round_off_are_matched(steel: DenseSystem) -> None:
    close = steel.points + 1e-9
    assert np.array_equal(match_nodes(steel, replace(steel, points=close)), match_nodes(steel, steel))
    shifted = steel.points.copy()
    shifted[[3, 7], 0] += 2e-5
    assert match_nodes(steel, replace(steel, points=shifted)) is None
    assert match_nodes(steel, half_space_system(np.eye(3), SIDE, 4)) is None


def test_surfaces_that_do_not_face_each_other_are_rejected(steel: DenseSystem) -> None:
    down = steel.frames * np.array([1.0, -1.0, -1.0])
    with pytest.raises(MeshError, match="do not face each other at 121 of 121 nodes"):
        combine_bodies(steel, replace(steel, frames=down))


def test_different_elements_on_the_same_nodes_do_not_match(steel: DenseSystem) -> None:
    weights = steel.weights.copy()
    weights[:2] *= (1.5, 0.5)
    assert match_nodes(steel, replace(steel, weights=weights)) is None


def test_insulated_bodies_have_different_potentials() -> None:
    """Without conduction, the potential of one body does not depend on the ground of the other."""
    body = half_space_system(axisymmetric_compliance(TRANSVERSE.stiffness), SIDE, 10)
    both = combine_bodies(body, body)
    n = len(both.points)
    zero, volts = np.zeros((n, 2)), np.tile([1e4, -20.0], (n, 1))
    laws = Signorini(), flux_channels(Insulating(), Insulating())
    states = [
        solve_converged(ContactProblem(both, *laws, sphere(both) - APPROACH, zero, held)) for held in (zero, volts)
    ]
    np.testing.assert_array_equal(states[0].load, states[1].load)
    conducting = Signorini(), flux_channels(StepConductivity(np.inf), Insulating())
    held = solve_converged(ContactProblem(both, *conducting, sphere(both) - APPROACH, zero, volts))
    assert np.abs(held.load[:, 3]).max() > 0.0
