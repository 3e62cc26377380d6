"""The volume mesh of a box as shells: a core of cubes under the contact zone, and copies of it that grow to the box."""

from itertools import pairwise

import numpy as np

from meeframe.plugin import Array
from meeframe_skfem.elements import HEX8, VolumeElement, tabulate
from meeframe_skfem.volume import VolumeMesh, boundary_faces


def shells_around(core: VolumeMesh, low: Array, high: Array, fractions: Array, open_face: Array) -> VolumeMesh:
    """hex8 between a core and the box around it, core included.

    core: a box of hex8; low, high: (3,) corners of the body's box; fractions: (k,) of the way from the core's surface
    to the box, where each shell ends, the last 1: every point of the surface goes straight to where the affine map of
    the core onto the box takes it; open_face: (p,) bool, the core's points in the face that both have in common.
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
    # faces go counter-clockwise seen from outside, and so do the first four corners of a cell seen from its last four
    cells = [np.hstack([below[local], above[local]]) for below, above in pairwise(numbers)]
    return VolumeMesh(np.concatenate(points), np.concatenate([core.cells, *cells]), HEX8)


def with_nodes_between(mesh: VolumeMesh, element: VolumeElement) -> VolumeMesh:
    """Straight cells of hex8 with the nodes of another hexahedron.

    A node is the mean of the corners whose trilinear functions do not vanish there: those of a corner, an edge, a face
    or of the cell. Cells that share these corners share the node.
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
