"""Bodies that stick out so far from their supports that their bending is a matter of small differences."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meeframe.elements.base import shape_functions
from meeframe.fields import N_MECHANICAL, Array, Indices
from meeframe.mesh.body import Body
from meeframe.mesh.parts import body_parts
from meeframe.mesh.surface import SurfaceMesh
from meeframe.mesh.topology import corner_count

LEVELS = 64
"""Planes that cut a part off, in each direction: a limb is found shorter by at most one part in so many of the body."""
RATIO, LINEAR_RATIO = 20.0, 6.0
"""Longer parts are slender. Clamped rods of twenty widths are bent rightly, to 4 %, of six and less with linear
elements, too; rods of thirty are not, nor of ten with linear elements (validation/slender_rods)."""


@dataclass(frozen=True)
class Slender:
    """A part of a body that reaches `length` [m] from its supports, or from where it is thicker, is `thickness` [m]
    thick in the direction of its bending, and is farthest from its supports `at` [m]."""

    length: float
    thickness: float
    at: tuple[float, float, float]


def slender_parts(body: Body, ratio: float) -> tuple[Slender, ...]:
    """Return where a body that check_mesh lets pass is longer than `ratio` times its thickness: the worst of each part.

    Planes at right angles to the axes, and at 45 degrees to two of them, cut off what lies beyond. For bending along
    each axis in the plane its length is the height over the plane, or, if less, the distance of its farthest point from
    the nearest point where the displacement along that axis is prescribed: half the span between two supports. Its
    thickness is volume over projected area: that of a square rod or of a plate, the wall of a hollow one. Limbs of a
    bulky body are seen if a plane cuts them off, not in a recess nor with a thicker head; across the diagonals of the
    axes lengths are found up to a third too small for their thickness.
    """
    mesh = body.mesh
    if mesh.semi_infinite:
        return ()
    held = np.zeros((len(mesh.points), N_MECHANICAL), bool)
    for condition in body.conditions:
        if condition.kind == "value" and condition.field < N_MECHANICAL:
            held[mesh.group_points(condition.group), condition.field] = True
    part = body_parts(mesh)
    triangles, points = _triangles(mesh)
    pieces = (
        _worst(triangles[part[points] == number], mesh.points[part == number], held[part == number], ratio)
        for number in range(int(part.max()) + 1)
    )
    return tuple(piece for piece in pieces if piece is not None)


def bending_warnings(body: Body, ratio: float = RATIO, advice: str = "") -> tuple[str, ...]:
    """Return what boundary elements by collocation have to say of a body's slender parts: where, how slender, what to
    do.

    ratio: parts longer than that times their thickness, or LINEAR_RATIO with linear elements, are slender; advice: what
    to try first.
    """
    linear = any(len(block.element.nodes) == corner_count(block.element) for block in body.mesh.blocks)
    return tuple(
        f"the body reaches {part.length:.3g} m from its supports, or from where it is thicker, at "
        f"({', '.join(f'{x:.3g}' for x in part.at)}) [m], {part.length / part.thickness:.3g} times its thickness of "
        f"{part.thickness:.3g} m: its bending may be far off; {advice}compare with a mesh twice as fine, or use finite "
        "elements (formulation skfem)"
        for part in slender_parts(body, min(ratio, LINEAR_RATIO) if linear else ratio)
    )


def _worst(triangles: Array, points: Array, held: NDArray[np.bool_], ratio: float) -> Slender | None:
    """Return the longest for its thickness of all pieces of a part, if it is longer than `ratio` times that.

    triangles: (t, 3, 3), its surface; held: displacements that are prescribed at its points (p, 3).
    """
    worst, normals = None, np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2.0
    for axis in range(3):
        supports = points[held[:, axis]]
        distances = np.full(len(points), np.inf)
        for towards in _across(axis) if len(supports) else ():
            levels, volumes, areas = _cut_off(triangles @ towards, normals @ towards, np.abs(normals[:, axis]) / 2.0)
            heights = points @ towards
            lengths = heights.max() - levels
            if not np.any(lengths * areas > ratio * volumes):
                continue
            if np.isinf(distances[0]):
                distances = _nearest(points, supports)
            order = np.argsort(-heights)
            beyond = np.searchsorted(-heights[order], -levels, "left")
            lengths = np.minimum(lengths, np.maximum.accumulate(distances[order])[beyond - 1])
            k = int(np.argmax(lengths * areas / volumes))
            if lengths[k] * areas[k] > ratio * volumes[k]:
                ratio = lengths[k] * areas[k] / volumes[k]
                x, y, z = points[order[distances[order[: beyond[k]]].argmax()]].tolist()
                worst = Slender(float(lengths[k]), float(volumes[k] / areas[k]), (x, y, z))
    return worst


def _across(axis: int) -> Array:
    """Return the unit vectors at right angles to an axis, every 45 degrees, (8, 3)."""
    angles = np.arange(8) * (np.pi / 4.0)
    return np.insert(np.column_stack([np.cos(angles), np.sin(angles)]), axis, 0.0, axis=1)


def _cut_off(heights: Array, rises: Array, widths: Array) -> tuple[Array, Array, Array]:
    """Return the planes at equal distances from the lowest point, and volume and area of what lies above each,
    (LEVELS,) each.

    heights: of the corners of each triangle, (t, 3); rises: its area times its normal along the heights; widths: its
    area, as it is to be counted. A closed surface needs no lid: the volume above is int (z - level) n_z dS.
    """
    low, middle, high = np.sort(heights, axis=1).T
    mean = heights.mean(axis=1)
    levels = low.min() + (high.max() - low.min()) * np.arange(LEVELS) / LEVELS
    first, last = np.searchsorted(levels, low, "right"), np.searchsorted(levels, high, "left")

    def whole(weights: Array) -> Array:
        """Return the sum over all triangles that lie above each level."""
        total: Array = np.bincount(first, weights, LEVELS + 1)[:0:-1].cumsum()[::-1]
        return total

    volumes, areas = whole(rises * mean) - levels * whole(rises), whole(widths)
    cut = np.maximum(last - first, 0)
    t = np.repeat(np.arange(len(cut)), cut)
    level = np.arange(len(t)) - np.repeat(np.cumsum(cut) - cut, cut) + first[t]
    above, below = high[t] - levels[level], levels[level] - low[t]
    upper = levels[level] >= middle[t]  # one corner is above, else two
    tip = np.where(upper, above, below)
    tip_share = tip**2 / ((high - low)[t] * np.where(upper, (high - middle)[t], (middle - low)[t]))
    shares = np.where(upper, tip_share, 1.0 - tip_share)
    moments = np.where(upper, 0.0, mean[t] - levels[level]) + tip_share * tip / 3.0
    volumes += np.bincount(level, rises[t] * moments, LEVELS)
    areas += np.bincount(level, widths[t] * shares, LEVELS)
    return levels, volumes, areas


def _nearest(points: Array, others: Array) -> Array:
    """Return the distance of each point from the nearest of the others."""
    from scipy.spatial import cKDTree

    distances: Array = cKDTree(others).query(points)[0]
    return distances


def _triangles(mesh: SurfaceMesh) -> tuple[Array, Indices]:
    """Return the elements as flat triangles, those with curved sides as several, (t, 3, 3), and a point of each one's
    element."""
    triangles, points = [], []
    for block in mesh.blocks:
        n = 1 if len(block.element.nodes) == corner_count(block.element) else 2
        if block.element.reference == "triangle":
            start, step, inside = 0.0, 1.0 / n, n
        else:
            start, step, inside = -1.0, 2.0 / n, 2 * n
        corners = [
            (i + a, j + b)
            for i in range(n)
            for j in range(n)
            for three in (((0, 0), (1, 0), (0, 1)), ((1, 0), (1, 1), (0, 1)))
            if i + j + max(map(sum, three)) <= inside
            for a, b in three
        ]
        shapes = shape_functions(block.element, start + step * np.array(corners))
        places = np.einsum("mn,end->emd", shapes, mesh.points[block.connectivity])
        triangles.append(places.reshape(-1, 3, 3))
        points.append(np.repeat(block.connectivity[:, 0], len(corners) // 3))
    return np.concatenate(triangles), np.concatenate(points)
