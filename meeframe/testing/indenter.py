"""Conformance of an indenter with its abstract class (meeframe.indenters.base)."""

import numpy as np
from hypothesis import strategies as st

from meeframe.fields import Array
from meeframe.indenters.base import Indenter
from meeframe.testing.requirements import check_frozen, each, require
from meeframe.testing.search import search_for

_SAMPLES = 500
_COORDINATES = st.sampled_from([0.0, 1.0, -1.0, 1e-9, -0.5]) | st.floats(-1.0, 1.0, allow_subnormal=False)
"""Coordinates in units of the half width."""


def check_indenter(indenter: Indenter, size: float = 1e-2, seed: int = 0) -> None:
    """Check an indenter at random points and at simple ones found by hypothesis.

    The indenter is frozen; its height is pure and local, >= 0 or inf, never NaN, and zero at its lowest point.

    Parameters
    ----------
    indenter : Indenter
        The indenter.
    size : float, optional
        Half width of the square about the axis that is checked [m].
    seed : int, optional
        Seed of the random points.

    Raises
    ------
    AssertionError
        If a property fails.
    """
    check_frozen(indenter)
    random = np.random.default_rng(seed)
    x, y = size * random.uniform(-1.0, 1.0, (2, _SAMPLES)) * 10.0 ** random.uniform(-4.0, 0.0, _SAMPLES)
    x[0] = y[0] = 0.0
    copies = x.copy(), y.copy()
    height = indenter.height(x, y)
    pure = np.array_equal(x, copies[0]) and np.array_equal(y, copies[1])
    require(pure, "height changes its arguments, so that later evaluations use other points", indenter)
    require(np.shape(height) == x.shape, "height has another shape than the coordinates", np.shape(height))
    worst = int(np.argmin(np.where(np.isnan(height), -np.inf, height)))
    details = f"{height[worst]} at x, y = {x[worst]:g}, {y[worst]:g} m"
    nonnegative = bool(height[worst] >= 0.0)
    require(nonnegative, "height is negative or NaN, though approaches count from the lowest point", details)
    step = size * 1e-6
    nearby = np.concatenate([height, *(indenter.height(x + dx, y + dy) for dx, dy in step * _DIRECTIONS)])
    lowest = float(nearby.min())
    require(lowest <= 1e-3 * size, "no height near zero, though approaches count from the lowest point", lowest)
    sample = random.permutation(_SAMPLES)[: _SAMPLES // 3]
    separate = indenter.height(x[sample], y[sample])
    require(np.array_equal(separate, height[sample]), "height depends on other points, so on the mesh", indenter)
    search_for(
        st.tuples(_COORDINATES, _COORDINATES), lambda point: _check_height(indenter, *size * np.array([point]).T)
    )


def _check_height(indenter: Indenter, x: Array, y: Array) -> None:
    """Check that heights at (n,) points are >= 0 or inf."""
    with np.errstate(all="ignore"):
        height = indenter.height(x, y)
    message = "height is negative or NaN, though approaches count from the lowest point"
    each(height >= 0.0, message, np.column_stack([x, y]), height)


_DIRECTIONS = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
