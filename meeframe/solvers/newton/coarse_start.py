"""Coarse-grid correction of a start that was interpolated from a coarser grid.

The residual of such a start is oscillatory near the contact edge and the slip boundary, where nodes are relaxed, and
smooth elsewhere: there it arises because the two discretised bodies respond differently to the same load. As in the
full approximation scheme the coarse problem is solved again, with the displacement of the indenter relative to the
body that the finer grid has at the common nodes. The change by one Newton step there, which costs a quarter of one on
the finer grid, is added to the finer load.

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


def improve_start(
    point: ResidualState, nodes: Indices, coarse: Coarse, coarse_residual: ContactResidual, coarse_nodes: Indices
) -> ResidualState:
    """Return a start from a coarser grid after relaxation, correction by that grid and another relaxation.

    See `correct_start`.
    """
    smooth = smooth_slip_boundary(smooth_contact_edge(point))
    corrected_state = correct_start(smooth, nodes, coarse, coarse_residual, coarse_nodes)
    return smooth if corrected_state is smooth else smooth_slip_boundary(smooth_contact_edge(corrected_state))


def correct_start(
    point: ResidualState, nodes: Indices, coarse: Coarse, coarse_residual: ContactResidual, coarse_nodes: Indices
) -> ResidualState:
    """Return a point whose load is changed by a step of the coarser problem; the given point if that does not help.

    nodes: (n,) of the problem's zone that its equation has, in order; coarse_residual: the equation of places (m,) of
    the coarser zone.
    """
    coarse_state = _coarse_state(point, nodes, coarse, coarse_residual, coarse_nodes)
    step = newton_step(coarse_state.equation, coarse_state.linearise(), TOLERANCE)
    if not step.finite:
        return point
    _, next_state = take_step(coarse_state, np.zeros(len(coarse_nodes)), step, 1.0)
    if not next_state.merit < coarse_state.merit:
        return point
    change = np.zeros((point.equation.problem.fields.size, len(coarse.problem.gap))).T
    change[coarse_nodes] = next_state.load - coarse_state.load
    fields = np.flatnonzero(change.any(axis=0))
    load = point.load.copy(order="K")
    change = coarse.coarsening.prolong(change[:, fields])[nodes]
    load[:, fields] += np.where(load[:, fields] != 0.0, change, 0.0)  # nodes without load remain unloaded
    load[:, MECHANICAL] = point.equation.problem.contact_law.project(load[:, MECHANICAL])
    corrected_state = point.at_load(load, point.contact_fraction, point.biactive, next_state.motion)
    return corrected_state if corrected_state.merit < point.merit else point


def _coarse_state(
    point: ResidualState, nodes: Indices, coarse: Coarse, coarse_residual: ContactResidual, coarse_nodes: Indices
) -> ResidualState:
    """Return the point at the nodes of the coarser grid, in a coarse problem with corrected data.

    The indenter is moved so that its displacement relative to the body is that of the finer grid, and the prescribed
    resultants change so that their error is the same.
    """
    problem, common_nodes = coarse_residual.problem, coarse.coarsening.nodes[coarse_nodes]
    index = np.minimum(np.searchsorted(nodes, common_nodes), len(nodes) - 1)
    is_common = nodes[index] == common_nodes
    load = np.where(is_common[:, None], point.load[index], 0.0)
    biactive, contact_fraction = (
        is_common & point.biactive[index],
        np.where(is_common, point.contact_fraction[index], 0.0),
    )
    relative_displacement, _ = coarse_residual.approximate_relative_displacement(
        load, point.motion
    )  # error far below the difference of the two grids
    difference = np.zeros_like(relative_displacement)
    np.subtract(
        point.relative_displacement[index],
        relative_displacement,
        out=difference,
        where=is_common[:, None] & np.isfinite(relative_displacement),
    )
    imbalance = unbalance(problem, load) - point.balance * point.equation.scales.totals
    prescribed_resultants = (
        replace(resultant, total=resultant.total + change)
        for resultant, change in zip(problem.prescribed_resultants, imbalance, strict=True)
    )
    corrected_problem = replace(
        problem,
        translation=problem.translation + difference[:, :2],
        gap=problem.gap + difference[:, 2],
        potentials=problem.potentials - difference[:, POTENTIALS],
        prescribed_resultants=tuple(prescribed_resultants),
    )
    return replace(coarse_residual, problem=corrected_problem).at_relative_displacement(
        load, relative_displacement + difference, contact_fraction, biactive, point.motion
    )
