"""What coarser divisions may change, and where they must not be asked: narrow indenters, hidden asperities, laws."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.convolution import Convolution
from meeframe_halfspace.system import HalfSpaceSystem

from meeframe.contact.channels import flux_channels
from meeframe.contact.nested import coarse_problem
from meeframe.contact.problem import ContactProblem, Solver, Status
from meeframe.contact.scales import problem_scales
from meeframe.elements import Quad4
from meeframe.fields import Array, Indices
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ContactLaw
from meeframe.material import Material, library_material, rotation_about
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import ProjectedCG, SemismoothNewton, StoppingCriteria, residual, solve
from meeframe.system.capabilities import (
    ApproximateInverse,
    Coarsening,
    EdgeResolution,
    FieldwiseApply,
    InteriorFields,
    Multigrid,
    Persistence,
    PointFields,
    Restriction,
    Subsystem,
    diagonal,
)
from meeframe.system.edge_correction import correct_edge
from meeframe.system.reduced import NodalFields, ReducedSystem
from meeframe.system.rotated import rotate_frames
from meeframe.system.two_body import combine_bodies
from meeframe.testing.capabilities import check_capabilities, check_restriction
from meeframe.testing.force_control import PRESS, prescribe_resultant
from meeframe.testing.half_space import indentation_problem
from meeframe.testing.matrix_free import MatrixFree
from meeframe.testing.operation_counter import OperationCounter

ISOTROPIC = Material.isotropic(200e9, 0.3).stiffness
ANISOTROPIC = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
WIDTH, FORCE = 1e-2, 100.0
GRIDS = [
    (HalfSpace(matrix_up_to=0), (63, 80)),
    (HalfSpace("constant", matrix_up_to=0), (64, 69)),
    (HalfSpace("trigonometric", periodic=True, matrix_up_to=0), (63, 79)),
]
SOLVERS = pytest.mark.parametrize("solver", [ProjectedCG(), SemismoothNewton()], ids=["projected-cg", "newton"])


def system_of(formulation: HalfSpace, divisions: tuple[int, int], stiffness: Array = ANISOTROPIC) -> ReducedSystem:
    width = WIDTH, WIDTH * divisions[1] / divisions[0]
    mesh = half_space_mesh(10.0 * max(width), width, divisions, 1, Quad4())
    return formulation.reduce(Body(stiffness, mesh, (), "contact"))


def grid(n: int) -> ReducedSystem:
    return system_of(HalfSpace(matrix_up_to=0), (n - 1, n - 1), ISOTROPIC)


def pressed_by(system: ReducedSystem, gap: Array, force: float) -> ContactProblem:
    """An indenter that moves freely down."""
    return replace(held(system, gap), prescribed_resultants=(prescribe_resultant(system, PRESS, force),))


def held(system: ReducedSystem, gap: Array) -> ContactProblem:
    """An indenter that does not move."""
    none = np.zeros((len(gap), 2))
    return ContactProblem(system, Signorini(), flux_channels(Insulating(), Insulating()), gap, none, none)


def near(system: ReducedSystem, n: int, row: int, column: int, spacings: float) -> Array:
    """Nodes (n,) of a grid n x n within so many spacings of one of them."""
    order = np.lexsort((system.points[:, 1], system.points[:, 0])).reshape(n, n)
    distance = np.linalg.norm(system.points - system.points[order[row, column]], axis=1)
    return np.asarray(distance < spacings * WIDTH / (n - 1))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("moved", [False, True], ids=["given", "free"])
def test_magnitudes_are_those_of_asperities_between_the_coarse_nodes(moved: bool) -> None:
    """Every coarse node is far below the asperities that overlap: the residual is measured in what these bear."""
    n = 128
    system = grid(n)
    order = np.lexsort((system.points[:, 1], system.points[:, 0])).reshape(n, n)
    random, gap = np.random.default_rng(1), np.full(n * n, 1e-5)
    asperities = order[1::2, 1::2].ravel()[random.random(n * n // 4) < 0.1]
    gap[asperities] = -1e-9 * random.random(len(asperities))
    problem = pressed_by(system, gap + 2e-9, 1e-4) if moved else held(system, gap)
    plain = replace(problem, system=MatrixFree.of(system))
    scales, expected = problem_scales(problem), problem_scales(plain)
    assert scales.pressure == pytest.approx(expected.pressure, rel=0.5)
    assert scales.displacement[2] == pytest.approx(expected.displacement[2], rel=0.5)
    solution = solve(problem, ProjectedCG(), StoppingCriteria(tolerance=1e-8))
    assert solution.status is Status.CONVERGED
    assert residual(plain, solution.state) < 2e-8


@SOLVERS
@pytest.mark.parametrize(("n", "spacings"), [(64, 0.5), (64, 1.1), (128, 0.5), (128, 2.5)])
def test_indenters_that_cover_few_nodes_if_any_of_the_coarse_ones(solver: Solver, n: int, spacings: float) -> None:
    """A given motion, and a given force: the same stiffness; of a single node in closed form."""
    system = grid(n)
    under = near(system, n, n // 2 - 1, n // 2 + 1, spacings)
    free = pressed_by(system, np.where(under, 0.0, np.inf), FORCE)
    pressed = solve(free, solver, StoppingCriteria(tolerance=1e-10))
    assert pressed.status is Status.CONVERGED
    depth = float(pressed.state.motion[0])
    if under.sum() == 1:
        own = float(system.diagonal_blocks()[under][0, 2, 2])
        assert depth == pytest.approx(own * FORCE / float(system.weights[under][0]), rel=1e-9)
    given = solve(held(system, np.where(under, -depth, np.inf)), solver, StoppingCriteria(tolerance=1e-10))
    assert given.status is Status.CONVERGED
    assert -system.weights @ given.state.load[:, 2] == pytest.approx(FORCE, rel=1e-8)


@pytest.mark.full(except_for=1)
@SOLVERS
def test_indenters_that_cover_no_node(solver: Solver) -> None:
    """They bear nothing: at a given motion that is so, a given force is not met."""
    system = grid(24)
    nowhere = np.full(len(system.points), np.inf)
    assert solve(held(system, nowhere), solver).status is Status.CONVERGED
    pressed = solve(pressed_by(system, nowhere, FORCE), solver, StoppingCriteria(stall_window=3, max_iterations=50))
    assert pressed.status is not Status.CONVERGED
    assert not pressed.state.load.any()


@final
@dataclass(frozen=True, eq=False)
class NodalCoulomb(ContactLaw):
    """Friction whose coefficients are those of the nodes (n,), as of an increment."""

    mu: Array

    def project(self, trial: Array) -> Array:
        pressure = np.maximum(-trial[:, 2], 0.0)
        size = np.linalg.norm(trial[:, :2], axis=1)
        part = np.minimum(1.0, np.divide(self.mu * pressure, size, out=np.ones_like(size), where=size > 0.0))
        return np.column_stack([trial[:, :2] * part[:, None], -pressure])

    def tangential_scaling(self) -> Array:
        return np.eye(2)


def test_laws_of_the_nodes_are_asked_for_these_alone() -> None:
    n, mu = 72, 0.3
    system = grid(n)
    gap = (system.points[:, :2] ** 2).sum(axis=1) / 0.2 - 4e-6
    uniform = replace(held(system, gap), contact_law=IsotropicCoulomb(mu), translation=np.full((n * n, 2), 4e-7))
    nodal = replace(uniform, contact_law=NodalCoulomb(np.full(n * n, mu)))
    assert coarse_problem(uniform) is not None
    assert coarse_problem(nodal) is None
    states = [
        solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-10)).state for problem in (uniform, nodal)
    ]
    assert np.abs(states[0].load - states[1].load).max() < 1e-7 * np.abs(states[0].load).max()


@pytest.mark.parametrize(("formulation", "divisions"), GRIDS)
def test_capabilities_of_a_half_space(formulation: HalfSpace, divisions: tuple[int, int]) -> None:
    check_capabilities(system_of(formulation, divisions))


@pytest.mark.full(except_for=9)
@pytest.mark.parametrize(
    "system",
    [
        *(system_of(formulation, divisions) for formulation, divisions in GRIDS),
        system_of(HalfSpace(edges="resolved", matrix_up_to=0), (24, 31)),
        system_of(HalfSpace(matrix_up_to=10**6), (6, 5)),
    ],
    ids=["bilinear", "constant", "periodic", "edges", "dense"],
)
@pytest.mark.parametrize("directed", [False, True], ids=["as it is", "turned"])
def test_own_responses_are_those_to_unit_loads(system: ReducedSystem, directed: bool) -> None:
    """In the order in which they are asked for; of a part, too."""
    n = len(system.points)
    whole = rotate_frames(system, np.random.default_rng(2).normal(3.0, size=(n, 3))) if directed else system
    restriction = whole.capability(Restriction)
    part = None if restriction is None else restriction.restrict(np.arange(2 * n // 5, 2 * n // 5 + 3))
    for asked in (whole, whole if part is None else part.system):
        for fields in ((2,), (4, 0, 1), tuple(range(5))):
            own = diagonal(asked, fields)
            assert own.shape == (len(asked.points), len(fields))
            np.testing.assert_array_equal(own, asked.diagonal_blocks()[:, fields, fields])
            for node in (0, len(own) // 2, len(own) - 1):
                for found, field in zip(own[node], fields, strict=True):
                    load = np.zeros((len(own), 5))
                    load[node, field] = 1.0
                    assert found == pytest.approx(asked.apply(load)[node, field], rel=1e-9)


def test_parts_of_single_nodes() -> None:
    """Of 17 x 17 nodes a corner is a part of its own."""
    system = system_of(HalfSpace(matrix_up_to=0), (16, 16))
    corner = system.restrict(np.array([len(system.points) - 1]))
    assert corner is not None
    assert len(corner.nodes) == 1
    check_restriction(system)


def test_parts_of_free_grids() -> None:
    """Around the nodes, little larger than need be; what answers wherever they are; none where it is hardly less."""
    n = 96
    system = system_of(HalfSpace(matrix_up_to=0), (n - 1, n - 1))
    distance = np.abs(system.points[:, :2]).max(axis=1) / WIDTH
    wider = np.flatnonzero(distance < 0.21)
    part = system.restrict(wider)
    assert part is not None
    assert len(wider) <= len(part.nodes) <= 1.5 * len(wider)
    shifted, smaller = system.restrict(wider + 12 * n), system.restrict(np.flatnonzero(distance < 0.1))
    assert shifted is not None
    assert smaller is not None
    assert shifted.system.convolution is part.system.convolution
    assert len(smaller.nodes) < 0.5 * len(part.nodes)
    assert system.restrict(np.flatnonzero(distance < 0.45)) is None
    periodic = system_of(HalfSpace("trigonometric", periodic=True, matrix_up_to=0), (n, n))
    assert periodic.capability(Restriction) is None


def test_parts_of_two_sizes_are_kept() -> None:
    """The contact's, and what it was before: of 1, 12 and 25 nodes along a side."""
    system = system_of(HalfSpace(matrix_up_to=0), (40, 40))

    def answering(count: int) -> Convolution:
        part = system.restrict(np.arange(count))
        assert part is not None
        assert isinstance(part.system, HalfSpaceSystem)
        return part.system.convolution

    first, second = answering(1), answering(12)
    assert (answering(1), answering(12)) == (first, second)
    third = answering(25)
    assert (answering(12), answering(25)) == (second, third)
    assert answering(1) is not first


def test_solutions_do_not_depend_on_what_was_asked_before() -> None:
    """Bit for bit: larger and smaller contacts beforehand leave other parts behind, and none of them is used again."""

    def solved(system: ReducedSystem, radius: float) -> Array:
        height = (system.points[:, :2] ** 2).sum(axis=1) / 0.2
        problem = indentation_problem(system, height, radius**2 / 0.1, conductivity=(np.inf, np.inf), potentials=(5, 1))
        solution = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-8))
        assert solution.status is Status.CONVERGED
        return solution.state.load

    first, second = (system_of(HalfSpace(matrix_up_to=0), (40, 40), ANISOTROPIC) for _ in range(2))
    radii = np.array([0.16, 0.2, 0.24, 0.3]) * WIDTH
    loads = [solved(first, radius) for radius in radii]
    again = [solved(second, radius) for radius in radii[::-1]][::-1]
    for load, other in zip(loads, again, strict=True):
        np.testing.assert_array_equal(load, other)


@SOLVERS
def test_coarse_grids_that_nothing_presses(solver: Solver) -> None:
    """Their solution is no load at all, in no field: that of this one, too."""
    system = grid(64)
    problem = pressed_by(system, (system.points**2).sum(axis=1), 0.0)
    if solver != ProjectedCG():
        problem = problem.with_laws(electric=StepConductivity(np.inf))
    solution = solve(problem, solver, StoppingCriteria(tolerance=1e-8))
    assert solution.status is Status.CONVERGED
    assert not solution.state.load.any()


FORWARDED = {FieldwiseApply, ApproximateInverse, Multigrid, Restriction}


def capabilities_of(system: ReducedSystem) -> set[type]:
    return {kind for kind in (*FORWARDED, EdgeResolution, Persistence) if system.capability(kind) is not None}


def radial(system: ReducedSystem) -> ReducedSystem:
    return rotate_frames(system, system.points - system.points.mean(axis=0))


def alike(system: ReducedSystem) -> ReducedSystem:
    return rotate_frames(system, np.tile([0.6, 0.8, 0.0], (len(system.points), 1)))


def corrected(system: ReducedSystem) -> ReducedSystem:
    edge = (np.random.default_rng(0).random(len(system.points)) < 0.1)[:, None, None] * np.eye(5)
    return correct_edge(system, edge * system.diagonal_blocks())


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize(
    ("compose", "capabilities"),
    [
        (lambda system: combine_bodies(system, system), FORWARDED),
        (lambda system: combine_bodies(radial(system), alike(system)), FORWARDED),
        (lambda system: combine_bodies(system, MatrixFree.of(system)), {FieldwiseApply, ApproximateInverse}),
        (lambda system: combine_bodies(MatrixFree.of(system), system), {FieldwiseApply}),
        (alike, FORWARDED),
        (radial, FORWARDED),
        (corrected, FORWARDED - {Multigrid}),
        (lambda system: rotate_frames(corrected(system), radial(system).frames[:, 0]), FORWARDED - {Multigrid}),
        (OperationCounter.of, FORWARDED),
        (lambda system: OperationCounter.of(system, accelerated=False), {FieldwiseApply}),
        (MatrixFree.of, set()),
    ],
)
def test_capabilities_of_composed_systems(compose, capabilities: set[type]) -> None:
    """Each is forwarded and correct, or absent for the stated reason."""
    system = system_of(*GRIDS[0])
    assert capabilities_of(system) == FORWARDED
    whole = compose(system)
    assert capabilities_of(whole) == capabilities
    check_capabilities(whole)
    nodes = np.flatnonzero(np.hypot(*(system.points[:, :2] - 1e-3).T) < 2e-3)
    restriction = whole.capability(Restriction)
    assert restriction is None or restriction.restrict(nodes) is not None


def test_two_bodies_with_other_coarse_nodes_have_no_coarser_grid() -> None:
    """Turned over, every second one of an even number of nodes along x2 is one of the others."""
    even = system_of(HalfSpace(matrix_up_to=0), (63, 63))
    assert even.capability(Multigrid) is not None
    assert combine_bodies(even, even).capability(Multigrid) is None
    odd = system_of(HalfSpace(matrix_up_to=0), (63, 64))
    assert combine_bodies(odd, odd).capability(Multigrid) is not None


def test_two_bodies_resolve_edges_if_both_do() -> None:
    resolved, nodal = (system_of(HalfSpace(matrix_up_to=0, edges=edges), (24, 24)) for edges in ("resolved", "nodes"))
    both = combine_bodies(resolved, rotate_frames(resolved, np.tile([0.6, 0.8, 0.0], (len(nodal.points), 1))))
    assert EdgeResolution in capabilities_of(both)
    check_capabilities(both)
    assert EdgeResolution not in capabilities_of(combine_bodies(resolved, nodal))
    assert EdgeResolution not in capabilities_of(correct_edge(resolved, 0.1 * resolved.diagonal_blocks()))


def test_two_bodies_start_from_a_coarser_grid() -> None:
    """The same answer with fewer products than without acceleration."""
    both = combine_bodies(
        system_of(HalfSpace(matrix_up_to=0), (96, 96)), system_of(HalfSpace(matrix_up_to=0), (96, 96), ISOTROPIC)
    )
    height = (both.points[:, 0] ** 2 + both.points[:, 1] ** 2) / 2.0
    loads, products = [], []
    for accelerated in (True, False):
        system = OperationCounter.of(both, accelerated)
        problem = indentation_problem(system, height, 4e-6, IsotropicCoulomb(0.3), translation=(1e-6, 0.0))
        solution = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-10))
        assert solution.status is Status.CONVERGED
        loads.append(solution.state.load)
        products.append(len(system.products))
    scale = np.abs(loads[1]).max(axis=0)[:3]
    assert (np.abs(loads[0] - loads[1])[:, :3].max(axis=0) < 1e-7 * scale).all()
    assert products[0] < 0.7 * products[1]


@final
@dataclass(frozen=True, eq=False)
class Wrong(ReducedSystem, FieldwiseApply, ApproximateInverse, Multigrid, Restriction, InteriorFields):
    """A half space one of whose capabilities is wrong."""

    inner: HalfSpaceSystem
    wrong: str

    @classmethod
    def of(cls, inner: ReducedSystem, wrong: str) -> "Wrong":
        assert isinstance(inner, HalfSpaceSystem)
        return cls(inner.points, inner.frames, inner.weights, inner.cells, inner.offset, inner, wrong)

    def capability(self, kind):
        return super().capability(kind) if self.inner.capability(kind) is not None else None

    def apply(self, load: Array) -> Array:
        return self.inner.apply(load)

    def diagonal_blocks(self) -> Array:
        return self.inner.diagonal_blocks()

    def dense(self) -> Array | None:
        return None

    def recover(self, load: Array) -> NodalFields:
        return self.inner.recover(load)

    def apply_fields(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        wanted = sorted(fields) if self.wrong == "wanted fields" else fields
        found = self.inner.apply_fields(load, sorted(loaded) if self.wrong == "loaded fields" else loaded, wanted)
        return 1.0001 * found if self.wrong == "single precision" and load.dtype == np.float32 else found

    def diagonal(self, fields: Sequence[int]) -> Array:
        return self.inner.diagonal(sorted(fields) if self.wrong == "diagonal" else fields)

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array]:
        inverse = self.inner.approximate_inverse(fields)
        return (lambda displacement: -inverse(displacement)) if self.wrong == "approximate_inverse" else inverse

    def coarsen(self) -> Coarsening:
        coarse = self.inner.coarsen()
        if self.wrong == "prolong":
            return replace(coarse, prolong=lambda values: 0.5 * coarse.prolong(values))
        if self.wrong == "weights":
            return replace(coarse, system=replace(coarse.system, weights=0.25 * coarse.system.weights))
        return replace(coarse, nodes=coarse.nodes[::-1]) if self.wrong == "points" else coarse

    def restrict(self, nodes: Indices) -> Subsystem | None:
        part = self.inner.restrict(nodes[len(nodes) // 2 :] if self.wrong == "part" else nodes)
        if part is not None and self.wrong == "fields of a part":
            return replace(part, system=Wrong.of(part.system, "loaded fields"))
        return replace(part, nodes=part.nodes[::-1]) if part is not None and self.wrong == "nodes of a part" else part

    def evaluate(self, load: Array, points: Array) -> PointFields:
        interior = self.inner.capability(InteriorFields)
        assert interior is not None
        fields = interior.evaluate(load, points)
        if self.wrong == "gradients":
            return replace(fields, gradients=-fields.gradients)
        doubled = {name: 2.0 * getattr(fields, name) for name in ("values", "gradients", "fluxes")}
        return replace(fields, **doubled) if self.wrong == "interior" else fields


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize(
    ("wrong", "message"),
    [(name, "apply_fields of loads float64") for name in ("loaded fields", "wanted fields", "fields of a part")]
    + [(name, name) for name in ("approximate_inverse", "prolong", "weights", "points", "diagonal")]
    + [("single precision", "apply_fields of loads float32")]
    + [("gradients", "are not the derivatives"), ("interior", "do not tend to those of recover at its surface")]
    + [("part", "lacks some of the requested nodes"), ("nodes of a part", "points of a subsystem are not")],
)
def test_wrong_capabilities_are_caught(wrong: str, message: str) -> None:
    system = system_of(*GRIDS[0], stiffness=ANISOTROPIC)
    with pytest.raises(AssertionError, match=message):
        check_capabilities(Wrong.of(system, wrong))
    check_capabilities(Wrong.of(system, "nothing"))
