"""HDF5 files that may come from others: everything that is read is in the file itself and of a plausible size."""

import mmap
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import h5py

from meeframe.common.files import check_file

MAX_COMPRESSION: Final = 1100
"""Largest ratio of the size of an array and its compressed size; deflate attains 1032."""
_HEAP: Final = b"GCOL\1\0\0\0"
"""Signature and version of a heap."""
ALWAYS_ALLOWED: Final = 2**30
"""Size [bytes] up to which arrays are read however small the file is; parts that were never written take no place."""


@contextmanager
def open_hdf5(path: Path, is_result_link: Callable[[str, str], bool] = lambda name, target: False) -> Iterator[Any]:
    """Open an HDF5 file for reading, if it refers to no other file.

    HDF5 follows external links, external storage and virtual datasets wherever they lead, so that a file from somebody
    else could make any readable file part of a result.

    Parameters
    ----------
    path : Path
        The file.
    is_result_link : callable, optional
        Returns True for an external link, given by its name and its target file, that is allowed, and whose target is
        checked likewise. By default none is.

    Yields
    ------
    h5py.File
        The open file.

    Raises
    ------
    OSError
        If the file is a device, a pipe or a folder, or if it cannot be read as HDF5.
    ValueError
        If it refers to other files, or if an array is larger than the file can hold.
    """
    check_file(path)
    with h5py.File(path, "r") as file:
        try:
            _check_heaps(path, file.id.get_create_plist().get_sizes()[1])
            _check(file, path.stat().st_size, is_result_link)
        except (RuntimeError, LookupError, TypeError) as error:  # as h5py names errors of HDF5
            raise OSError(f"is damaged: {error}") from None
        yield file


def _check_heaps(path: Path, length_bytes: int) -> None:
    """Check the heaps of a file, in which texts are stored: HDF5 searches a damaged one without end.

    Parameters
    ----------
    path : Path
        The file.
    length_bytes : int
        Size of a length in it.

    Raises
    ------
    OSError
        If the objects of a heap do not follow each other up to its end.

    References
    ----------
    HDF5 File Format Specification, version 3.0, section III.E (global heap).
    """
    header = 8 + length_bytes
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        start = content.find(_HEAP)
        while start >= 0:
            end = start + int.from_bytes(content[start + 8 : start + header], "little")
            if not start + header <= _end_of_objects(content, start + header, end, header) <= end <= len(content):
                raise OSError("is damaged: the objects in one of its heaps do not fit into it")
            start = content.find(_HEAP, start + 1)


def _end_of_objects(content: mmap.mmap, position: int, end: int, header: int) -> int:
    """Return where the objects of a heap end; 0 if one has no length."""
    while position + header <= min(end, len(content)):
        length = int.from_bytes(content[position + 8 : position + header], "little")
        is_free = content[position : position + 2] == b"\0\0"  # its length includes the header
        if is_free and length == 0:
            return 0
        position += length if is_free else header + -(-length // 8) * 8
    return position


def _check(group: Any, size: int, is_result_link: Callable[[str, str], bool] | None) -> None:
    """Check the links and arrays of a group at any depth, in a file of a size [bytes]. Raises ValueError."""
    external: dict[bytes, str] = {}

    def visit_link(name: bytes, info: Any) -> None:
        if info.type not in (h5py.h5l.TYPE_HARD, h5py.h5l.TYPE_SOFT):
            is_external = info.type == h5py.h5l.TYPE_EXTERNAL
            external[name] = group.id.links.get_val(name)[0].decode(errors="replace") if is_external else "unknown"

    def visit_object(name: bytes, info: Any) -> None:
        if info.type == h5py.h5o.TYPE_DATASET:
            _check_array(h5py.h5d.open(group.id, name), size)

    group.id.links.visit(visit_link, info=True)
    h5py.h5o.visit(group.id, visit_object, info=True)  # low-level: as fast as the arrays are read
    for link, target in external.items():
        name = link.decode(errors="replace")
        if is_result_link is None or not is_result_link(name, target):
            raise ValueError(f"{name!r} is a link to another file, {target!r}; allowed: data in the file itself")
        with suppress(KeyError):  # it may not be written yet
            linked = group[link]
            _check(linked, Path(linked.file.filename).stat().st_size, None)


def _check_array(dataset: Any, file_size: int) -> None:
    """Check the storage and the size of a low-level dataset. Raises ValueError."""
    stored = dataset.get_create_plist()
    if stored.get_layout() == h5py.h5d.VIRTUAL or stored.get_external_count():
        name = h5py.h5i.get_name(dataset).decode(errors="replace")
        raise ValueError(f"{name!r} is stored in other files; allowed: data in the file itself")
    size = dataset.get_space().get_simple_extent_npoints() * dataset.get_type().get_size()
    if size > max(ALWAYS_ALLOWED, MAX_COMPRESSION * file_size):
        name = h5py.h5i.get_name(dataset).decode(errors="replace")
        raise ValueError(
            f"{name!r} of shape {dataset.shape} takes {size / 2**30:.0f} GiB; its file of {file_size} bytes holds less"
        )
