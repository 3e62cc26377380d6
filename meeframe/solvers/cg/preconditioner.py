"""What preconditions conjugate gradients on the pressure: the inverse compliance, restricted to the nodes that move."""

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
"""The preconditioned modes belong to a set of nodes from which the present one may differ by this fraction."""
NO_NODES: Final = np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class Preconditioner:
    """Pressures on free nodes alone that roughly cause openings of the gap there.

    inverse: of the normal compliance, roughly, (n, 1) from (n, 1); free: (f,) the nodes; extension: of openings there,
    if there is one; guides: (k, n) preconditioned modes, along which resultants are taken out; made: (n,) the nodes to
    which these belong.
    """

    problem: ContactProblem
    inverse: Callable[[Array], Array]
    free: Indices
    extension: Prolongation | None
    guides: Array
    made: Mask

    @classmethod
    def of(cls, problem: ContactProblem) -> "Preconditioner | None":
        """On no nodes as yet; None if the reduced system knows no inverse."""
        approximate, n = problem.system.capability(ApproximateInverse), len(problem.gap)
        inverse = None if approximate is None else approximate.approximate_inverse((NORMAL,))
        return None if inverse is None else cls(problem, inverse, NO_NODES, None, np.zeros((0, n)), np.zeros(n, bool))

    def on(self, modes: NormalModes) -> "Preconditioner":
        """On the nodes of the modes, with guides that belong to about these."""
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
        """That roughly cause openings (f,), (f,)."""
        single: Array = opening.astype(np.float32)
        if self.extension is not None:
            return self.extension.restrict(self._inverted(self.extension.prolong(single))).astype(float)
        whole: Array = np.zeros(len(self.made), np.float32)
        whole[self.free] = single
        return self._inverted(whole)[self.free].astype(float)

    def balanced(self, opening: Array, modes: NormalModes) -> Array:
        """The same without resultants, modes on the free nodes."""
        return modes.without(self.pressures(opening), self.guides[:, self.free])

    def _inverted(self, opening: Array) -> Array:
        return self.inverse(opening[:, None])[:, 0]
