"""The volume elements: shape functions and quadrature from scikit-fem, numbered as meshio numbers their nodes."""

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
    """An isoparametric Lagrange element.

    name: short name; meshio_type: meshio's name, whose order the nodes have; surface: the element of its faces;
    nodes: (n, 3) in the reference domain; faces: corners of each, counter-clockwise seen from outside;
    quadrature: degree of the rule, of positive weights, which integrates its stiffness if its edges are straight and
    parallel, and its gradients in any case; basis: scikit-fem's element, by its name.
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
        """Corners; they come first among the nodes."""
        return 1 + max(corner for face in self.faces for corner in face)


def tabulate(element: VolumeElement, xi: Array) -> tuple[Array, Array]:
    """Shape functions (m, n) and their derivatives (m, n, 3) at reference points xi (m, 3)."""
    order = _order_in_skfem(element)
    basis = _basis(element)
    pairs = [basis.lbasis(xi.T, i) for i in order]
    ones = np.ones(len(xi))
    values = np.stack([value * ones for value, _ in pairs], axis=1)
    derivatives = np.stack([np.stack([part * ones for part in slope], axis=-1) for _, slope in pairs], axis=1)
    return values, derivatives


def cell_rule(element: VolumeElement, degree: int | None = None) -> tuple[Array, Array]:
    """Points (m, 3) and weights (m,) of scikit-fem's rule of a degree, by default the element's own."""
    from skfem.quadrature import get_quadrature  # type: ignore[import-untyped]

    points, weights = get_quadrature(_basis(element).refdom, degree or element.quadrature)
    return np.asarray(points.T, float), np.asarray(weights, float)


@lru_cache(maxsize=8)
def face_nodes(element: VolumeElement) -> Indices:
    """Nodes of each face in the order of the surface element, counter-clockwise seen from outside, (faces, k)."""
    linear = Quad4() if element.surface.reference == "quadrilateral" else Tri3()
    shares = shape_functions(linear, element.surface.nodes)
    places = np.array([shares @ element.nodes[list(face)] for face in element.faces])
    distance = np.linalg.norm(element.nodes - places[:, :, None], axis=-1)
    return np.asarray(distance.argmin(axis=-1), np.int64)


@lru_cache(maxsize=8)
def _basis(element: VolumeElement) -> Any:
    """Scikit-fem's element."""
    import skfem  # type: ignore[import-untyped]  # slow to import; not by whoever only registers this formulation

    return getattr(skfem, element.basis)()


@lru_cache(maxsize=8)
def _order_in_skfem(element: VolumeElement) -> tuple[int, ...]:
    """Number of scikit-fem's shape function for each node."""
    distance = np.linalg.norm(element.nodes[:, None] - _basis(element).doflocs, axis=2)
    return tuple(int(number) for number in distance.argmin(axis=1))


def _nodes(corners: Corners, *between: Corners) -> Array:
    """Corners, then the middles of edges, faces and the body, each given by its corners."""
    at = np.array(corners, float)
    nodes = np.array([*at, *(at[list(group)].mean(axis=0) for groups in between for group in groups)])
    nodes.setflags(write=False)
    return nodes


_WHOLE: Final = (tuple(range(8)),)
HEX8: Final = VolumeElement("hex8", "hexahedron", Quad4(), _nodes(_CUBE), _CUBE_FACES, 3, "ElementHex1")
HEX20: Final = VolumeElement(
    "hex20", "hexahedron20", Quad8(), _nodes(_CUBE, _CUBE_EDGES), _CUBE_FACES, 5, "ElementHexS2"
)
HEX27: Final = VolumeElement(
    "hex27", "hexahedron27", Quad9(), _nodes(_CUBE, _CUBE_EDGES, _CUBE_FACES, _WHOLE), _CUBE_FACES, 5, "ElementHex2"
)
TET10: Final = VolumeElement(
    "tet10", "tetra10", Tri6(), _nodes(_SIMPLEX, _SIMPLEX_EDGES), _SIMPLEX_FACES, 5, "ElementTetP2"
)

ELEMENTS: Final = (HEX8, HEX20, HEX27, TET10)
"""All of them. The nodes of meshio's hexahedron27 are those of VTK: edges, faces x-, x+, y-, y+, z-, z+, centre."""
