# mypy: ignore-errors
"""Sums of products of matrices anywhere in memory, in one call without the global interpreter lock.

A table has one row for each product: first row and number of rows of its target, likewise columns, inner size (FULL
without a right factor), then address, distance of lines and order of the left factor, likewise of the right one. BLAS
is that of SciPy, as called by numba.
"""

from typing import Final

import numpy as np
from numba import carray, njit, types
from numba.extending import intrinsic

from meeframe.plugin import Array

FULL: Final = -1
"""Inner size of an entry without a right factor."""
COLUMNS: Final = 11
OuterProduct = tuple[slice, slice, Array, Array]
"""A product left (m, k) @ right (k, n) in a range of rows and columns."""
BY_ROWS, BY_COLUMNS = 0, 1
"""Orders of storage: by rows or by columns."""

_gemm = types.ExternalFunction("numba_xxgemm", types.intc(*(types.char,) * 3, *(types.intp,) * 11))


@intrinsic
def _pointer(context, address, like):
    """Return a pointer to numbers like those of an array, from an address."""

    def code(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return types.CPointer(like.dtype)(address, like), code


@njit(cache=True)
def _address(array):
    """Return the address of the first number, faster than numpy does."""
    return array.ctypes.data


def locate(array, dtype):
    """Return address, distance of lines and order of a matrix. Raises ValueError for another type or gaps in lines."""
    (rows, columns), (row_stride, column_stride), size = array.shape, array.strides, array.itemsize
    if array.dtype == dtype:
        address = _address(array)
        if (columns <= 1 or column_stride == size) and (rows <= 1 or row_stride >= columns * size):
            return address, max(1, columns, row_stride // size), BY_ROWS
        if (rows <= 1 or row_stride == size) and (columns <= 1 or column_stride >= rows * size):
            return address, max(1, rows, column_stride // size), BY_COLUMNS
    raise ValueError(f"a matrix of {array.dtype} with strides {array.strides}; allowed: {dtype}, without gaps in lines")


def table_of(products, first_row, first_column, dtype):
    """Return the table of products (range of rows, range of columns, left (m, k), right (k, n)). Raises as `locate`."""
    entries = [
        (
            rows.start - first_row,
            len(left),
            columns.start - first_column,
            right.shape[1],
            len(right),
            *locate(left, dtype),
            *locate(right, dtype),
        )
        for rows, columns, left, right in products
    ]
    return np.array(entries, np.int64).reshape(-1, COLUMNS)


@njit(cache=True, nogil=True)
def _multiply(kind, m, n, k, factor, left, right, scale, target):
    """Set target (m, n) to scale * target + factor * left (m, k) @ right (k, n), given by address, lines and order.

    factor and scale are addresses of numbers; target is ordered by rows, that is, transposed for BLAS. Returns nonzero
    if BLAS could not be called.
    """
    transpositions = ord("t") if right[2] else ord("n"), ord("t") if left[2] else ord("n")
    return _gemm(kind, *transpositions, n, m, k, factor, right[0], right[1], left[0], left[1], scale, *target)


@njit(cache=True, nogil=True)
def _skip_rows(matrix, rows, size):
    """Return the same matrix from a later row on."""
    address, distance, order = matrix
    return address + rows * size * (1 if order else distance), distance, order


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _add_to_vector(m, n, matrix, x, result):
    """Add matrix (m, n) @ x (n,) to result (m,).

    BLAS is not used because it reads several lines at once, which does not pay for numbers that are read once.
    """
    address, distance, order = matrix
    numbers = carray(_pointer(address, result), (distance * (n if order else m),))
    if order:
        for j in range(n):
            column, factor = numbers[j * distance : j * distance + m], x[j]
            for i in range(m):
                result[i] += column[i] * factor
    else:
        for i in range(m):
            row, total = numbers[i * distance : i * distance + n], result[i]
            for j in range(n):
                total += row[j] * x[j]
            result[i] = total


@njit(cache=True, nogil=True)
def add_products(table, transpose, x, result, origin):
    """Add matrix @ x, or its transpose @ x, to result (m, w), for a matrix given by its blocks.

    Returns True if BLAS did it. x: address, distance of lines, order, first row in terms of the table; origin: the
    first row of the result.
    """
    size, width = result.itemsize, result.shape[1]
    kind = ord("s") if size == 4 else ord("d")
    numbers = np.array([0.0, 1.0]).astype(result.dtype)
    zero = numbers.ctypes.data
    one = zero + size
    rank = max(1, table[:, 4].max()) if len(table) else 1
    inner = np.empty((rank, width), result.dtype)
    middle = inner.ctypes.data, width
    base, failed = result.ctypes.data, 0
    for line in range(len(table)):
        r, m, c, n, k = table[line, :5]
        left = table[line, 5], table[line, 6], table[line, 7]
        right = table[line, 8], table[line, 9], table[line, 10]
        if transpose:
            r, m, c, n = c, n, r, m
            left, right = (right[0], right[1], 1 - right[2]), (left[0], left[1], 1 - left[2])
            if k == FULL:
                left = right
        if width == 1 and x[1] == 1:
            vector = carray(_pointer(x[0] + (c - x[3]) * size, result), (n,))
            total = result[r - origin : r - origin + m, 0]
            if k == FULL:
                _add_to_vector(m, n, left, vector, total)
            else:
                inner[:k] = 0.0
                _add_to_vector(k, n, right, vector, inner[:k, 0])
                _add_to_vector(m, k, left, inner[:k, 0], total)
            continue
        target = base + (r - origin) * width * size, width
        operand = _skip_rows((x[0], x[1], x[2]), c - x[3], size)
        if k == FULL:
            failed |= _multiply(kind, m, width, n, one, left, operand, one, target)
        elif k > 0 and n > 0:
            failed |= _multiply(kind, k, width, n, one, right, operand, zero, middle)
            failed |= _multiply(kind, m, width, k, one, left, (middle[0], width, 0), one, target)
    return failed == 0 and numbers[1] == 1.0 and inner.size >= 0  # arrays live until here


@njit(cache=True, nogil=True)
def subtract_products(table, target):
    """Subtract products of two factors from target (m, n), ordered by rows. Returns True if BLAS did it."""
    size, columns, failed = target.itemsize, target.shape[1], 0
    kind = ord("s") if size == 4 else ord("d")
    numbers = np.array([-1.0, 1.0]).astype(target.dtype)
    minus = numbers.ctypes.data
    for line in range(len(table)):
        r, m, c, n, k = table[line, :5]
        left = table[line, 5], table[line, 6], table[line, 7]
        right = table[line, 8], table[line, 9], table[line, 10]
        matrix = target.ctypes.data + (r * columns + c) * size, columns
        if k > 0:
            failed |= _multiply(kind, m, n, k, minus, left, right, minus + size, matrix)
    return failed == 0 and numbers[1] == 1.0  # arrays live until here
