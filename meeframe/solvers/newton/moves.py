"""State after a step of Newton's method: admissible tractions, and nodes that become biactive."""

from typing import Final

import numpy as np

from meeframe.contact.problem import ContactProblem, contact_gap
from meeframe.fields import MECHANICAL, POTENTIALS, Array
from meeframe.laws.base import attraction, is_adhesive
from meeframe.solvers.newton.globalization import Step
from meeframe.solvers.newton.residual import FLUX_ROWS, FRACTION, ResidualState

MAX_FLIPS: Final = 1
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
    stepped = point.at_load(load, contact_fraction, point.biactive, motion)
    flips = flips + stepped.find_switched(point)
    becomes_biactive = (flips > MAX_FLIPS) & ~stepped.biactive
    if becomes_biactive.any():
        contact_fraction, increment = stepped.contact_fraction.copy(), stepped.closing_increment
        near = np.flatnonzero(becomes_biactive & (np.abs(stepped.trial[:, 2]) < increment))
        contact_fraction[near] = np.clip(
            point.contact_fraction[near] - stepped.trial[near, 2] / increment[near], 0.0, 1.0
        )
        stepped = stepped.with_contact_fraction(contact_fraction, stepped.biactive | becomes_biactive)
    else:
        stepped = _fit_fractions(stepped)
    return flips, stepped


def with_biactive(point: ResidualState, stepped: ResidualState) -> ResidualState:
    """Return a moved point with the nodes that it opened or closed as biactive, if that violates the laws less.

    Their conduction remains unchanged for the time being: it would jump, and the fluxes with it. Only nodes whose trial
    is as near to zero as their own switching moves it can be biactive. Otherwise the given point is returned.
    """
    near = stepped.find_switched(point) & ~stepped.biactive & (np.abs(stepped.trial[:, 2]) < stepped.sigma)
    if not near.any():
        return stepped
    contact_fraction = np.where(near, point.contact_fraction, stepped.contact_fraction)
    biactive_state = stepped.with_contact_fraction(contact_fraction, stepped.biactive | near)
    return biactive_state if biactive_state.merit < stepped.merit else stepped


def _fit_fractions(stepped: ResidualState) -> ResidualState:
    """Return a moved point with the intermediate contact fractions that fit its fluxes and drives best.

    A step changes both at once, and the conducted flux is their product, which the linearised equations do not contain.
    The result is the given point if that does not help.
    """
    partial = stepped.between & stepped.jump.any(axis=1)
    if not partial.any():
        return stepped
    unit = stepped.equation.scales.displacement[POTENTIALS]
    flux_residual = stepped.residual[partial][:, FLUX_ROWS]
    slope = stepped.jump[partial] * stepped.drive[partial] / unit
    contact_fraction, square = stepped.contact_fraction.copy(), (slope**2).sum(axis=1)
    change = np.divide((slope * flux_residual).sum(axis=1), square, out=np.zeros_like(square), where=square > 0.0)
    contact_fraction[partial] = np.clip(np.clip(contact_fraction[partial], 0.0, 1.0) - change, 0.0, 1.0)
    fitted = stepped.with_contact_fraction(contact_fraction, stepped.biactive)
    return fitted if fitted.merit < stepped.merit else stepped


def _admissible(problem: ContactProblem, load: Array, motion: Array) -> Array:
    """Return the tractions (n, 3) of a load (n, fields) at a motion (m,), their contact part projected by the law."""
    law, traction = problem.contact_law, load[:, MECHANICAL].copy()
    attractive = np.zeros(len(load))
    if is_adhesive(law):
        displacement = problem.system.offset + problem.system.apply(load)
        attractive = attraction(law, contact_gap(problem, displacement, motion)[:, 2])
    traction[:, 2] -= attractive
    traction = law.project(traction)
    traction[:, 2] += attractive
    return traction
