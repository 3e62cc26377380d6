"""Slip that merely undoes that of the same material before, where it flows through the contact."""

from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask
from meeframe.contact.problem import ContactProblem
from meeframe.fields import MECHANICAL, Array
from meeframe.laws.base import is_adhesive
from meeframe.system.capabilities import MaterialFlow

_EXCESS: Final = 1e-6
"""Part by which a traction grows to find out whether friction limits it."""


def undone_slip(problem: ContactProblem, load: Array, slip: Array) -> Mask | None:
    """Return the nodes at which a state of an iteration slips that should rather stick; None if there are none.

    Where friction acts at its limit at too many nodes, the material that enters them slips back against the friction,
    and then forward as it should. Each node alone seems to slip rightly, but for the first one or two. As long as
    the sum from there is against the friction, the material would stick.

    Parameters
    ----------
    problem : ContactProblem
        Problem, in which material flows from node to node or not.
    load : Array
        (n, fields), admissible tractions.
    slip : Array
        (n, 2), slip of the indenter over the material at each node [m].
    """
    flow = problem.system.capability(MaterialFlow)
    if flow is None or is_adhesive(problem.contact_law):
        return None
    traction, lines = load[:, MECHANICAL].copy(), flow.flow_lines
    size = np.linalg.norm(traction[:, :2], axis=1)
    traction[:, :2] *= 1.0 + _EXCESS
    limited = np.linalg.norm(problem.contact_law.project(traction)[:, :2], axis=1) < (1.0 + 0.5 * _EXCESS) * size
    along = np.divide((load[:, :2] * slip).sum(axis=1), size, out=np.zeros_like(size), where=limited)
    if not (along < 0.0).any():
        return None
    steps = np.where(limited, along, np.abs(along).sum())[lines]  # a node that sticks ends the sum
    total = np.cumsum(steps, axis=0)
    highest = np.maximum.accumulate(np.maximum(total, 0.0), axis=0)
    undone = np.zeros(len(load), bool)
    undone[lines[1:]] = (along[lines[1:]] > 0.0) & (total[1:] < highest[:-1])
    return undone
