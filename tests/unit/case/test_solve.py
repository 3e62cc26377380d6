"""Test load steps on a bed of independent springs, for which t = min(gap, 0) x stiffness."""

import dataclasses

import numpy as np
import pytest

import meeframe
from meeframe.common.errors import CaseError
from meeframe.contact.problem import Status
from meeframe.elements import Quad4
from meeframe.indenters import Placement, Sphere
from meeframe.laws import IsotropicCoulomb, StepConductivity
from meeframe.material import library_material
from meeframe.mesh import block_mesh
from meeframe.model.case import Case
from meeframe.model.load import load_case
from meeframe.model.step import Step
from meeframe.results.records import RunStatus
from meeframe.solvers import Uzawa

STIFFNESS = 1e14
RADIUS = 0.1


@pytest.fixture
def case(write_case, registry):
    return load_case(write_case(more='\n[[steps]]\napproach = "20 um"\n'), registry)


def springs(points, approach, x=0.0):
    """Return the traction t.nu of the closed form."""
    height = ((points[:, 0] - x) ** 2 + points[:, 1] ** 2) / (2 * RADIUS)
    return STIFFNESS * np.minimum(height - approach, 0.0)


def test_successive_steps(case):
    result = meeframe.solve_case(case)
    assert result.status is RunStatus.CONVERGED
    assert len(result.steps) == 2
    for step, approach in zip(result.steps, (1e-5, 2e-5), strict=True):
        expected = springs(result.zone.points, approach)
        np.testing.assert_allclose(step.traction[:, 2], expected, atol=1e-8 * np.abs(expected).max())
        contact_fraction = expected < 0
        np.testing.assert_allclose(step.gap[contact_fraction], 0.0, atol=1e-12)
        totals = meeframe.resultants(result.zone, step)
        assert totals.force == pytest.approx([0, 0, result.zone.weights @ expected], rel=1e-8)
        assert totals.contact_area == pytest.approx(result.zone.weights[contact_fraction].sum())
        assert (totals.stick_area, totals.slip_area) == (0.0, totals.contact_area), "nothing holds it without friction"
    assert {"springs", "contact", "boundary fields", "total"} <= result.timings.keys()
    assert sum(result.timings.values()) - result.timings["total"] <= result.timings["total"]
    assert result.peak_memory_mb > 10


def test_placement_moves_the_indenter(case):
    moved = dataclasses.replace(case, placement=Placement(x=1e-3))
    result = meeframe.solve_case(moved)
    expected = springs(result.zone.points, 1e-5, x=1e-3)
    np.testing.assert_allclose(result.steps[0].traction[:, 2], expected, atol=1e-8 * np.abs(expected).max())


def test_translation_moves_the_body(case):
    step = dataclasses.replace(case.steps[0], translation=(2e-6, -1e-6))
    result = meeframe.solve_case(dataclasses.replace(case, contact_law=IsotropicCoulomb(np.inf), steps=(step,)))
    (solved,) = result.steps
    contact_fraction = solved.traction[:, 2] < 0
    np.testing.assert_allclose(
        solved.displacement[contact_fraction, :2], np.tile([2e-6, -1e-6], (contact_fraction.sum(), 1)), rtol=1e-7
    )
    assert meeframe.resultants(result.zone, solved).force[0] > 0


def test_friction_depends_on_earlier_steps(case):
    """After a reversal each spring carries its earlier traction less k times the reversed distance, at least -mu p."""
    forth, back, friction = 4e-6, 3e-6, 0.3
    steps = [dataclasses.replace(case.steps[0], translation=(d, 0.0)) for d in (forth, forth - back)]
    result = meeframe.solve_case(dataclasses.replace(case, contact_law=IsotropicCoulomb(friction), steps=tuple(steps)))
    bound = -friction * springs(result.zone.points, 1e-5)
    first = np.minimum(STIFFNESS * forth, bound)
    second = np.maximum(first - STIFFNESS * back, -bound)
    assert np.any(second < 0)
    assert np.any((first == bound) & (second > -bound)), "some have slipped forth and stick on the way back"
    for step, expected in zip(result.steps, (first, second), strict=True):
        np.testing.assert_allclose(step.traction[:, 0], expected, atol=1e-7 * bound.max())


def test_potentials_in_conducting_contact(case):
    steps = tuple(
        dataclasses.replace(step, scalars={"electric_potential": 7.0, "magnetic_potential": -0.5})
        for step in case.steps
    )
    result = meeframe.solve_case(
        dataclasses.replace(case, conductivity={"electric": StepConductivity(np.inf)}, steps=steps)
    )
    for step in result.steps:
        contact_fraction = step.traction[:, 2] < 0
        np.testing.assert_allclose(step.potentials[contact_fraction, 0], 7.0, rtol=1e-9)
        assert not step.potentials[~contact_fraction, 0].any()
        assert not step.potentials[:, 1].any()  # magnetically insulated
        # springs have -phi = q / k, so a higher potential of the indenter draws flux in: q < 0
        # (docs/explanation/theory.md)
        assert meeframe.resultants(result.zone, step).charge < 0


def test_steps_continue_after_a_failed_step(case):
    stopping = dataclasses.replace(case.stopping, max_iterations=1)
    case = dataclasses.replace(case, solver=Uzawa())
    result = meeframe.solve_case(dataclasses.replace(case, stopping=stopping))
    assert result.status is RunStatus.NOT_CONVERGED
    assert [step.status for step in result.steps] == [Status.ITERATION_LIMIT] * 2
    assert all(step.iterations == 1 and step.message for step in result.steps)


def test_case_from_objects(case):
    """The example of docs/reference/case-files.md runs on springs."""
    material = library_material("batio3-cofe2o4")
    mesh = block_mesh(0.05, 0.12, 0.005, 4, 2, 1, Quad4())
    made = Case(
        material=material,
        mesh=mesh,
        conditions=tuple(meeframe.BoundaryCondition("base", field, "value") for field in range(5)),
        indenter=Sphere(RADIUS),
        steps=(Step(approach=1e-5), Step(approach=2e-5)),
        formulation=case.formulation,
    )
    ours, theirs = meeframe.solve_case(made), meeframe.solve_case(case)
    for one, other in zip(ours.steps, theirs.steps, strict=True):
        np.testing.assert_allclose(one.traction, other.traction, rtol=1e-9, atol=1e-3)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"steps": ()}, "at least one load step"),
        ({"zone": "lid"}, "no face group 'lid'"),
        ({"conditions": ()}, "no boundary condition prescribes electric_potential"),
        ({"conditions": (meeframe.BoundaryCondition("base", 0, "value", np.nan),)}, "must be finite"),
        ({"conditions": (meeframe.BoundaryCondition("contact", 0, "value"),)}, "it is the contact zone"),
    ],
)
def test_cases_from_python_are_checked(case, change, text):
    with pytest.raises((CaseError, meeframe.MeeframeError), match=text):
        dataclasses.replace(case, **change)


def test_supports_by_components_of_several_groups(case):
    """Two faces with one component each leave rigid motions; three faces must fix all six."""

    def fixed(pairs):
        mechanical = (meeframe.BoundaryCondition(group, field, "value") for group, field in pairs)
        potentials = (meeframe.BoundaryCondition("base", field, "value") for field in (3, 4))
        return dataclasses.replace(case, conditions=(*mechanical, *potentials))

    fixed([("side_x-", 0), ("side_y-", 1), ("base", 2)])
    with pytest.raises(CaseError, match="leave 1 of the 6 rigid motions free"):
        fixed([("side_x-", 0), ("base", 2)])


def test_message_about_contact_without_pressure():
    """A high potential takes the pressure of all nodes away."""
    result = meeframe.Case.from_toml("""
material = {name = "batio3-cofe2o4"}
mesh = {type = "half-space", contact_width = "5 mm", divisions = 6}
formulation = "half-space"
indenter = {name = "sphere", radius = "100 mm"}
conductivity = {electric = {name = "step", kappa = 2e-7}}
contact = {law = {name = "signorini"}}
steps = [{approach = "20 um", electric_potential = 3.16e8}]
""").solve()
    (step,) = result.steps
    assert not step.touching.any()
    assert step.fluxes[:, 0].any()
    assert step.message.endswith("; no node bears a pressure, but some conduct between open and closed")


def test_message_about_missing_contact(case):
    """The message appears once, in the first step, and states the distance."""
    away = (Step(-1e-5), Step(-2e-5))
    step, other = meeframe.solve_case(dataclasses.replace(case, steps=away)).steps
    assert other.message.split("; ")[1:] == ["the indenter does not touch the body"]
    (doubt,) = step.message.split("; ")[1:]
    assert doubt.startswith(
        "the indenter does not touch the undeformed body: at an approach of -1e-05 m it stays 1e-05"
    )
    totals = meeframe.resultants(meeframe.solve_case(case).zone, step)
    assert str(totals.max_pressure) == str(totals.contact_area) == "0.0"
    assert not totals.force.any()


def test_message_about_contact_at_zone_boundary(case):
    inner, outer = meeframe.solve_case(dataclasses.replace(case, steps=(Step(1e-6), Step(1e-3)))).steps
    assert "edge of its zone" not in inner.message
    assert "the contact reaches the boundary of its zone at 16 element sides" in outer.message
