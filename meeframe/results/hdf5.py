"""HDF5 files on disks that may be full, with contents that may have been modified."""

import io
import json
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

_SAMPLES: Final = 32
_SAMPLE_BYTES: Final = 4096
"""Number and size of the samples that decide on compression."""


class _Sink:
    """File that stores the first error of writing to itself, and keeps all later data in memory.

    Such an error, and missing data that it wrote before, leaves HDF5 in an inconsistent state, up to a crash.
    """

    def __init__(self, path: Path, mode: str) -> None:
        self.error: OSError | None = None
        self._file: io.FileIO | io.BytesIO = io.FileIO(path, mode)

    def __getattr__(self, name: str) -> Any:
        """Return any other attribute of the file."""
        return getattr(self._file, name)

    def write(self, data: Any) -> int:
        """Write the data; return the number of bytes, all of them."""
        position, full = self._file.tell(), memoryview(data).cast("B")
        left = full
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            self._go_on_in_memory(error, position).write(full)
        return len(full)

    def truncate(self, size: int) -> int:
        """Truncate the file."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            return self._go_on_in_memory(error, self._file.tell()).truncate(size)

    def _go_on_in_memory(self, error: OSError, position: int) -> io.BytesIO:
        self._file.seek(0)
        with self._file as full:
            memory = io.BytesIO(full.read())
        memory.seek(position)
        self.error, self._file = error, memory
        return memory


@contextmanager
def sink(path: Path, mode: str) -> Iterator[_Sink]:
    """Open a file for HDF5 to write, mode "w", or to change, "r+". Raises OSError if it cannot be written."""
    file = _Sink(path, {"w": "w+", "r+": "r+"}[mode])
    try:
        yield file
    finally:
        file.close()
        if file.error is not None:
            raise file.error


@contextmanager
def changed_file(path: Path, mode: str) -> Iterator[Any]:
    """Open an HDF5 file to be written, mode "w", or changed, "r+". Raises OSError if it cannot be written."""
    with sink(path, mode) as stream, h5py.File(stream, mode) as file:
        yield file


def is_compressible(values: Any) -> bool:
    """Return whether compression halves an array, or one made when it is read, from samples of its rows.

    It rarely does with numbers of many digits.
    """
    if not values.nbytes:
        return False
    rows = np.linspace(0, len(values), _SAMPLES, endpoint=False).astype(np.int64)
    per_sample = max(1, _SAMPLE_BYTES * len(values) // values.nbytes)
    sample = np.concatenate([np.ascontiguousarray(values[row : row + per_sample]).reshape(-1) for row in rows])
    shuffled = sample.view(np.uint8).reshape(-1, sample.dtype.itemsize).T.tobytes()
    return len(zlib.compress(shuffled, 1)) < 0.5 * len(shuffled)


def numbers_of(group: Any, name: str, shape: tuple[int, ...], kinds: str = "biuf") -> Any:
    """Return a dataset as an array. Raises ValueError unless it holds numbers, of kinds of numpy, in that shape."""
    values = group[name][()]
    if not isinstance(values, np.ndarray) or values.dtype.kind not in kinds or values.shape != shape:
        result = f"{values.dtype} of shape {values.shape}" if isinstance(values, np.ndarray) else type(values).__name__
        raise ValueError(f"{group.name}/{name} is {result} instead of numbers of shape {shape}")
    return values


def text_of(group: Any, name: str) -> str:
    """Return an attribute. Raises ValueError unless it is a text."""
    text = group.attrs[name]
    if not isinstance(text, str):
        raise ValueError(f"attribute {name!r} of {group.name} is not a text")
    return text


def table_of(group: Any, name: str, kind: Any) -> dict[str, Any]:
    """Return the JSON table in an attribute. Raises ValueError unless it is a table of values of a kind."""
    table = json.loads(text_of(group, name))
    if not isinstance(table, dict) or not all(isinstance(value, kind) for value in table.values()):
        raise ValueError(f"attribute {name!r} of {group.name} is not the table that belongs there")
    return table
