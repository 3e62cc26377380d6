"""Normal parts of the free motions of the indenter, for frictionless contact.

Pressures p >= 0 with prescribed resultants measure : p = -total form a convex set. The gap is its gradient up to a free
motion. The indenter is at rest when the motion satisfies

    sum measure_k (gap + sum_l w_l mode_l) = 0

over the nodes that have pressure or overlap. For a force along one axis that is a mean gap of zero (Polonsky and Keer,
Wear 231 (1999) 206).
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.contact.free_motion import balanced_projection, motions
from meeframe.contact.problem import ContactProblem
from meeframe.fields import NORMAL, Array, Indices

MAX_ROUNDS: Final = 30
"""Largest number of rounds in the search for the nodes that overlap when the indenter is at rest."""
MAX_CONDITION_NUMBER: Final = 1e12
"""Condition number beyond which the equations of the motions, which may have different units, count as singular."""
CONJUGACY_TOLERANCE: Final = 1e-9
RESULTANT_ROUND_OFF: Final = 1e-10
"""Largest relative remainder that counts as round-off where the resultants determine all values."""


def _normal_components(problem: ContactProblem, values: list[Array]) -> Array:
    """Return normal components (k, n) of values (n, fields), zero without an indenter above; a view where possible."""
    above = np.isfinite(problem.gap)
    if len(values) == 1 and above.all():
        return values[0].T[NORMAL : NORMAL + 1]
    components = np.zeros((len(values), len(problem.gap)))
    for component, value in zip(components, values, strict=True):
        np.copyto(component, value[:, NORMAL], where=above)
    return components


@dataclass(frozen=True, eq=False)
class NormalModes:
    """Normal components of the free motions of the indenter.

    Attributes
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    numbers : Indices
        (k,), numbers among the problem's prescribed resultants.
    mode, density : Array
        (k, f), normal parts, zero where there is no indenter above; of all n nodes at first.
    nodes : Indices
        (f,), nodes to which they are restricted.
    """

    problem: ContactProblem
    numbers: Indices
    mode: Array
    density: Array
    nodes: Indices = field(default_factory=lambda: np.zeros(0, np.int64))

    @classmethod
    def of(cls, problem: ContactProblem) -> "NormalModes":
        """Return the normal modes of a problem on all its nodes.

        Raises CaseError if a resultant is not conjugate to its motion, that is if the normal part of a measure is not
        that of weights * mode up to a factor: the solution is then no minimum.
        """
        numbers = motions(problem)
        free = [problem.prescribed_resultants[number] for number in numbers]
        mode = _normal_components(problem, [resultant.mode for resultant in free])
        density = _normal_components(problem, [resultant.density for resultant in free])
        for k, number in enumerate(numbers):
            measure, work = (problem.system.weights * values for values in (density[k], mode[k]))
            factor = (measure @ work) / ((work @ work) or 1.0)
            deviation, size = (np.abs(values).max(initial=0.0) for values in (measure - factor * work, measure))
            if deviation > CONJUGACY_TOLERANCE * size:
                raise CaseError(
                    f"solver 'projected-cg' cannot find free motion {number} of the indenter: its resultant is not the "
                    "force or moment along its motion; allowed: measures whose normal part is weights * mode up to a "
                    "factor. Use 'newton', 'uzawa-bb', 'uzawa-nesterov', 'uzawa' or 'auto'"
                )
        return cls(problem, numbers, mode, density)

    @cached_property
    def measure(self) -> Array:
        """Normal parts (k, f) of the measures at the nodes to which the modes are restricted."""
        return np.asarray(self.problem.system.weights[self.nodes] * self.density)

    def restrict(self, free: Indices) -> "NormalModes":
        """Return the modes of all nodes restricted to the free ones (f,)."""
        both = (self.mode, self.density)  # views of one number remain so
        mode, density = (np.take(v, free, axis=1) if v.strides[1] else v[:, : free.size] for v in both)
        return NormalModes(self.problem, self.numbers, mode, density, free)

    def balance_amounts(self, values: Array) -> Array:
        """Return amounts (k,) with which values (f,) + amounts @ modes have no resultants.

        Where the nodes do not determine the amounts, the smallest ones in scaled units are returned.
        """
        gram = self.measure @ self.mode.T
        size = np.sqrt(np.abs(np.diag(gram)))
        size[size == 0.0] = 1.0
        scaled, right = gram / size[:, None] / size, -(self.measure @ values) / size
        if len(size) == 1:
            return np.asarray(right * np.sign(scaled[0]) / size)
        return np.asarray(np.linalg.pinv(scaled) @ right / size)

    def remove_resultants(self, values: Array) -> Array:
        """Return values (f,) with their resultants removed along the modes.

        Where the nodes are so few that the resultants determine all values, the result is zero and not its round-off.
        """
        if self.numbers.size == 0:
            return values
        remainder = values + self.balance_amounts(values) @ self.mode
        is_significant = np.linalg.norm(remainder) > RESULTANT_ROUND_OFF * np.linalg.norm(values)
        return remainder if is_significant else np.zeros_like(remainder)

    def bring_to_rest(
        self, traction: Array, gap: Array, motion: Array, guess: "NormalModes"
    ) -> tuple[Array, "NormalModes"]:
        """Return the motion (m,) with which the indenter is at rest, and the modes on nodes with pressure or overlap.

        traction: (n,) along the normals; gap: (n,) at a motion (m,), which is changed to that at rest; guess: modes on
        an estimate of those nodes, with which the search begins.
        """
        pressed = traction < 0.0
        if self.numbers.size == 0:
            return motion, self.restrict(np.flatnonzero(pressed | (gap < 0.0)))
        modes = guess if guess.nodes.size else self.restrict(np.flatnonzero(pressed))
        if not modes.nodes.size:
            modes = self.restrict(np.flatnonzero(gap < 0.0))
        motion = motion.copy()
        for _ in range(MAX_ROUNDS):
            amounts = modes.balance_amounts(gap[modes.nodes])
            motion[self.numbers] += amounts
            for amount, mode in zip(amounts, self.mode, strict=True):
                gap += amount * (mode if mode.strides[0] else mode[:1])  # often the same at all nodes
            touching = np.flatnonzero(pressed | (gap < 0.0))
            if np.array_equal(touching, modes.nodes):
                break
            modes = self.restrict(touching)
        return motion, modes

    def balance(self, pressure: Array) -> Array:
        """Return the compression (f,) with the prescribed resultants that is nearest to pressures (f,)."""
        if self.numbers.size == 0:
            return np.maximum(pressure, 0.0)
        balanced = self._balance_by_newton(pressure)
        return self._balance_by_damping(pressure) if balanced is None else balanced

    def _balance_by_newton(self, pressure: Array) -> Array | None:
        """Balance by Newton's method on the motions, piecewise linear and so exact; return None if that fails."""
        totals = np.array([self.problem.prescribed_resultants[number].total for number in self.numbers])
        pressed = pressure > 0.0
        for _ in range(MAX_ROUNDS):
            measure = np.where(pressed, self.measure, 0.0)
            gram = measure @ self.mode.T
            if not pressed.any() or np.linalg.cond(gram) > MAX_CONDITION_NUMBER:
                return None
            shifted = pressure - np.linalg.solve(gram, measure @ pressure + totals) @ self.mode
            next_pressed = shifted > 0.0
            if np.array_equal(next_pressed, pressed):
                return np.maximum(shifted, 0.0)
            pressed = next_pressed
        return None

    def _balance_by_damping(self, pressure: Array) -> Array:
        """Balance by the damped method, for any law and modes."""
        traction, gap = np.zeros((2, len(self.problem.gap), 3))
        gap[:, NORMAL] = np.inf
        gap[self.nodes, NORMAL] = 0.0
        traction[self.nodes, NORMAL] = -pressure
        projection = balanced_projection(self.problem, traction, gap, (1.0, 1.0))
        return np.asarray(-projection.traction[self.nodes, NORMAL])
