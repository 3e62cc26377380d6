"""A reduced system without capabilities, for tests of what solvers do without them."""

from dataclasses import dataclass
from typing import final

from meeframe.fields import Array
from meeframe.system.reduced import NodalFields, ReducedSystem


@final
@dataclass(frozen=True, eq=False)
class MatrixFree(ReducedSystem):
    """A system that hides the matrix and all capabilities of another one.

    Attributes
    ----------
    hidden
        The other system.
    """

    hidden: ReducedSystem

    @classmethod
    def of(cls, system: ReducedSystem) -> "MatrixFree":
        """Return a system with the same products and nothing else."""
        return cls(system.points, system.frames, system.weights, system.cells, system.offset, system)

    def apply(self, load: Array) -> Array:
        """Return the product of the hidden system."""
        return self.hidden.apply(load)

    def diagonal_blocks(self) -> Array:
        """Return the diagonal blocks of the hidden system."""
        return self.hidden.diagonal_blocks()

    def dense(self) -> None:
        """Return None."""
        return

    def recover(self, load: Array) -> NodalFields:
        """Return the boundary fields of the hidden system."""
        return self.hidden.recover(load)
