"""Preconditioner of conjugate gradients on the pressure: the approximate inverse compliance on the free nodes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask
from meeframe.contact.problem import ContactProblem
from meeframe.fields import Array, Indices
from meeframe.solvers.cg.normal_modes import NORMAL, NormalModes
from meeframe.system.capabilities import ApproximateInverse

MAX_CHANGED_FRACTION: Final = 0.2
"""Largest fraction by which the free nodes may differ from those to which the preconditioned modes belong."""
NO_NODES: Final = np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class Preconditioner:
    """Approximate pressures on the free nodes alone that cause given gap openings there.

    Attributes
    ----------
    inverse : callable
        Approximate inverse of the normal compliance, (n, 1) from (n, 1).
    free : Indices
        (f,), free nodes.
    mode_pressures : Array
        (k, n), preconditioned modes, along which resultants are removed.
    mode_nodes : Mask
        (n,), nodes to which these belong.
    """

    inverse: Callable[[Array], Array]
    free: Indices
    mode_pressures: Array
    mode_nodes: Mask

    @classmethod
    def of(cls, problem: ContactProblem) -> "Preconditioner | None":
        """Return the preconditioner on no nodes yet; None if the reduced system has no approximate inverse."""
        approximate, n = problem.system.capability(ApproximateInverse), len(problem.gap)
        inverse = None if approximate is None else approximate.approximate_inverse((NORMAL,))
        return None if inverse is None else cls(inverse, NO_NODES, np.zeros((0, n)), np.zeros(n, bool))

    def restrict(self, modes: NormalModes) -> "Preconditioner":
        """Return the preconditioner on the nodes of the modes, with guides that belong approximately to these."""
        free = modes.nodes
        if free is self.free:
            return self
        restricted = replace(self, free=free)
        n_changed = max(len(free), int(self.mode_nodes.sum())) - int(self.mode_nodes[free].sum())
        if len(self.mode_pressures) == len(modes.numbers) and n_changed <= MAX_CHANGED_FRACTION * len(free):
            return restricted
        n = len(self.mode_nodes)
        mode_nodes, mode_pressures = np.zeros(n, bool), np.zeros((len(modes.numbers), n))
        mode_nodes[free] = True
        for mode_pressure, mode in zip(mode_pressures, modes.mode, strict=True):
            mode_pressure[free] = restricted.pressures(mode)
        return replace(restricted, mode_pressures=mode_pressures, mode_nodes=mode_nodes)

    def pressures(self, opening: Array) -> Array:
        """Return pressures (f,) that approximately cause openings (f,)."""
        full: Array = np.zeros((len(self.mode_nodes), 1), np.float32)
        full[self.free, 0] = opening
        pressures: Array = self.inverse(full)[self.free, 0].astype(float)
        return pressures

    def balance(self, opening: Array, modes: NormalModes) -> Array:
        """Return the pressures of `pressures` with their resultants removed; modes are those on the free nodes."""
        return modes.remove_resultants(self.pressures(opening), self.mode_pressures[:, self.free])
