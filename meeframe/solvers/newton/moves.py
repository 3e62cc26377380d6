"""State after a step of Newton's method: admissible tractions, and nodes that become biactive."""

from typing import Final

import numpy as np

from meeframe.contact.problem import ContactProblem, contact_gap
from meeframe.fields import MECHANICAL, POTENTIALS, Array
from meeframe.laws.base import attraction, is_adhesive
from meeframe.solvers.newton.contact_edge import relaxed_where_switched
from meeframe.solvers.newton.globalization import Step
from meeframe.solvers.newton.residual import FLUX_ROWS, FRACTION, ResidualState

FLIPS: Final = 1
"""Largest number of openings and closings before a node is treated as biactive.

That does no harm to a node that need not be biactive.
"""
ROUND_OFF: Final = 1e-14
"""Largest normal traction, relative to the characteristic one, that counts as zero.

A flux counts as zero below this fraction of its previous value.
"""


def take_step(point: ResidualState, flips: Array, step: Step, fraction: float) -> tuple[Array, ResidualState]:
    """Return the flips (n,) and the point after a fraction of a step.

    Nodes whose conduction keeps changing become biactive. They begin between open and closed, at the fraction where
    their own switching would make their trial zero: from one of the ends the first step goes too far, since the drive
    changes along with the fraction.
    """
    equation = point.equation
    motion = point.motion + fraction * step.motion
    load = point.load + fraction * step.local[:, :FRACTION]
    load[:, MECHANICAL] = _admissible(equation.problem, load, motion)
    # round-off of tractions, fluxes and fractions that the step removed
    load[np.abs(load[:, 2]) < ROUND_OFF * equation.scales.pressure, MECHANICAL] = 0.0
    load[:, POTENTIALS][np.abs(load[:, POTENTIALS]) < ROUND_OFF * np.abs(point.load[:, POTENTIALS])] = 0.0
    contact_fraction = point.contact_fraction + fraction * step.local[:, FRACTION]
    contact_fraction[np.abs(contact_fraction) < ROUND_OFF] = 0.0
    moved = point.moved(load, contact_fraction, point.grazing, motion)
    flips = flips + moved.switched(point)
    fresh = (flips > FLIPS) & ~moved.grazing
    if fresh.any():
        contact_fraction, lift = moved.contact_fraction.copy(), moved.lift
        within = np.flatnonzero(fresh & (np.abs(moved.trial[:, 2]) < lift))
        contact_fraction[within] = np.clip(
            point.contact_fraction[within] - moved.trial[within, 2] / lift[within], 0.0, 1.0
        )
        moved = moved.regrazed(contact_fraction, moved.grazing | fresh)
    else:
        moved = _with_fitting_fractions(moved)
    return flips, relaxed_where_switched(point, moved)


def held_where_it_grazes(point: ResidualState, moved: ResidualState) -> ResidualState:
    """Return a moved point with the nodes that it opened or closed as biactive, if that violates the laws less.

    Their conduction remains unchanged for the time being: it would jump, and the fluxes with it. Only nodes whose trial
    is as near to zero as their own switching moves it can be biactive. Otherwise the given point is returned.
    """
    near = moved.switched(point) & ~moved.grazing & (np.abs(moved.trial[:, 2]) < moved.sigma)
    if not near.any():
        return moved
    contact_fraction = np.where(near, point.contact_fraction, moved.contact_fraction)
    held = moved.regrazed(contact_fraction, moved.grazing | near)
    return held if held.merit < moved.merit else moved


def _with_fitting_fractions(moved: ResidualState) -> ResidualState:
    """Return a moved point with the intermediate contact fractions that fit its fluxes and drives best.

    A step changes both at once, and the conducted flux is their product, which the linearised equations do not contain.
    The result is the given point if that does not help.
    """
    some = moved.between & moved.jump.any(axis=1)
    if not some.any():
        return moved
    unit = moved.equation.scales.displacement[POTENTIALS]
    left = moved.residual[some][:, FLUX_ROWS]
    slope = moved.jump[some] * moved.drive[some] / unit
    contact_fraction, square = moved.contact_fraction.copy(), (slope**2).sum(axis=1)
    change = np.divide((slope * left).sum(axis=1), square, out=np.zeros_like(square), where=square > 0.0)
    contact_fraction[some] = np.clip(np.clip(contact_fraction[some], 0.0, 1.0) - change, 0.0, 1.0)
    fitting = moved.regrazed(contact_fraction, moved.grazing)
    return fitting if fitting.merit < moved.merit else moved


def _admissible(problem: ContactProblem, load: Array, motion: Array) -> Array:
    """Return the tractions (n, 3) of a load (n, fields) at a motion (m,), their contact part projected by the law."""
    law, traction = problem.contact_law, load[:, MECHANICAL].copy()
    pull = np.zeros(len(load))
    if is_adhesive(law):
        displacement = problem.system.offset + problem.system.apply(load)
        pull = attraction(law, contact_gap(problem, displacement, motion)[:, 2])
    traction[:, 2] -= pull
    traction = law.project(traction)
    traction[:, 2] += pull
    return traction
