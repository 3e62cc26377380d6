"""A limit on the threads of BLAS while threads of meeframe share the work."""

import sys
from functools import lru_cache
from threading import Lock
from types import TracebackType
from typing import Any

from threadpoolctl import ThreadpoolController


class _OneThread:
    """Context manager that counts its entries and limits BLAS to one thread while there are any.

    The limit applies to the whole process. If each of several overlapping uses restored the value that it found, one
    would lift the limit of the others or leave it in place for good.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._entries = 0
        self._limits: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if self._limits is None:
                self._limits = _libraries(len(sys.modules)).limit(limits=1, user_api="blas")
            self._entries += 1

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with self._lock:
            self._entries -= 1
            if self._entries == 0 and self._limits is not None:
                self._limits.restore_original_limits()
                self._limits = None


@lru_cache(maxsize=1)
def _libraries(_n_modules: int) -> ThreadpoolController:
    """Return the thread pools of this process.

    Looking for them takes milliseconds, more than a small solution does. A module that is imported later may load a
    further library, so that they are looked for again when the number of modules has changed.
    """
    return ThreadpoolController()


ONE_BLAS_THREAD = _OneThread()
"""Context manager: BLAS uses one thread while any thread of the process is in this context."""
