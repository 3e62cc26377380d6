"""Small matrices at many nodes, stored by their entries."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array, Indices

MAX_CONDITION_NUMBER: Final = 1e12
"""Condition number of a node's block beyond which its pseudo-inverse is used."""

SAMPLE_STRIDE: Final = 101
"""Stride of the nodes in the first test of an entry for zero."""


@dataclass(frozen=True, eq=False)
class NodeBlocks:
    """Blocks of c nodes, stored by their nonzero entries.

    entries: (c,) by row and column, without those that are zero at all nodes; shape: (rows, c) of products with
    vectors.
    """

    entries: Mapping[tuple[int, int], Array]
    shape: tuple[int, int]

    @classmethod
    def of(cls, entries: Mapping[tuple[int, int], Array], shape: tuple[int, int]) -> "NodeBlocks":
        """Return the blocks with entries (c,), dropping those that are zero everywhere."""
        # a sample of the nodes is tested first
        return cls(
            {position: entry for position, entry in entries.items() if entry[::SAMPLE_STRIDE].any() or entry.any()},
            shape,
        )

    @property
    def finite(self) -> bool:
        """True if all entries are finite."""
        return all(bool(np.isfinite(entry).all()) for entry in self.entries.values())

    def entry(self, row: int, column: int) -> Array:
        """Return the entry (c,) of a row and a column."""
        values = self.entries.get((row, column))
        return np.zeros(self.shape[1]) if values is None else values

    def dense(self, columns: int) -> Array:
        """Return the blocks as matrices (c, rows, columns)."""
        matrices = np.zeros((*self.shape[::-1], columns))
        for (row, column), entry in self.entries.items():
            matrices[:, row, column] = entry
        return matrices

    def products(self, precision: np.dtype[Any]) -> "NodeProducts":
        """Return the data for products with vectors of a precision."""
        positions = np.array(list(self.entries), np.intp).reshape(-1, 2).T
        entries = np.empty((len(self.entries), self.shape[1]), precision)
        for converted, entry in zip(entries, self.entries.values(), strict=True):
            converted[:] = entry
        return NodeProducts(positions[0], positions[1], entries, self.shape)

    def compose(self, other: "NodeBlocks") -> "NodeBlocks":
        """Return the products (rows, columns) with other blocks, which act first."""
        products = dict[tuple[int, int], Array]()
        for (row, shared), entry in self.entries.items():
            for (inner, column), first in other.entries.items():
                if inner == shared:
                    products[row, column] = products.get((row, column), 0.0) + entry * first
        return NodeBlocks.of(products, self.shape)

    def plus(self, other: "NodeBlocks") -> "NodeBlocks":
        """Return the sums with other blocks."""
        both = {
            position: self.entries[position] + other.entries[position]
            for position in self.entries.keys() & other.entries.keys()
        }
        return NodeBlocks.of({**self.entries, **other.entries, **both}, self.shape)

    def with_entries(self, row: int, column: int, nodes: Indices, values: Array | float) -> "NodeBlocks":
        """Return the blocks with other values (k,) of an entry at k nodes."""
        entry = self.entry(row, column).copy()
        entry[nodes] = values
        others = {position: other for position, other in self.entries.items() if position != (row, column)}
        return NodeBlocks({**others, **NodeBlocks.of({(row, column): entry}, self.shape).entries}, self.shape)

    def swap_rows(self, one: int, other: int, nodes: Indices) -> "NodeBlocks":
        """Return the blocks with two rows exchanged at k nodes (k,)."""
        blocks = self
        for column in {column for row, column in self.entries if row in (one, other)}:
            for row, from_row in ((one, other), (other, one)):
                blocks = blocks.with_entries(row, column, nodes, self.entry(from_row, column)[nodes])
        return blocks

    def rotate(self, cosine: Array, sine: Array) -> "NodeBlocks":
        """Return the blocks in axes of the first two components rotated by angles of these cosines and sines (c,)."""
        entries, none = dict(self.entries), np.zeros(self.shape[1])
        for axis in (0, 1):
            for other in {position[1 - axis] for position in entries if position[axis] < 2}:
                positions = ((0, other), (1, other)) if axis == 0 else ((other, 0), (other, 1))
                first, second = (entries.get(position, none) for position in positions)
                entries[positions[0]] = cosine * first + sine * second
                entries[positions[1]] = cosine * second - sine * first
        return NodeBlocks.of(entries, self.shape)

    def inverses(self, which: NDArray[np.bool_]) -> "NodeBlocks":
        """Return the inverses on some rows and columns (rows, c) of square blocks, zero elsewhere; see `_inverse`."""
        inverses, off_diagonal = dict[tuple[int, int], Array](), np.zeros(self.shape, bool)
        for row, mask in enumerate(which):
            diagonal = self.entry(row, row)
            inverses[row, row] = np.divide(1.0, diagonal, out=np.zeros(len(diagonal)), where=mask & (diagonal != 0.0))
        for i, j in permutations(range(len(which)), 2):
            if (i, j) in self.entries:
                linked = which[i] & which[j] & (self.entries[i, j] != 0.0)
                off_diagonal[i] |= linked
                off_diagonal[j] |= linked
        nodes, rows = np.flatnonzero(off_diagonal.any(axis=0)), np.flatnonzero(off_diagonal.any(axis=1)).tolist()
        blocks = np.empty((len(rows), len(rows), len(nodes)))
        for position in np.ndindex(blocks.shape[:2]):
            i, j = (rows[k] for k in position)
            both = which[i, nodes] & which[j, nodes]
            blocks[position] = np.where(both, self.entry(i, j)[nodes], float(i == j))
        inverse = _inverse(blocks) if nodes.size else blocks
        for position in np.ndindex(blocks.shape[:2]):
            i, j = (rows[k] for k in position)
            entry = inverses.setdefault((i, j), np.zeros(self.shape[1]))
            entry[nodes] = np.where(which[i, nodes] & which[j, nodes], inverse[position], 0.0)
        return NodeBlocks.of(inverses, self.shape)


@dataclass(frozen=True, eq=False)
class NodeProducts:
    """Blocks of c nodes with all data for products.

    rows and columns: (k,) each, of entries (k, c); shape: (rows, c) of products.
    """

    rows: Indices
    columns: Indices
    entries: Array
    shape: tuple[int, int]

    def add(self, vectors: Array, to: Array) -> None:
        """Add the products with vectors (columns, c) to other ones (rows, c)."""
        for row, column, entry in zip(self.rows, self.columns, self.entries, strict=True):
            to[row] += entry * vectors[column]

    def times(self, vectors: Array) -> Array:
        """Return the products (rows, c) with vectors (columns, c)."""
        product = np.zeros(self.shape, vectors.dtype)
        self.add(vectors, product)
        return product


def _inverse(blocks: Array) -> Array:
    """Return the inverses of blocks (s, s, c), pseudo-inverses of singular ones, and NaN for non-finite ones."""
    matrices = blocks.transpose(2, 0, 1)
    with np.errstate(all="ignore"):
        if len(blocks) == 2:  # the two directions in which nodes slip, at many of them
            (a, b), (c, d) = blocks
            inverses = (np.array([[d, -b], [-c, a]]) / (a * d - b * c)).transpose(2, 0, 1)
        else:
            try:
                inverses = np.asarray(np.linalg.inv(matrices), float)
            except np.linalg.LinAlgError:  # one of them is singular, and nothing is known of the others
                inverses = np.full(matrices.shape, np.inf)
        size, bound = (np.abs(values).max(axis=(1, 2), initial=0.0) for values in (matrices, inverses))
        singular = ~(size * bound < MAX_CONDITION_NUMBER) & np.isfinite(size)
    inverses[~np.isfinite(size)] = np.nan
    inverses[singular] = np.linalg.pinv(matrices[singular])
    return np.asarray(inverses.transpose(1, 2, 0))
