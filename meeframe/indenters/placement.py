"""Placement of an indenter, and the initial gap between it and the contact zone."""

import math
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.indenters.base import Indenter
from meeframe.mesh.zone import ContactZone, local_frames

Flags = NDArray[np.bool_]

MOST_STEPS: Final = 200
SAMPLES: Final = 100  # of a ray that may meet a surface that is not convex
ROUND_OFF: Final = 1e-13  # of a distance, in parts of the extent of the contact zone


@dataclass(frozen=True)
class Placement:
    """Position of an indenter just touching: approach zero.

    axis: direction from which the indenter comes, pointing away from the body; with the global x3 axis (the default)
    the indenter's own axes are the global ones, else e1, e2 of local_frames(axis).
    x, y: where its lowest point stands in those axes, from the origin [m]; along the axis it stands level with the
    highest point of the contact zone. rotation: of the shape in its own plane, then tilt_2 about e2, then tilt_1 about
    e1, all right-handed, about the lowest point that it has upright, exact for any angle [rad]; that point stays
    where it is, so that what a tilt brings below it overlaps with the body at approach zero.
    Raises CaseError if a number is not finite, a tilt reaches a right angle, or the axis is no direction.
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

    @property
    def base(self) -> Array:
        """Axes of the place, rows e1, e2, axis, (3, 3)."""
        base: Array = local_frames(np.array([self.axis]) / math.hypot(*self.axis))[0]
        return base

    @property
    def turn(self) -> Array:
        """Rotation (3, 3) that takes coordinates of the shape to those along e1, e2, axis."""
        turn: Array = _about(0, self.tilt_1) @ _about(1, self.tilt_2) @ _about(2, self.rotation)
        return turn

    def lowest(self, points: Array) -> Array:
        """Return where the lowest point stands, just touching a contact zone of points (n, 3), (3,) along base's rows
        [m]."""
        return np.array([self.x, self.y, np.max(points @ self.base[2])])

    def reference(self, points: Array) -> Array:
        """Return the same point in global axes, (3,) [m]."""
        reference: Array = self.lowest(points) @ self.base
        return reference


def initial_gap(
    indenter: Indenter, zone: ContactZone, placement: Placement | None = None, approach: float = 0.0
) -> Array:
    """Return the distance from each point of the zone to the indenter's surface along the outward normal, (n,) [m].

    Negative where they overlap, inf where the normal meets no surface of the indenter. approach: displacement of the
    indenter against its axis [m]. On a flat zone with the indenter upright this is height(x, y) - approach.
    Raises CaseError where the indenter's surface is so rough and steep that the distance cannot be found.
    """
    placement = placement or Placement()
    base, turn = placement.base, placement.turn
    lowest = placement.lowest(zone.points) - np.array([0.0, 0.0, approach])
    # rays along the normals in coordinates of the shape
    start = (zone.points @ base.T - lowest) @ turn
    along = zone.frames[:, 2] @ base.T @ turn
    gap = np.full(len(start), np.inf)
    ahead = along[:, 2] > 1e-9
    found, settled = _meet(indenter, start[ahead], along[ahead])
    if not settled.all():
        worst = zone.points[ahead][~settled]
        raise CaseError(
            f"no distance to the indenter along the normal at {len(worst)} points, the first at {worst[0]} [m]: its "
            "surface is too steep there for the tilt or the curvature of the contact zone"
        )
    gap[ahead] = found
    return gap


def _meet(indenter: Indenter, start: Array, along: Array) -> tuple[Array, Flags]:
    """Return where rays from below (n, 3), not level, first meet the surface: signed distance (n,), and whether it is
    settled.

    Newton's method on level(s) = z - height(x, y) from the level of the lowest point, where level <= 0. For a convex
    indenter level is concave along the ray, so that the steps never pass the first meeting, and where level stops
    rising there is none. For others it may rise again: then the ray is not settled. Rays that pass beside the surface
    meet none, whatever its sides look like.
    """
    distance = -start[:, 2] / along[:, 2]
    scale = np.abs(start).max(initial=0.0) or 1.0
    upright = not np.any(along[:, :2])
    running, beside, falling = np.ones(len(start), bool), np.zeros(len(start), bool), np.zeros(len(start), bool)
    for _ in range(MOST_STEPS):
        rays = np.flatnonzero(running)
        if rays.size == 0:
            break
        at = start[rays] + distance[rays, None] * along[rays]
        height = indenter.height(at[:, 0], at[:, 1])
        rate = along[rays, 2] - (0.0 if upright else _slope(indenter, at, along[rays], 1e-6 * scale))
        beside[rays] = np.isinf(height)
        falling[rays] = ~beside[rays] & (rate <= 0)
        lost = (beside | falling)[rays]
        step = np.where(lost, 0.0, height - at[:, 2]) / np.where(lost, 1.0, rate)
        distance[rays] += step
        running[rays] = ~lost & (np.abs(step) > ROUND_OFF * scale)
    doubtful = falling.copy()
    doubtful[falling] = _meets_ahead(indenter, start[falling], along[falling], distance[falling], scale)
    return np.where(beside | falling, np.inf, distance), ~(running | doubtful)


def _meets_ahead(indenter: Indenter, start: Array, along: Array, distance: Array, reach: float) -> Flags:
    """Return whether the rays get above the surface within reach beyond a distance, by samples."""
    met = np.zeros(len(start), bool)
    for further in np.linspace(0, reach, SAMPLES + 1)[1:]:
        at = start + (distance + further)[:, None] * along
        met |= at[:, 2] > indenter.height(at[:, 0], at[:, 1])
    return met


def _slope(indenter: Indenter, at: Array, along: Array, reach: float) -> Array:
    """Return the change of height per length of ray, by central differences; 0 beside an edge."""
    ahead = indenter.height(*(at[:, :2] + reach * along[:, :2]).T)
    behind = indenter.height(*(at[:, :2] - reach * along[:, :2]).T)
    known = np.isfinite(ahead) & np.isfinite(behind)
    return np.subtract(ahead, behind, where=known, out=np.zeros(len(at))) / (2 * reach)


def _about(axis: int, angle: float) -> Array:
    """Return the right-handed rotation about a coordinate axis, (3, 3)."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[j, j] = rotation[k, k] = math.cos(angle)
    rotation[k, j] = math.sin(angle)
    rotation[j, k] = -rotation[k, j]
    return rotation
