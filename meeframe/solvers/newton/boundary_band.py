"""Nodes around the boundary between two kinds of them, on a lattice: pressed and open, sticking and slipping."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.common.memoize import memoize_by_identity
from meeframe.contact.conduction import Mask
from meeframe.fields import Indices
from meeframe.solvers._kernels.edge_relaxation import number_edge
from meeframe.solvers.newton.residual import Point
from meeframe.system.capabilities import LatticeStencil, Stencil
from meeframe.system.reduced import ReducedSystem

REACH: Final = 4
"""Places around a node where its load counts: as good as 16 of them."""
ROUGHER: Final = 4.0
"""So much more the laws may be violated by relaxed nodes at first: those beside have not followed yet."""
ROUND_OFF: Final = 1e-12
"""Of a traction: what sticks is projected on itself but for so much."""


@dataclass(frozen=True, eq=False)
class Ring:
    """m nodes beside such a boundary.

    stencil: responses of nodes to each other; number: (nx, ny) of the nodes on the lattice, -1 elsewhere; places:
    (m, 2) on it; nodes: (m,) their numbers in the zone.
    """

    stencil: Stencil
    number: Indices
    places: Indices
    nodes: Indices

    @classmethod
    def of(cls, point: Point, kind: Mask, width: int) -> "Ring | None":
        """Nodes within so many spacings of one of the other kind (n,); None if there are none, or no lattice."""
        stencil = _stencil(point.equation.problem.system, tuple(point.equation.loaded))
        if stencil is None:
            return None
        number = np.empty(stencil.lattice.shape, np.int64)
        if not number_edge(kind[stencil.lattice], width, stencil.periodic, number):
            return None
        return cls(stencil, number, np.argwhere(number >= 0), stencil.lattice[number >= 0])


@memoize_by_identity
def _stencil(system: ReducedSystem, fields: tuple[int, ...]) -> Stencil | None:
    lattice = system.capability(LatticeStencil)
    return None if lattice is None else lattice.stencil(REACH, fields)


def slips(point: Point) -> Mask:
    """Nodes (n,) whose friction is less than what would hold them, open ones among them."""
    trial = point.trial[:, :2]
    off = np.abs(point.equation.problem.contact_law.project(point.trial)[:, :2] - trial).max(axis=1)
    return np.asarray(off > ROUND_OFF * np.abs(trial).max(axis=1))
