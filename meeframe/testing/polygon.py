"""Closed forms of layer potentials of flat polygons."""

from itertools import pairwise

import numpy as np

from meeframe.fields import Array


def solid_angle(corners: Array, source: Array) -> float:
    """Return the solid angle of a flat polygon with corners (n, 3), convex, seen from source (3,): int (x - x').nu /
    r^3 dS.

    Positive where the source is behind the face whose corners run counter-clockwise. Source: van Oosterom and Strackee,
    IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    first, *rest = np.asarray(corners, float) - source
    total = 0.0
    for second, third in pairwise(rest):
        a, b, c = (np.linalg.norm(v) for v in (first, second, third))
        volume = first @ np.cross(second, third)
        total += 2.0 * np.arctan2(volume, a * b * c + first @ second * c + first @ third * b + second @ third * a)
    return float(total)


def single_layer(corners: Array, source: Array) -> float:
    """Return int 1/r dS over a flat, convex polygon with corners (n, 3), seen from source (3,) anywhere, corners
    included.

    Source: Wilton et al., IEEE Trans. Antennas Propag. 32 (1984) 276.
    """
    corners = np.asarray(corners, float) - source
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    total = 0.0
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = np.linalg.norm(end - start)
        away = start @ np.cross((end - start) / length, normal)
        if abs(away) > 1e-14 * length:
            reach = np.linalg.norm(start) + np.linalg.norm(end)
            total += away * np.log((reach + length) / (reach - length))
    height = corners[0] @ normal
    if abs(height) > 1e-14 * np.abs(corners).max():
        total -= abs(height) * abs(solid_angle(corners, np.zeros(3)))
    return float(total)
