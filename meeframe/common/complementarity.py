"""Linear complementarity problems, solved by Lemke's method."""

from typing import Final

import numpy as np
import scipy  # submodules are loaded on first use
from numpy.typing import NDArray

from meeframe.common.blas import ONE_BLAS_THREAD

Array = NDArray[np.float64]

_MAX_PIVOTS_PER_UNKNOWN: Final = 12
"""Number of pivots after which the method ends without a solution, for each unknown: few problems need one of them."""
_PIVOTS_BETWEEN: Final = 400
"""Number of pivots after which the dictionary is computed anew, without the round-off of so many updates."""
_MIN_PIVOT: Final = 1e-9
"""Least magnitude of a pivot."""
_TIE: Final = 1e-10
"""Difference of the values of the entering variable that counts as none."""
_ROUND_OFF: Final = 1e-11
"""Value of a variable that counts as zero."""
_SEED: Final = 1
"""Seed of the covering vector, whose random entries prevent ties."""


def solve_complementarity(matrix: Array, right: Array) -> Array | None:
    """Return a solution z of w = matrix z + right, w >= 0, z >= 0, w . z = 0, by Lemke's method.

    The path of the method, along which an artificial variable takes the rest of the right-hand side, may turn back as
    often as it likes. It ends at a solution if the matrix is copositive, as with dry friction, and the problem feasible
    in the sense of section 4.4 of Cottle, Pang and Stone, The Linear Complementarity Problem (1992).

    Parameters
    ----------
    matrix : Array
        (n, n).
    right : Array
        (n,), in general position: the method has no rule against cycles through degenerate points.

    Returns
    -------
    Array or None
        (n,); None if the method ends on a ray, at a singular basis, with numbers that are not finite, or after too many
        pivots.
    """
    if (right >= 0.0).all():
        return np.zeros(len(right))
    with ONE_BLAS_THREAD:  # pivots are too small to share
        return _follow(matrix, right)


def _follow(matrix: Array, right: Array) -> Array | None:
    """Return the solution at the end of the path, or None."""
    n = len(right)
    cover = np.random.default_rng(_SEED).uniform(0.5, 1.5, n)
    # row variables = dictionary times column variables + values; w, z and the artificial variable have these numbers
    rows, columns, artificial = np.arange(n), np.arange(n, 2 * n + 1), 2 * n
    dictionary, values = np.asfortranarray(np.column_stack([matrix, cover])), right.copy()
    row, column = int(np.argmin(right / cover)), n
    for pivots in range(1, _MAX_PIVOTS_PER_UNKNOWN * n):
        _exchange(dictionary, values, row, column)
        leaving, rows[row] = rows[row], columns[column]
        columns[column] = leaving
        values[np.abs(values) < _ROUND_OFF] = 0.0
        if leaving == artificial:
            solution = np.zeros(2 * n + 1)
            solution[rows] = np.maximum(values, 0.0)
            return solution[n:artificial]
        if pivots % _PIVOTS_BETWEEN == 0:
            full = np.column_stack([np.eye(n), -matrix, -cover])
            try:
                fresh = np.linalg.solve(full[:, rows], np.column_stack([-full[:, columns], right]))
            except np.linalg.LinAlgError:
                return None
            dictionary, values = np.asfortranarray(fresh[:, :-1]), fresh[:, -1].copy()
        entering = leaving + n if leaving < n else leaving - n
        column = int(np.flatnonzero(columns == entering)[0])
        slope = dictionary[:, column]
        falling = np.flatnonzero(slope < -_MIN_PIVOT)
        if not len(falling) or not np.isfinite(values).all():
            return None
        limits = np.maximum(values[falling], 0.0) / -slope[falling]
        tied = falling[limits <= (1.0 + _TIE) * limits.min() + _TIE]
        # of rows that reach zero together, that of the artificial variable ends the path; else the best pivot
        row = int(tied[np.argmin(np.where(rows[tied] == artificial, -np.inf, slope[tied]))])
    return None


def _exchange(dictionary: Array, values: Array, row: int, column: int) -> None:
    """Exchange the variables of a row and a column, in place."""
    pivot = dictionary[row, column]
    slope = dictionary[:, column].copy()
    equation = -dictionary[row] / pivot
    equation[column] = 1.0 / pivot
    value = -values[row] / pivot
    dictionary[:, column] = 0.0
    scipy.linalg.blas.dger(1.0, slope, equation, a=dictionary, overwrite_a=True)
    dictionary[row] = equation
    values += value * slope
    values[row] = value
