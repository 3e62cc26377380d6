"""Surface meshes from files, by meshio."""

import contextlib
import io
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path
from threading import Lock
from typing import IO, Any, Final

import numpy as np

from meeframe.common.errors import MeshError
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Indices
from meeframe.mesh.checks import check_mesh, drop_unused, merge_points, orient_outward
from meeframe.mesh.surface import ElementBlock, SurfaceMesh

UNNAMED = "surface"
# how names of meshio's cells begin that are not surfaces
_LOWER = ("vertex", "line", "VTK_LAGRANGE_CURVE")
_SOLID = ("tetra", "hexahedron", "wedge", "pyramid", "polyhedron")
_PATIENCE = 1000
"""How often a file is read beyond its end before that is taken for an endless search for what is missing."""
_READING: Final = Lock()
"""Threads read one after the other: they share where they print, and meshio's modules."""


def read_mesh(
    path: str | PathLike[str],
    elements: Iterable[SurfaceElement],
    *,
    length_unit: float = 1.0,
    merge_tolerance: float | None = None,
    group_data: str | None = None,
    reorient: bool = False,
) -> SurfaceMesh:
    """Return the checked surface mesh in any file that meshio reads; formats with mixed element types too.

    elements: the element types to choose from, by their meshio_type. length_unit: metres per unit of the file.
    merge_tolerance: merge points closer than this [m]; None refuses coinciding points. group_data: name of a cell array
    of whole numbers that makes face groups NAME_1, NAME_2, ...; by default groups are the file's cell sets or gmsh's
    physical groups, and elements without any form the group 'surface'. reorient: flip surfaces that are inside out.
    Points, lines and volume cells are passed over. Raises MeshError, which names the file.
    """
    file = Path(path)
    try:
        if not (np.isfinite(length_unit) and length_unit > 0):
            raise MeshError(f"length_unit = {length_unit!r}: must be a positive number of metres")
        data = read_any(file)
        mesh = drop_unused(_convert(data, elements, length_unit, group_data))
        if merge_tolerance is not None:
            mesh = merge_points(mesh, merge_tolerance)
        if reorient:
            mesh = orient_outward(mesh)
        check_mesh(mesh)
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from None
    return mesh


def read_any(file: Path) -> Any:
    """Return meshio's mesh of a file; its printing and its exits become errors. Raises MeshError."""
    import meshio  # a quarter of a second to start: only for those who read files

    try:
        if not file.is_file():
            raise MeshError("no such file")
    except PermissionError as error:
        raise MeshError(f"cannot be read: {error.strerror}") from None
    said = io.StringIO()
    try:
        with _READING, contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), _ends(meshio):
            return meshio.read(file)
    except (Exception, SystemExit) as error:
        text = " ".join(said.getvalue().split()) or str(error) or type(error).__name__
        raise MeshError(f"meshio cannot read it: {text}") from None


class _Source(io.FileIO):
    """A file that is not read beyond its end for ever, as readers of meshio do where a file is cut off."""

    beyond = 0

    def readinto(self, buffer: Any, /) -> int | None:
        """Read as from any file; raise EOFError after too many reads at the end of the file."""
        count = super().readinto(buffer)
        self.beyond = 0 if count else self.beyond + 1
        if self.beyond > _PATIENCE:
            raise EOFError("the file ends too early")
        return count


def _open(path: str, mode: str = "r") -> IO[Any]:
    """Open a file for reading, in place of the built-in function."""
    source = io.BufferedReader(_Source(path))
    return source if "b" in mode else io.TextIOWrapper(source)


@contextlib.contextmanager
def _ends(meshio: Any) -> Iterator[None]:
    """Return meshio opens files that end."""
    meshio._files.open = _open
    try:
        yield
    finally:
        del meshio._files.open


def _convert(data: Any, elements: Iterable[SurfaceElement], length_unit: float, group_data: str | None) -> SurfaceMesh:
    points = np.asarray(data.points, float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise MeshError("its points are not three-dimensional")
    known = {element.meshio_type: element for element in elements}
    kept = [k for k, cells in enumerate(data.cells) if _is_surface(cells.type, known)]
    if not kept or sum(len(data.cells[k].data) for k in kept) == 0:
        found = ", ".join(sorted({cells.type for cells in data.cells})) or "none"
        raise MeshError(f"no surface elements; cells in the file: {found}; wanted: {', '.join(known)}")
    labels = _labels(data, kept, group_data)
    names = tuple(sorted({name for part in labels for name in part}))
    blocks = tuple(
        ElementBlock(known[data.cells[k].type], np.asarray(data.cells[k].data, np.int64), _numbers(part, names))
        for k, part in zip(kept, labels, strict=True)
    )
    return SurfaceMesh(points * length_unit, blocks, names)


def _is_surface(cell_type: str, known: dict[str, SurfaceElement]) -> bool:
    if cell_type in known:
        return True
    if cell_type.startswith(_LOWER) or cell_type.lower().removeprefix("vtk_lagrange_").startswith(_SOLID):
        return False
    raise MeshError(f"cells of type {cell_type!r} are not among the element types: {', '.join(known)}")


def _numbers(labels: list[str], names: tuple[str, ...]) -> Indices:
    return np.array([names.index(name) for name in labels], np.int64)


def _labels(data: Any, kept: list[int], group_data: str | None) -> list[list[str]]:
    """Return the face group of each element of the kept cell blocks."""
    if group_data is not None:
        if group_data not in data.cell_data:
            found = ", ".join(data.cell_data) or "none"
            raise MeshError(f"group_data = {group_data!r}: no such cell array in the file; it has: {found}")
        numbers = [np.ravel(data.cell_data[group_data][k]) for k in kept]
        odd = next((v for block in numbers for v in block if not float(v).is_integer()), None)
        if odd is not None:
            raise MeshError(f"group_data = {group_data!r}: {odd:g} in it; allowed: whole numbers")
        return [[f"{group_data}_{int(v)}" for v in block] for block in numbers]
    sets = {name: members for name, members in data.cell_sets.items() if not name.startswith("gmsh:")}
    if sets:
        return [_labels_from_sets(sets, k, len(data.cells[k].data)) for k in kept]
    if "gmsh:physical" in data.cell_data:
        tags = {int(tag): name for name, (tag, dimension) in data.field_data.items() if dimension == 2}
        tags[0] = UNNAMED  # gmsh's way of saying: in no physical group
        return [[tags.get(int(v), f"physical_{int(v)}") for v in data.cell_data["gmsh:physical"][k]] for k in kept]
    return [[UNNAMED] * len(data.cells[k].data) for k in kept]


def _labels_from_sets(sets: dict[str, Any], block: int, count: int) -> list[str]:
    labels = [""] * count
    for name, members in sets.items():
        for element in np.asarray([] if members[block] is None else members[block], np.int64):
            if labels[element]:
                raise MeshError(f"an element is in two face groups, {labels[element]!r} and {name!r}")
            labels[element] = name
    return [label or UNNAMED for label in labels]
