"""HDF5 files that may come from others: everything that is read is in the file itself and of a plausible size."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import h5py

MAX_COMPRESSION: Final = 1100
"""Largest ratio of the size of an array and its compressed size; deflate attains 1032."""
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
        If the file cannot be read as HDF5.
    ValueError
        If it refers to other files, or if an array is larger than the file can hold.
    """
    with h5py.File(path, "r") as file:
        _check(file, path.stat().st_size, is_result_link)
        yield file


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
