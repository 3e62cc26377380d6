"""A reduced system held as one matrix: what dense boundary elements and finite elements hand over."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from meeframe.core.fields import Array
from meeframe.core.formulation import NodalFields, ReducedSystem


@final
@dataclass(frozen=True, eq=False)
class DenseSystem(ReducedSystem):
    """displacement = offset + matrix : load.

    matrix: (n, 5, n, 5), response (node, field) to the load (node, field), signs as in ReducedSystem;
    recovery: gives the fields on the whole boundary for a load (n, 5).
    """

    matrix: Array
    recovery: Callable[[Array], NodalFields]

    def apply(self, load: Array) -> Array:
        """compliance(load), (n, 5) for load (n, 5): one matrix-vector product."""
        size = self.offset.size
        response: Array = self.matrix.reshape(size, size) @ np.ravel(load)
        return response.reshape(load.shape)

    def diagonal_blocks(self) -> Array:
        """Response of each node to its own load, (n, 5, 5)."""
        nodes = np.arange(len(self.offset))
        return self.matrix[nodes, :, nodes, :]

    def dense(self) -> Array | None:
        """The compliance, (n, 5, n, 5)."""
        return self.matrix

    def recover(self, load: Array) -> NodalFields:
        """Fields on the whole boundary for a load (n, 5) on the contact zone."""
        return self.recovery(load)
