"""Test direction fields of friction axes: closed forms and rejected input."""

from typing import Any

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.mesh.axes import FrictionAxes

POINTS = np.random.default_rng(2).normal(size=(30, 3)) * 1e-3


def test_uniform_direction() -> None:
    for length in (1e-300, 1.0, 1e300):
        directions = FrictionAxes(direction=(3 * length, 0, -4 * length)).directions(POINTS)
        np.testing.assert_allclose(directions, np.tile([0.6, 0.0, -0.8], (30, 1)), rtol=1e-14)


def test_directions_around_an_axis_point_away_from_it() -> None:
    centre, axis = np.array([2e-3, -1e-3, 5e-3]), np.array([1.0, 2.0, -2.0]) / 3
    directions = FrictionAxes(around=tuple(7 * axis), centre=tuple(centre)).directions(POINTS)
    np.testing.assert_allclose(directions @ axis, 0.0, atol=1e-17)
    feet = POINTS - directions
    np.testing.assert_allclose(np.cross(feet - centre, axis), 0.0, atol=1e-17)


def test_directions_around_x3_are_radial() -> None:
    directions = FrictionAxes(around=(0, 0, 1)).directions(POINTS)
    np.testing.assert_allclose(directions, POINTS * [1, 1, 0], atol=1e-19)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_points_on_the_axis_have_no_direction(scale: float) -> None:
    centre = np.array([0.1, 0.2, 0.3]) * scale
    points = centre + scale * np.array([[0.0, 0.0, 0.0], [1e-17, 0.0, 3.0], [1e-3, 0.0, 0.0], [0.0, 1.0, 0.0]])
    directions = FrictionAxes(around=(0, 0, 1), centre=tuple(centre)).directions(points)
    assert not directions[:2].any()
    np.testing.assert_allclose(
        directions[2:], scale * np.array([[1e-3, 0, 0], [0, 1, 0]]), rtol=1e-9, atol=1e-12 * scale
    )


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({}, "neither of direction and around"),
        ({"direction": (1, 0, 0), "around": (0, 0, 1)}, "both of direction and around"),
        ({"direction": (0, 0, 0)}, r"direction = \(0, 0, 0\); allowed: three finite numbers, not all zero"),
        ({"around": (0, np.inf, 1)}, "around = .*three finite numbers"),
        ({"around": (0, 1)}, r"around = \(0, 1\)"),
        ({"around": (0, 0, 1), "centre": (0, np.nan, 1)}, "centre = .*three finite numbers$"),
        ({"direction": (1, 0, 0), "centre": (0, 0, 1)}, "centre = .*requires around"),
        ({"direction": ("x", 0, 0)}, "direction = "),
    ],
)
def test_invalid_fields_are_rejected(keys: dict[str, Any], text: str) -> None:
    with pytest.raises(CaseError, match=text):
        FrictionAxes(**keys)
