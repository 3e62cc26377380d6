"""Volume elements, with shape functions and quadrature from scikit-fem and the node numbers of meshio."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np

from meeframe.plugin import Array, Indices, SurfaceElement
from meeframe.plugin.surfaces import Quad4, Quad8, Quad9, Tri3, Tri6, shape_functions

Corners = tuple[tuple[int, ...], ...]

# reference domains of scikit-fem: the cube [0, 1]^3 and the tetrahedron with corners at 0 and the unit vectors
_CUBE: Final = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
_CUBE_FACES: Final = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7))
_CUBE_EDGES: Final = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_SIMPLEX: Final = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
_SIMPLEX_FACES: Final = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
_SIMPLEX_EDGES: Final = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))


@dataclass(frozen=True, eq=False)
class VolumeElement:
    """An isoparametric Lagrange element of the volume.

    Attributes
    ----------
    name : str
        Short name.
    meshio_type : str
        Name in meshio, whose node order is used.
    surface : SurfaceElement
        Element of its faces.
    nodes : Array
        Nodes in the reference domain, (n, 3).
    faces : tuple of tuple of int
        Corners of each face, counter-clockwise seen from outside.
    quadrature : int
        Degree of the rule, with positive weights, which integrates the stiffness exactly if the edges are straight and
        parallel, and gradients for all shapes.
    basis : str
        Name of the element in scikit-fem.
    """

    name: str
    meshio_type: str
    surface: SurfaceElement
    nodes: Array
    faces: Corners
    quadrature: int
    basis: str

    @property
    def n_corners(self) -> int:
        """Number of corners, which are the first nodes."""
        return 1 + max(corner for face in self.faces for corner in face)


def tabulate(element: VolumeElement, xi: Array) -> tuple[Array, Array]:
    """Return shape functions (m, n) and their derivatives (m, n, 3) at reference points xi (m, 3)."""
    order = _order_in_skfem(element)
    basis = _basis(element)
    results = [basis.lbasis(xi.T, i) for i in order]
    ones = np.ones(len(xi))
    values = np.stack([value * ones for value, _ in results], axis=1)
    derivatives = np.stack([np.stack([column * ones for column in slope], axis=-1) for _, slope in results], axis=1)
    return values, derivatives


def cell_rule(element: VolumeElement, degree: int | None = None) -> tuple[Array, Array]:
    """Return points (m, 3) and weights (m,) of the rule of a degree, by default that of the element."""
    from skfem.quadrature import get_quadrature  # type: ignore[import-untyped]

    points, weights = get_quadrature(_basis(element).refdom, degree or element.quadrature)
    return np.asarray(points.T, float), np.asarray(weights, float)


@lru_cache(maxsize=8)
def face_nodes(element: VolumeElement) -> Indices:
    """Return the nodes of each face, (faces, k), in the order of the surface element."""
    linear = Quad4() if element.surface.reference == "quadrilateral" else Tri3()
    weights_of_corners = shape_functions(linear, element.surface.nodes)
    positions = np.array([weights_of_corners @ element.nodes[list(face)] for face in element.faces])
    distance = np.linalg.norm(element.nodes - positions[:, :, None], axis=-1)
    return np.asarray(distance.argmin(axis=-1), np.int64)


@lru_cache(maxsize=8)
def _basis(element: VolumeElement) -> Any:
    """Return the element of scikit-fem."""
    import skfem  # type: ignore[import-untyped]  # slow to import; not by whoever only registers this formulation

    return getattr(skfem, element.basis)()


@lru_cache(maxsize=8)
def _order_in_skfem(element: VolumeElement) -> tuple[int, ...]:
    """Return the number of the shape function in scikit-fem for each node."""
    distance = np.linalg.norm(element.nodes[:, None] - _basis(element).doflocs, axis=2)
    return tuple(int(number) for number in distance.argmin(axis=1))


def _nodes(corners: Corners, *inner: Corners) -> Array:
    """Return corners, then centres of edges, faces and cell, which are defined by their corners."""
    positions = np.array(corners, float)
    nodes = np.array([*positions, *(positions[list(group)].mean(axis=0) for groups in inner for group in groups)])
    nodes.setflags(write=False)
    return nodes


_CELL: Final = (tuple(range(8)),)
HEX8: Final = VolumeElement("hex8", "hexahedron", Quad4(), _nodes(_CUBE), _CUBE_FACES, 3, "ElementHex1")
HEX20: Final = VolumeElement(
    "hex20", "hexahedron20", Quad8(), _nodes(_CUBE, _CUBE_EDGES), _CUBE_FACES, 5, "ElementHexS2"
)
HEX27: Final = VolumeElement(
    "hex27", "hexahedron27", Quad9(), _nodes(_CUBE, _CUBE_EDGES, _CUBE_FACES, _CELL), _CUBE_FACES, 5, "ElementHex2"
)
TET10: Final = VolumeElement(
    "tet10", "tetra10", Tri6(), _nodes(_SIMPLEX, _SIMPLEX_EDGES), _SIMPLEX_FACES, 5, "ElementTetP2"
)

ELEMENTS: Final = (HEX8, HEX20, HEX27, TET10)
"""All volume elements; hexahedron27 has the node order of VTK: edges, faces x-, x+, y-, y+, z-, z+, centre."""
