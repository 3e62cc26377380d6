"""Prescribed resultants: free motions of the indenter, found together with the tractions of a gradient step.

A step of Uzawa's method projects the augmented tractions p + r S g by the contact law. With free rigid motions w the
gap is g + sum_k w_k mode_k, and the projection is one onto the admissible tractions that also have the prescribed
resultants: w satisfies
    sum measure_k * project(p + r S (g + sum_l w_l mode_l)) = total_k.
These few equations are solved at each step, node by node and without the compliance. Where the step is stationary, w is
the motion of the solution, for any r > 0. Without friction they are the gradient of a convex function.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from meeframe.contact.problem import ContactProblem, ContactState
from meeframe.fields import MECHANICAL, NORMAL, Array, Indices
from meeframe.laws.base import ContactLaw, attraction, augmented_traction, fixed_point_map, traction_tangents

MAX_ITERATIONS: Final = 60
RESULTANT_ROUND_OFF: Final = 1e-14
"""Round-off of a resultant, relative to the sum of the magnitudes of its tractions."""
REGULARISATION: Final = (0.0, 1e-6, 1e-4, 1e-2, 1.0)
"""Regularisations of the equations, in units of the resistance of the whole zone; zero while the contact resists."""
MAX_DISTANCE_RATIO: Final = 10.0
"""Largest motion of the indenter in multiples of its distance from the body; nothing else bounds it in full slip."""
MAX_BISECTIONS: Final = 60
"""Number of bisections towards the sign change of the unbalance, where it does not change at first."""
FRACTIONS: Final = tuple(0.5**k for k in range(12))
MIN_DECREASE: Final = 1e-3
"""Least decrease of the unbalance for an accepted step, as a fraction of the predicted decrease."""
MAX_TRACTION_RATIO: Final = 1e6
"""Tangential part of a trial traction over its pressure, larger than any finite friction coefficient."""


@dataclass(frozen=True, eq=False)
class BalancedProjection:
    """Projected tractions and the motions that balance their resultants.

    Attributes
    ----------
    traction : Array
        (n, 3), projected tractions [Pa].
    trial : Array
        (n, 3), augmented tractions that were projected [Pa].
    motion : Array
        (k,), amounts of the free motions of the mechanical prescribed resultants.
    """

    traction: Array
    trial: Array
    motion: Array


def motions(problem: ContactProblem) -> Indices:
    """Return the numbers (k,), among the prescribed resultants, of those with a free rigid motion."""
    return np.array(
        [i for i, resultant in enumerate(problem.prescribed_resultants) if not resultant.electromagnetic], np.int64
    )


def potentials(problem: ContactProblem) -> Indices:
    """Return the numbers (j,), among the prescribed resultants, of those with a free potential."""
    return np.array(
        [i for i, resultant in enumerate(problem.prescribed_resultants) if resultant.electromagnetic], np.int64
    )


def start_below_indenter(problem: ContactProblem, start: ContactState | None) -> ContactState | None:
    """Return the state of the previous load step without load and contact where there is no indenter above now.

    Such nodes have an infinite gap. A previous problem may have loaded them: the indenter may have moved away, or edges
    that are resolved may lie beyond it.
    """
    if start is None or np.isfinite(problem.gap).all():
        return start
    above = np.isfinite(problem.gap)
    load = np.where(above, start.load.T, 0.0).T  # field by field
    return replace(start, load=load, contact_fraction=np.where(above, start.contact_fraction, 0.0))


def start_load(problem: ContactProblem, start: ContactState | None) -> Array:
    """Return the load (n, fields) of the previous load step, zero if there is none."""
    return np.zeros_like(problem.system.offset) if start is None else start.load


def start_motion(problem: ContactProblem, start: ContactState | None) -> Array:
    """Return the motion (m,) of the previous load step's state if the numbers of free motions agree, else zero."""
    count = len(problem.prescribed_resultants)
    return start.motion if start is not None and start.motion.shape == (count,) else np.zeros(count)


def maximal_traction(law: ContactLaw, direction: Array, normal: Array) -> Array:
    """Return the admissible tractions (n, 3) with the largest component along directions (n, 3).

    Their normal parts are given, (n,). Applies to laws with the scaling of maximal dissipation.
    """
    tangential = direction[:, :2] @ law.tangential_scaling()
    size = np.linalg.norm(tangential, axis=1)[:, None]
    steepest = MAX_TRACTION_RATIO * np.abs(normal).max(initial=0.0)
    trial = np.empty_like(direction)
    trial[:, :2] = steepest * np.divide(tangential, size, out=np.zeros_like(tangential), where=size > 0.0)
    trial[:, NORMAL] = normal
    return law.project(trial)


def reserve(law: ContactLaw, traction: Array, gap: Array, direction: Array) -> float:
    """Return the unused friction along directions (n, 3), summed over the nodes.

    It is the difference between the largest admissible component under the same pressures and that of tractions (n, 3)
    at normal gaps (n,); negative where `maximal_traction` does not return the largest one.
    """
    pull = attraction(law, gap)
    pressed = traction.copy()
    pressed[:, NORMAL] -= pull
    return float((direction * (maximal_traction(law, direction, pressed[:, NORMAL]) - pressed)).sum())


def balanced_projection(
    problem: ContactProblem, traction: Array, gap: Array, r: tuple[float, float]
) -> BalancedProjection:
    """Project augmented tractions after the free motions that balance the prescribed resultants.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    traction : Array
        (n, 3), tractions before the step [Pa].
    gap : Array
        (n, 3), gap at the motion from which the returned motions count [m].
    r : (float, float)
        Normal and tangential step length [Pa/m].

    Returns
    -------
    BalancedProjection
        Tractions and motions. The unbalance of resultants that cannot be reached is as small as could be found.
    """
    balance = _Balance.of(problem, traction, gap, r)
    state = balance.at(np.zeros(len(balance.totals)))
    max_displacement = MAX_DISTANCE_RATIO * balance.distance_scale(state)
    for _ in range(MAX_ITERATIONS):
        if (np.abs(state.unbalance) <= RESULTANT_ROUND_OFF * state.size).all():
            break
        candidate = balance.improve(state, max_displacement)
        if candidate is None:
            break
        state = candidate
    return BalancedProjection(state.traction, state.trial, state.motion)


@dataclass(frozen=True, eq=False)
class _MotionState:
    """Gap, trial and tractions (n, 3) at a motion.

    unbalance: (k,) of the resultants; size: (k,) magnitudes that set their round-off.
    """

    motion: Array
    gap: Array
    trial: Array
    traction: Array
    unbalance: Array
    size: Array


@dataclass(frozen=True, eq=False)
class _Balance:
    """Balance equations of the mechanical free motions.

    modes, measures: (k, n, 3) and totals: (k,) of the prescribed resultants; resistance: (k,) resistance of the whole
    zone [N/m] against each motion.
    """

    problem: ContactProblem
    traction: Array
    gap: Array
    r: tuple[float, float]
    modes: Array
    measures: Array
    totals: Array
    resistance: Array

    @classmethod
    def of(cls, problem: ContactProblem, traction: Array, gap: Array, r: tuple[float, float]) -> "_Balance":
        prescribed_resultants = [problem.prescribed_resultants[i] for i in motions(problem)]
        modes, measures = np.zeros((2, len(prescribed_resultants), *gap.shape))
        for k, resultant in enumerate(prescribed_resultants):
            modes[k], measures[k] = resultant.mode[:, MECHANICAL], resultant.measure[:, MECHANICAL]
        modes[:, ~np.isfinite(gap[:, NORMAL])] = 0.0
        totals = np.array([resultant.total for resultant in prescribed_resultants])
        resistance = np.einsum("kni,kni->k", np.abs(measures), np.abs(modes)) * r[0]
        return cls(problem, traction, gap, r, modes, measures, totals, resistance)

    def at(self, motion: Array) -> _MotionState:
        """Return the tractions at a motion (k,)."""
        gap = self.gap + np.tensordot(motion, self.modes, axes=1)
        trial = augmented_traction(self.problem.contact_law, self.traction, gap, self.r)
        projected = fixed_point_map(self.problem.contact_law, trial, gap, self.r)
        contributions = self.measures * projected
        size = np.maximum(np.abs(contributions).sum(axis=(1, 2)), np.abs(self.totals))
        return _MotionState(motion, gap, trial, projected, contributions.sum(axis=(1, 2)) - self.totals, size)

    def improve(self, state: _MotionState, max_displacement: float) -> _MotionState | None:
        """Return a state with less unbalance; None if there is none.

        Damped Newton steps are tried with increasing regularisation. max_displacement: largest allowed displacement of
        the indenter by the motion [m].
        """
        weight = np.divide(
            1.0, np.sqrt(self.resistance), out=np.zeros_like(self.resistance), where=self.resistance > 0.0
        )
        scaled = weight[:, None] * self._jacobian(state) * weight
        right = -weight * state.unbalance
        for regularisation in REGULARISATION:
            if regularisation > 0.0 and self._is_friction_exhausted(state, weight):
                return None
            try:
                step = weight * np.linalg.solve(scaled + regularisation * np.eye(len(weight)), right)
            except np.linalg.LinAlgError:
                continue
            displacement = self._max_displacement(step)
            if not 0.0 < displacement < np.inf or (regularisation == 0.0 and displacement > max_displacement):
                continue
            step *= min(1.0, max_displacement / displacement)
            for fraction in FRACTIONS:
                motion = state.motion + fraction * step
                if self._max_displacement(motion) > max_displacement:
                    continue
                candidate = self.at(motion)
                if np.linalg.norm(weight * candidate.unbalance) < (1.0 - MIN_DECREASE * fraction) * np.linalg.norm(
                    right
                ):
                    return candidate
        return self._stick(state, weight, max_displacement) or self._bisect(state, weight, max_displacement)

    def _is_friction_exhausted(self, state: _MotionState, weight: Array) -> bool:
        """Return whether no tractions under the same pressures have less unbalance.

        The motion does not change the pressures here. The resultants then lie beyond a plane that the best tractions
        just reach.
        """
        if self.modes[:, :, NORMAL].any():
            return False
        direction = -np.tensordot(weight**2 * state.unbalance, self.measures, axes=1)
        unused = reserve(self.problem.contact_law, state.traction, state.gap[:, NORMAL], direction)
        return abs(unused) <= MIN_DECREASE * float(((weight * state.unbalance) ** 2).sum())

    def _stick(self, state: _MotionState, weight: Array, max_displacement: float) -> _MotionState | None:
        """Return the state at the motion that would balance if friction were unlimited; None if it is no better.

        In slip that is not along the friction, no step along the unbalance helps: friction turns along its limit.
        """
        pressed = np.asarray(state.traction[:, NORMAL] < 0.0)
        traction, by_gap = state.traction.copy(), np.zeros((len(pressed), 3, 3))
        traction[pressed, :2] = state.trial[pressed, :2]
        by_gap[pressed, NORMAL, NORMAL] = self.r[0]
        by_gap[pressed, :2, :2] = self.r[1] * self.problem.contact_law.tangential_scaling()
        jacobian = np.einsum("kni,nij,lnj->kl", self.measures, by_gap, self.modes)
        unbalance = (self.measures * traction).sum(axis=(1, 2)) - self.totals
        step = -weight * (np.linalg.pinv(weight[:, None] * jacobian * weight) @ (weight * unbalance))
        if not self._max_displacement(state.motion + step) <= max_displacement:
            return None
        candidate = self.at(state.motion + step)
        is_better = np.linalg.norm(weight * candidate.unbalance) < np.linalg.norm(weight * state.unbalance)
        return candidate if is_better else None

    def _bisect(self, state: _MotionState, weight: Array, max_displacement: float) -> _MotionState | None:
        """Return a state where the unbalance stops driving the indenter the present way; None if there is none.

        Before contact, or in full slip, the resultants do not change with the motion and no Newton step helps. Along
        their direction the unbalance is monotone (exactly so without friction and attraction), which allows bisection.
        """
        direction = -(weight**2) * state.unbalance
        displacement = self._max_displacement(direction)
        if not 0.0 < displacement < np.inf:
            return None
        low, high = 0.0, max_displacement / displacement
        if direction @ self.at(state.motion + high * direction).unbalance < 0.0:
            return None
        candidate = state
        for _ in range(MAX_BISECTIONS):
            middle = 0.5 * (low + high)
            candidate = self.at(state.motion + middle * direction)
            if np.linalg.norm(weight * candidate.unbalance) < 0.5 * np.linalg.norm(weight * state.unbalance):
                break
            low, high = (middle, high) if direction @ candidate.unbalance < 0.0 else (low, middle)
        return (
            candidate
            if np.linalg.norm(weight * candidate.unbalance) < np.linalg.norm(weight * state.unbalance)
            else None
        )

    def _jacobian(self, state: _MotionState) -> Array:
        """Return the derivative of the resultants with respect to the motion, (k, k)."""
        _, by_gap = traction_tangents(self.problem.contact_law, state.trial, state.gap, self.r)
        return np.asarray(np.einsum("kni,nij,lnj->kl", self.measures, by_gap, self.modes))

    def distance_scale(self, state: _MotionState) -> float:
        """Return the largest distance of body and indenter, or motion due to the unbalance in the whole zone [m]."""
        finite = np.isfinite(state.trial[:, NORMAL])
        separation = float(np.abs(state.trial[finite]).max(initial=0.0)) / self.r[0]
        motion = np.divide(
            state.unbalance, self.resistance, out=np.zeros_like(self.resistance), where=self.resistance > 0.0
        )
        return max(separation, self._max_displacement(motion))

    def _max_displacement(self, motion: Array) -> float:
        """Return the largest displacement of the indenter by a motion (k,) [m]."""
        return float((np.abs(motion) * np.abs(self.modes).max(axis=(1, 2), initial=0.0)).max(initial=0.0))
