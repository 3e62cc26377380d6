"""The conformance check names the fault of solvers that are each wrong in one way."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import pytest

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver, Status, contact_gap
from meeframe.fields import Array
from meeframe.laws import Insulating, OrthotropicCoulomb, Signorini
from meeframe.laws.base import ConductivityLaw, ContactLaw, StepLengths, attraction, augmented_traction, resolve
from meeframe.solvers import ProjectedCG, SemismoothNewton, StoppingCriteria, Uzawa, solve
from meeframe.system.dense import DenseSystem
from meeframe.testing.contact import check_solver
from meeframe.testing.half_space import half_space_system, indentation_problem

LIMITS = StoppingCriteria(max_iterations=60)
INNER = SemismoothNewton()


@dataclass(frozen=True)
class WrongSolver(Solver):
    """Newton steps on a modified problem, or with a modified step."""

    check_interval: ClassVar[int] = SemismoothNewton.check_interval

    def problem(self, problem: ContactProblem) -> ContactProblem:
        return problem

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        return INNER.init(self.problem(problem), start)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        return INNER.step(self.problem(problem), iterate)


@dataclass(frozen=True)
class SolvesAnother(WrongSolver):
    """A solver of a problem in which something is missing, exchanged or added."""

    change: Callable[[ContactProblem], ContactProblem]

    def problem(self, problem: ContactProblem) -> ContactProblem:
        return self.change(problem)


def without_initial_gap(problem: ContactProblem) -> ContactProblem:
    """Use the gap of a flat indenter in eq. (31)."""
    return replace(problem, gap=np.where(np.isfinite(problem.gap), problem.gap.min(), np.inf))


def without_offset(problem: ContactProblem) -> ContactProblem:
    return replace(problem, system=replace(problem.system, offset=np.zeros_like(problem.system.offset)))


def without_conductivity(problem: ContactProblem) -> ContactProblem:
    return replace(problem, channels=flux_channels(Insulating(), Insulating()))


def with_exchanged_conductivities(problem: ContactProblem) -> ContactProblem:
    return problem.with_laws(electric=problem.law_of("magnetic"), magnetic=problem.law_of("electric"))


def without_potentials(problem: ContactProblem) -> ContactProblem:
    return replace(problem, potentials=np.zeros_like(problem.potentials))


def with_reversed_potentials(problem: ContactProblem) -> ContactProblem:
    return replace(problem, potentials=-problem.potentials)


def with_reversed_slip(problem: ContactProblem) -> ContactProblem:
    return replace(problem, translation=-problem.translation)


def without_coupling(problem: ContactProblem) -> ContactProblem:
    """Neglect the deformation due to potentials."""
    assert isinstance(problem.system, DenseSystem)
    matrix = problem.system.matrix.copy()
    matrix[:, :3, :, 3:] = 0.0
    return replace(problem, system=replace(problem.system, matrix=matrix))


def without_friction(problem: ContactProblem) -> ContactProblem:
    return replace(problem, contact_law=Signorini())


def with_swapped_coefficients(problem: ContactProblem) -> ContactProblem:
    law = problem.contact_law
    if isinstance(law, OrthotropicCoulomb):
        return replace(problem, contact_law=OrthotropicCoulomb(law.mu2, law.mu1, law.angle))
    return problem


def without_angle(problem: ContactProblem) -> ContactProblem:
    law = problem.contact_law
    if isinstance(law, OrthotropicCoulomb):
        return replace(problem, contact_law=OrthotropicCoulomb(law.mu1, law.mu2))
    return problem


@dataclass(frozen=True)
class UnitMetric(ContactLaw):
    """The projection of a law with a unit step."""

    law: ContactLaw

    def project(self, trial: Array) -> Array:
        return self.law.project(trial)

    def tangential_scaling(self) -> Array:
        return np.eye(2)


def without_metric(problem: ContactProblem) -> ContactProblem:
    if problem.contact_law == Signorini():
        return problem
    return replace(problem, contact_law=UnitMetric(problem.contact_law))


@dataclass(frozen=True, eq=False)
class LimitOf(ContactLaw):
    """A friction limit with pressures (n,) other than those of the iteration."""

    law: ContactLaw
    pressure: Array

    def project(self, trial: Array) -> Array:
        normal = np.minimum(trial[:, 2], 0.0)
        stale = self.law.project(np.column_stack([trial[:, :2], -self.pressure]))
        return np.where(normal[:, None] < 0.0, np.column_stack([stale[:, :2], normal]), 0.0)

    def tangential_scaling(self) -> Array:
        return self.law.tangential_scaling()


@lru_cache(maxsize=1)
def with_stale_pressure(problem: ContactProblem) -> ContactProblem:
    """Use the friction limit of the frictionless pressure."""
    if problem.contact_law == Signorini():
        return problem
    pressure = -solve(without_friction(problem), SemismoothNewton()).state.load[:, 2]
    return replace(problem, contact_law=LimitOf(problem.contact_law, pressure))


@dataclass(frozen=True)
class Pulling(ContactLaw):
    """A law that transmits tension."""

    law: ContactLaw

    def project(self, trial: Array) -> Array:
        traction = self.law.project(trial)
        traction[:, 2] = np.where(np.isfinite(trial[:, 2]), trial[:, 2], 0.0)
        return traction

    def tangential_scaling(self) -> Array:
        return self.law.tangential_scaling()


def with_tension(problem: ContactProblem) -> ContactProblem:
    return replace(problem, contact_law=Pulling(problem.contact_law))


@dataclass(frozen=True)
class ProjectionOf(ContactLaw):
    """The projection of a law without its other methods."""

    law: ContactLaw

    def project(self, trial: Array) -> Array:
        return self.law.project(trial)

    def tangential_scaling(self) -> Array:
        return self.law.tangential_scaling()


def with_projection_only(problem: ContactProblem) -> ContactProblem:
    return replace(problem, contact_law=ProjectionOf(problem.contact_law))


@dataclass(frozen=True)
class WithoutAttraction(ProjectionOf):
    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        return resolve(self.law, trial, gap, r)


def without_attraction(problem: ContactProblem) -> ContactProblem:
    return replace(problem, contact_law=WithoutAttraction(problem.contact_law))


@dataclass(frozen=True)
class WithoutSlip(WithoutAttraction):
    """A friction limit without the influence of slip."""

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        return resolve(self.law, trial, gap * [0.0, 0.0, 1.0], r)

    def adhesion(self, gap: Array) -> Array:
        return attraction(self.law, gap)


def without_slip(problem: ContactProblem) -> ContactProblem:
    return replace(problem, contact_law=WithoutSlip(problem.contact_law))


@dataclass(frozen=True)
class PartOfConductivity(ConductivityLaw):
    """A conductivity law that receives only part of gap and drop."""

    across_gap: ClassVar[bool] = True

    law: ConductivityLaw
    gap: float = 1.0
    drop: float = 1.0

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        return self.law.conductivity(normal_traction, self.gap * gap, self.drop * drop)


def without_drop(problem: ContactProblem) -> ContactProblem:
    electric, magnetic = (PartOfConductivity(channel.law, drop=0.0) for channel in problem.channels)
    return replace(problem, channels=flux_channels(electric, magnetic))


def without_gap_of_conduction(problem: ContactProblem) -> ContactProblem:
    electric, magnetic = (PartOfConductivity(channel.law, gap=0.0) for channel in problem.channels)
    return replace(problem, channels=flux_channels(electric, magnetic))


def with_smaller_resultants(problem: ContactProblem) -> ContactProblem:
    return replace(
        problem, prescribed_resultants=tuple(replace(f, total=0.99 * f.total) for f in problem.prescribed_resultants)
    )


@dataclass(frozen=True)
class Reports(WrongSolver):
    """A solver with correct iterates, which are stored in the memory, that reports something else."""

    change: Callable[[Iterate], Iterate]

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        inner = INNER.init(problem, start)
        return replace(self.change(inner), memory=inner)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        assert isinstance(iterate.memory, Iterate)
        inner = INNER.step(problem, iterate.memory)
        return replace(self.change(inner), memory=inner)


def closed_everywhere(iterate: Iterate) -> Iterate:
    return replace(iterate, contact_fraction=np.ones_like(iterate.contact_fraction))


def open_everywhere(iterate: Iterate) -> Iterate:
    return replace(iterate, contact_fraction=np.zeros_like(iterate.contact_fraction))


def nearly_right(iterate: Iterate) -> Iterate:
    return replace(iterate, load=1.0003 * iterate.load)


class ForgetsTheStart(WrongSolver):
    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        return INNER.init(problem, None)


class ChangesItsArgument(WrongSolver):
    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        moved = INNER.step(problem, iterate)
        iterate.load[:] = moved.load
        return moved


class ChangesTheStart(WrongSolver):
    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        iterate = INNER.init(problem, start)
        if start is not None:
            start.contact_fraction[:] = 0.5
        return iterate


class ChangesTheProblem(WrongSolver):
    """A solver that moves the indenter onto the body."""

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        displacement = problem.system.offset + problem.system.apply(iterate.load)
        problem.gap[:] = np.where(np.isfinite(problem.gap), displacement[:, 2], np.inf)
        problem.translation[:] = displacement[:, :2]
        return iterate


@dataclass(frozen=True)
class CountsItsCalls(WrongSolver):
    """A solver whose step depends on the number of calls."""

    calls: list[None] = field(default_factory=list, compare=False)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        self.calls.append(None)
        moved = INNER.step(problem, iterate)
        return replace(moved, load=moved.load * (1.0 + 1e-13 * (len(self.calls) % 7)))


@dataclass(frozen=True)
class ReusesItsArrays(WrongSolver):
    """A solver that writes every load into the same array."""

    kept: list[Array] = field(default_factory=list, compare=False)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        moved = INNER.step(problem, iterate)
        if not self.kept:
            self.kept.append(np.empty_like(moved.load))
        self.kept[0][:] = moved.load
        return replace(moved, load=self.kept[0])


class SlowInLargeUnits(WrongSolver):
    """A solver with short steps where tractions are small numbers."""

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        moved = INNER.step(problem, iterate)
        if np.abs(moved.load[:, 2]).max() > 1e3:
            return moved
        return replace(moved, load=0.5 * (iterate.load + moved.load))


@dataclass(frozen=True)
class MechanicalNewton(Solver):
    """Newton's method on p = project(p + r S g) without fluxes; `nodes` includes the interaction of nodes."""

    nodes: bool

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        load = np.zeros_like(problem.system.offset) if start is None else start.load
        return Iterate(load, np.asarray(load[:, 2] < 0.0, float))

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        n, law = len(problem.gap), problem.contact_law
        matrix = problem.system.dense()
        assert matrix is not None
        compliance = matrix[:, :3, :, :3]
        scaled = np.eye(3)
        scaled[:2, :2] = law.tangential_scaling()
        r = 1.0 / np.abs(compliance).sum(axis=(2, 3)).max()
        displacement = problem.system.offset + problem.system.apply(iterate.load)
        traction = iterate.load[:, :3]
        trial = augmented_traction(law, traction, contact_gap(problem, displacement), (r, r))
        tangent = law.tangent(trial)
        rows = np.einsum("nij,jk,nkml->niml", tangent, r * scaled, compliance)
        if not self.nodes:
            rows = np.where(np.eye(n, dtype=bool)[:, None, :, None], rows, 0.0)
        local = np.zeros((n, 3, n, 3))
        local[np.arange(n), :, np.arange(n)] = np.eye(3) - tangent
        step = np.linalg.solve((local + rows).reshape(3 * n, 3 * n), (law.project(trial) - traction).ravel())
        load = iterate.load.copy()
        load[:, :3] += step.reshape(n, 3)
        return Iterate(load, np.asarray(trial[:, 2] < 0.0, float))


@pytest.fixture
def problem() -> ContactProblem:
    system = half_space_system(np.diag([1.0, 1.0, 1.0, -1.0, -1.0]), 2.0, 5)
    return indentation_problem(system, 0.5 * (system.points**2).sum(axis=1), 0.3)


def another(change: Callable[[ContactProblem], ContactProblem], message: str) -> Any:
    return pytest.param(SolvesAnother(change), message, id=change.__name__)


def reports(change: Callable[[Iterate], Iterate], message: str) -> Any:
    return pytest.param(Reports(change), message, id=change.__name__)


FLUX = r"the worst condition is '(electric|magnetic) flux'"
FRICTION = r"the worst condition is '(friction limit|slip)'"


@pytest.mark.full
@pytest.mark.parametrize(
    ("solver", "message"),
    [
        another(without_offset, "^insulated: .*the worst condition is '(pressure or gap|penetration|slip)'"),
        another(without_initial_gap, "^insulated: .*the worst condition is '(pressure or gap|penetration)'"),
        another(with_tension, "^insulated: .*the worst condition is 'tension'"),
        another(without_conductivity, f"^conducting: .*{FLUX}"),
        another(with_exchanged_conductivities, f"^resistive: .*{FLUX}"),
        another(without_potentials, f"^conducting: .*{FLUX}"),
        another(with_reversed_potentials, f"^conducting: .*{FLUX}"),
        another(without_coupling, "^conducting: "),
        another(without_friction, f"^friction: .*{FRICTION}"),
        another(with_reversed_slip, f"^friction: .*{FRICTION}"),
        another(with_swapped_coefficients, f"^friction: .*{FRICTION}"),
        another(without_angle, f"^friction: .*{FRICTION}"),
        another(without_metric, f"^friction: .*{FRICTION}"),
        another(with_stale_pressure, f"^friction: .*{FRICTION}"),
        another(with_projection_only, "^soft surfaces: .*the worst condition is '(penetration|pressure or gap)'"),
        another(
            without_attraction,
            "^soft surfaces: .*the worst condition is '(tension|penetration|pressure or gap|closed fraction)'",
        ),
        another(without_slip, f"^soft surfaces: .*{FRICTION}"),
        another(without_drop, f"^across the gap: .*{FLUX}"),
        another(without_gap_of_conduction, f"^across the gap: .*{FLUX}"),
        another(with_smaller_resultants, "^resultants: .*the worst condition is 'prescribed resultant'"),
        reports(closed_everywhere, "^insulated: .*the worst condition is 'closed fraction'"),
        reports(open_everywhere, "^insulated: .*the worst condition is 'closed fraction'"),
        reports(nearly_right, "^insulated: residual"),
        pytest.param(ForgetsTheStart(), "leaves its own solution", id="forgets the start"),
        pytest.param(ChangesItsArgument(), "step changes its argument", id="changes its argument"),
        pytest.param(ChangesTheStart(), "init or step changes the start", id="changes the start"),
        pytest.param(ChangesTheProblem(), "changes the problem", id="changes the problem"),
        pytest.param(CountsItsCalls(), "step depends on earlier calls", id="counts its calls"),
        pytest.param(ReusesItsArrays(), "step changes what it gave before", id="reuses its arrays"),
        pytest.param(SlowInLargeUnits(), "the number of iterations depends on units", id="slow in large units"),
        pytest.param(MechanicalNewton(nodes=False), "^insulated: .*residual", id="Newton without coupling of nodes"),
        pytest.param(MechanicalNewton(nodes=True), f"^conducting: .*{FLUX}", id="Newton without fluxes"),
    ],
)
def test_wrong_solvers_are_detected(solver: Solver, message: str) -> None:
    with pytest.raises(AssertionError, match=message):
        check_solver(solver, LIMITS)


@pytest.mark.full
def test_a_step_with_a_unit_is_detected() -> None:
    with pytest.raises(AssertionError, match=r"^insulated: in other units: "):
        check_solver(Uzawa(2.5e13, 2.5e13))


def test_small_error_is_detected_under_the_criterion_of_the_paper() -> None:
    """The state does not change any more, and the driver accepts a residual below 1e-3."""
    with pytest.raises(AssertionError, match=r"^insulated: residual of the state handed over"):
        check_solver(Reports(nearly_right), replace(LIMITS, criterion="paper"))


def test_exact_state_has_converged(problem: ContactProblem) -> None:
    """A residual of exactly zero, here of a solver that modifies the problem, causes no division by zero."""
    solution = solve(problem, ChangesTheProblem())
    assert (solution.status, solution.residual) == (Status.CONVERGED, 0.0)


@pytest.mark.full
def test_correct_solvers_pass() -> None:
    check_solver(Reports(lambda iterate: iterate))
    check_solver(ProjectedCG(), friction=False, conduction=False)
