"""Surface meshes from files that meshio reads."""

import contextlib
import gzip
import io
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path
from threading import Lock
from typing import IO, Any, Final

import numpy as np

from meeframe.common.errors import MeshError
from meeframe.common.files import MAX_EXPANDED_BYTES, bounded_decompression
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Indices
from meeframe.mesh.checks import check_mesh, merge_points, orient_outward, remove_unused_points
from meeframe.mesh.references import check_references
from meeframe.mesh.surface import ElementBlock, SurfaceMesh

DEFAULT_GROUP = "surface"
# prefixes of the meshio names of cells that are not surfaces
_LOWER_DIMENSIONS = ("vertex", "line", "VTK_LAGRANGE_CURVE")
_VOLUME_CELLS = ("tetra", "hexahedron", "wedge", "pyramid", "polyhedron")
_MAX_READS_AT_END = 1000
"""Number of reads at the end of a file after which a reader is taken to search for missing data without end."""
_READ_LOCK: Final = Lock()
"""Lock of the reader: redirecting output and replacing a function of meshio affect all threads."""


def read_mesh(
    path: str | PathLike[str],
    elements: Iterable[SurfaceElement],
    *,
    length_unit: float = 1.0,
    merge_tolerance: float | None = None,
    group_data: str | None = None,
    reorient: bool = False,
) -> SurfaceMesh:
    """Read and check the surface mesh in a file.

    All formats of meshio are supported, and files with several element types. Points, lines and volume cells are
    ignored.

    Parameters
    ----------
    path : path-like
        The file.
    elements : iterable of SurfaceElement
        Element types to choose from, by their `meshio_type`.
    length_unit : float
        Metres per unit of length of the file.
    merge_tolerance : float, optional
        Merge points closer than this [m]. By default coinciding points are an error.
    group_data : str, optional
        Name of a cell array of integers that defines face groups NAME_1, NAME_2, .... By default, face groups are the
        cell sets or the physical groups (gmsh) of the file; elements in no group form the group 'surface'.
    reorient : bool
        Flip surfaces that are inside out.

    Returns
    -------
    SurfaceMesh
        The mesh.

    Raises
    ------
    MeshError
        If the file cannot be read or its mesh is not valid; the message names the file.
    """
    file = Path(path)
    try:
        if not (np.isfinite(length_unit) and length_unit > 0):
            raise MeshError(f"length_unit = {length_unit!r}: must be a positive number of metres")
        data = read_any(file)
        mesh = remove_unused_points(_convert(data, elements, length_unit, group_data))
        if merge_tolerance is not None:
            mesh = merge_points(mesh, merge_tolerance)
        if reorient:
            mesh = orient_outward(mesh)
        check_mesh(mesh)
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from None
    except OverflowError:
        raise MeshError(f"{file}: it contains an integer of more than 64 bits; allowed: smaller ones") from None
    return mesh


def read_any(file: Path) -> Any:
    """Read a file by meshio.

    Parameters
    ----------
    file : Path
        The file.

    Returns
    -------
    meshio.Mesh
        All points and cells of the file.

    Raises
    ------
    MeshError
        If meshio cannot read the file, prints an error or exits, or if the file refers to files in other folders.
    """
    import meshio  # slow to import (0.25 s), so that only those who read files wait

    try:
        if not file.is_file():
            raise MeshError("no such file")
    except PermissionError as error:
        raise MeshError(f"cannot be read: {error.strerror}") from None
    if file.suffix.lower() == ".wkt":
        raise MeshError(
            "format wkt: its reader may take forever for damaged files; allowed: another format, such as vtu"
        )
    check_references(file)
    output = io.StringIO()
    try:
        with _READ_LOCK, contextlib.redirect_stdout(output), contextlib.redirect_stderr(output), _finite_files(meshio):
            _check_gzip(file)
            return meshio.read(file)
    except MeshError:
        raise
    except (Exception, SystemExit) as error:
        text = " ".join(output.getvalue().split()) or str(error) or type(error).__name__
        raise MeshError(f"meshio cannot read it: {text}") from None


class _FiniteFile(io.FileIO):
    """A file that raises an error when a reader of meshio loops at the end of a truncated file."""

    reads_at_end = 0

    def readinto(self, buffer: Any, /) -> int | None:
        """Read into a buffer; raise EOFError after too many reads at the end of the file."""
        count = super().readinto(buffer)
        self.reads_at_end = 0 if count else self.reads_at_end + 1
        if self.reads_at_end > _MAX_READS_AT_END:
            raise EOFError("the file ends too early")
        return count


def _open(path: str, mode: str = "r") -> IO[Any]:
    """Open a file for reading, instead of the built-in function."""
    source = io.BufferedReader(_FiniteFile(path))
    return source if "b" in mode else io.TextIOWrapper(source)


@contextlib.contextmanager
def _finite_files(meshio: Any) -> Iterator[None]:
    """Let meshio open files by `_open` and expand them within bounds, in this context."""
    meshio._files.open = _open
    try:
        with bounded_decompression("meshio"):
            yield
    finally:
        del meshio._files.open


def _check_gzip(file: Path) -> None:
    """Raise MeshError if a file that gzip compressed expands too far; its reader expands all of it."""
    if file.suffix.lower() == ".gz":
        with gzip.open(file) as content:
            size = 0
            while block := content.read(2**20):
                size += len(block)
                if size > MAX_EXPANDED_BYTES:
                    raise MeshError(f"it expands to more than {MAX_EXPANDED_BYTES} bytes")


def _convert(data: Any, elements: Iterable[SurfaceElement], length_unit: float, group_data: str | None) -> SurfaceMesh:
    points = np.asarray(data.points, float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise MeshError("points are not three-dimensional")
    element_types = {element.meshio_type: element for element in elements}
    selected = [k for k, cells in enumerate(data.cells) if _is_surface(cells.type, element_types)]
    if any(np.ndim(data.cells[k].data) != 2 for k in selected):
        raise MeshError("its elements are no tables of node numbers")
    if not selected or sum(len(data.cells[k].data) for k in selected) == 0:
        available = ", ".join(sorted({cells.type for cells in data.cells})) or "none"
        raise MeshError(f"no surface elements; cells in the file: {available}; allowed: {', '.join(element_types)}")
    labels = _labels(data, selected, group_data)
    names = tuple(sorted({name for block in labels for name in block}))
    blocks = tuple(
        ElementBlock(
            element_types[data.cells[k].type], np.asarray(data.cells[k].data, np.int64), _numbers(block, names)
        )
        for k, block in zip(selected, labels, strict=True)
    )
    return SurfaceMesh(points * length_unit, blocks, names)


def _is_surface(cell_type: str, element_types: dict[str, SurfaceElement]) -> bool:
    if cell_type in element_types:
        return True
    if cell_type.startswith(_LOWER_DIMENSIONS) or cell_type.lower().removeprefix("vtk_lagrange_").startswith(
        _VOLUME_CELLS
    ):
        return False
    raise MeshError(f"cells of type {cell_type!r} are not supported; allowed: {', '.join(element_types)}")


def _numbers(labels: list[str], names: tuple[str, ...]) -> Indices:
    return np.array([names.index(name) for name in labels], np.int64)


def _labels(data: Any, selected: list[int], group_data: str | None) -> list[list[str]]:
    """Return the face group of each element of the selected cell blocks."""
    if group_data is not None:
        if group_data not in data.cell_data:
            available = ", ".join(data.cell_data) or "none"
            raise MeshError(f"group_data = {group_data!r}: no such cell array in the file; it has: {available}")
        numbers = [np.ravel(data.cell_data[group_data][k]) for k in selected]
        fraction = next((v for block in numbers for v in block if not float(v).is_integer()), None)
        if fraction is not None:
            raise MeshError(f"group_data = {group_data!r}: it contains {fraction:g}; allowed: integers")
        return [[f"{group_data}_{int(v)}" for v in block] for block in numbers]
    sets = {name: members for name, members in data.cell_sets.items() if not name.startswith("gmsh:")}
    if sets:
        return [_labels_from_sets(sets, k, len(data.cells[k].data)) for k in selected]
    if "gmsh:physical" in data.cell_data:
        tags = {int(tag): name for name, (tag, dimension) in data.field_data.items() if dimension == 2}
        tags[0] = DEFAULT_GROUP  # gmsh: in no physical group
        return [[tags.get(int(v), f"physical_{int(v)}") for v in data.cell_data["gmsh:physical"][k]] for k in selected]
    return [[DEFAULT_GROUP] * len(data.cells[k].data) for k in selected]


def _labels_from_sets(sets: dict[str, Any], block: int, count: int) -> list[str]:
    labels = [""] * count
    for name, members in sets.items():
        for element in np.asarray([] if members[block] is None else members[block], np.int64):
            if labels[element]:
                raise MeshError(f"an element is in two face groups, {labels[element]!r} and {name!r}")
            labels[element] = name
    return [label or DEFAULT_GROUP for label in labels]
