"""Compiled sums of radial series over grids and cells; see meeframe_halfspace.radial."""

# mypy: ignore-errors
import numpy as np
from numba import njit

MAX_RULE = 10
"""Largest number of Gauss points along a side of a piece of a cell."""
MAX_DIVISIONS = 60
"""Largest number of halvings of a cell."""


@njit(cache=True, nogil=True)
def add_series(r, c, s, factor, series, values):
    """Add factor * series at radius r and the angle with cos c and sin s to values (entries,).

    series: edges (p + 1,), coefficients (p, t, n), counts (p, t) of nonzero ones; entries, harmonics, sines, (t,) each
    and sorted by harmonics.
    """
    edges, coefficients, counts, entries, harmonics, sines = series
    if r > edges[-1]:
        return
    panel = min(np.searchsorted(edges, r, side="right"), len(edges) - 1) - 1
    x = (2.0 * r - edges[panel] - edges[panel + 1]) / (edges[panel + 1] - edges[panel])
    cn, sn, n = 1.0, 0.0, 0
    for t in range(len(entries)):
        count = counts[panel, t]
        if count == 0:
            continue
        while n < harmonics[t]:
            cn, sn, n = cn * c - sn * s, sn * c + cn * s, n + 1
        b1, b2 = 0.0, 0.0
        for degree in range(count - 1, 0, -1):
            b1, b2 = 2.0 * x * b1 - b2 + coefficients[panel, t, degree], b1
        value = x * b1 - b2 + coefficients[panel, t, 0]
        values[entries[t]] += factor * value * (sn if sines[t] else cn)


@njit(cache=True, nogil=True)
def fill_samples(first, last, x, y, series, out):
    """Set out[:, i, j], (entries, nx, ny), to a series at offsets x[i], y[j] for rows first..last - 1."""
    values = np.empty(len(out))
    for i in range(first, last):
        for j in range(len(y)):
            r = np.sqrt(x[i] * x[i] + y[j] * y[j])
            c, s = (x[i] / r, y[j] / r) if r > 0.0 else (1.0, 0.0)
            values[:] = 0.0
            add_series(r, c, s, 1.0, series, values)
            out[:, i, j] = values


@njit(cache=True, nogil=True)
def fill_waves(first, last, along, across, window_x, window_y, nx, ny, series, entry, symbol):
    """Add to rows first..last - 1 of symbol one entry of a series in |q| times the windows over |q|; not at q = 0.

    As `fill_symbol`: the highest wave number of an even count stands for both signs.
    """
    values = np.empty(entry + 1)
    for i in range(first, last):
        for j in range(len(across)):
            q = np.sqrt(along[i] * along[i] + across[j] * across[j])
            if q == 0.0:
                continue
            c, s = along[i] / q, across[j] / q
            both_x, both_y = 2 * i == nx, 2 * j == ny
            values[entry] = 0.0
            add_series(q, c, s, 1.0, series, values)
            if both_x:
                add_series(q, -c, s, 1.0, series, values)
            if both_y:
                add_series(q, c, -s, 1.0, series, values)
            if both_x and both_y:
                add_series(q, -c, -s, 1.0, series, values)
            share = (0.5 if both_x else 1.0) * (0.5 if both_y else 1.0)
            symbol[i, j] += values[entry] * share * window_x[i] * window_y[j] / q


@njit(cache=True, nogil=True)
def _add_piece(x0, x1, y0, y1, weight, width, height, series, rules, values):
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
            for part in range(4):
                stack[count, 0], stack[count, 1] = (x0, xm) if part % 2 == 0 else (xm, x1)
                stack[count, 2], stack[count, 3] = (y0, ym) if part < 2 else (ym, y1)
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
                add_series(r, c, s, factor, series, values)


@njit(cache=True, nogil=True)
def fill_cells(first, last, spacing, pieces_x, pieces_y, width, height, series, rules, out):
    """Set out[:, i, j] to the integral of a series over the density around a node, as `fill_rows` does for K."""
    values = np.empty(len(out))
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
                        values,
                    )
            out[:, i, j] = values
