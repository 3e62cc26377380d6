"""Conformance of an indenter with its contract (meeframe.indenters.base)."""

import numpy as np
from hypothesis import strategies as st

from meeframe.fields import Array
from meeframe.indenters.base import Indenter
from meeframe.testing.requirements import check_frozen, each, require
from meeframe.testing.search import search_for

_SAMPLES = 500
_PLACES = st.sampled_from([0.0, 1.0, -1.0, 1e-9, -0.5]) | st.floats(-1.0, 1.0, allow_subnormal=False)
"""Coordinates in units of the half width."""


def check_indenter(indenter: Indenter, size: float = 1e-2, seed: int = 0) -> None:
    """Check that an indenter is frozen and its height pure and local, >= 0 or inf, never NaN, and zero at its lowest
    point.

    size: half width of the square about the axis that is looked at [m]. Raises AssertionError.
    """
    check_frozen(indenter)
    random = np.random.default_rng(seed)
    x, y = size * random.uniform(-1.0, 1.0, (2, _SAMPLES)) * 10.0 ** random.uniform(-4.0, 0.0, _SAMPLES)
    x[0] = y[0] = 0.0
    kept = x.copy(), y.copy()
    height = indenter.height(x, y)
    pure = np.array_equal(x, kept[0]) and np.array_equal(y, kept[1])
    require(pure, "height changes its arguments, so that whoever asks next asks elsewhere", indenter)
    require(np.shape(height) == x.shape, "height has another shape than the coordinates", np.shape(height))
    worst = int(np.argmin(np.where(np.isnan(height), -np.inf, height)))
    where = f"{height[worst]} at x, y = {x[worst]:g}, {y[worst]:g} m"
    least = bool(height[worst] >= 0.0)
    require(least, "height is negative or NaN, though approaches count from the lowest point", where)
    step = size * 1e-6
    around = np.concatenate([height, *(indenter.height(x + dx, y + dy) for dx, dy in step * _AROUND)])
    found = float(around.min())
    require(found <= 1e-3 * size, "no height near zero, though approaches count from the lowest point", found)
    some = random.permutation(_SAMPLES)[: _SAMPLES // 3]
    alone = indenter.height(x[some], y[some])
    require(np.array_equal(alone, height[some]), "height depends on other points, so on the mesh", indenter)
    search_for(st.tuples(_PLACES, _PLACES), lambda place: _check_height(indenter, *size * np.array([place]).T))


def _check_height(indenter: Indenter, x: Array, y: Array) -> None:
    """Check that heights at (n,) points are >= 0 or inf."""
    with np.errstate(all="ignore"):
        height = indenter.height(x, y)
    what = "height is negative or NaN, though approaches count from the lowest point"
    each(height >= 0.0, what, np.column_stack([x, y]), height)


_AROUND = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
