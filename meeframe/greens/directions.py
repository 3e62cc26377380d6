"""Sets of directions on the unit sphere."""

import numpy as np

from meeframe.fields import Array


def spread_directions(count: int) -> Array:
    """Return unit vectors spread evenly over the sphere along a golden spiral, (count, 3)."""
    number = np.arange(count) + 0.5
    height, azimuth = 1.0 - 2.0 * number / count, np.pi * (3.0 - np.sqrt(5.0)) * number
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height], axis=1)
