"""Motions of an indenter and the conjugate resultants agree with rigid rotations and sums of forces."""

import numpy as np
import pytest

from meeframe.indenters import Placement
from meeframe.indenters.base import MOTIONS, N_MOTIONS, MotionModes, motion_modes, total_resultants
from meeframe.mesh.regular import shared_frames
from meeframe.mesh.zone import local_frames

ANGLE = 1e-7
RANDOM = np.random.default_rng(3)
POINTS = RANDOM.normal(size=(20, 3))
NORMALS = RANDOM.normal(size=(20, 3))
FRAMES = local_frames(NORMALS / np.linalg.norm(NORMALS, axis=1, keepdims=True))
WEIGHTS = RANDOM.uniform(0.5, 1.5, 20)
PLACEMENT = Placement(x=0.3, y=-0.2, axis=(0.3, -0.4, 0.8))
AXES, REFERENCE = PLACEMENT.base, PLACEMENT.reference(POINTS)
MODES = motion_modes(POINTS, FRAMES, AXES, REFERENCE)


def rotated(axis, angle):
    """Return points after a right-handed rotation about an axis through the reference point (Rodrigues)."""
    arm = POINTS - REFERENCE
    along = np.outer(arm @ axis, axis)
    return REFERENCE + along + np.cos(angle) * (arm - along) + np.sin(angle) * np.cross(axis, arm)


def in_global_axes(mode):
    return np.einsum("na,nai->ni", mode[:, :3], FRAMES)


@pytest.mark.parametrize(("number", "axis"), [(3, AXES[0]), (4, AXES[1]), (5, AXES[2])])
def test_tilts_and_twist_are_small_rotations(number, axis):
    np.testing.assert_allclose(in_global_axes(MODES[number]), (rotated(axis, ANGLE) - POINTS) / ANGLE, atol=1e-6)


def test_approach_and_translations():
    for number, direction in enumerate((-AXES[2], AXES[0], AXES[1])):
        np.testing.assert_allclose(in_global_axes(MODES[number]), np.tile(direction, (20, 1)), atol=1e-14)


def test_resultants_are_forces_moments_and_charges():
    load = np.random.default_rng(4).normal(size=(20, 5))
    totals = total_resultants(MODES, WEIGHTS, load)
    forces = WEIGHTS[:, None] * in_global_axes(load)
    force, moment = forces.sum(axis=0), np.cross(POINTS - REFERENCE, forces).sum(axis=0)
    expected = [-AXES[2] @ force, *(AXES[:2] @ force), *(AXES @ moment), *(WEIGHTS @ load[:, 3:])]
    np.testing.assert_allclose(totals, expected, rtol=1e-12)
    assert len(totals) == N_MOTIONS == max(column.stop for column in MOTIONS.values())


def test_resultants_without_load_are_zero():
    np.testing.assert_array_equal(total_resultants(MODES, WEIGHTS, np.zeros((20, 5))), np.zeros(N_MOTIONS))


def test_resultants_of_points_with_one_frame_follow_from_moments():
    load, frames = np.random.default_rng(4).normal(size=(20, 5)), shared_frames(FRAMES[0], 20)
    modes = MotionModes(POINTS, frames, AXES, REFERENCE)
    expected = total_resultants(motion_modes(POINTS, frames.copy(), AXES, REFERENCE), WEIGHTS, load)
    np.testing.assert_allclose(total_resultants(modes, WEIGHTS, load), expected, rtol=1e-12)
    largest = [np.abs(mode).max(axis=0) for mode in modes]
    for extreme, bound in zip(modes.at_extremes(), largest, strict=True):
        assert (np.abs(extreme).max(axis=0) >= (1.0 - 1e-12) * bound).all()


def test_reference_point_is_level_with_the_highest_point():
    assert AXES[2] @ REFERENCE == pytest.approx((POINTS @ AXES[2]).max())
    assert AXES[:2] @ REFERENCE == pytest.approx([0.3, -0.2])
