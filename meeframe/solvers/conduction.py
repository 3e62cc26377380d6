"""The flux law at contact size: resistances, the switch between open and closed, and the graph between them.

A law that jumps at zero traction (eqs. 17, 18) makes the problem quasi-variational: a node that conducts may lift off,
no longer conduct, touch again, and so for ever. Such a node grazes: the problem with the jump has no solution, the one
with the jump's filled-in graph has. There a node with zero traction and zero gap carries any fraction `closed` in
[0, 1] of the conductivity of a closed contact, and
    closed = clip(closed - (p_nu + r g_nu) / p_o, 0, 1)
says all of it, for any r > 0 and any pressure p_o > 0: closed is one where p_nu < 0, zero where g_nu > 0, and between
only where both vanish.
"""

from typing import Final

import numpy as np

from meeframe.core.contact import ConductivityLaw, ContactProblem
from meeframe.core.fields import Array

TOUCHING: Final = -float(np.finfo(float).tiny)
"""A normal traction that is hardly one [Pa]: laws are evaluated on the closed side of their jump."""


def resistances(problem: ContactProblem, normal_traction: Array, closed: Array, own: Array) -> Array:
    """Resistances 1/kappa of the electric and the magnetic contact, (n, 2): 0 conducts perfectly, inf insulates.

    normal_traction, closed: (n,); own: (n, 2) > 0, response of each node's potentials to their own flux density, which
    is the measure of a fraction: the transmissivity kappa own / (1 + kappa own) is interpolated, so that a fraction of
    a perfect conductor is one of finite resistance. Nodes without an indenter above are insulated.
    """
    columns = [
        _resistance(law, normal_traction, closed, own[:, k])
        for k, law in enumerate((problem.electric_law, problem.magnetic_law))
    ]
    return np.where(np.isfinite(problem.gap)[:, None], np.stack(columns, axis=1), np.inf)


def own_response(problem: ContactProblem) -> Array:
    """Response of each node's two potentials to their own flux density, (n, 2)."""
    blocks = problem.system.diagonal_blocks()
    return np.stack([blocks[:, 3, 3], blocks[:, 4, 4]], axis=1)


def switch(closed: Array, trial: Array, pressure: float) -> Array:
    """clip(closed - trial / pressure, 0, 1), (n,): the filled-in graph as a fixed point; trial = p_nu + r g_nu (n,)."""
    return np.clip(closed - trial / pressure, 0.0, 1.0)


def _resistance(law: ConductivityLaw, normal_traction: Array, closed: Array, own: Array) -> Array:
    kappa = law.conductivity(np.minimum(normal_traction, TOUCHING))
    kappa_open = law.conductivity(np.zeros_like(normal_traction))
    with np.errstate(divide="ignore", over="ignore"):
        transmissivity = closed * _transmissivity(kappa, own) + (1.0 - closed) * _transmissivity(kappa_open, own)
        between = own * (1.0 / transmissivity - 1.0)
        return np.where(closed == 1.0, 1.0 / kappa, np.where(closed == 0.0, 1.0 / kappa_open, between))


def _transmissivity(kappa: Array, own: Array) -> Array:
    """kappa own / (1 + kappa own), (n,) in [0, 1], also for kappa = 0 and inf."""
    return np.asarray(1.0 / (1.0 + 1.0 / (kappa * own)))
