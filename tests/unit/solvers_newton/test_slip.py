"""Relaxation of friction between stick and slip: it finds what the laws say, and leaves solutions as they are."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import meeframe.solvers.newton.slip_boundary as slip_module
from meeframe.contact.conduction import Mask
from meeframe.contact.problem import ContactProblem
from meeframe.fields import Array
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw
from meeframe.solvers._kernels.stencil_products import neighbours, stencil_products
from meeframe.solvers.newton.boundary_band import BoundaryBand, slips
from meeframe.solvers.newton.residual import ResidualState
from meeframe.solvers.newton.slip_boundary import smooth_slip_boundary
from meeframe.system.capabilities import Stencil
from meeframe.testing.operation_counter import OperationCounter

MU, DRAGGED = 0.3, (3e-6, 1e-6)
ISOTROPIC, TURNED = IsotropicCoulomb(MU), OrthotropicCoulomb(0.2, 0.5, 0.4)


def alone(stencil: Stencil, nodes: Array, load: Array, over: tuple[int, ...]) -> Array:
    """What loads (m, k) of nodes (m,) cause at them, (m, k), by pairs: periods (0,) or (-1, 0, 1) along both axes."""
    (nx, ny), reach, k = stencil.lattice.shape, len(stencil.responses) // 2, load.shape[1]
    place = np.empty((stencil.lattice.max() + 1, 2), int)
    place[stencil.lattice] = np.moveaxis(np.indices((nx, ny)), 0, -1)
    found = np.zeros_like(load)
    for i, j in product(over, over):
        apart = place[nodes][:, None] - place[nodes][None, :] + [i * nx, j * ny]  # of one node (first) from a load
        near = (np.abs(apart) <= reach).all(axis=2)
        at, source = np.nonzero(near)
        blocks = stencil.responses[*(apart[at, source] + reach).T][:, :k, :k]
        np.add.at(found, at, np.einsum("pij,pj->pi", blocks, load[source]))
    return found


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("shape", [(7, 13), (12, 6), (4, 9), (9, 4)])
def test_products_are_sums_over_pairs(shape: tuple[int, int], periodic: bool) -> None:
    """Also where a period is shorter than the stencil, whose responses then count twice."""
    random = np.random.default_rng(shape[0])
    lattice = random.permutation(shape[0] * shape[1]).reshape(shape)
    taking = random.random(shape) < 0.6
    number = np.where(taking, np.cumsum(taking).reshape(shape) - 1, -1)
    places, nodes = np.argwhere(taking), lattice[taking]
    responses = random.normal(size=(5, 5, 2, 2))
    load = np.append(random.normal(size=(len(nodes), 2)), [[0.0, 0.0]], axis=0)
    found = np.full((len(nodes), 2), np.nan)
    around = neighbours(number, places, periodic, 2)
    stencil_products(around, responses.reshape(-1, 2, 2), load, found)
    expected = alone(Stencil(lattice, periodic, responses), nodes, load[:-1], (-1, 0, 1) if periodic else (0,))
    assert 0 < len(nodes) < lattice.size
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def ring_of(point: ResidualState) -> BoundaryBand:
    ring = BoundaryBand.of(point, (point.load[:, 2] < 0.0) & ~slips(point), slip_module.WIDTH)
    assert ring is not None
    return ring


def off(point: ResidualState, nodes: Array, gap: Array, tractions: Array) -> Array:
    """By how much friction (m, 2) of tractions (m, 3) is off that which the law makes of it with gaps (m, 2) under the
    pressures that there are."""
    law, trial = point.equation.problem.contact_law, point.load[:, :3].copy()
    trial[nodes] = tractions
    trial[nodes, :2] += point.equation.r * gap @ law.tangential_scaling()
    return np.asarray(law.project(trial)[nodes, :2] - tractions[:, :2])


def left(point: ResidualState, relaxed: ResidualState) -> tuple[float, float]:
    """Root of the mean square of what tractions around the boundary are off by, before and after: gaps follow from the
    changes of those alone."""
    ring = ring_of(point)
    nodes, change = ring.nodes, (relaxed.load - point.load)[ring.nodes, :2]
    gap = point.ahead[nodes, :2]
    after = gap - alone(ring.stencil, nodes, change, (0,))
    before = off(point, nodes, gap, point.load[nodes, :3])
    return float(np.sqrt((before**2).mean())), float(
        np.sqrt((off(point, nodes, after, relaxed.load[nodes, :3]) ** 2).mean())
    )


LAWS = [pytest.param(ISOTROPIC, id="isotropic"), pytest.param(TURNED, id="orthotropic")]


@pytest.mark.parametrize("law", LAWS)
def test_a_solution_stays_what_it_is(law: ContactLaw, conducting, at_solution) -> None:
    """What was found in double precision satisfies the laws around the boundary, too."""
    point = at_solution(conducting(80, 0.3, law, dragged=DRAGGED))
    relaxed = smooth_slip_boundary(point)
    sticking = (point.load[:, 2] < 0.0) & ~slips(point)
    assert 100 < sticking.sum() < (point.load[:, 2] < 0.0).sum() - 100
    np.testing.assert_allclose(relaxed.load, point.load, rtol=0, atol=1e-9 * np.abs(point.load[:, 2]).max())
    assert relaxed.violation < 1e-9


@pytest.mark.parametrize("law", LAWS)
def test_what_is_not_friction_beside_the_boundary_is_untouched(law: ContactLaw, conducting, interpolated) -> None:
    point = interpolated(conducting(81, 0.3, law, dragged=DRAGGED))
    relaxed, beside = smooth_slip_boundary(point), np.zeros(len(point.load), bool)
    beside[ring_of(point).nodes] = True
    changed = (relaxed.load != point.load).any(axis=1)
    assert 50 < changed.sum() <= beside.sum() < len(beside)
    np.testing.assert_array_equal(relaxed.load[:, 2:], point.load[:, 2:])
    np.testing.assert_array_equal(relaxed.load[~beside], point.load[~beside])
    np.testing.assert_array_equal(relaxed.grazing, point.grazing)
    np.testing.assert_array_equal(relaxed.contact_fraction[point.grazing], point.contact_fraction[point.grazing])
    np.testing.assert_array_equal(relaxed.motion, point.motion)


@pytest.mark.parametrize("law", LAWS)
def test_laws_hold_beside_the_boundary(law: ContactLaw, conducting, interpolated) -> None:
    """With the gaps that the nodes around cause."""
    point = interpolated(conducting(81, 0.3, law, dragged=DRAGGED))
    before, after = left(point, smooth_slip_boundary(point))
    assert after < 0.1 * before


def pressed(problem: ContactProblem, dragged: Mask | bool, at: Callable[..., ResidualState]) -> ResidualState:
    """Uniform pressure where surfaces overlap, the indenter dragged far along the nodes (n,), or all, or none."""
    overlap, way = problem.gap < 0.0, np.zeros_like(problem.translation)
    load = np.zeros((len(overlap), 5))
    load[overlap, 2] = -1e5
    way[:, 0] = np.where(dragged, 1e-3, 0.0)
    return at(replace(problem, translation=way), load, overlap.astype(float))


def half(problem: ContactProblem) -> Mask:
    return np.asarray(problem.system.points[:, 0] > 0.0)


@pytest.mark.parametrize(
    ("law", "done"),
    [
        (ISOTROPIC, True),
        (Signorini(), False),
        (IsotropicCoulomb(0.0), False),
    ],
    ids=["friction", "frictionless", "mu = 0"],
)
@pytest.mark.parametrize("helped", [True, False])
def test_nothing_is_done_without_friction_or_lattice(law: ContactLaw, done: bool, helped: bool, conducting, at) -> None:
    """Half of the nodes would slip."""
    problem = conducting(40, 0.3, law, Insulating())
    problem = replace(problem, system=OperationCounter.of(problem.system, accelerated=helped))
    point = pressed(problem, half(problem), at)
    assert (smooth_slip_boundary(point) is not point) == (done and helped)


def test_nothing_is_done_where_all_sticks_or_all_slips(conducting, at) -> None:
    """A flat indenter on the whole zone, so that there is no edge either."""
    problem = replace(conducting(40, 0.3, ISOTROPIC, Insulating()), gap=np.full(1600, -1e-5))
    glued = replace(problem, contact_law=IsotropicCoulomb(np.inf))
    for given, dragged, share in ((problem, False, 0.0), (problem, True, 1.0), (glued, True, 0.0)):
        point = pressed(given, dragged, at)
        assert slips(point).mean() == share
        assert smooth_slip_boundary(point) is point
    point = pressed(problem, half(problem), at)
    assert slips(point).mean() == 0.5
    assert smooth_slip_boundary(point) is not point
    apart = pressed(replace(problem, gap=-problem.gap), True, at)
    assert smooth_slip_boundary(apart) is apart
