"""Strongly singular integrals of the traction kernel at a node: the Cauchy principal value and the free term c_JK.

They are computed directly, as a check of their sum, which the formulations take from constant fields ('rigid body
motions'). The excluded neighbourhood is a sphere of vanishing radius. The sum of c, of the principal values over all
elements that meet at a node, and of the integrals over the other elements of a closed surface vanishes for constant
fields (eq. 19).
"""

from typing import Final

import numpy as np

from meeframe.elements._kernels.quadrature_order import MODERATE_ANISOTROPY
from meeframe.elements.base import SurfaceElement, shape_derivatives
from meeframe.elements.quadrature import element_rule
from meeframe.fields import Array
from meeframe.greens.base import Kernel
from meeframe.greens.directions import spread_directions

_ARC_POINTS: Final = 24
_MAX_ARC: Final = np.pi / 6
_N_APEXES: Final = 64


def traction_principal_value(
    kernel: Kernel,
    element: SurfaceElement,
    nodes: Array,
    local_node: int,
    tolerance: float = 1e-10,
    anisotropy: float = MODERATE_ANISOTROPY,
) -> Array:
    """Return the contribution of one element to the principal value of int T_JK N_a dS, with the source at a node.

    Parameters
    ----------
    kernel : Kernel
        Fundamental solution.
    element : SurfaceElement
        Element type.
    nodes : Array
        Positions of the nodes, (n, 3), in the unit of length of the kernel.
    local_node : int
        Number of the node at which the source lies.
    tolerance : float
        Relative error of the quadrature.
    anisotropy : float
        Anisotropy of the medium, see `meeframe.elements.anisotropy`.

    Returns
    -------
    Array
        Contributions, (n, 5, 5). Only their sum over all elements that meet at the node is independent of the unit of
        length.

    Notes
    -----
    With the tangent map A of the element at the source and the offset y in the reference domain, the singular part
    T(A y, normal) of the integrand is subtracted, and its integral beyond |A y| = epsilon is added without its
    logarithm of epsilon: over all elements that meet at the node these logarithms cancel.

    References
    ----------
    Guiggiani and Gigante, J. Appl. Mech. 57 (1990) 906.
    """
    source = np.asarray(nodes, float)[local_node]
    rule = element_rule(element, nodes, source, tolerance, element.nodes[local_node], anisotropy)
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
    """Return the free term c_JK of eq. (19) at a node, from the tangent cone of the body.

    Parameters
    ----------
    kernel : Kernel
        Fundamental solution.
    facets : Array
        Sectors of the cone, (f, 3, 3), in any order, one from `tangent_facet` for each element that meets at the node.

    Returns
    -------
    Array
        Free term, (5, 5); half the identity at a smooth point.

    Notes
    -----
    c is minus the integral of T(e, normal e) over the unit sphere inside the cone. That region is integrated over
    signed spherical triangles of a fan about an axis well away from the facets. This holds for re-entrant cones, too:
    the fan covers the region up to complete spheres.
    """
    arcs = _arcs(facets)
    points, weights = _fan(_apex(arcs[0]), *arcs)
    spheres = np.floor(weights.sum() / (4.0 * np.pi))
    traction = kernel.evaluate(points, points)[1]
    inside: Array = -np.einsum("m,mjk->jk", weights, traction) - spheres * np.eye(traction.shape[1])
    return inside


def tangent_facet(element: SurfaceElement, nodes: Array, local_node: int) -> Array:
    """Return the sector of the tangent cone that an element contributes at one of its nodes.

    Parameters
    ----------
    element : SurfaceElement
        Element type.
    nodes : Array
        Positions of the nodes, (n, 3).
    local_node : int
        Number of the node.

    Returns
    -------
    Array
        Unit start and end directions, counter-clockwise seen from outside, and outward unit normal, (3, 3). Start and
        end are opposite at a mid-side node and equal at a node inside the element, whose sector is a complete plane.
    """
    origin = element.nodes[local_node]
    corners = element.nodes[: 4 if element.reference == "quadrilateral" else 3]
    following = np.roll(corners, -1, axis=0)
    sides = [(a, b) for a, b in zip(corners, following, strict=True) if abs(_cross(a - origin, b - origin)) > 1e-12]
    # The sides without the node, in counter-clockwise order, start behind the sides that contain it.
    begins = [k for k, (a, _) in enumerate(sides) if not np.array_equal(a, sides[k - 1][1])]
    first = begins[0] if begins else 0
    start, end = sides[first][0] - origin, sides[first - 1][1] - origin
    tangents = _tangents(element, nodes, local_node)
    vectors = np.array([start @ tangents, end @ tangents, np.cross(*tangents)])
    facet: Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return facet


def _tangents(element: SurfaceElement, nodes: Array, local_node: int) -> Array:
    """Return the tangents x_xi, x_eta at a node, (2, 3)."""
    derivatives = shape_derivatives(element, element.nodes[[local_node]])[0]
    tangents: Array = derivatives.T @ np.asarray(nodes, float)
    return tangents


def _cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _gauge(element: SurfaceElement, points: Array, origin: Array) -> Array:
    """Return the fraction, 0 to 1, of the way from origin to the boundary of the reference domain at points (m, 2)."""
    if element.reference == "quadrilateral":
        sides = np.array([[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, -1.0, 1.0]])
    else:
        sides = np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
    distances = sides[:, 2] - sides[:, :2] @ origin
    functionals = sides[distances > 1e-12, :2] / distances[distances > 1e-12, None]
    gauge: Array = ((points - origin) @ functionals.T).max(axis=1)
    return gauge


def _arcs(facets: Array) -> tuple[Array, Array, Array]:
    """Return Gauss points p on the arcs in which facets cut the unit sphere: p and dp/ds (m, 3), weights ds (m,)."""
    nodes, weights = np.polynomial.legendre.leggauss(_ARC_POINTS)
    positions, velocities, steps = [], [], []
    for start, end, normal in np.asarray(facets, float):
        tangent = np.cross(normal, start)
        angle = np.arctan2(end @ tangent, end @ start) % (2.0 * np.pi)
        angle = angle if angle > 1e-9 else 2.0 * np.pi
        n_pieces = int(np.ceil(angle / _MAX_ARC))
        half = 0.5 * angle / n_pieces
        angles = (half * (2.0 * np.arange(n_pieces)[:, None] + 1.0 + nodes)).ravel()[:, None]
        positions.append(np.cos(angles) * start + np.sin(angles) * tangent)
        velocities.append(np.cos(angles) * tangent - np.sin(angles) * start)
        steps.append(np.tile(half * weights, n_pieces))
    return np.concatenate(positions), np.concatenate(velocities), np.concatenate(steps)


def _apex(positions: Array) -> Array:
    """Return the direction, among many, that is farthest from points (m, 3) on the sphere and their antipodes."""
    candidates = spread_directions(_N_APEXES)
    best: Array = candidates[np.abs(candidates @ positions.T).max(axis=1).argmin()]
    return best


def _fan(apex: Array, positions: Array, velocities: Array, steps: Array) -> tuple[Array, Array]:
    """Return directions (m, 3) and signed solid angles (m,) of the fan from apex to arcs; the body is on the right."""
    nodes, weights = np.polynomial.legendre.leggauss(2 * _ARC_POINTS)
    cosine = positions @ apex
    tangent = positions - cosine[:, None] * apex
    sine = np.linalg.norm(tangent, axis=1)
    turn_direction = -np.cross(apex, positions)
    turns = steps * np.einsum("mi,mi->m", turn_direction, velocities) / sine**2
    half = 0.5 * np.arctan2(sine, cosine)
    angles = half[:, None] * (1.0 + nodes)
    outward = (tangent / sine[:, None])[:, None, :]
    points = np.cos(angles)[..., None] * apex + np.sin(angles)[..., None] * outward
    solid_angles = turns[:, None] * half[:, None] * weights * np.sin(angles)
    return points.reshape(-1, 3), solid_angles.ravel()
