"""Normal parts of the free motions of the indenter, for frictionless contact.

Pressures between zero and a bound, with resultants measure : p = total and measure = weights * mode, form a convex set.
The gap is the gradient on it up to a free motion. The indenter is at rest when the motion satisfies

    sum measure_k (gap + sum_l w_l mode_l) = 0

over the free nodes: those with pressure or overlap, but not those that overlap at the bound. For a force along one axis
that is a mean gap of zero (Polonsky and Keer, Wear 231 (1999) 206).
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.contact.conduction import Mask
from meeframe.contact.free_motion import motions
from meeframe.contact.problem import ContactProblem
from meeframe.fields import NORMAL, Array, Indices

MAX_ROUNDS: Final = 30
"""Largest number of rounds in the search for the free nodes, and for balanced pressures."""
REGULARISATION: Final = 1e-12
"""Fraction of the matrix of all nodes that is added to that of the nodes within their bounds."""
FRACTIONS: Final = tuple(0.5**k for k in range(60))
MAX_OVERSHOOT: Final = 0.1
"""Largest slope beyond the minimum along a step, as a fraction of the slope at its start."""
CONJUGACY_TOLERANCE: Final = 1e-12
REMAINDER_ROUND_OFF, RESULTANT_ROUND_OFF = 1e-10, 1e-14
"""Largest relative remainder where the resultants determine all values, and of resultants, that count as round-off."""


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
    mode : Array
        (k, f), normal parts, zero where there is no indenter above; of all n nodes at first.
    totals : Array
        (k,), resultants of the pressures measured by weights * mode.
    bound : float
        Largest pressure [Pa].
    nodes : Indices
        (f,), nodes to which they are restricted.
    """

    problem: ContactProblem
    numbers: Indices
    mode: Array
    totals: Array
    bound: float
    nodes: Indices = field(default_factory=lambda: np.zeros(0, np.int64))

    @classmethod
    def of(cls, problem: ContactProblem, bound: float) -> "NormalModes":
        """Return the normal modes of a problem with pressures up to a bound [Pa] on all its nodes.

        Raises CaseError if a resultant is not conjugate to its motion, that is if the normal part of a measure is not
        that of weights * mode up to a factor: the solution is then no minimum.
        """
        numbers = motions(problem)
        free = [problem.prescribed_resultants[number] for number in numbers]
        mode = _normal_components(problem, [resultant.mode for resultant in free])
        density = _normal_components(problem, [resultant.density for resultant in free])
        totals = np.zeros(len(numbers))
        for k, number in enumerate(numbers):
            measure, work = (problem.system.weights * values for values in (density[k], mode[k]))
            factor = (measure @ work) / ((work @ work) or 1.0)
            totals[k] = -free[k].total / factor if factor else 0.0
            deviation, size = (np.abs(values).max(initial=0.0) for values in (measure - factor * work, measure))
            if deviation > CONJUGACY_TOLERANCE * size:
                raise CaseError(
                    f"solver 'projected-cg' cannot find free motion {number} of the indenter: its resultant is not the "
                    "force or moment along its motion; allowed: measures whose normal part is weights * mode up to a "
                    "factor. Use 'newton', 'uzawa-bb', 'uzawa-nesterov', 'uzawa' or 'auto'"
                )
        return cls(problem, numbers, mode, totals, bound)

    @cached_property
    def measure(self) -> Array:
        """Measures (k, f) of the resultants of pressures at the nodes to which the modes are restricted."""
        return np.asarray(self.problem.system.weights[self.nodes] * self.mode)

    def restrict(self, free: Indices) -> "NormalModes":
        """Return the modes of all nodes restricted to the free ones (f,)."""
        # a view of one number remains so
        mode = np.take(self.mode, free, axis=1) if self.mode.strides[1] else self.mode[:, : free.size]
        return NormalModes(self.problem, self.numbers, mode, self.totals, self.bound, free)

    def balance_amounts(self, values: Array) -> Array:
        """Return amounts (k,) with which values (f,) + amounts @ modes have no resultants.

        Where the nodes do not determine the amounts, the smallest ones in scaled units are returned.
        """
        return _solve(self.measure @ self.mode.T, -(self.measure @ values))

    def remove_resultants(self, values: Array) -> Array:
        """Return values (f,) with their resultants removed along the modes.

        Where the nodes are so few that the resultants determine all values, the result is zero and not its round-off.
        """
        if self.numbers.size == 0:
            return values
        remainder = values + self.balance_amounts(values) @ self.mode
        is_significant = np.linalg.norm(remainder) > REMAINDER_ROUND_OFF * np.linalg.norm(values)
        return remainder if is_significant else np.zeros_like(remainder)

    def bring_to_rest(
        self, traction: Array, gap: Array, motion: Array, guess: "NormalModes"
    ) -> tuple[Array, "NormalModes"]:
        """Return the motion (m,) with which the indenter is at rest, and the modes on the free nodes.

        traction: (n,) along the normals; gap: (n,) at a motion (m,), which is changed to that at rest; guess: modes on
        an estimate of those nodes, with which the search begins.
        """
        pressed, yielded = traction < 0.0, traction <= -self.bound
        if self.numbers.size == 0:
            return motion, self.restrict(_free(pressed, yielded, gap))
        modes = guess if guess.nodes.size else self.restrict(np.flatnonzero(pressed))
        if not modes.nodes.size:
            modes = self.restrict(np.flatnonzero(gap < 0.0))
        motion = motion.copy()
        for _ in range(MAX_ROUNDS):
            amounts = modes.balance_amounts(gap[modes.nodes])
            motion[self.numbers] += amounts
            for amount, mode in zip(amounts, self.mode, strict=True):
                gap += amount * (mode if mode.strides[0] else mode[:1])  # often the same at all nodes
            free = _free(pressed, yielded, gap)
            if np.array_equal(free, modes.nodes):
                break
            modes = self.restrict(free)
        return motion, modes

    def balance(self, pressure: Array, resultants: Array) -> Array:
        """Return the pressures (f,) within their bounds with resultants (k,) that are nearest to pressures (f,).

        Newton's method minimises a convex function by steps that hardly overshoot. Unbearable resultants are missed.
        """
        total_gram, shifted, clipped = self.measure @ self.mode.T, pressure, np.clip(pressure, 0.0, self.bound)
        if (clipped != pressure).all() and (self.measure @ clipped != resultants).any():  # begin within the bounds
            shifted = pressure - _solve(total_gram, self.measure @ pressure - resultants) @ self.mode
            clipped = np.clip(shifted, 0.0, self.bound)
        side, excess = np.sign(shifted - clipped), self.measure @ clipped - resultants
        for _ in range(MAX_ROUNDS):
            if (np.abs(excess) <= RESULTANT_ROUND_OFF * (np.abs(self.measure) @ clipped + np.abs(resultants))).all():
                break
            gram = np.where(side == 0.0, self.measure, 0.0) @ self.mode.T
            step, last = _solve(gram + REGULARISATION * total_gram, excess), (shifted, side, excess)
            for fraction in FRACTIONS:
                shifted = last[0] - fraction * step @ self.mode
                clipped = np.clip(shifted, 0.0, self.bound)
                excess = self.measure @ clipped - resultants
                if excess @ step >= -MAX_OVERSHOOT * (last[2] @ step):
                    break
            side = np.sign(shifted - clipped)
            if fraction == 1.0 and not side.all() and np.array_equal(side, last[1]):
                break  # the step was exact
        return clipped


def _solve(gram: Array, right: Array) -> Array:
    """Return the solution (k,) of equations of motions, which may have different units; the smallest if singular."""
    size = np.sqrt(np.abs(np.diag(gram)))
    size[size == 0.0] = 1.0
    scaled = gram / size[:, None] / size
    if len(size) == 1:
        return np.asarray(right * np.sign(scaled[0]) / size**2)
    return np.asarray(np.linalg.pinv(scaled) @ (right / size) / size)


def _free(pressed: Mask, yielded: Mask, gap: Array) -> Indices:
    """Return the nodes with pressure or overlap, but not those that overlap at the largest pressure, by masks (n,)."""
    return np.flatnonzero((pressed | (gap < 0.0)) & ~(yielded & (gap <= 0.0)))
