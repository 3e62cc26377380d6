"""Search for jumps of a function of nodes; see meeframe.testing.contact."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array

_HALVINGS: Final = 46
"""Of an interval: what is left is hardly wider than round-off."""
_JUMP: Final = 1e-6
"""Of the function, whose values are of order one."""


def steepest(function: Callable[[Array], Array], start: Array, end: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the ends of what is left of intervals (n, ...) that are halved to where a function (n,) changes most, and
    whether it jumps there (n,)."""
    before, after = function(start), function(end)
    for _ in range(_HALVINGS):
        middle = 0.5 * (start + end)
        between = function(middle)
        first = np.abs(between - before) >= np.abs(after - between)
        nearer = first.reshape(-1, *[1] * (start.ndim - 1))
        start, before = np.where(nearer, start, middle), np.where(first, before, between)
        end, after = np.where(nearer, middle, end), np.where(first, between, after)
    return start, end, np.asarray(np.abs(after - before) > _JUMP)
