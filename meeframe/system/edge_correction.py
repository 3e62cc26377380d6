"""A reduced system in which the contact's edge lies between the nodes: nodes there respond more to their own load."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import final

import numpy as np

from meeframe.fields import Array, Indices
from meeframe.system.reduced import BlockResponse, NodalFields, Prolongation, ReducedSystem, Subsystem, rescale_inverse


@final
@dataclass(frozen=True, eq=False)
class EdgeCorrectedSystem(ReducedSystem):
    """displacement = that of the original + own . load, node by node.

    original: with the contact's edge resolved to nodes; own: (n, 5, 5), see Edges.
    """

    original: ReducedSystem
    own: Array

    def apply(self, load: Array) -> Array:
        """compliance(load), (n, 5) for load (n, 5)."""
        return self.original.apply(load) + _each(self.own, load)

    def response(self, load: Array, fields: Sequence[int]) -> Array:
        """compliance(load) in the given fields alone, (n, len(fields))."""
        chosen = list(fields)
        return self.original.response(load, chosen) + _each(self.own[:, chosen], load)

    def block_response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """compliance in k fields alone, (n, k), of loads (n, l) in l fields alone."""
        return self._answered(self.original.block_response, load, loaded, fields)

    def rough_response(self) -> BlockResponse | None:
        """That of the original, and what the nodes themselves respond more."""
        rough = self.original.rough_response()
        return None if rough is None else partial(self._answered, rough)

    def _answered(self, answer: BlockResponse, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """`block_response` by an answer of the original."""
        own = self.own[:, list(fields)][:, :, list(loaded)]
        return answer(load, loaded, fields) + _each(own, load)

    def diagonal_blocks(self) -> Array:
        """Response of each node to its own load, (n, 5, 5)."""
        blocks: Array = self.original.diagonal_blocks() + self.own
        return blocks

    def dense(self) -> Array | None:
        """The compliance, (n, 5, n, 5), if the original holds it as a matrix."""
        matrix = self.original.dense()
        if matrix is None:
            return None
        matrix = matrix.copy()
        nodes = np.arange(len(self.own))
        matrix[nodes, :, nodes, :] += self.own
        return matrix

    def recover(self, load: Array) -> NodalFields:
        """Fields on the whole boundary for a load (n, 5) on the contact zone, those of the original."""
        return self.original.recover(load)

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array] | None:
        """That of the original between factors by which nodes at the edge respond less to displacements."""
        inverse = self.original.approximate_inverse(fields)
        if inverse is None:
            return None
        before, after = (system.diagonal_blocks()[:, fields, fields] for system in (self.original, self))
        return rescale_inverse(inverse, before, after)

    def extension(self, nodes: Indices) -> Prolongation | None:
        """That of the original."""
        return self.original.extension(nodes)

    def within(self, nodes: Indices) -> Subsystem | None:
        """That of the original, whose nodes respond more likewise."""
        part = self.original.within(nodes)
        return None if part is None else replace(part, system=correct_edge(part.system, self.own[part.kept]))


def _each(blocks: Array, load: Array) -> Array:
    """Blocks (n, k, l) times the load (n, l) of their nodes, (n, k)."""
    products: Array = np.einsum("nij,nj->ni", blocks, load)
    return products


def correct_edge(system: ReducedSystem, own: Array) -> EdgeCorrectedSystem:
    """A system with more response (n, 5, 5) of its nodes to their own load."""
    return EdgeCorrectedSystem(system.points, system.frames, system.weights, system.cells, system.offset, system, own)
