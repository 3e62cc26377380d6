"""Feasibility of prescribed forces and moments under the tractions that the contact law admits.

Admissible tractions make up a cone at each node, and so do the resultants of all of them together. By the lemma of
Farkas a prescribed resultant lies outside that cone if and only if some motion has power against it, and none against
any admissible traction. Generators of the cone are collected, each the traction that most resists the present motion,
until the nearest resultant found is the prescribed one or its difference proves to be such a motion.

Where the approach is prescribed, pressures follow from the solution, and so does the force that friction can bear.
Insufficient friction shows once every law is satisfied, everything that resists slips, and resultants are still missed.
So does insufficient pressure for a prescribed charge or flux: every law is satisfied, but no node conducts.
"""

from functools import partial
from typing import Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.contact.conduction import potential_diagonal, resistances
from meeframe.contact.free_motion import maximal_traction, motions, potentials, reserve
from meeframe.contact.nested import has_nodal_data, on_sample
from meeframe.contact.problem import ContactProblem, ContactState, contact_gap, unbalance
from meeframe.contact.residual import law_violation
from meeframe.contact.scales import Scales, largest
from meeframe.fields import MECHANICAL, N_MECHANICAL, NORMAL, Array
from meeframe.laws.base import ContactLaw, contact_traction, has_friction, is_adhesive, is_pure_projection

TOLERANCE: Final = 1e-6
MAX_GENERATORS: Final = 200
MAX_COMPRESSION: Final = 1e30
"""Normal traction [Pa] beyond any that a contact law without a bound returns as it is."""
TRIAL_TRACTIONS: Final = tuple(
    pressure * np.array(trial)
    for pressure in (1e-3, 1.0, 1e4, 1e8, 1e12)
    for trial in ([0.5, 0.5, -1.0], [0.5, 0.0, 1.0])
)
"""Trial tractions of pressed and open nodes [Pa], up to pressures beyond any material's."""
LAW_TOLERANCE: Final = 1e-12
"""Largest relative deviation of a traction due to round-off."""
MIN_INFEASIBLE_FRACTION: Final = 0.5
"""Least fraction of the missed resultants that must be infeasible under the present pressures."""
MAX_VIOLATION_RATIO: Final = 0.1
"""Largest violation of the laws, as a fraction of these, below which the pressures count as converged."""


def infeasibility(problem: ContactProblem, scales: Scales) -> str | None:
    """Return the reason why no state has the prescribed resultants; None if one may have them.

    Applies to contact laws that admit a cone of tractions, with the scaling of the law of maximal dissipation, or less.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem.
    scales : Scales
        Characteristic magnitudes of the problem.

    Returns
    -------
    str or None
        Reason in words, for the message of a solution.
    """
    bounded = beyond_bound(problem)
    if bounded is not None:
        return bounded
    missing = 0.0 if is_adhesive(problem.contact_law) else _missing_force(problem, scales)
    if missing > TOLERANCE:
        return (
            f"no pressure and friction in the contact add up to the prescribed forces and moments ({missing:.1e} off)"
        )
    for resultant in problem.prescribed_resultants:
        channels = [problem.channels[k - N_MECHANICAL] for k in resultant.mode_fields if k >= N_MECHANICAL]
        if channels and resultant.total and not any(channel.is_conducting for channel in channels):
            names = " or ".join(channel.field.resultant.replace("_", " ") for channel in channels)
            return f"a {names} is prescribed, but the contact does not conduct it"
    return None


def beyond_bound(problem: ContactProblem) -> str | None:
    """Return the reason why a contact law with bounded pressures cannot bear the prescribed forces; None if it may.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem.

    Returns
    -------
    str or None
        Reason in words, for the message of a solution.
    """
    bound = largest_pressures(problem.contact_law, len(problem.gap))
    if bound.max() == np.inf:
        return None
    for k in motions(problem):
        resultant = problem.prescribed_resultants[k]
        most = float((np.maximum(-resultant.measure_of(2), 0.0) * bound * np.isfinite(problem.gap)).sum())
        if _lifts(problem, k) and resultant.total > most * (1.0 + TOLERANCE):
            return (
                f"the prescribed force or moment of {resultant.total:.4g} is more than the contact law admits: its "
                f"largest pressure over the whole zone makes {most:.4g}"
            )
    return None


def largest_pressures(law: ContactLaw, n: int) -> Array:
    """Return the largest pressures of a contact law on n nodes, inf if it does not bound them or is adhesive.

    Parameters
    ----------
    law : ContactLaw
        Law.
    n : int
        Number of nodes.

    Returns
    -------
    Array
        Pressures, (n,), or (1,) if they are the same at all nodes [Pa].
    """
    trial = np.tile([0.0, 0.0, -MAX_COMPRESSION], (n if has_nodal_data(law, n) else 1, 1))
    bound = -law.project(trial)[:, NORMAL]
    return np.full(len(bound), np.inf) if is_adhesive(law) or not bound.max() < MAX_COMPRESSION / 2.0 else bound


def frictionless_bound(law: ContactLaw, n: int) -> float | None:
    """Return the largest pressure of a law of frictionless, unilateral contact without attraction; None for other laws.

    Parameters
    ----------
    law : ContactLaw
        Law.
    n : int
        Number of nodes.

    Returns
    -------
    float or None
        Pressure [Pa], inf without a bound; None also if it is not the same at all nodes.
    """
    is_projection = is_pure_projection(law) and not has_friction(law)
    return on_sample(law, n, partial(_bound_of_trials, law)) if is_projection else None


def _bound_of_trials(law: ContactLaw, n: int) -> float | None:
    """Return the largest pressure if trials at n nodes are projected between it and zero, else None."""
    bound = float(-law.project(np.tile([0.0, 0.0, -MAX_COMPRESSION], (n, 1)))[:, NORMAL].min())
    for trial in TRIAL_TRACTIONS:
        expected = np.array([0.0, 0.0, np.clip(trial[NORMAL], -bound, 0.0)])
        deviation = np.abs(law.project(np.tile(trial, (n, 1))) - expected)
        if not (deviation <= LAW_TOLERANCE * np.abs(expected)).all():
            return None
    return bound if bound < MAX_COMPRESSION / 2.0 else np.inf


def beyond_friction(problem: ContactProblem, state: ContactState, scales: Scales) -> str | None:
    """Return the reason why friction cannot bear the prescribed tangential resultants; None if it may.

    Friction cannot bear them at the pressures of a state if the state satisfies everything else, to the accuracy by
    which they are missed, and no friction under its pressures reduces the difference: no further motion then changes
    anything.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem.
    state : ContactState
        Present state of the iteration.
    scales : Scales
        Characteristic magnitudes of the problem.

    Returns
    -------
    str or None
        Reason in words, for the message of a solution.
    """
    tangential = [k for k in motions(problem) if not _lifts(problem, k)]
    imbalance = unbalance(problem, state.load)
    relative = imbalance / scales.totals
    deficit = float(np.linalg.norm(relative[tangential]))
    others = np.delete(relative, tangential)
    if not TOLERANCE < deficit < np.inf:
        return None
    measures = [problem.prescribed_resultants[k].measure[:, MECHANICAL] / scales.totals[k] for k in tangential]
    direction = -np.tensordot(relative[tangential], measures, axes=1)
    gap = contact_gap(problem, state.displacement, state.motion)[:, NORMAL]
    shortfall = deficit - abs(reserve(problem.contact_law, state.load[:, MECHANICAL], gap, direction)) / deficit
    # other resultants may be missed too, in favour of these: they bring friction only by its coefficient
    if not shortfall >= MIN_INFEASIBLE_FRACTION * deficit or not largest(others) <= MIN_INFEASIBLE_FRACTION * shortfall:
        return None
    if not law_violation(problem, state, scales) <= MAX_VIOLATION_RATIO * shortfall:
        return None
    totals = np.array([problem.prescribed_resultants[k].total for k in tangential])
    resultants = np.where(
        np.abs(totals + imbalance[tangential]) > TOLERANCE * scales.totals[tangential],
        totals + imbalance[tangential],
        0.0,
    )
    prescribed, friction = (", ".join(f"{value:.4g}" for value in values) for values in (totals, resultants))
    allowed = "allowed: less, a motion in their place, or more pressure before they act"
    if any(2 in problem.prescribed_resultants[k].density_fields for k in tangential):
        return (
            "the ratio of tangential to normal force prescribed is more than friction bears: all slips, or nothing "
            f"touches, and at the pressures found the force is missed by {friction} N, N m ({allowed})"
        )
    return (
        f"the tangential forces and moments prescribed ({prescribed} N, N m) are more than friction bears: all slips, "
        f"and at the pressures found they reach {friction} ({allowed})"
    )


def beyond_conduction(problem: ContactProblem, state: ContactState, scales: Scales) -> str | None:
    """Return the reason why the contact cannot conduct a prescribed charge or flux; None if it may.

    It cannot at the pressures of a state if the state satisfies everything else, to the accuracy by which the charge is
    missed, and no node conducts: the potential of the indenter then changes nothing.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem.
    state : ContactState
        Present state of the iteration.
    scales : Scales
        Characteristic magnitudes of the problem.

    Returns
    -------
    str or None
        Reason in words, for the message of a solution.
    """
    relative = np.abs(unbalance(problem, state.load) / scales.totals)
    missed = [k for k in potentials(problem) if 0.0 < relative[k] < np.inf]  # a charge may be small in its unit
    if not missed:
        return None
    others = largest(np.delete(relative, missed))
    gap = contact_gap(problem, state.displacement, state.motion)[:, NORMAL]
    normal_traction = contact_traction(problem.contact_law, state.load[:, NORMAL], gap)
    resistance = resistances(problem, normal_traction, state.contact_fraction, potential_diagonal(problem))
    for k in missed:
        resultant = problem.prescribed_resultants[k]
        channels = [field - N_MECHANICAL for field in resultant.mode_fields if field >= N_MECHANICAL]
        # a law across the gap may conduct at another potential
        if any(problem.channels[i].law.across_gap for i in channels) or np.isfinite(resistance[:, channels]).any():
            continue
        if max(others, law_violation(problem, state, scales)) <= MAX_VIOLATION_RATIO * relative[k]:
            names = " or ".join(problem.channels[i].field.resultant.replace("_", " ") for i in channels)
            return (
                f"a {names} of {resultant.total:.4g} is prescribed, but no node conducts it at the pressures "
                "found (allowed: a potential in its place, or more pressure)"
            )
    return None


def _missing_force(problem: ContactProblem, scales: Scales) -> float:
    """Return the relative distance of the prescribed resultants to the feasible ones; 0 if it is not certain."""
    moving = motions(problem)
    if moving.size == 0:
        return 0.0
    below = np.isfinite(problem.gap)
    measures = np.stack([problem.prescribed_resultants[k].measure[:, MECHANICAL] / scales.totals[k] for k in moving])
    measures[:, ~below] = 0.0
    totals = np.array([problem.prescribed_resultants[k].total / scales.totals[k] for k in moving])
    if not totals.any() and _presses(problem):
        # ratios of resultants: some pressure is then needed, and its amount does not matter
        weights = np.where(below, problem.system.weights, 0.0)
        force = weights[:, None] * np.array([0.0, 0.0, -1.0]) / (weights.sum() * scales.pressure)
        measures, totals = np.concatenate([measures, force[None]]), np.append(totals, 1.0)
    generators = np.empty((len(totals), 0))
    difference, missing = totals, float(np.linalg.norm(totals))
    while missing > TOLERANCE * np.linalg.norm(totals) and generators.shape[1] < MAX_GENERATORS:
        direction = np.tensordot(difference, measures, axes=1)
        traction = maximal_traction(problem.contact_law, direction, np.full(len(direction), -1.0))
        power = (direction * traction).sum(axis=1)
        node = int(np.argmax(power))
        generator = measures[:, node] @ traction[node]
        if power[node] <= TOLERANCE * missing * np.linalg.norm(generator):
            return missing / float(np.linalg.norm(totals))
        generators = np.column_stack([generators, generator / np.linalg.norm(generator)])
        amounts, missing = scipy.optimize.nnls(generators, totals)
        difference = totals - generators @ amounts
    return 0.0


def _presses(problem: ContactProblem) -> bool:
    """Return whether the indenter overlaps the unloaded surface and none of its free motions can change that."""
    can_lift = any(_lifts(problem, k) for k in motions(problem))
    return not can_lift and bool((problem.system.offset[:, NORMAL] > problem.gap).any())


def _lifts(problem: ContactProblem, resultant: int) -> bool:
    """Return whether a free motion, given by its number, moves the indenter towards the body or away from it."""
    return bool(problem.prescribed_resultants[resultant].mode[np.isfinite(problem.gap), NORMAL].any())
