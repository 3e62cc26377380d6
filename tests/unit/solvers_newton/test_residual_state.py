"""Incrementally updated residual states agree with new evaluations, and fractions at their bounds are linearised
correctly."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.contact.problem import AT_REST, PrescribedResultant
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw
from meeframe.solvers import SemismoothNewton, StoppingCriteria, solve
from meeframe.solvers.newton.linear import newton_step
from meeframe.solvers.newton.residual import ContactResidual, ResidualState

MU = 0.3
SINGLE = float(np.finfo(np.float32).eps)


def moving(problem, fields=(0, 2, 3, 4)):
    """Return a problem whose indenter may move along these fields, including a tilt."""
    computed = []
    for field in fields:
        mode = np.zeros_like(problem.system.offset)
        mode[:, field] = 1.0 + (100.0 * problem.system.points[:, 0] if field == 2 else 0.0)
        computed.append(PrescribedResultant(mode, mode, problem.system.weights, 1.0))
    return replace(problem, prescribed_resultants=tuple(computed))


def far_off(problem) -> ResidualState:
    """Return arbitrary loads of the magnitude of contact loads."""
    equation, random = ContactResidual.of(problem), np.random.default_rng(7)
    n = len(problem.gap)
    load = equation.scales.load * random.normal(size=(n, 5))
    load[:, 2] = -np.abs(load[:, 2])
    motion = equation.units * random.normal(size=len(equation.units))
    return equation.at(load, np.zeros(n), np.zeros(n, bool), motion)


def beyond(point: ResidualState, node: int, end: float, share: float) -> ResidualState:
    """Return a solution with a biactive node whose fraction is just beyond a bound and whose trial is a fraction of
    sigma from zero, positive if open."""
    equation, mask = point.equation, np.arange(len(point.load)) == node
    load, contact_fraction = point.load.copy(), point.contact_fraction.copy()
    contact_fraction[node] = end + (0.005 if end else -0.005)
    for _ in range(3):  # the trial is linear in the pressure of the node
        moved = equation.at(load, contact_fraction, mask, AT_REST)
        off = share * moved.sigma[node] - moved.trial[node, 2]
        load[node, 2] += off / (1.0 - equation.r * equation.blocks[node, 2, 2])
    moved = equation.at(load, contact_fraction, mask, AT_REST)
    assert moved.trial[node, 2] == pytest.approx(share * moved.sigma[node], rel=1e-6)
    assert (moved.switch[node] - end) * (1.0 if end else -1.0) >= 0.0
    return moved


def solved_edge(problem, end: float) -> tuple[ResidualState, int]:
    """Return the solution and, of the nodes in contact or open, the one nearest to the other state where that
    matters."""
    equation = ContactResidual.of(problem)
    state = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-13)).state
    point = equation.at(state.load, state.contact_fraction, np.zeros(len(state.load), bool), AT_REST)
    assert point.violation < 1e-12
    may = (point.contact_fraction == end) & (point.sigma > 1e-3 * equation.scales.pressure)
    assert may.any()
    return point, int(np.flatnonzero(may)[np.abs(point.trial[may, 2]).argmin()])


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("end", [1.0, 0.0], ids=["closed", "open"])
@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(MU)], ids=["smooth", "rough"])
def test_step_restores_nodes_at_a_bound(law: ContactLaw, end: float, sphere) -> None:
    """The trial hardly differs from zero; without friction the equations are linear there."""
    problem = sphere("orthotropic", law, (np.inf, np.inf), cells=12)
    point, node = solved_edge(problem, end)
    moved = beyond(point, node, end, 1e-3 if end else -1e-3)
    step = newton_step(moved.equation, moved.linearise())
    after = moved.equation.at(
        moved.load + step.local[:, :5], moved.contact_fraction + step.local[:, 5], moved.biactive, AT_REST
    )
    before, left = (np.abs((each.load - point.load) / point.equation.scales.load).max() for each in (moved, after))
    assert before > 1e-3
    assert left <= (before**2 if law.tangential_scaling().any() else 1e-9 * before)


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("end", [1.0, 0.0], ids=["closed", "open"])
@pytest.mark.parametrize(
    "law",
    [Signorini(), IsotropicCoulomb(MU), IsotropicCoulomb(np.inf), OrthotropicCoulomb(0.2, 0.5, 0.4)],
    ids=["smooth", "rough", "glued", "orthotropic"],
)
def test_nodes_at_a_bound_are_linearised_by_their_fraction(law: ContactLaw, end: float, sphere) -> None:
    """The derivative is that of the residual where the trial has the sign of the fraction."""
    problem = sphere("orthotropic", law, (np.inf, np.inf), cells=12)
    point, node = solved_edge(problem, end)
    side = 1.0 if end else -1.0
    here, there = beyond(point, node, end, 1e-9 * side), beyond(point, node, end, -1e-6 * side)
    equation, random = point.equation, np.random.default_rng(4)
    change = equation.scales.load * random.normal(size=(len(point.load), 5))
    widths = np.array([1.0, -1.0]) * 1e-8 * point.sigma[node] / equation.scales.pressure
    rows = [equation.at(there.load + h * change, there.contact_fraction, there.biactive, AT_REST) for h in widths]
    assert len({bool(each.trial[node, 2] < 0.0) for each in (*rows, there)}) == 1
    assert (here.trial[node, 2] < 0.0) != (there.trial[node, 2] < 0.0)
    expected = (rows[0].residual - rows[1].residual)[node, :5] / np.ptp(widths)
    blocks, caused = here.linearise(), problem.system.apply(change)
    computed = (blocks.a.dense(6)[node, :5, :5] @ change[node]) + blocks.b.dense(5)[node, :5] @ caused[node]
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-4 * np.abs(expected).max())
    separated = 2e-6 * point.sigma[node] / equation.scales.pressure  # to the distance of the two states
    np.testing.assert_allclose(blocks.residual[node, :3], there.residual[node, :3], rtol=1e-5, atol=separated)


def test_changed_fractions_match_a_new_evaluation(conducting) -> None:
    """Loads and gaps are the same, some nodes have no indenter above, and any nodes were biactive before."""
    problem = conducting(24, 0.3, IsotropicCoulomb(MU))
    problem = replace(problem, gap=np.where(np.arange(24 * 24) % 7 == 0, np.inf, problem.gap))
    equation, random = ContactResidual.of(problem), np.random.default_rng(8)
    n = len(problem.gap)
    load = equation.scales.load * random.normal(size=(n, 5))
    load[:, 2] = np.where(random.random(n) < 0.5, -np.abs(load[:, 2]), 0.0)
    load[~np.isfinite(problem.gap)] = 0.0
    fractions, masks = random.normal(0.5, 0.7, (2, n)), random.random((2, n)) < 0.5
    point = equation.at(load, fractions[0], masks[0], AT_REST)
    computed, expected = (
        point.with_contact_fraction(fractions[1], masks[1]),
        equation.at_relative_displacement(point.load, point.relative_displacement, fractions[1], masks[1], AT_REST),
    )
    for name in ("contact_fraction", "biactive", "transmissivity", "switch", "sigma", "drive", "residual"):
        np.testing.assert_allclose(
            getattr(computed, name), getattr(expected, name), rtol=1e-12, atol=1e-13, err_msg=name
        )
    assert not np.allclose(computed.residual, point.residual)
