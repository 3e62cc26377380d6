# mypy: ignore-errors
"""Sums of products of matrices that lie anywhere in memory, in one call that does not hold the interpreter's lock.

A table has one row for each product: first row and number of rows of its place, likewise columns, inner size (FULL
where there is no right factor), then address, distance of lines and order of the left factor, likewise of the right
one. BLAS is SciPy's, as numba calls it.
"""

from typing import Final

import numpy as np
from numba import carray, njit, types
from numba.extending import intrinsic

from meeframe.plugin import Array

FULL: Final = -1
"""In the place of an inner size: the left factor alone."""
COLUMNS: Final = 11
Outer = tuple[slice, slice, Array, Array]
"""A product left (m, k) @ right (k, n) in a range of rows and columns."""
BY_ROWS, BY_COLUMNS = 0, 1
"""Orders: neighbours in memory belong to one row, or to one column."""

_gemm = types.ExternalFunction("numba_xxgemm", types.intc(*(types.char,) * 3, *(types.intp,) * 11))


@intrinsic
def _pointer(context, address, like):
    """To numbers as those of an array, from an address."""

    def code(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return types.CPointer(like.dtype)(address, like), code


@njit(cache=True)
def _address(array):
    """Of the first number, faster than numpy tells it."""
    return array.ctypes.data


def located(array, dtype):
    """Address, distance of lines and order of a matrix. Raises ValueError if it is of another type or has gaps."""
    (rows, columns), (down, across), size = array.shape, array.strides, array.itemsize
    if array.dtype == dtype:
        address = _address(array)
        if (columns <= 1 or across == size) and (rows <= 1 or down >= columns * size):
            return address, max(1, columns, down // size), BY_ROWS
        if (rows <= 1 or down == size) and (columns <= 1 or across >= rows * size):
            return address, max(1, rows, across // size), BY_COLUMNS
    raise ValueError(f"a matrix of {array.dtype} and strides {array.strides}; allowed: {dtype}, without gaps in lines")


def table_of(products, first_row, first_column, dtype):
    """Table of products (range of rows, range of columns, left (m, k), right (k, n)); raises as `located`."""
    places = [
        (
            rows.start - first_row,
            len(left),
            columns.start - first_column,
            right.shape[1],
            len(right),
            *located(left, dtype),
            *located(right, dtype),
        )
        for rows, columns, left, right in products
    ]
    return np.array(places, np.int64).reshape(-1, COLUMNS)


@njit(cache=True, nogil=True)
def _multiply(kind, m, n, k, factor, left, right, share, target):
    """target (m, n) = share * target + factor * left (m, k) @ right (k, n); the last three by address, lines, order.

    factor and share are addresses of numbers; target is ordered by rows, that is, transposed for BLAS. Not zero if BLAS
    could not be called.
    """
    turns = ord("t") if right[2] else ord("n"), ord("t") if left[2] else ord("n")
    return _gemm(kind, *turns, n, m, k, factor, right[0], right[1], left[0], left[1], share, *target)


@njit(cache=True, nogil=True)
def _below(place, lines, size):
    """The same matrix from a later row on."""
    address, distance, order = place
    return address + lines * size * (1 if order else distance), distance, order


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _add_to_vector(m, n, place, x, result):
    """result (m,) += matrix (m, n) @ x (n,). What is read once is not worth BLAS, which reads several lines at once."""
    address, distance, order = place
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
    """result (m, w) += matrix @ x, for a matrix given by its parts; transpose: by its transpose. True if BLAS did it.

    x: address, distance of lines, order, first row in terms of the table; origin: the first row of the result.
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
        part = _below((x[0], x[1], x[2]), c - x[3], size)
        if k == FULL:
            failed |= _multiply(kind, m, width, n, one, left, part, one, target)
        elif k > 0 and n > 0:
            failed |= _multiply(kind, k, width, n, one, right, part, zero, middle)
            failed |= _multiply(kind, m, width, k, one, left, (middle[0], width, 0), one, target)
    return failed == 0 and numbers[1] == 1.0 and inner.size >= 0  # arrays live until here


@njit(cache=True, nogil=True)
def subtract_products(table, target):
    """target (m, n), ordered by rows, less products of two factors. True if BLAS did it."""
    size, columns, failed = target.itemsize, target.shape[1], 0
    kind = ord("s") if size == 4 else ord("d")
    numbers = np.array([-1.0, 1.0]).astype(target.dtype)
    minus = numbers.ctypes.data
    for line in range(len(table)):
        r, m, c, n, k = table[line, :5]
        left = table[line, 5], table[line, 6], table[line, 7]
        right = table[line, 8], table[line, 9], table[line, 10]
        place = target.ctypes.data + (r * columns + c) * size, columns
        if k > 0:
            failed |= _multiply(kind, m, n, k, minus, left, right, minus + size, place)
    return failed == 0 and numbers[1] == 1.0  # arrays live until here
