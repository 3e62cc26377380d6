"""Newton's method on the part of a half space around the contact, against the same on all of it."""

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
    """A sphere pressed onto a place [widths], conducting and rubbing, dragged a little."""
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
    """With parts and without; the second one beforehand would find entries made."""
    found = solve(problem, SemismoothNewton(), LIMITS, start)
    with monkeypatch.context() as without:
        without.setattr(newton, "contact_neighbourhood", lambda problem, contact: None)
        return found, solve(problem, SemismoothNewton(), LIMITS, start)


def sizes_of_parts(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Of all that are taken from now on."""
    sizes: list[int] = []

    class Seen(ContactNeighbourhood):
        def __init__(self, problem: ContactProblem, nodes: Indices, equation: Any) -> None:
            super().__init__(problem, nodes, equation)
            sizes.append(len(nodes))

    monkeypatch.setattr("meeframe.solvers.newton.neighbourhood.ContactNeighbourhood", Seen)
    return sizes


def check_alike(found: ContactSolution, other: ContactSolution) -> None:
    assert found.status is other.status is Status.CONVERGED
    for field in range(5):
        largest = np.abs(other.state.load[:, field]).max()
        np.testing.assert_allclose(found.state.load[:, field], other.state.load[:, field], atol=1e-7 * largest, rtol=0)
    np.testing.assert_array_equal(found.state.contact_fraction > 0.0, other.state.contact_fraction > 0.0)


def prescribed_resultants(system: ReducedSystem, force: float) -> tuple[PrescribedResultant, ...]:
    """Pressed by a force and dragged with half of what friction bears."""
    totals, found = {2: -force, 0: 0.5 * MU * force, 1: 0.0}, []
    for field, total in totals.items():
        mode = np.zeros_like(system.offset)
        mode[:, field] = 1.0
        found.append(PrescribedResultant(mode, system.weights[:, None] * mode, total))
    return tuple(found)


@pytest.mark.full(except_for=3)
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
def test_parts_have_the_solution_of_the_whole(given: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
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
    sizes = sizes_of_parts(monkeypatch)
    found, whole = solutions(problem, monkeypatch)
    assert min(sizes) < 0.5 * len(problem.gap)
    check_alike(found, whole)


def halved(problem: ContactProblem, contact: Mask) -> ContactNeighbourhood | None:
    """Parts that have too little, wherever they are taken: half of what was asked for."""
    return contact_neighbourhood(problem, contact & (problem.system.points[:, 0] > 0.05 * WIDTH))


def test_contact_beside_the_part_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = sphere(half_space(), (0.05, -0.1))
    with monkeypatch.context() as given:
        given.setattr(newton, "contact_neighbourhood", halved)
        found = solve(problem, SemismoothNewton(), LIMITS)
    check_alike(found, solutions(problem, monkeypatch)[1])


@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(MU)], ids=["smooth", "rough"])
def test_an_asperity_between_coarse_nodes_beside_the_part_is_found(
    law: ContactLaw, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The coarser grid does not see it, and the part does not hold it."""
    smooth = sphere(half_space(), (0.05, -0.1), contact_law=law)
    coarse = coarse_problem(smooth)
    assert coarse is not None
    between = np.setdiff1d(np.arange(len(smooth.gap)), coarse.coarsening.nodes)
    place = WIDTH * np.array([-0.36, 0.35])
    node = between[np.linalg.norm(smooth.system.points[between, :2] - place, axis=1).argmin()]
    bump = np.arange(len(smooth.gap)) == node
    problem = replace(smooth, gap=np.where(bump, 0.6 * smooth.gap.min(), smooth.gap))
    started = SemismoothNewton().init(problem, None).memory_as(newton._Memory)
    assert started.neighbourhood is not None
    assert node not in started.neighbourhood.nodes
    found, whole = solutions(problem, monkeypatch)
    check_alike(found, whole)
    assert found.state.load[node, 2] < 0.0
    assert law_residual(problem, found.state, problem_scales(problem)) <= LIMITS.tolerance


def test_a_part_without_a_step_gives_way_to_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before gradient steps are made, which are those of the whole problem."""
    problem = sphere(half_space(), (0.05, -0.1))
    step, failed = newton.newton_step, list[int]()

    def once_without(equation: ContactResidual, *given: Any) -> Step:
        found = step(equation, *given)
        if failed or len(equation.blocks) == equation.count:
            return found
        failed.append(len(equation.blocks))
        return replace(found, local=np.full_like(found.local, np.nan))

    with monkeypatch.context() as given:
        given.setattr(newton, "newton_step", once_without)
        found = solve(problem, SemismoothNewton(), LIMITS)
    assert failed
    check_alike(found, solutions(problem, monkeypatch)[1])


@pytest.mark.parametrize(("before", "after"), [((0.05, -0.1), (0.08, -0.1)), ((0.4, 0.4), (-0.4, -0.4))])
def test_what_was_solved_before_does_not_matter(
    before: tuple[float, float], after: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A load step from a converged state goes on in a part, and nothing is left of the contact that was."""
    system = half_space()
    start = solve(sphere(system, before), SemismoothNewton(), LIMITS).state
    sizes = sizes_of_parts(monkeypatch)
    found, whole = solutions(sphere(system, after), monkeypatch, start)
    assert sizes
    check_alike(found, whole)
    for solution in (found, whole):
        open_ = solution.state.contact_fraction == 0.0
        assert not solution.state.load[open_].any()


def test_contact_that_shrinks_gets_a_part(monkeypatch: pytest.MonkeyPatch) -> None:
    system = half_space()
    start = solve(sphere(system, (0.0, 0.0), 0.5), SemismoothNewton(), LIMITS).state
    assert contact_neighbourhood(sphere(system, (0.0, 0.0)), start.load.any(axis=1)) is None
    sizes = sizes_of_parts(monkeypatch)
    found, whole = solutions(sphere(system, (0.0, 0.0)), monkeypatch, start)
    assert sizes
    check_alike(found, whole)


def test_edges_between_nodes_in_a_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes that are covered in part conduct without pressure, so that they belong to it."""
    problem = sphere(half_space(edges="resolved"), (0.05, -0.1))
    start = solve(problem, SemismoothNewton(), LIMITS).state
    finer = resolve_edges(problem, start)
    assert finer is not None
    sizes = sizes_of_parts(monkeypatch)
    found, whole = solutions(finer, monkeypatch, start)
    assert sizes
    check_alike(found, whole)


def test_a_tilt_shifts_a_paraboloid(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tilted, it is the same one elsewhere: where the moment of the force is the prescribed one."""
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
    tilt = PrescribedResultant(mode, system.weights[:, None] * mode, moment)
    tilted = replace(plain, prescribed_resultants=(press, tilt))
    sizes = sizes_of_parts(monkeypatch)
    check_alike(solve(tilted, SemismoothNewton(), LIMITS), there)
    assert sizes


def test_parts_measure_in_the_units_of_the_whole() -> None:
    """A tilt moves the border of the zone farther than that of a part."""
    system = half_space()
    problem, mode = sphere(system, (0.0, 0.0)), np.zeros_like(system.offset)
    mode[:, 2] = system.points[:, 0]
    tilted = replace(problem, prescribed_resultants=(PrescribedResultant(mode, system.weights[:, None] * mode, 0.0),))
    part = contact_neighbourhood(tilted, problem.gap < 0.0)
    assert part is not None
    np.testing.assert_array_equal(part.equation.units, ContactResidual.of(tilted).units)


def test_indenters_that_end_in_a_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """A round flat punch: no indenter above the other nodes."""
    system = half_space()
    problem, radius = sphere(system, (0.0, 0.0)), np.hypot(*system.points[:, :2].T)
    punch = replace(problem, gap=np.where(radius < 0.2 * WIDTH, -1e-3 * WIDTH, np.inf))
    sizes = sizes_of_parts(monkeypatch)
    found, whole = solutions(punch, monkeypatch)
    assert sizes
    assert (found.state.load[np.isfinite(punch.gap), 2] < 0.0).mean() > 0.5
    check_alike(found, whole)
