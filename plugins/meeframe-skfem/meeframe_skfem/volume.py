"""Volume meshes, their boundary faces, and a reader of files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from meeframe.plugin import Array, Indices, MeshError, TooLargeError, usable_memory
from meeframe.plugin.surfaces import read_any
from meeframe_skfem.elements import ELEMENTS, VolumeElement, cell_rule, face_nodes, tabulate

MIN_JACOBIAN_RATIO: Final = 1e-6  # least Jacobian of an element relative to its largest

BYTES_PER_UNKNOWN: Final = 450.0  # memory of a reduction over unknowns^(4/3), measured at 1e5 and 1.7e5 unknowns


@dataclass(frozen=True, eq=False)
class VolumeMesh:
    """A volume mesh with cells of one type.

    Attributes
    ----------
    points : Array
        Positions, (p, 3) [m].
    cells : Indices
        Point numbers, (e, n), in the order of meshio.
    element : VolumeElement
        Type of the cells.
    """

    points: Array
    cells: Indices
    element: VolumeElement


@dataclass(frozen=True, eq=False)
class Faces:
    """Boundary faces of a volume mesh.

    Attributes
    ----------
    nodes : Indices
        Point numbers, (f, k), counter-clockwise seen from outside.
    cell, local : Indices
        Cell of each face, and number of the face in the cell, (f,).
    """

    nodes: Indices
    cell: Indices
    local: Indices


def boundary_faces(mesh: VolumeMesh) -> Faces:
    """Return the faces that belong to one cell only.

    Raises
    ------
    MeshError
        If more than two cells share a face.
    """
    local_nodes, n_faces = face_nodes(mesh.element), len(mesh.element.faces)
    nodes = mesh.cells[:, local_nodes].reshape(-1, local_nodes.shape[1])
    corners = np.sort(nodes[:, : len(mesh.element.faces[0])], axis=1)
    _, number = np.unique(corners, axis=0, return_inverse=True)
    count = np.bincount(number.ravel())[number.ravel()]
    if count.max() > 2:
        raise MeshError(f"volume mesh: {np.count_nonzero(count > 2)} faces are shared by more than two cells")
    outside = np.flatnonzero(count == 1)
    return Faces(nodes[outside], outside // n_faces, outside % n_faces)


def read_volume(path: Path, length_unit: float, n_fields: int) -> VolumeMesh:
    """Read the volume mesh in a file that meshio supports; surface cells are ignored.

    Parameters
    ----------
    path : Path
        The file, with cells of one of ELEMENTS.
    length_unit : float
        Metres per unit of length of the file.
    n_fields : int
        Number of fields of the body.

    Raises
    ------
    MeshError
        If the file cannot be read, has no such cells or several types of them, cells that are inside out or folded, or
        separate parts; the message names the file.
    """
    try:
        mesh = _convert(read_any(path), length_unit)
        check_volume(mesh)
        check_memory(len(mesh.points), n_fields)
    except MeshError as error:
        raise MeshError(f"volume = {str(path)!r}: {error}") from None
    return mesh


def check_volume(mesh: VolumeMesh) -> None:
    """Check that all cells have positive Jacobians and form one connected body.

    Raises
    ------
    MeshError
        If they do not.
    """
    xi = np.concatenate([cell_rule(mesh.element)[0], mesh.element.nodes])
    slopes = tabulate(mesh.element, xi)[1]
    jacobians = np.linalg.det(np.einsum("mnk,enx->emxk", slopes, mesh.points[mesh.cells]))
    bad = jacobians.min(axis=1) <= MIN_JACOBIAN_RATIO * np.abs(jacobians).max(axis=1)
    if bad.any():
        centre = mesh.points[mesh.cells[bad][0]].mean(axis=0)
        raise MeshError(
            f"{np.count_nonzero(bad)} of {len(bad)} cells are folded or inside out, the first at {centre} [m]"
        )
    cell = np.repeat(np.arange(len(mesh.cells)), mesh.cells.shape[1])
    graph = coo_array((np.ones(cell.size), (cell, len(mesh.cells) + mesh.cells.ravel())), shape=(_size(mesh),) * 2)
    n_components = connected_components(graph, directed=False)[0]
    if n_components > 1:
        raise MeshError(f"the cells form {n_components} separate parts; allowed: one")


def check_memory(n_points: float, n_fields: int) -> None:
    """Check that the memory that this process may use suffices for `n_fields` fields on a mesh of `n_points` points.

    Raises
    ------
    TooLargeError
        If it does not.

    Notes
    -----
    The size of the factors grows with the power 4/3 of the unknowns (nested dissection in three dimensions). The factor
    is measured with pardiso.
    """
    unknowns = n_fields * n_points
    required = BYTES_PER_UNKNOWN * unknowns ** (4 / 3)
    available = usable_memory()
    if required > available:
        raise TooLargeError(
            f"volume mesh: {unknowns:.3g} unknowns need about {required / 1e9:.3g} GB; this process may use "
            f"{available / 1e9:.3g} GB: use a larger `growth`, fewer elements in the contact zone or a coarser volume"
        )


def _size(mesh: VolumeMesh) -> int:
    return len(mesh.cells) + len(mesh.points)


def _convert(data: Any, length_unit: float) -> VolumeMesh:
    elements = {element.meshio_type: element for element in ELEMENTS}
    solid = [block for block in data.cells if block.dim == 3 and len(block.data)]
    types = sorted({block.type for block in solid})
    if len(types) != 1 or types[0] not in elements:
        raise MeshError(
            f"volume cells in the file: {', '.join(types) or 'none'}; allowed: one of {', '.join(elements)}"
        )
    cells = np.concatenate([np.asarray(block.data, np.int64) for block in solid])
    if cells.min() < 0 or cells.max() >= len(data.points):
        invalid = cells.min() if cells.min() < 0 else cells.max()
        raise MeshError(f"a cell has point number {invalid}; allowed: 0 to {len(data.points) - 1}")
    point_numbers, numbers = np.unique(cells, return_inverse=True)
    points = np.asarray(data.points, float)[point_numbers] * length_unit
    if points.shape[1] != 3 or not np.isfinite(points).all():
        raise MeshError("points are not finite and three-dimensional")
    return VolumeMesh(points, numbers.reshape(cells.shape).astype(np.int64), elements[types[0]])
