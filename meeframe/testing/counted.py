"""A reduced system that counts its products: what iterations cost, whatever the machine does."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import final

from meeframe.fields import Array, Indices
from meeframe.system.reduced import (
    BlockResponse,
    Coarsening,
    Edges,
    IndenterEdge,
    NodalFields,
    Prolongation,
    ReducedSystem,
    Stencil,
    Subsystem,
)


@final
@dataclass(frozen=True, eq=False)
class Counted(ReducedSystem):
    """A reduced system that counts its products; without approximate inverse, extension, stencil, rough responses,
    coarser division and parts if not `helped`.

    products: one entry for each.
    """

    inner: ReducedSystem
    helped: bool
    products: list[None] = field(default_factory=list)

    @classmethod
    def of(cls, inner: ReducedSystem, helped: bool = True) -> "Counted":
        """Of any system."""
        return cls(inner.points, inner.frames, inner.weights, inner.cells, inner.offset, inner, helped)

    def apply(self, load: Array) -> Array:
        """See ReducedSystem."""
        self.products.append(None)
        return self.inner.apply(load)

    def response(self, load: Array, fields: Sequence[int]) -> Array:
        """See ReducedSystem."""
        self.products.append(None)
        return self.inner.response(load, fields)

    def block_response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """See ReducedSystem."""
        self.products.append(None)
        return self.inner.block_response(load, loaded, fields)

    def rough_response(self) -> BlockResponse | None:
        """See ReducedSystem."""
        rough = self.inner.rough_response() if self.helped else None
        if rough is None:
            return None

        def counted(load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
            self.products.append(None)
            return rough(load, loaded, fields)

        return counted

    def diagonal_blocks(self) -> Array:
        """See ReducedSystem."""
        return self.inner.diagonal_blocks()

    def dense(self) -> Array | None:
        """See ReducedSystem."""
        return self.inner.dense()

    def recover(self, load: Array) -> NodalFields:
        """See ReducedSystem."""
        return self.inner.recover(load)

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array] | None:
        """See ReducedSystem."""
        return self.inner.approximate_inverse(fields) if self.helped else None

    def extension(self, nodes: Indices) -> Prolongation | None:
        """See ReducedSystem."""
        return self.inner.extension(nodes) if self.helped else None

    def coarser(self) -> Coarsening | None:
        """See ReducedSystem."""
        return self.inner.coarser() if self.helped else None

    def within(self, nodes: Indices) -> Subsystem | None:
        """See ReducedSystem: products there are counted, too."""
        part = self.inner.within(nodes) if self.helped else None
        if part is None:
            return None
        counted = Counted.of(part.system)
        return replace(part, system=replace(counted, products=self.products))

    def stencil(self, reach: int, fields: Sequence[int]) -> Stencil | None:
        """See ReducedSystem."""
        return self.inner.stencil(reach, fields) if self.helped else None

    def edges(self, pressure: Array, rim: IndenterEdge | None = None) -> Edges | None:
        """See ReducedSystem."""
        return self.inner.edges(pressure, rim)
