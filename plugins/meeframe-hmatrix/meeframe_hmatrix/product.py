"""Fast products of a hierarchical matrix with one vector, with all numbers in the order in which they are read."""

from dataclasses import dataclass

import numpy as np

from meeframe.plugin import Array, Indices
from meeframe_hmatrix.blocks import Block, Dense, count_entries, leaves, rank, shape
from meeframe_hmatrix.gemm import FULL
from meeframe_hmatrix.product_kernels import add_product


@dataclass(frozen=True, eq=False)
class Product:
    """Product matrix @ x for x (n,), in double precision.

    Attributes
    ----------
    rows, columns
        Size of the matrix.
    table
        For each undivided block first row, number of rows, first column, number of columns, and rank or FULL, (b, 5).
    numbers
        Numbers (k,) by rows, those of left factors by columns.
    """

    rows: int
    columns: int
    table: Indices
    numbers: Array

    def __call__(self, x: Array) -> Array:
        """Return matrix @ x, (m,). Raises ValueError if x has another length."""
        if x.shape != (self.columns,):
            raise ValueError(f"a vector of shape {x.shape}; allowed: ({self.columns},)")
        result = np.zeros(self.rows)
        add_product(self.table, self.numbers, np.ascontiguousarray(x, float), result)
        return result


def product_of(block: Block) -> Product:
    """Return the product of a tree of blocks whose columns begin with 0; rows count from its first row."""
    table, numbers, position = [], np.empty(count_entries(block)), 0
    for leaf in leaves(block):
        (m, n), dense = shape(leaf), isinstance(leaf, Dense)
        first = leaf.rows.start - block.rows.start, m, leaf.columns.start, n
        table.append((*first, FULL if dense else rank(leaf)))
        for factor in (leaf.array,) if dense else (leaf.left.T, leaf.right):
            numbers[position : position + factor.size].reshape(factor.shape)[:] = factor
            position += factor.size
    return Product(*shape(block), np.array(table, np.int64), numbers)
