"""How many threads BLAS takes while threads of our own share the work."""

from threading import Lock
from types import TracebackType

from threadpoolctl import threadpool_limits


class _OneThread:
    """Counts who is inside. The limit is one of the whole process: each restoring what it found would, where several
    overlap, lift that of the others or leave it behind."""

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
"""BLAS of this process takes one thread while any thread of ours is within `with ONE_BLAS_THREAD:`; as before then."""
