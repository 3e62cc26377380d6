"""Measure the limits of one core: multiply-adds on registers, and reading from each level of memory."""

import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from common import Record
from numba import njit

POWERS, CHAINS = 16, 4
READ = {"first-level cache": 16, "second-level cache": 512, "third-level cache": 8192, "main memory": 262_144}
"""Array sizes [kB] that fit into each level."""
TURNS = 7


@njit(fastmath={"contract"}, cache=True)
def _polynomials(values: np.ndarray, out: np.ndarray, passes: int) -> None:
    """Evaluate polynomials in independent chains (CHAINS, n): one multiply-add for each value and power."""
    for turn in range(passes):
        for i in range(values.shape[1]):
            x = values[0, i]
            a, b, c, d = x, values[1, i], values[2, i], values[3, i]
            for _ in range(POWERS):
                a = a * x + turn
                b = b * x + turn
                c = c * x + turn
                d = d * x + turn
            out[0, i], out[1, i], out[2, i], out[3, i] = a, b, c, d


@njit(fastmath=True, cache=True)
def _total(values: np.ndarray, passes: int) -> float:
    """Read all values `passes` times."""
    total = 0.0
    for turn in range(passes):
        for i in range(len(values)):
            total += values[i] * turn
    return total


def multiply_adds(quick: bool) -> tuple[Callable[[], None], float]:
    """Return an action that consists of multiply-adds on registers, and their number."""
    values, out = (aligned(1024).reshape(CHAINS, -1) for _ in range(2))
    values[:] = np.linspace(0.1, 0.5, values.size).reshape(values.shape)
    passes = 500 if quick else 5000
    return partial(_polynomials, values, out, passes), float(passes * POWERS * values.size)


def reading(quick: bool) -> Record:
    """Return the reading rates of one core [GB/s], the best of several runs by processor time."""
    work = 1e8 if quick else 1e9
    result = {}
    for level, kilobytes in READ.items():
        array = aligned(kilobytes * 128)
        passes = max(1, round(work / array.nbytes))
        result[level] = passes * array.nbytes / least_times([partial(_total, array, passes)])[0] / 1e9
    return result


def aligned(size: int) -> np.ndarray:
    """Return ones aligned to a cache line: vectors across two lines take twice as long to read."""
    room = np.ones(size + 8)
    first = -room.ctypes.data % 64 // 8
    return room[first : first + size]


def least_times(actions: Sequence[Callable[[], object]], turns: int = TURNS) -> list[float]:
    """Return the least processor time [s] of each action; actions alternate to run at the same clock rates."""
    for action in actions:
        action()
    least = [float("inf")] * len(actions)
    for _ in range(turns):
        for number, action in enumerate(actions):
            begin = time.process_time()
            action()
            least[number] = min(least[number], time.process_time() - begin)
    return least
