"""A better start on a finer grid than what is interpolated from a coarser one: what both grids know of its residual.

It is rough beside the edge of the contact and the boundary of slip, where nodes are relaxed, and smooth elsewhere: the
same load moves the two bodies otherwise. As in the full approximation scheme the coarse problem is asked again, with
the indenter as far ahead of the body as the finer grid finds it at the nodes that both have. What a step of Newton's
method changes there, which costs a quarter of one on the finer grid, is added to the finer load.

Source: Brandt, Math. Comput. 31 (1977) 333.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from meeframe.contact.nested import Coarse
from meeframe.contact.problem import unbalance
from meeframe.fields import MECHANICAL, POTENTIALS, Indices
from meeframe.solvers.newton.contact_edge import relaxed_edge
from meeframe.solvers.newton.globalization import newton_step
from meeframe.solvers.newton.moves import moved_by
from meeframe.solvers.newton.residual import Equation, Point
from meeframe.solvers.newton.slip_boundary import relaxed_slip

TOLERANCE: Final = 0.03
"""Fraction of the residual that may be left of the coarse equations."""


def improved_start(point: Point, nodes: Indices, coarse: Coarse, below: Equation, places: Indices) -> Point:
    """A point interpolated from a coarser grid, relaxed, corrected by that grid and relaxed again; see corrected."""
    smooth = relaxed_slip(relaxed_edge(point))
    found = corrected(smooth, nodes, coarse, below, places)
    return smooth if found is smooth else relaxed_slip(relaxed_edge(found))


def corrected(point: Point, nodes: Indices, coarse: Coarse, below: Equation, places: Indices) -> Point:
    """A point with its load changed by a step of the coarser problem; the same point if that does not help.

    nodes: (n,) of the problem's zone that its equation has, in order; below: that of places (m,) of the coarser zone.
    """
    there = _seen_from_below(point, nodes, coarse, below, places)
    step = newton_step(there.equation, there.linearise(), TOLERANCE)
    if not step.finite:
        return point
    _, moved = moved_by(there, np.zeros(len(places)), step, 1.0)
    if not moved.merit < there.merit:
        return point
    change = np.zeros((point.equation.problem.fields.size, len(coarse.problem.gap))).T
    change[places] = moved.load - there.load
    fields = np.flatnonzero(change.any(axis=0))
    load = point.load.copy(order="K")
    change = coarse.coarsening.prolong(change[:, fields])[nodes]
    load[:, fields] += np.where(load[:, fields] != 0.0, change, 0.0)  # nodes that bear nothing go on so
    load[:, MECHANICAL] = point.equation.problem.contact_law.project(load[:, MECHANICAL])
    found = point.moved(load, point.contact_fraction, point.grazing, moved.motion)
    return found if found.merit < point.merit else point


def _seen_from_below(point: Point, nodes: Indices, coarse: Coarse, below: Equation, places: Indices) -> Point:
    """The point at the nodes of the coarser grid, in its problem with the indenter moved to where it is ahead of the
    finer body, and with resultants that are wrong by as much."""
    problem, known = below.problem, coarse.coarsening.nodes[places]
    at = np.minimum(np.searchsorted(nodes, known), len(nodes) - 1)
    same = nodes[at] == known
    load = np.where(same[:, None], point.load[at], 0.0)
    grazing, contact_fraction = same & point.grazing[at], np.where(same, point.contact_fraction[at], 0.0)
    ahead, _ = below.roughly_ahead(load, point.motion)  # by far as near as the two grids are to each other
    moved = np.zeros_like(ahead)
    np.subtract(point.ahead[at], ahead, out=moved, where=same[:, None] & np.isfinite(ahead))
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
    return replace(below, problem=elsewhere).beside(load, ahead + moved, contact_fraction, grazing, point.motion)
