"""Files of VTK's unstructured grids, written array by array and block by block."""

import base64
import zlib
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final
from xml.sax.saxutils import quoteattr

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

from meeframe.fields import Array, Indices
from meeframe.mesh.regular import Cells, GridCells
from meeframe.results.hdf5 import is_compressible

VTK_CELLS: Final = {"triangle": 5, "triangle6": 22, "quad": 9, "quad8": 23, "quad9": 28}
"""VTK's numbers of meshio's cell types whose nodes have the same order in both."""
_TYPES: Final = {
    "f8": "Float64",
    "f4": "Float32",
    "i8": "Int64",
    "i4": "Int32",
    "i1": "Int8",
    "u1": "UInt8",
    "b1": "Int8",
}
_BLOCK: Final = 1 << 20
"""Largest size in bytes of the blocks that are compressed one by one."""
_INTEGER: Final = np.int32
"""Numbers of points in files: half the size of those of numpy, and enough for half a billion cells."""


def write_vtu(path: Path, points: Array, cells: Cells, data: Iterable[tuple[str, NDArray[Any]]]) -> None:
    """Write an unstructured grid with fields at its points.

    Arrays are made, compressed and written block by block. They are compressed only where that halves them, so that
    compression does not determine the time.

    Parameters
    ----------
    path : Path
        File to write.
    points : Array
        Positions, (p, 3).
    cells : sequence of tuple
        Cell type, a key of VTK_CELLS, and connectivity of each block.
    data : iterable of tuple
        Name and values, (p,) or (p, k), of each field. Fields are taken and written one by one.
    """
    connectivity, offsets, types = _numbered(cells)
    with path.open("wb") as file:
        file.write(
            b'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" '
            b'header_type="UInt64" compressor="vtkZLibDataCompressor"><UnstructuredGrid>'
            + f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(types)}">\n<Points>'.encode()
        )
        _write_array(file, "Points", points, components=3)
        file.write(b"</Points>\n<Cells>")
        _write_array(file, "connectivity", connectivity)
        _write_array(file, "offsets", offsets)
        _write_array(file, "types", types)
        file.write(b"</Cells>\n<PointData>")
        for name, values in data:
            _write_array(file, name, values, components=values.shape[1] if values.ndim == 2 else 0)
        file.write(b"</PointData>\n</Piece></UnstructuredGrid></VTKFile>\n")


@dataclass(frozen=True)
class _Rows:
    """Array whose rows are made when they are read: take returns those of a slice of the first `count` numbers."""

    count: int
    take: Callable[[Indices], NDArray[Any]]

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        return self.take(np.arange(*rows.indices(self.count)))

    @property
    def nbytes(self) -> int:
        return self.count * self[:1].nbytes


def _numbered(cells: Cells) -> tuple["_Rows | NDArray[Any]", ...]:
    """Return VTK's connectivity, offsets and types of cells."""
    if isinstance(cells, GridCells):
        return (
            _Rows(cells.n_cells, lambda numbers: cells.nodes(numbers).astype(_INTEGER)),
            _Rows(cells.n_cells, lambda numbers: (4 * (numbers + 1)).astype(_INTEGER)),
            _Rows(cells.n_cells, lambda numbers: np.full(len(numbers), VTK_CELLS["quad"], np.uint8)),
        )
    sizes = [nodes.shape for _, nodes in cells]
    counts = np.repeat([size[1] for size in sizes], [size[0] for size in sizes])
    types = np.repeat([VTK_CELLS[name] for name, _ in cells], [size[0] for size in sizes])
    nodes = np.concatenate([nodes.ravel() for _, nodes in cells])
    return nodes.astype(_INTEGER), np.cumsum(counts, dtype=_INTEGER), types.astype(np.uint8)


def _write_array(file: BinaryIO, name: str, values: "_Rows | NDArray[Any]", components: int = 0) -> None:
    """Write an array, compressed block by block; the sizes of the blocks precede them."""
    first = values[:1]
    width = first.dtype.itemsize * int(np.prod(first.shape[1:]))
    per_block = max(1, _BLOCK // width)
    starts = range(0, len(values), per_block)
    sizes = np.zeros(3 + len(starts), "<u8")
    if starts:
        sizes[:3] = len(starts), per_block * width, (len(values) - starts[-1]) * width
    numbers = f' NumberOfComponents="{components}"' if components else ""
    kind = _TYPES[first.dtype.str[1:]]
    file.write(f'<DataArray type="{kind}" Name={quoteattr(name)}{numbers} format="binary">'.encode())
    begin = file.tell()
    file.write(base64.b64encode(sizes.tobytes()))
    level, rest = int(is_compressible(values)), b""

    def compressed(start: int) -> bytes:
        return zlib.compress(np.ascontiguousarray(values[start : start + per_block]).tobytes(), level)

    with ThreadPoolExecutor(get_num_threads()) as pool:
        for block, data in enumerate(pool.map(compressed, starts), 3):
            sizes[block] = len(data)
            rest += data
            end = len(rest) - len(rest) % 3  # bytes that base64 encodes without padding
            file.write(base64.b64encode(rest[:end]))
            rest = rest[end:]
    file.write(base64.b64encode(rest))
    end = file.tell()
    file.seek(begin)
    file.write(base64.b64encode(sizes.tobytes()))
    file.seek(end)
    file.write(b"</DataArray>\n")
