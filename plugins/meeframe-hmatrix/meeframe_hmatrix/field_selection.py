"""Compliance of the contact zone between some of the fields, as a tree of blocks."""

from meeframe.plugin import Array
from meeframe_hmatrix.blocks import Block, Dense, LowRank, Split, count_entries, shape, to_dense

CALL_OVERHEAD = 4000
"""Numbers multiplied in the time of the overhead of a product of two small arrays."""


def select_fields(compliance: Block, to_load: Array, to_displacement: Array) -> Block:
    """Return the blocks from l fields of a load to f fields of a displacement, rows and columns counted from 0.

    Blocks on the diagonal are dense.

    Parameters
    ----------
    compliance
        Tree with n_fields rows and columns for each node.
    to_load, to_displacement
        Maps (n, n_fields, l) and (n, f, n_fields) of the nodes in this order.
    """
    first, n_fields = compliance.rows.start, to_load.shape[1]

    def nodes_of(indices: slice, start: int) -> slice:
        return slice((indices.start - start) // n_fields, (indices.stop - start) // n_fields)

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
    """Return matrices (n, f, n_fields) of each node times its rows of an array (n_fields n, k)."""
    nodes, fields, n_fields = children.shape
    width = array.shape[1]  # may be zero
    product: Array = children @ array.reshape(nodes, n_fields, width)
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
