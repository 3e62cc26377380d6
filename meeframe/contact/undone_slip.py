"""Slip that merely undoes that of the same material before, where it flows through the contact."""

from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask
from meeframe.contact.problem import ContactProblem
from meeframe.fields import MECHANICAL, Array
from meeframe.laws.base import is_adhesive
from meeframe.system.capabilities import MaterialFlow

MAX_BACKWARD: Final = 3
"""Largest number of successive nodes at which material slips back before it slips forward.

More of them are not the end of a line of slip: friction as a whole is about to change. 5 or 8 take as many products.
"""
_EXCESS: Final = 1e-6
"""Part by which a traction grows to find out whether friction limits it."""


def undone_slip(problem: ContactProblem, load: Array, trial: Array) -> Mask | None:
    """Return the nodes at which a state of an iteration slips that should rather stick; None if there are none.

    Where friction acts at its limit at too many nodes, the material that enters them slips back against the friction,
    and then forward as it should. Each node alone seems to slip rightly, but for the first one or two. As long as
    the sum from there is against the friction, the material would stick.

    Gain: 72 instead of 122 products on 256 x 256 nodes with a creepage along the rolling direction.

    Parameters
    ----------
    problem : ContactProblem
        Problem, in which material flows from node to node or not.
    load : Array
        (n, fields), admissible tractions.
    trial : Array
        (n, 3), its augmented tractions, from which it differs by slips times a step length.
    """
    flow = problem.system.capability(MaterialFlow)
    if flow is None or is_adhesive(problem.contact_law):
        return None
    traction, lines = load[:, MECHANICAL].copy(), flow.flow_lines
    size = np.linalg.norm(traction[:, :2], axis=1)
    traction[:, :2] *= 1.0 + _EXCESS
    limited = np.linalg.norm(problem.contact_law.project(traction)[:, :2], axis=1) < (1.0 + 0.5 * _EXCESS) * size
    work = (load[:, :2] * (trial[:, :2] - load[:, :2])).sum(axis=1)
    slips = np.divide(work, size, out=np.zeros_like(size), where=limited)[lines]
    if not (slips < 0.0).any():
        return None
    place = np.arange(len(lines))[:, None]
    backward = place - np.maximum.accumulate(np.where(slips < 0.0, -1, place), axis=0)
    ends = ~limited[lines] | (backward > MAX_BACKWARD)
    sums = np.cumsum(np.where(ends, np.abs(slips).sum(), slips), axis=0)
    highest = np.maximum.accumulate(np.maximum(sums, 0.0), axis=0)
    undone = np.zeros(len(load), bool)
    undone[lines[1:]] = (slips[1:] > 0.0) & (sums[1:] < highest[:-1])
    return undone
