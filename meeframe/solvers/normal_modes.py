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
from meeframe.solvers.conduction import Mask
from meeframe.solvers.free_motion import balanced_projection, motions

NORMAL: Final = 2
ROUNDS: Final = 30
"""Of the search for the nodes that overlap when the indenter is at rest."""
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

    def amounts(self, values: Array, free: Mask) -> Array:
        """Motions (k,) with which values (n,) + amounts @ mode have no resultants over the free nodes (n,).

        The smallest ones, in their own units, where the free nodes do not determine them.
        """
        measure = np.where(free, self.measure, 0.0)
        gram = measure @ self.mode.T
        size = np.sqrt(np.abs(np.diag(gram)))
        size[size == 0.0] = 1.0
        inverse = np.linalg.pinv(gram / size[:, None] / size) / size[:, None] / size
        return np.asarray(-inverse @ (measure @ np.where(free, values, 0.0)))

    def without(self, values: Array, free: Mask) -> Array:
        """Values (n,) without resultants over the free nodes (n,), zero elsewhere.

        Where the nodes are so few that the resultants determine all of them, that is zero and not its round-off.
        """
        values = np.where(free, values, 0.0)
        if self.numbers.size == 0:
            return values
        rest = np.where(free, values + self.amounts(values, free) @ self.mode, 0.0)
        return rest if np.linalg.norm(rest) > ROUND_OFF * np.linalg.norm(values) else np.zeros_like(rest)

    def rested(self, pressure: Array, gap: Array, motion: Array) -> tuple[Array, Array]:
        """Gap (n,) and motion (m,) with the indenter at rest under a pressure (n,), from a gap (n,) at a motion."""
        if self.numbers.size == 0:
            return gap, motion
        moved = gap
        for _ in range(ROUNDS):
            free = (pressure > 0.0) | (moved < 0.0)
            amounts = self.amounts(gap, free)
            moved = gap + amounts @ self.mode
            if (((pressure > 0.0) | (moved < 0.0)) == free).all():
                break
        motion = motion.copy()
        motion[self.numbers] += amounts
        return moved, motion

    def balanced(self, pressure: Array, free: Mask) -> Array:
        """The nearest compression (n,) with the prescribed resultants, on the free nodes, to pressures (n,) there."""
        if self.numbers.size == 0:
            return np.maximum(pressure, 0.0)
        traction, apart = np.zeros((2, len(pressure), 3))
        traction[:, NORMAL] = -pressure
        apart[~free, NORMAL] = np.inf
        found = balanced_projection(self.problem, traction, apart, (1.0, 1.0))
        return np.asarray(-found.traction[:, NORMAL])
