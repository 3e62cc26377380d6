"""Memory that a process may use, of arrays with columns of zeros, and of freed arrays, which the C library can retain.

Solvers allocate and free arrays of some megabytes all the time. By default the C library returns free memory at the
end of its heap to the system, which has to provide and clear it again page by page. That takes a tenth of the time of
large contacts.
"""

import ctypes
import math
import mmap
import os
import resource
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

MAX_RETAINED_BYTES: Final = 2**30
"""Number of free bytes at the end of the heap that stay with the process."""
MIN_MAPPED_BYTES: Final = 2**25
"""Size in bytes from which an array is mapped separately and returned when freed; the upper limit of the library.

With 2**22, runs on 2048 x 2048 nodes take 9 to 16 bytes less per node, and an eighth to a quarter more time.
"""
MIN_RELEASED_NODES: Final = 2**20
"""Number of nodes from which free memory is returned between the stages of a run: 30 to 60 bytes per node."""
MIN_PAGED_BYTES: Final = 2**22
"""Size in bytes from which zeros are mapped by themselves: in memory that was freed they would have to be written."""
_TRIM_THRESHOLD: Final = -1
_MMAP_THRESHOLD: Final = -3
_TUNING_VARIABLES: Final = "MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_", "GLIBC_TUNABLES"


def usable_memory() -> int:
    """Return the memory in bytes that this process may use.

    It is that of the machine, or the least limit of the process (`ulimit -v`) and of its control groups, by which batch
    systems and containers limit jobs.
    """
    limits = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"), *control_group_limits()]
    addresses, _ = resource.getrlimit(resource.RLIMIT_AS)
    return min(limits if addresses == resource.RLIM_INFINITY else [*limits, addresses - _unused_addresses()])


def _unused_addresses() -> int:
    """Return the bytes that are mapped but not in memory: libraries and stacks of threads reserve many."""
    try:
        mapped, resident = map(int, Path("/proc/self/statm").read_text(encoding="ascii").split()[:2])
    except (OSError, ValueError):  # not Linux
        return 0
    return (mapped - resident) * os.sysconf("SC_PAGE_SIZE")


def control_group_limits(
    membership: Path = Path("/proc/self/cgroup"), mount: Path = Path("/sys/fs/cgroup")
) -> Iterator[int]:
    """Yield the limits in bytes of the control groups that hold this process, of both versions of the interface.

    Parameters
    ----------
    membership : Path, optional
        File of the system that lists the groups.
    mount : Path, optional
        Folder of the groups. In a container, its top is the group of the container.
    """
    try:
        lines = membership.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:  # not Linux
        return
    for line in lines:
        _, controllers, group = line.split(":", 2)
        if not controllers:
            top, name = mount, "memory.max"
        elif "memory" in controllers.split(","):
            top, name = mount / "memory", "memory.limit_in_bytes"
        else:
            continue
        folder = top / group.lstrip("/")
        for each in (folder, *folder.parents[: len(folder.relative_to(top).parts)]):
            with suppress(OSError, ValueError):  # no such file, or "max"
                yield int((each / name).read_text(encoding="ascii"))


@cache
def keep_freed_memory() -> bool:
    """Let the process retain freed memory from now on.

    Returns
    -------
    bool
        True if the setting was accepted. It is not with another library than the GNU C library, or if an environment
        variable (see mallopt(3)) sets the limits already.
    """
    if any(name in os.environ for name in _TUNING_VARIABLES):
        return False
    try:
        os.confstr("CS_GNU_LIBC_VERSION")  # raises with other libraries, where these numbers may mean something else
        mallopt = ctypes.CDLL(None).mallopt
    except (ValueError, OSError, AttributeError):
        return False
    return bool(mallopt(_MMAP_THRESHOLD, MIN_MAPPED_BYTES) and mallopt(_TRIM_THRESHOLD, MAX_RETAINED_BYTES))


def release_freed_memory(nodes: int) -> None:
    """Return free memory to the system, if the C library can, after a stage of a run on many nodes.

    Parameters
    ----------
    nodes : int
        Number of nodes; with fewer than MIN_RELEASED_NODES nothing is done.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if nodes >= MIN_RELEASED_NODES else None
    if trim is not None:
        trim(0)


def zeros(shape: tuple[int, ...], kind: type[np.generic] = np.float64) -> NDArray[Any]:
    """Return zeros, of which pages that are never written take no memory if there are many of them.

    Parameters
    ----------
    shape : tuple of int
        Shape of the array, whose first axis varies fastest: the columns of a matrix are stored one after another.
    kind : type, optional
        Type of the numbers.

    Returns
    -------
    array
        The zeros.
    """
    size = math.prod(shape) * np.dtype(kind).itemsize
    if size < MIN_PAGED_BYTES:
        return np.zeros(shape, kind, order="F")
    pages = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if hasattr(mmap, "MADV_HUGEPAGE"):  # as numpy does: fewer and larger pages take less time
        pages.madvise(mmap.MADV_HUGEPAGE)
    return np.frombuffer(pages, kind).reshape(shape, order="F")


def stack_columns(columns: Iterable[NDArray[np.float64]], shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return columns (n,) as an array (n, k), stored one after another: columns of zeros take no memory.

    Parameters
    ----------
    columns : iterable of array
        The k columns.
    shape : tuple of int
        Shape (n, k) of the array.

    Returns
    -------
    array
        The array.
    """
    stacked = zeros(shape)
    for column, values in zip(stacked.T, columns, strict=True):
        if values.any():
            column[:] = values
    return stacked
