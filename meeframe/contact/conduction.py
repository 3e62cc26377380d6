"""Flux law at contact size: resistances, the switch between open and closed, and the graph between them.

A law that jumps at zero traction (eqs. 17, 18) makes the problem quasi-variational: a node that conducts may lift off,
no longer conduct, touch again, and so on without end. The problem with the jump then has no solution; the one with the
jump's filled-in graph has. Such a node is treated as biactive: with zero traction and zero gap it carries any fraction
`contact_fraction` in [0, 1] of the conductivity of a closed contact. The equation
    closed = clip(closed - (p_nu + r g_nu) / p_o, 0, 1)
expresses all of this, for any r > 0 and any pressure p_o > 0: closed is one where p_nu < 0, zero where g_nu > 0, and
between these only where both vanish.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.memoize import memoize_by_identity
from meeframe.contact.problem import ContactProblem
from meeframe.fields import POTENTIALS, Array
from meeframe.laws.base import ConductivityLaw, contact_conductivity
from meeframe.system.capabilities import diagonal

Mask = NDArray[np.bool_]

FLIPS: Final = 3
"""Number of changes between open and closed after which a node is treated as biactive."""
GAIN_GROWTH: Final = 1.1
GAIN_FALL: Final = 0.75
GAIN_LIMITS: Final = (1e-3, 1e12)
ROOT_OFF: Final = 1e-15
"""Tolerance of the drop left at a node, relative to the drop without flux and to itself."""
ROOT_STEPS: Final = 180
TOUCHING: Final = -float(np.finfo(float).tiny)
"""Smallest normal traction in magnitude [Pa], for the evaluation of laws on the closed side of their jump."""


def conducting(problem: ContactProblem) -> bool:
    """Return whether any channel conducts."""
    return any(channel.is_conducting for channel in problem.channels)


def resistances(
    problem: ContactProblem, normal_traction: Array, contact_fraction: Array, own: Array, ahead: Array | None = None
) -> Array:
    """Return the resistances 1/kappa of the channels, (n, channels): 0 conducts perfectly, inf insulates.

    normal_traction: (n,) of the contact; contact_fraction: (n,); own: (n, channels) > 0, response of each node's
    potentials to their own flux density. It defines the meaning of a fraction: the transmissivity kappa own / (1 +
    kappa own) is interpolated, so that a fraction of a perfect conductor has a finite resistance. ahead: (n, fields)
    position of the indenter relative to the body, as `unloaded` returns it, for laws that depend on the gap or the
    drop. Nodes without an indenter above are insulated.
    """
    n_fields = problem.fields.size
    ahead = np.zeros((n_fields, len(own))).T if ahead is None else np.where(np.isfinite(ahead), ahead, 0.0)
    gap, drops = np.maximum(ahead[:, 2], 0.0), ahead[:, POTENTIALS].T
    columns = [
        _resistance(channel.law, normal_traction, contact_fraction, own[:, k], gap, drop)
        for k, (channel, drop) in enumerate(zip(problem.channels, drops, strict=True))
    ]
    found = np.where(np.isfinite(problem.gap), columns, np.inf).T
    return found if problem.area_fraction is None else _at_edge(problem, problem.area_fraction, normal_traction, found)


def unloaded(ahead: Array, flux: Array, own: Array) -> Array:
    """Return the position of the indenter relative to the body, (n, fields), without the nodes' own fluxes.

    flux: (n, channels); own: (n, channels) response of each node's potentials to its own flux.

    The conductivity at a drop is solved together with the drop, node by node, from there: with a law that conducts
    steeply above some drop, iterations on the drop itself would oscillate.
    """
    moved = ahead.copy(order="K")
    moved[:, POTENTIALS] += own * flux
    return moved


@memoize_by_identity
def potential_diagonal(problem: ContactProblem) -> Array:
    """Return the response of each node's potentials to their own flux density, (n, channels)."""
    own = diagonal(problem.system, range(problem.fields.size)[POTENTIALS])
    own.setflags(write=False)  # the independent residual uses it as well
    return own


@dataclass(frozen=True, eq=False)
class Switches:
    """Rules by which an iteration opens and closes the conduction of each node; arrays (n,).

    A node conducts when it has traction (eqs. 17, 18), until it has changed more than FLIPS times. From then on it is
    treated as biactive and steps along the filled-in graph instead. The trial traction p_nu + r g_nu that drives it
    indicates both the current state and the direction of change, which damps the interaction with the slower tractions;
    the step grows while the trial keeps its sign and shrinks when the sign reverses.

    flips: number of changes so far; gain: factor on the step of a biactive node; side: sign of the last trial traction.
    """

    flips: Array
    gain: Array
    side: Array

    @classmethod
    def unused(cls, n: int) -> "Switches":
        """Return the initial switches of n nodes."""
        return cls(np.zeros(n), np.ones(n), np.zeros(n))

    def next(self, was_touching: Mask, touching: Mask, trial: Array) -> "Switches":
        """Return the switches after one step of the tractions."""
        side = np.sign(trial)
        gain = np.clip(self.gain * np.where(side == self.side, GAIN_GROWTH, GAIN_FALL), *GAIN_LIMITS)
        return Switches(self.flips + (touching != was_touching), np.where(self.flips > FLIPS, gain, 1.0), side)

    def contact_fraction(self, before: Array, touching: Mask, trial: Array, pressure: float) -> Array:
        """Return the closed fractions (n,) after a step from `before`; pressure: characteristic pressure [Pa]."""
        return np.where(self.flips > FLIPS, switch(before, self.gain * trial, pressure), touching)


def switch(contact_fraction: Array, trial: Array, pressure: float) -> Array:
    """Return clip(closed - trial / pressure, 0, 1), (n,), with trial = p_nu + r g_nu (n,).

    Its fixed points are the filled-in graph.
    """
    return np.clip(contact_fraction - trial / pressure, 0.0, 1.0)


def follows_gap(problem: ContactProblem) -> bool:
    """Return whether a conductivity of the problem depends on the gap or the drop."""
    return any(channel.law.across_gap for channel in problem.channels)


def _resistance(
    law: ConductivityLaw, normal_traction: Array, contact_fraction: Array, own: Array, gap: Array, drop: Array
) -> Array:
    nothing = np.zeros_like(normal_traction)
    shut, apart = contact_fraction == 1.0, contact_fraction == 0.0
    # a law that depends on the drop is evaluated at many drops: skip it where no node needs it
    kappa = nothing if apart.all() else _alone(law, np.minimum(normal_traction, TOUCHING), nothing, drop, own)
    kappa_open = nothing if shut.all() else _alone(law, nothing, gap, drop, own)
    with np.errstate(divide="ignore", over="ignore"):
        if shut.all() or apart.all():
            return np.asarray(1.0 / (kappa if shut.any() else kappa_open))
        found = np.where(shut, 1.0 / kappa, 1.0 / kappa_open)
        at = np.flatnonzero(~(shut | apart))
        conducting, insulating = (_transmissivity(part[at], own[at]) for part in (kappa, kappa_open))
        found[at] = own[at] * (
            1.0 / (contact_fraction[at] * conducting + (1.0 - contact_fraction[at]) * insulating) - 1.0
        )
    return np.asarray(found)


def _alone(law: ConductivityLaw, normal_traction: Array, gap: Array, drop: Array, own: Array) -> Array:
    """Return kappa (n,) at the part of the drop without flux that remains at each node.

    The remaining fraction x satisfies x (1 + own kappa(x drop)) = 1. It is found by regula falsi (Illinois), which
    creeps where a flat piece meets a steep one: every third iteration halves the bracket. Where kappa jumps there, the
    value returned is the one in between for which x is the root.
    """
    kappa = law.conductivity(normal_traction, gap, drop)
    if not law.across_gap:
        return kappa

    def excess(fraction: Array) -> Array:
        flux = fraction * own * law.conductivity(normal_traction, gap, fraction * drop)
        return np.where(np.isnan(flux), 0.0, fraction + flux - 1.0)

    with np.errstate(divide="ignore", invalid="ignore"):
        here = 1.0 / (1.0 + own * kappa)
        value = excess(here)
        simple = np.abs(value) <= ROOT_OFF
        other = np.where(value < 0.0, 1.0, 0.0)
        beyond = np.where(value < 0.0, own * kappa, -1.0)
        for turn in range(ROOT_STEPS):
            found = (np.abs(value) <= ROOT_OFF) | (np.abs(here - other) <= ROOT_OFF * here)
            if found.all():
                break
            secant = here - value * (here - other) / (value - beyond)
            halved = 0.5 * (here + other)
            following = np.where(np.isfinite(secant) & (turn % 3 < 2), secant, halved)
            following = np.where(found, here, following)
            change = excess(following)
            crossed = change * value < 0.0
            other, beyond = np.where(crossed, (here, value), (other, 0.5 * beyond))
            here, value = following, change
        return np.where(simple, kappa, (1.0 / here - 1.0) / own)


def _at_edge(problem: ContactProblem, area_fraction: Array, normal_traction: Array, found: Array) -> Array:
    """Return the resistances (n, channels) corrected at partly covered nodes (n,).

    At these nodes, conduction without pressure counts on the covered part alone, whether the node itself has pressure
    or not.
    """
    resistance = found.copy()
    at = np.flatnonzero((area_fraction > 0.0) & (area_fraction < 1.0))
    for k, law in enumerate(channel.law for channel in problem.channels):
        if law.across_gap:
            continue
        least = contact_conductivity(law, np.full(len(at), TOUCHING))
        added = contact_conductivity(law, np.minimum(normal_traction[at], TOUCHING))
        with np.errstate(divide="ignore", invalid="ignore"):
            more = np.where(least < added, added - least, 0.0)
            resistance[at, k] = np.where(least > 0.0, 1.0 / (area_fraction[at] * least + more), found[at, k])
    return resistance


def _transmissivity(kappa: Array, own: Array) -> Array:
    """Return kappa own / (1 + kappa own), (n,) in [0, 1], also for kappa = 0 and inf."""
    return np.asarray(1.0 / (1.0 + 1.0 / (kappa * own)))
