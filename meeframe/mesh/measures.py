"""Integrals over surface meshes: points, normals, area, volume."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from meeframe.elements.base import Reference, SurfaceElement, shape_derivatives, shape_functions
from meeframe.fields import Array, Indices
from meeframe.mesh.surface import SurfaceMesh

AFFINE_TOLERANCE = 1e-11  # of the size of an element
VOLUME_ORDER = 6
"""Gauss points per direction: exact for the volume under any element up to degree 3 in each direction."""


@lru_cache(maxsize=32)
def gauss_rule(reference: Reference, n: int) -> tuple[Array, Array]:
    """Return the product Gauss rule on a reference domain.

    Parameters
    ----------
    reference : {'quadrilateral', 'triangle'}
        Reference domain.
    n : int
        Points per direction. The rule is exact to degree 2n - 1 in each direction on the quadrilateral, and to total
        degree 2n - 2 on the triangle, a collapsed square.

    Returns
    -------
    Array
        Points, (n^2, 2), read-only.
    Array
        Weights, (n^2,), read-only.
    """
    nodes, weights = np.polynomial.legendre.leggauss(n)
    x, y = (a.ravel() for a in np.meshgrid(nodes, nodes, indexing="ij"))
    w = np.outer(weights, weights).ravel()
    if reference == "triangle":
        x, y = (1 + x) / 2, (1 + y) / 2
        y, w = y * (1 - x), w * (1 - x) / 4
    points = np.stack([x, y], axis=1)
    points.setflags(write=False)
    w.setflags(write=False)
    return points, w


def normal_vectors(points: Array, element: SurfaceElement, connectivity: Indices, xi: Array) -> Array:
    """Return the outward normals of elements, as long as the surface Jacobian.

    Parameters
    ----------
    points : Array
        Points of the mesh, (p, 3).
    element : SurfaceElement
        Element type.
    connectivity : Indices
        Point numbers of the elements, (e, n).
    xi : Array
        Reference points, (m, 2).

    Returns
    -------
    Array
        Normals, (e, m, 3).
    """
    tangents = np.tensordot(points[connectivity], shape_derivatives(element, xi), axes=(1, 1))  # (e, 3, m, 2)
    along, across = tangents[..., 0], tangents[..., 1]
    normals = np.empty((len(connectivity), len(xi), 3))
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        normals[:, :, axis] = along[:, first] * across[:, second] - along[:, second] * across[:, first]
    return normals


def affine(points: Array, element: SurfaceElement, connectivity: Indices) -> NDArray[np.bool_]:
    """Return which elements are affine images of the reference domain.

    Parameters
    ----------
    points : Array
        Points of the mesh, (p, 3).
    element : SurfaceElement
        Element type.
    connectivity : Indices
        Point numbers of the elements, (e, n).

    Returns
    -------
    ndarray of bool
        True for elements that are affine to AFFINE_TOLERANCE of their size, (e,).
    """
    basis = np.column_stack([np.ones(len(element.nodes)), element.nodes])
    bending = np.eye(len(basis)) - basis @ np.linalg.pinv(basis)
    nodes = points[connectivity]
    bent = np.abs(np.tensordot(nodes, bending, axes=(1, 1))).max(axis=(1, 2))
    return np.asarray(bent <= AFFINE_TOLERANCE * np.ptp(nodes, axis=1).max(axis=1))


def area(mesh: SurfaceMesh, group: str | None = None) -> float:
    """Return the area of a mesh or of one face group.

    Parameters
    ----------
    mesh : SurfaceMesh
        The mesh.
    group : str, optional
        Name of a face group; by default the whole mesh.

    Returns
    -------
    float
        The area [m^2].

    Raises
    ------
    MeshError
        If the mesh has no such group.
    """
    index = None if group is None else mesh.group(group)
    total = 0.0
    for block in mesh.blocks:
        chosen = block.connectivity if index is None else block.connectivity[block.groups == index]
        xi, weights = gauss_rule(block.element.reference, VOLUME_ORDER)
        normals = normal_vectors(mesh.points, block.element, chosen, xi)
        total += float(np.sum(np.linalg.norm(normals, axis=-1) @ weights))
    return total


def volume(mesh: SurfaceMesh) -> float:
    """Return the enclosed volume [m^3] by the divergence theorem, int x.n dS / 3.

    Parameters
    ----------
    mesh : SurfaceMesh
        Closed mesh.

    Returns
    -------
    float
        Volume [m^3], negative if the mesh is inside out.
    """
    return float(volume_shares(mesh, mesh.points.mean(axis=0)).sum())


def volume_shares(mesh: SurfaceMesh, origin: Array) -> Array:
    """Return int (x - origin).n dS / 3 over each element, (n_elements,) [m^3], block after block."""
    shares = [np.empty(0)]
    for block in mesh.blocks:
        xi, weights = gauss_rule(block.element.reference, VOLUME_ORDER)
        normals = normal_vectors(mesh.points, block.element, block.connectivity, xi)
        nodes = mesh.points[block.connectivity] - origin
        positions = np.einsum("mn,end->emd", shape_functions(block.element, xi), nodes)
        shares.append(np.einsum("emd,emd,m->e", positions, normals, weights) / 3)
    return np.concatenate(shares)


def corners(cells: Sequence[tuple[str, Indices]]) -> list[Indices]:
    """Return the corner nodes, (e, 3 or 4), of each block of cells of a contact zone."""
    return [nodes[:, : 3 if name.startswith("triangle") else 4] for name, nodes in cells]


def vector_areas(points: Array) -> Array:
    """Return the integrals of the normal, (e, 3), over polygons with straight sides between points (e, m, 3).

    The polygons need not be plane.
    """
    areas = np.zeros((len(points), 3))
    for k in range(1, points.shape[1] - 1):  # triangles of the first corner and two successive ones
        one, other = points[:, k] - points[:, 0], points[:, k + 1] - points[:, 0]
        for axis in range(3):
            first, second = (axis + 1) % 3, (axis + 2) % 3
            areas[:, axis] += one[:, first] * other[:, second] - one[:, second] * other[:, first]
    return areas / 2.0
