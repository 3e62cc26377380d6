"""Preconditioner of conjugate gradients on the pressure: the approximate inverse compliance on the free nodes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask
from meeframe.contact.problem import ContactProblem
from meeframe.fields import Array, Indices
from meeframe.solvers.cg.normal_modes import NORMAL, NormalModes
from meeframe.system.capabilities import ApproximateInverse, Prolongation

OUTDATED: Final = 0.2
"""Largest fraction by which the free nodes may differ from those to which the preconditioned modes belong."""
NO_NODES: Final = np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class Preconditioner:
    """Approximate pressures on the free nodes alone that cause given gap openings there.

    inverse: approximate inverse of the normal compliance, (n, 1) from (n, 1); free: (f,) the nodes; extension:
    prolongation of openings from there to the zone, if there is one; guides: (k, n) preconditioned modes, along which
    resultants are removed; made: (n,) the nodes to which these belong.
    """

    problem: ContactProblem
    inverse: Callable[[Array], Array]
    free: Indices
    extension: Prolongation | None
    guides: Array
    made: Mask

    @classmethod
    def of(cls, problem: ContactProblem) -> "Preconditioner | None":
        """Return the preconditioner on no nodes yet; None if the reduced system has no approximate inverse."""
        approximate, n = problem.system.capability(ApproximateInverse), len(problem.gap)
        inverse = None if approximate is None else approximate.approximate_inverse((NORMAL,))
        return None if inverse is None else cls(problem, inverse, NO_NODES, None, np.zeros((0, n)), np.zeros(n, bool))

    def on(self, modes: NormalModes) -> "Preconditioner":
        """Return the preconditioner on the nodes of the modes, with guides that belong approximately to these."""
        free = modes.nodes
        if free is self.free:
            return self
        approximate = self.problem.system.capability(ApproximateInverse)
        moved = replace(self, free=free, extension=None if approximate is None else approximate.prolongation(free))
        apart = max(len(free), int(self.made.sum())) - int(self.made[free].sum())
        if len(self.guides) == len(modes.numbers) and apart <= OUTDATED * len(free):
            return moved
        n = len(self.made)
        made, guides = np.zeros(n, bool), np.zeros((len(modes.numbers), n))
        made[free] = True
        for guide, mode in zip(guides, modes.mode, strict=True):
            guide[free] = moved.pressures(mode)
        return replace(moved, guides=guides, made=made)

    def pressures(self, opening: Array) -> Array:
        """Return pressures (f,) that approximately cause openings (f,)."""
        single: Array = opening.astype(np.float32)
        if self.extension is not None:
            return self.extension.restrict(self._inverted(self.extension.prolong(single))).astype(float)
        whole: Array = np.zeros(len(self.made), np.float32)
        whole[self.free] = single
        return self._inverted(whole)[self.free].astype(float)

    def balanced(self, opening: Array, modes: NormalModes) -> Array:
        """Return the pressures of `pressures` with their resultants removed; modes are those on the free nodes."""
        return modes.without(self.pressures(opening), self.guides[:, self.free])

    def _inverted(self, opening: Array) -> Array:
        return self.inverse(opening[:, None])[:, 0]
