"""The compliance of the contact zone between some of the fields alone, as a tree of blocks."""

from meeframe.plugin import N_FIELDS, Array
from meeframe_hmatrix.blocks import Block, Dense, LowRank, Split, shape, stored, to_dense

CALL = 4000
"""Numbers that are multiplied in the time that a product of two small arrays takes besides."""


def in_fields(compliance: Block, to_load: Array, to_displacement: Array) -> Block:
    """Blocks from l fields of a load to f fields of a displacement, rows and columns counted from 0.

    compliance: five rows and columns a node; to_load: (n, 5, l), to_displacement: (n, f, 5) of the nodes in that order.
    Blocks on the diagonal are dense.
    """
    first = compliance.rows.start

    def node(part: slice, start: int) -> slice:
        return slice((part.start - start) // N_FIELDS, (part.stop - start) // N_FIELDS)

    def chosen(block: Block) -> Block:
        here, there = node(block.rows, first), node(block.columns, 0)
        left, right = to_displacement[here], to_load[there]
        fields, loaded = left.shape[1], right.shape[2]
        rows = slice(fields * here.start, fields * here.stop)
        columns = slice(loaded * there.start, loaded * there.stop)
        if isinstance(block, Split):
            return Split(rows, columns, tuple(tuple(chosen(part) for part in line) for line in block.parts))
        if isinstance(block, LowRank) and here != there:
            return LowRank(rows, columns, _from_left(left, block.left), _from_left(right.mT, block.right.T).T)
        half = _from_left(left, to_dense(block))
        return Dense(rows, columns, _from_left(right.mT, half.T).T)

    return chosen(compliance)


def _from_left(parts: Array, array: Array) -> Array:
    """Matrices (n, f, 5) of each node times its five rows of an array (5 n, k)."""
    nodes, fields, _ = parts.shape
    width = array.shape[1]  # may be zero
    product: Array = parts @ array.reshape(nodes, N_FIELDS, width)
    return product.reshape(nodes * fields, width)


def merged(block: Block) -> Block:
    """Return a block with parts merged where this makes products with vectors faster."""
    if isinstance(block, Split):
        parts = tuple(tuple(merged(part) for part in line) for line in block.parts)
        block = Split(block.rows, block.columns, parts)
        cost = sum(stored(part) + CALL * (not isinstance(part, Split)) for line in parts for part in line)
    elif isinstance(block, LowRank):
        cost = stored(block)
    else:
        return block
    m, n = shape(block)
    return Dense(block.rows, block.columns, to_dense(block)) if m * n <= cost else block
