"""Files of VTK's unstructured grids, written array by array and block by block."""

import base64
import zlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, TextIO
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array, Indices
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
"""Size in bytes of the blocks that are compressed one by one."""


def write_vtu(
    path: Path,
    points: Array,
    cells: Sequence[tuple[str, Indices]],
    data: Iterable[tuple[str, NDArray[Any]]],
) -> None:
    """Write an unstructured grid with fields at its points.

    Arrays are compressed only where that halves them, so that compression does not determine the time.

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
    sizes = [nodes.shape for _, nodes in cells]
    with path.open("w", encoding="utf-8") as file:
        file.write(
            '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" '
            'header_type="UInt64" compressor="vtkZLibDataCompressor"><UnstructuredGrid>'
            f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{sum(size[0] for size in sizes)}">\n<Points>'
        )
        _write_array(file, "Points", points)
        file.write("</Points>\n<Cells>")
        _write_array(file, "connectivity", np.concatenate([nodes.ravel() for _, nodes in cells]))
        counts = np.repeat([size[1] for size in sizes], [size[0] for size in sizes])
        _write_array(file, "offsets", np.cumsum(counts, dtype=np.int64))
        types = np.repeat([VTK_CELLS[name] for name, _ in cells], [size[0] for size in sizes])
        _write_array(file, "types", types.astype(np.uint8))
        file.write("</Cells>\n<PointData>")
        for name, values in data:
            _write_array(file, name, values)
        file.write("</PointData>\n</Piece></UnstructuredGrid></VTKFile>\n")


def _write_array(file: TextIO, name: str, values: NDArray[Any]) -> None:
    values = np.ascontiguousarray(values)
    kind = _TYPES[values.dtype.str[1:]]
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    file.write(f'<DataArray type="{kind}" Name={quoteattr(name)}{components} format="binary">')
    blocks = list(_compressed(values))
    last = values.nbytes % _BLOCK or min(values.nbytes, _BLOCK)
    header = np.array([len(blocks), _BLOCK, last, *map(len, blocks)], "<u8")
    file.write(base64.b64encode(header.tobytes()).decode("ascii"))
    file.write(base64.b64encode(b"".join(blocks)).decode("ascii"))
    file.write("</DataArray>\n")


def _compressed(values: NDArray[Any]) -> Iterator[bytes]:
    level = int(is_compressible(values))
    content = values.reshape(-1).view(np.uint8)
    for start in range(0, len(content), _BLOCK):
        yield zlib.compress(content[start : start + _BLOCK].tobytes(), level)
