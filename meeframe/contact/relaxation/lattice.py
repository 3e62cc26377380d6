"""Nodes of a lattice around the boundary between two kinds of nodes: pressed and open, sticking and slipping."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from meeframe.common.memoize import memoize_by_identity
from meeframe.contact._kernels.relaxation import number_band
from meeframe.contact.conduction import Mask
from meeframe.contact.problem import ContactProblem
from meeframe.fields import Array, Indices
from meeframe.system.capabilities import LatticeStencil, Stencil
from meeframe.system.reduced import ReducedSystem

RADIUS: Final = 4
"""Largest distance, in spacings, at which the load of a node counts; 16 spacings have the same effect."""
_ROUND_OFF: Final = 1e-12
"""Largest relative change of a sticking traction under projection that counts as round-off."""


@dataclass(frozen=True, eq=False)
class Start:
    """State of n nodes that is to be relaxed.

    Attributes
    ----------
    problem : ContactProblem
        Contact problem; its laws are the same at all nodes.
    load : Array
        (n, fields), admissible load.
    relative_displacement : Array
        (n, fields), displacement of the indenter relative to the body under that load.
    trial : Array
        (n, 3), augmented tractions [Pa].
    contact_fraction : Array
        (n,), contact fractions.
    closed, open : Array
        (n, channels), transmissivity of closed and of open contact.
    """

    problem: ContactProblem
    load: Array
    relative_displacement: Array
    trial: Array
    contact_fraction: Array
    closed: Array
    open: Array

    @cached_property
    def slips(self) -> Mask:
        """Nodes (n,) whose friction is less than what would prevent sliding, including open nodes."""
        tangential = self.trial[:, :2]
        deviation = np.abs(self.problem.contact_law.project(self.trial)[:, :2] - tangential).max(axis=1)
        return np.asarray(deviation > _ROUND_OFF * np.abs(tangential).max(axis=1))


@dataclass(frozen=True, eq=False)
class Band:
    """Band of m nodes of a lattice on either side of a boundary between two kinds of nodes.

    Attributes
    ----------
    stencil : Stencil
        Responses of nodes to each other.
    number : Indices
        (nx, ny), numbers of the nodes of the band at their places, -1 at other places.
    positions : Indices
        (m, 2), places on the lattice.
    nodes : Indices
        (m,), numbers in the zone.
    """

    stencil: Stencil
    number: Indices
    positions: Indices
    nodes: Indices

    @classmethod
    def around(cls, start: Start, kind: Mask, width: int) -> "Band | None":
        """Return the band of nodes at most `width` spacings from one of the other kind (n,).

        None if there are no such nodes, or no lattice.
        """
        stencil = _stencil(start.problem.system)
        if stencil is None:
            return None
        number = np.empty(stencil.lattice.shape, np.int64)
        if not number_band(kind[stencil.lattice], width, stencil.periodic, number):
            return None
        return cls(stencil, number, np.argwhere(number >= 0), stencil.lattice[number >= 0])


@memoize_by_identity
def _stencil(system: ReducedSystem) -> Stencil | None:
    lattice = system.capability(LatticeStencil)
    return None if lattice is None else lattice.stencil(RADIUS)
