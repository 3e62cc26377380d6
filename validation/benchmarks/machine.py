"""What one core can do: multiplications and additions on registers, and reading from each level of memory."""

import time
from collections.abc import Callable
from functools import partial

import numpy as np
from common import Record
from numba import njit

POWERS = 16
READ = {"first-level cache": 16, "second-level cache": 512, "third-level cache": 8192, "main memory": 262_144}
"""Kilobytes that fit there."""


@njit(fastmath=True, cache=True)
def _polynomials(values: np.ndarray, out: np.ndarray, passes: int) -> None:
    """Horner's rule with independent chains: two operations for each value and power, all on registers."""
    for turn in range(passes):
        for i in range(len(values)):
            power = values[i]
            for _ in range(POWERS):
                power = power * values[i] + turn
            out[i] = power


@njit(fastmath=True, cache=True)
def _total(values: np.ndarray, passes: int) -> float:
    """Reads everything so many times."""
    total = 0.0
    for turn in range(passes):
        for i in range(len(values)):
            total += values[i] * turn
    return total


def limits(quick: bool) -> Record:
    """Peak [GFLOP/s] and reading [GB/s] of one core, the best of seven runs, by processor time."""
    work = 1e8 if quick else 1e9
    values, out = np.linspace(0.1, 0.5, 1024), np.empty(1024)
    operations = 2 * POWERS * len(values)
    passes = round(work / operations)
    peak = passes * operations / _least_time(lambda: _polynomials(values, out, passes))
    reading = {}
    for level, kilobytes in READ.items():
        array = np.ones(kilobytes * 128)
        passes = max(1, round(work / array.nbytes))
        reading[level] = passes * array.nbytes / _least_time(partial(_total, array, passes)) / 1e9
    return {"peak_gflops": peak / 1e9, "reading_gb_s": reading}


def _least_time(action: Callable[[], object]) -> float:
    """Least processor time of seven calls [s]."""
    action()
    times = []
    for _ in range(7):
        begin = time.process_time()
        action()
        times.append(time.process_time() - begin)
    return min(times)
