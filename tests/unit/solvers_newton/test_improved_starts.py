"""Relaxation of starts around the edges of contact and stick, and their correction by a coarser grid."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_laws.conductivity import PowerLaw
from scipy.spatial.distance import cdist

from meeframe.contact._kernels.relaxation import number_band, sweep_nodes, tangential_response
from meeframe.contact.conduction import conducting as is_conducting
from meeframe.contact.nested import coarse_problem, prolonged_start, with_tension
from meeframe.contact.problem import ContactProblem, Iterate, Status
from meeframe.contact.relaxation import Start, relax
from meeframe.contact.residual import evaluate
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ContactLaw
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import SemismoothNewton, StoppingCriteria, residual, solve
from meeframe.solvers.newton.moves import improve_start
from meeframe.solvers.newton.residual import ContactResidual, ResidualState
from meeframe.system.capabilities import LatticeStencil
from meeframe.system.rotated import rotate_frames
from meeframe.testing.half_space import indentation_problem

DRAGGED = (3e-7, 1e-7)
COULOMB = IsotropicCoulomb(0.3)
ORTHOTROPIC = OrthotropicCoulomb(0.2, 0.5, 0.4)
WIDTH, RADIUS = 7e-3, 0.1


def start_of(state: ResidualState) -> Start:
    """Return the input of the relaxation at a state."""
    fraction = np.clip(state.contact_fraction, 0.0, 1.0)
    closed = state.transmissivity + (1.0 - fraction)[:, None] * state.jump
    values = state.load, state.relative_displacement, state.trial, fraction
    return Start(state.equation.problem, *values, closed, closed - state.jump)


def periodic() -> ContactProblem:
    mesh = half_space_mesh(10.0 * WIDTH, WIDTH, 63, 1, Quad4())
    body = Body(library_material("orthotropic-mee").stiffness, mesh, (), "contact")
    system = HalfSpace("trigonometric", periodic=True, matrix_up_to=0).reduce(body)
    height = ((system.points[:, :2] - [1e-4, 2e-4]) ** 2).sum(axis=1) / (2.0 * RADIUS)
    depth = (0.25 * WIDTH) ** 2 / RADIUS
    return indentation_problem(system, height, depth, COULOMB, (np.inf, np.inf), (5.0, 1.0), DRAGGED)


def without_lattice(problem: ContactProblem) -> ContactProblem:
    """Return the same problem on a system that has no stencil."""
    system = problem.system
    return replace(problem, system=rotate_frames(system, system.frames[:, 0].copy()))


@pytest.mark.parametrize("is_periodic", [False, True])
@pytest.mark.parametrize("width", [1, 2, 3])
def test_band_has_the_nodes_near_those_of_the_other_kind(width: int, is_periodic: bool) -> None:
    kinds = np.random.default_rng(width).random((17, 23)) < 0.04
    number = np.full(kinds.shape, 99)
    count = number_band(kinds, width, is_periodic, number)
    places = np.argwhere(np.ones_like(kinds)).astype(float)
    shifts = [np.array([i * 17.0, j * 23.0]) for i, j in product((-1, 0, 1), repeat=2)] if is_periodic else [0.0]
    distance = np.min([cdist(places, places + shift) for shift in shifts], axis=0)
    kind = kinds.ravel()
    expected = ((distance <= width) & (kind[:, None] != kind)).any(axis=1)
    assert 0 < count < kinds.size
    np.testing.assert_array_equal(number.ravel() >= 0, expected)
    np.testing.assert_array_equal(number.ravel()[expected], np.arange(count))


@pytest.mark.parametrize("is_periodic", [False, True])
def test_tangential_responses_are_sums_over_nodes_within_reach(is_periodic: bool) -> None:
    random = np.random.default_rng(5)
    inside = random.random((12, 9)) < 0.6
    number = np.where(inside, np.cumsum(inside).reshape(inside.shape) - 1, -1)
    positions, responses = np.argwhere(inside), random.normal(size=(5, 5, 2, 2))
    load, result = random.normal(size=(len(positions), 2)), np.full((len(positions), 2), np.nan)
    tangential_response(number, positions, is_periodic, responses, load, result)
    expected = np.zeros_like(load)
    for shift in product((-1, 0, 1), repeat=2) if is_periodic else [(0, 0)]:
        offset = positions[:, None] - positions[None] + np.multiply(shift, inside.shape)
        to, source = np.nonzero((np.abs(offset) <= 2).all(axis=2))
        np.add.at(expected, to, np.einsum("pij,pj->pi", responses[*(offset[to, source] + 2).T], load[source]))
    np.testing.assert_allclose(result, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("material", ["orthotropic-mee", "batio3-cofe2o4"])
def test_sweeps_alone_solve_a_small_contact(material: str, conducting, at) -> None:
    """Projected Gauss-Seidel iteration converges without friction, and the independent residual accepts its result."""
    problem = conducting(49, 0.1, material=material)
    stencil = problem.system.stencil(24)
    number = np.full(stencil.lattice.shape, -1)
    inside = np.hypot(*(np.indices(number.shape) - 24)) <= 11.0
    number[inside] = np.arange(inside.sum())
    nodes = stencil.lattice[inside]
    state = at(problem, np.zeros_like(problem.system.offset), np.zeros(len(problem.gap)))
    load, displacement = (np.ascontiguousarray(each[nodes]) for each in (state.load, state.relative_displacement))
    fraction, closed = np.zeros(len(nodes)), np.ones((len(nodes), 2))
    lattice = number, np.argwhere(inside), False, stencil.responses
    slips = np.zeros(len(nodes), bool)
    sweep_nodes(*lattice, closed, np.zeros_like(closed), slips, load, displacement, fraction, 4000, 1e-15)
    full, fractions = np.zeros_like(state.load), np.zeros(len(problem.gap))
    full[nodes], fractions[nodes] = load, fraction
    assert ((load[:, 2] < 0.0) & (fraction == 1.0)).sum() > 20
    assert residual(problem, evaluate(problem, Iterate(full, fractions, None, np.zeros(0)))) < 1e-5


CASES: dict[str, Callable[..., ContactProblem]] = {
    "isotropic friction": lambda make: make(64, 0.3, COULOMB, dragged=DRAGGED),
    "orthotropic friction": lambda make: make(64, 0.3, ORTHOTROPIC, dragged=DRAGGED),
    "frictionless": lambda make: make(64, 0.3, Signorini()),
    "insulated": lambda make: make(64, 0.3, COULOMB, Insulating(), dragged=DRAGGED),
    "poor conductor": lambda make: make(64, 0.3, COULOMB, StepConductivity(1e-4), dragged=DRAGGED),
    "periodic": lambda make: periodic(),
}


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("name", CASES)
def test_solutions_are_not_changed(name: str, conducting, at_solution) -> None:
    """Neither relaxation nor a coarser grid changes what satisfies the laws."""
    problem = CASES[name](conducting)
    state = at_solution(problem)
    coarse = coarse_problem(problem)
    assert coarse is not None
    equation = ContactResidual.of(coarse.problem)
    nodes, coarse_nodes = np.arange(len(problem.gap)), np.arange(len(coarse.problem.gap))
    improved = improve_start(state, nodes, coarse, equation, coarse_nodes)
    unit = np.abs(state.load).max(axis=0)
    assert (np.abs(improved.load - state.load) <= 1e-6 * unit).all()
    assert improved.violation < 1e-6


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("name", CASES)
def test_interpolated_starts_become_better(name: str, conducting, at) -> None:
    """The improved start is admissible, loads no other nodes, and violates the laws less."""
    problem = CASES[name](conducting)
    coarse = coarse_problem(problem)
    assert coarse is not None
    coarse_solution = solve(coarse.problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-6)).state
    if not is_conducting(problem):  # the edge of the contact then lies between coarse nodes
        equation = ContactResidual.of(coarse.problem)
        open_nodes = np.zeros(len(coarse_solution.load), bool)
        values = coarse_solution.load, coarse_solution.contact_fraction, open_nodes, coarse_solution.motion
        coarse_solution = with_tension(
            coarse.problem, coarse_solution, equation.at(*values).relative_displacement[:, 2]
        )
    start = prolonged_start(problem, coarse, coarse_solution)
    load = start.load.copy(order="K")
    load[:, :3] = problem.contact_law.project(load[:, :3])
    state = at(problem, load, start.contact_fraction)
    nodes, coarse_nodes = np.arange(len(problem.gap)), np.arange(len(coarse.problem.gap))
    improved = improve_start(state, nodes, coarse, ContactResidual.of(coarse.problem), coarse_nodes)
    assert improved.merit < 0.7 * state.merit
    admissible = problem.contact_law.project(improved.load[:, :3])
    np.testing.assert_allclose(improved.load[:, :3], admissible, rtol=0, atol=1e-12 * np.abs(load[:, 2]).max())
    again = at(problem, improved.load, improved.contact_fraction)
    assert again.merit == pytest.approx(improved.merit, rel=1e-9)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("law", [COULOMB, ORTHOTROPIC], ids=["isotropic", "orthotropic"])
def test_solutions_are_those_without_a_lattice_in_fewer_steps(law: ContactLaw, conducting) -> None:
    problem = conducting(96, 0.35, law, dragged=DRAGGED)
    plain = without_lattice(problem)
    assert plain.system.capability(LatticeStencil) is None
    limits = StoppingCriteria(tolerance=1e-10)
    relaxed, other = (solve(each, SemismoothNewton(), limits) for each in (problem, plain))
    assert relaxed.status is other.status is Status.CONVERGED
    unit = np.abs(other.state.load).max(axis=0)
    assert (np.abs(relaxed.state.load - other.state.load) < 1e-6 * unit).all()
    assert relaxed.iterations < other.iterations


def _disturbed(state: ResidualState, at: Callable[..., ResidualState], problem: ContactProblem) -> ResidualState:
    """Return a state whose load is a little too large."""
    load: Array = 1.001 * state.load
    load[:, :3] = problem.contact_law.project(load[:, :3])
    return at(problem, load, state.contact_fraction)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize(
    ("law", "flux", "changes"),
    [
        (COULOMB, StepConductivity(np.inf), (True, True)),
        (COULOMB, Insulating(), (True, False)),
        (COULOMB, PowerLaw(1e-5, 1e6, 0.9), (True, False)),
        (Signorini(), StepConductivity(np.inf), (False, True)),
        (Signorini(), Insulating(), (False, False)),
    ],
    ids=["both", "insulated", "conductivity from zero", "frictionless", "neither"],
)
def test_only_boundaries_that_matter_are_relaxed(law, flux, changes, conducting, at, at_solution) -> None:
    """Friction around the boundary of stick, fluxes around the edge of conduction; everything else stays."""
    problem = conducting(64, 0.3, law, flux, dragged=DRAGGED)
    state = _disturbed(at_solution(problem), at, problem)
    relaxed = relax(start_of(state))
    if not any(changes):
        assert relaxed is None
        return
    assert relaxed is not None
    load, fraction = relaxed
    changed = load != state.load
    assert changed[:, :2].any() == changes[0]
    assert changed[:, 3:].any() == changes[1]
    assert changed.any(axis=1).mean() < 0.5
    assert (fraction == state.contact_fraction).all() or changes[1]


def test_nothing_is_relaxed_without_a_lattice(conducting, at, at_solution) -> None:
    problem = without_lattice(conducting(64, 0.3, COULOMB, dragged=DRAGGED))
    assert relax(start_of(_disturbed(at_solution(problem), at, problem))) is None


def test_flat_contact_without_edges_is_not_relaxed(conducting, at) -> None:
    """All nodes are pressed and stick."""
    problem = conducting(40, 0.3, COULOMB)
    problem = replace(problem, gap=np.full(len(problem.gap), -1e-6))
    load = np.zeros_like(problem.system.offset)
    load[:, 2] = -1e5
    assert relax(start_of(at(problem, load, np.ones(len(load))))) is None


def test_start_state_is_not_changed(conducting, at, at_solution) -> None:
    problem = conducting(64, 0.3, COULOMB, dragged=DRAGGED)
    state = _disturbed(at_solution(problem), at, problem)
    arrays = state.load, state.relative_displacement, state.contact_fraction
    copies = [array.copy() for array in arrays]
    assert relax(start_of(state)) is not None
    for array, copy in zip(arrays, copies, strict=True):
        np.testing.assert_array_equal(array, copy)
