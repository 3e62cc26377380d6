"""Test limits of nested grids: narrow indenters, hidden asperities, laws with nodal data, restrictions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
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
    LatticeStencil,
    Multigrid,
    Persistence,
    PointFields,
    Prolongation,
    Restriction,
    Stencil,
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
    (HalfSpace(matrix_up_to=0), (47, 60)),
    (HalfSpace("constant", matrix_up_to=0), (48, 53)),
    (HalfSpace("trigonometric", periodic=True, matrix_up_to=0), (47, 59)),
]
SOLVERS = pytest.mark.parametrize("solver", [ProjectedCG(), SemismoothNewton()], ids=["projected-cg", "newton"])


def system_of(formulation: HalfSpace, divisions: tuple[int, int], stiffness: Array = ANISOTROPIC) -> ReducedSystem:
    width = WIDTH, WIDTH * divisions[1] / divisions[0]
    mesh = half_space_mesh(10.0 * max(width), width, divisions, 1, Quad4())
    return formulation.reduce(Body(stiffness, mesh, (), "contact"))


@cache
def cached_system(formulation: HalfSpace, divisions: tuple[int, int]) -> ReducedSystem:
    """Return the system that several tests share, or contain in a composed or wrong one."""
    return system_of(formulation, divisions)


def grid(n: int) -> ReducedSystem:
    return system_of(HalfSpace(matrix_up_to=0), (n - 1, n - 1), ISOTROPIC)


def press(system: ReducedSystem, gap: Array, force: float) -> ContactProblem:
    """Return an indenter that moves freely along its axis under a normal force."""
    return replace(fixed(system, gap), prescribed_resultants=(prescribe_resultant(system, PRESS, force),))


def fixed(system: ReducedSystem, gap: Array) -> ContactProblem:
    """Return an indenter with a prescribed position."""
    none = np.zeros((len(gap), 2))
    return ContactProblem(system, Signorini(), flux_channels(Insulating(), Insulating()), gap, none, none)


def near(system: ReducedSystem, n: int, row: int, column: int, spacings: float) -> Array:
    """Return the nodes (n,) of an n x n grid within a number of spacings from one of them."""
    order = np.lexsort((system.points[:, 1], system.points[:, 0])).reshape(n, n)
    distance = np.linalg.norm(system.points - system.points[order[row, column]], axis=1)
    return np.asarray(distance < spacings * WIDTH / (n - 1))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("moved", [False, True], ids=["given", "free"])
def test_scales_with_asperities_between_coarse_nodes(moved: bool) -> None:
    """All coarse nodes lie far below the overlapping asperities, which determine the scale of the residual."""
    n = 128
    system = grid(n)
    order = np.lexsort((system.points[:, 1], system.points[:, 0])).reshape(n, n)
    random, gap = np.random.default_rng(1), np.full(n * n, 1e-5)
    asperities = order[1::2, 1::2].ravel()[random.random(n * n // 4) < 0.1]
    gap[asperities] = -1e-9 * random.random(len(asperities))
    problem = press(system, gap + 2e-9, 1e-4) if moved else fixed(system, gap)
    plain = replace(problem, system=MatrixFree.of(system))
    scales, expected = problem_scales(problem), problem_scales(plain)
    assert scales.pressure == pytest.approx(expected.pressure, rel=0.5)
    assert scales.displacement[2] == pytest.approx(expected.displacement[2], rel=0.5)
    solution = solve(problem, ProjectedCG(), StoppingCriteria(tolerance=1e-8))
    assert solution.status is Status.CONVERGED
    assert residual(plain, solution.state) < 2e-8


@pytest.mark.full(except_for=2)
@SOLVERS
@pytest.mark.parametrize(("n", "spacings"), [(64, 0.5), (64, 1.1), (128, 0.5), (128, 2.5)])
def test_narrow_indenters(solver: Solver, n: int, spacings: float) -> None:
    """A prescribed motion and a prescribed force give the same stiffness; for a single node there is a closed form."""
    system = grid(n)
    under = near(system, n, n // 2 - 1, n // 2 + 1, spacings)
    free = press(system, np.where(under, 0.0, np.inf), FORCE)
    pressed = solve(free, solver, StoppingCriteria(tolerance=1e-10))
    assert pressed.status is Status.CONVERGED
    depth = float(pressed.state.motion[0])
    if under.sum() == 1:
        compliance = float(system.diagonal_blocks()[under][0, 2, 2])
        assert depth == pytest.approx(compliance * FORCE / float(system.weights[under][0]), rel=1e-9)
    given = solve(fixed(system, np.where(under, -depth, np.inf)), solver, StoppingCriteria(tolerance=1e-10))
    assert given.status is Status.CONVERGED
    assert -system.weights @ given.state.load[:, 2] == pytest.approx(FORCE, rel=1e-8)


@pytest.mark.full(except_for=1)
@SOLVERS
def test_indenters_that_cover_no_node(solver: Solver) -> None:
    """Such indenters carry no load: a prescribed motion converges, a prescribed force does not."""
    system = grid(24)
    nowhere = np.full(len(system.points), np.inf)
    assert solve(fixed(system, nowhere), solver).status is Status.CONVERGED
    pressed = solve(press(system, nowhere, FORCE), solver, StoppingCriteria(stall_window=3, max_iterations=50))
    assert pressed.status is not Status.CONVERGED
    assert not pressed.state.load.any()


@final
@dataclass(frozen=True, eq=False)
class NodalCoulomb(ContactLaw):
    """Coulomb friction with one coefficient for each node (n,), as after `for_increment`."""

    mu: Array

    def project(self, trial: Array) -> Array:
        pressure = np.maximum(-trial[:, 2], 0.0)
        size = np.linalg.norm(trial[:, :2], axis=1)
        part = np.minimum(1.0, np.divide(self.mu * pressure, size, out=np.ones_like(size), where=size > 0.0))
        return np.column_stack([trial[:, :2] * part[:, None], -pressure])

    def tangential_scaling(self) -> Array:
        return np.eye(2)


def test_laws_with_nodal_data_are_evaluated_at_their_nodes() -> None:
    n, mu = 72, 0.3
    system = grid(n)
    gap = (system.points[:, :2] ** 2).sum(axis=1) / 0.2 - 4e-6
    uniform = replace(fixed(system, gap), contact_law=IsotropicCoulomb(mu), translation=np.full((n * n, 2), 4e-7))
    nodal = replace(uniform, contact_law=NodalCoulomb(np.full(n * n, mu)))
    assert coarse_problem(uniform) is not None
    assert coarse_problem(nodal) is None
    states = [
        solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-10)).state for problem in (uniform, nodal)
    ]
    assert np.abs(states[0].load - states[1].load).max() < 1e-7 * np.abs(states[0].load).max()


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("formulation", "divisions"), GRIDS)
def test_capabilities_of_a_half_space(formulation: HalfSpace, divisions: tuple[int, int]) -> None:
    check_capabilities(cached_system(formulation, divisions))


@pytest.mark.full(except_for=9)
@pytest.mark.parametrize(
    ("formulation", "divisions"),
    [*GRIDS, (HalfSpace(edges="resolved", matrix_up_to=0), (24, 31)), (HalfSpace(matrix_up_to=10**6), (6, 5))],
    ids=["bilinear", "constant", "periodic", "edges", "dense"],
)
@pytest.mark.parametrize("directed", [False, True], ids=["as it is", "turned"])
def test_diagonal_matches_unit_loads(formulation: HalfSpace, divisions: tuple[int, int], directed: bool) -> None:
    """Fields are returned in the requested order, also for restrictions."""
    system = cached_system(formulation, divisions)
    n = len(system.points)
    whole = rotate_frames(system, np.random.default_rng(2).normal(3.0, size=(n, 3))) if directed else system
    restriction = whole.capability(Restriction)
    part = None if restriction is None else restriction.restrict(np.arange(2 * n // 5, 2 * n // 5 + 3))
    for asked in (whole, whole if part is None else part.system):
        for fields in ((2,), (4, 0, 1), tuple(range(5))):
            compliance = diagonal(asked, fields)
            assert compliance.shape == (len(asked.points), len(fields))
            np.testing.assert_array_equal(compliance, asked.diagonal_blocks()[:, fields, fields])
            for node in (0, len(compliance) // 2, len(compliance) - 1):
                for computed, field in zip(compliance[node], fields, strict=True):
                    load = np.zeros((len(compliance), 5))
                    load[node, field] = 1.0
                    assert computed == pytest.approx(asked.apply(load)[node, field], rel=1e-9)


def test_restriction_to_single_node() -> None:
    """A corner of 17 x 17 nodes is restricted to itself."""
    system = system_of(HalfSpace(matrix_up_to=0), (16, 16))
    corner = system.restrict(np.array([len(system.points) - 1]))
    assert corner is not None
    assert len(corner.nodes) == 1
    check_restriction(system)


def test_restriction_of_free_grids() -> None:
    """Restrictions are little larger than the requested nodes and absent where they would hardly be smaller than the
    zone."""
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


def test_restrictions_of_two_sizes_are_cached() -> None:
    """The cache holds the current restriction and the previous one, for 1, 12 and 25 nodes along a side."""
    system = system_of(HalfSpace(matrix_up_to=0), (40, 40))

    def restriction_for(count: int) -> Convolution:
        part = system.restrict(np.arange(count))
        assert part is not None
        assert isinstance(part.system, HalfSpaceSystem)
        return part.system.convolution

    first, second = restriction_for(1), restriction_for(12)
    assert (restriction_for(1), restriction_for(12)) == (first, second)
    third = restriction_for(25)
    assert (restriction_for(12), restriction_for(25)) == (second, third)
    assert restriction_for(1) is not first


@pytest.mark.full
def test_solutions_do_not_depend_on_earlier_solutions() -> None:
    """Solutions are bitwise reproducible after contacts of other sizes, which leave other restrictions in the cache."""

    def solve_with(system: ReducedSystem, radius: float) -> Array:
        height = (system.points[:, :2] ** 2).sum(axis=1) / 0.2
        problem = indentation_problem(system, height, radius**2 / 0.1, conductivity=(np.inf, np.inf), potentials=(5, 1))
        solution = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-8))
        assert solution.status is Status.CONVERGED
        return solution.state.load

    first, second = (system_of(HalfSpace(matrix_up_to=0), (40, 40), ANISOTROPIC) for _ in range(2))
    radii = np.array([0.16, 0.2, 0.24, 0.3]) * WIDTH
    loads = [solve_with(first, radius) for radius in radii]
    again = [solve_with(second, radius) for radius in radii[::-1]][::-1]
    for load, other in zip(loads, again, strict=True):
        np.testing.assert_array_equal(load, other)


@SOLVERS
def test_coarse_grids_without_contact(solver: Solver) -> None:
    """The coarse solution without contact gives a zero initial load in all fields."""
    system = grid(64)
    problem = press(system, (system.points**2).sum(axis=1), 0.0)
    if solver != ProjectedCG():
        problem = problem.with_laws(electric=StepConductivity(np.inf))
    solution = solve(problem, solver, StoppingCriteria(tolerance=1e-8))
    assert solution.status is Status.CONVERGED
    assert not solution.state.load.any()


FORWARDED = {FieldwiseApply, ApproximateInverse, Multigrid, Restriction}


def capabilities_of(system: ReducedSystem) -> set[type]:
    return {
        kind
        for kind in (*FORWARDED, LatticeStencil, EdgeResolution, Persistence)
        if system.capability(kind) is not None
    }


def radial(system: ReducedSystem) -> ReducedSystem:
    return rotate_frames(system, system.points - system.points.mean(axis=0))


def identical(system: ReducedSystem) -> ReducedSystem:
    return rotate_frames(system, np.tile([0.6, 0.8, 0.0], (len(system.points), 1)))


def edge_corrected(system: ReducedSystem) -> ReducedSystem:
    edge = (np.random.default_rng(0).random(len(system.points)) < 0.1)[:, None, None] * np.eye(5)
    return correct_edge(system, edge * system.diagonal_blocks())


@pytest.mark.full
@pytest.mark.parametrize(
    ("compose", "capabilities"),
    [
        (lambda system: combine_bodies(system, system), FORWARDED),
        (lambda system: combine_bodies(radial(system), identical(system)), FORWARDED),
        (lambda system: combine_bodies(system, MatrixFree.of(system)), {FieldwiseApply, ApproximateInverse}),
        (lambda system: combine_bodies(MatrixFree.of(system), system), {FieldwiseApply}),
        (radial, FORWARDED),
        (lambda system: rotate_frames(edge_corrected(system), radial(system).frames[:, 0]), FORWARDED - {Multigrid}),
        (OperationCounter.of, FORWARDED | {LatticeStencil}),
        (lambda system: OperationCounter.of(system, accelerated=False), {FieldwiseApply}),
        (MatrixFree.of, set()),
    ],
)
def test_capabilities_of_composed_systems(compose, capabilities: set[type]) -> None:
    """Each capability is forwarded and correct, or absent for the stated reason."""
    system = cached_system(*GRIDS[0])
    assert capabilities_of(system) == FORWARDED | {LatticeStencil}
    whole = compose(system)
    assert capabilities_of(whole) == capabilities
    check_capabilities(whole)
    nodes = np.flatnonzero(np.hypot(*(system.points[:, :2] - 1e-3).T) < 2e-3)
    restriction = whole.capability(Restriction)
    assert restriction is None or restriction.restrict(nodes) is not None


def test_two_bodies_without_common_coarse_nodes() -> None:
    """With an even number of nodes along x2, the rotated second body coarsens to the other nodes."""
    even = system_of(HalfSpace(matrix_up_to=0), (63, 63))
    assert even.capability(Multigrid) is not None
    assert combine_bodies(even, even).capability(Multigrid) is None
    odd = system_of(HalfSpace(matrix_up_to=0), (63, 64))
    assert combine_bodies(odd, odd).capability(Multigrid) is not None


@pytest.mark.full
def test_two_bodies_resolve_edges_if_both_do() -> None:
    resolved, nodal = (system_of(HalfSpace(matrix_up_to=0, edges=edges), (24, 24)) for edges in ("resolved", "nodes"))
    both = combine_bodies(resolved, rotate_frames(resolved, np.tile([0.6, 0.8, 0.0], (len(nodal.points), 1))))
    assert EdgeResolution in capabilities_of(both)
    check_capabilities(both)
    assert EdgeResolution not in capabilities_of(combine_bodies(resolved, nodal))
    assert EdgeResolution not in capabilities_of(correct_edge(resolved, 0.1 * resolved.diagonal_blocks()))


@pytest.mark.full
def test_two_bodies_use_nested_grids() -> None:
    """Nested grids save products and do not change the solution."""
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
class WrongCapability(
    ReducedSystem, FieldwiseApply, ApproximateInverse, Multigrid, LatticeStencil, Restriction, InteriorFields
):
    """A half space with a single incorrect capability."""

    inner: HalfSpaceSystem
    wrong: str

    @classmethod
    def of(cls, inner: ReducedSystem, wrong: str) -> "WrongCapability":
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
        computed = self.inner.apply_fields(load, sorted(loaded) if self.wrong == "loaded fields" else loaded, wanted)
        return 1.0001 * computed if self.wrong == "single precision" and load.dtype == np.float32 else computed

    def diagonal(self, fields: Sequence[int]) -> Array:
        return self.inner.diagonal(sorted(fields) if self.wrong == "diagonal" else fields)

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array]:
        inverse = self.inner.approximate_inverse(fields)
        return (lambda displacement: -inverse(displacement)) if self.wrong == "approximate_inverse" else inverse

    def series_inverse(self, fields: Sequence[int], resistances: Array) -> Callable[[Array], Array]:
        wrong = self.wrong == "series_inverse"
        return self.inner.series_inverse(fields, -2.0 * resistances if wrong else resistances)

    def prolongation(self, nodes: Indices) -> Prolongation:
        inner = self.inner.prolongation(nodes)
        if self.wrong == "adjoint of a prolongation":
            return replace(inner, restrict=lambda values: inner.restrict(2.0 * values))
        return replace(inner, prolong=np.copy) if self.wrong == "shape of a prolongation" else inner

    def coarsen(self) -> Coarsening:
        coarse = self.inner.coarsen()
        if self.wrong == "prolong":
            return replace(coarse, prolong=lambda values: 0.5 * coarse.prolong(values))
        if self.wrong == "weights":
            return replace(coarse, system=replace(coarse.system, weights=0.25 * coarse.system.weights))
        return replace(coarse, nodes=coarse.nodes[::-1]) if self.wrong == "points" else coarse

    def stencil(self, radius: int) -> Stencil | None:
        stencil = self.inner.stencil(radius)
        if stencil is not None and self.wrong == "stencil":
            return replace(stencil, responses=stencil.responses[:, ::-1])
        return replace(stencil, lattice=stencil.lattice[1:]) if stencil and self.wrong == "lattice" else stencil

    def restrict(self, nodes: Indices) -> Subsystem | None:
        part = self.inner.restrict(nodes[len(nodes) // 2 :] if self.wrong == "part" else nodes)
        if part is not None and self.wrong == "fields of a part":
            return replace(part, system=WrongCapability.of(part.system, "loaded fields"))
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
    + [(name, name) for name in ("approximate_inverse", "series_inverse", "prolong", "weights", "points", "diagonal")]
    + [("single precision", "apply_fields of loads float32")]
    + [("gradients", "are not the derivatives"), ("interior", "do not tend to those of recover at its surface")]
    + [("adjoint of a prolongation", "is not the adjoint"), ("shape of a prolongation", "of the wrong shape")]
    + [("stencil", "is not apply"), ("lattice", "has not each node once")]
    + [("part", "lacks some of the requested nodes"), ("nodes of a part", "points of a subsystem are not")],
)
def test_wrong_capabilities_are_detected(wrong: str, message: str) -> None:
    with pytest.raises(AssertionError, match=message):
        check_capabilities(WrongCapability.of(cached_system(*GRIDS[0]), wrong))


@pytest.mark.full
def test_correct_capabilities_pass_in_the_same_wrapper() -> None:
    check_capabilities(WrongCapability.of(cached_system(*GRIDS[0]), "nothing"))
