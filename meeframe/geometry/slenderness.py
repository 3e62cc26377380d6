"""Bodies that stick out so far from their supports that their bending is a matter of small differences."""

from dataclasses import dataclass

import numpy as np

from meeframe.core.body import Body
from meeframe.core.element import shape_functions
from meeframe.core.fields import ELECTRIC, Array
from meeframe.core.mesh import Indices, SurfaceMesh
from meeframe.geometry.measures import gauss_rule, normal_vectors
from meeframe.geometry.parts import body_parts
from meeframe.geometry.topology import corner_count

WIDTHS, WIDTHS_OF_LINEAR = 12.0, 6.0
"""Longer parts are slender. Clamped rods of ten widths are bent rightly, to 1 %, and of five widths with linear
elements, to 4 %; rods of thirty are not, nor of ten with linear elements (validation/slender_rods). The rest is what
end faces take from the width as it is found here."""


@dataclass(frozen=True)
class Slender:
    """A part of a body that reaches `length` [m] from its supports and is `width` [m] thick; at: its farthest point."""

    length: float
    width: float
    at: tuple[float, float, float]


def slender_parts(body: Body) -> tuple[Slender, ...]:
    """Separate parts that collocation is known to bend wrongly, on meshes that check_mesh lets pass.

    The length is the largest distance of a point from the nearest one with a prescribed displacement: of a rod between
    two supports half its own, of a plate on a support its thickness. The width is four times volume over surface: that
    of a square or circular rod, twice the thickness of a plate.
    """
    mesh = body.mesh
    held = np.zeros(len(mesh.points), bool)
    for condition in body.conditions:
        if condition.kind == "value" and condition.field < ELECTRIC:
            held[mesh.group_points(condition.group)] = True
    if mesh.semi_infinite or not held.any():
        return ()
    part = body_parts(mesh)
    volumes, areas = _measures(mesh, part)
    linear = any(len(block.element.nodes) == corner_count(block.element) for block in mesh.blocks)
    found = []
    for number, width in enumerate(4.0 * volumes / areas):
        here = part == number
        points, supports = mesh.points[here], mesh.points[held & here]
        longest = (WIDTHS_OF_LINEAR if linear else WIDTHS) * width
        if len(supports) and np.linalg.norm(np.ptp(points, axis=0)) > longest:
            distances = _nearest(points, supports)
            if (length := float(distances.max())) > longest:
                x, y, z = points[distances.argmax()].tolist()
                found.append(Slender(length, float(width), (x, y, z)))
    return tuple(found)


def bending_warnings(body: Body) -> tuple[str, ...]:
    """What boundary elements by collocation have to say of a body's slender parts: where, how slender, what to do."""
    return tuple(
        f"the body reaches {part.length:.3g} m from its supports at ({', '.join(f'{x:.3g}' for x in part.at)}) [m], "
        f"{part.length / part.width:.3g} times its width of {part.width:.3g} m: its bending may be far off; compare "
        "with a mesh twice as fine, or use finite elements (formulation skfem)"
        for part in slender_parts(body)
    )


def _nearest(points: Array, others: Array) -> Array:
    """Distance of each point from the nearest of the others."""
    from scipy.spatial import cKDTree

    distances: Array = cKDTree(others).query(points)[0]
    return distances


def _measures(mesh: SurfaceMesh, part: Indices) -> tuple[Array, Array]:
    """Volume and surface of each part."""
    count = int(part.max()) + 1
    volumes, areas = np.zeros((2, count))
    origin = mesh.points.mean(axis=0)
    for block in mesh.blocks:
        xi, weights = gauss_rule(block.element.reference, 3)
        normals = normal_vectors(mesh.points, block.element, block.connectivity, xi)
        positions = np.einsum(
            "mn,end->emd", shape_functions(block.element, xi), mesh.points[block.connectivity] - origin
        )
        owner = part[block.connectivity[:, 0]]
        shares = np.einsum("emd,emd,m->e", positions, normals, weights) / 3.0
        volumes += np.bincount(owner, weights=shares, minlength=count)
        areas += np.bincount(owner, weights=np.linalg.norm(normals, axis=-1) @ weights, minlength=count)
    return volumes, areas
