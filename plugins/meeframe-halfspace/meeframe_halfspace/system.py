"""The reduced system of a half space: a convolution on the grid of the contact zone, without a matrix."""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from meeframe.core.fields import MECHANICAL, N_FIELDS, Array
from meeframe.core.formulation import NodalFields, ReducedSystem
from meeframe_halfspace.convolution import Convolution
from meeframe_halfspace.grid import Grid
from meeframe_halfspace.response import entries_to_matrix

SIGNS: Final = np.array([1.0, 1.0, 1.0, -1.0, -1.0])
"""Of the potentials in a displacement of ReducedSystem."""


@final
@dataclass(frozen=True, eq=False)
class HalfSpaceSystem(ReducedSystem):
    """displacement = factors (convolution of (factors, shares, load)), potentials negated.

    shares: (n,) of the density around each node that belongs to the zone, 1 but on the border of a free grid; factors:
    (5,) of the scaling; own: (5, 5) response of a node to its own density [SI], signs as in ReducedSystem.
    """

    grid: Grid
    convolution: Convolution
    shares: Array
    factors: Array
    own: Array

    def apply(self, load: Array) -> Array:
        """compliance(load), (n, 5) for load (n, 5): fast Fourier transforms."""
        scaled = self.grid.gather(load * self.shares[:, None] * self.factors)
        response: Array = self.grid.scatter(self.convolution.apply(scaled)) * (self.factors * SIGNS)
        return response

    def diagonal_blocks(self) -> Array:
        """Response of each node to its own load, (n, 5, 5)."""
        blocks: Array = self.shares[:, None, None] * self.own
        return blocks

    def dense(self) -> Array | None:
        """None: see dense_matrix."""
        return None

    def recover(self, load: Array) -> NodalFields:
        """Fields on the contact zone for a load (n, 5): the half space around it has none on its surface but decays."""
        values = (self.offset + self.apply(load)) * SIGNS
        return NodalFields(self.points, self.cells, self._global(values), self._global(load))

    def _global(self, extended: Array) -> Array:
        turned = extended.copy()
        turned[:, MECHANICAL] = np.einsum("ni,nij->nj", extended[:, MECHANICAL], self.frames)
        return turned


def dense_matrix(system: HalfSpaceSystem) -> Array:
    """The compliance of a system as (n, 5, n, 5), by as many products as a unit load has fields."""
    (nx, ny), n = system.grid.size, system.grid.nodes.size
    # a unit density in the corner of a grid that has room for all offsets
    wide = replace(system.convolution, size=system.convolution.padded)
    kernel = np.empty((N_FIELDS, N_FIELDS, *wide.size))
    for field in range(N_FIELDS):
        load = np.zeros((N_FIELDS, *wide.size))
        load[field, 0, 0] = 1.0
        kernel[:, field] = wide.apply(load)
    kernel *= (np.outer(system.factors * SIGNS, system.factors))[:, :, None, None]
    place = np.empty((n, 2), np.int64)
    place[system.grid.nodes.ravel()] = np.indices((nx, ny)).reshape(2, -1).T
    i, j = (place[:, None] - place).transpose(2, 0, 1)  # negative offsets count from the end
    matrix = np.empty((n, N_FIELDS, n, N_FIELDS))
    for row in range(N_FIELDS):
        for column in range(N_FIELDS):
            matrix[:, row, :, column] = kernel[row, column][i, j] * system.shares
    return matrix


def own_response(values: Array, factors: Array) -> Array:
    """Response (5, 5) [SI], signs as in ReducedSystem, of the entries (25,) in scaled fields."""
    own: Array = entries_to_matrix(values) * np.outer(factors * SIGNS, factors)
    return own
