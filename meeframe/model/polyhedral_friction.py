"""States under friction whose limit is a polygon, as initial guesses for states under the laws themselves.

With friction sum_k b_k d_k along directions d_k of each node, b_k >= 0, contact is a linear complementarity problem
(Stewart and Trinkle, Int. J. Numer. Meth. Engng 39 (1996) 2673), in which each line is complementary to the variable
that follows it:

    gap >= 0                                   pressure
    s - d_k . slip >= 0                        b_k
    ratio * pressure - sum_k b_k >= 0          s
    resultant - prescribed = 0                 motion of the indenter.

Lemke's method finds a solution even if states turn back many times as the load or the friction grows, where Newton's
method has no initial guess. Resistances, attraction and compliance of the contact are those of the state before; the
fluxes are eliminated. From one solution to the next, directions are refined around those of the friction found.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from meeframe.common.complementarity import solve_complementarity
from meeframe.contact.conduction import conducting
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, contact_gap
from meeframe.contact.residual import NEGLIGIBLE_PRESSURE, evaluate, law_residual, state_resistances
from meeframe.contact.scales import problem_scales
from meeframe.fields import MECHANICAL, N_MECHANICAL, NORMAL, POTENTIALS, Array, Indices
from meeframe.laws.base import ContactLaw, attraction, augmented_traction, has_resolvent, resolve
from meeframe.model.biactive_friction import SolveEased, solve_with_biactive_friction
from meeframe.model.easier_laws import EXACT, CappedLaw, Easing, resolves_edge
from meeframe.model.kinematics import Solution
from meeframe.solvers.conduction.elimination import Elimination, Response

_FIRST_RATIO: Final = 1.0
"""Ratio of friction to pressure of a state that is easily found."""
_RATIOS: Final = (1e3, 1e4, 1e2, 1e1)
"""Ratios from whose states the solution is sought; most find it from the first one."""
_MAX_NODES: Final = 100
"""Largest number of nodes that may touch: a few seconds for each solution of the complementarity problem."""
_N_DIRECTIONS: Final = 8
"""Number of directions all around."""
_N_REFINED: Final = 5
"""Number of directions around that of the friction found."""
_REFINEMENT: Final = 0.4
"""Factor of the angle that these span, from one solution to the next."""
_MAX_REFINEMENTS: Final = 12
_MAX_IDLE: Final = 4
"""Number of refinements, in all, and in a row without a smaller residual."""
_MAX_RESIDUAL: Final = 1e-4
"""Largest residual at which directions, resistances, attraction and compliance are accurate."""
_LARGE_PRESSURE: Final = 1e6
"""Pressure, in characteristic ones, at which friction no longer grows."""
_FACTORS: Final = 1.0, 1.0001
"""Factors of a trial between which the tangent to the law of a compliant interface is taken."""
_PERTURBATION: Final = 1e-8, 1e-6
"""Perturbations of gaps and slips, and of friction without pressure: degenerate points would stop Lemke's method."""
_SEED: Final = 0
"""Seed of their random factors."""


def solve_from_polyhedral_friction(solve: SolveEased, failed: Solution, tolerance: float) -> Solution | None:
    """Return the solution of an increment with large friction from a state with a polygon as limit of friction.

    Parameters
    ----------
    solve, failed, tolerance
        As for `solve_by_capped_friction`.

    Returns
    -------
    Solution or None
        The solution; None if it is not found, or if more than 100 nodes may touch.
    """
    if not resolves_edge(failed.increment.problem):
        return _solve(solve, failed, tolerance)
    at_nodes = _solve(solve, failed, tolerance, Easing(at_nodes=True))
    if at_nodes is None:
        return None
    solution = solve(at_nodes.end.state, EXACT)
    solution = solution.with_result(iterations=at_nodes.result.iterations + solution.result.iterations)
    if solution.is_converged:
        return solution
    return _solve(solve, solution, tolerance, Easing(edge_of=at_nodes.end.state))


def _solve(solve: SolveEased, failed: Solution, tolerance: float, edge: Easing = EXACT) -> Solution | None:
    """Return the solution of an increment with the contact edge of `edge`, or None."""

    def solve_eased(start: ContactState | None, easing: Easing) -> Solution:
        return solve(start, replace(easing, at_nodes=edge.at_nodes, edge_of=edge.edge_of))

    exact, iterations = failed.increment.problem, failed.result.iterations
    last = solve_eased(None, Easing(_FIRST_RATIO))
    iterations += last.result.iterations
    for ratio in _RATIOS:
        known = last.end.state if last.is_converged else None
        guess = polyhedral_state(last.increment.problem, exact.contact_law, ratio, known)
        if guess is None:
            continue
        capped = solve_eased(guess, Easing(ratio))
        if capped.is_converged:
            solution = solve_with_biactive_friction(solve_eased, capped, ratio, exact, tolerance)
            if solution is not None:
                return solution.with_result(iterations=iterations + solution.result.iterations)
            last = capped
        iterations += capped.result.iterations
    return None


@np.errstate(all="ignore")  # states may be far from any solution
def polyhedral_state(
    problem: ContactProblem, law: ContactLaw, ratio: float, known: ContactState | None
) -> ContactState | None:
    """Return a state under a friction limit that is nearly that of a law, and at most a multiple of the pressure.

    Parameters
    ----------
    problem : ContactProblem
        Problem with a stored matrix, under any contact law.
    law : ContactLaw
        The law.
    ratio : float
        Largest friction over the pressure.
    known : ContactState, optional
        State whose resistances, attraction and compliance of the contact are the first ones; by default nothing
        conducts, attracts or yields at first.

    Returns
    -------
    ContactState or None
        The state, without heat that friction generates. None if no matrix is stored, no node or too many may touch, or
        Lemke's method finds no state.
    """
    scales = problem_scales(problem)
    if problem.system.dense() is None or not 0.0 < scales.pressure < np.inf:
        return None
    problem = replace(problem, contact_law=CappedLaw(law, ratio))
    around = np.tile(2.0 * np.pi * np.arange(_N_DIRECTIONS) / _N_DIRECTIONS, (len(problem.gap), 1))
    directions, span = around, 2.0 * np.pi / _N_DIRECTIONS
    best, least, idle, state = None, np.inf, 0, known
    for _ in range(_MAX_REFINEMENTS):
        state = _Frozen(problem, law, ratio, state).state(directions)
        if state is None:
            break
        residual = law_residual(problem, state, scales)
        idle = 0 if residual < least else idle + 1
        if residual < least:
            best, least = state, residual
        if residual < _MAX_RESIDUAL or idle == _MAX_IDLE:
            break
        friction, gap = state.load[:, :2], contact_gap(problem, state.displacement, state.motion)
        along = np.where(np.any(friction, axis=1, keepdims=True), friction, gap[:, :2])
        angle = np.arctan2(along[:, 1], along[:, 0])
        directions = np.column_stack([around, angle[:, None] + span * np.linspace(-1.0, 1.0, _N_REFINED)])
        span *= _REFINEMENT
    return best


class _Frozen:
    """Contact problem with the resistances, attraction and compliance of the contact of a known state.

    Attributes
    ----------
    nodes : Array
        Those that may touch; further ones are added where a state would overlap.
    """

    def __init__(self, problem: ContactProblem, law: ContactLaw, ratio: float, known: ContactState | None) -> None:
        n, scales = len(problem.gap), problem_scales(problem)
        self._problem, self._pressure = problem, scales.pressure
        self._unit, self._r = scales.normal_compliance * scales.pressure, (1.0 / scales.normal_compliance,) * 2
        self._modes = [k for k, each in enumerate(problem.prescribed_resultants) if not each.electromagnetic]
        self._motion = np.zeros(len(problem.prescribed_resultants)) if known is None else known.motion.copy()
        self._motion[self._modes] = 0.0
        self._load, compliance, closure = np.zeros((n, problem.fields.size)), np.zeros(n), np.zeros(n)
        resistance = np.full((n, len(problem.channels)), np.inf)
        may_touch = np.isfinite(problem.gap)
        if known is not None:
            gap = contact_gap(problem, known.displacement, known.motion)
            self._load[:, NORMAL] = attraction(law, gap[:, NORMAL])
            may_touch &= (gap[:, NORMAL] < scales.displacement[NORMAL]) | known.load[:, MECHANICAL].any(axis=1)
            if conducting(problem):
                resistance = state_resistances(problem, known)
                resistance[np.isnan(resistance)] = np.inf
            if has_resolvent(law):
                finite = np.where(np.isfinite(gap), gap, 0.0)
                compliance, closure = self._linear_closure(law, known.load[:, MECHANICAL], finite)
        self.nodes: Indices = np.flatnonzero(may_touch)
        self._compliance = compliance / scales.normal_compliance
        self._elimination = Elimination.of(problem)
        self._conductors = self._elimination.prepare(resistance, None)
        displacement = np.zeros_like(self._load)
        displacement[:, MECHANICAL] = self._response(self._load[:, MECHANICAL]).displacement
        fixed = contact_gap(problem, displacement, self._motion)
        fixed[:, NORMAL] += closure
        self._gap = np.where(np.isfinite(fixed), fixed, 0.0) / self._unit
        negligible = NEGLIGIBLE_PRESSURE * self._pressure
        self._ratio = np.minimum(ratio, self._friction(law, negligible) / negligible)
        self._limit = self._friction(law, _LARGE_PRESSURE * self._pressure) / self._pressure

    def _linear_closure(self, law: ContactLaw, traction: Array, gap: Array) -> tuple[Array, Array]:
        """Return compliance (n,) [m/Pa] and closure without pressure (n,) [m] of the tangent to a law at a state."""
        trial = augmented_traction(law, traction, gap, self._r)
        # normal tractions that satisfy the law with the difference from their trial, over r, as negative closure
        normal, changed = np.array([resolve(law, factor * trial, gap, self._r)[:, NORMAL] for factor in _FACTORS])
        closure, changed_closure = (np.outer(_FACTORS, trial[:, NORMAL]) - [normal, changed]) / self._r[0]
        compliance, rest, yields = np.zeros(len(gap)), np.zeros(len(gap)), normal < 0.0
        if yields.any():
            compliance[:] = np.median(closure[yields] / normal[yields])
            compliance[yields] = (changed_closure - closure)[yields] / (changed - normal)[yields]
            rest[yields] = compliance[yields] * normal[yields] - closure[yields]
        return compliance, rest

    def _response(self, traction: Array, total: bool = True) -> Response:
        """Return the response of the body to tractions (n, 3), with that to offsets and potentials if it is total."""
        conductors, flux = self._conductors, np.zeros_like(self._conductors.resistance)
        if not total:
            return self._elimination.respond(traction, conductors, flux)
        return self._elimination.state(traction, conductors, flux, np.zeros(len(conductors.floating.totals)))

    def _friction(self, law: ContactLaw, pressure: float) -> Array:
        """Return the largest friction (n,) [Pa] of a law under a pressure [Pa]."""
        trial = np.tile([_LARGE_PRESSURE**2 * self._pressure, 0.0, -pressure], (len(self._load), 1))
        return np.asarray(np.linalg.norm(resolve(law, trial, np.zeros_like(trial), self._r)[:, :2], axis=1))

    def state(self, angles: Array) -> ContactState | None:
        """Return the state with friction along directions at angles (n, k) of each node; None if it is not found."""
        while 0 < len(self.nodes) <= _MAX_NODES:
            state = self._state_at_nodes(angles[self.nodes])
            if state is None:
                return None
            gap = contact_gap(self._problem, state.displacement, state.motion)[:, NORMAL]
            gap[self.nodes] = 0.0
            if (gap >= 0.0).all():
                return state
            self.nodes = np.union1d(self.nodes, np.flatnonzero(gap < 0.0))
        return None

    def _state_at_nodes(self, angles: Array) -> ContactState | None:
        """Return the state with loads at the nodes that may touch alone."""
        m, k = angles.shape
        number = np.arange(m)
        # unit pressure, and unit friction along each direction, as tractions of the nodes
        bases = np.zeros((m, N_MECHANICAL, m, 1 + k))
        bases[number, NORMAL, number, 0] = -1.0
        bases[number, 0, number, 1:], bases[number, 1, number, 1:] = np.cos(angles), np.sin(angles)
        base = bases.reshape(m * N_MECHANICAL, m * (1 + k))
        matrix, right, units = self._equations(base, k)
        solution = solve_complementarity(matrix, right)
        if solution is None:
            return None
        load, motion, n_loads = self._load.copy(), self._motion.copy(), base.shape[1]
        load[self.nodes, MECHANICAL] += self._pressure * (base @ solution[:n_loads]).reshape(m, N_MECHANICAL)
        response = self._response(load[:, MECHANICAL])
        load[:, POTENTIALS] = response.flux
        motion[self._conductors.floating.numbers] = response.potential
        there, back = solution[len(solution) - 2 * len(units) :].reshape(2, -1)
        motion[self._modes] += units * (there - back)
        contact_fraction = np.zeros(len(load))
        contact_fraction[self.nodes] = solution[: n_loads : 1 + k] > 0.0
        return evaluate(self._problem, Iterate(load, contact_fraction, motion=motion))

    def _equations(self, base: Array, k: int) -> tuple[Array, Array, Array]:
        """Return matrix and right-hand side of the complementarity problem, and the units of the motions.

        The variables are pressure and friction of each node, slips s by both limits of friction, and motions of the
        indenter there and back.
        """
        nodes, n_loads = self.nodes, base.shape[1]
        limit = self._limit[nodes]
        limited = np.flatnonzero(limit < _LARGE_PRESSURE)
        compliance = self._compliance_of_body()
        loads = base.T @ (compliance.reshape(len(base), -1) * (self._pressure / self._unit)) @ base
        pressures = slice(0, n_loads, 1 + k)
        loads[pressures, pressures] += np.diag(self._compliance[nodes])
        sums = np.kron(np.eye(len(nodes)), np.concatenate([[0.0], np.ones(k)]))
        bounds = -sums
        bounds[:, pressures] = np.diag(self._ratio[nodes])
        modes, measures, units, missing = self._free_motions(base)
        columns = [sums.T, sums[limited].T, -modes.T, modes.T]
        rows = [bounds, -sums[limited], measures, -measures]
        slips = np.vstack(rows)
        matrix = np.block([[loads, np.hstack(columns)], [slips, np.zeros((len(slips), len(slips)))]])
        sizes = n_loads, len(nodes), len(limited), 2 * len(units)
        right = np.concatenate(
            [-base.T @ self._gap[nodes].ravel(), np.zeros(len(nodes)), limit[limited], -missing, missing]
        )
        strength = np.repeat([_PERTURBATION[0], _PERTURBATION[1], _PERTURBATION[0], 0.0], sizes)
        return matrix, right + strength * np.random.default_rng(_SEED).uniform(0.5, 1.0, len(right)), units

    def _compliance_of_body(self) -> Array:
        """Return the compliance (m, 3, m, 3) of the nodes that may touch, with the potentials eliminated."""
        nodes = self.nodes
        compliance = np.zeros((len(nodes), N_MECHANICAL) * 2)
        for number, node in enumerate(nodes.tolist()):
            for axis in range(N_MECHANICAL):
                traction = np.zeros((len(self._load), N_MECHANICAL))
                traction[node, axis] = 1.0
                compliance[:, :, number, axis] = self._response(traction, total=False).displacement[nodes]
        return compliance

    def _free_motions(self, base: Array) -> tuple[Array, Array, Array, Array]:
        """Return gaps per motion and resultants per load, (motions, loads), units of motions, and missing totals."""
        count = len(self._modes)
        modes, measures = np.zeros((count, base.shape[1])), np.zeros((count, base.shape[1]))
        units, missing = np.ones(count), np.zeros(count)
        for row, number in enumerate(self._modes):
            each = self._problem.prescribed_resultants[number]
            mode, measure = (values[self.nodes, MECHANICAL].ravel() for values in (each.mode, each.measure))
            mode_unit, measure_unit = (np.abs(values).max(initial=0.0) or 1.0 for values in (mode, measure))
            modes[row], measures[row] = mode @ base / mode_unit, measure @ base / measure_unit
            units[row] = self._unit / mode_unit
            missing[row] = (each.total - each.of_load(self._load)) / (measure_unit * self._pressure)
        return modes, measures, units, missing
