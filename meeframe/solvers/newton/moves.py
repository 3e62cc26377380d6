"""Changes of a state of Newton's method: a fraction of a step, and the improvement of a start from a coarser grid."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from meeframe.common.memory import stack_columns
from meeframe.contact.conduction import is_partial
from meeframe.contact.nested import Coarse, with_defect
from meeframe.contact.problem import ContactProblem, contact_gap, unbalance
from meeframe.contact.relaxation import Start, relax, relax_contact_edge
from meeframe.fields import MECHANICAL, NORMAL, POTENTIALS, Array, Indices
from meeframe.laws.base import attraction, is_adhesive
from meeframe.solvers.newton.linear import Step, newton_step
from meeframe.solvers.newton.residual import FRACTION, ContactResidual, ResidualState

MAX_FLIPS: Final = 1
"""Largest number of openings and closings before a node is treated as biactive.

That does no harm to a node that need not be biactive.
"""
ROUND_OFF: Final = 1e-14
"""Largest normal traction, relative to the characteristic one, that counts as zero.

A flux counts as zero below this fraction of its previous value.
"""
MAX_RELAXED_GROWTH: Final = 4.0
"""Largest factor by which relaxation may raise the merit at first, as the nodes around have not followed yet."""
CORRECTION_TOLERANCE: Final = 0.03
"""Fraction of the residual that the linear equations of a correction by the coarser grid may leave."""


def take_step(state: ResidualState, flips: Array, step: Step, fraction: float) -> tuple[Array, ResidualState]:
    """Return the flips (n,) and the state after a fraction of a step.

    Nodes whose conduction keeps changing become biactive. They begin between open and closed, at the fraction where
    switching would make their trial zero: from an end the first step goes too far, since the drive changes too.
    """
    equation = state.equation
    motion = state.motion + fraction * step.motion
    changes = zip(state.load.T, step.local.T[:FRACTION], strict=True)
    load = stack_columns((before + fraction * change for before, change in changes), state.load.shape)
    load[:, MECHANICAL] = _admissible(equation.problem, load, motion)
    # round-off of tractions, fluxes and fractions that the step removed
    load[np.abs(load[:, NORMAL]) < ROUND_OFF * equation.scales.pressure, MECHANICAL] = 0.0
    load[:, POTENTIALS][np.abs(load[:, POTENTIALS]) < ROUND_OFF * np.abs(state.load[:, POTENTIALS])] = 0.0
    contact_fraction = state.contact_fraction + fraction * step.local[:, FRACTION]
    contact_fraction[np.abs(contact_fraction) < ROUND_OFF] = 0.0
    candidate = equation.at(load, contact_fraction, state.biactive, motion)
    flips = flips + candidate.find_switched(state)
    becomes_biactive = (flips > MAX_FLIPS) & ~candidate.biactive
    if becomes_biactive.any():
        contact_fraction, increment = candidate.contact_fraction.copy(), candidate.closing_increment
        normal_trial = candidate.trial[:, NORMAL]
        near = np.flatnonzero(becomes_biactive & (np.abs(normal_trial) < increment))
        contact_fraction[near] = np.clip(state.contact_fraction[near] - normal_trial[near] / increment[near], 0.0, 1.0)
        candidate = candidate.with_contact_fraction(contact_fraction, candidate.biactive | becomes_biactive)
    return flips, candidate


def _admissible(problem: ContactProblem, load: Array, motion: Array) -> Array:
    """Return the tractions (n, 3) of a load (n, fields) at a motion (m,), their contact part projected by the law."""
    law, traction = problem.contact_law, load[:, MECHANICAL].copy()
    attractive = np.zeros(len(load))
    if is_adhesive(law):
        displacement = problem.system.offset + problem.system.apply(load)
        attractive = attraction(law, contact_gap(problem, displacement, motion)[:, NORMAL])
    traction[:, NORMAL] -= attractive
    traction = law.project(traction)
    traction[:, NORMAL] += attractive
    return traction


def improve_start(
    state: ResidualState, nodes: Indices, coarse: Coarse, coarse_equation: ContactResidual, coarse_nodes: Indices
) -> ResidualState:
    """Return a start from a coarser grid that is corrected by that grid and relaxed where contact and stick end.

    The correction is smooth: around the edge of a conducting contact, the start is relaxed beforehand.

    Parameters
    ----------
    state : ResidualState
        State of the start.
    nodes : Indices
        (n,), nodes of its equation among those of the zone, in ascending order.
    coarse : Coarse
        Problem on the coarser grid.
    coarse_equation : ContactResidual
        Equation that was solved there.
    coarse_nodes : Indices
        (m,), nodes of that equation among those of the coarser zone.
    """
    relaxed = _relaxed(state, relax_contact_edge)
    return _relaxed(_corrected(relaxed, nodes, coarse, coarse_equation, coarse_nodes), relax)


def _relaxed(state: ResidualState, relaxation: Callable[[Start], tuple[Array, Array] | None]) -> ResidualState:
    """Return a state relaxed around the edges of contact and stick; the given state if that does not help."""
    problem, fraction = state.equation.problem, np.clip(state.contact_fraction, 0.0, 1.0)
    closed = state.transmissivity + (1.0 - fraction)[:, None] * state.jump
    values = state.load, state.relative_displacement, state.trial, fraction
    relaxed = relaxation(Start(problem, *values, closed, closed - state.jump))
    if relaxed is None:
        return state
    load, fraction = relaxed
    biactive = state.biactive | is_partial(fraction)
    candidate = state.equation.at(load, fraction, biactive, state.motion)
    return candidate if candidate.merit < MAX_RELAXED_GROWTH * state.merit else state


def _corrected(
    state: ResidualState, nodes: Indices, coarse: Coarse, coarse_equation: ContactResidual, coarse_nodes: Indices
) -> ResidualState:
    """Return a state whose smooth error one step on the coarser grid removes; the given state if that does not help.

    What is left after relaxation arises because the two discretised bodies respond differently to the same load. As in
    the full approximation scheme, the coarser problem gets the defects of the finer state.
    """
    common = coarse.coarsening.nodes[coarse_nodes]
    index = np.minimum(np.searchsorted(nodes, common), len(nodes) - 1)
    shared = nodes[index] == common
    load, fraction = np.where(shared, state.load[index].T, 0.0).T, np.where(shared, state.contact_fraction[index], 0.0)
    biactive = shared & state.biactive[index]
    before = coarse_equation.at(load, fraction, biactive, state.motion)
    displacement = before.relative_displacement
    known = shared[:, None] & np.isfinite(displacement)
    defect = np.zeros_like(displacement)
    np.subtract(state.relative_displacement[index], displacement, out=defect, where=known)
    imbalance = unbalance(coarse_equation.problem, load) - state.balance * state.equation.scales.totals
    equation = replace(coarse_equation, problem=with_defect(coarse_equation.problem, defect, imbalance))
    before = equation.at_relative_displacement(load, displacement + defect, fraction, biactive, state.motion)
    step = newton_step(equation, before.linearise(), CORRECTION_TOLERANCE)
    if not step.finite:
        return state
    _, after = take_step(before, np.zeros(len(load)), step, 1.0)
    if not after.merit < before.merit:
        return state
    change = np.zeros((state.equation.problem.fields.size, len(coarse.problem.gap))).T
    change[coarse_nodes] = after.load - before.load
    fields = np.flatnonzero(change.any(axis=0))
    load, change = state.load.copy(order="K"), coarse.coarsening.prolong(change[:, fields])[nodes]
    load[:, fields] += np.where(load[:, fields] != 0.0, change, 0.0)  # nodes without load remain unloaded
    load[:, MECHANICAL] = state.equation.problem.contact_law.project(load[:, MECHANICAL])
    candidate = state.equation.at(load, state.contact_fraction, state.biactive, after.motion)
    return candidate if candidate.merit < state.merit else state
