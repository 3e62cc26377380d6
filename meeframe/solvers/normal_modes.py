"""The free motions of the indenter as a frictionless contact sees them: by their normal parts.

Pressures p >= 0 with prescribed resultants measure : p = -total form a convex set. The gap is its gradient up to a free
motion: it is at rest where the motion has been chosen such that
    sum measure_k (gap + sum_l w_l mode_l) = 0
over the nodes that have pressure or overlap. For a force along one axis that is a mean gap of zero (Polonsky and Keer,
Wear 231 (1999) 206).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.core.contact import ContactProblem
from meeframe.core.errors import CaseError
from meeframe.core.fields import Array
from meeframe.core.mesh import Indices
from meeframe.solvers.free_motion import balanced_projection, motions

NORMAL: Final = 2
ROUNDS: Final = 30
"""Of the search for the nodes that overlap when the indenter is at rest."""
SINGULAR: Final = 1e12
"""Condition of the equations of the motions, of which more than one may have units of its own."""
PROPORTIONAL: Final = 1e-9
ROUND_OFF: Final = 1e-10
"""What is left of values that resultants determine, as a fraction."""


@dataclass(frozen=True, eq=False)
class NormalModes:
    """Normal parts of the mechanical freedoms.

    numbers: (k,) among the problem's freedoms; mode, measure: (k, n), zero where there is no indenter above.
    """

    problem: ContactProblem
    numbers: Indices
    mode: Array
    measure: Array

    @classmethod
    def of(cls, problem: ContactProblem) -> "NormalModes":
        """Of a problem.

        Raises CaseError if a resultant does not belong to its motion, that is if the normal part of a measure is not
        that of weights * mode up to a factor: the solution is then no minimum.
        """
        numbers = motions(problem)
        above = np.isfinite(problem.gap)
        mode, measure = np.zeros((2, len(numbers), len(problem.gap)))
        for k, number in enumerate(numbers):
            freedom = problem.freedoms[number]
            mode[k, above], measure[k, above] = freedom.mode[above, NORMAL], freedom.measure[above, NORMAL]
            work = problem.system.weights * mode[k]
            factor = (measure[k] @ work) / ((work @ work) or 1.0)
            if np.abs(measure[k] - factor * work).max(initial=0.0) > PROPORTIONAL * np.abs(measure[k]).max(initial=0.0):
                raise CaseError(
                    f"solver 'projected-cg' cannot find freedom {number} of the indenter: its resultant is not the "
                    "force or moment along its motion; allowed: measures whose normal part is weights * mode up to a "
                    "factor. Use 'newton', 'uzawa-bb', 'uzawa-nesterov', 'uzawa' or 'auto'"
                )
        return cls(problem, numbers, mode, measure)

    def amounts(self, values: Array, free: Indices, along: Array | None = None) -> Array:
        """Amounts (k,) with which values (f,) + amounts @ along have no resultants on the free nodes (f,).

        along: (k, f), the modes if not given. The smallest amounts, in their own units, where the free nodes do not
        determine them.
        """
        measure = self.measure[:, free]
        gram = measure @ (self.mode[:, free] if along is None else along).T
        size = np.sqrt(np.abs(np.diag(gram)))
        size[size == 0.0] = 1.0
        inverse = np.linalg.pinv(gram / size[:, None] / size) / size[:, None] / size
        return np.asarray(-inverse @ (measure @ values))

    def without(self, values: Array, free: Indices, along: Array | None = None) -> Array:
        """Values (f,) on the free nodes (f,) without resultants; along: (k, f), how these are taken out, by the modes
        if not given.

        Where the nodes are so few that the resultants determine all of them, that is zero and not its round-off.
        """
        if self.numbers.size == 0:
            return values
        along = self.mode[:, free] if along is None else along
        rest = values + self.amounts(values, free, along) @ along
        return rest if np.linalg.norm(rest) > ROUND_OFF * np.linalg.norm(values) else np.zeros_like(rest)

    def rested(self, pressure: Array, gap: Array, motion: Array) -> tuple[Array, Array]:
        """Gap (n,) and motion (m,) with the indenter at rest under a pressure (n,), from a gap (n,) at a motion."""
        if self.numbers.size == 0:
            return gap, motion
        pressed = pressure > 0.0
        free = pressed if pressed.any() else gap < 0.0
        for _ in range(ROUNDS):
            nodes = np.flatnonzero(free)
            amounts = self.amounts(gap[nodes], nodes)
            moved = gap + amounts @ self.mode
            following = pressed | (moved < 0.0)
            if np.array_equal(following, free):
                break
            free = following
        motion = motion.copy()
        motion[self.numbers] += amounts
        return moved, motion

    def balanced(self, pressure: Array, free: Indices) -> Array:
        """The nearest compression (f,) with the prescribed resultants to pressures (f,) on the free nodes (f,)."""
        if self.numbers.size == 0:
            return np.maximum(pressure, 0.0)
        found = self._balanced(pressure, free)
        return self._searched(pressure, free) if found is None else found

    def _balanced(self, pressure: Array, free: Indices) -> Array | None:
        """By Newton's method on the motions, piecewise linear and so exact; None if that leads nowhere."""
        mode, measure = self.mode[:, free], self.measure[:, free]
        totals = np.array([self.problem.freedoms[number].total for number in self.numbers])
        moved, pressed = pressure, pressure > 0.0
        for _ in range(ROUNDS):
            on = np.flatnonzero(pressed)
            gram = measure[:, on] @ mode[:, on].T
            if not on.size or np.linalg.cond(gram) > SINGULAR:
                return None
            moved = pressure - np.linalg.solve(gram, measure[:, on] @ pressure[on] + totals) @ mode
            following = moved > 0.0
            if np.array_equal(following, pressed):
                return np.maximum(moved, 0.0)
            pressed = following
        return None

    def _searched(self, pressure: Array, free: Indices) -> Array:
        """By the damped method for whatever law and modes."""
        traction, apart = np.zeros((2, self.mode.shape[1], 3))
        apart[:, NORMAL] = np.inf
        apart[free, NORMAL] = 0.0
        traction[free, NORMAL] = -pressure
        found = balanced_projection(self.problem, traction, apart, (1.0, 1.0))
        return np.asarray(-found.traction[free, NORMAL])
