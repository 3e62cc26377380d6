"""Search for jumps of a function of nodes; see meeframe.testing.contact."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array

_HALVINGS: Final = 46
"""Number of bisections; the remaining interval is hardly wider than round-off."""
_MIN_JUMP: Final = 1e-6
"""Smallest jump of a function whose values are of order one."""


def steepest(function: Callable[[Array], Array], start: Array, end: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return where a function changes most in given intervals, and whether it jumps there.

    Parameters
    ----------
    function
        Function of nodes, (n, ...) to (n,).
    start, end
        Ends of the intervals, (n, ...).

    Returns
    -------
    start, end
        Ends of the intervals after repeated bisection, (n, ...).
    jumps
        True where the function jumps, (n,).
    """
    before, after = function(start), function(end)
    for _ in range(_HALVINGS):
        middle = 0.5 * (start + end)
        between = function(middle)
        first = np.abs(between - before) >= np.abs(after - between)
        nearer = first.reshape(-1, *[1] * (start.ndim - 1))
        start, before = np.where(nearer, start, middle), np.where(first, before, between)
        end, after = np.where(nearer, middle, end), np.where(first, between, after)
    return start, end, np.asarray(np.abs(after - before) > _MIN_JUMP)
