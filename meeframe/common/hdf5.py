"""HDF5 files that may come from others: everything that is read is in the file itself and of a plausible size."""

import math
import mmap
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import h5py

from meeframe.common.files import check_file

MAX_COMPRESSION: Final = 32
"""Largest ratio of the size of a large array and of its stored size; that of measured heights and of meshes is less."""
MAX_DEFLATE: Final = 1100
"""Largest such ratio in results, whose fields may be zero nearly everywhere; deflate attains 1032."""
_LARGEST_RATIOS: Final = {h5py.h5z.FILTER_DEFLATE: 1032, h5py.h5z.FILTER_LZF: 88}
"""Compressions, with the largest ratio of the size of data and of their compressed size that each attains."""
_NO_COMPRESSION: Final = (h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32)
"""Filters of HDF5 that do not change the size, except by a check sum."""
_CHECK_SUM: Final = 4
"""Size [bytes] of a check sum."""
_POINTER, _REFERENCE = 8, 16
"""Sizes [bytes] of an element of variable length in memory, and in a file."""
_FILTER_NAMES: Final = {
    1: "gzip", 2: "shuffle", 3: "fletcher32", 4: "szip", 5: "nbit", 6: "scale-offset", 32000: "lzf"
}  # fmt: skip
"""Names of the filters of HDF5, for messages."""
_DOUBLE: Final = 8
"""Size [bytes] of the numbers that arrays become."""
_HEAP: Final = b"GCOL\1\0\0\0"
"""Signature and version of a heap."""
ALWAYS_ALLOWED: Final = 2**27
"""Size [bytes] as doubles up to which arrays are read however little of them is stored: 4096 x 4096 numbers."""


@contextmanager
def open_hdf5(
    path: Path,
    is_result_link: Callable[[str, str], bool] = lambda name, target: False,
    max_compression: int = MAX_COMPRESSION,
) -> Iterator[Any]:
    """Open an HDF5 file for reading, if it refers to no other file and declares no more than it stores.

    HDF5 follows external links, external storage and virtual datasets wherever they lead, so that a file from somebody
    else could make any readable file part of a result.

    Parameters
    ----------
    path : Path
        The file.
    is_result_link : callable, optional
        Returns True for an external link, given by its name and its target file, that is allowed, and whose target is
        checked likewise. By default none is.
    max_compression : int, optional
        Largest ratio of the size of an array and of its stored size, if the array takes more than `ALWAYS_ALLOWED`.

    Yields
    ------
    h5py.File
        The open file.

    Raises
    ------
    OSError
        If the file is a device, a pipe or a folder, or if it cannot be read as HDF5.
    ValueError
        If it refers to other files, if an array is far larger than what is stored of it, or if it is compressed twice,
        otherwise than by gzip or lzf, or to chunks that expand beyond their size.
    """
    check_file(path)
    with h5py.File(path, "r") as file:
        try:
            _check_heaps(path, file.id.get_create_plist().get_sizes()[1])
            _check(file, path.stat().st_size, is_result_link, max_compression)
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


def _check(group: Any, file_size: int, is_result_link: Callable[[str, str], bool] | None, max_compression: int) -> None:
    """Check the links and arrays of a group at any depth, in a file of a size [bytes]. Raises ValueError."""
    external: dict[bytes, str] = {}

    def visit_link(name: bytes, info: Any) -> None:
        if info.type not in (h5py.h5l.TYPE_HARD, h5py.h5l.TYPE_SOFT):
            is_external = info.type == h5py.h5l.TYPE_EXTERNAL
            external[name] = group.id.links.get_val(name)[0].decode(errors="replace") if is_external else "unknown"

    def visit_object(name: bytes, info: Any) -> None:
        if info.type == h5py.h5o.TYPE_DATASET:
            _check_array(h5py.h5d.open(group.id, name), file_size, max_compression)

    group.id.links.visit(visit_link, info=True)
    h5py.h5o.visit(group.id, visit_object, info=True)  # low-level: as fast as the arrays are read
    for link, target in external.items():
        name = link.decode(errors="replace")
        if is_result_link is None or not is_result_link(name, target):
            raise ValueError(f"{name!r} is a link to another file, {target!r}; allowed: data in the file itself")
        with suppress(KeyError):  # it may not be written yet
            linked = group[link]
            _check(linked, Path(linked.file.filename).stat().st_size, None, max_compression)


def _check_array(dataset: Any, file_size: int, max_compression: int) -> None:
    """Check the storage and the size of a low-level dataset. Raises ValueError."""
    stored = dataset.get_create_plist()
    if stored.get_layout() == h5py.h5d.VIRTUAL or stored.get_external_count():
        raise ValueError(f"{_name(dataset)} is stored in other files; allowed: data in the file itself")
    number, size = math.prod(dataset.shape), dataset.get_type().get_size()
    if dataset.get_type().detect_class(h5py.h5t.VLEN) or dataset.get_type().detect_class(h5py.h5t.STRING):
        size *= _REFERENCE // _POINTER  # at most: elements of variable length take more in a file than in memory
    chunk = math.prod(stored.get_chunk()) if stored.get_layout() == h5py.h5d.CHUNKED else 0
    number = max(number, chunk)  # chunks are read as a whole
    if number * max(size, _DOUBLE) > ALWAYS_ALLOWED:
        held, taken = min(dataset.get_storage_size(), file_size), number * size  # chunks may name the same bytes
        if taken > max_compression * held:
            raise ValueError(
                f"{_name(dataset)} of shape {dataset.shape} takes {taken / 2**30:.4g} GiB, of which the file stores "
                f"{held} bytes; allowed: {max_compression} times what it stores, or {ALWAYS_ALLOWED // _DOUBLE} numbers"
            )
    if chunk and stored.get_nfilters():
        _check_chunks(dataset, [stored.get_filter(k)[0] for k in range(stored.get_nfilters())], chunk * size)


def _check_chunks(dataset: Any, filters: list[int], size: int) -> None:
    """Check that chunks expand to their size [bytes] at most: HDF5 expands them to their end. Raises ValueError."""
    compressions = {code: place for place, code in enumerate(filters) if code not in _NO_COMPRESSION}
    if len(set(filters)) < len(filters) or len(compressions) > 1 or not compressions.keys() <= _LARGEST_RATIOS.keys():
        names = ", ".join(_FILTER_NAMES.get(code, f"number {code}") for code in filters)
        raise ValueError(
            f"{_name(dataset)} is compressed twice, or by other filters of HDF5 than gzip and lzf ({names}); allowed: "
            "these, once, as `h5repack -f GZIP=4` writes them"
        )
    if not compressions:
        return
    ((compression, place),) = compressions.items()
    largest = ALWAYS_ALLOWED // _LARGEST_RATIOS[compression]
    if dataset.get_storage_size() <= largest:
        return
    chunks: list[Any] = []
    dataset.chunk_iter(chunks.append)
    for chunk in chunks:
        if chunk.filter_mask >> place & 1:  # not compressed
            continue
        where = f"the chunk at {chunk.chunk_offset} of {_name(dataset)}"
        if compression == h5py.h5z.FILTER_LZF:  # without a function that would tell how far it expands
            if chunk.size > (allowed := min(size + _CHECK_SUM, largest)):
                raise ValueError(f"{where} has {chunk.size} bytes; allowed: {allowed}, or gzip")
        elif _inflates_beyond(dataset.read_direct_chunk(chunk.chunk_offset)[1], size + _CHECK_SUM):
            raise ValueError(f"{where} expands to more than its {size} bytes")


def _inflates_beyond(stored: bytes, size: int) -> bool:
    """Return whether a deflate stream holds more than a size [bytes]. Raises OSError if it is damaged."""
    try:
        return len(zlib.decompressobj().decompress(stored, size + 1)) > size
    except zlib.error as error:
        raise OSError(f"is damaged: {error}") from None


def _name(dataset: Any) -> str:
    return repr(h5py.h5i.get_name(dataset).decode(errors="replace"))
