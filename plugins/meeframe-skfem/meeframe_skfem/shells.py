"""The volume mesh of a box from a core of cubes under the contact zone and shells around it that grow to the box."""

from itertools import pairwise

import numpy as np

from meeframe.plugin import Array
from meeframe_skfem.elements import HEX8, VolumeElement, tabulate
from meeframe_skfem.volume import VolumeMesh, boundary_faces


def shells_around(core: VolumeMesh, low: Array, high: Array, fractions: Array, open_face: Array) -> VolumeMesh:
    """Fill a box with a core and shells of hex8 cells around it.

    Parameters
    ----------
    core : VolumeMesh
        A box of hex8 cells.
    low, high : Array
        Corners of the box to fill, (3,) each.
    fractions : Array
        End of each shell as a fraction of the distance from the surface of the core to the box, (k,), the last one 1.
        Each point of the surface moves on a straight line to its image under the affine map of the core onto the box.
    open_face : Array
        Points of the core in the face that core and box have in common, (p,) bool.

    Returns
    -------
    VolumeMesh
        The mesh, including the core.
    """
    faces = boundary_faces(core).nodes
    faces = faces[~open_face[faces].all(axis=1)]
    surface, local = np.unique(faces, return_inverse=True)
    inner = core.points[surface]
    first, last = core.points.min(axis=0), core.points.max(axis=0)
    outer = low + (inner - first) * ((high - low) / (last - first))
    points = [core.points, *((1 - fraction) * inner + fraction * outer for fraction in fractions)]
    numbers = [surface, *(len(core.points) + len(surface) * k + np.arange(len(surface)) for k in range(len(fractions)))]
    local = local.reshape(faces.shape)
    # faces are counter-clockwise seen from outside, as the first four corners of a cell are seen from its last four
    cells = [np.hstack([lower[local], upper[local]]) for lower, upper in pairwise(numbers)]
    return VolumeMesh(np.concatenate(points), np.concatenate([core.cells, *cells]), HEX8)


def convert_cells(mesh: VolumeMesh, element: VolumeElement) -> VolumeMesh:
    """Convert straight hex8 cells to another hexahedron.

    Each node is the mean of the corners whose trilinear functions do not vanish there: those of a corner, an edge, a
    face or the cell. Cells that share these corners share the node.
    """
    shares = tabulate(HEX8, element.nodes)[0]
    parents = [np.flatnonzero(share > 0.0) for share in shares]
    cells = np.empty((len(mesh.cells), len(parents)), np.int64)
    points: list[Array] = []
    for count in sorted({len(corners) for corners in parents}):
        local = [node for node, corners in enumerate(parents) if len(corners) == count]
        groups = np.sort(mesh.cells[:, [parents[node] for node in local]], axis=-1)
        distinct, number = np.unique(groups.reshape(-1, count), axis=0, return_inverse=True)
        cells[:, local] = number.reshape(len(cells), -1) + sum(map(len, points))
        points.append(mesh.points[distinct].mean(axis=1))
    return VolumeMesh(np.concatenate(points), cells, element)
