"""Nodes at the edge of a contact that conducts, relaxed beside the steps of Newton's method.

On a coarser grid another edge was found, and what is interpolated from it is wrong where nodes are open, closed or in
between, which depends on how the edge runs between them. Newton's method finds that out node by node, one step after
the other, each of which costs many products. Most of it depends on a few nodes around: these are asked in turns, as in
projected Gauss-Seidel relaxation, each for the load with which it satisfies the laws beside the others. So they are
where a step has opened or closed a node, whose flux is then that of the other state.
"""

from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask, follows_gap
from meeframe.fields import MECHANICAL
from meeframe.laws.base import is_pure_projection
from meeframe.solvers._kernels.edge_relaxation import relax_edge
from meeframe.solvers.conduction.transmissivity import LOWEST
from meeframe.solvers.newton.boundary_band import ROUGHER, Ring, slips
from meeframe.solvers.newton.residual import Point

WIDTH, SWEEPS = 2, 6
"""Spacings from the edge on either side, and sweeps, to and fro in turn: farther in loads follow from those of many
nodes."""
SWITCHED_WIDTH, SWITCHED_SWEEPS = 3, 12
"""The same around nodes that a step has switched, which are few."""
SETTLED: Final = 1e-3
"""Of the work of the first sweeps: one that does less is the last."""
BEHIND: Final = 0.1
"""Of the largest violation the residual of pressure or fluxes is more than so much where a node has not followed."""
FEW: Final = 25
"""So many nodes with the largest violation each would have the merit that all have: others violate the laws less."""
HARDLY: Final = 1e-3
"""Of its pressure a node that had less before was hardly pressed."""
AT_ONCE: Final = 0.5
"""Of the largest jump of conduction that of a contact without pressure is more than so much, or it grows."""


def relaxed_edge(point: Point) -> Point:
    """A point with the nodes around the edge relaxed, those left in between grazing; the same point where conduction
    does not jump at the edge, where nodes lie on no lattice, or if it does not help."""
    relaxed = _relaxed(point, point.load[:, 2] < 0.0, WIDTH, SWEEPS)
    return relaxed if relaxed.merit < ROUGHER * point.merit else point


def relaxed_where_switched(before: Point, moved: Point) -> Point:
    """A moved point with the nodes relaxed that have opened or closed, or of which a few that graze are left behind,
    with those around; the same point if these do not violate the laws far more than others, or if it does not help."""
    few = moved.merit**2 * moved.equation.count < FEW * moved.judged**2
    behind = np.maximum(np.abs(moved.residual[:, 2]), moved.judged_nodes) > BEHIND * moved.judged
    switched = behind & (moved.switched(before) | (few & moved.grazing))
    relaxed = _relaxed(moved, switched, SWITCHED_WIDTH, SWITCHED_SWEEPS) if switched.any() else moved
    return relaxed if relaxed.merit < moved.merit else moved


def _relaxed(point: Point, kind: Mask, width: int, sweeps: int) -> Point:
    """A point with the nodes relaxed that are near others of another kind (n,); the same if there is nothing to do."""
    problem = point.equation.problem
    if (
        not is_pure_projection(problem.contact_law)
        or follows_gap(problem)
        or not point.jump.any()
        or not _jumps_at_edge(point)
    ):
        return point
    ring = Ring.of(point, kind, width)
    if ring is None:
        return point
    nodes, stencil = ring.nodes, ring.stencil
    load, ahead, contact_fraction = (
        np.ascontiguousarray(part[nodes]) for part in (point.load, point.ahead, point.contact_fraction)
    )
    contact_fraction = np.clip(contact_fraction, 0.0, 1.0)
    shut = point.transmissivity[nodes] + (1.0 - contact_fraction)[:, None] * point.jump[nodes]
    apart = shut - point.jump[nodes]
    laws = shut, apart, slips(point)[nodes]  # asked at all nodes: each may have its own
    neighbours = ring.number, ring.places, stencil.periodic, stencil.responses
    relax_edge(*neighbours, *laws, load, ahead, contact_fraction, sweeps, SETTLED)
    whole, fraction, grazing = point.load.copy(order="K"), point.contact_fraction.copy(), point.grazing.copy()
    whole[nodes], fraction[nodes] = load, contact_fraction
    fresh = nodes[point.load[nodes, 2] > HARDLY * load[:, 2]]  # rub in the direction in which they were moved
    whole[fresh, :2] = point.trial[fresh, :2]
    whole[nodes, MECHANICAL] = problem.contact_law.project(whole[:, MECHANICAL])[nodes]
    grazing[nodes] |= (contact_fraction > 0.0) & (contact_fraction < 1.0)
    return point.moved(whole, fraction, grazing, point.motion)


def _jumps_at_edge(point: Point) -> bool:
    """Whether contact begins to conduct at once: where the conductivity grows from zero with the pressure it does not
    matter which of two neighbours is pressed."""
    equation, largest = point.equation, np.abs(point.jump).max()
    touching = np.full(len(point.load), -LOWEST * equation.scales.pressure)
    jump = equation.transmissivity(touching, point.ahead, 1.0) - equation.transmissivity.open(touching, point.ahead)
    return bool(np.abs(jump).max() > AT_ONCE * largest)
