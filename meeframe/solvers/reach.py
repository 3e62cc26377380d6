"""Whether prescribed forces and moments can be borne at all by tractions that the contact law admits.

Admissible tractions make up a cone at each node, and so do the resultants of all of them together. By the lemma of
Farkas a prescribed resultant lies outside of that cone just if some motion has power against it, and none against any
admissible traction. Generators of the cone are collected, each the traction that resists the present motion the most,
until the nearest resultant found is right or its difference proves to be such a motion.
"""

from typing import Final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.core.contact import ContactProblem
from meeframe.core.fields import ELECTRIC, MECHANICAL, Array
from meeframe.core.law import ContactLaw, attracts, conducts
from meeframe.solvers.free_motion import motions
from meeframe.solvers.scales import Scales

NEGLIGIBLE: Final = 1e-6
MAX_GENERATORS: Final = 200
STEEPEST: Final = 1e6
"""Tangential part of a trial traction of unit pressure: more than any finite friction coefficient."""


def unreachable(problem: ContactProblem, scales: Scales) -> str | None:
    """Why no state at all has the prescribed resultants, in words; None if one may have.

    For contact laws that admit a cone of tractions, with the scaling of the law of maximal dissipation, or less.
    """
    missing = 0.0 if attracts(problem.contact_law) else _missing_force(problem, scales)
    if missing > NEGLIGIBLE:
        return (
            f"no pressure and friction in the contact add up to the prescribed forces and moments ({missing:.1e} off)"
        )
    laws = (problem.electric_law, problem.magnetic_law)
    for freedom in problem.freedoms:
        carried = [freedom.mode[:, ELECTRIC + k].any() and conducts(law) for k, law in enumerate(laws)]
        if freedom.electromagnetic and freedom.total and not any(carried):
            return "a charge or magnetic flux is prescribed, but the contact does not conduct it"
    return None


def _missing_force(problem: ContactProblem, scales: Scales) -> float:
    """Distance of the prescribed resultants to those that can be reached, as a fraction; 0 if it is not certain."""
    moving = motions(problem)
    if moving.size == 0:
        return 0.0
    below = np.isfinite(problem.gap)
    measures = np.stack([problem.freedoms[k].measure[:, MECHANICAL] / scales.totals[k] for k in moving])
    measures[:, ~below] = 0.0
    totals = np.array([problem.freedoms[k].total / scales.totals[k] for k in moving])
    if not totals.any() and _presses(problem):
        # ratios of resultants: then some pressure is needed, and how much does not matter
        weights = np.where(below, problem.system.weights, 0.0)
        force = weights[:, None] * np.array([0.0, 0.0, -1.0]) / (weights.sum() * scales.pressure)
        measures, totals = np.concatenate([measures, force[None]]), np.append(totals, 1.0)
    generators = np.empty((len(totals), 0))
    difference, missing = totals, float(np.linalg.norm(totals))
    while missing > NEGLIGIBLE * np.linalg.norm(totals) and generators.shape[1] < MAX_GENERATORS:
        resisted = np.tensordot(difference, measures, axes=1)
        resisting = _strongest(problem.contact_law, resisted)
        power = (resisted * resisting).sum(axis=1)
        node = int(np.argmax(power))
        generator = measures[:, node] @ resisting[node]
        if power[node] <= NEGLIGIBLE * missing * np.linalg.norm(generator):
            return missing / float(np.linalg.norm(totals))
        generators = np.column_stack([generators, generator / np.linalg.norm(generator)])
        amounts, missing = scipy.optimize.nnls(generators, totals)
        difference = totals - generators @ amounts
    return 0.0


def _presses(problem: ContactProblem) -> bool:
    """Whether the indenter overlaps the unloaded surface and none of its free motions can change that."""
    lifts = any(problem.freedoms[k].mode[np.isfinite(problem.gap), 2].any() for k in motions(problem))
    return not lifts and bool((problem.system.offset[:, 2] > problem.gap).any())


def _strongest(law: ContactLaw, direction: Array) -> Array:
    """Admissible tractions (n, 3) of unit pressure with the largest component along directions (n, 3)."""
    tangential = direction[:, :2] @ law.tangential_scaling()
    size = np.linalg.norm(tangential, axis=1)[:, None]
    trial = np.full_like(direction, -1.0)
    trial[:, :2] = STEEPEST * np.divide(tangential, size, out=np.zeros_like(tangential), where=size > 0.0)
    return law.project(trial)
