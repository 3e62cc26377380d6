"""Files named by users: regular files of a limited size, and arrays that fit into their files."""

import errno
import json
import math
import os
import stat
import sys
from io import BytesIO
from pathlib import Path
from tokenize import TokenError
from typing import Any, Final

import numpy as np

MAX_TEXT_BYTES: Final = 2**26
"""Largest size of a case file, study file or plugin file."""
MAX_DATA_BYTES: Final = 2**30
"""Largest size of a file of heights or a JSON file."""
_MAX_HEADER_BYTES: Final = 2**16
"""Largest size of a header of a .npy file."""


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
