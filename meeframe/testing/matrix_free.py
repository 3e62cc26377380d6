"""A reduced system that is applied but not held as a matrix: for tests of what solvers do without one."""

from dataclasses import dataclass
from typing import final

from meeframe.core.dense_system import DenseSystem
from meeframe.core.fields import Array
from meeframe.core.formulation import NodalFields, ReducedSystem


@final
@dataclass(frozen=True, eq=False)
class MatrixFree(ReducedSystem):
    """A dense system that does not show its matrix."""

    hidden: DenseSystem

    @classmethod
    def of(cls, system: DenseSystem) -> "MatrixFree":
        """Of a dense system."""
        return cls(system.points, system.frames, system.weights, system.cells, system.offset, system)

    def apply(self, load: Array) -> Array:
        """See ReducedSystem."""
        return self.hidden.apply(load)

    def diagonal_blocks(self) -> Array:
        """See ReducedSystem."""
        return self.hidden.diagonal_blocks()

    def dense(self) -> None:
        """Nothing."""
        return

    def recover(self, load: Array) -> NodalFields:
        """See ReducedSystem."""
        return self.hidden.recover(load)
