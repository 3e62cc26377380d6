"""Mesh generators: the graded block of the paper (Fig. 2), a plain box and a sphere."""

import math
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Annotated, Final, Literal

import numpy as np

from meeframe.common.errors import MeshError, TooLargeError
from meeframe.common.memory import usable_memory
from meeframe.elements.base import SurfaceElement
from meeframe.elements.lagrange import Quad4
from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.mesh.lattice import (
    border_sides,
    check_values,
    frame_surface,
    grid_points,
    place_nodes,
    prism_surface,
)
from meeframe.mesh.regular import GridPoints, border_entries
from meeframe.mesh.surface import GridBlocks, SurfaceMesh

BLOCK_GROUPS: Final = ("contact", "top", "side_x-", "side_x+", "side_y-", "side_y+", "base")
BOX_GROUPS: Final = ("x-", "x+", "y-", "y+", "z-", "z+")

BASE_BYTES: Final = 270_000_000
"""Memory of Python, its libraries and compiled kernels."""
BYTES_PER_NODE: Final = 145
"""Memory of a run without friction, conduction, figures and fields, per node of the grid of a half space."""

PerAxis = float | tuple[float, float]
CountPerAxis = int | tuple[int, int]


@dataclass(frozen=True)
class Grading:
    """Growth of the elements of a block away from the contact zone.

    Attributes
    ----------
    first_ring : float
        Width of the first ring of elements around the contact zone over the element size inside it. The default, 1,
        continues the zone with square elements; larger values spread the rings more evenly. The widths of the rings
        form a geometric sequence from there to the border of the block.
    layer_growth : float
        Ratio of the heights of successive layers down the sides; with values above 1 they are finer at the top.

    Raises
    ------
    CaseError
        If one of them is not positive.
    """

    first_ring: Annotated[float, Quantity("", gt=0)] = 1.0
    layer_growth: Annotated[float, Quantity("", gt=0)] = 1.5

    def __post_init__(self) -> None:
        check_quantities(self)


def block_mesh(
    half_width: PerAxis,
    height: float,
    contact_width: PerAxis,
    divisions: CountPerAxis,
    rings: int,
    layers: int,
    element: SurfaceElement,
    grading: Grading | None = None,
) -> SurfaceMesh:
    """Return a block with a fine contact zone in the middle of its top face (paper, section 7.1 and Fig. 2).

    The block is centred on the x3 axis; its top face lies in x3 = 0 and its base in x3 = -height.

    Parameters
    ----------
    half_width : float or tuple of float
        Half the width of the block [m], one number or one for x1 and one for x2.
    height : float
        Height of the block [m].
    contact_width : float or tuple of float
        Width of the contact zone [m], one number or one for x1 and one for x2.
    divisions : int or tuple of int
        Number of equal elements along each side of the contact zone, and of the base.
    rings, layers : int
        Number of rings of elements from the contact zone to the border of the top face, and of layers down the sides.
    element : SurfaceElement
        Element type.
    grading : Grading, optional
        Growth of the elements away from the contact zone.

    Returns
    -------
    SurfaceMesh
        The mesh, with the face groups BLOCK_GROUPS.

    Raises
    ------
    MeshError
        If a size or a number is out of bounds.

    Notes
    -----
    The mesh of 1088 elements in the paper is block_mesh(0.05, 0.12, 0.005, 16, rings, layers, Quad4()) with
    rings + layers = 9.
    """
    half, contact, cells = _lengths_per_axis(half_width), _lengths_per_axis(contact_width), _counts_per_axis(divisions)
    _check_sizes(half, height, contact)
    check_values("layers", (layers,), at_least=1)
    grading = grading or Grading()
    top, ring_loops = _top(half, contact, cells, rings, grading)
    base = grid_points(half, cells, -float(height))
    downward = np.cumsum(grading.layer_growth ** np.arange(layers))
    downward /= downward[-1]
    layer_loops = (1 - downward)[:, None, None] * ring_loops[-1] + downward[:, None, None] * border_entries(base)
    sides = border_sides(cells, (4, 3, 5, 2))
    strips = np.concatenate([np.ones((rings, len(sides)), np.int64), np.tile(sides, (layers, 1))])
    surface = prism_surface(top, np.concatenate([ring_loops, layer_loops]), base, (0, strips, 6), BLOCK_GROUPS)
    return place_nodes(surface, element)


def _top(
    half: tuple[float, float], contact: tuple[float, float], cells: tuple[int, int], rings: int, grading: Grading
) -> tuple[Array, Array]:
    """Return the points of the contact zone (nx + 1, ny + 1, 3) and of loops around it (rings, 2 nx + 2 ny, 3)."""
    for name, counts in (("divisions", cells), ("rings", (rings,))):
        check_values(name, counts, at_least=1)
    top = grid_points((contact[0] / 2, contact[1] / 2), cells, 0.0)
    # a ring has one relative width along the border of the zone: all widths scale with their mean
    distance = sum(half) / 2 - sum(contact) / 4
    first = grading.first_ring * (contact[0] / cells[0] + contact[1] / cells[1]) / 2
    outward = geometric_fractions(distance, rings, first)[:, None, None]
    return top, (1 - outward) * border_entries(top) + outward * border_entries(grid_points(half, cells, 0.0))


def _check_sizes(half_width: tuple[float, float], height: float, contact_width: tuple[float, float]) -> None:
    for name, sizes in (("half_width", half_width), ("height", (height,)), ("contact_width", contact_width)):
        check_values(name, sizes)
    for contact, half in zip(contact_width, half_width, strict=True):
        if not contact < 2 * half:
            raise MeshError(f"contact_width = {contact!r}: must be less than the block's width, {2 * half!r}")


def half_space_mesh(
    half_width: PerAxis,
    contact_width: PerAxis,
    divisions: CountPerAxis,
    rings: int,
    element: SurfaceElement,
    grading: Grading | None = None,
) -> SurfaceMesh:
    """Return the top face of `block_mesh` alone, in the plane x3 = 0 that bounds the half space x3 < 0.

    Parameters
    ----------
    half_width : float or tuple of float
        Half the width of the face [m], one number or one for x1 and one for x2.
    contact_width : float or tuple of float
        Width of the contact zone [m], one number or one for x1 and one for x2.
    divisions : int or tuple of int
        Number of equal elements along each side of the contact zone.
    rings : int
        Number of rings of elements from the contact zone to the border of the face.
    element : SurfaceElement
        Element type.
    grading : Grading, optional
        Growth of the rings away from the contact zone.

    Returns
    -------
    SurfaceMesh
        The mesh, with the face groups 'contact' and 'top'.

    Raises
    ------
    MeshError
        If a size or a number is out of bounds, or as TooLargeError if a run needs more memory than the process may use.
    """
    half, contact, cells = _lengths_per_axis(half_width), _lengths_per_axis(contact_width), _counts_per_axis(divisions)
    _check_sizes(half, 1.0, contact)
    check_grid_memory(f"divisions = {cells[0]} x {cells[1]}", (cells[0] + 1) * (cells[1] + 1))
    grid, loops = _top(half, contact, cells, rings, grading or Grading())
    names = BLOCK_GROUPS[:2]
    if isinstance(element, Quad4):
        x, y = grid[:, 0, 0].copy(), grid[0, :, 1].copy()  # views would keep the whole grid
        points = GridPoints.make(x, y, loops.reshape(-1, 3))
        shape = cells[0] + 1, cells[1] + 1
        return SurfaceMesh(points, GridBlocks(element, points, shape, rings), names, semi_infinite=True)
    return replace(place_nodes(frame_surface(grid, loops, names), element), semi_infinite=True)


def check_grid_memory(
    label: str, nodes: int, bytes_per_node: int = BYTES_PER_NODE, purpose: Literal["run", "surface"] = "run"
) -> None:
    """Raise TooLargeError if a run or a surface on a grid of so many nodes needs more memory than the process may use.

    Parameters
    ----------
    label : str
        Beginning of the message, such as a key with its value.
    nodes : int
        Number of nodes.
    bytes_per_node : int, optional
        Memory per node; by default that of a run without friction, conduction, figures and fields.
    purpose : {'run', 'surface'}, optional
        What needs the memory, for the message.
    """
    required, available = BASE_BYTES + nodes * bytes_per_node, usable_memory()
    if required > available:
        most = math.isqrt(max(available - BASE_BYTES, 0) // bytes_per_node)
        gigabytes = Decimal(required) / 10**9  # which may exceed the largest float
        raise TooLargeError(
            f"{label}: a {purpose} with {nodes} nodes needs at least {gigabytes:.3g} GB; this process may use "
            f"{available / 1e9:.3g} GB; allowed: about {most} x {most} nodes"
        )


def box_mesh(
    sizes: tuple[float, float, float], divisions: tuple[int, int, int], element: SurfaceElement
) -> SurfaceMesh:
    """Return a box centred at the origin, with equal divisions along each edge.

    Parameters
    ----------
    sizes : tuple of float
        Lengths of the edges along x1, x2 and x3 [m].
    divisions : tuple of int
        Number of elements along each of them.
    element : SurfaceElement
        Element type.

    Returns
    -------
    SurfaceMesh
        The mesh, with the face groups BOX_GROUPS.

    Raises
    ------
    MeshError
        If a size or a number is out of bounds.
    """
    check_values("sizes", sizes)
    check_values("divisions", divisions, at_least=1)
    half, cells = (sizes[0] / 2, sizes[1] / 2), (divisions[0], divisions[1])
    levels = sizes[2] / 2 * (np.arange(-divisions[2], divisions[2] + 1, 2) / divisions[2])[::-1]
    top, base = grid_points(half, cells, levels[0]), grid_points(half, cells, levels[-1])
    loops = np.stack([border_entries(grid_points(half, cells, level)) for level in levels[1:]])
    strips = np.tile(border_sides(cells, (2, 1, 3, 0)), (divisions[2], 1))
    return place_nodes(prism_surface(top, loops, base, (5, strips, 4), BOX_GROUPS), element)


def sphere_mesh(radius: float, divisions: int, element: SurfaceElement) -> SurfaceMesh:
    """Return a sphere about the origin: a cube with cells of equal angles, projected onto the sphere.

    Parameters
    ----------
    radius : float
        Radius [m].
    divisions : int
        Number of elements along each edge of the cube.
    element : SurfaceElement
        Element type. All nodes lie on the sphere to round-off, those between the corners included.

    Returns
    -------
    SurfaceMesh
        The mesh, with the face group 'surface'.

    Raises
    ------
    MeshError
        If a size or a number is out of bounds.
    """
    check_values("radius", (radius,))
    cube = box_mesh((2.0, 2.0, 2.0), (divisions, divisions, divisions), element)
    stretched = np.tan(np.pi / 4 * cube.points)
    points = radius * stretched / np.linalg.norm(stretched, axis=1, keepdims=True)
    blocks = tuple(type(b)(b.element, b.connectivity, np.zeros_like(b.groups)) for b in cube.blocks)
    return SurfaceMesh(points, blocks, ("surface",))


def geometric_fractions(total: float, count: int, first: float) -> Array:
    """Return relative positions of the ends of widths that form a geometric sequence.

    Parameters
    ----------
    total : float
        Sum of the widths.
    count : int
        Number of widths.
    first : float
        First width. Widths never decrease: if `first` is too large for that, they are all equal.

    Returns
    -------
    Array
        Positions, (count,), rising to 1.
    """
    if count == 1 or first * count >= total:
        return np.arange(1, count + 1) / count
    powers = np.arange(count)
    # Newton's method from above: the sum of the powers is convex, so that the ratio falls until round-off stops it
    ratio, previous = (total / first) ** (1 / (count - 1)), np.inf
    while ratio < previous:
        previous, excess = ratio, np.sum(ratio**powers) - total / first
        ratio -= excess / np.sum(powers * ratio ** (powers - 1))
    sums = np.cumsum(ratio**powers)
    fractions: Array = sums / sums[-1]
    return fractions


def _lengths_per_axis(value: PerAxis) -> tuple[float, float]:
    return (value[0], value[1]) if isinstance(value, tuple | list) else (value, value)


def _counts_per_axis(value: CountPerAxis) -> tuple[int, int]:
    return (value[0], value[1]) if isinstance(value, tuple | list) else (value, value)
