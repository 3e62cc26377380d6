"""Coarse-grid correction of a start that was interpolated from a coarser grid.

The residual of such a start is rough beside the contact edge and the slip boundary, where nodes are relaxed, and smooth
elsewhere: there it arises because the two discretised bodies respond differently to the same load. As in the full
approximation scheme the coarse problem is solved again, with the displacement of the indenter relative to the body that
the finer grid has at the common nodes. The change by one Newton step there, which costs a quarter of one on the finer
grid, is added to the finer load.

Source: Brandt, Math. Comput. 31 (1977) 333.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from meeframe.contact.nested import Coarse
from meeframe.contact.problem import unbalance
from meeframe.fields import MECHANICAL, POTENTIALS, Indices
from meeframe.solvers.newton.contact_edge import smooth_contact_edge
from meeframe.solvers.newton.globalization import newton_step
from meeframe.solvers.newton.moves import take_step
from meeframe.solvers.newton.residual import ContactResidual, ResidualState
from meeframe.solvers.newton.slip_boundary import smooth_slip_boundary

TOLERANCE: Final = 0.03
"""Largest fraction of the residual that the linear solution on the coarse grid may leave."""


def improved_start(
    point: ResidualState, nodes: Indices, coarse: Coarse, below: ContactResidual, places: Indices
) -> ResidualState:
    """Return a start from a coarser grid after relaxation, correction by that grid and another relaxation.

    See `corrected`.
    """
    smooth = smooth_slip_boundary(smooth_contact_edge(point))
    found = corrected(smooth, nodes, coarse, below, places)
    return smooth if found is smooth else smooth_slip_boundary(smooth_contact_edge(found))


def corrected(
    point: ResidualState, nodes: Indices, coarse: Coarse, below: ContactResidual, places: Indices
) -> ResidualState:
    """Return a point whose load is changed by a step of the coarser problem; the given point if that does not help.

    nodes: (n,) of the problem's zone that its equation has, in order; below: the equation of places (m,) of the coarser
    zone.
    """
    there = _seen_from_below(point, nodes, coarse, below, places)
    step = newton_step(there.equation, there.linearise(), TOLERANCE)
    if not step.finite:
        return point
    _, moved = take_step(there, np.zeros(len(places)), step, 1.0)
    if not moved.merit < there.merit:
        return point
    change = np.zeros((point.equation.problem.fields.size, len(coarse.problem.gap))).T
    change[places] = moved.load - there.load
    fields = np.flatnonzero(change.any(axis=0))
    load = point.load.copy(order="K")
    change = coarse.coarsening.prolong(change[:, fields])[nodes]
    load[:, fields] += np.where(load[:, fields] != 0.0, change, 0.0)  # nodes without load remain unloaded
    load[:, MECHANICAL] = point.equation.problem.contact_law.project(load[:, MECHANICAL])
    found = point.moved(load, point.contact_fraction, point.biactive, moved.motion)
    return found if found.merit < point.merit else point


def _seen_from_below(
    point: ResidualState, nodes: Indices, coarse: Coarse, below: ContactResidual, places: Indices
) -> ResidualState:
    """Return the point at the nodes of the coarser grid, in a coarse problem with corrected data.

    The indenter is moved so that its displacement relative to the body is that of the finer grid, and the prescribed
    resultants change so that their error is the same.
    """
    problem, known = below.problem, coarse.coarsening.nodes[places]
    at = np.minimum(np.searchsorted(nodes, known), len(nodes) - 1)
    same = nodes[at] == known
    load = np.where(same[:, None], point.load[at], 0.0)
    biactive, contact_fraction = same & point.biactive[at], np.where(same, point.contact_fraction[at], 0.0)
    relative_displacement, _ = below.approximate_relative_displacement(
        load, point.motion
    )  # error far below the difference of the two grids
    moved = np.zeros_like(relative_displacement)
    np.subtract(
        point.relative_displacement[at],
        relative_displacement,
        out=moved,
        where=same[:, None] & np.isfinite(relative_displacement),
    )
    missing = unbalance(problem, load) - point.balance * point.equation.scales.totals
    prescribed_resultants = (
        replace(free, total=free.total + by) for free, by in zip(problem.prescribed_resultants, missing, strict=True)
    )
    elsewhere = replace(
        problem,
        translation=problem.translation + moved[:, :2],
        gap=problem.gap + moved[:, 2],
        potentials=problem.potentials - moved[:, POTENTIALS],
        prescribed_resultants=tuple(prescribed_resultants),
    )
    return replace(below, problem=elsewhere).beside(
        load, relative_displacement + moved, contact_fraction, biactive, point.motion
    )
