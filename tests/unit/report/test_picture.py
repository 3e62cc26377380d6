"""The flattened zone does not turn with the frames of its points."""

from dataclasses import replace

import numpy as np

from meeframe.report.picture import Picture


def test_a_direction_field_leaves_the_picture_as_it_is(synthetic) -> None:
    zone = synthetic.zone()
    radius = np.linalg.norm(zone.points, axis=1, keepdims=True)
    away = np.where(radius > 0.0, zone.points / np.where(radius > 0.0, radius, 1.0), [1.0, 0.0, 0.0])
    frames = zone.frames.copy()
    frames[:, 0], frames[:, 1] = away, np.cross(zone.frames[:, 2], away)
    np.testing.assert_allclose(Picture.of(zone).points, zone.points[:, :2] * 1e3)
    np.testing.assert_allclose(Picture.of(replace(zone, frames=frames)).points, zone.points[:, :2] * 1e3)
