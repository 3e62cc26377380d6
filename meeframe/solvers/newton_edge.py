"""The edge of a contact that conducts, relaxed before Newton's method begins on a fine grid.

On a coarser grid another edge was found, and what is interpolated from it is wrong where nodes are open, closed or in
between, which depends on how the edge runs between them. Newton's method finds that out node by node, one step after
the other, each of which costs many products. Most of it depends on a few nodes around: these are asked in turns, as in
projected Gauss-Seidel relaxation, each for the load with which it satisfies the laws beside the others.
"""

from typing import Final

import numpy as np

from meeframe.core.fields import MECHANICAL
from meeframe.core.law import augmented_traction
from meeframe.kernels.edge_relaxation import number_edge, relax_edge
from meeframe.solvers.conduction import unloaded
from meeframe.solvers.floating import POTENTIALS
from meeframe.solvers.nonsmooth import Point
from meeframe.solvers.transmissivity import LOWEST

WIDTH: Final = 2
"""Spacings from the edge on either side: farther in the loads follow from those of many nodes."""
REACH: Final = 4
"""Places around a node where its load counts: as good as 16 of them."""
SWEEPS: Final = 6
ROUGHER: Final = 4.0
"""So much more the laws may be violated: nodes beside the edge have not followed yet."""
AT_ONCE: Final = 0.5
"""Of the largest jump of conduction that of a contact without pressure is more than so much, or it grows."""


def relaxed_edge(point: Point) -> Point:
    """A point with the nodes around the edge relaxed, those left in between grazing; the same point where conduction
    does not jump at the edge, where nodes lie on no lattice, or if it does not help."""
    equation, problem = point.equation, point.equation.problem
    stencil = problem.system.stencil(REACH) if _jumps_at_edge(point) else None
    if stencil is None:
        return point
    pressed, number = point.load[stencil.lattice, 2] < 0.0, np.empty(stencil.lattice.shape, np.int64)
    count = number_edge(pressed, WIDTH, stencil.periodic, number)
    places = np.argwhere(number >= 0)
    nodes = stencil.lattice[number >= 0]
    if not count:
        return point
    law, lengths = problem.contact_law, (equation.r, equation.r)
    trial = augmented_traction(law, point.load[:, MECHANICAL], point.ahead[:, MECHANICAL], lengths)[nodes]
    load, ahead, closed = (np.ascontiguousarray(part[nodes]) for part in (point.load, point.ahead, point.closed))
    closed = np.clip(closed, 0.0, 1.0)
    conducting = point.transmissivity[nodes] + (1.0 - closed)[:, None] * point.jump[nodes]
    relax_edge(
        number,
        places,
        stencil.periodic,
        stencil.responses,
        conducting,
        conducting - point.jump[nodes],
        (law.project(trial) != trial)[:, :2].any(axis=1),
        load,
        ahead,
        closed,
        SWEEPS,
    )
    load[:, MECHANICAL] = law.project(load[:, MECHANICAL])
    whole, fraction, grazing = point.load.copy(order="K"), point.closed.copy(), point.grazing.copy()
    whole[nodes], fraction[nodes] = load, closed
    grazing[nodes] |= (closed > 0.0) & (closed < 1.0)
    relaxed = equation.at(whole, fraction, grazing, point.motion)
    return relaxed if relaxed.merit < ROUGHER * point.merit else point


def _jumps_at_edge(point: Point) -> bool:
    """Whether contact begins to conduct at once: where the conductivity grows from zero with the pressure it does not
    matter which of two neighbours is pressed."""
    equation, largest = point.equation, np.abs(point.jump).max(initial=0.0)
    if largest == 0.0:
        return False
    touching = np.full(len(point.load), -LOWEST * equation.scales.pressure)
    alone = unloaded(point.ahead, point.load[:, POTENTIALS], equation.own)
    ends = (equation.transmissivity(touching, alone, closed) for closed in (1.0, 0.0))
    return bool(np.abs(np.subtract(*ends)).max() > AT_ONCE * largest)
