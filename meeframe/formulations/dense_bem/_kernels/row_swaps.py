"""Row exchanges of pivoting."""

from numba import njit


@njit(cache=True, nogil=True)
def swap_rows(target, swaps):
    """Exchange row i of target (m, n) with row swaps[i], counted from 1, for all i in turn.

    The columns are processed one after the other, as they lie in memory in Fortran order, by one thread: the threads of
    dlaswp (LAPACK) wait for each other at every call, which is slow on a busy machine.
    """
    for column in range(target.shape[1]):
        for row in range(len(swaps)):
            other = swaps[row] - 1
            value = target[row, column]
            target[row, column] = target[other, column]
            target[other, column] = value
