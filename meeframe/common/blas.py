"""Limits the threads of BLAS while threads of meeframe share the work."""

from threading import Lock
from types import TracebackType

from threadpoolctl import threadpool_limits


class _OneThread:
    """A context manager that counts its entries and limits BLAS to one thread while there are any.

    The limit belongs to the whole process. If each of several overlapping uses restored the value it had found, one
    would lift the limit of the others or leave it behind.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._inside = 0
        self._limits: threadpool_limits | None = None

    def __enter__(self) -> None:
        with self._lock:
            if self._limits is None:
                self._limits = threadpool_limits(1, user_api="blas")
            self._inside += 1

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0 and self._limits is not None:
                self._limits.restore_original_limits()
                self._limits = None


ONE_BLAS_THREAD = _OneThread()
"""Context in which BLAS uses one thread, as long as any thread of the process is inside; restored afterwards."""
