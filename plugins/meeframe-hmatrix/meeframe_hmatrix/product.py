"""Fast products of a hierarchical matrix with one vector: low-rank factors and dense blocks stacked by cluster."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from meeframe.core.fields import Array
from meeframe.core.mesh import Indices
from meeframe_hmatrix.blocks import Block, Dense, LowRank, leaves, shape


@dataclass(frozen=True, eq=False)
class Product:
    """matrix @ x for x (n,), in a few hundred dense products.

    rights: range of columns and stacked right factors; lefts: range of rows, stacked left factors and the places of
    their partners in what the right factors give; dense: range of rows, stacked blocks and their columns.
    """

    rows: int
    rights: tuple[tuple[slice, Array], ...]
    lefts: tuple[tuple[slice, Array, Indices], ...]
    dense: tuple[tuple[slice, Array, Indices], ...]

    def __call__(self, x: Array) -> Array:
        """matrix @ x, (m,)."""
        result = np.zeros(self.rows)
        inner = np.concatenate([factor @ x[columns] for columns, factor in self.rights] or [x[:0]])
        for rows, factor, places in self.lefts:
            result[rows] += factor @ inner[places]
        for rows, array, columns in self.dense:
            result[rows] += array @ x[columns]
        return result

    @property
    def stored(self) -> int:
        """Numbers that it keeps."""
        factors = [factor for _, factor in self.rights]
        factors += [array for _, array, _ in (*self.lefts, *self.dense)]
        return sum(factor.size for factor in factors)


def stacked(block: Block) -> Product:
    """The product of a tree of blocks whose columns begin with 0; its rows count from their first."""
    origin = block.rows.start
    by_columns: dict[tuple[int, int], list[tuple[LowRank, int]]] = defaultdict(list)
    low_rank: dict[tuple[int, int], list[tuple[LowRank, Indices]]] = defaultdict(list)
    dense: dict[tuple[int, int], list[Dense]] = defaultdict(list)
    for leaf in leaves(block):
        rows = leaf.rows.start - origin, leaf.rows.stop - origin
        if isinstance(leaf, Dense):
            dense[rows].append(leaf)
        elif leaf.left.shape[1]:
            by_columns[leaf.columns.start, leaf.columns.stop].append((leaf, 0))
    place, rights = 0, []
    for columns, group in by_columns.items():
        rights.append((slice(*columns), np.concatenate([leaf.right for leaf, _ in group])))
        for leaf, _ in group:
            rank = leaf.left.shape[1]
            low_rank[leaf.rows.start - origin, leaf.rows.stop - origin].append((leaf, np.arange(place, place + rank)))
            place += rank
    lefts = [
        (slice(*rows), np.concatenate([leaf.left for leaf, _ in group], axis=1), np.concatenate([p for _, p in group]))
        for rows, group in low_rank.items()
    ]
    near = [
        (
            slice(*rows),
            np.concatenate([leaf.array for leaf in group], axis=1),
            np.concatenate([np.arange(leaf.columns.start, leaf.columns.stop) for leaf in group]),
        )
        for rows, group in dense.items()
    ]
    return Product(shape(block)[0], tuple(rights), tuple(lefts), tuple(near))
