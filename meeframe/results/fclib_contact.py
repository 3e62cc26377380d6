"""Conversion between contact problems of meeframe and local problems of FCLIB.

A force on the body is -r: r = -weights * traction, so that r_N >= 0 in compression. The velocity u is the gap between
indenter and body at the end of the increment, its tangential part the slip of the indenter over the body: u = position
- offset - compliance(load), and hence W = compliance / weights, q = position - offset. The signs agree: a traction of
meeframe has the direction of the slip, a reaction of FCLIB the opposite one. Components are reordered, (e1, e2, nu) to
(nu, e1, e2), which keeps frames right-handed. Nodes without an indenter above are no contacts.

Files contain mechanics alone. Where the contact conducts, its potentials are eliminated at given resistances R =
1/kappa (on the set A of fluxes of nodes that conduct, meeframe.solvers.conduction.elimination), which take the
Schur complement W = C_mm - C_mA (C_AA + R)^-1 C_Am of the compliance.
"""

import warnings
from typing import Final

import numpy as np
from scipy.linalg import LinAlgWarning, lu_factor, lu_solve

from meeframe.common.errors import CaseError
from meeframe.contact.channels import flux_channels
from meeframe.contact.conduction import potential_diagonal, resistances
from meeframe.contact.problem import (
    ContactProblem,
    ContactSolution,
    ContactState,
    Solver,
    check_accepted,
    contact_gap,
    indenter_position,
)
from meeframe.fields import N_FIELDS, Array, Indices
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw, contact_conductivity, contact_traction
from meeframe.results.fclib import PER_CONTACT, LocalProblem, LocalSolution
from meeframe.solvers import StoppingCriteria, solve
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import NodalFields

COMPONENTS: Final = np.array([2, 0, 1])
"""Order of the components of a meeframe load or displacement in FCLIB."""
_PRESSURES: Final = -np.logspace(-3, 15, 19)
"""Normal tractions [Pa] for the test of insulation: a law that insulates at all of them counts as insulating."""
MATH_INFO: Final = "W: compliance of deformable bodies, unsymmetric where the formulation collocates"


def local_problem(
    problem: ContactProblem, state: ContactState | None = None, title: str = "", description: str = ""
) -> LocalProblem:
    """Return a contact problem as one of FCLIB: forces [N], gaps and slips [m], contacts in the order of the nodes.

    state: of the problem, where its free motions and its conductivities are fixed; needed only if it has any.
    Raises CaseError if the law is not frictionless or isotropic Coulomb friction with a finite coefficient, if the
    compliance is not held as a matrix, if the indenter is nowhere above, or if a state is needed.
    """
    mu = friction_coefficient(problem.contact_law)
    full = problem.system.dense()
    if full is None:
        raise CaseError("FCLIB: the compliance is not stored as a matrix; allowed: formulations that store one")
    compliance = full.reshape(problem.system.offset.size, -1)
    resistance = _resistance(problem, state)
    position = indenter_position(problem, _motion(problem, state))
    nodes = contacts(problem)
    dofs = (problem.system.n_fields * nodes[:, None] + COMPONENTS).ravel()
    matrix, q = _condensed(compliance, (position - problem.system.offset).ravel(), resistance, dofs)
    matrix /= np.repeat(problem.system.weights[nodes], PER_CONTACT)
    return LocalProblem(matrix, q, np.full(len(nodes), mu), title, description, MATH_INFO)


def local_solution(problem: ContactProblem, state: ContactState) -> LocalSolution:
    """Return a state of a contact problem as a solution of its `local_problem`.

    Gaps and slips are in [m], forces on the body in [N].
    """
    nodes = contacts(problem)
    gap = contact_gap(problem, state.displacement, state.motion)[nodes]
    force = problem.system.weights[nodes, None] * state.load[nodes, :PER_CONTACT]
    return LocalSolution(gap[:, COMPONENTS].ravel(), -force[:, COMPONENTS].ravel())


def contacts(problem: ContactProblem) -> Indices:
    """Return the numbers (m,) of the nodes that are contacts in FCLIB: those with an indenter above."""
    return np.flatnonzero(np.isfinite(problem.gap))


def contact_problem(local: LocalProblem) -> ContactProblem:
    """Return a problem of FCLIB as one of meeframe: as many nodes as contacts, weights of one, insulating.

    Laws of meeframe have one coefficient. Where that of a contact is another, mu_i, its tangential traction is r_T =
    s_i t with s_i = mu_i / max(mu) and its slip s_i u_T: the cone in t has the largest coefficient, and W becomes S W
    S, which leaves the solutions unchanged. A contact without friction has s_i = 0, and an additional compliance that
    keeps t at zero. See `reactions` for the inverse.
    """
    n = len(local.mu)
    scale = _scales(local)
    matrix = np.zeros((n, N_FIELDS, n, N_FIELDS))
    extra = np.where(scale == 0.0, np.diag(local.matrix).mean(), 0.0)
    scaled = scale[:, None] * local.matrix
    scaled *= scale
    np.einsum("ii->i", scaled)[:] += extra
    blocks = scaled.reshape(n, PER_CONTACT, n, PER_CONTACT)
    matrix[:, COMPONENTS[:, None], :, COMPONENTS] = blocks.transpose(1, 3, 0, 2)
    nodes = np.arange(n)
    for field in range(PER_CONTACT, N_FIELDS):
        matrix[nodes, field, nodes, field] = 1.0  # potentials without any effect
    system = DenseSystem(
        points=np.zeros((n, 3)),
        frames=np.tile(np.eye(3), (n, 1, 1)),
        weights=np.ones(n),
        cells=(),
        offset=np.zeros((n, N_FIELDS)),
        matrix=matrix,
        recovery=_no_body,
    )
    q = (scale * local.q).reshape(n, PER_CONTACT)
    law = IsotropicCoulomb(float(local.mu.max()))
    return ContactProblem(system, law, flux_channels(Insulating(), Insulating()), q[:, 0], q[:, 1:], np.zeros((n, 2)))


def reactions(local: LocalProblem, state: ContactState) -> LocalSolution:
    """Return a state of the `contact_problem` of a local problem as its solution, with u = W r + q."""
    r = -_scales(local) * state.load[:, COMPONENTS].ravel()
    return LocalSolution(local.matrix @ r + local.q, r)


def solve_local(
    local: LocalProblem, solver: Solver, stopping: StoppingCriteria | None = None
) -> tuple[LocalSolution, ContactSolution]:
    """Solve a problem of FCLIB with a solver of meeframe; the second result has the status and the residual.

    Raises CaseError if the solver does not accept the problem.
    """
    problem = contact_problem(local)
    check_accepted(solver, problem)
    with warnings.catch_warnings():
        # W of more contacts than degrees of freedom is singular: its residual shows whether there is a solution
        warnings.simplefilter("ignore", LinAlgWarning)
        result = solve(problem, solver, stopping)
    return reactions(local, result.state), result


def _scales(local: LocalProblem) -> Array:
    """Return s_i of `contact_problem` for each component, one for the normal ones, (3m,)."""
    largest = float(local.mu.max()) or 1.0
    scale = np.ones((len(local.mu), PER_CONTACT))
    scale[:, 1:] = (local.mu / largest)[:, None] if local.mu.any() else 1.0
    return scale.ravel()


def friction_coefficient(law: ContactLaw) -> float:
    """Return the friction coefficient of a law, zero without friction.

    Raises CaseError if FCLIB does not support the law.
    """
    match law:
        case Signorini():
            return 0.0
        case IsotropicCoulomb(mu) if np.isfinite(mu):
            return mu
        case OrthotropicCoulomb(mu1, mu2) if mu1 == mu2 and np.isfinite(mu1):
            return mu1
    raise CaseError(
        f"FCLIB: contact law {law}; allowed: contact without friction, or isotropic Coulomb friction with a finite "
        "coefficient"
    )


def _motion(problem: ContactProblem, state: ContactState | None) -> Array:
    if state is not None:
        return state.motion
    if problem.prescribed_resultants:
        raise CaseError(
            f"FCLIB: {len(problem.prescribed_resultants)} motions or potentials of the indenter are free; "
            "allowed: none, or a state, at which they are fixed"
        )
    return np.zeros(0)


def _resistance(problem: ContactProblem, state: ContactState | None) -> Array:
    """Return the resistances (n, 2) of the contact in a state."""
    if state is not None:
        relative_displacement = indenter_position(problem, state.motion) - state.displacement
        pressing = contact_traction(problem.contact_law, state.load[:, 2], relative_displacement[:, 2])
        return resistances(
            problem, pressing, state.contact_fraction, potential_diagonal(problem), relative_displacement
        )
    for name, law in ((channel.field.name, channel.law) for channel in problem.channels):
        if law.across_gap or contact_conductivity(law, _PRESSURES).any():
            raise CaseError(
                f"FCLIB: the {name} law {law} conducts; allowed: insulating laws, or a state, which fixes the "
                "conductivities"
            )
    return np.full((len(problem.gap), len(problem.channels)), np.inf)


def _condensed(
    compliance: Array, relative_displacement: Array, resistance: Array, dofs: Indices
) -> tuple[Array, Array]:
    """Return W per density (k, k) and q (k,) at mechanical dofs (k,) with the conducting potentials eliminated.

    compliance: (5n, 5n); relative_displacement: (5n,) position of the indenter relative to the unloaded body;
    resistance: (n, 2).
    """
    matrix, q = compliance[np.ix_(dofs, dofs)], relative_displacement[dofs]
    diagonal = np.full((len(resistance), PER_CONTACT + resistance.shape[1]), np.inf)
    diagonal[:, PER_CONTACT:] = resistance
    fluxes = np.flatnonzero(np.isfinite(diagonal))
    if fluxes.size == 0:
        return matrix, q
    equations = compliance[np.ix_(fluxes, fluxes)] + np.diag(diagonal.flat[fluxes])
    scale = np.diag(equations) ** -0.5  # makes the equations independent of units
    factor = lu_factor(scale[:, None] * equations * scale)
    right_hand_sides = np.column_stack([compliance[np.ix_(fluxes, dofs)], relative_displacement[fluxes]])
    response = compliance[np.ix_(dofs, fluxes)] @ (scale[:, None] * lu_solve(factor, scale[:, None] * right_hand_sides))
    return matrix - response[:, :-1], q - response[:, -1]


def _no_body(_load: Array) -> NodalFields:
    raise CaseError("an FCLIB problem has no body whose fields could be computed")
