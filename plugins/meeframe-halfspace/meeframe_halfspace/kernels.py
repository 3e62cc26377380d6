"""Compiled sums of the point response over cells; for symbols see meeframe_halfspace.response.

The density of a cell is bilinear on rectangles. With d the vector from the source to the field point, the integral of
w(d) K(theta)/r over a rectangle of d is the sum over its edges of an integral in theta only, because the one along each
ray is that of a polynomial. On an edge at distance |a| from the point the variable is s with (distance along the edge)
= |a| sinh(s): the integrand is as smooth as K.
"""

# mypy: ignore-errors
import numpy as np
from numba import njit

from meeframe.plugin import prefetch

NEAR = 6.0
"""Cells within this distance in spacings are integrated along their edges, others by product rules."""
PREFETCH_COUNT = 64
"""Number of values at the beginning of a row of the symbol that are prefetched."""
CACHE_LINE = 8
"""Number of doubles in a cache line."""


@njit(cache=True, nogil=True)
def add_response(c, s, factor, even, odd, values):
    """Add factor * K(theta) to values (entries,), for c, s = cos, sin of theta.

    Symmetric entries are followed by antisymmetric ones.
    """
    n_symmetric, n_antisymmetric = even.shape[2], odd.shape[2]
    cn, sn = 1.0, 0.0
    step_c, step_s = c * c - s * s, 2.0 * s * c
    for n in range(even.shape[0]):
        for entry in range(n_symmetric):
            values[entry] += factor * (even[n, 0, entry] * cn + even[n, 1, entry] * sn)
        cn, sn = cn * step_c - sn * step_s, sn * step_c + cn * step_s
    cn, sn = c, s
    for n in range(odd.shape[0]):
        for entry in range(n_antisymmetric):
            values[n_symmetric + entry] += factor * (odd[n, 0, entry] * cn + odd[n, 1, entry] * sn)
        cn, sn = cn * step_c - sn * step_s, sn * step_c + cn * step_s


@njit(cache=True, nogil=True)
def _edge(a, low, high, upright, sign, weight, even, odd, rule, values):
    """Add the contribution of one edge at signed distance a from the point, from low to high along it.

    upright: True if the edge is parallel to y; weight: (p0, p1, q0, q1) of w = (p0 + p1 d_x)(q0 + q1 d_y); rule: (2, n)
    Gauss.
    """
    if a == 0.0:
        return
    p0, p1, q0, q1 = weight
    start, end = np.arcsinh(low / abs(a)), np.arcsinh(high / abs(a))
    half = (end - start) / 2.0
    for k in range(rule.shape[1]):
        t = start + half * (1.0 + rule[0, k])
        cosh = np.cosh(t)
        across, along = np.sign(a) / cosh, np.tanh(t)
        c, s = (across, along) if upright else (along, across)
        length = abs(a) * cosh
        moments = p0 * q0 + length * ((p1 * q0 * c + p0 * q1 * s) / 2.0 + length * p1 * q1 * c * s / 3.0)
        add_response(c, s, sign * half * rule[1, k] * a * moments, even, odd, values)


@njit(cache=True, nogil=True)
def _near(x, y, pieces_x, pieces_y, even, odd, rule, values):
    """Add the exact integral over a cell.

    pieces: (k, 4) rows (start, end, w0, w1) of the factor of the density in each direction, which is w0 + w1 *
    coordinate between start and end, relative to the centre of the cell.
    """
    for i in range(pieces_x.shape[0]):
        x0, x1 = x - pieces_x[i, 1], x - pieces_x[i, 0]
        p0, p1 = pieces_x[i, 2] + pieces_x[i, 3] * x, -pieces_x[i, 3]
        for j in range(pieces_y.shape[0]):
            y0, y1 = y - pieces_y[j, 1], y - pieces_y[j, 0]
            weight = (p0, p1, pieces_y[j, 2] + pieces_y[j, 3] * y, -pieces_y[j, 3])
            _edge(x1, y0, y1, True, 1.0, weight, even, odd, rule, values)
            _edge(x0, y0, y1, True, -1.0, weight, even, odd, rule, values)
            _edge(y1, x0, x1, False, 1.0, weight, even, odd, rule, values)
            _edge(y0, x0, x1, False, -1.0, weight, even, odd, rule, values)


@njit(cache=True, nogil=True)
def tabulate(even, odd, count):
    """Return K(theta), (count + 3, entries), at count angles from -1 step on, and periodically at two more."""
    table = np.zeros((count + 3, even.shape[2] + odd.shape[2]))
    for k in range(count + 3):
        theta = 2.0 * np.pi / count * (k - 1)
        add_response(np.cos(theta), np.sin(theta), 1.0, even, odd, table[k])
    return table


@njit(cache=True, nogil=True)
def _far(x, y, hx, hy, nodes, weights, around, values):
    """Add the product rule on a cell.

    nodes: (n,) in spacings; weights: (n,) with sum 1; around: K as returned by `tabulate`.
    """
    count = around.shape[0] - 3
    for i in range(len(nodes)):
        dx = x - hx * nodes[i]
        for j in range(len(nodes)):
            dy = y - hy * nodes[j]
            angle = np.arctan2(dy, dx) / (2.0 * np.pi) * count
            angle += count if angle < 0.0 else 0.0
            k = min(int(angle), count - 1)
            t = angle - k
            # cubic interpolation through the angles k - 1 .. k + 2
            u, v, w = t - 1.0, t - 2.0, t + 1.0
            factor = hx * hy * weights[i] * weights[j] / np.sqrt(dx * dx + dy * dy)
            c0, c1 = -factor * t * u * v / 6.0, factor * w * u * v / 2.0
            c2, c3 = -factor * w * t * v / 2.0, factor * w * t * u / 6.0
            for entry in range(around.shape[1]):
                values[entry] += (
                    c0 * around[k, entry]
                    + c1 * around[k + 1, entry]
                    + c2 * around[k + 2, entry]
                    + c3 * around[k + 3, entry]
                )


@njit(cache=True, nogil=True)
def cell_response(x, y, spacing, pieces_x, pieces_y, even, odd, around, rule, tables, thresholds, values):
    """Set values (entries,) to the response at (x, y) from the centre of a cell to a density that is 1 at the centre.

    around: K as returned by `tabulate`; rule: (2, n) Gauss on [-1, 1]; tables: (k, 2, k) nodes and weights of product
    rules with 1 to k points per direction; thresholds: (k,) distances in spacings from which each of them is accurate.
    """
    values[:] = 0.0
    distance = np.sqrt(x * x + y * y) / max(spacing[0], spacing[1])
    if distance < NEAR:
        _near(x, y, pieces_x, pieces_y, even, odd, rule, values)
        return
    n = len(thresholds)
    while n > 1 and distance >= thresholds[n - 2]:
        n -= 1
    _far(x, y, spacing[0], spacing[1], tables[n - 1, 0, :n], tables[n - 1, 1, :n], around, values)


@njit(cache=True, nogil=True)
def fill_rows(first, last, spacing, pieces_x, pieces_y, even, odd, around, rule, tables, thresholds, out):
    """Set out[:, i, j] to the response at i, j - (ny - 1) spacings along x, y from a cell, for rows first..last - 1.

    out: (entries, nx, 2 ny - 1).
    """
    values = np.empty(out.shape[0])
    middle = (out.shape[2] - 1) // 2
    for i in range(first, last):
        for j in range(out.shape[2]):
            x, y = i * spacing[0], (j - middle) * spacing[1]
            cell_response(x, y, spacing, pieces_x, pieces_y, even, odd, around, rule, tables, thresholds, values)
            for entry in range(len(values)):
                out[entry, i, j] = values[entry]


@njit(cache=True, nogil=True)
def series_values(c, s, coefficients, odd, work, values):
    """Set values[k, j] to series k (n, 2) in the angle with cos c[j] and sin s[j].

    The harmonics are 1, 3, ... if `odd`, else 0, 2, .... work: (4, len(c)). Loops over many angles with few arrays each
    are vectorized by the compiler.
    """
    step_c, step_s, cn, sn = work[0], work[1], work[2], work[3]
    for j in range(len(c)):
        step_c[j], step_s[j] = c[j], s[j]
        cn[j], sn[j] = (c[j], s[j]) if odd else (1.0, 0.0)
    _add_angles(step_c, step_s, c, s)
    values[:] = 0.0
    for n in range(coefficients.shape[1]):
        for k in range(len(values)):
            if coefficients[k, n, 0] != 0.0:
                _add(coefficients[k, n, 0], cn, values[k])
            if coefficients[k, n, 1] != 0.0:
                _add(coefficients[k, n, 1], sn, values[k])
        _add_angles(cn, sn, step_c, step_s)


@njit(cache=True, nogil=True)
def _add_angles(c, s, step_c, step_s):
    """Add in place to angles with cos c and sin s those with cos step_c and sin step_s."""
    for j in range(len(c)):
        new_c = c[j] * step_c[j] - s[j] * step_s[j]
        s[j] = s[j] * step_c[j] + c[j] * step_s[j]
        c[j] = new_c


@njit(cache=True, nogil=True)
def _add(factor, term, total):
    """Add factor * term to total."""
    for j in range(len(total)):
        total[j] += factor * term[j]


@njit(cache=True, nogil=True)
def fill_far(first, last, spacing, coefficients, odd, weights, middle, out):
    """Set out[:, i, middle + j] to the response of entries far from the cell, for rows first..last - 1, as `fill_rows`.

    coefficients: (m, n, 2) series of the entries, all odd or all even; weights: (2 k + 1,), symmetric, for the integral
    over a density from samples at the surrounding positions; out: (m, nx, middle + ny).
    """
    half_width, width = len(weights) // 2, out.shape[2]
    # samples of row i are stored at i modulo their number
    samples = np.empty((len(out), len(weights), width + 2 * half_width))
    across, inverse, c, s = np.empty((4, samples.shape[2]))
    work, values = np.empty((4, samples.shape[2])), np.empty((len(out), samples.shape[2]))
    y = (np.arange(samples.shape[2]) - (half_width + middle)) * spacing[1]
    area = spacing[0] * spacing[1]
    for sample_row in range(first - half_width, last + half_width):
        x, i = sample_row * spacing[0], sample_row - half_width
        for j in range(len(y)):
            distance = np.sqrt(x * x + y[j] * y[j])
            inverse[j] = 1.0 / distance if distance > 0.0 else 0.0
        for j in range(len(y)):
            c[j] = x * inverse[j]
        for j in range(len(y)):
            s[j] = y[j] * inverse[j]
        series_values(c, s, coefficients, odd, work, values)
        for entry in range(len(out)):
            row = samples[entry, sample_row % len(weights)]
            for j in range(len(row)):
                row[j] = values[entry, j] * area * inverse[j]
            if i < first:
                continue
            source, target = samples[entry, i % len(weights)], out[entry, i]
            for j in range(len(across)):
                across[j] = weights[half_width] * source[j]
            for k in range(1, half_width + 1):
                rows = samples[entry, (i - k) % len(weights)], samples[entry, (i + k) % len(weights)]
                _add_both(weights[half_width + k], *rows, across)
            for j in range(width):
                target[j] = weights[half_width] * across[half_width + j]
            for k in range(1, half_width + 1):
                columns = (
                    across[half_width - k : half_width - k + width],
                    across[half_width + k : half_width + k + width],
                )
                _add_both(weights[half_width + k], *columns, target)


@njit(cache=True, nogil=True)
def _add_both(factor, left, right, total):
    """Add factor * (left + right) to total."""
    for j in range(len(total)):
        total[j] += factor * (left[j] + right[j])


@njit(cache=True, nogil=True)
def fill_symbol(first, last, along, across, window_x, window_y, nx, ny, coefficients, odd, symbol):
    """Set rows first..last - 1 of symbol to one entry of Y(q)/|q| times the windows; zero at q = 0.

    along, across: wave numbers (nx // 2 + 1,), (ny,); coefficients: series of the entry in the angle of q. The highest
    wave number of an even count stands for both signs: the mean of the two is real where it must be.
    """
    inverse, c, s = np.empty((3, symbol.shape[1]))
    work, work_one = np.empty((4, symbol.shape[1])), np.empty((4, 1))
    full_row, one = np.empty((1, symbol.shape[1])), np.empty((1, 1))
    values, series = full_row[0], coefficients.reshape(1, len(coefficients), 2)
    for i in range(first, last):
        symbol[i] = 0.0
        for j in range(len(values)):
            k = np.sqrt(along[i] * along[i] + across[j] * across[j])
            inverse[j] = 1.0 / k if k > 0.0 else 0.0
        for j in range(len(values)):
            s[j] = across[j] * inverse[j]
        passes = 2 if 2 * i == nx else 1
        for side in range(passes):
            for j in range(len(values)):
                c[j] = (1.0 - 2.0 * side) * along[i] * inverse[j]
            series_values(c, s, series, odd, work, full_row)
            if ny % 2 == 0:
                last_y = slice(ny // 2, ny // 2 + 1)
                series_values(c[last_y], -s[last_y], series, odd, work_one, one)
                values[ny // 2] = 0.5 * (values[ny // 2] + one[0, 0])
            _add(window_x[i] / passes, values, symbol[i])
        for j in range(len(values)):
            symbol[i, j] *= window_y[j] * inverse[j]


@njit(cache=True, nogil=True)
def multiply_waves(first, entries, terms, factors, waves, products):
    """Set products[a] to the sum of factor * entry * waves[b] in rows first, first + 1, ... of the spectrum.

    entries: (n, all rows, py), real, or (n, all rows, py // 2 + 1) if each is an even or odd function along the rows;
    terms: (t, 5) rows (a, b, entry, 1 to multiply by i, else 0, 1 or -1 for even and odd functions), those of an entry
    in sequence; waves: (l, rows, py), products: (k, rows, py), complex; factors: (t,), in the precision of these. The
    loop is over rows so that waves and products stay in the nearest cache.
    """
    count, width = entries.shape[2], products.shape[2]
    real = np.empty(width, factors.dtype)
    for row in range(products.shape[1]):
        for a in range(len(products)):
            products[a, row] = 0.0
        previous = -1
        for term in range(len(terms)):
            a, b, entry, imaginary = terms[term, 0], terms[term, 1], terms[term, 2], terms[term, 3]
            if entry != previous:
                next_row = (entry * entries.shape[1] + first + row + 1) * count
                for index in range(next_row, next_row + PREFETCH_COUNT, CACHE_LINE):
                    prefetch(entries, index)
                _unfold(entries[entry, first + row], terms[term, 4], real)
                previous = entry
            if imaginary:
                _add_imaginary(real, factors[term], waves[b, row], products[a, row])
            else:
                _add_real(real, factors[term], waves[b, row], products[a, row])


@njit(cache=True, nogil=True)
def _unfold(half, parity, full_row):
    """Set full (py,) to half (py // 2 + 1,) and its mirrored continuation."""
    count, width = len(half), len(full_row)
    for j in range(count):
        full_row[j] = half[j]
    if parity > 0:
        for j in range(count, width):
            full_row[j] = half[width - j]
    else:
        for j in range(count, width):
            full_row[j] = -half[width - j]


@njit(cache=True, nogil=True)
def _add_real(real, factor, waves, products):
    """Add factor * real * waves to products, entry by entry."""
    for j in range(len(products)):
        k = factor * real[j]
        products[j] += complex(k * waves[j].real, k * waves[j].imag)


@njit(cache=True, nogil=True)
def _add_imaginary(imaginary, factor, waves, products):
    """Add i * factor * imaginary * waves to products, entry by entry."""
    for j in range(len(products)):
        k = factor * imaginary[j]
        products[j] += complex(-k * waves[j].imag, k * waves[j].real)
