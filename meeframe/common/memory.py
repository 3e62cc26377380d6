"""Keeps freed memory in the process, for the arrays to come.

Solvers allocate and free arrays of some megabytes all the time. The C library returns free memory at the end of its
heap to the system, which has to find and clear it again, page by page: a tenth of the time of large contacts.
"""

import ctypes
import os
from functools import cache
from typing import Final

FREE_MEMORY_KEPT: Final = 2**30
"""Free bytes at the end of the heap that stay with the process."""
MIN_MAPPED_ARRAY: Final = 2**25
"""Size in bytes from which an array gets a mapping of its own, returned when freed; the library's own upper limit."""
_TRIM_THRESHOLD: Final = -1
_MMAP_THRESHOLD: Final = -3
_TUNED: Final = "MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_", "GLIBC_TUNABLES"


@cache
def keep_freed_memory() -> bool:
    """Let the process keep freed memory from now on, and return whether it does.

    This works with the GNU C library only, and not where one of its environment variables (mallopt(3)) says otherwise.
    """
    if any(name in os.environ for name in _TUNED):
        return False
    try:
        os.confstr("CS_GNU_LIBC_VERSION")  # raises elsewhere, where such numbers may mean something else
        mallopt = ctypes.CDLL(None).mallopt
    except (ValueError, OSError, AttributeError):
        return False
    return bool(mallopt(_MMAP_THRESHOLD, MIN_MAPPED_ARRAY) and mallopt(_TRIM_THRESHOLD, FREE_MEMORY_KEPT))
