"""Search for slender limbs of a body, whose bending boundary elements by collocation do not resolve."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meeframe.elements.base import shape_functions
from meeframe.fields import N_MECHANICAL, Array, Indices
from meeframe.mesh.body import Body
from meeframe.mesh.parts import body_parts
from meeframe.mesh.surface import SurfaceMesh
from meeframe.mesh.topology import corner_count

N_LEVELS = 64
"""Number of cutting planes in each direction; lengths are accurate to this fraction of the extent of the body."""
RATIO, LINEAR_RATIO = 20.0, 6.0
"""Largest ratio of length to thickness that is not slender, for quadratic and for linear elements.

The bending of clamped rods of these ratios is accurate to 4 %, that of rods of ratios 30 and 10 is not
(validation/slender_rods)."""


@dataclass(frozen=True)
class SlenderLimb:
    """A slender limb of a body.

    Attributes
    ----------
    length : float
        Distance of its end from the supports, or from where the body is thicker [m].
    thickness : float
        Thickness in the direction of bending [m].
    at : tuple of float
        Position of the point farthest from the supports [m].
    """

    length: float
    thickness: float
    at: tuple[float, float, float]


def find_slender_limbs(body: Body, ratio: float) -> tuple[SlenderLimb, ...]:
    """Return the most slender limb of each separate part of a body, if it is longer than `ratio` times its thickness.

    Parameters
    ----------
    body : Body
        A body whose mesh passes `check_mesh`.
    ratio : float
        Least ratio of length to thickness of a slender limb.

    Returns
    -------
    tuple of SlenderLimb
        The limbs, at most one for each separate part.

    Notes
    -----
    Planes at right angles to the axes, and at 45 degrees to two of them, cut off limbs. For bending along each axis in
    the plane, the length of a limb is its height over the plane or, if less, the distance of its farthest point from
    the nearest point where the displacement along that axis is prescribed: half the span between two supports. Its
    thickness is volume over projected area: that of a square rod or of a plate, or the wall thickness of a hollow rod.
    Limbs of a bulky body are found if a plane cuts them off, but not in a recess or with a thicker head. Limbs along
    the diagonals of the axes have lengths up to a third too small for their thickness.
    """
    mesh = body.mesh
    if mesh.semi_infinite:
        return ()
    fixed = np.zeros((len(mesh.points), N_MECHANICAL), bool)
    for condition in body.conditions:
        if condition.kind == "value" and condition.field < N_MECHANICAL:
            fixed[mesh.group_points(condition.group), condition.field] = True
    part = body_parts(mesh)
    triangles, points = _triangles(mesh)
    limbs = (
        _longest_limb(triangles[part[points] == number], mesh.points[part == number], fixed[part == number], ratio)
        for number in range(int(part.max()) + 1)
    )
    return tuple(limb for limb in limbs if limb is not None)


def bending_warnings(body: Body, ratio: float = RATIO, advice: str = "") -> tuple[str, ...]:
    """Return warnings about the bending of slender limbs by boundary elements with collocation.

    Parameters
    ----------
    body : Body
        A body whose mesh passes `check_mesh`.
    ratio : float
        Least ratio of length to thickness of a slender limb; LINEAR_RATIO at most with linear elements.
    advice : str
        What to try first, as the beginning of a sentence that goes on in small letters.

    Returns
    -------
    tuple of str
        One message for each limb: where it is, how slender, and what to do.
    """
    linear = any(len(block.element.nodes) == corner_count(block.element) for block in body.mesh.blocks)
    return tuple(
        f"the body extends {limb.length:.3g} m from its supports, or from where it is thicker, at "
        f"({', '.join(f'{x:.3g}' for x in limb.at)}) [m], {limb.length / limb.thickness:.3g} times its thickness of "
        f"{limb.thickness:.3g} m, so that its bending may be inaccurate: {advice}compare with a mesh twice as fine, or "
        "use finite elements (formulation skfem)"
        for limb in find_slender_limbs(body, min(ratio, LINEAR_RATIO) if linear else ratio)
    )


def _longest_limb(triangles: Array, points: Array, fixed: NDArray[np.bool_], ratio: float) -> SlenderLimb | None:
    """Return the most slender limb of a separate part, if it is longer than `ratio` times its thickness.

    triangles: (t, 3, 3), its surface; fixed: displacements that are prescribed at its points (p, 3).
    """
    limb, normals = None, np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2.0
    for axis in range(3):
        supports = points[fixed[:, axis]]
        distances = np.full(len(points), np.inf)
        for towards in _transverse_directions(axis) if len(supports) else ():
            levels, volumes, areas = _volumes_above(
                triangles @ towards, normals @ towards, np.abs(normals[:, axis]) / 2.0
            )
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
                limb = SlenderLimb(float(lengths[k]), float(volumes[k] / areas[k]), (x, y, z))
    return limb


def _transverse_directions(axis: int) -> Array:
    """Return the unit vectors at right angles to an axis, every 45 degrees, (8, 3)."""
    angles = np.arange(8) * (np.pi / 4.0)
    return np.insert(np.column_stack([np.cos(angles), np.sin(angles)]), axis, 0.0, axis=1)


def _volumes_above(heights: Array, rises: Array, widths: Array) -> tuple[Array, Array, Array]:
    """Return equidistant levels from the lowest point, and volume and area above each, (N_LEVELS,) each.

    heights: of the corners of each triangle, (t, 3); rises: its area times its normal along the heights; widths: its
    area with the weight of the sum. The volume above a level of a closed surface is int (z - level) n_z dS.
    """
    low, middle, high = np.sort(heights, axis=1).T
    mean = heights.mean(axis=1)
    levels = low.min() + (high.max() - low.min()) * np.arange(N_LEVELS) / N_LEVELS
    first, last = np.searchsorted(levels, low, "right"), np.searchsorted(levels, high, "left")

    def sum_above(weights: Array) -> Array:
        """Return the sum over all triangles that lie above each level."""
        total: Array = np.bincount(first, weights, N_LEVELS + 1)[:0:-1].cumsum()[::-1]
        return total

    volumes, areas = sum_above(rises * mean) - levels * sum_above(rises), sum_above(widths)
    cut = np.maximum(last - first, 0)
    t = np.repeat(np.arange(len(cut)), cut)
    level = np.arange(len(t)) - np.repeat(np.cumsum(cut) - cut, cut) + first[t]
    above, below = high[t] - levels[level], levels[level] - low[t]
    upper = levels[level] >= middle[t]  # one corner lies above, else two
    tip = np.where(upper, above, below)
    tip_share = tip**2 / ((high - low)[t] * np.where(upper, (high - middle)[t], (middle - low)[t]))
    shares = np.where(upper, tip_share, 1.0 - tip_share)
    moments = np.where(upper, 0.0, mean[t] - levels[level]) + tip_share * tip / 3.0
    volumes += np.bincount(level, rises[t] * moments, N_LEVELS)
    areas += np.bincount(level, widths[t] * shares, N_LEVELS)
    return levels, volumes, areas


def _nearest(points: Array, others: Array) -> Array:
    """Return the distance of each point from the nearest of the others."""
    from scipy.spatial import cKDTree

    distances: Array = cKDTree(others).query(points)[0]
    return distances


def _triangles(mesh: SurfaceMesh) -> tuple[Array, Indices]:
    """Return the elements as flat triangles (t, 3, 3), several for curved ones, and a point of each element (t,)."""
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
            for triangle in (((0, 0), (1, 0), (0, 1)), ((1, 0), (1, 1), (0, 1)))
            if i + j + max(map(sum, triangle)) <= inside
            for a, b in triangle
        ]
        shapes = shape_functions(block.element, start + step * np.array(corners))
        positions = np.einsum("mn,end->emd", shapes, mesh.points[block.connectivity])
        triangles.append(positions.reshape(-1, 3, 3))
        points.append(np.repeat(block.connectivity[:, 0], len(corners) // 3))
    return np.concatenate(triangles), np.concatenate(points)
