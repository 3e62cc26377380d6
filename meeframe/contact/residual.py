"""Independent residual: the violation of the laws by a state, computed without reference to its solver."""

from typing import Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.common.memory import release_freed_memory
from meeframe.contact.conduction import conducting, depends_on_gap, potential_diagonal, resistances, switch, unloaded
from meeframe.contact.generated_heat import conducted_flux
from meeframe.contact.nested import has_nodal_data, is_uniform
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, indenter_field, indenter_position, unbalance
from meeframe.contact.scales import Scales, largest, largest_potentials, problem_scales
from meeframe.fields import MECHANICAL, N_MECHANICAL, NORMAL, POTENTIALS, Array
from meeframe.laws.base import (
    ContactLaw,
    augmented_traction,
    contact_traction,
    fixed_point_map,
    has_friction,
    has_resolvent,
    resolve,
)
from meeframe.system.capabilities import apply_load

NEGLIGIBLE_PRESSURE: Final = 1e-12
"""Pressure of a node that touches, in units of the characteristic one."""
MIN_JUMP: Final = 1e-6
"""Friction under such a pressure that counts, likewise."""
BLOCK_SIZE: Final = 2**14
"""Number of nodes at which laws are evaluated at once."""


def essential_fields(problem: ContactProblem) -> tuple[int, ...]:
    """Return the fields of the displacement on which the laws depend, by column."""
    law = problem.contact_law
    is_frictionless = not has_friction(law) and not has_resolvent(law)
    needed = (not is_frictionless, not is_frictionless, True, *(channel.is_conducting for channel in problem.channels))
    return tuple(np.flatnonzero(needed).tolist())


def evaluate(problem: ContactProblem, iterate: Iterate, fields: tuple[int, ...] | None = None) -> ContactState:
    """Return the state of an iterate, with its displacement by one application of the compliance.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    iterate : Iterate
        Iterate of a solver.
    fields : tuple of int, optional
        Columns of the displacement to compute; the others are zero. By default all columns, which come from `apply`; a
        selection comes from `apply_load`.

    Returns
    -------
    ContactState
        State with the load, contact fractions and motions of the iterate.

    Raises
    ------
    CaseError
        If the solver does not determine the free motions of the problem.
    """
    if np.shape(iterate.motion) != (len(problem.prescribed_resultants),):
        raise CaseError(
            f"the solver found {np.size(iterate.motion)} of the {len(problem.prescribed_resultants)} motions and "
            "potentials of the indenter that are free; allowed with prescribed resultants: a solver that finds them, "
            "such as 'auto'"
        )
    system = problem.system
    if fields is None or len(fields) == system.n_fields:
        release_freed_memory(len(iterate.load))  # of steps, most of which are in single precision
        displacement = system.apply(iterate.load)
        if system.offset.any():
            displacement = system.offset + displacement
    else:
        displacement = np.zeros((system.n_fields, len(iterate.load))).T  # field by field
        for field, values in zip(fields, apply_load(system, iterate.load, fields).T, strict=True):
            np.add(system.offset[:, field], values, out=displacement[:, field])
    return ContactState(iterate.load, displacement, np.asarray(iterate.contact_fraction, float), iterate.motion)


def residual(problem: ContactProblem, state: ContactState, scales: Scales | None = None) -> float:
    """Return the dimensionless violation of the problem by a state; inf if it is not finite.

    It is computed by the laws from the load, the displacement and the contact fraction, without the solver, in units of
    magnitudes characteristic of the problem's data (`scales`). It is the largest of five parts:

    - consistency, displacement = offset + compliance(load);
    - the contact law as a fixed point of its projection (eqs. 27, 28 with r the inverse of a characteristic
    compliance);
    - the flux laws with the conductivity of the state's traction and contact fraction;
    - the contact fraction itself (see meeframe.contact.conduction);
    - the balance of the prescribed resultants, by summation of the load.

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    state : ContactState
        State of the contact zone.
    scales : Scales, optional
        Characteristic magnitudes; computed if not given.

    Returns
    -------
    float
        The residual; inf if the state is not finite.
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

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    state : ContactState
        State to test.
    scales : Scales
        Characteristic magnitudes of the problem, the units of the residual.
    fields : tuple of int, optional
        Columns of the displacement that are known, at least those of `essential_fields`; all by default.

    Returns
    -------
    float
        Dimensionless violation of the laws and of the prescribed resultants; inf if the state is not finite.
    """
    known = [state.displacement] if fields is None else [state.displacement[:, field] for field in fields]
    if not all(np.isfinite(values).all() for values in (state.load, *known, state.contact_fraction, state.motion)):
        return np.inf
    balance = largest(unbalance(problem, state.load) / scales.totals)
    worst = float(np.max([law_violation(problem, state, scales), balance]))
    return worst if np.isfinite(worst) else np.inf


def law_violation(problem: ContactProblem, state: ContactState, scales: Scales) -> float:
    """Return the residual of the laws alone, irrespective of the resultants; nan if it is not a number."""
    return float(np.max([_contact_violation(problem, state, scales), *_flux_violation(problem, state, scales)]))


def node_blocks(law: ContactLaw, n: int) -> list[slice]:
    """Return the blocks in which a law is evaluated at n nodes: one unless it is the same at all nodes."""
    size = BLOCK_SIZE if is_uniform(law, n) else max(n, 1)
    return [slice(first, first + size) for first in range(0, n, size)]


def _contact_violation(problem: ContactProblem, state: ContactState, scales: Scales) -> float:
    """Return the larger violation of the contact law and of the contact fraction.

    It is computed by blocks of nodes, which fit into the cache, if the law is the same at all nodes.
    """
    law, n, r = problem.contact_law, len(state.load), 1.0 / scales.normal_compliance
    axes = [axis for axis in essential_fields(problem) if axis < N_MECHANICAL]
    worst, jumps = [0.0], limit_jumps(law, n, scales.pressure)
    for nodes in node_blocks(law, n):
        traction, contact_fraction = state.load[nodes, MECHANICAL], state.contact_fraction[nodes]
        gap = np.zeros((3, len(contact_fraction))).T
        for axis in axes:
            position = indenter_field(problem, axis, state.motion, nodes)
            np.subtract(position, state.displacement[nodes, axis], out=gap[:, axis])
        trial = augmented_traction(law, traction, gap, (r, r))
        violation = np.abs(traction - fixed_point_map(law, trial, gap, (r, r))).max(axis=1, initial=0.0)
        if jumps:
            violation = np.fmin(violation, _biactive_violation(law, traction, gap, trial, r, scales.pressure))
        worst.append(largest(violation) / scales.pressure)
        worst.append(largest(contact_fraction - switch(contact_fraction, trial[:, NORMAL], scales.pressure)))
    return float(np.max(worst))


def limit_jumps(law: ContactLaw, n: int, size: float = 1.0) -> bool:
    """Return whether a law of n nodes admits friction under hardly any pressure, as constant limits and full stick do.

    size: pressure and friction [Pa] by which both are measured.
    """
    if not 0.0 < size < np.inf:
        return False
    return friction_exceeds(law, n, MIN_JUMP / NEGLIGIBLE_PRESSURE, NEGLIGIBLE_PRESSURE * size)


def friction_exceeds(law: ContactLaw, n: int, ratio: float, pressure: float) -> bool:
    """Return whether a law of n nodes admits friction of more than a multiple of a pressure [Pa]."""
    trial = np.tile([2.0 * ratio * pressure, 0.0, -pressure], (n if has_nodal_data(law, n) else 1, 1))
    return bool(np.abs(law.project(trial)[:, :2]).max(initial=0.0) > ratio * pressure)


def _biactive_violation(law: ContactLaw, traction: Array, gap: Array, trial: Array, r: float, pressure: float) -> Array:
    """Return the violation, (n,) [Pa], by nodes of zero gap and pressure that bear a fraction of the limit of friction.

    trial: (n, 3), augmented tractions; r: their step length; pressure: characteristic one [Pa].
    """
    touching = trial.copy()
    touching[:, NORMAL] = -NEGLIGIBLE_PRESSURE * pressure
    friction = resolve(law, touching, gap, (r, r))[:, :2]
    square = (friction**2).sum(axis=1)
    along = (traction[:, :2] * friction).sum(axis=1)
    fraction = np.clip(np.divide(along, square, out=np.zeros_like(square), where=square > 0.0), 0.0, 1.0)
    missed = np.abs(traction[:, :2] - fraction[:, None] * friction).max(axis=1)
    normal = np.abs(contact_traction(law, traction[:, NORMAL], gap[:, NORMAL]))
    return np.asarray(np.max([missed, normal, r * np.abs(gap[:, NORMAL])], axis=0))


def state_resistances(problem: ContactProblem, state: ContactState) -> Array:
    """Return the resistances of the contact in a state.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    state : ContactState
        Its state.

    Returns
    -------
    Array
        (n, channels), as from `resistances`.
    """
    relative_displacement = indenter_position(problem, state.motion) - state.displacement
    return _resistances(
        problem, state, relative_displacement, conducted_flux(problem, state.load, relative_displacement)
    )


def _resistances(problem: ContactProblem, state: ContactState, relative_displacement: Array, flux: Array) -> Array:
    """Return the resistances (n, channels) of a state with relative displacements (n, fields) and conducted fluxes."""
    normal_traction = contact_traction(problem.contact_law, state.load[:, NORMAL], relative_displacement[:, NORMAL])
    self_compliance = potential_diagonal(problem)
    unloaded_position = unloaded(relative_displacement, flux, self_compliance) if depends_on_gap(problem) else None
    return resistances(problem, normal_traction, state.contact_fraction, self_compliance, unloaded_position)


def _flux_violation(problem: ContactProblem, state: ContactState, scales: Scales) -> list[float]:
    """Return the largest R f + (-phi + phi_o) over a characteristic potential, and f alone where insulated.

    f is the conducted flux, without heat that friction generates; for the potential see Scales.transmitted_drop.

    The violation is one where a law returns NaN: the law is not satisfied there, but the iteration may still proceed.
    """
    compliance = np.diag(scales.compliance)[POTENTIALS]
    if not conducting(problem):
        insulated = zip(state.load.T[POTENTIALS], compliance, scales.drop, strict=True)
        return [largest(flux) * c / scale for flux, c, scale in insulated]
    relative_displacement = indenter_position(problem, state.motion)
    relative_displacement -= state.displacement
    flux = conducted_flux(problem, state.load, relative_displacement)
    resistance = _resistances(problem, state, relative_displacement, flux)
    difference = -relative_displacement[:, POTENTIALS]
    weight = compliance / (compliance + resistance)
    drop = np.where(weight > 0.0, difference, 0.0) * weight + (1.0 - weight) * compliance * flux
    potential = largest_potentials(problem, state.motion, relative_displacement)
    unit = scales.transmitted_drop(weight, state.load, flux, potential)
    return [
        largest(np.where(np.isnan(values), scale, values)) / scale for values, scale in zip(drop.T, unit, strict=True)
    ]
