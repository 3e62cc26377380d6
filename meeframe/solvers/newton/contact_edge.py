"""Local relaxation of nodes at the edge of a conducting contact, between the steps of Newton's method.

The contact edge on a coarser grid differs, and what is interpolated from it is wrong where nodes are open, closed or
biactive, which depends on the course of the edge between them. Newton's method finds the state of these nodes one by
one in successive steps, each of which costs many products. Most of it depends on a few nodes around: these are solved
in turn, as in projected Gauss-Seidel relaxation, each for the load that satisfies the laws with the others fixed. The
same is done where a step has opened or closed a node, whose flux is then that of the other state.
"""

from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask, depends_on_gap
from meeframe.fields import MECHANICAL
from meeframe.laws.base import is_pure_projection
from meeframe.solvers._kernels.edge_relaxation import relax_edge
from meeframe.solvers.conduction.transmissivity import MIN_PRESSURE_RATIO
from meeframe.solvers.newton.boundary_band import MAX_MERIT_GROWTH, BoundaryBand, slips
from meeframe.solvers.newton.residual import ResidualState

WIDTH, SWEEPS = 2, 6
"""Half width of the relaxed band, in spacings from the contact edge, and largest number of sweeps.

Sweeps alternate in direction. Farther from the edge loads depend on those of many nodes.
"""
SWITCHED_WIDTH, SWITCHED_SWEEPS = 3, 12
"""Half width and largest number of sweeps around nodes that a step has switched, which are few."""
WORK_TOLERANCE: Final = 1e-3
"""Work of a sweep, relative to that of the greatest one, at which it is the last."""
LAG_FRACTION: Final = 0.1
"""Fraction of the largest violation above which the residual of pressure or fluxes shows that a node lags behind."""
MAX_DOMINANT_NODES: Final = 25
"""Largest number of nodes with the largest violation that count as few.

So many nodes with the largest violation each would have the merit of all nodes: the others violate the laws less.
"""
MAX_PRESSURE_RATIO: Final = 1e-3
"""Largest fraction of its new pressure that a node bore before to count as newly pressed."""
MIN_JUMP_RATIO: Final = 0.5
"""Smallest jump of conduction of a contact without pressure, as a fraction of the largest jump.

Below it the conduction counts as growing with the pressure.
"""


def smooth_contact_edge(point: ResidualState) -> ResidualState:
    """Return a point with the nodes around the contact edge relaxed, those left between open and closed as biactive.

    The result is the given point where conduction does not jump at the edge, where nodes lie on no lattice, or if the
    relaxation does not help.
    """
    relaxed = _relax(point, point.load[:, 2] < 0.0, WIDTH, SWEEPS)
    return relaxed if relaxed.merit < MAX_MERIT_GROWTH * point.merit else point


def relax_switched(before: ResidualState, stepped: ResidualState) -> ResidualState:
    """Return a moved point after relaxation of the nodes that have opened or closed.

    If only few nodes violate the laws strongly, biactive nodes that lag behind are included, and in any case the nodes
    around. The result is the given point if these nodes do not violate the laws far more than others, or if the
    relaxation does not help.
    """
    is_local = stepped.merit**2 * stepped.equation.count < MAX_DOMINANT_NODES * stepped.law_residual**2
    lags = np.maximum(np.abs(stepped.residual[:, 2]), stepped.node_residual) > LAG_FRACTION * stepped.law_residual
    switched = lags & (stepped.find_switched(before) | (is_local & stepped.biactive))
    relaxed = _relax(stepped, switched, SWITCHED_WIDTH, SWITCHED_SWEEPS) if switched.any() else stepped
    return relaxed if relaxed.merit < stepped.merit else stepped


def _relax(point: ResidualState, kind: Mask, width: int, sweeps: int) -> ResidualState:
    """Return a point after relaxation of the nodes near others of another kind (n,), if there are any."""
    problem = point.equation.problem
    if (
        not is_pure_projection(problem.contact_law)
        or depends_on_gap(problem)
        or not point.jump.any()
        or not _jumps_at_edge(point)
    ):
        return point
    band = BoundaryBand.of(point, kind, width)
    if band is None:
        return point
    nodes, stencil = band.nodes, band.stencil
    load, relative_displacement, contact_fraction = (
        np.ascontiguousarray(values[nodes])
        for values in (point.load, point.relative_displacement, point.contact_fraction)
    )
    contact_fraction = np.clip(contact_fraction, 0.0, 1.0)
    closed = point.transmissivity[nodes] + (1.0 - contact_fraction)[:, None] * point.jump[nodes]
    open_ = closed - point.jump[nodes]
    laws = closed, open_, slips(point)[nodes]  # evaluated at all nodes: each may have its own law
    neighbours = band.number, band.positions, stencil.periodic, stencil.responses
    relax_edge(*neighbours, *laws, load, relative_displacement, contact_fraction, sweeps, WORK_TOLERANCE)
    full_load, fraction, biactive = point.load.copy(order="K"), point.contact_fraction.copy(), point.biactive.copy()
    full_load[nodes], fraction[nodes] = load, contact_fraction
    newly_pressed = nodes[
        point.load[nodes, 2] > MAX_PRESSURE_RATIO * load[:, 2]
    ]  # newly pressed nodes slip in the direction of their trial
    full_load[newly_pressed, :2] = point.trial[newly_pressed, :2]
    full_load[nodes, MECHANICAL] = problem.contact_law.project(full_load[:, MECHANICAL])[nodes]
    biactive[nodes] |= (contact_fraction > 0.0) & (contact_fraction < 1.0)
    return point.at_load(full_load, fraction, biactive, point.motion)


def _jumps_at_edge(point: ResidualState) -> bool:
    """Return true if contact begins to conduct at once.

    Where the conductivity grows from zero with the pressure, it does not matter which of two neighbours is pressed.
    """
    equation, largest = point.equation, np.abs(point.jump).max()
    touching = np.full(len(point.load), -MIN_PRESSURE_RATIO * equation.scales.pressure)
    jump = equation.transmissivity(touching, point.relative_displacement, 1.0) - equation.transmissivity.open(
        touching, point.relative_displacement
    )
    return bool(np.abs(jump).max() > MIN_JUMP_RATIO * largest)
