"""Relaxation of the edge of a contact that conducts: it finds what the laws say, and leaves solutions as they are."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from meeframe_laws.conductivity import PowerLaw
from scipy.spatial.distance import cdist

from meeframe.contact.problem import ContactState, Iterate
from meeframe.contact.residual import evaluate
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini
from meeframe.laws.base import ConductivityLaw
from meeframe.solvers import residual
from meeframe.solvers._kernels.edge_relaxation import number_edge, relax_edge
from meeframe.solvers.newton.contact_edge import relaxed_where_switched, smooth_contact_edge
from meeframe.solvers.newton.residual import ContactResidual, ResidualState
from meeframe.system.capabilities import LatticeStencil
from meeframe.testing.operation_counter import OperationCounter

MU = 0.3


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("reach", [1, 2, 3])
def test_the_edge_is_what_is_near_nodes_of_the_other_kind(reach: int, periodic: bool) -> None:
    pressed = np.random.default_rng(reach).random((17, 23)) < 0.04
    number = np.full(pressed.shape, 99)
    count = number_edge(pressed, reach, periodic, number)
    places = np.argwhere(np.ones_like(pressed)).astype(float)
    images = [np.array([i * 17.0, j * 23.0]) for i in (-1, 0, 1) for j in (-1, 0, 1)] if periodic else [np.zeros(2)]
    distance = np.min([cdist(places, places + image) for image in images], axis=0)
    kind = pressed.ravel()
    expected = ((distance <= reach) & (kind[:, None] != kind)).any(axis=1)
    assert 0 < count < pressed.size
    assert np.array_equal(number.ravel() >= 0, expected)
    assert np.array_equal(number.ravel()[expected], np.arange(count))


@pytest.mark.parametrize("material", ["orthotropic-mee", "batio3-cofe2o4"])
def test_sweeps_alone_solve_a_contact_smaller_than_their_reach(material: str, conducting, at) -> None:
    """Projected Gauss-Seidel converges without friction; the judge finds the laws satisfied. Single precision."""
    problem = conducting(49, 0.1, material=material)
    system, reach, middle = problem.system, 24, 24
    stencil = system.capability(LatticeStencil).stencil(reach, range(5))
    assert stencil is not None
    number = np.full(stencil.lattice.shape, -1)
    inside = np.hypot(*(np.indices(number.shape) - middle)) <= 11.0
    number[inside] = np.arange(inside.sum())
    places, nodes = np.argwhere(inside), stencil.lattice[inside]
    point = at(problem, np.zeros_like(system.offset), np.zeros(len(problem.gap)))
    load, ahead, contact_fraction = point.load[nodes], np.ascontiguousarray(point.ahead[nodes]), np.zeros(len(nodes))
    load, shut = np.ascontiguousarray(load), np.ones((len(nodes), 2))
    slips = np.zeros(len(nodes), bool)
    relax_edge(
        number, places, False, stencil.responses, shut, 0.0 * shut, slips, load, ahead, contact_fraction, 300, 0.0
    )
    whole, fraction = point.load.copy(), np.zeros(len(problem.gap))
    whole[nodes], fraction[nodes] = load, contact_fraction
    assert 50 < (load[:, 2] < 0.0).sum() < len(nodes)
    assert residual(problem, evaluate(problem, Iterate(whole, fraction))) < 1e-5


@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(MU)], ids=["frictionless", "friction"])
def test_a_solution_stays_what_it_is(law: Any, conducting, at_solution) -> None:
    problem = replace(conducting(80, 0.3, law), translation=np.tile([2e-7, 0.0], (6400, 1)))
    point = at_solution(problem)
    between = (point.contact_fraction > 0.0) & (point.contact_fraction < 1.0)
    assert between.any()
    assert smooth_contact_edge(point) is point


def test_an_edge_that_was_changed_is_found_again(conducting, at_solution, at) -> None:
    """Open nodes at the edge are closed and closed ones opened, with loads of the wrong kind."""
    problem = conducting(80, 0.3)
    point = at_solution(problem)
    pressed, stencil = point.load[:, 2] < 0.0, problem.system.capability(LatticeStencil).stencil(1, [2])
    assert stencil is not None
    number = np.empty(stencil.lattice.shape, np.int64)
    number_edge(pressed[stencil.lattice], 1, False, number)
    rim = np.zeros(len(pressed), bool)
    rim[stencil.lattice[number >= 0]] = np.random.default_rng(5).random((number >= 0).sum()) < 0.3
    load, contact_fraction = point.load.copy(), point.contact_fraction.copy()
    load[rim & pressed] = 0.0
    load[rim & ~pressed, 2] = 0.2 * point.load[:, 2].min()
    contact_fraction[rim] = ~pressed[rim]
    changed = at(problem, load, contact_fraction)
    relaxed = smooth_contact_edge(changed)
    assert rim.sum() > 20
    assert relaxed.merit < changed.merit
    unlike = [((one.contact_fraction > 0.0) != (point.contact_fraction > 0.0)).sum() for one in (changed, relaxed)]
    assert unlike[1] <= 0.2 * unlike[0]


@pytest.mark.parametrize("flux", [Insulating(), PowerLaw(1e-3, 1e8, 0.5)], ids=["insulated", "growing"])
def test_nothing_is_done_where_conduction_does_not_jump(flux: ConductivityLaw, conducting, at) -> None:
    problem = conducting(40, 0.3, flux=flux)
    load = np.where((problem.gap < 0.0)[:, None], [0.0, 0.0, -1e7, 0.0, 0.0], 0.0)
    point = at(problem, load, (load[:, 2] < 0.0).astype(float))
    assert smooth_contact_edge(point) is point


def test_nothing_is_done_on_no_lattice_or_without_contact(conducting, at) -> None:
    problem = conducting(40, 0.3)
    load = np.where((problem.gap < 0.0)[:, None], [0.0, 0.0, -1e7, 0.0, 0.0], 0.0)
    contact_fraction = (load[:, 2] < 0.0).astype(float)
    point = at(problem, load, contact_fraction)
    assert smooth_contact_edge(point) is not point
    unhelped = replace(problem, system=OperationCounter.of(problem.system, accelerated=False))
    for given, state in (
        (unhelped, ContactState(load, load, contact_fraction)),
        (problem, ContactState(0 * load, load, 0 * contact_fraction)),
    ):
        point = at(given, state.load, state.contact_fraction)
        assert smooth_contact_edge(point) is point


def switched(point: ResidualState) -> ResidualState:
    """The point with a closed node of little pressure opened, whose flux has not followed."""
    held = (point.load[:, 2] < 0.0) & (point.lift > 0.0) & ~point.grazing
    node = np.flatnonzero(held)[point.load[held, 2].argmax()]
    load, contact_fraction, grazing = point.load.copy(), point.contact_fraction.copy(), point.grazing.copy()
    load[node, :3], contact_fraction[node], grazing[node] = 0.0, 0.0, True
    return point.equation.at(load, contact_fraction, grazing, point.motion)


def test_a_node_that_a_step_has_switched_is_found_again(conducting, at_solution) -> None:
    """And one that grazes and is left behind; one that does neither, or whose flux has followed, is let alone."""
    point = at_solution(conducting(80, 0.3))
    moved = switched(point)
    for before in (point, moved):
        found = relaxed_where_switched(before, moved)
        assert found.merit < 0.2 * moved.merit
        assert np.array_equal(found.contact_fraction > 0.0, point.contact_fraction > 0.0)
    neither = replace(moved, grazing=np.zeros_like(moved.grazing))
    assert relaxed_where_switched(neither, neither) is neither
    followed = replace(moved, residual=moved.residual * [1.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert relaxed_where_switched(point, followed) is followed


def test_laws_of_each_node_are_asked_at_all_of_them(conducting, at_solution, each_its_own) -> None:
    """The same as with one law."""
    problem, found = conducting(80, 0.3, IsotropicCoulomb(MU)), list[ResidualState]()
    solved = at_solution(problem)
    for law in (problem.contact_law, each_its_own(MU, mus=np.full(6400, MU))):
        equation = ContactResidual.of(replace(problem, contact_law=law))
        point = equation.beside(solved.load, solved.ahead, solved.contact_fraction, solved.grazing, solved.motion)
        found.append(relaxed_where_switched(point, switched(point)))
    assert np.array_equal(found[0].contact_fraction, found[1].contact_fraction)
    np.testing.assert_allclose(found[0].load, found[1].load, atol=1e-12 * np.abs(found[0].load).max())
