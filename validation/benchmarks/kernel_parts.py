"""What a pair of the tabulated fundamental solution consists of: time and arithmetic of its parts."""

import numpy as np
from common import Record, median_time
from numba import njit

from meeframe.core.fields import N_FIELDS, Array
from meeframe.fundamental.tabulated import TabulatedKernel
from meeframe.kernels.tabulated import BLOCK, DEGREE, WIDE, WIDTH, evaluate, horner, sort_by_cell, tractions


@njit(cache=True, fastmath={"contract"})
def _interpolate(table: Array, cells: Array, value: Array) -> None:
    """G, G_s, G_t in given cells, all columns, into value (48,)."""
    for cell in cells:
        for column in range(WIDTH):
            found = horner(table, cell, column, 0.3, -0.4)
            value[column], value[WIDTH + column], value[2 * WIDTH + column] = found


def interpolation_us(kernel: TabulatedKernel, repeats: int) -> Record:
    """Microseconds a point of interpolation alone: all points in one cell, and each in another cell than the last."""
    count, value = 60_000, np.empty(3 * WIDTH)
    cells = {"one": np.zeros(count, int), "others": 7 * np.arange(count) % len(kernel.table)}
    return {
        name: 1e6
        * median_time(lambda chosen=chosen: _interpolate(kernel.table, chosen, value), repeats)["processor"]
        / count
        for name, chosen in cells.items()
    }


@njit(cache=True)
def _repeat_tractions(coefficients: Array, place: Array, values: Array, out: Array, count: int) -> None:
    """The tractions of one block of points, many times."""
    for _ in range(count):
        tractions(coefficients, place, values, out)


def parts_us(kernel: TabulatedKernel, offset: Array, repeats: int) -> Record:
    """Microseconds a point of finding and sorting the cells of points (n, 3), and of tractions in full blocks."""
    room = len(offset)
    place, key, order = np.empty((3, room)), np.empty(room, np.int32), np.empty(room, np.int32)
    near, values, out = np.ones((7, BLOCK)), np.ones((WIDTH, 3 * WIDE)), np.empty((5, 5 * BLOCK))
    calls, blocks = 100, 3000

    def sorting() -> None:
        for _ in range(calls):
            sort_by_cell(offset, kernel.cells, place, key, order)

    def contraction() -> None:
        _repeat_tractions(kernel.coefficients[0], near, values, out, blocks)

    counts = {"sorting": (sorting, calls * room), "tractions": (contraction, blocks * BLOCK)}
    return {name: 1e6 * median_time(action, repeats)["processor"] / n for name, (action, n) in counts.items()}


def reused_us(kernel: TabulatedKernel, offset: Array, normal: Array, repeats: int) -> float:
    """Microseconds a pair of the largest call where the memory of its results has been written before."""
    u, t = np.zeros((2, len(offset), N_FIELDS**2))

    def action() -> None:
        evaluate(kernel.table, kernel.cells, kernel.coefficients, offset, normal, u, t)

    return 1e6 * median_time(action, repeats)["processor"] / len(offset)


def interpolations() -> int:
    """Operations of an interpolation, in all columns: of rows in one direction 36 multiply-adds for values and 28 for
    derivatives, of their sum in the other 22."""
    return WIDTH * 2 * (DEGREE * (DEGREE + 1) // 2 + DEGREE * (DEGREE - 1) // 2 + 3 * DEGREE - 2)


def arithmetic(points: int) -> Record:
    """Operations (a multiplication or an addition each) of one pair, from the formulas, and bytes of its coefficients.

    After the interpolation, U: one product an entry.
    T: 25 x 3 contractions of stiffness and normal, of which 25 go into the two others; 25 sums of 15 products, scaled.
    A point of a sum over an element: derivatives of all columns, then a multiply-add for each node, matrix and column;
    an element of so many points: sums of 15 products for each node, stiffness and normal being contracted once a plane.
    """
    coefficients = (DEGREE + 1) * (DEGREE + 2) // 2
    entries = N_FIELDS**2
    interpolation = interpolations()
    pair = entries + entries * (3 * 5 + 2 * 2) + entries * 30
    contraction = 4 * entries * 30
    return {
        "pair": interpolation + pair,
        "summed": interpolation + 8 * WIDTH + 4 * 4 * 2 * WIDTH + contraction / points,
        "bytes": 8 * WIDTH * coefficients,
    }
