"""Conversion of a tree of blocks to two arrays for files and other processes."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from meeframe.plugin import Array, Indices
from meeframe_hmatrix.blocks import Block, Dense, LowRank, Split, leaves, rank

DIVIDED, FULL = -2, -1
"""Values in place of a rank for divided and for dense blocks."""
COLUMNS: Final = 7


def pack(block: Block) -> tuple[Indices, Array]:
    """Return a table (b, 7) of all blocks, divided ones before their children, and the numbers (k,) of undivided ones.

    A row of the table has the first row and the one after the last, likewise columns, then the rank and the numbers of
    rows and columns of children.
    """
    arrays = [child for leaf in leaves(block) for child in _arrays(leaf)]
    return np.array(list(_table_rows(block)), np.int64), np.concatenate([array.ravel() for array in arrays])


def unpack(table: Indices, numbers: Array) -> Block:
    """Return the tree, whose arrays are views of `numbers`. Raises ValueError unless they match the table."""
    if table.ndim != 2 or table.shape[1] != COLUMNS:
        raise ValueError(f"a table of blocks has {COLUMNS} columns, not the shape {table.shape}")
    rows = iter(table.tolist())
    position = 0

    def take(*size: int) -> Array:
        nonlocal position
        position += size[0] * size[1]
        return numbers[position - size[0] * size[1] : position].reshape(size)

    def block() -> Block:
        first, last, first_column, last_column, kind, n_child_rows, n_child_columns = next(rows)
        row_range, column_range = slice(first, last), slice(first_column, last_column)
        if kind == DIVIDED:
            return Split(
                row_range,
                column_range,
                tuple([tuple([block() for _ in range(n_child_columns)]) for _ in range(n_child_rows)]),
            )
        if kind == FULL:
            return Dense(row_range, column_range, take(last - first, last_column - first_column))
        return LowRank(row_range, column_range, take(last - first, kind), take(kind, last_column - first_column))

    try:
        tree = block()
    except StopIteration:
        raise ValueError(f"a table of {len(table)} blocks is incomplete") from None
    if position != numbers.size or next(rows, None) is not None:
        raise ValueError(f"{numbers.size} numbers and {len(table)} blocks do not form one tree")
    return tree


def _table_rows(block: Block) -> Iterator[tuple[int, ...]]:
    bounds = block.rows.start, block.rows.stop, block.columns.start, block.columns.stop
    if isinstance(block, Split):
        yield (*bounds, DIVIDED, len(block.children), len(block.children[0]))
        for block_row in block.children:
            for child in block_row:
                yield from _table_rows(child)
    else:
        yield (*bounds, rank(block) if isinstance(block, LowRank) else FULL, 0, 0)


def _arrays(leaf: Dense | LowRank) -> tuple[Array, ...]:
    return (leaf.array,) if isinstance(leaf, Dense) else (leaf.left, leaf.right)
