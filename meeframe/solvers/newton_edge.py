"""Nodes at the edge of a contact that conducts, relaxed beside the steps of Newton's method.

On a coarser grid another edge was found, and what is interpolated from it is wrong where nodes are open, closed or in
between, which depends on how the edge runs between them. Newton's method finds that out node by node, one step after
the other, each of which costs many products. Most of it depends on a few nodes around: these are asked in turns, as in
projected Gauss-Seidel relaxation, each for the load with which it satisfies the laws beside the others. So they are
where a step has opened or closed a node, whose flux is then that of the other state.
"""

from typing import Final

import numpy as np

from meeframe.core.fields import MECHANICAL
from meeframe.core.formulation import ReducedSystem, Stencil
from meeframe.core.law import ContactLaw, attracts
from meeframe.core.once import once_for_each
from meeframe.kernels.edge_relaxation import number_edge, relax_edge
from meeframe.solvers.conduction import Mask, follows_gap
from meeframe.solvers.floating import POTENTIALS
from meeframe.solvers.nonsmooth import Point
from meeframe.solvers.transmissivity import LOWEST

REACH: Final = 4
"""Places around a node where its load counts: as good as 16 of them."""
WIDTH, SWEEPS = 2, 6
"""Spacings from the edge on either side, and sweeps, to and fro in turn: farther in loads follow from those of many
nodes."""
SWITCHED_WIDTH, SWITCHED_SWEEPS = 3, 12
"""The same around nodes that a step has switched, which are few."""
SETTLED: Final = 1e-3
"""Of the work of the first sweeps: one that does less is the last."""
ROUGHER: Final = 4.0
"""So much more the laws may be violated at first: nodes beside the edge have not followed yet."""
BEHIND: Final = 0.1
"""Of the largest violation the residual of a flux is more than so much where it has not followed its node."""
AT_ONCE: Final = 0.5
"""Of the largest jump of conduction that of a contact without pressure is more than so much, or it grows."""
ROUND_OFF: Final = 1e-12
"""Of a traction: what sticks is projected on itself but for so much."""


def relaxed_edge(point: Point) -> Point:
    """A point with the nodes around the edge relaxed, those left in between grazing; the same point where conduction
    does not jump at the edge, where nodes lie on no lattice, or if it does not help."""
    relaxed = _relaxed(point, point.load[:, 2] < 0.0, WIDTH, SWEEPS)
    return relaxed if relaxed.merit < ROUGHER * point.merit else point


def relaxed_where_switched(before: Point, moved: Point) -> Point:
    """A moved point with the nodes relaxed that have opened or closed, with those around; the same point if their
    fluxes are not far from those of their new state, or if it does not help."""
    behind = np.abs(moved.residual[:, POTENTIALS]).max(axis=1) > BEHIND * moved.violation
    switched = behind & moved.switched(before)
    relaxed = _relaxed(moved, switched, SWITCHED_WIDTH, SWITCHED_SWEEPS) if switched.any() else moved
    return relaxed if relaxed.merit < moved.merit else moved


def _relaxed(point: Point, kind: Mask, width: int, sweeps: int) -> Point:
    """A point with the nodes relaxed that are near others of another kind (n,); the same if there is nothing to do."""
    equation, problem = point.equation, point.equation.problem
    law = problem.contact_law
    plain = type(law).resolve is ContactLaw.resolve and not attracts(law) and not follows_gap(problem)
    stencil = _stencil(problem.system, tuple(equation.loaded)) if plain and point.jump.any() else None
    if stencil is None or not _jumps_at_edge(point):
        return point
    number = np.empty(stencil.lattice.shape, np.int64)
    if not number_edge(kind[stencil.lattice], width, stencil.periodic, number):
        return point
    places, nodes = np.argwhere(number >= 0), stencil.lattice[number >= 0]
    # laws are asked at all nodes: each may have its own
    trial = point.trial[:, :2]
    off = np.abs(law.project(point.trial)[:, :2] - trial).max(axis=1)
    slips = (off > ROUND_OFF * np.abs(trial).max(axis=1))[nodes]
    load, ahead, closed = (np.ascontiguousarray(part[nodes]) for part in (point.load, point.ahead, point.closed))
    closed = np.clip(closed, 0.0, 1.0)
    shut = point.transmissivity[nodes] + (1.0 - closed)[:, None] * point.jump[nodes]
    apart = shut - point.jump[nodes]
    relax_edge(
        number, places, stencil.periodic, stencil.responses, shut, apart, slips, load, ahead, closed, sweeps, SETTLED
    )
    whole, fraction, grazing = point.load.copy(order="K"), point.closed.copy(), point.grazing.copy()
    whole[nodes], fraction[nodes] = load, closed
    whole[nodes, MECHANICAL] = law.project(whole[:, MECHANICAL])[nodes]
    grazing[nodes] |= (closed > 0.0) & (closed < 1.0)
    return equation.at(whole, fraction, grazing, point.motion)


@once_for_each
def _stencil(system: ReducedSystem, fields: tuple[int, ...]) -> Stencil | None:
    return system.stencil(REACH, fields)


def _jumps_at_edge(point: Point) -> bool:
    """Whether contact begins to conduct at once: where the conductivity grows from zero with the pressure it does not
    matter which of two neighbours is pressed."""
    equation, largest = point.equation, np.abs(point.jump).max()
    touching = np.full(len(point.load), -LOWEST * equation.scales.pressure)
    jump = equation.transmissivity(touching, point.ahead, 1.0) - equation.transmissivity.open(touching, point.ahead)
    return bool(np.abs(jump).max() > AT_ONCE * largest)
