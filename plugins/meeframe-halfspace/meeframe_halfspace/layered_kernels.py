"""Compiled sums of radial series over grids and cells; see meeframe_halfspace.radial."""

# mypy: ignore-errors
import numpy as np
from numba import njit

MAX_RULE = 10
"""Largest number of Gauss points along a side of a piece of a cell."""
MAX_DIVISIONS = 60
"""Largest number of halvings of a cell."""


@njit(cache=True, nogil=True)
def sum_degrees(r, series, radial):
    """Set radial (t,) to the coefficients of all terms at radius r.

    series: edges (p + 1,), coefficients (p, n, t), numbers of the terms (p, n) up to the last one with a nonzero
    coefficient of a degree; entries, harmonics, sines, (t,) each and sorted by harmonics.
    """
    edges, coefficients, counts = series[:3]
    radial[:] = 0.0
    if r > edges[-1]:
        return
    panel = min(np.searchsorted(edges, r, side="right"), len(edges) - 1) - 1
    x = (2.0 * r - edges[panel] - edges[panel + 1]) / (edges[panel + 1] - edges[panel])
    before, polynomial = x, 1.0
    for degree in range(coefficients.shape[1]):
        row = coefficients[panel, degree]
        for t in range(counts[panel, degree]):
            radial[t] += polynomial * row[t]
        before, polynomial = polynomial, (2.0 if degree else 1.0) * x * polynomial - (before if degree else 0.0)


@njit(cache=True, nogil=True)
def add_terms(c, s, factor, series, radial, values):
    """Add factor * terms at the angle with cos c and sin s to values (2, entries): of cosines and of sines."""
    entries, harmonics, sines = series[3:]
    cn, sn, n = 1.0, 0.0, 0
    for t in range(len(entries)):
        while n < harmonics[t]:
            cn, sn, n = cn * c - sn * s, sn * c + cn * s, n + 1
        values[sines[t], entries[t]] += factor * radial[t] * (sn if sines[t] else cn)


@njit(cache=True, nogil=True)
def fill_samples(first, last, x, y, middle, series, out):
    """Set out[:, i, j], (entries, nx, ny), to a series at offsets x[i], y[j] for rows first..last - 1.

    middle: index of zero in y, whose values are opposite on both sides of it, as far as there are any.
    """
    radial, values = np.empty(len(series[3])), np.empty((2, len(out)))
    for i in range(first, last):
        for j in range(len(y)):
            mirror = 2 * middle - j
            if middle < mirror < len(y):
                continue
            r = np.sqrt(x[i] * x[i] + y[j] * y[j])
            c, s = (x[i] / r, y[j] / r) if r > 0.0 else (1.0, 0.0)
            values[:] = 0.0
            sum_degrees(r, series, radial)
            add_terms(c, s, 1.0, series, radial, values)
            for entry in range(len(out)):
                out[entry, i, j] = values[0, entry] + values[1, entry]
                if 0 <= mirror < middle:
                    out[entry, i, mirror] = values[0, entry] - values[1, entry]


@njit(cache=True, nogil=True)
def fill_products(first, last, starts, columns, weights, values, out):
    """Set rows first..last - 1 of out, (count, n, width), to those of a sparse matrix times values (count, m, width).

    starts (n + 1,), columns, weights: the matrix by rows. scipy takes several times as long.
    """
    for number in range(len(out)):
        for i in range(first, last):
            target = out[number, i]
            target[:] = 0.0
            for index in range(starts[i], starts[i + 1]):
                weight, source = weights[index], values[number, columns[index]]
                for j in range(len(target)):
                    target[j] += weight * source[j]


@njit(cache=True, nogil=True)
def fill_waves(first, last, along, across, window_x, window_y, nx, ny, series, entry, symbol):
    """Add to rows first..last - 1 of symbol one entry of a series in |q| times the windows over |q|; not at q = 0.

    As `fill_symbol`: the highest wave number of an even count stands for both signs.
    """
    radial, values = np.empty(len(series[3])), np.empty((2, entry + 1))
    for i in range(first, last):
        for j in range(len(across)):
            q = np.sqrt(along[i] * along[i] + across[j] * across[j])
            if q == 0.0:
                continue
            c, s = along[i] / q, across[j] / q
            both_x, both_y = 2 * i == nx, 2 * j == ny
            values[:] = 0.0
            sum_degrees(q, series, radial)
            add_terms(c, s, 1.0, series, radial, values)
            if both_x:
                add_terms(-c, s, 1.0, series, radial, values)
            if both_y:
                add_terms(c, -s, 1.0, series, radial, values)
            if both_x and both_y:
                add_terms(-c, -s, 1.0, series, radial, values)
            share = (0.5 if both_x else 1.0) * (0.5 if both_y else 1.0)
            symbol[i, j] += (values[0, entry] + values[1, entry]) * share * window_x[i] * window_y[j] / q


@njit(cache=True, nogil=True)
def _add_piece(x0, x1, y0, y1, weight, width, height, series, rules, radial, values):
    """Add the integral over the rectangle of offsets times (w0 + w1 x)(w2 + w3 y), divided until it is accurate.

    width: sides of the rectangle are at most this part of the distance from the singularities of the series, which lie
    at imaginary heights above the source: sqrt(r^2 + height^2); rules: (n, 2, n) Gauss rules on [-1, 1].
    """
    stack = np.empty((3 * MAX_DIVISIONS + 4, 4))
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = x0, x1, y0, y1
    count = 1
    while count > 0:
        count -= 1
        x0, x1, y0, y1 = stack[count, 0], stack[count, 1], stack[count, 2], stack[count, 3]
        near_x = max(x0, 0.0) if x0 > 0.0 else min(x1, 0.0)
        near_y = max(y0, 0.0) if y0 > 0.0 else min(y1, 0.0)
        ratio = max(x1 - x0, y1 - y0) / np.sqrt(near_x * near_x + near_y * near_y + height * height)
        if ratio > 1.0 and count < 3 * MAX_DIVISIONS:
            xm, ym = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
            for quarter in range(4):
                stack[count, 0], stack[count, 1] = (x0, xm) if quarter % 2 == 0 else (xm, x1)
                stack[count, 2], stack[count, 3] = (y0, ym) if quarter < 2 else (ym, y1)
                count += 1
            continue
        # the error of n points falls like (ratio / 4)^(2 n)
        n = int(np.ceil(width / np.log(4.0 / ratio)))
        n = min(max(n, 2), MAX_RULE)
        half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
        for i in range(n):
            x = x0 + half_x * (1.0 + rules[n - 1, 0, i])
            for j in range(n):
                y = y0 + half_y * (1.0 + rules[n - 1, 0, j])
                r = np.sqrt(x * x + y * y)
                c, s = (x / r, y / r) if r > 0.0 else (1.0, 0.0)
                density = (weight[0] + weight[1] * x) * (weight[2] + weight[3] * y)
                factor = half_x * half_y * rules[n - 1, 1, i] * rules[n - 1, 1, j] * density
                sum_degrees(r, series, radial)
                add_terms(c, s, factor, series, radial, values)


@njit(cache=True, nogil=True)
def fill_cells(first, last, spacing, pieces_x, pieces_y, width, height, series, rules, out):
    """Set out[:, i, j] to the integral of a series over the density around a node, as `fill_rows` does for K."""
    radial, values = np.empty(len(series[3])), np.empty((2, len(out)))
    weight = np.empty(4)
    middle = (out.shape[2] - 1) // 2
    for i in range(first, last):
        x = i * spacing[0]
        for j in range(out.shape[2]):
            y = (j - middle) * spacing[1]
            values[:] = 0.0
            for a in range(pieces_x.shape[0]):
                weight[0], weight[1] = pieces_x[a, 2] + pieces_x[a, 3] * x, -pieces_x[a, 3]
                for b in range(pieces_y.shape[0]):
                    weight[2], weight[3] = pieces_y[b, 2] + pieces_y[b, 3] * y, -pieces_y[b, 3]
                    _add_piece(
                        x - pieces_x[a, 1],
                        x - pieces_x[a, 0],
                        y - pieces_y[b, 1],
                        y - pieces_y[b, 0],
                        weight,
                        width,
                        height,
                        series,
                        rules,
                        radial,
                        values,
                    )
            for entry in range(len(out)):
                out[entry, i, j] = values[0, entry] + values[1, entry]
