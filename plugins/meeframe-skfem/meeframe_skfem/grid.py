"""Volume meshes of boxes, graded from the grid of the contact zone."""

import math
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from meeframe.plugin import Array, Body, MeshError, SurfaceElement, SurfaceMesh
from meeframe.plugin.surfaces import ElementBlock, geometric_fractions
from meeframe_skfem.elements import HEX8, HEX20, HEX27, VolumeElement
from meeframe_skfem.layers import check_thickness, interface_depths
from meeframe_skfem.shells import convert_cells, shells_around
from meeframe_skfem.volume import VolumeMesh, check_memory

Grid = Literal["tensor", "shells"]

COORDINATE_TOLERANCE: Final = 1e-9  # coordinates that differ by less than this fraction of the body's size are the same
_HEXAHEDRA: Final = {element.surface.name: element for element in (HEX8, HEX20, HEX27)}
_NODES_PER_CELL: Final = {"hex8": 1, "hex20": 4, "hex27": 8}  # in a large grid
_ALLOWED: Final = (
    "finite elements fill a box (a closed surface of six planes) whose contact zone is a rectangular grid of "
    "quad4, quad8 or quad9 on one of them, or a volume mesh in the file `volume`"
)


def box_volume(body: Body, growth: float, outside: int | None, layers: int | None, grid: Grid = "tensor") -> VolumeMesh:
    """Return the graded volume mesh of a box.

    Parameters
    ----------
    body : Body
        A box whose contact zone is a rectangular grid of elements.
    growth : float
        Largest ratio of the widths of neighbouring elements, where their number is not prescribed.
    outside : int or None
        Number of elements from the contact zone outwards, or number of shells.
    layers : int or None
        Number of elements from the contact zone downwards, for a body without layers of other materials.
    grid : {'tensor', 'shells'}
        With 'tensor', the grid lines of the contact zone extend through the entire body. The first elements outside it
        are as wide as those of the zone, those below it as their mean, and the next ones grow in a constant ratio. With
        'shells', a core of cubes lies below the zone, as deep as the zone is wide in its narrower direction. Shells
        around it grow to the box, the first one as thick as the cubes; layers of other materials do not fit them.

    Raises
    ------
    MeshError
        If the body is not a box, its contact zone is not a grid, or the memory does not suffice; the message says what
        is allowed.
    """
    if body.contact_group is None:
        raise MeshError(f"the body has no contact zone to grade a grid around; {_ALLOWED}")
    low, high = _box(body.mesh)
    element, normal, top, lines = _zone_grid(body.mesh, body.contact_group, low, high)
    if grid == "shells":
        mesh = _shells((normal, top, lines), (low, high), growth, outside)
        check_memory(_NODES_PER_CELL[element.name] * len(mesh.points), body.fields.size)
        return mesh if element is HEX8 else convert_cells(mesh, element)
    axes: list[Array] = [np.empty(0)] * 3
    for axis, coordinates in lines.items():
        steps = np.diff(coordinates)
        before = graded_positions(coordinates[0] - low[axis], steps[0], growth, outside)
        after = graded_positions(high[axis] - coordinates[-1], steps[-1], growth, outside)
        axes[axis] = np.concatenate([coordinates[0] - before[::-1], coordinates, coordinates[-1] + after])
    depths = _depths(body, high[normal] - low[normal], _mean_step(lines), growth, layers)
    axes[normal] = high[normal] - depths[::-1] if top else low[normal] + depths
    for axis in range(3):  # the exact corners of the box
        axes[axis][[0, -1]] = low[axis], high[axis]
    check_memory(_NODES_PER_CELL[element.name] * math.prod(len(axis) for axis in axes), body.fields.size)
    return tensor_grid((axes[0], axes[1], axes[2]), element)


def _depths(body: Body, depth: float, step: float, growth: float, count: int | None) -> Array:
    """Return the depths of the ends of elements below the zone, among them those of the interfaces between layers.

    The widths in a layer continue those above it. A layer thinner than the elements of the zone is one element, below
    which widths start again with those of the zone.
    """
    if body.layers.layers:
        check_thickness(body, depth)
    depths, width = [np.zeros(1)], step
    for start, end in pairwise([0.0, *interface_depths(body), depth]):
        depths.append(start + graded_positions(end - start, width, growth, count))
        width = max(step, growth * float(np.diff(np.append(start, depths[-1]))[-1]))
    return np.concatenate(depths)


def _mean_step(lines: dict[int, Array]) -> float:
    return float(np.mean([np.diff(coordinates).mean() for coordinates in lines.values()]))


def _shells(
    zone: tuple[int, bool, dict[int, Array]],
    box: tuple[Array, Array],
    growth: float,
    outside: int | None,
) -> VolumeMesh:
    """Return a mesh of shells with cells of eight nodes.

    zone: axis of the normal, True at its upper end, grid lines; box: two corners.
    """
    (normal, top, lines), (low, high) = zone, box
    step = _mean_step(lines)
    depths = step * np.arange(min(len(coordinates) for coordinates in lines.values()))
    axes = [lines.get(axis, high[axis] - depths[::-1] if top else low[axis] + depths) for axis in range(3)]
    first = np.array([axis[0] for axis in axes])
    last = np.array([axis[-1] for axis in axes])
    distances = np.delete(np.stack([first - low, high - last]).ravel(), normal + 3 * top)
    if distances.min() < step:
        raise MeshError(
            f"the cubes under the contact zone leave {distances.min():.3g} m of the box, less than an "
            f'element of {step:.3g} m, so that no shells fit; allowed: grid = "tensor"'
        )
    distance = float(distances.mean())
    core = tensor_grid((axes[0], axes[1], axes[2]), HEX8)
    plane = core.points[:, normal] == (last if top else first)[normal]
    return shells_around(core, low, high, graded_positions(distance, step, growth, outside) / distance, plane)


def graded_positions(distance: float, first: float, growth: float, count: int | None) -> Array:
    """Return the positions of the ends of elements whose widths form a geometric sequence.

    Parameters
    ----------
    distance : float
        Distance to fill.
    first : float
        Width of the first element. Widths never decrease: if `first` is too large for that, they are all equal.
    growth : float
        Largest ratio of successive widths, if `count` is None.
    count : int or None
        Number of elements, by default the smallest number that satisfies `growth`.

    Returns
    -------
    Array
        Positions, (count,).
    """
    if distance <= COORDINATE_TOLERANCE * first:
        return np.empty(0)
    if count is None:
        ratio = distance / first
        min_count = np.log1p(ratio * (growth - 1)) / np.log(growth) if growth > 1 else ratio
        count = max(1, math.ceil(min_count - 1e-9))
    return distance * geometric_fractions(distance, count, first)


def tensor_grid(axes: tuple[Array, Array, Array], element: VolumeElement) -> VolumeMesh:
    """Return hexahedra between planes at rising coordinates, (nx + 1,), (ny + 1,) and (nz + 1,)."""
    counts = [len(axis) - 1 for axis in axes]
    # number the nodes on the grid of half cells, then remove those that no element uses
    half = [np.interp(np.arange(2 * n + 1) / 2, np.arange(n + 1), axis) for n, axis in zip(counts, axes, strict=True)]
    shape = tuple(len(axis) for axis in half)
    points = np.stack(np.meshgrid(*half, indexing="ij"), axis=-1).reshape(-1, 3)
    corner = np.stack(np.meshgrid(*(2 * np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    indices = corner + np.rint(2 * element.nodes).astype(np.int64)
    cells = np.ravel_multi_index(tuple(indices[..., axis] for axis in range(3)), shape)
    node_numbers, numbers = np.unique(cells, return_inverse=True)
    return VolumeMesh(points[node_numbers], numbers.reshape(cells.shape).astype(np.int64), element)


def _box(mesh: SurfaceMesh) -> tuple[Array, Array]:
    """Return the lowest and the highest corner of a box, (3,) each; raise MeshError for other bodies."""
    if mesh.semi_infinite:
        raise MeshError(f"a semi-infinite body has no volume mesh without [base] or `depth`; {_ALLOWED}")
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    tolerance = COORDINATE_TOLERANCE * float((high - low).max())
    deviation = np.minimum(np.abs(mesh.points - low), np.abs(mesh.points - high)).min(axis=1)
    if (deviation > tolerance).any():
        position = mesh.points[deviation.argmax()]
        raise MeshError(f"the body is not a box, since its surface has a point at {position} [m]; {_ALLOWED}")
    return low, high


def _zone_grid(
    mesh: SurfaceMesh, group: str, low: Array, high: Array
) -> tuple[VolumeElement, int, bool, dict[int, Array]]:
    """Return element, axis of the normal, True for the zone at its upper end, and grid lines along the other axes."""
    block = _only_block(mesh, group)
    points = mesh.points[block.connectivity[:, :4]]
    tolerance = COORDINATE_TOLERANCE * float((high - low).max())
    flat = [axis for axis in range(3) if np.ptp(points[..., axis]) <= tolerance]
    if len(flat) != 1:
        raise MeshError(f"contact zone {group!r} is not in one plane of the box; {_ALLOWED}")
    normal = flat[0]
    lines = {axis: _distinct(points[..., axis].ravel(), tolerance) for axis in range(3) if axis != normal}
    # each cell of the grid is one element: their numbers agree, and each lies between neighbouring lines
    spans = []
    for axis, coordinates in lines.items():
        first, last = (np.abs(np.subtract.outer(end, coordinates)).argmin(axis=1) for end in _ends(points[..., axis]))
        spans.append((first, last))
    cells = {(int(i), int(j)) for i, j in zip(spans[0][0], spans[1][0], strict=True)}
    expected = int(np.prod([len(coordinates) - 1 for coordinates in lines.values()]))
    square = all((last == first + 1).all() for first, last in spans)
    if not (square and len(cells) == len(points) == expected):
        raise MeshError(f"contact zone {group!r} is not a rectangular grid of elements; {_ALLOWED}")
    return _HEXAHEDRA[block.element.name], normal, bool(points[0, 0, normal] > low[normal] + tolerance), lines


def _ends(coordinates: Array) -> tuple[Array, Array]:
    return coordinates.min(axis=1), coordinates.max(axis=1)


def _only_block(mesh: SurfaceMesh, group: str) -> ElementBlock:
    """Return the elements of a face group, which must all be of one type that is a face of a hexahedron."""
    index = mesh.group(group)
    blocks = [(block.element, block.connectivity[block.groups == index]) for block in mesh.blocks]
    selected = [(element, cells) for element, cells in blocks if len(cells)]
    if len(selected) != 1 or selected[0][0].name not in _HEXAHEDRA:
        names = _names([element for element, _ in selected])
        raise MeshError(f"contact zone {group!r} is made of {names}; {_ALLOWED}")
    element, cells = selected[0]
    return ElementBlock(element, cells, np.full(len(cells), index))


def _names(elements: list[SurfaceElement]) -> str:
    return ", ".join(element.name for element in elements) or "no elements"


def _distinct(values: Array, tolerance: float) -> Array:
    """Return the distinct values in rising order."""
    ordered = np.sort(values)
    return ordered[np.diff(ordered, prepend=-np.inf) > tolerance]
