"""Inverses of sparse matrices that may have empty rows."""

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy  # submodules are loaded on first use
from numpy.typing import NDArray


def sparse_inverse(matrix: Any, precision: np.dtype[Any]) -> Callable[[NDArray[Any]], NDArray[Any]]:
    """Return the inverse of a square sparse matrix between its rows and columns that are not zero.

    Parameters
    ----------
    matrix : sparse array
        (n, n); a row and a column of the same number are left out if either is zero.
    precision : dtype
        Precision of the entries, whose round-off counts as zero.

    Returns
    -------
    callable
        Function of right-hand sides (n,) that returns solutions (n,), zero in rows that are left out, and everywhere
        if the other rows are singular.
    """
    largest = np.abs(matrix)
    least = matrix.shape[0] * float(np.finfo(precision).eps) * largest.max()
    rows, columns = (largest.max(axis=axis).toarray().ravel() > least for axis in (1, 0))
    nonzero = np.flatnonzero(rows & columns)
    try:
        factors = scipy.sparse.linalg.splu(scipy.sparse.csc_array(matrix[nonzero][:, nonzero], dtype=float))
    except RuntimeError:
        return np.zeros_like

    def solve(values: NDArray[Any]) -> NDArray[Any]:
        solution = np.zeros_like(values)
        solution[nonzero] = factors.solve(values[nonzero].astype(float))
        return solution

    return solve
