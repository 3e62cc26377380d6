"""Test attractive surfaces: contact and open nodes, tension in results, pulling forces."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from rich.console import Console

import meeframe
from meeframe.common.errors import CaseError
from meeframe.contact.problem import Status
from meeframe.laws import IsotropicCoulomb
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.model.load import load_case
from meeframe.model.step import Step
from meeframe.results.records import Region
from meeframe.results.summary import summary, summary_table

STIFFNESS, RADIUS, MU = 1e14, 0.1, 0.3
STRENGTH, RANGE = 1e8, 1e-5
FARTHEST = STRENGTH / STIFFNESS
"""Springs are stiffer than the attraction is steep, 3 STRENGTH / RANGE: a node up to here above the surface touches."""


@dataclass(frozen=True)
class Attractive(ContactLaw):
    """Coulomb friction under an attraction that decreases with the cube of the gap."""

    mu: float = MU

    def project(self, trial):
        return IsotropicCoulomb(self.mu).project(trial)

    def tangential_scaling(self):
        return IsotropicCoulomb(self.mu).tangential_scaling()

    def adhesion(self, gap):
        return STRENGTH / (1.0 + gap / RANGE) ** 3


@pytest.fixture
def case(write_case, registry):
    """Return the sphere on springs under the attractive law; three nodes in a row are 0, 1.25 and 2.5 mm from its
    axis."""
    return replace(load_case(write_case(), registry), contact_law=Attractive())


def height(case):
    """Return the gap of the undeformed body at its nodes at first contact, (n,) [m]."""
    x, y, _ = meeframe.solve_case(replace(case, contact_law=IsotropicCoulomb(MU))).zone.points.T
    return (x**2 + y**2) / (2 * RADIUS)


def tractions_on_springs(gap, stiffness=STIFFNESS):
    """Return the normal tractions (n,) of independent springs under an indenter at gaps (n,), by bisection where
    open."""
    low, high = np.zeros_like(gap), np.maximum(gap, 0.0)
    for _ in range(200):
        middle = (low + high) / 2  # the remaining gap
        pulled = Attractive().adhesion(middle) > stiffness * (gap - middle)
        low, high = np.where(pulled, low, middle), np.where(pulled, middle, high)
    return np.where(gap <= STRENGTH / stiffness, stiffness * gap, Attractive().adhesion((low + high) / 2))


@pytest.mark.parametrize("solver", ["auto", "newton"])
def test_contact_differs_from_attraction(case, solver, registry):
    """Four nodes are in contact under tension; nodes farther away are attracted and open."""
    from meeframe.plugin.registry import Kind

    case = replace(case, steps=(Step(approach=7.3e-6),), solver=registry.create(Kind.SOLVER, solver))
    result = meeframe.solve_case(case)
    (step,) = result.steps
    assert step.status is Status.CONVERGED
    gap = height(case) - 7.3e-6
    assert [(gap < 0).sum(), ((gap > 0) & (gap < FARTHEST)).sum(), (gap > FARTHEST).sum()] == [1, 4, 20]
    np.testing.assert_array_equal(step.touching, gap < FARTHEST)
    np.testing.assert_array_equal(step.region == Region.OPEN, gap > FARTHEST)
    np.testing.assert_allclose(step.traction[:, 2], tractions_on_springs(gap), rtol=1e-8)
    totals = meeframe.resultants(result.zone, step)
    assert totals.max_tension == pytest.approx(tractions_on_springs(gap).max(), rel=1e-8)
    assert totals.max_pressure == pytest.approx(STIFFNESS * 7.3e-6, rel=1e-8)
    assert totals.contact_area == pytest.approx(1.25e-3**2 * (1 + 4), rel=1e-12), "five nodes of four cells each"
    assert "edge of its zone" not in step.message, "attracted nodes at the edge do not touch"


def test_two_bodies_attract_each_other(case, write_case, registry, second_body):
    """Springs in series have three quarters of the stiffness, so more nodes are in contact; both bodies are pulled."""
    pair = replace(
        load_case(write_case(more=second_body), registry), contact_law=Attractive(), steps=(Step(approach=7e-6),)
    )
    (step,) = meeframe.solve_case(pair).steps
    assert step.status is Status.CONVERGED
    gap, stiffness = height(case) - 7e-6, 0.75 * STIFFNESS
    assert [(gap < 0).sum(), ((gap > 0) & (gap < STRENGTH / stiffness)).sum()] == [1, 4]
    np.testing.assert_array_equal(step.touching, gap < STRENGTH / stiffness)
    expected = tractions_on_springs(gap, stiffness)
    np.testing.assert_allclose(step.traction[:, 2], expected, rtol=1e-8)
    np.testing.assert_allclose(step.displacement[:, 2], expected / STIFFNESS, rtol=1e-8)
    np.testing.assert_allclose(step.second_body.displacement[:, 2], -expected / (3 * STIFFNESS), rtol=1e-8)


def summary_of(result):
    console = Console(width=200)
    with console.capture() as caught:
        console.print(summary_table(result))
    return caught.get()


def test_tension_in_the_summary(case):
    result = meeframe.solve_case(case)
    (step,) = summary(result)["steps"]
    assert 0.0 < step["max_tension"] < STRENGTH
    assert f"{step['max_tension']:.6g}" in summary_of(result)
    pressed = meeframe.solve_case(replace(case, contact_law=IsotropicCoulomb(MU)))
    assert str(summary(pressed)["steps"][0]["max_tension"]) == "0.0"
    assert "tension" not in summary_of(pressed)


def test_attraction_without_contact(case):
    result = meeframe.solve_case(
        replace(case, steps=(Step(approach=-2e-6), Step(approach=-2e-6, translation=(1e-6, 0.0))))
    )
    for step in result.steps:
        assert step.status is Status.CONVERGED
        assert not step.touching.any()
        assert "the indenter does not touch the body" in step.message
        totals = meeframe.resultants(result.zone, step)
        expected = result.zone.weights @ tractions_on_springs(height(case) + 2e-6)
        assert totals.normal_force == pytest.approx(-expected, rel=1e-8)
        assert (totals.contact_area, totals.max_pressure, totals.slip_area) == (0.0, 0.0, 0.0)
        assert (step.slip_path == 0.0).all()


def test_pulling_force_recovers_the_approach(case):
    first = meeframe.solve_case(replace(case, steps=(Step(approach=3e-7),)))
    force = meeframe.resultants(first.zone, first.steps[0]).normal_force
    assert force < 0.0
    assert first.steps[0].touching.sum() == 1
    pulled = meeframe.solve_case(replace(case, steps=(Step(approach=3e-7), Step(normal_force=force, twist=1e-6))))
    assert pulled.steps[1].status is Status.CONVERGED
    assert pulled.steps[1].loading.approach == pytest.approx(3e-7, rel=1e-6)
    np.testing.assert_array_equal(pulled.steps[1].touching, first.steps[0].touching)


def test_friction_limit_under_tension(case):
    """The limit uses the traction less the attraction, so nodes in contact under tension carry friction, too."""
    result = meeframe.solve_case(replace(case, steps=(Step(approach=7.3e-6, translation=(1e-4, 0.0)),)))
    (step,) = result.steps
    gap = height(case) - 7.3e-6
    limit = MU * np.where(gap < FARTHEST, STRENGTH - STIFFNESS * gap, 0.0)
    np.testing.assert_allclose(np.linalg.norm(step.traction[:, :2], axis=1), limit, rtol=1e-7, atol=1e-3)
    assert ((step.traction[:, 2] > 0.0) & (step.region == Region.SLIP)).sum() == 4
    np.testing.assert_array_equal(step.slip_path > 0.0, step.touching)


def test_full_slip_at_the_friction_limit_under_tension(case):
    first = meeframe.solve_case(replace(case, steps=(Step(approach=7.3e-6, translation=(1e-4, 0.0)),)))
    force = meeframe.resultants(first.zone, first.steps[0]).tangential_force[0]
    for share, slides in ((0.95, False), (1.0, True)):
        steps = (Step(approach=7.3e-6), Step(tangential_force=(share * force, 0.0)))
        *_, step = meeframe.solve_case(replace(case, steps=steps)).steps
        assert step.status is Status.CONVERGED
        assert ("the whole contact slips" in step.message) == slides


def test_pulling_requires_an_attractive_law(case, write_case, registry):
    with pytest.raises(
        CaseError, match=r"^normal_force = -1.0: allowed: numbers >= 0 \[N\], pressing on the body, unless"
    ):
        replace(case, steps=(Step(normal_force=-1.0),), contact_law=IsotropicCoulomb(MU))
    with pytest.raises(CaseError, match=r"case.toml: steps\[1\].normal_force = '-1 kN': allowed: numbers >= 0"):
        load_case(write_case(('approach = "10 um"', 'normal_force = "-1 kN"')), registry)


@dataclass(frozen=True)
class Spark(ConductivityLaw):
    """A law that conducts across a gap only, above a threshold of the drop."""

    across_gap: ClassVar[bool] = True
    kappa: float = 1e-6
    threshold: float = 0.0

    def conductivity(self, normal_traction, gap, drop):
        return np.where((gap > 0.0) & (np.abs(drop) >= self.threshold), self.kappa, 0.0)


def test_charge_across_the_gap_determines_the_potential(case):
    """The charge determines the potential without contact; the tangential motion is undetermined and keeps its
    value."""
    steps = (
        Step(approach=-2e-6, scalars={"charge": 1e-8}),
        Step(translation=(1e-6, 0.0)),
        Step(tangential_force=(0.0, 0.0)),
    )
    result = meeframe.solve_case(
        replace(case, contact_law=IsotropicCoulomb(MU), conductivity={"electric": Spark()}, steps=steps)
    )
    assert [step.status for step in result.steps] == [Status.CONVERGED] * 3
    last = result.steps[-1]
    assert meeframe.resultants(result.zone, last).charge == pytest.approx(1e-8, rel=1e-8)
    kappa, spring = Spark().kappa, 1e13 / STIFFNESS  # potential per flux density of the springs in tests/conftest.py
    flux = 1e-8 / result.zone.weights.sum()
    assert last.loading.electric_potential == pytest.approx(-flux * (1.0 / kappa + spring), rel=1e-8)
    assert last.loading.translation.tolist() == [1e-6, 0.0]


def test_charges_are_rejected_by_insulating_laws_only(case):
    steps = (Step(approach=1e-5, scalars={"charge": 1e-9}),)
    replace(case, conductivity={"electric": Spark(threshold=1e4)}, steps=steps)
    with pytest.raises(CaseError, match="the laws of the contact insulate"):
        replace(case, conductivity={"electric": Spark(kappa=0.0)}, steps=steps)
