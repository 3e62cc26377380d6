"""Time by stage, and the peak memory of the process."""

import contextlib
import resource
import sys
import time

from meeframe.system.reduced import Progress, silent


class Clock:
    """Clock that divides the time of a run into successive stages, and forwards progress."""

    def __init__(self, show: Progress = silent) -> None:
        self._show = show
        self._begin = self._mark = time.perf_counter()
        self._stage = ""
        self._seconds: dict[str, float] = {}

    def __call__(self, stage: str, fraction: float) -> None:
        """Report progress: time is assigned to this stage from here on."""
        self._close()
        self._stage = stage
        self._show(stage, fraction)

    def timings(self) -> dict[str, float]:
        """Return the seconds by stage so far, and their `total`."""
        self._close()
        return {**self._seconds, "total": self._mark - self._begin}

    def _close(self) -> None:
        now = time.perf_counter()
        if self._stage:
            self._seconds[self._stage] = self._seconds.get(self._stage, 0.0) + now - self._mark
        self._mark = now


def peak_memory_mb() -> float:
    """Return the largest resident memory of this process so far [MB = 1e6 bytes]."""
    if sys.platform == "linux":  # ru_maxrss counts the memory of the process that started this one
        with contextlib.suppress(OSError, StopIteration), open("/proc/self/status", encoding="ascii") as status:
            return next(float(line.split()[1]) for line in status if line.startswith("VmHWM:")) * 1024.0 / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak * (1.0 if sys.platform == "darwin" else 1024.0) / 1e6
