"""Files named by users: regular files of a limited size, and arrays that fit into their files."""

import errno
import json
import lzma
import math
import os
import stat
import sys
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from io import BytesIO
from pathlib import Path
from threading import RLock
from tokenize import TokenError
from types import SimpleNamespace
from typing import Any, Final

import numpy as np

MAX_TEXT_BYTES: Final = 2**26
"""Largest size of a case file, study file or plugin file."""
MAX_DATA_BYTES: Final = 2**30
"""Largest size of a file of heights or a JSON file."""
MAX_EXPANDED_BYTES: Final = 2**29
"""Largest size of what the compressed parts of a file expand to, other than in HDF5."""
_MAX_HEADER_BYTES: Final = 2**16
"""Largest size of a header of a .npy file."""
_DECOMPRESSORS: Final[dict[str, tuple[Callable[[], Any], type[Exception]]]] = {
    "zlib": (zlib.decompressobj, zlib.error),
    "lzma": (partial(lzma.LZMADecompressor, memlimit=MAX_EXPANDED_BYTES), lzma.LZMAError),
}
_EXPANDING: Final = RLock()
"""Lock of `bounded_decompression`, which affects all threads."""


def check_file(path: str | Path, max_bytes: int = sys.maxsize) -> None:
    """Check that a file may be read as a whole.

    Parameters
    ----------
    path : str or Path
        The file.
    max_bytes : int, optional
        Its largest allowed size.

    Raises
    ------
    OSError
        If it does not exist, if it is a device, a pipe or a folder, which may never end, or if it is too large.
    """
    status = os.stat(path)
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "is a device or a pipe; allowed: a regular file")
    if status.st_size > max_bytes:
        raise OSError(errno.EFBIG, f"has {status.st_size} bytes; allowed: at most {max_bytes}")


def read_json(path: str | Path) -> Any:
    """Return the content of a JSON file.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    object
        What it holds.

    Raises
    ------
    OSError
        As `check_file`, or if it cannot be read.
    ValueError
        If it is not a JSON file, or nested too deeply.
    """
    check_file(path, MAX_DATA_BYTES)
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except RecursionError as error:
        raise ValueError(str(error)) from None


def read_npy(path: str | Path) -> Any:
    """Return the array of a .npy file, without objects.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    ndarray
        The array.

    Raises
    ------
    OSError
        If it cannot be read, or as `check_file`.
    ValueError
        If it is damaged or holds objects; the shape in its header is compared with the size of the file.
    """
    check_file(path, MAX_DATA_BYTES)
    with open(path, "rb") as file:
        head = BytesIO(file.read(_MAX_HEADER_BYTES))  # the length that it declares may be gigabytes
        try:
            version = np.lib.format.read_magic(head)
            reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, dtype = reader(head)
        except (TokenError, SyntaxError, RecursionError, OverflowError, TypeError, LookupError) as error:
            raise ValueError(f"its header is damaged: {error}") from None
        if any(isinstance(length, bool) for length in shape):  # which NumPy takes for integers, here only
            raise ValueError(f"its header declares an array of shape {shape}")
        size, left = math.prod(shape) * dtype.itemsize, os.fstat(file.fileno()).st_size - head.tell()
        if not dtype.hasobject and not 0 <= size <= left:
            raise ValueError(f"its header declares an array of shape {shape}, {size} bytes; {left} follow")
        file.seek(0)
        return np.lib.format.read_array(file, allow_pickle=False)


@contextmanager
def bounded_decompression(package: str) -> Iterator[None]:
    """Bound what the modules of a package decompress by zlib and lzma within this context.

    Readers of other packages expand whatever a file holds: 2 MB may become 2 GB.

    Parameters
    ----------
    package : str
        Name of the package, which is imported.

    Yields
    ------
    None
        Data that together expand to more than `MAX_EXPANDED_BYTES` raise the error of damaged data here.
    """
    left = MAX_EXPANDED_BYTES

    def decompress(create: Callable[[], Any], error: type[Exception], data: bytes) -> bytes:
        nonlocal left
        decompressor = create()
        content: bytes = decompressor.decompress(data, left + 1)
        left -= len(content)
        if left < 0:
            raise error(f"compressed data expand to more than {MAX_EXPANDED_BYTES} bytes")
        if not decompressor.eof:
            raise error("compressed data are cut short")
        return content

    with _EXPANDING:
        originals = [
            (module, name, vars(module)[name])
            for module_name, module in tuple(sys.modules.items())
            for name in _DECOMPRESSORS
            if module_name.startswith(f"{package}.") and name in vars(module)
        ]
        try:
            for module, name, original in originals:
                bounded = {**vars(original), "decompress": partial(decompress, *_DECOMPRESSORS[name])}
                setattr(module, name, SimpleNamespace(**bounded))
            yield
        finally:
            for module, name, original in originals:
                setattr(module, name, original)
