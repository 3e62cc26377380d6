"""Where a step of Newton's method leads: admissible tractions, and nodes that are taken to graze."""

from typing import Final

import numpy as np

from meeframe.contact.problem import ContactProblem, contact_gap
from meeframe.fields import MECHANICAL, POTENTIALS, Array
from meeframe.laws.base import attraction, attracts
from meeframe.solvers.newton.contact_edge import relaxed_where_switched
from meeframe.solvers.newton.globalization import Step
from meeframe.solvers.newton.residual import FLUX_ROWS, FRACTION, Point

FLIPS: Final = 1
"""A node may open and close so many times before it is taken to graze: that does it no harm if it need not."""
ROUND_OFF: Final = 1e-14
"""A normal traction below this fraction of the characteristic one is none, nor a flux of that it was before."""


def moved_by(point: Point, flips: Array, step: Step, fraction: float) -> tuple[Array, Point]:
    """Flips (n,) and point after a fraction of a step. Nodes whose conduction keeps changing are taken to graze.

    They begin between open and closed, where their own switching would take their trial to zero: from one of the ends
    the first step goes too far, since the drive changes along with the fraction.
    """
    equation = point.equation
    motion = point.motion + fraction * step.motion
    load = point.load + fraction * step.local[:, :FRACTION]
    load[:, MECHANICAL] = _admissible(equation.problem, load, motion)
    # what is left of tractions, fluxes and fractions that the step took away
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


def held_where_it_grazes(point: Point, moved: Point) -> Point:
    """A moved point, or the same with nodes that graze where it opened or closed them, if that violates the laws less.

    Their conduction stays for the time being: it would jump, and the fluxes with it. Only nodes whose trial is as near
    to zero as their own switching moves it can graze.
    """
    near = moved.switched(point) & ~moved.grazing & (np.abs(moved.trial[:, 2]) < moved.sigma)
    if not near.any():
        return moved
    contact_fraction = np.where(near, point.contact_fraction, moved.contact_fraction)
    held = moved.regrazed(contact_fraction, moved.grazing | near)
    return held if held.merit < moved.merit else moved


def _with_fitting_fractions(moved: Point) -> Point:
    """A moved point, or the same with the fractions between open and closed that go best with its fluxes and drives.

    A step changes both at once, and what conducts is their product: of that the linearised equations know nothing.
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
    """Tractions (n, 3) of a load (n, fields) at a motion (m,), the contact's part of them projected by the law."""
    law, traction = problem.contact_law, load[:, MECHANICAL].copy()
    pull = np.zeros(len(load))
    if attracts(law):
        displacement = problem.system.offset + problem.system.apply(load)
        pull = attraction(law, contact_gap(problem, displacement, motion)[:, 2])
    traction[:, 2] -= pull
    traction = law.project(traction)
    traction[:, 2] += pull
    return traction
