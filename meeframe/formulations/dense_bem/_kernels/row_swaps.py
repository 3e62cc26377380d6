"""Exchanges of rows, as pivoting makes them."""

from numba import njit


@njit(cache=True, nogil=True)
def swap_rows(target, swaps):
    """Exchange rows of target (m, n): row i with row swaps[i], counted from 1, one after the other.

    One column after the other, as it lies in memory in Fortran order. By one thread: those of LAPACK's dlaswp wait for
    each other at every call, which takes long on a machine with other work.
    """
    for column in range(target.shape[1]):
        for row in range(len(swaps)):
            other = swaps[row] - 1
            kept = target[row, column]
            target[row, column] = target[other, column]
            target[other, column] = kept
