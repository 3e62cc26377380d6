"""Test preflight checks: solvers that reject the case, an indenter that touches nothing."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import meeframe
from meeframe.common.errors import CaseError
from meeframe.contact.problem import Solver
from meeframe.formulations.base import Formulation
from meeframe.indenters import FlatPunch
from meeframe.laws import IsotropicCoulomb, StepConductivity
from meeframe.model.load import load_case
from meeframe.model.preflight import planned, undeformed
from meeframe.model.step import Step
from meeframe.solvers import Auto, ProjectedCG, Uzawa
from meeframe.system.reduced import silent

PCG = '\n[solver]\nname = "projected-cg"\n'
FRICTION = '\n[contact]\nlaw = { name = "isotropic-coulomb", mu = 0.3 }\n'
REFUSED = (
    "solver 'projected-cg' takes frictionless contact only, .* not IsotropicCoulomb; allowed contact law: signorini"
)


@pytest.fixture
def case(write_case, registry):
    """Return the sphere on springs."""
    return load_case(write_case(), registry)


def test_solver_that_rejects_the_law_is_reported_at_its_key(write_case, registry, case):
    with pytest.raises(CaseError, match=rf"case\.toml: solver: {REFUSED}"):
        load_case(write_case(more=PCG + FRICTION), registry)
    with pytest.raises(CaseError, match=f"^{REFUSED}"):
        replace(case, solver=ProjectedCG(), contact_law=IsotropicCoulomb(0.3))
    assert load_case(write_case(more=PCG + FRICTION.replace("0.3", "0")), registry).solver == ProjectedCG()


def test_other_errors_are_not_attributed_to_the_solver(write_case, registry):
    loose = ("displacement = [0, 0, 0]\n", "")
    with pytest.raises(CaseError) as raised:
        load_case(write_case(loose, more=PCG + FRICTION), registry)
    assert "solver" not in str(raised.value)
    assert "boundary" in str(raised.value)


def test_unsupported_resultant_is_reported_early(case):
    """On a curved zone, pressure carries part of a tangential force, in a ratio that varies with the position."""
    points = case.mesh.points.copy()
    points[:, 2] -= 40.0 * np.minimum((points[:, :2] ** 2).sum(axis=1), 2.5e-5) * (points[:, 2] > -1e-9)
    steps = (Step(approach=1e-5), Step(force_ratio=(0.01, 0.0)))
    hill = replace(case, mesh=replace(case.mesh, points=points), steps=steps)
    assert hill.solver == Auto()
    with pytest.raises(
        CaseError, match="solver 'projected-cg' cannot find free motion 0 of the indenter: its resultant"
    ):
        replace(hill, solver=ProjectedCG())
    assert replace(hill, solver=ProjectedCG(), steps=steps[:1]).steps == steps[:1]


@dataclass(frozen=True)
class Shallow(Solver):
    """A solver that rejects an approach above 15 um."""

    def check(self, problem):
        if problem.gap.min() < -15e-6:
            raise CaseError(f"solver 'shallow' at {problem.system.points[problem.gap.argmin()]}")

    def init(self, problem, start, tolerance=1e-10):
        raise NotImplementedError

    def step(self, problem, iterate):
        raise NotImplementedError


def test_solvers_check_every_step(case):
    steps = (Step(approach=1e-5), Step(translation=(1e-6, 0.0)), Step(approach=2e-5))
    assert replace(case, solver=Shallow(), steps=steps[:2]).solver == Shallow()
    with pytest.raises(CaseError, match=r"solver 'shallow' at \[0\. 0\. 0\.\]"):
        replace(case, solver=Shallow(), steps=steps)


@dataclass(frozen=True)
class Selective(Shallow):
    """A solver that accepts laws of one class only."""

    def check(self, problem):
        if not isinstance(problem.law_of("electric"), StepConductivity):
            raise CaseError(f"solver 'selective' does not take {type(problem.law_of('electric')).__name__}")

    def init(self, problem, start, tolerance=1e-10):
        self.check(problem)
        assert problem.law_of("electric") == StepConductivity(1.0)
        return Uzawa().init(problem, start)

    def step(self, problem, iterate):
        self.check(problem)
        return Uzawa().step(problem, iterate)


def test_solvers_check_the_laws_they_receive(case):
    law = StepConductivity(1.0)
    selective = replace(
        case, conductivity={"electric": law}, solver=Selective(), potentials={"electric_potential": 100.0}
    )
    (step,) = meeframe.solve_case(selective).steps
    (expected,) = meeframe.solve_case(replace(selective, solver=Uzawa())).steps
    np.testing.assert_array_equal(step.fluxes, expected.fluxes)
    assert vars(law) == {"kappa": 1.0}
    with pytest.raises(CaseError, match="solver 'selective' does not take Insulating"):
        replace(case, solver=Selective())


@dataclass(frozen=True)
class Softening(IsotropicCoulomb):
    """A law whose pressure grows only half as fast beyond a limit [Pa]."""

    most: float = np.inf

    def project(self, trial):
        traction = super().project(trial)
        return 0.5 * (traction + np.maximum(traction, [-np.inf, -np.inf, -self.most]))


@pytest.mark.parametrize(
    ("law", "taken"), [(Softening(0.0), True), (Softening(0.0, 1e7), False), (Softening(0.1), False)]
)
def test_laws_are_evaluated_at_pressures_of_all_magnitudes(case, law, taken):
    problem = planned(undeformed(replace(case, contact_law=law)))
    assert ProjectedCG().accepts(next(problem).problem) is taken


AWAY = "the indenter does not touch the undeformed body: at an approach of {} m it stays {} m or more from the nodes"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([], None),
        (
            [('"10 um"', "0")],
            "at an approach of 0 m the indenter only touches the undeformed body, without pressure",
        ),
        # the sphere's axis passes through the middle of a cell of 1.25 mm, so the lowest node is at R - sqrt(R^2
        # - 2 (side / 2)^2)
        (
            [('"100 mm"', '"100 mm"\nx = "625 um"\ny = "625 um"'), ('"10 um"', '"1 um"')],
            AWAY.format("1e-06", "2.91e-06"),
        ),
        (
            [('"100 mm"', '"100 mm"\nx = "20 mm"'), ('"10 um"', '"1 um"')],
            AWAY.format("1e-06", "0.00153")
            + " of the contact zone 'contact'. Its lowest point, at x = 0.02 m and y = 0 m,"
            " lies outside that zone, which extends from x = -0.0025 to 0.0025 m and from y = -0.0025 to 0.0025 m",
        ),
        ([('"100 mm"', '"100 mm"\nx = "20 mm"'), ('"10 um"', '"2 mm"')], None),
        ([('"100 mm"', '"100 mm"\nx = "20 mm"'), ('approach = "10 um"', 'normal_force = "1 N"')], None),
    ],
)
def test_warning_about_missing_contact(write_case, registry, changes, message):
    """A prescribed force always leads to contact."""
    warnings = load_case(write_case(*changes), registry).warnings
    assert len(warnings) == (message is not None)
    assert all(message in text for text in warnings)


@pytest.mark.parametrize(("approach", "message"), [("62 um", False), ("63 um", True), ("40 mm", True)])
def test_warning_about_overlap_of_the_whole_zone(write_case, registry, approach, message):
    """At the corners, sqrt(2) 2.5 mm from the axis, the height of a sphere of 100 mm is 62.5 um."""
    warnings = load_case(write_case(('"10 um"', f'"{approach}"')), registry).warnings
    assert len(warnings) == message
    assert all("overlaps the undeformed body on the whole contact zone 'contact', by " in text for text in warnings)


IDLE = "{}_potential of {} has no effect: the contact insulates unless [conductivity.{}] names a conducting law"


def test_warning_about_potentials_of_insulating_indenters(case):
    """The potential may be that of the indenter or of a load step."""
    volts = replace(case, potentials={"electric_potential": -3e4})
    assert volts.warnings == (IDLE.format("electric", "3e+04 V", "electric"),)
    assert not replace(volts, conductivity={"electric": StepConductivity(np.inf)}).warnings
    steps = (Step(approach=1e-5), Step(scalars={"magnetic_potential": 20.0}))
    amperes = replace(case, steps=steps, conductivity={"electric": StepConductivity(np.inf)})
    message = IDLE.format("magnetic", "20 A", "magnetic")
    assert amperes.warnings == (message,)
    assert [message in step.message for step in meeframe.solve_case(amperes).steps] == [True, False]


@dataclass(frozen=True)
class Periodic(Formulation):
    """Springs whose contact zone is one period of an infinite surface."""

    of_period: Formulation
    periodic: str = "along e1"  # a separate key, whatever its name

    def is_periodic(self):
        return True

    def check(self, body):
        self.of_period.check(body)

    def reduce(self, body, progress=silent):
        return self.of_period.reduce(body, progress)


def test_no_warning_about_intended_full_contact(case):
    """Flat punches over the whole face and periodic surfaces may be in full contact; missing contact still causes a
    warning."""
    over = replace(case, indenter=FlatPunch(radius=1.0))
    assert not over.warnings
    deep = replace(case, steps=(Step(approach=1e-3),))
    assert deep.preflight
    assert not replace(deep, formulation=Periodic(case.formulation)).preflight
    assert replace(case, steps=(Step(approach=-1e-3),), formulation=Periodic(case.formulation)).preflight


def test_no_warning_at_border_of_a_period(case):
    (step,) = meeframe.solve_case(replace(case, steps=(Step(approach=1e-4),))).steps
    assert "the contact reaches the boundary of its zone at 16 element sides" in step.message
    assert "overlaps" not in step.message, "of which the edge is enough"
    is_periodic = replace(case, steps=(Step(approach=1e-4),), formulation=Periodic(case.formulation))
    (step,) = meeframe.solve_case(is_periodic).steps
    assert step.touching.all()
    assert "edge" not in step.message
    assert "overlaps" not in step.message


def test_no_warning_with_laws_across_the_gap(write_case, registry):
    above = ('"10 um"', '"-10 um"')
    assert load_case(write_case(above), registry).warnings
    across = '\n[conductivity]\nelectric = { name = "across-gap", gap_constant = "1e-11 F/m" }\n'
    assert not load_case(write_case(above, more=across), registry).warnings
    dmt = '\n[contact]\nlaw = { name = "dmt", work_of_adhesion = "0.1 J/m^2", equilibrium_distance = "1 nm" }\n'
    assert not load_case(write_case(above, more=dmt), registry).warnings


def test_one_step_with_contact_suffices(case):
    steps = (Step(approach=-1e-5), Step(approach=1e-5), Step(approach=0.0))
    assert replace(case, steps=steps[:1]).warnings
    assert not replace(case, steps=steps).warnings
