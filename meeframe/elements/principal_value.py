"""Strongly singular integrals of the traction kernel at a node: Cauchy principal value, and the free term c_JK.

Directly, as a check of the constant-field ('rigid body') way of finding their sum. The excluded neighbourhood is a
sphere of vanishing radius; over all elements that meet at a node, c + sum of principal values + the integrals over the
other elements of a closed surface vanishes for constant fields (eq. 19).
"""

from typing import Final

import numpy as np

from meeframe.elements._kernels.quadrature_order import MODERATE_ANISOTROPY
from meeframe.elements.base import SurfaceElement, shape_derivatives
from meeframe.elements.quadrature import pair_rule
from meeframe.fields import Array
from meeframe.greens.base import Kernel
from meeframe.greens.directions import spread_directions

_POINTS: Final = 24
_LONGEST_ARC: Final = np.pi / 6
_APEXES: Final = 64


def traction_principal_value(
    kernel: Kernel,
    element: SurfaceElement,
    nodes: Array,
    local_node: int,
    tolerance: float = 1e-10,
    anisotropy: float = MODERATE_ANISOTROPY,
) -> Array:
    """Return the contribution of one element to the principal value of int T_JK N_a dS, source at one of its nodes,
    (n, fields, fields).

    nodes: (n, 3), in the unit of length of the kernel. Guiggiani and Gigante (J. Appl. Mech. 57, 1990, 906): with the
    element's tangent map A at the source, offset y in the reference domain, the singular part T(A y, normal) of the
    integrand is subtracted and its integral beyond |A y| = epsilon added, where its logarithm of epsilon is dropped:
    over all elements that meet at the node these logarithms cancel, and only their sum is independent of the unit.
    """
    source = np.asarray(nodes, float)[local_node]
    rule = pair_rule(element, nodes, source, tolerance, element.nodes[local_node], anisotropy)
    traction = kernel.evaluate(rule.positions - source, rule.normals)[1]
    values: Array = np.einsum("m,ma,mjk->ajk", rule.measures, rule.shapes, traction)

    origin = element.nodes[local_node]
    tangents = _tangents(element, nodes, local_node)
    area = np.cross(*tangents)
    offsets = (rule.points - origin) @ tangents
    gauge = _gauge(element, rule.points, origin)
    normals = np.broadcast_to(area / np.linalg.norm(area), offsets.shape)
    singular = kernel.evaluate(offsets, np.ascontiguousarray(normals))[1]
    factors = 1.0 - gauge * np.log(np.linalg.norm(offsets, axis=1) / gauge)
    values[local_node] -= np.linalg.norm(area) * np.einsum("m,mjk->jk", rule.weights * factors, singular)
    return values


def free_term(kernel: Kernel, facets: Array) -> Array:
    """Return the free term c_JK of eq. (19) at a node, (fields, fields), from the tangent cone of the body there.

    facets: (f, 3, 3), in any order, one for each element that meets at the node, as tangent_facet makes them: start
    direction, end direction, outward unit normal. c = -(integral of T(e, normal e) over the part of the unit sphere
    inside the cone); a smooth point gives half the identity. The part is summed as signed triangles of a fan about an
    axis well away from the facets, which holds for re-entrant cones too: the fan covers it but for whole spheres.
    """
    arcs = _arcs(facets)
    points, weights = _fan(_apex(arcs[0]), *arcs)
    spheres = np.floor(weights.sum() / (4.0 * np.pi))
    traction = kernel.evaluate(points, points)[1]
    inside: Array = -np.einsum("m,mjk->jk", weights, traction) - spheres * np.eye(traction.shape[1])
    return inside


def tangent_facet(element: SurfaceElement, nodes: Array, local_node: int) -> Array:
    """Return the element's sector of the tangent cone at one of its nodes, for free_term.

    Rows of (3, 3): unit start and end directions, counter-clockwise seen from outside, and outward unit normal. Start
    and end are opposite at a mid-side node and alike at a node inside the element, whose sector is the whole plane.
    """
    origin = element.nodes[local_node]
    corners = element.nodes[: 4 if element.reference == "quadrilateral" else 3]
    following = np.roll(corners, -1, axis=0)
    sides = [(a, b) for a, b in zip(corners, following, strict=True) if abs(_cross(a - origin, b - origin)) > 1e-12]
    # Sides away from the node, in counter-clockwise order: begin behind those that hold it.
    begins = [k for k, (a, _) in enumerate(sides) if not np.array_equal(a, sides[k - 1][1])]
    first = begins[0] if begins else 0
    start, end = sides[first][0] - origin, sides[first - 1][1] - origin
    tangents = _tangents(element, nodes, local_node)
    rows = np.array([start @ tangents, end @ tangents, np.cross(*tangents)])
    facet: Array = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    return facet


def _tangents(element: SurfaceElement, nodes: Array, local_node: int) -> Array:
    """Return the tangents x_xi, x_eta at a node, (2, 3)."""
    derivatives = shape_derivatives(element, element.nodes[[local_node]])[0]
    tangents: Array = derivatives.T @ np.asarray(nodes, float)
    return tangents


def _cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _gauge(element: SurfaceElement, points: Array, origin: Array) -> Array:
    """Return the fraction 0..1 of the way from origin to the boundary of the reference domain at points (m, 2)."""
    if element.reference == "quadrilateral":
        sides = np.array([[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, -1.0, 1.0]])
    else:
        sides = np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
    room = sides[:, 2] - sides[:, :2] @ origin
    away = sides[room > 1e-12, :2] / room[room > 1e-12, None]
    gauge: Array = ((points - origin) @ away.T).max(axis=1)
    return gauge


def _arcs(facets: Array) -> tuple[Array, Array, Array]:
    """Return the Gauss points on the great arcs in which facets cut the unit sphere: points p, dp/ds (m, 3), weights
    ds (m,)."""
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    positions, velocities, steps = [], [], []
    for start, end, normal in np.asarray(facets, float):
        sideways = np.cross(normal, start)
        angle = np.arctan2(end @ sideways, end @ start) % (2.0 * np.pi)
        angle = angle if angle > 1e-9 else 2.0 * np.pi
        pieces = int(np.ceil(angle / _LONGEST_ARC))
        half = 0.5 * angle / pieces
        angles = (half * (2.0 * np.arange(pieces)[:, None] + 1.0 + nodes)).ravel()[:, None]
        positions.append(np.cos(angles) * start + np.sin(angles) * sideways)
        velocities.append(np.cos(angles) * sideways - np.sin(angles) * start)
        steps.append(np.tile(half * weights, pieces))
    return np.concatenate(positions), np.concatenate(velocities), np.concatenate(steps)


def _apex(positions: Array) -> Array:
    """Return the one of many directions on the sphere that is farthest from points (m, 3) and their antipodes."""
    candidates = spread_directions(_APEXES)
    best: Array = candidates[np.abs(candidates @ positions.T).max(axis=1).argmin()]
    return best


def _fan(apex: Array, positions: Array, velocities: Array, steps: Array) -> tuple[Array, Array]:
    """Return the directions (m, 3) and signed solid angles (m,) of the fan between apex and arcs; the body is to their
    right."""
    nodes, weights = np.polynomial.legendre.leggauss(2 * _POINTS)
    cosine = positions @ apex
    sideways = positions - cosine[:, None] * apex
    sine = np.linalg.norm(sideways, axis=1)
    turning = -np.cross(apex, positions)
    turns = steps * np.einsum("mi,mi->m", turning, velocities) / sine**2
    half = 0.5 * np.arctan2(sine, cosine)
    angles = half[:, None] * (1.0 + nodes)
    outward = (sideways / sine[:, None])[:, None, :]
    points = np.cos(angles)[..., None] * apex + np.sin(angles)[..., None] * outward
    solid_angles = turns[:, None] * half[:, None] * weights * np.sin(angles)
    return points.reshape(-1, 3), solid_angles.ravel()
