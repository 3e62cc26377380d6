"""A tree of blocks as two arrays, to be kept in files and sent to other processes."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from meeframe.plugin import Array, Indices
from meeframe_hmatrix.blocks import Block, Dense, LowRank, Split, leaves, rank

DIVIDED, FULL = -2, -1
"""In the place of a rank: of divided and of dense blocks."""
COLUMNS: Final = 7


def packed(block: Block) -> tuple[Indices, Array]:
    """Table (b, 7) of all blocks, a divided one before its parts, and the numbers of the undivided ones (k,).

    A row of the table: first row and the one after the last, likewise columns, rank, lines and columns of the parts.
    """
    arrays = [part for leaf in leaves(block) for part in _arrays(leaf)]
    return np.array(list(_rows(block)), np.int64), np.concatenate([array.ravel() for array in arrays])


def unpacked(table: Indices, numbers: Array) -> Block:
    """The tree again; its arrays are parts of `numbers`. Raises ValueError unless they fit the table."""
    if table.ndim != 2 or table.shape[1] != COLUMNS:
        raise ValueError(f"a table of blocks has {COLUMNS} columns, not the shape {table.shape}")
    rows = iter(table.tolist())
    place = 0

    def take(*size: int) -> Array:
        nonlocal place
        place += size[0] * size[1]
        return numbers[place - size[0] * size[1] : place].reshape(size)

    def block() -> Block:
        first, last, left, right, kind, lines, columns = next(rows)
        here, there = slice(first, last), slice(left, right)
        if kind == DIVIDED:
            return Split(here, there, tuple([tuple([block() for _ in range(columns)]) for _ in range(lines)]))
        if kind == FULL:
            return Dense(here, there, take(last - first, right - left))
        return LowRank(here, there, take(last - first, kind), take(kind, right - left))

    try:
        tree = block()
    except StopIteration:
        raise ValueError(f"a table of {len(table)} blocks ends before its tree") from None
    if place != numbers.size or next(rows, None) is not None:
        raise ValueError(f"{numbers.size} numbers and {len(table)} blocks are more than one tree has")
    return tree


def _rows(block: Block) -> Iterator[tuple[int, ...]]:
    bounds = block.rows.start, block.rows.stop, block.columns.start, block.columns.stop
    if isinstance(block, Split):
        yield (*bounds, DIVIDED, len(block.parts), len(block.parts[0]))
        for line in block.parts:
            for part in line:
                yield from _rows(part)
    else:
        yield (*bounds, rank(block) if isinstance(block, LowRank) else FULL, 0, 0)


def _arrays(leaf: Dense | LowRank) -> tuple[Array, ...]:
    return (leaf.array,) if isinstance(leaf, Dense) else (leaf.left, leaf.right)
