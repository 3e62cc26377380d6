"""Compiled propagation of waves from the surface of a half space into its depth.

A wave exp(i k m.x) of unit direction m = (cos a, sin a) decays as u(d) = exp(-k d G) u(0) with the depth d, where
G = T^-1 (Y^-1 + i R^T); see meeframe_halfspace.interior. The matrix exponential is computed by scaling and squaring of
its Taylor polynomial, which needs no eigenvectors.
"""

from math import factorial, hypot

import numpy as np
from numba import njit

DEGREE = 10
"""Degree of the Taylor polynomial: relative error 1e-11 at MAX_NORM."""
MAX_NORM = 0.5
"""Largest norm of the scaled exponent."""
INVERSE_FACTORIALS = np.array([1.0 / factorial(n) for n in range(DEGREE + 1)])


@njit(cache=True, nogil=True)
def _multiply(a, b, out):
    """Set out to the product of matrices a and b."""
    size = a.shape[0]
    for i in range(size):
        for j in range(size):
            total = 0j
            for k in range(size):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@njit(cache=True, nogil=True)
def _invert(matrix, out):
    """Set out to the inverse of a matrix, which is overwritten, by elimination with row pivots."""
    size = matrix.shape[0]
    for i in range(size):
        for j in range(size):
            out[i, j] = 1.0 if i == j else 0.0
    for column in range(size):
        pivot = column
        for row in range(column + 1, size):
            if abs(matrix[row, column]) > abs(matrix[pivot, column]):
                pivot = row
        if pivot != column:
            for j in range(size):
                matrix[column, j], matrix[pivot, j] = matrix[pivot, j], matrix[column, j]
                out[column, j], out[pivot, j] = out[pivot, j], out[column, j]
        factor = 1.0 / matrix[column, column]
        for j in range(size):
            matrix[column, j] *= factor
            out[column, j] *= factor
        for row in range(size):
            if row != column and matrix[row, column] != 0.0:
                factor = matrix[row, column]
                for j in range(size):
                    matrix[row, j] -= factor * matrix[column, j]
                    out[row, j] -= factor * out[column, j]


@njit(cache=True, nogil=True)
def _compliance(direction, even, odd, out):
    """Set out to Y of a direction exp(i a), from its series laid out as PointResponse.wave_series."""
    size, n_symmetric, n_antisymmetric = out.shape[0], even.shape[2], odd.shape[2]
    symmetric, antisymmetric = np.zeros(n_symmetric), np.zeros(n_antisymmetric)
    square, wave = direction * direction, 1.0 + 0j
    for n in range(even.shape[0]):
        for e in range(n_symmetric):
            symmetric[e] += even[n, 0, e] * wave.real + even[n, 1, e] * wave.imag
        wave *= square
    wave = direction
    for n in range(odd.shape[0]):
        for e in range(n_antisymmetric):
            antisymmetric[e] += odd[n, 0, e] * wave.real + odd[n, 1, e] * wave.imag
        wave *= square
    upper = strict = 0
    for i in range(size):
        for j in range(i, size):
            out[i, j] = out[j, i] = symmetric[upper]
            upper += 1
            if j > i:
                out[i, j] += 1j * antisymmetric[strict]
                out[j, i] -= 1j * antisymmetric[strict]
                strict += 1


@njit(cache=True, nogil=True)
def _exponential(matrix, scale, out, work):
    """Set out to exp(-scale * matrix); the matrix is preserved, work (2, f, f) is not."""
    size = matrix.shape[0]
    norm = 0.0
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += abs(matrix[i, j])
        norm = max(norm, scale * total)
    squarings = 0
    while norm > MAX_NORM:
        norm *= 0.5
        squarings += 1
    scaled, product = work[0], work[1]
    factor = -scale / 2.0**squarings
    for i in range(size):
        for j in range(size):
            scaled[i, j] = factor * matrix[i, j]
            out[i, j] = INVERSE_FACTORIALS[DEGREE] if i == j else 0.0
    for n in range(DEGREE - 1, -1, -1):
        _multiply(scaled, out, product)
        for i in range(size):
            for j in range(size):
                out[i, j] = product[i, j]
            out[i, i] += INVERSE_FACTORIALS[n]
    for _ in range(squarings):
        _multiply(out, out, product)
        for i in range(size):
            for j in range(size):
                out[i, j] = product[i, j]


@njit(cache=True, nogil=True)
def propagate(first, last, waves, loads, depth, even, odd, inverse_t, coupling, fields):
    """Fill fields[:, first:last] with the waves of values and derivatives at a depth.

    waves: (w, 2) wave vectors, none of them zero; loads: (f, w) extended tractions on the surface; even, odd: series of
    Y; inverse_t: T^-1 (f, f); coupling: (2, f, f), R^T of the directions e1 and e2; fields: (4, f, w), complex, with
    values and derivatives along e1, e2 and the outward normal.
    """
    size = inverse_t.shape[0]
    y, z, g = np.empty((3, size, size), np.complex128)
    exponential, work = np.empty((size, size), np.complex128), np.empty((2, size, size), np.complex128)
    surface, value = np.empty(size, np.complex128), np.empty(size, np.complex128)
    for w in range(first, last):
        k = hypot(waves[w, 0], waves[w, 1])
        cosine, sine = waves[w, 0] / k, waves[w, 1] / k
        _compliance(complex(cosine, sine), even, odd, y)
        for i in range(size):
            surface[i] = 0.0
            for j in range(size):
                surface[i] += y[i, j] * loads[j, w] / k
        _invert(y, z)
        for i in range(size):
            for j in range(size):
                z[i, j] += 1j * (cosine * coupling[0, i, j] + sine * coupling[1, i, j])
        for i in range(size):
            for j in range(size):
                g[i, j] = 0.0
                for m in range(size):
                    g[i, j] += inverse_t[i, m] * z[m, j]
        _exponential(g, k * depth, exponential, work)
        for i in range(size):
            value[i] = 0.0
            for j in range(size):
                value[i] += exponential[i, j] * surface[j]
        for i in range(size):
            slope = 0j
            for j in range(size):
                slope += g[i, j] * value[j]
            fields[0, i, w] = value[i]
            fields[1, i, w] = 1j * waves[w, 0] * value[i]
            fields[2, i, w] = 1j * waves[w, 1] * value[i]
            fields[3, i, w] = k * slope
