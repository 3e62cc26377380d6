# mypy: ignore-errors
"""Compiled products of a hierarchical matrix with one vector."""

import numpy as np
from numba import njit

from meeframe_hmatrix.gemm import FULL


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _dots(numbers, x, result):
    """result (m,) += matrix @ x, (n,), for the numbers (m n) of a matrix by rows."""
    n = len(x)
    for i in range(len(result)):
        row, total = numbers[i * n : (i + 1) * n], 0.0
        for j in range(n):
            total += row[j] * x[j]
        result[i] += total


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def add_product(table, numbers, x, result):
    """result (m,) += matrix @ x, (n,), from table and numbers of meeframe_hmatrix.product.Product."""
    place = 0
    for line in range(len(table)):
        row, m, column, n, rank = table[line]
        values, target = x[column : column + n], result[row : row + m]
        if rank == FULL:
            _dots(numbers[place : place + m * n], values, target)
            place += m * n
            continue
        inner = np.zeros(rank)
        left, right = place, place + rank * m
        place = right + rank * n
        _dots(numbers[right:place], values, inner)
        for k in range(rank):
            part = numbers[left + k * m : left + (k + 1) * m]
            for i in range(m):
                target[i] += part[i] * inner[k]
