"""Lattice nodes around the boundary between two kinds of nodes: pressed and open, sticking and slipping."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.common.memoize import memoize_by_identity
from meeframe.contact.conduction import Mask
from meeframe.fields import Indices
from meeframe.solvers._kernels.edge_relaxation import number_edge
from meeframe.solvers.newton.residual import ResidualState
from meeframe.system.capabilities import LatticeStencil, Stencil
from meeframe.system.reduced import ReducedSystem

STENCIL_REACH: Final = 4
"""Largest distance, in spacings, at which the load of a node counts: as good as 16 of them."""
MAX_MERIT_GROWTH: Final = 4.0
"""Largest factor by which relaxation may raise the merit at first, as the nodes around have not followed yet."""
PROJECTION_ROUND_OFF: Final = 1e-12
"""Largest relative change of a sticking traction under projection that counts as round-off."""


@dataclass(frozen=True, eq=False)
class BoundaryBand:
    """Band of m lattice nodes on either side of a boundary between two kinds of nodes.

    Attributes
    ----------
    stencil : Stencil
        Responses of nodes to each other.
    number : Indices
        (nx, ny), numbers of the nodes on the lattice, -1 elsewhere.
    positions : Indices
        (m, 2), positions on the lattice.
    nodes : Indices
        (m,), numbers in the zone.
    """

    stencil: Stencil
    number: Indices
    positions: Indices
    nodes: Indices

    @classmethod
    def of(cls, point: ResidualState, kind: Mask, width: int) -> "BoundaryBand | None":
        """Return the band of nodes at most `width` spacings from one of the other kind (n,).

        The result is None if there are no such nodes, or no lattice.
        """
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
    return None if lattice is None else lattice.stencil(STENCIL_REACH, fields)


def slips(point: ResidualState) -> Mask:
    """Return the nodes (n,) whose friction is less than what would prevent sliding, open nodes included."""
    trial = point.trial[:, :2]
    deviation = np.abs(point.equation.problem.contact_law.project(point.trial)[:, :2] - trial).max(axis=1)
    return np.asarray(deviation > PROJECTION_ROUND_OFF * np.abs(trial).max(axis=1))
