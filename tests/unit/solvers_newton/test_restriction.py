"""Newton's method restricted to a neighbourhood of the contact agrees with that on the whole zone."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.contact.channels import flux_channels
from meeframe.contact.conduction import Mask
from meeframe.contact.nested import coarse_problem
from meeframe.contact.problem import ContactProblem, ContactSolution, ContactState, PrescribedResultant, Status
from meeframe.contact.residual import law_residual
from meeframe.contact.scales import problem_scales
from meeframe.elements import Quad4
from meeframe.fields import Array, Indices
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ContactLaw
from meeframe.material import Material, library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import SemismoothNewton, StoppingCriteria, solve
from meeframe.solvers.driver import resolve_edges
from meeframe.solvers.newton import method as newton
from meeframe.solvers.newton.linear import Step
from meeframe.solvers.newton.neighbourhood import ContactNeighbourhood, contact_neighbourhood
from meeframe.solvers.newton.residual import ContactResidual
from meeframe.system.reduced import ReducedSystem
from meeframe.system.two_body import combine_bodies
from meeframe.testing.operation_counter import OperationCounter

WIDTH, RADIUS, MU = 1e-2, 0.1, 0.3
LIMITS = StoppingCriteria(tolerance=1e-10)


def half_space(n: int = 63, stiffness: Array | None = None, **options: Any) -> ReducedSystem:
    body = Body(
        library_material("orthotropic-mee").stiffness if stiffness is None else stiffness,
        half_space_mesh(10.0 * WIDTH, WIDTH, n, 1, Quad4()),
        (),
        "contact",
    )
    return HalfSpace(matrix_up_to=0, **options).reduce(body)


def sphere(system: ReducedSystem, at: Sequence[float], contact: float = 0.15, **given: Any) -> ContactProblem:
    """Return a problem of a sphere at a position [widths], conducting and with friction, moved slightly along the
    surface."""
    depth = (contact * WIDTH) ** 2 / RADIUS
    gap = ((system.points[:, :2] - WIDTH * np.array(at)) ** 2).sum(axis=1) / (2.0 * RADIUS) - depth
    translation, flux = np.tile([0.3 * MU * depth, 0.0], (len(gap), 1)), StepConductivity(np.inf)
    problem = ContactProblem(
        system, IsotropicCoulomb(MU), flux_channels(flux, flux), gap, translation, np.tile([5.0, 1.0], (len(gap), 1))
    )
    return replace(problem, **given)


def solutions(
    problem: ContactProblem, monkeypatch: pytest.MonkeyPatch, start: ContactState | None = None
) -> tuple[ContactSolution, ContactSolution]:
    """Return solutions with and without restriction; the latter comes second, so that the first one computes
    entries."""
    computed = solve(problem, SemismoothNewton(), LIMITS, start)
    with monkeypatch.context() as without:
        without.setattr(newton, "contact_neighbourhood", lambda problem, contact: None)
        return computed, solve(problem, SemismoothNewton(), LIMITS, start)


def record_sizes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list that records the sizes of all restrictions from now on."""
    sizes: list[int] = []

    class Recorder(ContactNeighbourhood):
        def __init__(self, problem: ContactProblem, nodes: Indices, equation: Any) -> None:
            super().__init__(problem, nodes, equation)
            sizes.append(len(nodes))

    monkeypatch.setattr("meeframe.solvers.newton.neighbourhood.ContactNeighbourhood", Recorder)
    return sizes


def check_same(computed: ContactSolution, other: ContactSolution) -> None:
    assert computed.status is other.status is Status.CONVERGED
    for field in range(5):
        largest = np.abs(other.state.load[:, field]).max()
        np.testing.assert_allclose(
            computed.state.load[:, field], other.state.load[:, field], atol=1e-7 * largest, rtol=0
        )
    np.testing.assert_array_equal(computed.state.contact_fraction > 0.0, other.state.contact_fraction > 0.0)


def prescribed_resultants(system: ReducedSystem, force: float) -> tuple[PrescribedResultant, ...]:
    """Return a normal force and half of the tangential force that friction can carry."""
    totals, computed = {2: -force, 0: 0.5 * MU * force, 1: 0.0}, []
    for field, total in totals.items():
        mode = np.zeros_like(system.offset)
        mode[:, field] = 1.0
        computed.append(PrescribedResultant(mode, mode, system.weights, total))
    return tuple(computed)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    "given",
    [
        {},
        {"at": (0.42, -0.4)},  # over the corner of the zone
        {"contact_law": Signorini()},
        {"channels": flux_channels(Insulating(), StepConductivity(1e-9))},
        {"force": 40.0},
        {"pair": True},
    ],
    ids=["fixed", "corner", "frictionless", "resistance", "force", "pair"],
)
def test_restriction_does_not_change_the_solution(given: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    given = dict(given)
    body, other = half_space(), Material.isotropic(1e11, 0.25).stiffness
    system = OperationCounter.of(
        combine_bodies(body, half_space(stiffness=other)) if given.pop("pair", False) else body
    )
    at, force = given.pop("at", (0.05, -0.1)), given.pop("force", None)
    problem = sphere(system, at, **given)
    if force is not None:
        still = np.zeros_like(problem.translation)
        gap = problem.gap - problem.gap.min()
        problem = replace(
            problem, gap=gap, translation=still, prescribed_resultants=prescribed_resultants(system, force)
        )
    sizes = record_sizes(monkeypatch)
    restricted, unrestricted = solutions(problem, monkeypatch)
    assert min(sizes) < 0.5 * len(problem.gap)
    check_same(restricted, unrestricted)


def halve_restrictions(problem: ContactProblem, contact: Mask) -> ContactNeighbourhood | None:
    """Reduce every restriction to half of the requested nodes."""
    return contact_neighbourhood(problem, contact & (problem.system.points[:, 0] > 0.05 * WIDTH))


@pytest.mark.full
def test_contact_outside_the_restriction_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = sphere(half_space(), (0.05, -0.1))
    with monkeypatch.context() as given:
        given.setattr(newton, "contact_neighbourhood", halve_restrictions)
        computed = solve(problem, SemismoothNewton(), LIMITS)
    check_same(computed, solutions(problem, monkeypatch)[1])


@pytest.mark.full
@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(MU)], ids=["smooth", "rough"])
def test_asperity_outside_the_restriction_is_found(law: ContactLaw, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither the coarser grid nor the restriction contains it."""
    smooth = sphere(half_space(), (0.05, -0.1), contact_law=law)
    coarse = coarse_problem(smooth)
    assert coarse is not None
    between = np.setdiff1d(np.arange(len(smooth.gap)), coarse.coarsening.nodes)
    position = WIDTH * np.array([-0.36, 0.35])
    node = between[np.linalg.norm(smooth.system.points[between, :2] - position, axis=1).argmin()]
    bump = np.arange(len(smooth.gap)) == node
    problem = replace(smooth, gap=np.where(bump, 0.6 * smooth.gap.min(), smooth.gap))
    started = SemismoothNewton().init(problem, None).memory_as(newton._Memory)
    assert started.neighbourhood is not None
    assert node not in started.neighbourhood.nodes
    restricted, unrestricted = solutions(problem, monkeypatch)
    check_same(restricted, unrestricted)
    assert restricted.state.load[node, 2] < 0.0
    assert law_residual(problem, restricted.state, problem_scales(problem)) <= LIMITS.tolerance


@pytest.mark.full
def test_failed_step_leads_to_the_whole_zone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gradient steps are made on the whole problem only."""
    problem = sphere(half_space(), (0.05, -0.1))
    step, failed = newton.newton_step, list[int]()

    def once_without(equation: ContactResidual, *given: Any) -> Step:
        computed = step(equation, *given)
        if failed or len(equation.blocks) == equation.count:
            return computed
        failed.append(len(equation.blocks))
        return replace(computed, local=np.full_like(computed.local, np.nan))

    with monkeypatch.context() as given:
        given.setattr(newton, "newton_step", once_without)
        computed = solve(problem, SemismoothNewton(), LIMITS)
    assert failed
    check_same(computed, solutions(problem, monkeypatch)[1])


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("before", "after"), [((0.05, -0.1), (0.08, -0.1)), ((0.4, 0.4), (-0.4, -0.4))])
def test_earlier_solutions_have_no_influence(
    before: tuple[float, float], after: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A load step from a converged state starts on a restriction, without data of the earlier contact."""
    system = half_space()
    start = solve(sphere(system, before), SemismoothNewton(), LIMITS).state
    sizes = record_sizes(monkeypatch)
    restricted, unrestricted = solutions(sphere(system, after), monkeypatch, start)
    assert sizes
    check_same(restricted, unrestricted)
    for solution in (restricted, unrestricted):
        open_ = solution.state.contact_fraction == 0.0
        assert not solution.state.load[open_].any()


def test_shrinking_contact_uses_a_restriction(monkeypatch: pytest.MonkeyPatch) -> None:
    system = half_space()
    start = solve(sphere(system, (0.0, 0.0), 0.5), SemismoothNewton(), LIMITS).state
    assert contact_neighbourhood(sphere(system, (0.0, 0.0)), start.load.any(axis=1)) is None
    sizes = record_sizes(monkeypatch)
    restricted, unrestricted = solutions(sphere(system, (0.0, 0.0)), monkeypatch, start)
    assert sizes
    check_same(restricted, unrestricted)


def test_edge_resolution_on_a_restriction(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes with an area fraction conduct without pressure, so the restriction contains them."""
    problem = sphere(half_space(edges="resolved"), (0.05, -0.1))
    start = solve(problem, SemismoothNewton(), LIMITS).state
    finer = resolve_edges(problem, start)
    assert finer is not None
    sizes = record_sizes(monkeypatch)
    restricted, unrestricted = solutions(finer, monkeypatch, start)
    assert sizes
    check_same(restricted, unrestricted)


def test_tilt_shifts_a_paraboloid(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tilted paraboloid is a shifted one; the prescribed moment determines its position."""
    system, force, shift = half_space(), 40.0, 0.1 * WIDTH
    about, still = (0.05, -0.1), np.zeros((len(system.points), 2))
    plain, shifted = (
        replace(
            problem,
            gap=problem.gap - problem.gap.min(),
            translation=still,
            prescribed_resultants=prescribed_resultants(system, force),
        )
        for problem in (sphere(system, at, contact_law=Signorini()) for at in (about, (0.15, -0.1)))
    )
    mode = np.zeros_like(system.offset)
    mode[:, 2] = system.points[:, 0] - about[0] * WIDTH
    press = plain.prescribed_resultants[0]
    there = solve(replace(shifted, prescribed_resultants=(press,)), SemismoothNewton(), LIMITS)
    moment = float((system.weights * mode[:, 2]) @ there.state.load[:, 2])
    assert moment == pytest.approx(-force * shift, rel=0.05)  # not axisymmetric, and divided into nodes
    tilt = PrescribedResultant(mode, mode, system.weights, moment)
    tilted = replace(plain, prescribed_resultants=(press, tilt))
    sizes = record_sizes(monkeypatch)
    check_same(solve(tilted, SemismoothNewton(), LIMITS), there)
    assert sizes


def test_restriction_uses_the_scales_of_the_whole_problem() -> None:
    """A tilt moves the border of the zone farther than that of a restriction."""
    system = half_space()
    problem, mode = sphere(system, (0.0, 0.0)), np.zeros_like(system.offset)
    mode[:, 2] = system.points[:, 0]
    tilted = replace(problem, prescribed_resultants=(PrescribedResultant(mode, mode, system.weights, 0.0),))
    part = contact_neighbourhood(tilted, problem.gap < 0.0)
    assert part is not None
    np.testing.assert_array_equal(part.equation.units, ContactResidual.of(tilted).units)


def test_indenter_edge_inside_a_restriction(monkeypatch: pytest.MonkeyPatch) -> None:
    """A circular flat punch has no indenter above the other nodes."""
    system = half_space()
    problem, radius = sphere(system, (0.0, 0.0)), np.hypot(*system.points[:, :2].T)
    punch = replace(problem, gap=np.where(radius < 0.2 * WIDTH, -1e-3 * WIDTH, np.inf))
    sizes = record_sizes(monkeypatch)
    restricted, unrestricted = solutions(punch, monkeypatch)
    assert sizes
    assert (restricted.state.load[np.isfinite(punch.gap), 2] < 0.0).mean() > 0.5
    check_same(restricted, unrestricted)
