"""A reduced system that counts its products, a measure of cost that does not depend on the machine."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar, final

from meeframe.fields import Array, Indices
from meeframe.system.capabilities import (
    ApproximateInverse,
    Coarsening,
    EdgeCorrection,
    EdgeResolution,
    FieldwiseApply,
    IndenterEdge,
    LatticeStencil,
    Multigrid,
    Prolongation,
    Restriction,
    Stencil,
    Subsystem,
)
from meeframe.system.reduced import NodalFields, ReducedSystem

C = TypeVar("C")


@final
@dataclass(frozen=True, eq=False)
class OperationCounter(
    ReducedSystem,
    FieldwiseApply,
    ApproximateInverse,
    Multigrid,
    LatticeStencil,
    Restriction,
    EdgeResolution,
):
    """A reduced system that counts its products.

    Attributes
    ----------
    inner
        The system whose products are counted.
    accelerated
        False hides all capabilities of the inner system but `FieldwiseApply` and `EdgeResolution`.
    products
        One entry for each product with the compliance, also of subsystems.
    """

    inner: ReducedSystem
    accelerated: bool
    products: list[None] = field(default_factory=list)

    @classmethod
    def of(cls, inner: ReducedSystem, accelerated: bool = True) -> "OperationCounter":
        """Return a counter of the products of a system."""
        return cls(inner.points, inner.frames, inner.weights, inner.cells, inner.offset, inner, accelerated)

    def capability(self, kind: type[C]) -> C | None:
        """Return the counter itself if the inner system has the capability and it is not hidden."""
        hidden = not self.accelerated and not issubclass(kind, FieldwiseApply | EdgeResolution)
        return None if hidden or self.inner.capability(kind) is None else super().capability(kind)

    def apply(self, load: Array) -> Array:
        """Return the product of the inner system, and count it."""
        self.products.append(None)
        return self.inner.apply(load)

    def diagonal_blocks(self) -> Array:
        """Return the diagonal blocks of the inner system."""
        return self.inner.diagonal_blocks()

    def dense(self) -> Array | None:
        """Return the matrix of the inner system."""
        return self.inner.dense()

    def recover(self, load: Array) -> NodalFields:
        """Return the boundary fields of the inner system."""
        return self.inner.recover(load)

    def apply_fields(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the product of the inner system, and count it."""
        self.products.append(None)
        return self._inner(FieldwiseApply).apply_fields(load, loaded, fields)

    def diagonal(self, fields: Sequence[int]) -> Array:
        """Return the diagonals of the inner system."""
        return self._inner(FieldwiseApply).diagonal(fields)

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array] | None:
        """Return the approximate inverse of the inner system."""
        return self._inner(ApproximateInverse).approximate_inverse(fields)

    def series_inverse(self, fields: Sequence[int], resistances: Array) -> Callable[[Array], Array] | None:
        """Return that of the inner system."""
        return self._inner(ApproximateInverse).series_inverse(fields, resistances)

    def prolongation(self, nodes: Indices) -> Prolongation | None:
        """Return that of the inner system."""
        return self._inner(ApproximateInverse).prolongation(nodes)

    def coarsen(self) -> Coarsening:
        """Return the coarsening of the inner system, whose products are not counted."""
        return self._inner(Multigrid).coarsen()

    def stencil(self, radius: int) -> Stencil | None:
        """Return the stencil of the inner system."""
        return self._inner(LatticeStencil).stencil(radius)

    def restrict(self, nodes: Indices) -> Subsystem | None:
        """Return the subsystem of the inner system, whose products are counted, too."""
        subsystem = self._inner(Restriction).restrict(nodes)
        if subsystem is None:
            return None
        return replace(subsystem, system=replace(OperationCounter.of(subsystem.system), products=self.products))

    def edge_correction(self, pressure: Array, indenter_edge: IndenterEdge | None = None) -> EdgeCorrection:
        """Return the edge correction of the inner system."""
        return self._inner(EdgeResolution).edge_correction(pressure, indenter_edge)

    def _inner(self, kind: type[C]) -> C:
        capability = self.inner.capability(kind)
        assert capability is not None, f"the system has no {kind.__name__}"
        return capability
