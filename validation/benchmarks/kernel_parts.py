"""Measure and count the stages of one pair of the tabulated fundamental solution."""

import numpy as np
from common import Record, median_time
from machine import least_times, multiply_adds
from numba import njit

from meeframe.fields import N_FIELDS, Array
from meeframe.greens._kernels.tabulated import (
    BLOCK,
    DEGREE,
    PADDED_BLOCK,
    WIDTH,
    evaluate,
    horner,
    sort_by_cell,
    tractions,
)
from meeframe.greens.tabulated import TabulatedKernel


@njit(cache=True, fastmath={"contract"})
def _interpolate(table: Array, cells: Array, value: Array) -> None:
    """Interpolate G, G_s, G_t in the given cells, all columns, into value (48,)."""
    for cell in cells:
        for column in range(WIDTH):
            result = horner(table, cell, column, 0.3, -0.4)
            value[column], value[WIDTH + column], value[2 * WIDTH + column] = result


def interpolation(kernel: TabulatedKernel, quick: bool) -> Record:
    """Return the peak rate of multiply-adds [1e9 / s] and the times of interpolation alone [µs per point].

    All are best values. one: all points lie in one cell; others: each in another cell than the last.
    """
    count, value = 60_000, np.empty(3 * WIDTH)
    peak, products = multiply_adds(quick)
    cells = (np.zeros(count, int), 7 * np.arange(count) % len(kernel.table))
    actions = (lambda chosen=chosen: _interpolate(kernel.table, chosen, value) for chosen in cells)
    full, one, others = least_times([peak, *actions], turns=5 if quick else 25)
    return {"peak_products": 1e-9 * products / full, "one_us": 1e6 * one / count, "others_us": 1e6 * others / count}


@njit(cache=True)
def _repeat_tractions(coefficients: Array, place: Array, values: Array, out: Array, count: int) -> None:
    """Compute the tractions of one block of points many times."""
    for _ in range(count):
        tractions(coefficients, place, values, out)


def parts_us(kernel: TabulatedKernel, offset: Array, repeats: int) -> Record:
    """Return the times [µs per point] of sorting points (n, 3) by cell and of tractions in full blocks."""
    room = len(offset)
    place, key, order = np.empty((3, room)), np.empty(room, np.int32), np.empty(room, np.int32)
    near, values, out = np.ones((7, BLOCK)), np.ones((WIDTH, 3 * PADDED_BLOCK)), np.empty((5, 5 * BLOCK))
    calls, blocks = 100, 3000

    def sorting() -> None:
        for _ in range(calls):
            sort_by_cell(offset, kernel.cells, place, key, order)

    def contraction() -> None:
        _repeat_tractions(kernel.coefficients[0], near, values, out, blocks)

    counts = {"sorting": (sorting, calls * room), "tractions": (contraction, blocks * BLOCK)}
    return {name: 1e6 * median_time(action, repeats)["processor"] / n for name, (action, n) in counts.items()}


def reused_us(kernel: TabulatedKernel, offset: Array, normal: Array, repeats: int) -> float:
    """Return the time [µs] per pair if the memory of the results has been written before."""
    u, t = np.zeros((2, len(offset), N_FIELDS**2))

    def action() -> None:
        evaluate(kernel.table, kernel.cells, kernel.coefficients, offset, normal, u, t)

    return 1e6 * median_time(action, repeats)["processor"] / len(offset)


def arithmetic(points: int) -> Record:
    """Count products, operations and bytes of coefficients of one interpolation and of one pair, from the formulas.

    Interpolation, for each column: polynomials in one direction take 36 multiply-adds for values and 28 for
    derivatives, and their sum in the other direction 22; the first term of a derivative reuses a product of the value.
    A pair: U takes one product per entry; T takes 25 x 3 contractions of stiffness and normal, 25 of which enter the
    other two, and 25 sums of 15 products of value and derivatives, each scaled.
    A sum over an element: each point takes U and derivatives of all columns and a multiply-add for each node, matrix
    and column; each element takes sums of 15 products per node, with stiffness and normal contracted once per plane.
    """
    entries, nodes = N_FIELDS**2, 4
    sums = WIDTH * (DEGREE * (DEGREE + 1) // 2 + DEGREE * (DEGREE - 1) // 2 + 3 * DEGREE - 2)
    products = sums - WIDTH * DEGREE
    added, contracted = nodes * 4 * WIDTH, nodes * entries * 15 / points
    result = {
        "interpolation": (products, sums),
        "pair": (products + entries * (1 + 11 + 17), sums + entries * (8 + 14)),
        "summed": (products + 6 * WIDTH + added + contracted, sums + 2 * WIDTH + added + contracted),
    }
    return {
        "products": {name: counts[0] for name, counts in result.items()},
        "operations": {name: sum(counts) for name, counts in result.items()},
        "bytes": 8 * WIDTH * (DEGREE + 1) * (DEGREE + 2) // 2,
    }
