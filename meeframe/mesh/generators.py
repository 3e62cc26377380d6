"""Mesh generators: the graded block of the paper (Fig. 2), a plain box and a sphere."""

from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np

from meeframe.common.errors import MeshError
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.mesh.lattice import border, framed, grid_points, prism, require, side_of_border, with_element
from meeframe.mesh.surface import SurfaceMesh

BLOCK_GROUPS: Final = ("contact", "top", "side_x-", "side_x+", "side_y-", "side_y+", "base")
BOX_GROUPS: Final = ("x-", "x+", "y-", "y+", "z-", "z+")

Pair = float | tuple[float, float]
WholePair = int | tuple[int, int]


@dataclass(frozen=True)
class Grading:
    """Growth of the elements of a block away from the contact zone.

    first_ring: width of the first ring of elements around the contact zone over the element size inside it; 1 (the
    default) continues the zone with square elements, larger values spread a given number of rings more evenly. The
    widths of the rings form a geometric sequence from there to the edge of the block.
    layer_growth: ratio of the heights of successive layers down the sides; above 1 they are finer at the top.
    Raises CaseError unless both are above zero.
    """

    first_ring: Annotated[float, Quantity("", gt=0)] = 1.0
    layer_growth: Annotated[float, Quantity("", gt=0)] = 1.5

    def __post_init__(self) -> None:
        check_quantities(self)


def block_mesh(
    half_width: Pair,
    height: float,
    contact_width: Pair,
    divisions: WholePair,
    rings: int,
    layers: int,
    element: SurfaceElement,
    grading: Grading | None = None,
) -> SurfaceMesh:
    """Return the block with a fine contact zone in the middle of its top face (paper, section 7.1 and Fig. 2).

    The block is 2 half_width wide and `height` high [m]; its top face lies in x3 = 0, its base in x3 = -height, centred
    on the x3 axis. The contact zone, contact_width wide, has `divisions` equal elements a side; `rings` rings of
    elements lead from it to the edges of the top, `layers` layers down the sides; the base repeats `divisions`.
    half_width, contact_width and divisions are one number or an (x1, x2) pair. Face groups: BLOCK_GROUPS.
    The paper's 1088 elements: block_mesh(0.05, 0.12, 0.005, 16, rings, layers, Quad4()) with rings + layers = 9.
    Raises MeshError.
    """
    half, contact, cells = _pair(half_width), _pair(contact_width), _whole_pair(divisions)
    _check_sizes(half, height, contact)
    require("layers", (layers,), at_least=1)
    grading = grading or Grading()
    top, ring_loops = _top(half, contact, cells, rings, grading)
    base = grid_points(half, cells, -float(height))
    downward = np.cumsum(grading.layer_growth ** np.arange(layers))
    downward /= downward[-1]
    layer_loops = (1 - downward)[:, None, None] * ring_loops[-1] + downward[:, None, None] * border(base)
    sides = side_of_border(cells, (4, 3, 5, 2))
    strips = np.concatenate([np.ones((rings, len(sides)), np.int64), np.tile(sides, (layers, 1))])
    surface = prism(top, np.concatenate([ring_loops, layer_loops]), base, (0, strips, 6), BLOCK_GROUPS)
    return with_element(surface, element)


def _top(
    half: tuple[float, float], contact: tuple[float, float], cells: tuple[int, int], rings: int, grading: Grading
) -> tuple[Array, Array]:
    """Return the points of the contact zone, (nx + 1, ny + 1, 3), and of the loops around it, (rings, 2 nx + 2 ny,
    3)."""
    for name, counts in (("divisions", cells), ("rings", (rings,))):
        require(name, counts, at_least=1)
    top = grid_points((contact[0] / 2, contact[1] / 2), cells, 0.0)
    # equal rays from the border of the zone to the edge: all widths scale with their mean
    distance = sum(half) / 2 - sum(contact) / 4
    first = grading.first_ring * (contact[0] / cells[0] + contact[1] / cells[1]) / 2
    outward = geometric_fractions(distance, rings, first)[:, None, None]
    return top, (1 - outward) * border(top) + outward * border(grid_points(half, cells, 0.0))


def _check_sizes(half_width: tuple[float, float], height: float, contact_width: tuple[float, float]) -> None:
    for name, sizes in (("half_width", half_width), ("height", (height,)), ("contact_width", contact_width)):
        require(name, sizes)
    for contact, half in zip(contact_width, half_width, strict=True):
        if not contact < 2 * half:
            raise MeshError(f"contact_width = {contact!r}: must be less than the block's width, {2 * half!r}")


def half_space_mesh(
    half_width: Pair,
    contact_width: Pair,
    divisions: WholePair,
    rings: int,
    element: SurfaceElement,
    grading: Grading | None = None,
) -> SurfaceMesh:
    """Return the top face of `block_mesh` alone, a part of the plane x3 = 0 that bounds the half space x3 < 0.

    Face groups 'contact' and 'top'. Raises MeshError.
    """
    half, contact, cells = _pair(half_width), _pair(contact_width), _whole_pair(divisions)
    _check_sizes(half, 1.0, contact)
    surface = framed(*_top(half, contact, cells, rings, grading or Grading()), BLOCK_GROUPS[:2])
    return replace(with_element(surface, element), semi_infinite=True)


def box_mesh(
    sizes: tuple[float, float, float], divisions: tuple[int, int, int], element: SurfaceElement
) -> SurfaceMesh:
    """Return the box centred at the origin with equal divisions along each edge. Face groups: BOX_GROUPS. Raises
    MeshError."""
    require("sizes", sizes)
    require("divisions", divisions, at_least=1)
    half, cells = (sizes[0] / 2, sizes[1] / 2), (divisions[0], divisions[1])
    levels = sizes[2] / 2 * (np.arange(-divisions[2], divisions[2] + 1, 2) / divisions[2])[::-1]
    top, base = grid_points(half, cells, levels[0]), grid_points(half, cells, levels[-1])
    loops = np.stack([border(grid_points(half, cells, level)) for level in levels[1:]])
    strips = np.tile(side_of_border(cells, (2, 1, 3, 0)), (divisions[2], 1))
    return with_element(prism(top, loops, base, (5, strips, 4), BOX_GROUPS), element)


def sphere_mesh(radius: float, divisions: int, element: SurfaceElement) -> SurfaceMesh:
    """Return the sphere about the origin: a cube of divisions^2 cells a face, equal in angle, blown up; group
    'surface'.

    All nodes, those between the corners included, lie on the sphere to round-off. Raises MeshError.
    """
    require("radius", (radius,))
    cube = box_mesh((2.0, 2.0, 2.0), (divisions, divisions, divisions), element)
    blown = np.tan(np.pi / 4 * cube.points)
    points = radius * blown / np.linalg.norm(blown, axis=1, keepdims=True)
    blocks = tuple(type(b)(b.element, b.connectivity, np.zeros_like(b.groups)) for b in cube.blocks)
    return SurfaceMesh(points, blocks, ("surface",))


def geometric_fractions(total: float, count: int, first: float) -> Array:
    """Return the positions in (0, 1] after each of `count` widths that sum to total, geometric from `first` on.

    Widths never shrink outwards: where `first` is too wide for that they are equal.
    """
    if count == 1 or first * count >= total:
        return np.arange(1, count + 1) / count
    powers = np.arange(count)
    most = (total / first) ** (1 / (count - 1))
    # Newton's method from above: the sum of the powers is convex, so that ratios fall until round-off stops them
    ratio, before = most, np.inf
    while ratio < before:
        before, excess = ratio, np.sum(ratio**powers) - total / first
        ratio -= excess / np.sum(powers * ratio ** (powers - 1))
    sums = np.cumsum(ratio**powers)
    fractions: Array = sums / sums[-1]
    return fractions


def _pair(value: Pair) -> tuple[float, float]:
    return (value[0], value[1]) if isinstance(value, tuple | list) else (value, value)


def _whole_pair(value: WholePair) -> tuple[int, int]:
    return (value[0], value[1]) if isinstance(value, tuple | list) else (value, value)
