"""H and its tangential derivatives as means over the half circle normal to a direction.

Source: Barnett (docs/explanation/theory.md, Fundamental solution).

Directions are processed in groups of LANES, over which the compiler vectorises: arrays are flat, lanes run fastest, and
functions that are called in a loop over lanes are inlined.
"""

import math

import numpy as np
from numba import njit

from meeframe.fields import N_FIELDS
from meeframe.greens._kernels.modulation import N_PACKED, N_PAIRS

LANES = 32
MATRIX = N_PAIRS * LANES
"""Length of a group of 5x5 matrices."""
FORM_AXES = np.array([[0, 0], [0, 1], [1, 1], [0, 2], [1, 2]])
"""Axes of a triad (n, m, e) of each form."""
UPPER_ENTRIES = np.flatnonzero(np.triu(np.ones((N_FIELDS, N_FIELDS))))
"""Entries of a 5x5 matrix in its packed upper triangle."""


@njit(cache=True, nogil=True, fastmath={"contract"})
def _form(stiffness, a, b, products, form):
    """Fill form (MATRIX,) with C_iJKm (a_i b_m + b_i a_m) as [J, K], for vectors a, b (3 LANES,).

    products (6 LANES,) is scratch.
    """
    for p in range(LANES):
        ax, ay, az = a[p], a[LANES + p], a[2 * LANES + p]
        bx, by, bz = b[p], b[LANES + p], b[2 * LANES + p]
        products[p], products[LANES + p], products[2 * LANES + p] = 2.0 * ax * bx, 2.0 * ay * by, 2.0 * az * bz
        products[3 * LANES + p], products[4 * LANES + p] = ax * by + bx * ay, ay * bz + by * az
        products[5 * LANES + p] = az * bx + bz * ax
    for j in range(N_FIELDS):
        for k in range(N_FIELDS):
            c = stiffness[:, j, k, :]
            xx, yy, zz = c[0, 0], c[1, 1], c[2, 2]
            xy, yz, zx = c[0, 1] + c[1, 0], c[1, 2] + c[2, 1], c[2, 0] + c[0, 2]
            first = (N_FIELDS * j + k) * LANES
            for p in range(LANES):
                form[first + p] = (
                    xx * products[p]
                    + yy * products[LANES + p]
                    + zz * products[2 * LANES + p]
                    + xy * products[3 * LANES + p]
                    + yz * products[4 * LANES + p]
                    + zx * products[5 * LANES + p]
                )


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _inverse(g00, g01, g02, g03, g04, g11, g12, g13, g14, g22, g23, g24, g33, g34, g44):
    """Return the inverse of a symmetric 5x5 matrix with definite diagonal blocks of opposite sign.

    The inverse of [[A, B], [B^T, D]] is [[A^-1 + X Y^T, -Y], [-Y^T, S^-1]] with X = A^-1 B, S = D - B^T X, Y = X S^-1,
    where A (mechanical) and S are definite. The result may not be finite for other matrices.
    """
    a00, a01, a02 = g11 * g22 - g12 * g12, g02 * g12 - g01 * g22, g01 * g12 - g02 * g11
    scale = 1.0 / (g00 * a00 + g01 * a01 + g02 * a02)
    a00, a01, a02 = scale * a00, scale * a01, scale * a02
    a11, a12, a22 = scale * (g00 * g22 - g02 * g02), scale * (g01 * g02 - g00 * g12), scale * (g00 * g11 - g01 * g01)
    x03, x04 = a00 * g03 + a01 * g13 + a02 * g23, a00 * g04 + a01 * g14 + a02 * g24
    x13, x14 = a01 * g03 + a11 * g13 + a12 * g23, a01 * g04 + a11 * g14 + a12 * g24
    x23, x24 = a02 * g03 + a12 * g13 + a22 * g23, a02 * g04 + a12 * g14 + a22 * g24
    s33 = g33 - (g03 * x03 + g13 * x13 + g23 * x23)
    s34 = g34 - (g03 * x04 + g13 * x14 + g23 * x24)
    s44 = g44 - (g04 * x04 + g14 * x14 + g24 * x24)
    scale = 1.0 / (s33 * s44 - s34 * s34)
    s33, s34, s44 = scale * s44, -scale * s34, scale * s33
    y03, y04 = x03 * s33 + x04 * s34, x03 * s34 + x04 * s44
    y13, y14 = x13 * s33 + x14 * s34, x13 * s34 + x14 * s44
    y23, y24 = x23 * s33 + x24 * s34, x23 * s34 + x24 * s44
    return (
        (a00 + x03 * y03 + x04 * y04, a01 + x03 * y13 + x04 * y14, a02 + x03 * y23 + x04 * y24, -y03, -y04),
        (a11 + x13 * y13 + x14 * y14, a12 + x13 * y23 + x14 * y24, -y13, -y14),
        (a22 + x23 * y23 + x24 * y24, -y23, -y24),
        (s33, s34, s44),
    )


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _invert(f, c, s, inverse):
    """Fill inverse (MATRIX,) with the inverses of c^2 f0 / 2 + c s f1 + s^2 f2 / 2, for forms f (5 MATRIX,)."""
    cc, cs, ss = 0.5 * c * c, c * s, 0.5 * s * s
    for p in range(LANES):
        g00 = cc * f[0 * LANES + p] + cs * f[25 * LANES + p] + ss * f[50 * LANES + p]
        g01 = cc * f[1 * LANES + p] + cs * f[26 * LANES + p] + ss * f[51 * LANES + p]
        g02 = cc * f[2 * LANES + p] + cs * f[27 * LANES + p] + ss * f[52 * LANES + p]
        g03 = cc * f[3 * LANES + p] + cs * f[28 * LANES + p] + ss * f[53 * LANES + p]
        g04 = cc * f[4 * LANES + p] + cs * f[29 * LANES + p] + ss * f[54 * LANES + p]
        g11 = cc * f[6 * LANES + p] + cs * f[31 * LANES + p] + ss * f[56 * LANES + p]
        g12 = cc * f[7 * LANES + p] + cs * f[32 * LANES + p] + ss * f[57 * LANES + p]
        g13 = cc * f[8 * LANES + p] + cs * f[33 * LANES + p] + ss * f[58 * LANES + p]
        g14 = cc * f[9 * LANES + p] + cs * f[34 * LANES + p] + ss * f[59 * LANES + p]
        g22 = cc * f[12 * LANES + p] + cs * f[37 * LANES + p] + ss * f[62 * LANES + p]
        g23 = cc * f[13 * LANES + p] + cs * f[38 * LANES + p] + ss * f[63 * LANES + p]
        g24 = cc * f[14 * LANES + p] + cs * f[39 * LANES + p] + ss * f[64 * LANES + p]
        g33 = cc * f[18 * LANES + p] + cs * f[43 * LANES + p] + ss * f[68 * LANES + p]
        g34 = cc * f[19 * LANES + p] + cs * f[44 * LANES + p] + ss * f[69 * LANES + p]
        g44 = cc * f[24 * LANES + p] + cs * f[49 * LANES + p] + ss * f[74 * LANES + p]
        (h00, h01, h02, h03, h04), (h11, h12, h13, h14), (h22, h23, h24), (h33, h34, h44) = _inverse(
            g00, g01, g02, g03, g04, g11, g12, g13, g14, g22, g23, g24, g33, g34, g44
        )
        inverse[0 * LANES + p] = h00
        inverse[1 * LANES + p] = inverse[5 * LANES + p] = h01
        inverse[2 * LANES + p] = inverse[10 * LANES + p] = h02
        inverse[3 * LANES + p] = inverse[15 * LANES + p] = h03
        inverse[4 * LANES + p] = inverse[20 * LANES + p] = h04
        inverse[6 * LANES + p] = h11
        inverse[7 * LANES + p] = inverse[11 * LANES + p] = h12
        inverse[8 * LANES + p] = inverse[16 * LANES + p] = h13
        inverse[9 * LANES + p] = inverse[21 * LANES + p] = h14
        inverse[12 * LANES + p] = h22
        inverse[13 * LANES + p] = inverse[17 * LANES + p] = h23
        inverse[14 * LANES + p] = inverse[22 * LANES + p] = h24
        inverse[18 * LANES + p] = h33
        inverse[19 * LANES + p] = inverse[23 * LANES + p] = h34
        inverse[24 * LANES + p] = h44


@njit(cache=True, nogil=True, fastmath={"contract"})
def _multiply(a, b, product):
    """Fill product (MATRIX,) with the products of matrices a and b (MATRIX,)."""
    for i in range(N_FIELDS):
        for j in range(N_FIELDS):
            for p in range(LANES):
                value = 0.0
                for k in range(N_FIELDS):
                    value += a[(N_FIELDS * i + k) * LANES + p] * b[(N_FIELDS * k + j) * LANES + p]
                product[(N_FIELDS * i + j) * LANES + p] = value


@njit(cache=True, nogil=True, fastmath={"contract"})
def _add_angles(forms, first, step, count, with_tangents, total, work):
    """Add to total (3 MATRIX,) the integrands G^-1, cos F, sin F at angles first + k step; work: scratch arrays."""
    inverse, rotated, product = work
    for node in range(count):
        angle = first + node * step
        c, s = math.cos(angle), math.sin(angle)
        _invert(forms, c, s, inverse)
        for q in range(MATRIX):
            total[q] += inverse[q]
        if with_tangents:
            for q in range(MATRIX):
                rotated[q] = c * forms[3 * MATRIX + q] + s * forms[4 * MATRIX + q]
            _multiply(inverse, rotated, product)
            _multiply(product, inverse, rotated)
            for q in range(MATRIX):
                total[MATRIX + q] += c * rotated[q]
                total[2 * MATRIX + q] += s * rotated[q]


@njit(cache=True, nogil=True, error_model="numpy")
def _compare(total, previous, change, scale):
    """Fill change (LANES,) with the largest change of an entry with respect to twice the previous sum.

    An entry i, j is relative to the root of H_ii H_jj, so that each field counts alike, whatever its units and whether
    or not it is coupled to others. scale (5 LANES,) is scratch.
    """
    for i in range(N_FIELDS):
        for p in range(LANES):
            scale[i * LANES + p] = 1.0 / math.sqrt(abs(total[(N_FIELDS + 1) * i * LANES + p]))
    change[:] = 0.0
    for first in range(0, len(total), MATRIX):
        for i in range(N_FIELDS):
            for j in range(N_FIELDS):
                entry = first + (N_FIELDS * i + j) * LANES
                for p in range(LANES):
                    difference = abs(total[entry + p] - 2.0 * previous[entry + p])
                    change[p] = max(change[p], difference * scale[i * LANES + p] * scale[j * LANES + p])


@njit(cache=True, nogil=True)
def line_integrals(stiffness, triad, points, max_points, tolerance, with_tangents):
    """Return H, A, B (n, 3, 15) on triads (n, 3, 3), or H alone, (n, 1, 15), and a flag of convergence of all.

    The trapezoidal rule starts with a quarter of the points and doubles them, reusing the values, until its last change
    and the square of the change before are at most the tolerance. Each direction stops by itself.

    The change from n to 2n nodes is about r^n cos(n p), with a phase p, and the error that remains is r^2n. Where
    cos(n p) = 0, the change vanishes by accident, however large r is; there the square of the change before is r^n / 2.
    """
    n = triad.shape[0]
    axes, products, forms = np.empty((3, 3 * LANES)), np.empty(6 * LANES), np.empty(len(FORM_AXES) * MATRIX)
    work = (np.empty(MATRIX), np.empty(MATRIX), np.empty(MATRIX))
    change, change_before, scale = np.empty(LANES), np.empty(LANES), np.empty(N_FIELDS * LANES)
    n_functions = 3 if with_tangents else 1
    modulation = np.zeros((n, n_functions, N_PACKED))
    total = np.empty(n_functions * MATRIX)
    for first in range(0, n, LANES):
        n_used = min(LANES, n - first)
        for p in range(LANES):
            for axis in range(3):
                for i in range(3):
                    axes[axis, i * LANES + p] = triad[first + min(p, n_used - 1), axis, i]
        for form in range(len(FORM_AXES) if with_tangents else 3):
            a, b = FORM_AXES[form]
            _form(stiffness, axes[a], axes[b], products, forms[form * MATRIX : (form + 1) * MATRIX])
        total[:] = 0.0
        count = (points + 3) // 4
        step = math.pi / count
        _add_angles(forms, 0.0, step, count, with_tangents, total, work)
        converged = np.arange(LANES) >= n_used
        change[:] = np.inf
        while not converged.all():
            if count > max_points:
                return modulation, False
            previous = total.copy()
            _add_angles(forms, 0.5 * step, step, count, with_tangents, total, work)
            count *= 2
            step *= 0.5
            change, change_before = change_before, change
            _compare(total, previous, change, scale)
            for p in range(n_used):
                if not converged[p] and max(change[p], change_before[p] ** 2) <= tolerance:
                    converged[p] = True
                    for function in range(n_functions):
                        for entry in range(N_PACKED):
                            source = function * MATRIX + UPPER_ENTRIES[entry] * LANES + p
                            modulation[first + p, function, entry] = total[source] / count
    return modulation, bool(np.isfinite(modulation).all())
