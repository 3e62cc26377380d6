# mypy: ignore-errors
"""Compiled products of a hierarchical matrix with one vector."""

import numpy as np
from numba import njit

from meeframe_hmatrix.gemm import FULL


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _dots(numbers, x, result):
    """Add matrix @ x to result (m,), for x (n,) and the numbers (m n) of a matrix by rows."""
    n = len(x)
    for i in range(len(result)):
        row, total = numbers[i * n : (i + 1) * n], 0.0
        for j in range(n):
            total += row[j] * x[j]
        result[i] += total


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def add_product(table, numbers, x, result):
    """Add matrix @ x to result (m,), for x (n,) and table and numbers of meeframe_hmatrix.product.Product."""
    position = 0
    for line in range(len(table)):
        row, m, column, n, rank = table[line]
        values, target = x[column : column + n], result[row : row + m]
        if rank == FULL:
            _dots(numbers[position : position + m * n], values, target)
            position += m * n
            continue
        inner = np.zeros(rank)
        left, right = position, position + rank * m
        position = right + rank * n
        _dots(numbers[right:position], values, inner)
        for k in range(rank):
            factor = numbers[left + k * m : left + (k + 1) * m]
            for i in range(m):
                target[i] += factor[i] * inner[k]
