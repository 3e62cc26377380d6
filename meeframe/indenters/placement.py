"""Placement of an indenter, and its initial gap to the contact zone."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.indenters.base import Indenter
from meeframe.mesh.regular import extreme_points, shares_frame
from meeframe.mesh.zone import ContactZone, local_frames

Flags = NDArray[np.bool_]

BLOCK: Final = 2**16
"""Number of vertical rays that are traced at once: a block of them fits into the cache."""
MAX_STEPS: Final = 200
N_SAMPLES: Final = 100  # points on a ray that may meet a surface that is not convex
MIN_RISE: Final = 1e-9  # of a unit vector that may meet an indenter
ROUND_OFF: Final = 1e-13  # of a distance, relative to the extent of the contact zone


@checked_arguments
@dataclass(frozen=True)
class Placement:
    """Position of an indenter that just touches the body, with approach zero.

    Attributes
    ----------
    x, y : float
        Position of the lowest point from the origin along the axes e1, e2 of the placement [m]. Along the third axis,
        this point is level with the highest point of the contact zone.
    rotation, tilt_1, tilt_2 : float
        Rotation of the shape in its plane, then tilt_2 about e2, then tilt_1 about e1 [rad]. They are right-handed and
        exact for any angle. Their centre is the lowest point of the upright indenter, so that parts that a tilt brings
        below it overlap the body at approach zero.
    axis : tuple of float
        Direction from which the indenter approaches, pointing away from the body. With the global x3 axis (the
        default), the axes of the placement are the global ones, else those of local_frames(axis).

    Raises
    ------
    CaseError
        If a number is not finite, a tilt is a right angle or more, or the axis is zero.
    """

    x: Annotated[float, Quantity("m", gt=-math.inf, lt=math.inf)] = 0.0
    y: Annotated[float, Quantity("m", gt=-math.inf, lt=math.inf)] = 0.0
    rotation: Annotated[float, Quantity("rad", gt=-math.inf, lt=math.inf)] = 0.0
    tilt_1: Annotated[float, Quantity("rad", gt=-math.pi / 2, lt=math.pi / 2)] = 0.0
    tilt_2: Annotated[float, Quantity("rad", gt=-math.pi / 2, lt=math.pi / 2)] = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        check_quantities(self)
        length = math.hypot(*self.axis) if len(self.axis) == 3 else 0.0
        if not (0 < length < math.inf):
            raise CaseError(
                f"Placement: axis = {self.axis!r}: must be a direction in space, three numbers not all zero"
            )

    @cached_property
    def base(self) -> Array:
        """Axes of the placement, (3, 3), with rows e1, e2, axis; read-only."""
        base: Array = local_frames(np.array([self.axis]) / math.hypot(*self.axis))[0]
        base.setflags(write=False)
        return base

    @property
    def rotation_matrix(self) -> Array:
        """Rotation (3, 3) from coordinates of the shape to those along e1, e2, axis."""
        rotation_matrix: Array = _about(0, self.tilt_1) @ _about(1, self.tilt_2) @ _about(2, self.rotation)
        return rotation_matrix

    def lowest(self, points: Array) -> Array:
        """Return the position of the lowest point when it just touches a contact zone.

        Parameters
        ----------
        points : Array
            Points of the contact zone, (n, 3) [m].

        Returns
        -------
        Array
            Coordinates along the rows of `base`, (3,) [m].
        """
        return np.array([self.x, self.y, np.max(extreme_points(points) @ self.base[2])])

    def reference(self, points: Array) -> Array:
        """Return the point of `lowest` in global axes.

        Parameters
        ----------
        points : Array
            Positions (n, 3) of the contact zone [m].

        Returns
        -------
        Array
            (3,) [m].
        """
        reference: Array = self.lowest(points) @ self.base
        return reference


def initial_gap(
    indenter: Indenter, zone: ContactZone, placement: Placement | None = None, approach: float = 0.0
) -> Array:
    """Return the distance from each point of the contact zone to the indenter along the outward normal.

    Parameters
    ----------
    indenter : Indenter
        Shape of the indenter.
    zone : ContactZone
        The contact zone.
    placement : Placement, optional
        Position of the indenter.
    approach : float
        Displacement of the indenter against its axis [m].

    Returns
    -------
    Array
        Distances, (n,) [m], negative where the bodies overlap, inf where the normal does not meet the indenter. For an
        upright indenter and a flat zone they are height(x, y) - approach.

    Raises
    ------
    CaseError
        If the surface of the indenter is too rough and steep to compute the distance.
    """
    placement = placement or Placement()
    base, rotation_matrix = placement.base, placement.rotation_matrix
    lowest = placement.lowest(zone.points) - np.array([0.0, 0.0, approach])
    # rays along the normals, in coordinates of the shape
    if shares_frame(zone.frames):
        direction = np.broadcast_to(zone.frames[0, 2] @ base.T @ rotation_matrix, zone.points.shape)
        is_vertical, upward = not direction[0, :2].any(), np.broadcast_to(direction[0, 2] > MIN_RISE, len(direction))
    else:
        direction = zone.frames[:, 2] @ base.T @ rotation_matrix
        is_vertical, upward = False, direction[:, 2] > MIN_RISE
    gap = np.full(len(direction), np.inf)
    size = BLOCK if is_vertical else max(len(gap), 1)  # other rays are traced together
    for first in range(0, len(gap), size):
        nodes = np.flatnonzero(upward[first : first + size]) + first
        start = zone.points[nodes] @ base.T @ rotation_matrix - lowest @ rotation_matrix
        gap[nodes], converged = _intersect(indenter, start, direction[nodes])
        if not converged.all():
            failures = zone.points[nodes][~converged]
            raise CaseError(
                f"no distance to the indenter along the normal at {len(failures)} points, the first at {failures[0]}"
                " [m]: its surface is too steep there for the tilt or for the curvature of the contact zone"
            )
    return gap


def _intersect(indenter: Indenter, start: Array, direction: Array) -> tuple[Array, Flags]:
    """Return the signed distance (n,) to the first intersection of rising rays (n, 3), and flags of convergence.

    Newton's method solves level(s) = z - height(x, y) = 0 from the level of the lowest point, where level <= 0. For a
    convex indenter, level is concave along the ray, so that the steps never pass the first intersection, and there is
    none if level stops rising. For other indenters it may rise again; the ray then has not converged. Rays that pass
    outside the surface do not meet it, whatever the shape of its sides.
    """
    if not np.any(direction[:, :2]):  # rays along the axis
        return (indenter.height(start[:, 0], start[:, 1]) - start[:, 2]) / direction[:, 2], np.ones(len(start), bool)
    distance = -start[:, 2] / direction[:, 2]
    scale = np.abs(start).max(initial=0.0) or 1.0
    running, missed, falling = np.ones(len(start), bool), np.zeros(len(start), bool), np.zeros(len(start), bool)
    for _ in range(MAX_STEPS):
        rays = np.flatnonzero(running)
        if rays.size == 0:
            break
        position = start[rays] + distance[rays, None] * direction[rays]
        height = indenter.height(position[:, 0], position[:, 1])
        rate = direction[rays, 2] - _slope(indenter, position, direction[rays], 1e-6 * scale)
        missed[rays] = np.isinf(height)
        falling[rays] = ~missed[rays] & (rate <= 0)
        stopped = (missed | falling)[rays]
        step = np.where(stopped, 0.0, height - position[:, 2]) / np.where(stopped, 1.0, rate)
        distance[rays] += step
        running[rays] = ~stopped & (np.abs(step) > ROUND_OFF * scale)
    undecided = falling.copy()
    undecided[falling] = _intersects_later(indenter, start[falling], direction[falling], distance[falling], scale)
    return np.where(missed | falling, np.inf, distance), ~(running | undecided)


def _intersects_later(indenter: Indenter, start: Array, direction: Array, distance: Array, length: float) -> Flags:
    """Return whether rays rise above the surface within `length` beyond a distance, by samples."""
    intersects = np.zeros(len(start), bool)
    if not len(start):
        return intersects
    for extra in np.linspace(0, length, N_SAMPLES + 1)[1:]:
        position = start + (distance + extra)[:, None] * direction
        intersects |= position[:, 2] > indenter.height(position[:, 0], position[:, 1])
    return intersects


def _slope(indenter: Indenter, position: Array, direction: Array, width: float) -> Array:
    """Return the change of height per length of ray, by central differences; 0 at the end of the surface."""
    forward = indenter.height(*(position[:, :2] + width * direction[:, :2]).T)
    backward = indenter.height(*(position[:, :2] - width * direction[:, :2]).T)
    defined = np.isfinite(forward) & np.isfinite(backward)
    return np.subtract(forward, backward, where=defined, out=np.zeros(len(position))) / (2 * width)


def _about(axis: int, angle: float) -> Array:
    """Return the right-handed rotation about a coordinate axis, (3, 3)."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[j, j] = rotation[k, k] = math.cos(angle)
    rotation[k, j] = math.sin(angle)
    rotation[j, k] = -rotation[k, j]
    return rotation
