"""Memory that arrays leave, kept for those to come.

Solvers make and leave arrays of some megabytes all the time. The C library gives what is free at the end of its memory
back to the system, which has to find and clear it anew, page by page: a tenth of the time of large contacts.
"""

import ctypes
import os
from functools import cache
from typing import Final

KEPT: Final = 2**30
"""Bytes that are free at the end of the memory and stay with the process."""
LARGEST: Final = 2**25
"""Bytes from which an array has memory of its own, which the system has back: what the library comes to by itself."""
_TRIM_THRESHOLD: Final = -1
_MMAP_THRESHOLD: Final = -3
_TUNED: Final = "MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_", "GLIBC_TUNABLES"


@cache
def keep_freed_memory() -> bool:
    """Let the process keep freed memory, from now on; whether it does. Only of the GNU C library, and not where one of
    its own variables of the environment (mallopt(3)) says something else."""
    if any(name in os.environ for name in _TUNED):
        return False
    try:
        os.confstr("CS_GNU_LIBC_VERSION")  # raises elsewhere, where such numbers may mean something else
        mallopt = ctypes.CDLL(None).mallopt
    except (ValueError, OSError, AttributeError):
        return False
    return bool(mallopt(_MMAP_THRESHOLD, LARGEST) and mallopt(_TRIM_THRESHOLD, KEPT))
