"""A reduced system with nothing but what it must have: for tests of what solvers do without the rest."""

from dataclasses import dataclass
from typing import final

from meeframe.fields import Array
from meeframe.system.reduced import NodalFields, ReducedSystem


@final
@dataclass(frozen=True, eq=False)
class MatrixFree(ReducedSystem):
    """A system that shows neither its matrix nor an approximate inverse nor a coarser division."""

    hidden: ReducedSystem

    @classmethod
    def of(cls, system: ReducedSystem) -> "MatrixFree":
        """Of any system."""
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
