"""Volume meshes, their boundary faces, and reading them from files."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from meeframe.plugin import N_FIELDS, Array, Indices, MeshError, TooLargeError
from meeframe.plugin.surfaces import read_any
from meeframe_skfem.elements import ELEMENTS, VolumeElement, cell_rule, face_nodes, tabulate

FLAT: Final = 1e-6  # an element's Jacobian may nowhere fall below this part of its largest

BYTES: Final = 450.0  # memory of a reduction over the power 4/3 of its unknowns, measured at 1e5 and 1.7e5 of them


@dataclass(frozen=True, eq=False)
class VolumeMesh:
    """Cells of one type. points: (p, 3) [m]; cells: (e, n) point numbers in meshio's order; element: their type."""

    points: Array
    cells: Indices
    element: VolumeElement


@dataclass(frozen=True, eq=False)
class Faces:
    """Boundary faces of a volume mesh.

    nodes: (f, k) its point numbers, counter-clockwise seen from outside; cell, local: (f,) the cell that has the face
    and the face's number there.
    """

    nodes: Indices
    cell: Indices
    local: Indices


def boundary_faces(mesh: VolumeMesh) -> Faces:
    """The faces that belong to one cell only. Raises MeshError if more than two cells share a face."""
    local_nodes, n_faces = face_nodes(mesh.element), len(mesh.element.faces)
    nodes = mesh.cells[:, local_nodes].reshape(-1, local_nodes.shape[1])
    corners = np.sort(nodes[:, : len(mesh.element.faces[0])], axis=1)
    _, number = np.unique(corners, axis=0, return_inverse=True)
    count = np.bincount(number.ravel())[number.ravel()]
    if count.max() > 2:
        raise MeshError(f"volume mesh: {np.count_nonzero(count > 2)} faces are shared by more than two cells")
    outside = np.flatnonzero(count == 1)
    return Faces(nodes[outside], outside // n_faces, outside % n_faces)


def read_volume(path: Path, length_unit: float) -> VolumeMesh:
    """The volume mesh in a file that meshio reads: cells of one of ELEMENTS; surface cells are passed over.

    length_unit: metres per unit of the file. Raises MeshError that names the file if it cannot be read, has no such
    cells or more than one type of them, cells inside out or folded, or several parts.
    """
    try:
        mesh = _convert(read_any(path), length_unit)
        check_volume(mesh)
        check_memory(len(mesh.points))
    except MeshError as error:
        raise MeshError(f"volume = {str(path)!r}: {error}") from None
    return mesh


def check_volume(mesh: VolumeMesh) -> None:
    """Raises MeshError unless all cells have positive Jacobians and hang together."""
    xi = np.concatenate([cell_rule(mesh.element)[0], mesh.element.nodes])
    slopes = tabulate(mesh.element, xi)[1]
    jacobians = np.linalg.det(np.einsum("mnk,enx->emxk", slopes, mesh.points[mesh.cells]))
    bad = jacobians.min(axis=1) <= FLAT * np.abs(jacobians).max(axis=1)
    if bad.any():
        place = mesh.points[mesh.cells[bad][0]].mean(axis=0)
        raise MeshError(
            f"{np.count_nonzero(bad)} of {len(bad)} cells are folded or inside out, the first at {place} [m]"
        )
    owner = np.repeat(np.arange(len(mesh.cells)), mesh.cells.shape[1])
    graph = coo_array((np.ones(owner.size), (owner, len(mesh.cells) + mesh.cells.ravel())), shape=(_size(mesh),) * 2)
    parts = connected_components(graph, directed=False)[0]
    if parts > 1:
        raise MeshError(f"its cells form {parts} separate parts; one body is wanted")


def check_memory(n_points: float) -> None:
    """Raises TooLargeError if a mesh of so many points needs more memory than the machine has.

    The factors grow with the power 4/3 of the unknowns (nested dissection in three dimensions); measured by pardiso.
    """
    unknowns = N_FIELDS * n_points
    needed = BYTES * unknowns ** (4 / 3)
    available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > available:
        raise TooLargeError(
            f"volume mesh: {unknowns:.3g} unknowns need about {needed / 1e9:.3g} GB; this machine has "
            f"{available / 1e9:.3g} GB: use a larger `growth`, fewer elements in the contact zone or a coarser volume"
        )


def _size(mesh: VolumeMesh) -> int:
    return len(mesh.cells) + len(mesh.points)


def _convert(data: Any, length_unit: float) -> VolumeMesh:
    known = {element.meshio_type: element for element in ELEMENTS}
    solid = [block for block in data.cells if block.dim == 3 and len(block.data)]
    found = sorted({block.type for block in solid})
    if len(found) != 1 or found[0] not in known:
        raise MeshError(f"volume cells in it: {', '.join(found) or 'none'}; allowed: one of {', '.join(known)}")
    cells = np.concatenate([np.asarray(block.data, np.int64) for block in solid])
    if cells.min() < 0 or cells.max() >= len(data.points):
        wrong = cells.min() if cells.min() < 0 else cells.max()
        raise MeshError(f"a cell has the point number {wrong}; allowed: 0 to {len(data.points) - 1}")
    used, numbers = np.unique(cells, return_inverse=True)
    points = np.asarray(data.points, float)[used] * length_unit
    if points.shape[1] != 3 or not np.isfinite(points).all():
        raise MeshError("its points are not finite and three-dimensional")
    return VolumeMesh(points, numbers.reshape(cells.shape).astype(np.int64), known[found[0]])
