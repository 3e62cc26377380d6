"""Loads on a contact zone for the checks of reduced systems, and the comparison of responses."""

from typing import Final

import numpy as np

from meeframe.fields import Array
from meeframe.system.capabilities import diagonal
from meeframe.system.reduced import ReducedSystem

ROUND_OFF: Final = 1e-9
LOADS: Final = 6


def typical_load(system: ReducedSystem) -> Array:
    """Return the magnitudes (fields,) of loads whose displacements do similar work."""
    responses: Array = diagonal(system, range(system.n_fields)).mean(axis=0)
    return 1.0 / np.sqrt(np.abs(responses))


def smooth_loads(system: ReducedSystem) -> Array:
    """Return loads (k, n, 5) that vary slowly over the zone, with similar work of all fields."""
    functions, random = shapes(system), np.random.default_rng(1)
    loads: Array = np.einsum("kfs,sn->knf", random.normal(size=(LOADS, system.n_fields, len(functions))), functions)
    return loads * typical_load(system)


def shapes(system: ReducedSystem) -> Array:
    """Return slowly varying functions (s, n) on the zone."""
    middle = (system.points.min(axis=0) + system.points.max(axis=0)) / 2
    position = (system.points - middle) / np.ptp(system.points, axis=0).max()
    return np.stack([np.ones(len(position)), *position.T, np.cos(3.0 * position[:, 0]) * np.cos(3.0 * position[:, 1])])


def worst(actual: Array, expected: Array) -> float:
    """Return the largest difference of (n, k) relative to the largest expected entry of its field."""
    scale = np.abs(expected).max(axis=0)
    return float((np.abs(actual - expected).max(axis=0) / np.where(scale > 0.0, scale, 1.0)).max())
