"""Number of threads of a computation."""

from collections.abc import Iterator
from contextlib import contextmanager

import numba
from threadpoolctl import threadpool_limits


@contextmanager
def limited(threads: int | None) -> Iterator[None]:
    """Limit the threads of numba, of the libraries under numpy and scipy, and of meeframe; None: no change.

    The limit for numba applies to the calling thread alone, and is at most the number it was started with.
    """
    if threads is None:
        yield
        return
    before = numba.get_num_threads()
    launched: int = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
    numba.set_num_threads(min(threads, launched))
    try:
        with threadpool_limits(threads):
            yield
    finally:
        numba.set_num_threads(before)
