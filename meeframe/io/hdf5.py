"""HDF5 files on disks that may be full."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py


class _Sink(io.FileIO):
    """A file that keeps the first error of writing to itself: HDF5 gets into disorder by one, up to a crash."""

    error: OSError | None = None

    def write(self, data: Any, /) -> int:
        """All of the data, or nothing any more after an error."""
        left = memoryview(data).cast("B")
        size = len(left)
        try:
            while self.error is None and left:
                left = left[super().write(left) :]
        except OSError as error:
            self.error = error
        return size

    def truncate(self, size: int | None = None, /) -> int:
        """As of any file."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return self.tell() if size is None else size


@contextmanager
def changed_file(path: Path, mode: str) -> Iterator[Any]:
    """An HDF5 file to be written, mode "w", or to be changed, "r+". Raises OSError if it cannot be written."""
    with _Sink(path, {"w": "w+", "r+": "r+"}[mode]) as sink:
        try:
            with h5py.File(sink, mode) as file:
                yield file
        finally:
            if sink.error is not None:
                raise sink.error
