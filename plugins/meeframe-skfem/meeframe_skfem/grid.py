"""The volume mesh of a box: a graded tensor grid whose lines on the contact zone are those of the surface mesh."""

import math
from typing import Final, Literal

import numpy as np

from meeframe.plugin import Array, Body, MeshError, SurfaceElement, SurfaceMesh
from meeframe.plugin.surfaces import ElementBlock, geometric_fractions
from meeframe_skfem.elements import HEX8, HEX20, HEX27, VolumeElement
from meeframe_skfem.shells import shells_around, with_nodes_between
from meeframe_skfem.volume import VolumeMesh, check_memory

Grid = Literal["tensor", "shells"]

SAME: Final = 1e-9  # coordinates within this part of the body's size are the same
_HEXAHEDRA: Final = {element.surface.name: element for element in (HEX8, HEX20, HEX27)}
_NODES_PER_CELL: Final = {"hex8": 1, "hex20": 4, "hex27": 8}  # in a large grid
_ALLOWED: Final = (
    "finite elements fill a box (a closed surface of six planes) whose contact zone is a rectangular grid of "
    "quad4, quad8 or quad9 on one of them, or a volume mesh given by `volume`"
)


def box_volume(body: Body, growth: float, outside: int | None, layers: int | None, grid: Grid = "tensor") -> VolumeMesh:
    """The graded grid of a box.

    'tensor': the grid lines of the contact zone go through the whole body. From its edges outwards and from its plane
    downwards the first elements are as wide as the zone's (downwards: as their mean), the next ones wider in a constant
    ratio: at most `growth`, or what makes `outside` or `layers` elements fill the distance.
    'shells': a core of cubes beneath the zone, as deep as it is wide (the narrower way); shells around it grow into the
    box, the first as thick as the cubes, the next ones thicker likewise; `outside` is how many.
    Raises MeshError, saying what is allowed, if the body is no box, its zone no grid, or the machine too small.
    """
    if body.contact_group is None:
        raise MeshError(f"the body has no contact zone to grade a grid around; {_ALLOWED}")
    low, high = _box(body.mesh)
    element, normal, top, lines = _zone_grid(body.mesh, body.contact_group, low, high)
    if grid == "shells":
        return _shells(element, (normal, top, lines), (low, high), growth, outside)
    axes: list[Array] = [np.empty(0)] * 3
    for axis, inside in lines.items():
        steps = np.diff(inside)
        below = graded(inside[0] - low[axis], steps[0], growth, outside)
        above = graded(high[axis] - inside[-1], steps[-1], growth, outside)
        axes[axis] = np.concatenate([inside[0] - below[::-1], inside, inside[-1] + above])
    down = np.concatenate([[0.0], graded(high[normal] - low[normal], _mean_step(lines), growth, layers)])
    axes[normal] = high[normal] - down[::-1] if top else low[normal] + down
    for axis in range(3):  # the corners of the box to the last bit
        axes[axis][[0, -1]] = low[axis], high[axis]
    check_memory(_NODES_PER_CELL[element.name] * math.prod(len(axis) for axis in axes))
    return tensor_grid((axes[0], axes[1], axes[2]), element)


def _mean_step(lines: dict[int, Array]) -> float:
    return float(np.mean([np.diff(inside).mean() for inside in lines.values()]))


def _shells(
    element: VolumeElement,
    zone: tuple[int, bool, dict[int, Array]],
    box: tuple[Array, Array],
    growth: float,
    outside: int | None,
) -> VolumeMesh:
    """zone: axis along its normal, whether it is at the upper end, grid lines; box: lowest and highest corner."""
    (normal, top, lines), (low, high) = zone, box
    step = _mean_step(lines)
    down = step * np.arange(min(len(inside) for inside in lines.values()))
    axes = [lines.get(axis, high[axis] - down[::-1] if top else low[axis] + down) for axis in range(3)]
    first = np.array([axis[0] for axis in axes])
    last = np.array([axis[-1] for axis in axes])
    room = np.delete(np.stack([first - low, high - last]).ravel(), normal + 3 * top)
    if room.min() < step:
        raise MeshError(
            f"below and around the cube under the contact zone there are {room.min():.3g} m of the box, less than an "
            f'element of {step:.3g} m, and no room for shells; allowed: grid = "tensor"'
        )
    distance = float(room.mean())
    core = tensor_grid((axes[0], axes[1], axes[2]), HEX8)
    plane = core.points[:, normal] == (last if top else first)[normal]
    mesh = shells_around(core, low, high, graded(distance, step, growth, outside) / distance, plane)
    check_memory(_NODES_PER_CELL[element.name] * len(mesh.points))
    return mesh if element is HEX8 else with_nodes_between(mesh, element)


def graded(distance: float, first: float, growth: float, count: int | None) -> Array:
    """Positions after each of the elements that fill a distance, their widths in a constant ratio, (count,).

    The first is `first` wide, or less if there is no room. count: of the elements; None takes the fewest whose ratio is
    at most `growth`. Widths never shrink outwards: where `first` is too wide for that they are equal.
    """
    if distance <= SAME * first:
        return np.empty(0)
    if count is None:
        room = distance / first
        fewest = np.log1p(room * (growth - 1)) / np.log(growth) if growth > 1 else room
        count = max(1, math.ceil(fewest - 1e-9))
    return distance * geometric_fractions(distance, count, first)


def tensor_grid(axes: tuple[Array, Array, Array], element: VolumeElement) -> VolumeMesh:
    """Hexahedra between the planes at rising coordinates, (nx + 1,), (ny + 1,), (nz + 1,)."""
    counts = [len(axis) - 1 for axis in axes]
    # numbers of the nodes on the grid of half cells, those that no element has left out afterwards
    half = [np.interp(np.arange(2 * n + 1) / 2, np.arange(n + 1), axis) for n, axis in zip(counts, axes, strict=True)]
    shape = tuple(len(axis) for axis in half)
    points = np.stack(np.meshgrid(*half, indexing="ij"), axis=-1).reshape(-1, 3)
    corner = np.stack(np.meshgrid(*(2 * np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    places = corner + np.rint(2 * element.nodes).astype(np.int64)
    cells = np.ravel_multi_index(tuple(places[..., axis] for axis in range(3)), shape)
    used, numbers = np.unique(cells, return_inverse=True)
    return VolumeMesh(points[used], numbers.reshape(cells.shape).astype(np.int64), element)


def _box(mesh: SurfaceMesh) -> tuple[Array, Array]:
    """Lowest and highest corner of a body that is a box, (3,) each."""
    if mesh.semi_infinite:
        raise MeshError(f"a semi-infinite body has no volume mesh; {_ALLOWED}")
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    tolerance = SAME * float((high - low).max())
    off = np.minimum(np.abs(mesh.points - low), np.abs(mesh.points - high)).min(axis=1)
    if (off > tolerance).any():
        place = mesh.points[off.argmax()]
        raise MeshError(f"the body is no box, its surface has a point at {place} [m]; {_ALLOWED}")
    return low, high


def _zone_grid(
    mesh: SurfaceMesh, group: str, low: Array, high: Array
) -> tuple[VolumeElement, int, bool, dict[int, Array]]:
    """Element, axis along the normal, whether the zone is at its upper end, grid lines along the other two axes."""
    block = _only_block(mesh, group)
    points = mesh.points[block.connectivity[:, :4]]
    tolerance = SAME * float((high - low).max())
    flat = [axis for axis in range(3) if np.ptp(points[..., axis]) <= tolerance]
    if len(flat) != 1:
        raise MeshError(f"contact zone {group!r} is not in one plane of the box; {_ALLOWED}")
    normal = flat[0]
    lines = {axis: _distinct(points[..., axis].ravel(), tolerance) for axis in range(3) if axis != normal}
    # every cell of the grid is one element: as many of them, each between neighbouring lines
    spans = []
    for axis, inside in lines.items():
        first, last = (np.abs(np.subtract.outer(end, inside)).argmin(axis=1) for end in _ends(points[..., axis]))
        spans.append((first, last))
    cells = {(int(i), int(j)) for i, j in zip(spans[0][0], spans[1][0], strict=True)}
    wanted = int(np.prod([len(inside) - 1 for inside in lines.values()]))
    square = all((last == first + 1).all() for first, last in spans)
    if not (square and len(cells) == len(points) == wanted):
        raise MeshError(f"contact zone {group!r} is no rectangular grid of elements; {_ALLOWED}")
    return _HEXAHEDRA[block.element.name], normal, bool(points[0, 0, normal] > low[normal] + tolerance), lines


def _ends(coordinates: Array) -> tuple[Array, Array]:
    return coordinates.min(axis=1), coordinates.max(axis=1)


def _only_block(mesh: SurfaceMesh, group: str) -> ElementBlock:
    """The elements of a face group, which all are of one type that a hexahedron has as its face."""
    index = mesh.group(group)
    blocks = [(block.element, block.connectivity[block.groups == index]) for block in mesh.blocks]
    chosen = [(element, cells) for element, cells in blocks if len(cells)]
    if len(chosen) != 1 or chosen[0][0].name not in _HEXAHEDRA:
        names = _names([element for element, _ in chosen])
        raise MeshError(f"contact zone {group!r} is made of {names}; {_ALLOWED}")
    element, cells = chosen[0]
    return ElementBlock(element, cells, np.full(len(cells), index))


def _names(elements: list[SurfaceElement]) -> str:
    return ", ".join(element.name for element in elements) or "no elements"


def _distinct(values: Array, tolerance: float) -> Array:
    """Rising values, each once."""
    ordered = np.sort(values)
    return ordered[np.diff(ordered, prepend=-np.inf) > tolerance]
