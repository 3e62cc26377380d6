"""Closed forms of layer potentials of flat polygons."""

from itertools import pairwise

import numpy as np

from meeframe.fields import Array


def solid_angle(corners: Array, source: Array) -> float:
    """Return the solid angle int (x - x').nu / r^3 dS of a flat, convex polygon.

    Parameters
    ----------
    corners
        Corners (n, 3).
    source
        Point (3,) of view; the angle is positive behind the face whose corners run counter-clockwise.

    References
    ----------
    van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    first, *others = np.asarray(corners, float) - source
    total = 0.0
    for second, third in pairwise(others):
        a, b, c = (np.linalg.norm(v) for v in (first, second, third))
        volume = first @ np.cross(second, third)
        total += 2.0 * np.arctan2(volume, a * b * c + first @ second * c + first @ third * b + second @ third * a)
    return float(total)


def single_layer(corners: Array, source: Array) -> float:
    """Return int 1/r dS over a flat, convex polygon.

    Parameters
    ----------
    corners
        Corners (n, 3).
    source
        Point (3,) anywhere, corners included.

    References
    ----------
    Wilton et al., IEEE Trans. Antennas Propag. 32 (1984) 276.
    """
    corners = np.asarray(corners, float) - source
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    total = 0.0
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = np.linalg.norm(end - start)
        distance = start @ np.cross((end - start) / length, normal)
        if abs(distance) > 1e-14 * length:
            sum_of_radii = np.linalg.norm(start) + np.linalg.norm(end)
            total += distance * np.log((sum_of_radii + length) / (sum_of_radii - length))
    height = corners[0] @ normal
    if abs(height) > 1e-14 * np.abs(corners).max():
        total -= abs(height) * abs(solid_angle(corners, np.zeros(3)))
    return float(total)
