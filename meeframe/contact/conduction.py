"""Fluxes across the contact: resistances, transitions between open and closed contact, and partial conduction.

A law that jumps at zero traction (eqs. 17, 18) makes the problem quasi-variational: a node that conducts may lift off,
no longer conduct, touch again, and so on without end. The problem with the jump then has no solution; the one with the
jump's filled-in graph has. Such a node is treated as biactive: with zero traction and zero gap it carries any fraction
`contact_fraction` c in [0, 1] of the conductivity of a closed contact. The equation
    c = clip(c - (p_nu + r g_nu) / p_o, 0, 1)
expresses all of this, for any r > 0 and any pressure p_o > 0: c is one where p_nu < 0, zero where g_nu > 0, and between
these only where both vanish.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.memoize import memoize_by_identity
from meeframe.contact.problem import ContactProblem
from meeframe.fields import N_MECHANICAL, NORMAL, POTENTIALS, Array
from meeframe.laws.base import ConductivityLaw, contact_conductivity
from meeframe.system.capabilities import diagonal

Mask = NDArray[np.bool_]

MAX_FLIPS: Final = 3
"""Number of changes between open and closed after which a node is treated as biactive."""
GAIN_GROWTH: Final = 1.1
GAIN_SHRINKAGE: Final = 0.75
GAIN_LIMITS: Final = (1e-3, 1e12)
ROOT_TOLERANCE: Final = 1e-15
"""Tolerance of the drop left at a node, relative to the drop without flux and to itself."""
MAX_ROOT_STEPS: Final = 180
MIN_TRACTION: Final = -float(np.finfo(float).tiny)
"""Smallest normal traction in magnitude [Pa], for the evaluation of laws on the closed side of their jump."""
MIN_PRESSURE: Final = 1e-9
"""Least pressure, in units of the largest, by which a node counts as touching where the contact edge is located."""


def conducting(problem: ContactProblem) -> bool:
    """Return whether fluxes may cross the contact: any channel conducts, or friction generates heat."""
    return problem.friction_heat > 0.0 or any(channel.is_conducting for channel in problem.channels)


def resistances(
    problem: ContactProblem,
    normal_traction: Array,
    contact_fraction: Array,
    self_compliance: Array,
    relative_displacement: Array | None = None,
) -> Array:
    """Return the resistances 1/kappa of the channels at each node.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    normal_traction : Array
        (n,), normal traction of the contact [Pa], negative in compression.
    contact_fraction : Array
        (n,) in [0, 1], fraction of a closed contact's conductivity.
    self_compliance : Array
        (n, channels) > 0, response of each node's potentials to their own flux density. It defines the meaning of a
        fraction: the transmissivity kappa C / (1 + kappa C), C the self-compliance, is interpolated, so that a fraction
        of a perfect conductor has a finite resistance.
    relative_displacement : Array, optional
        (n, fields), displacement of the indenter relative to the body, as returned by `unloaded`, for laws that depend
        on the gap or the drop; zero by default.

    Returns
    -------
    Array
        (n, channels), 0 for a perfect conductor, inf where the contact insulates or no indenter is above.
    """
    n_fields = problem.fields.size
    relative_displacement = (
        np.zeros((n_fields, len(self_compliance))).T
        if relative_displacement is None
        else np.where(np.isfinite(relative_displacement), relative_displacement, 0.0)
    )
    gap, drops = np.maximum(relative_displacement[:, NORMAL], 0.0), relative_displacement[:, POTENTIALS].T
    columns = [
        _resistance(channel.law, normal_traction, contact_fraction, self_compliance[:, k], gap, drop)
        for k, (channel, drop) in enumerate(zip(problem.channels, drops, strict=True))
    ]
    resistance = np.where(np.isfinite(problem.gap), columns, np.inf).T
    return (
        resistance
        if problem.area_fraction is None
        else _with_area_fraction(problem, problem.area_fraction, normal_traction, contact_fraction, resistance)
    )


def closed_resistances(problem: ContactProblem, pressure: float) -> Array:
    """Return the resistances (fields,) of contact at a pressure [Pa]; zero if it conducts perfectly or not at all."""
    pressed = np.array([-pressure])
    resistance = np.zeros(problem.fields.size)
    for field, channel in enumerate(problem.channels, N_MECHANICAL):
        conductivity = float(contact_conductivity(channel.law, pressed)[0])
        resistance[field] = 1.0 / conductivity if 0.0 < conductivity < np.inf else 0.0
    return resistance


def unloaded(relative_displacement: Array, flux: Array, self_compliance: Array) -> Array:
    """Return the displacement of the indenter relative to the body without the effect of each node's own fluxes.

    The conductivity at a drop is solved together with the drop, node by node, from there: with a law that conducts
    steeply above some drop, iterations on the drop itself would oscillate.

    Parameters
    ----------
    relative_displacement : Array
        (n, fields), displacement of the indenter relative to the body, with all fluxes.
    flux : Array
        (n, channels), flux densities.
    self_compliance : Array
        (n, channels), response of each node's potentials to their own flux density.

    Returns
    -------
    Array
        (n, fields).
    """
    position = relative_displacement.copy(order="K")
    position[:, POTENTIALS] += self_compliance * flux
    return position


@memoize_by_identity
def potential_diagonal(problem: ContactProblem) -> Array:
    """Return the response of the potentials of each node to their own flux density.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.

    Returns
    -------
    Array
        (n, channels), read-only.
    """
    self_compliance = diagonal(problem.system, range(problem.fields.size)[POTENTIALS])
    self_compliance.setflags(write=False)  # the independent residual uses it as well
    return self_compliance


@dataclass(frozen=True, eq=False)
class Switches:
    """Rules by which an iteration opens and closes the conduction of each node.

    A node conducts when it has traction (eqs. 17, 18), until it has changed more than MAX_FLIPS times. From then on it
    is treated as biactive and steps along the filled-in graph instead. The trial traction p_nu + r g_nu that drives it
    indicates both the current state and the direction of change, which damps the interaction with the slower tractions;
    the step grows while the trial keeps its sign and shrinks when the sign reverses.

    Attributes
    ----------
    flips : Array
        (n,), number of changes so far.
    gain : Array
        (n,), factor on the step of a biactive node.
    side : Array
        (n,), sign of the last trial traction.
    """

    flips: Array
    gain: Array
    side: Array

    @classmethod
    def unused(cls, n: int) -> "Switches":
        """Return the initial switches.

        Parameters
        ----------
        n : int
            Number of nodes.

        Returns
        -------
        Switches
            Switches of nodes that have not changed yet.
        """
        return cls(np.zeros(n), np.ones(n), np.zeros(n))

    def next(self, was_touching: Mask, touching: Mask, trial: Array) -> "Switches":
        """Return the switches after one step of the tractions.

        Parameters
        ----------
        was_touching, touching : Mask
            (n,), True where nodes had traction before the step and where they have it after.
        trial : Array
            (n,), trial tractions p_nu + r g_nu after the step [Pa].

        Returns
        -------
        Switches
            The switches for the next step.
        """
        side = np.sign(trial)
        gain = np.clip(self.gain * np.where(side == self.side, GAIN_GROWTH, GAIN_SHRINKAGE), *GAIN_LIMITS)
        return Switches(self.flips + (touching != was_touching), np.where(self.flips > MAX_FLIPS, gain, 1.0), side)

    def contact_fraction(self, before: Array, touching: Mask, trial: Array, pressure: float) -> Array:
        """Return the contact fractions after a step.

        Parameters
        ----------
        before : Array
            (n,), fractions before the step.
        touching : Mask
            (n,), True where nodes have traction.
        trial : Array
            (n,), trial tractions p_nu + r g_nu [Pa].
        pressure : float
            Characteristic pressure [Pa].

        Returns
        -------
        Array
            (n,) in [0, 1].
        """
        return np.where(self.flips > MAX_FLIPS, switch(before, self.gain * trial, pressure), touching)


def switch(contact_fraction: Array, trial: Array, pressure: float) -> Array:
    """Return clip(c - trial / pressure, 0, 1), (n,), for contact fractions c (n,).

    trial: (n,), p_nu + r g_nu [Pa]. The fixed points are the filled-in graph.
    """
    return np.clip(contact_fraction - trial / pressure, 0.0, 1.0)


def is_partial(contact_fraction: Array) -> Mask:
    """Return where contact fractions (n,) are those of biactive nodes between open and closed."""
    return np.asarray((contact_fraction > 0.0) & (contact_fraction < 1.0))


def depends_on_gap(problem: ContactProblem) -> bool:
    """Return whether a conductivity of the problem depends on the gap or the drop."""
    return any(channel.law.across_gap for channel in problem.channels)


def _resistance(
    law: ConductivityLaw,
    normal_traction: Array,
    contact_fraction: Array,
    self_compliance: Array,
    gap: Array,
    drop: Array,
) -> Array:
    zero = np.zeros_like(normal_traction)
    closed, open_ = contact_fraction == 1.0, contact_fraction == 0.0
    # a law that depends on the drop is evaluated at many drops: skip it where no node needs it
    kappa = (
        zero
        if open_.all()
        else _conductivity_at_root(law, np.minimum(normal_traction, MIN_TRACTION), zero, drop, self_compliance)
    )
    kappa_open = zero if closed.all() else _conductivity_at_root(law, zero, gap, drop, self_compliance)
    with np.errstate(divide="ignore", over="ignore"):
        if closed.all() or open_.all():
            return np.asarray(1.0 / (kappa if closed.any() else kappa_open))
        resistance = np.where(closed, 1.0 / kappa, 1.0 / kappa_open)
        nodes = np.flatnonzero(~(closed | open_))
        conducting, insulating = (
            _transmissivity(conductivity[nodes], self_compliance[nodes]) for conductivity in (kappa, kappa_open)
        )
        resistance[nodes] = self_compliance[nodes] * (
            1.0 / (contact_fraction[nodes] * conducting + (1.0 - contact_fraction[nodes]) * insulating) - 1.0
        )
    return np.asarray(resistance)


def _conductivity_at_root(
    law: ConductivityLaw, normal_traction: Array, gap: Array, drop: Array, self_compliance: Array
) -> Array:
    """Return kappa (n,) at the part of the drop without flux that remains at each node.

    The remaining fraction x satisfies x (1 + C kappa(x drop)) = 1, C the self-compliance. It is found by regula falsi
    (Illinois), which converges slowly where a flat piece meets a steep one: every third iteration halves the bracket.
    Where kappa jumps there, the value returned is the one in between for which x is the root.
    """
    kappa = law.conductivity(normal_traction, gap, drop) + 0.0  # laws may return -0.0
    if not law.across_gap:
        return kappa

    def excess(fraction: Array) -> Array:
        flux = fraction * self_compliance * law.conductivity(normal_traction, gap, fraction * drop)
        return np.where(np.isnan(flux), 0.0, fraction + flux - 1.0)

    with np.errstate(divide="ignore", invalid="ignore"):
        root = 1.0 / (1.0 + self_compliance * kappa)
        value = excess(root)
        is_direct = np.abs(value) <= ROOT_TOLERANCE
        bracket_end = np.where(value < 0.0, 1.0, 0.0)
        end_value = np.where(value < 0.0, self_compliance * kappa, -1.0)
        for step in range(MAX_ROOT_STEPS):
            converged = (np.abs(value) <= ROOT_TOLERANCE) | (np.abs(root - bracket_end) <= ROOT_TOLERANCE * root)
            if converged.all():
                break
            secant = root - value * (root - bracket_end) / (value - end_value)
            midpoint = 0.5 * (root + bracket_end)
            candidate = np.where(np.isfinite(secant) & (step % 3 < 2), secant, midpoint)
            candidate = np.where(converged, root, candidate)
            candidate_value = excess(candidate)
            crossed = candidate_value * value < 0.0
            bracket_end, end_value = np.where(crossed, (root, value), (bracket_end, 0.5 * end_value))
            root, value = candidate, candidate_value
        return np.where(is_direct, kappa, (1.0 / root - 1.0) / self_compliance)


def _with_area_fraction(
    problem: ContactProblem, area_fraction: Array, normal_traction: Array, contact_fraction: Array, unscaled: Array
) -> Array:
    """Return the resistances (n, channels) corrected at nodes whose area is partly in contact.

    At these nodes, conduction without pressure counts on the area fraction (n,) alone, whether the node itself has
    pressure or not: a node outside the contact edge may bear a little pressure, but no area of it touches. The pressure
    of nodes without contact fraction is zero: round-off where their attraction is subtracted, of which a power law of a
    small exponent would make a notable conductivity.
    """
    resistance = unscaled.copy()
    nodes = np.flatnonzero(area_fraction < 1.0)
    touch = np.full(len(normal_traction), MIN_TRACTION)
    pressure = np.where(contact_fraction > 0.0, np.minimum(normal_traction, touch), touch)
    for k, law in enumerate(channel.law for channel in problem.channels):
        if law.across_gap:
            continue
        touching, pressed = (contact_conductivity(law, traction)[nodes] for traction in (touch, pressure))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            increase = np.where(touching < pressed, pressed - touching, 0.0)
            partial = np.where(area_fraction[nodes] > 0.0, area_fraction[nodes] * touching, 0.0)
            resistance[nodes, k] = np.where(touching > 0.0, 1.0 / (partial + increase), unscaled[nodes, k])
    return resistance


def _transmissivity(kappa: Array, self_compliance: Array) -> Array:
    """Return kappa C / (1 + kappa C), C the self-compliance: (n,) in [0, 1], also for kappa = 0 and inf."""
    return np.asarray(1.0 / (1.0 + 1.0 / (kappa * self_compliance)))
