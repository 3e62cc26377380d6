"""Starts on a finer grid that the coarser one has corrected."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.contact.conduction import Mask
from meeframe.contact.nested import Coarse
from meeframe.contact.problem import ContactProblem, Status
from meeframe.elements import Quad4
from meeframe.fields import Indices
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import SemismoothNewton, StoppingCriteria, solve
from meeframe.solvers.newton import coarse_start as newton_coarse
from meeframe.solvers.newton import method as newton
from meeframe.solvers.newton.coarse_start import corrected, improved_start
from meeframe.solvers.newton.contact_edge import smooth_contact_edge
from meeframe.solvers.newton.neighbourhood import inset
from meeframe.solvers.newton.residual import ROUNDED, ContactResidual, ResidualState
from meeframe.solvers.newton.slip_boundary import smooth_slip_boundary
from meeframe.testing.force_control import PRESS, SLIDE, SLIDE_2, VOLTAGE, freedom
from meeframe.testing.half_space import indentation_problem

COULOMB = IsotropicCoulomb(0.3)
PERFECT = StepConductivity(np.inf)
DRAGGED = (3e-7, 1e-7)
WIDTH, RADIUS = 7e-3, 0.1
CASES = {"rough": 0.5, "insulated": 0.3, "orthotropic": 0.7, "smooth": 0.6, "periodic": 0.4, "free": 0.3, "finite": 0.8}
"""What may be left of the merit."""


@dataclass(frozen=True)
class Start:
    """What improved_start is given on the finest grid."""

    point: ResidualState
    nodes: Indices
    coarse: Coarse
    below: ContactResidual
    places: Indices

    @property
    def smooth(self) -> "Start":
        return replace(self, point=smooth_slip_boundary(smooth_contact_edge(self.point)))

    @property
    def known(self) -> tuple[Mask, Indices]:
        """Which of the coarse places the finer part has, and where: by their points."""
        fine = self.point.equation.problem.system.points
        near = [np.linalg.norm(fine - each, axis=1) for each in self.below.problem.system.points]
        same = np.array([distance.min() < 1e-9 * WIDTH for distance in near])
        return same, np.array([distance.argmin() for distance in near])[same]

    def ask(self, function: Callable[..., ResidualState]) -> ResidualState:
        return function(self.point, self.nodes, self.coarse, self.below, self.places)


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch) -> Callable[[ContactProblem], Start]:
    def make(problem: ContactProblem) -> Start:
        seen: list[Start] = []

        def kept(*given) -> ResidualState:
            seen.append(Start(*given))
            return improved_start(*given)

        with monkeypatch.context() as within:
            within.setattr(newton, "improved_start", kept)
            SemismoothNewton().init(problem, None)
        return seen[-1]

    return make


def periodic() -> ContactProblem:
    mesh = half_space_mesh(10.0 * WIDTH, WIDTH, 63, 1, Quad4())
    body = Body(library_material("orthotropic-mee").stiffness, mesh, (), "contact")
    system = HalfSpace("trigonometric", periodic=True, matrix_up_to=0).reduce(body)
    height = ((system.points[:, :2] - [1e-4, 2e-4]) ** 2).sum(axis=1) / (2.0 * RADIUS)
    depth = (0.25 * WIDTH) ** 2 / RADIUS
    return indentation_problem(system, height, depth, COULOMB, (np.inf, np.inf), (5.0, 1.0), DRAGGED)


@pytest.fixture
def made(conducting) -> Callable[..., ContactProblem]:
    """Maker of a problem by its name."""

    def make(name: str, n: int = 64) -> ContactProblem:
        if name == "periodic":
            return periodic()
        law = {"orthotropic": OrthotropicCoulomb(0.2, 0.5, 0.4), "smooth": Signorini()}.get(name, COULOMB)
        flux = {"insulated": Insulating(), "finite": StepConductivity(1e-4)}.get(name, PERFECT)
        problem = conducting(n, 0.3, law, flux, dragged=DRAGGED)
        if name != "free":
            return problem
        load = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-6)).state.load
        total = (problem.system.weights[:, None] * load).sum(axis=0)
        modes = [(PRESS, -total[2]), (SLIDE, total[0]), (SLIDE_2, total[1]), (VOLTAGE, total[3])]
        prescribed_resultants = tuple(freedom(problem.system, mode, 1.001 * amount) for mode, amount in modes)
        gap, still = problem.gap - problem.gap.min(), np.zeros_like(problem.translation)
        return replace(problem, prescribed_resultants=prescribed_resultants, gap=gap, translation=still)

    return make


def on_less(problem: ContactProblem, given: Start) -> Start:
    """The finer point on a part that is just around the contact, below it the whole coarser grid."""
    load, contact_fraction = np.zeros((len(problem.gap), 5)), np.zeros(len(problem.gap))
    load[given.nodes], contact_fraction[given.nodes] = given.point.load, given.point.contact_fraction
    part = inset(problem, load[:, 2] < 0.0)
    assert part is not None
    point = part.equation.at(
        load[part.nodes], contact_fraction[part.nodes], contact_fraction[part.nodes] % 1.0 > 0.0, given.point.motion
    )
    below = given.coarse.problem
    return Start(point, part.nodes, given.coarse, ContactResidual.of(below), np.arange(len(below.gap)))


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("less", [False, True], ids=["as given", "nodes beside"])
@pytest.mark.parametrize("name", CASES)
def test_the_coarse_grid_sees_what_the_finer_one_leaves(name: str, less: bool, made, start) -> None:
    """The laws of the finer equation, asked there: the same residual; and the load is that of its own equation."""
    problem = made(name)
    given = start(problem)
    given = (on_less(problem, given) if less and name != "periodic" else given).smooth
    same, at = given.known
    assert same.sum() > 100
    assert not less or name == "periodic" or not same.all()
    fine, point = given.point.equation, given.point
    own, lifted = given.below.own.copy(), given.below.lifted.copy()
    own[same], lifted[same] = fine.own[at], fine.lifted[at]
    alike = replace(given.below, scales=fine.scales, r=fine.r, own=own, lifted=lifted, units=fine.units)
    there = replace(given, below=alike).ask(newton_coarse._seen_from_below)
    single = (
        ROUNDED * alike.approximate_relative_displacement(there.load, point.motion)[1]
    )  # in which the coarse body was moved
    anew = there.equation.at(there.load, there.contact_fraction, there.grazing, there.motion)
    for found, bound in ((there, 1e-12), (anew, single)):
        np.testing.assert_allclose(found.residual[same], point.residual[at], rtol=0, atol=bound)
        totals, coarse_totals = (each.equation.scales.totals for each in (point, found))
        np.testing.assert_allclose(found.balance * coarse_totals / totals, point.balance, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(found.load[same], point.load[at])
    assert not there.load[~same].any()
    np.testing.assert_array_equal(there.equation.problem.gap[~same], given.below.problem.gap[~same])
    assert np.abs(there.equation.problem.gap - given.below.problem.gap).max() > 1e-6 * fine.scales.displacement[2]


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("name", CASES)
def test_solutions_of_the_finer_grid_stay(name: str, made, start) -> None:
    problem = made(name)
    solution = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-11))
    assert solution.status is Status.CONVERGED
    state, given = solution.state, start(problem).smooth
    kept, contact_fraction = given.nodes, state.contact_fraction[given.nodes]
    assert not np.delete(state.load, kept, axis=0).any()
    grazing = (contact_fraction > 0.0) & (contact_fraction < 1.0)
    point = given.point.equation.at(state.load[kept], contact_fraction, grazing, state.motion)
    assert point.violation < 1e-10
    found = replace(given, point=point).ask(corrected)
    scales, before = point.equation.scales, given.ask(corrected)
    changed = np.abs(found.load - point.load).max(axis=0) / scales.load
    otherwise = np.abs(before.load - given.point.load).max(axis=0) / scales.load
    assert changed.max() < 1e-8
    assert otherwise.max() > 1e-3  # of a start that is none


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("less", [False, True], ids=["as given", "nodes beside"])
@pytest.mark.parametrize("name", CASES)
def test_interpolated_starts_become_better(name: str, less: bool, made, start) -> None:
    """By another load that is admissible, at the nodes that had one."""
    problem = made(name)
    given = start(problem)
    given = (on_less(problem, given) if less and name != "periodic" else given).smooth  # which has no parts
    point, found = given.point, given.ask(corrected)
    assert found.merit < CASES[name] * point.merit
    expected = found.equation.at(found.load, found.contact_fraction, found.grazing, found.motion)
    assert found.merit == pytest.approx(expected.merit, rel=1e-4)
    scales, law = found.equation.scales, problem.contact_law
    admissible = law.project(found.load[:, :3])
    np.testing.assert_allclose(found.load[:, :3], admissible, rtol=0, atol=1e-14 * scales.pressure)
    assert not found.load[point.load == 0.0].any()
    assert (found.motion != point.motion).any() == (name == "free")


def test_nodes_without_an_indenter_have_no_relative_displacement(made, start) -> None:
    """A sphere that ends within the zone, some of its nodes in the part: what is left is corrected as elsewhere."""
    whole = made("insulated")
    ends = np.hypot(*whole.system.points[:, :2].T) < 0.38 * WIDTH
    problem = replace(whole, gap=np.where(ends, whole.gap, np.inf))
    given = start(problem).smooth
    assert not np.isfinite(given.point.equation.problem.gap).all()
    there, found = given.ask(newton_coarse._seen_from_below), given.ask(corrected)
    same, at = given.known
    np.testing.assert_array_equal(there.equation.problem.gap == np.inf, given.below.problem.gap == np.inf)
    assert np.isfinite(there.merit)
    np.testing.assert_array_equal(there.load[same], given.point.load[at])
    assert found.merit < CASES["insulated"] * given.point.merit
