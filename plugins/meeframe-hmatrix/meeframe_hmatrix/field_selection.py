"""Compliance of the contact zone between some of the fields, as a tree of blocks."""

from meeframe.plugin import N_FIELDS, Array
from meeframe_hmatrix.blocks import Block, Dense, LowRank, Split, count_entries, shape, to_dense

CALL_OVERHEAD = 4000
"""Numbers multiplied in the time of the overhead of a product of two small arrays."""


def select_fields(compliance: Block, to_load: Array, to_displacement: Array) -> Block:
    """Return the blocks from l fields of a load to f fields of a displacement, rows and columns counted from 0.

    Blocks on the diagonal are dense.

    Parameters
    ----------
    compliance
        Tree with five rows and columns for each node.
    to_load, to_displacement
        Maps (n, 5, l) and (n, f, 5) of the nodes in this order.
    """
    first = compliance.rows.start

    def nodes_of(indices: slice, start: int) -> slice:
        return slice((indices.start - start) // N_FIELDS, (indices.stop - start) // N_FIELDS)

    def select(block: Block) -> Block:
        row_nodes, column_nodes = nodes_of(block.rows, first), nodes_of(block.columns, 0)
        left, right = to_displacement[row_nodes], to_load[column_nodes]
        fields, loaded = left.shape[1], right.shape[2]
        rows = slice(fields * row_nodes.start, fields * row_nodes.stop)
        columns = slice(loaded * column_nodes.start, loaded * column_nodes.stop)
        if isinstance(block, Split):
            return Split(
                rows, columns, tuple(tuple(select(child) for child in block_row) for block_row in block.children)
            )
        if isinstance(block, LowRank) and row_nodes != column_nodes:
            return LowRank(rows, columns, _multiply_nodes(left, block.left), _multiply_nodes(right.mT, block.right.T).T)
        half = _multiply_nodes(left, to_dense(block))
        return Dense(rows, columns, _multiply_nodes(right.mT, half.T).T)

    return select(compliance)


def _multiply_nodes(children: Array, array: Array) -> Array:
    """Return matrices (n, f, 5) of each node times its five rows of an array (5 n, k)."""
    nodes, fields, _ = children.shape
    width = array.shape[1]  # may be zero
    product: Array = children @ array.reshape(nodes, N_FIELDS, width)
    return product.reshape(nodes * fields, width)


def merge_blocks(block: Block) -> Block:
    """Return an equal block with fewer blocks where that makes products with a vector faster."""
    if isinstance(block, Split):
        children = tuple(tuple(merge_blocks(child) for child in block_row) for block_row in block.children)
        block = Split(block.rows, block.columns, children)
        cost = sum(
            count_entries(child) + CALL_OVERHEAD * (not isinstance(child, Split))
            for block_row in children
            for child in block_row
        )
    elif isinstance(block, LowRank):
        cost = count_entries(block)
    else:
        return block
    m, n = shape(block)
    return Dense(block.rows, block.columns, to_dense(block)) if m * n <= cost else block
