"""Prescribed resultants: the free motions of the indenter, found together with the tractions of a gradient step.

A step of Uzawa's method projects the augmented tractions p + r S g by the contact law. With free rigid motions w the
gap is g + sum_k w_k mode_k, and the projection is one onto the admissible tractions that also have the prescribed
resultants: w is such that
    sum measure_k * project(p + r S (g + sum_l w_l mode_l)) = total_k.
These few equations are solved at each step, node by node and without the compliance. Where the step is at rest, w is
the motion of the solution, whatever r > 0. Without friction they are the gradient of a convex function.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.contact.problem import ContactProblem, ContactState
from meeframe.fields import MECHANICAL, Array, Indices
from meeframe.laws.base import ContactLaw, attraction, augmented_traction, fixed_point_map, traction_tangents

MAX_ITERATIONS: Final = 60
ROUND_OFF: Final = 1e-14
"""Of a resultant, relative to what the tractions add up to without regard to sign."""
REGULARISATION: Final = (0.0, 1e-6, 1e-4, 1e-2, 1.0)
"""Of the equations, in parts of the resistance of the whole zone: none while there is contact that resists."""
FARTHEST: Final = 10.0
"""The indenter moves at most so many times its distance from the body: where all slips nothing else would stop it."""
BISECTIONS: Final = 60
"""Of the way to where the unbalance turns, where it does not change at first."""
FRACTIONS: Final = tuple(0.5**k for k in range(12))
LEAST_FALL: Final = 1e-3
"""The unbalance falls by this fraction of what a step promises, or the step is not taken."""
MIN_NORMAL_COSINE: Final = 1e6
"""Tangential part of a trial traction over its pressure: more than any finite friction coefficient."""


@dataclass(frozen=True, eq=False)
class Balanced:
    """Tractions (n, 3) projected by the law, the trial (n, 3) that was, and the motions (k,) of the mechanical freedoms
    that balance them."""

    traction: Array
    trial: Array
    motion: Array


def motions(problem: ContactProblem) -> Indices:
    """Numbers of the freedoms that are motions, (k,)."""
    return np.array(
        [i for i, freedom in enumerate(problem.prescribed_resultants) if not freedom.electromagnetic], np.int64
    )


def potentials(problem: ContactProblem) -> Indices:
    """Numbers of the freedoms that are potentials, (j,)."""
    return np.array([i for i, freedom in enumerate(problem.prescribed_resultants) if freedom.electromagnetic], np.int64)


def start_motion(problem: ContactProblem, start: ContactState | None) -> Array:
    """Motion (m,) of the previous load step's state, if its freedoms were as many, or none."""
    count = len(problem.prescribed_resultants)
    return start.motion if start is not None and start.motion.shape == (count,) else np.zeros(count)


def strongest(law: ContactLaw, direction: Array, normal: Array) -> Array:
    """Admissible tractions (n, 3) of normal parts (n,) with the largest component along directions (n, 3).

    Of laws with the scaling of maximal dissipation.
    """
    tangential = direction[:, :2] @ law.tangential_scaling()
    size = np.linalg.norm(tangential, axis=1)[:, None]
    steepest = MIN_NORMAL_COSINE * np.abs(normal).max(initial=0.0)
    trial = np.empty_like(direction)
    trial[:, :2] = steepest * np.divide(tangential, size, out=np.zeros_like(tangential), where=size > 0.0)
    trial[:, 2] = normal
    return law.project(trial)


def reserve(law: ContactLaw, traction: Array, gap: Array, direction: Array) -> float:
    """How much more than tractions (n, 3) at normal gaps (n,) others under the same pressures have along directions
    (n, 3), summed over the nodes; less than zero where `strongest` is not."""
    pull = attraction(law, gap)
    pressed = traction.copy()
    pressed[:, 2] -= pull
    return float((direction * (strongest(law, direction, pressed[:, 2]) - pressed)).sum())


def balanced_projection(problem: ContactProblem, traction: Array, gap: Array, r: tuple[float, float]) -> Balanced:
    """Project the augmented tractions of tractions (n, 3) and gap (n, 3), moved freely so that resultants balance.

    gap: with the motion from which the returned one counts; r: normal and tangential step [Pa/m]. Resultants that
    cannot be reached are left unbalanced as little as could be found.
    """
    balance = _Balance.of(problem, traction, gap, r)
    here = balance.at(np.zeros(len(balance.totals)))
    farthest = FARTHEST * balance.distance(here)
    for _ in range(MAX_ITERATIONS):
        if (np.abs(here.unbalance) <= ROUND_OFF * here.size).all():
            break
        there = balance.better(here, farthest)
        if there is None:
            break
        here = there
    return Balanced(here.traction, here.trial, here.motion)


@dataclass(frozen=True, eq=False)
class _Point:
    """Gap, trial and tractions (n, 3) at a motion. unbalance: (k,) of the resultants; size: (k,) what they may be in
    error by round-off."""

    motion: Array
    gap: Array
    trial: Array
    traction: Array
    unbalance: Array
    size: Array


@dataclass(frozen=True, eq=False)
class _Balance:
    """The equations. modes, measures: (k, n, 3) and totals: (k,) of the mechanical freedoms; whole: (k,) resistance of
    the whole zone [N/m] against each."""

    problem: ContactProblem
    traction: Array
    gap: Array
    r: tuple[float, float]
    modes: Array
    measures: Array
    totals: Array
    whole: Array

    @classmethod
    def of(cls, problem: ContactProblem, traction: Array, gap: Array, r: tuple[float, float]) -> "_Balance":
        prescribed_resultants = [problem.prescribed_resultants[i] for i in motions(problem)]
        modes, measures = np.zeros((2, len(prescribed_resultants), *gap.shape))
        for k, freedom in enumerate(prescribed_resultants):
            modes[k], measures[k] = freedom.mode[:, MECHANICAL], freedom.measure[:, MECHANICAL]
        modes[:, ~np.isfinite(gap[:, 2])] = 0.0
        totals = np.array([freedom.total for freedom in prescribed_resultants])
        whole = np.einsum("kni,kni->k", np.abs(measures), np.abs(modes)) * r[0]
        return cls(problem, traction, gap, r, modes, measures, totals, whole)

    def at(self, motion: Array) -> _Point:
        """The tractions at a motion (k,)."""
        moved = self.gap + np.tensordot(motion, self.modes, axes=1)
        trial = augmented_traction(self.problem.contact_law, self.traction, moved, self.r)
        projected = fixed_point_map(self.problem.contact_law, trial, moved, self.r)
        parts = self.measures * projected
        size = np.maximum(np.abs(parts).sum(axis=(1, 2)), np.abs(self.totals))
        return _Point(motion, moved, trial, projected, parts.sum(axis=(1, 2)) - self.totals, size)

    def better(self, here: _Point, farthest: float) -> _Point | None:
        """A point with less unbalance, by damped Newton steps, more and more regularised; None if there is none.

        farthest: how far the motion may take the indenter [m].
        """
        weight = np.divide(1.0, np.sqrt(self.whole), out=np.zeros_like(self.whole), where=self.whole > 0.0)
        scaled = weight[:, None] * self._jacobian(here) * weight
        right = -weight * here.unbalance
        for share in REGULARISATION:
            if share > 0.0 and self._bears_no_more(here, weight):
                return None
            try:
                step = weight * np.linalg.solve(scaled + share * np.eye(len(weight)), right)
            except np.linalg.LinAlgError:
                continue
            reach = self._reach(step)
            if not 0.0 < reach < np.inf or (share == 0.0 and reach > farthest):
                continue
            step *= min(1.0, farthest / reach)
            for fraction in FRACTIONS:
                motion = here.motion + fraction * step
                if self._reach(motion) > farthest:
                    continue
                there = self.at(motion)
                if np.linalg.norm(weight * there.unbalance) < (1.0 - LEAST_FALL * fraction) * np.linalg.norm(right):
                    return there
        return self._settled(here, weight, farthest)

    def _bears_no_more(self, here: _Point, weight: Array) -> bool:
        """Whether no tractions under the same pressures, which the motion leaves as they are, have less unbalance.

        Resultants then lie beyond a plane that the best tractions only just reach.
        """
        if self.modes[:, :, 2].any():
            return False
        direction = -np.tensordot(weight**2 * here.unbalance, self.measures, axes=1)
        more = reserve(self.problem.contact_law, here.traction, here.gap[:, 2], direction)
        return abs(more) <= LEAST_FALL * float(((weight * here.unbalance) ** 2).sum())

    def _settled(self, here: _Point, weight: Array, farthest: float) -> _Point | None:
        """A point where the unbalance no longer drives the indenter the way it goes from here; None if there is none.

        Where nothing touches as yet, or all slips, the resultants do not change with the motion and no Newton step
        helps. Along their direction the unbalance does not fall (exactly so without friction and
        attraction), so that bisection does.
        """
        direction = -(weight**2) * here.unbalance
        reach = self._reach(direction)
        if not 0.0 < reach < np.inf:
            return None
        low, high = 0.0, farthest / reach
        if direction @ self.at(here.motion + high * direction).unbalance < 0.0:
            return None
        there = here
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            there = self.at(here.motion + middle * direction)
            if np.linalg.norm(weight * there.unbalance) < 0.5 * np.linalg.norm(weight * here.unbalance):
                break
            low, high = (middle, high) if direction @ there.unbalance < 0.0 else (low, middle)
        return there if np.linalg.norm(weight * there.unbalance) < np.linalg.norm(weight * here.unbalance) else None

    def _jacobian(self, here: _Point) -> Array:
        """Change of the resultants with the motion, (k, k)."""
        _, by_gap = traction_tangents(self.problem.contact_law, here.trial, here.gap, self.r)
        return np.asarray(np.einsum("kni,nij,lnj->kl", self.measures, by_gap, self.modes))

    def distance(self, here: _Point) -> float:
        """Largest one between body and indenter, or of the motions that the unbalance causes in the whole zone [m]."""
        finite = np.isfinite(here.trial[:, 2])
        apart = float(np.abs(here.trial[finite]).max(initial=0.0)) / self.r[0]
        caused = np.divide(here.unbalance, self.whole, out=np.zeros_like(self.whole), where=self.whole > 0.0)
        return max(apart, self._reach(caused))

    def _reach(self, motion: Array) -> float:
        """Largest displacement of the indenter by a motion (k,) [m]."""
        return float((np.abs(motion) * np.abs(self.modes).max(axis=(1, 2), initial=0.0)).max(initial=0.0))
