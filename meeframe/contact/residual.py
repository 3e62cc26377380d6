"""Independent residual: the violation of the laws by a state, computed without reference to its solver."""

from typing import Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.contact.conduction import conducting, follows_gap, potential_diagonal, resistances, switch, unloaded
from meeframe.contact.nested import same_everywhere
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, indenter_field, indenter_position, unbalance
from meeframe.contact.scales import Scales, largest, problem_scales
from meeframe.fields import MECHANICAL, N_MECHANICAL, POTENTIALS
from meeframe.laws.base import ContactLaw, augmented_traction, contact_traction, fixed_point_map
from meeframe.system.capabilities import apply_load

BLOCK: Final = 2**14
"""Number of nodes at which laws are evaluated at once."""


def essential_fields(problem: ContactProblem) -> tuple[int, ...]:
    """Return the fields of the displacement on which the laws depend, by column."""
    law = problem.contact_law
    slides = not law.tangential_scaling().any() and type(law).resolve is ContactLaw.resolve
    asked = (not slides, not slides, True, *(channel.is_conducting for channel in problem.channels))
    return tuple(np.flatnonzero(asked).tolist())


def evaluate(problem: ContactProblem, iterate: Iterate, fields: tuple[int, ...] | None = None) -> ContactState:
    """Return the state of an iterate, with its displacement by one application of the compliance.

    fields: columns of the displacement to compute, all by default; the others are zero. All columns together come from
    `apply`, a selection from `apply_load`.

    Raises CaseError if the solver does not determine the free motions of the problem.
    """
    if np.shape(iterate.motion) != (len(problem.prescribed_resultants),):
        raise CaseError(
            f"the solver found {np.size(iterate.motion)} of the {len(problem.prescribed_resultants)} motions and "
            "potentials of the indenter that are free; allowed with prescribed resultants: a solver that finds them, "
            "such as 'auto'"
        )
    system = problem.system
    displacement = np.zeros((system.n_fields, len(iterate.load))).T
    whole = fields is None or len(fields) == system.n_fields
    columns = tuple(range(system.n_fields)) if fields is None else fields
    caused = system.apply(iterate.load) if whole else apply_load(system, iterate.load, columns)
    for field, part in zip(columns, caused.T, strict=True):  # field by field
        np.add(system.offset[:, field], part, out=displacement[:, field])
    return ContactState(iterate.load, displacement, iterate.contact_fraction, iterate.motion)


def residual(problem: ContactProblem, state: ContactState, scales: Scales | None = None) -> float:
    """Return the dimensionless violation of the problem by a state; inf if it is not finite.

    It is computed by the laws from the load, the displacement and the closed fraction, without the solver, in units of
    magnitudes characteristic of the problem's data (`scales`, computed if not given). It is the largest of five parts:

    - consistency, displacement = offset + compliance(load);
    - the contact law as a fixed point of its projection (eqs. 27, 28 with r the inverse of a characteristic
    compliance);
    - the flux laws with the conductivity of the state's traction and closed fraction;
    - the closed fraction itself (see meeframe.contact.conduction);
    - the balance of the prescribed resultants, by summation of the load.
    """
    scales = scales or problem_scales(problem)
    expected = problem.system.offset + problem.system.apply(state.load)
    consistency = np.abs(state.displacement - expected) / scales.displacement
    worst = max(float(consistency.max(initial=0.0)), law_residual(problem, state, scales))
    return worst if np.isfinite(worst) else np.inf


def law_residual(
    problem: ContactProblem, state: ContactState, scales: Scales, fields: tuple[int, ...] | None = None
) -> float:
    """Return the residual without the consistency of load and displacement.

    fields: columns of the displacement that are known, at least those of `essential_fields`; all by default.
    """
    known = [state.displacement] if fields is None else [state.displacement[:, field] for field in fields]
    if not all(np.isfinite(part).all() for part in (state.load, *known, state.contact_fraction, state.motion)):
        return np.inf
    balance = largest(unbalance(problem, state.load) / scales.totals)
    worst = float(np.max([law_violation(problem, state, scales), balance]))
    return worst if np.isfinite(worst) else np.inf


def law_violation(problem: ContactProblem, state: ContactState, scales: Scales) -> float:
    """Return the residual of the laws alone, irrespective of the resultants; nan if it is not a number."""
    return float(np.max([_contact_violation(problem, state, scales), *_flux_violation(problem, state, scales)]))


def _contact_violation(problem: ContactProblem, state: ContactState, scales: Scales) -> float:
    """Return the larger violation of the contact law and of the closed fraction.

    It is computed by blocks of nodes, which fit into the cache, if the law is the same at all nodes.
    """
    law, n, r = problem.contact_law, len(state.load), 1.0 / scales.normal_compliance
    asked = [axis for axis in essential_fields(problem) if axis < N_MECHANICAL]
    position = {axis: indenter_field(problem, axis, state.motion) for axis in asked}
    size, worst = BLOCK if same_everywhere(law, n) else max(n, 1), [0.0]
    for first in range(0, n, size):
        nodes = slice(first, first + size)
        traction, contact_fraction = state.load[nodes, MECHANICAL], state.contact_fraction[nodes]
        gap = np.zeros((3, len(contact_fraction))).T
        for axis in asked:
            np.subtract(position[axis][nodes], state.displacement[nodes, axis], out=gap[:, axis])
        trial = augmented_traction(law, traction, gap, (r, r))
        worst.append(largest(traction - fixed_point_map(law, trial, gap, (r, r))) / scales.pressure)
        worst.append(largest(contact_fraction - switch(contact_fraction, trial[:, 2], scales.pressure)))
    return float(np.max(worst))


def _flux_violation(problem: ContactProblem, state: ContactState, scales: Scales) -> list[float]:
    """Return the largest R f + (-phi + phi_o) over a characteristic potential, and f alone where insulated.

    The violation is one where a law returns NaN: the law is not satisfied there, but the iteration may still proceed.
    """
    compliance, potential = np.diag(scales.compliance)[POTENTIALS], scales.displacement[POTENTIALS]
    if not conducting(problem):
        insulated = zip(state.load.T[POTENTIALS], compliance, potential, strict=True)
        return [largest(flux) * c / scale for flux, c, scale in insulated]
    ahead = indenter_position(problem, state.motion)
    ahead -= state.displacement
    pressing = contact_traction(problem.contact_law, state.load[:, 2], ahead[:, 2])
    own = potential_diagonal(problem)
    alone = unloaded(ahead, state.load[:, POTENTIALS], own) if follows_gap(problem) else None
    resistance = resistances(problem, pressing, state.contact_fraction, own, alone)
    difference = -ahead[:, POTENTIALS]
    share = compliance / (compliance + resistance)
    drop = np.where(share > 0.0, difference, 0.0) * share + (1.0 - share) * compliance * state.load[:, POTENTIALS]
    return [
        largest(np.where(np.isnan(part), scale, part)) / scale for part, scale in zip(drop.T, potential, strict=True)
    ]
