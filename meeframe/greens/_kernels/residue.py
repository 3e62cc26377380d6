"""The explicit fundamental solution, by residues at the five upper Stroh eigenvalues (eqs. 43-54)."""

import math

import numpy as np
from numba import njit

from meeframe.fields import N_FIELDS
from meeframe.greens._kernels.modulation import N_PACKED, PACKED, contract

N_SAMPLES = 16
N_TERMS = 9
ROOTS_OF_UNITY = np.exp(2j * np.pi * np.arange(N_SAMPLES) / N_SAMPLES)
COMPLEMENT = np.array([[j for j in range(N_FIELDS) if j != i] for i in range(N_FIELDS)])


@njit(cache=True, nogil=True)
def characteristic_forms(stiffness, triad):
    """Return Q, R + R^T and T of eqs. 44-45, (n, 3, 5, 5), on triads (n, 3, 3)."""
    n = triad.shape[0]
    forms = np.empty((n, 3, N_FIELDS, N_FIELDS))
    for point in range(n):
        contract(stiffness, triad[point, 0], triad[point, 0], forms[point, 0])
        contract(stiffness, triad[point, 0], triad[point, 1], forms[point, 1])
        contract(stiffness, triad[point, 1], triad[point, 1], forms[point, 2])
        forms[point, 1] += forms[point, 1].T.copy()
    return forms


@njit(cache=True, nogil=True)
def _cofactor(matrix, i, j):
    """Return a cofactor of a 5x5 matrix, from 2x2 minors."""
    a, b, c, d = matrix[COMPLEMENT[i, 0]], matrix[COMPLEMENT[i, 1]], matrix[COMPLEMENT[i, 2]], matrix[COMPLEMENT[i, 3]]
    w, x, y, z = COMPLEMENT[j, 0], COMPLEMENT[j, 1], COMPLEMENT[j, 2], COMPLEMENT[j, 3]
    value = (
        (a[w] * b[x] - a[x] * b[w]) * (c[y] * d[z] - c[z] * d[y])
        - (a[w] * b[y] - a[y] * b[w]) * (c[x] * d[z] - c[z] * d[x])
        + (a[w] * b[z] - a[z] * b[w]) * (c[x] * d[y] - c[y] * d[x])
        + (a[x] * b[y] - a[y] * b[x]) * (c[w] * d[z] - c[z] * d[w])
        - (a[x] * b[z] - a[z] * b[x]) * (c[w] * d[y] - c[y] * d[w])
        + (a[y] * b[z] - a[z] * b[y]) * (c[w] * d[x] - c[x] * d[w])
    )
    return value if (i + j) % 2 == 0 else -value


@njit(cache=True, nogil=True)
def _adjugate(forms, roots, coefficients):
    """Fill coefficients (15, 9) of w^4 adj(G) and return the constant of det(G), from samples on the unit circle.

    With p = tan(angle) and w = exp(2 i angle) real directions z = cos n + sin m lie on the unit circle, where G(z) is
    real, adj(G) = w^-4 (polynomial of degree 8) and det(G) = constant w^-5 prod (w - w_i)(1 - conj(w_i) w).
    """
    coefficients[:] = 0.0
    constant = 0.0
    for sample in range(N_SAMPLES):
        angle = math.pi * sample / N_SAMPLES
        c, s = math.cos(angle), math.sin(angle)
        matrix = (c * c) * forms[0] + (c * s) * forms[1] + (s * s) * forms[2]
        determinant = 0.0
        for i in range(N_FIELDS):
            for j in range(i, N_FIELDS):
                value = _cofactor(matrix, i, j)
                for k in range(N_TERMS):
                    coefficients[PACKED[i, j], k] += value * ROOTS_OF_UNITY[((4 - k) * sample) % N_SAMPLES] / N_SAMPLES
                if i == 0:
                    determinant += matrix[0, j] * value
        for root in roots:
            determinant /= abs(ROOTS_OF_UNITY[sample] - root) ** 2
        constant += determinant / N_SAMPLES
    return constant


@njit(cache=True, nogil=True)
def _moments(nodes, roots, repeat, vector, moments):
    """Fill moments with the divided differences at nodes (N,) of w^k / prod (1 - conj(root) w)^repeat, for all k.

    By the theorem of Opitz, the divided difference of f at nodes z is the last entry of the first row of f(Z), where Z
    has z on its diagonal and ones above it. It is the sum of residues of f / prod (w - z) even if nodes coincide, and
    its evaluation does not divide by differences of nodes.
    """
    last = nodes.shape[0] - 1
    vector[: last + 1] = 0.0
    vector[last] = 1.0
    for root in np.conj(roots):
        for _ in range(repeat):
            vector[last] /= 1.0 - root * nodes[last]
            for k in range(last - 1, -1, -1):
                vector[k] = (vector[k] + root * vector[k + 1]) / (1.0 - root * nodes[k])
    for power in range(moments.shape[0]):
        moments[power] = vector[0]
        for k in range(last):
            vector[k] = nodes[k] * vector[k] + vector[k + 1]
        vector[last] *= nodes[last]


@njit(cache=True, nogil=True)
def _double_residues(adjugate, moments, double):
    """Fill double (3, 15, 15) with M_ijPKMN of eq. 50 times the squared constant.

    The indices are nn, nm and mm of eq. 52, then PK and MN, packed. Only MN >= PK and three of the nine ij are computed
    (eqs. 53, 54).
    """
    weighted = np.empty((3, N_TERMS), np.complex128)
    for pk in range(N_PACKED):
        for b in range(N_TERMS):
            x0, x1, x2 = 0.0j, 0.0j, 0.0j
            for a in range(N_TERMS):
                x0 += adjugate[pk, a] * moments[a + b]
                x1 += adjugate[pk, a] * moments[a + b + 1]
                x2 += adjugate[pk, a] * moments[a + b + 2]
            # w cos^2, w cos sin and w sin^2 as polynomials in w.
            weighted[0, b] = 0.25 * (x2 + 2.0 * x1 + x0)
            weighted[1, b] = -0.25j * (x2 - x0)
            weighted[2, b] = 0.25 * (-x2 + 2.0 * x1 - x0)
        for mn in range(pk, N_PACKED):
            for form in range(3):
                total = 0.0
                for b in range(N_TERMS):
                    total += (weighted[form, b] * adjugate[mn, b]).real
                double[form, pk, mn] = double[form, mn, pk] = total


@njit(cache=True, nogil=True)
def _tangents(stiffness, triad, double, scale, modulation):
    """Fill modulation[1:] with A and B (15,) from M (eq. 49 without its first term, along n and m)."""
    along_n, along_m = np.empty((2, N_FIELDS, N_FIELDS))
    contract(stiffness, triad[0], triad[2], along_n)
    contract(stiffness, triad[1], triad[2], along_m)
    along_n += along_n.T.copy()
    along_m += along_m.T.copy()
    for p in range(N_FIELDS):
        for j in range(p, N_FIELDS):
            for tangent in range(2):
                total = 0.0
                for k in range(N_FIELDS):
                    for m in range(N_FIELDS):
                        pk, mj = PACKED[p, k], PACKED[m, j]
                        total += along_n[k, m] * double[tangent, pk, mj] + along_m[k, m] * double[tangent + 1, pk, mj]
                modulation[1 + tangent, PACKED[p, j]] = scale * total


@njit(cache=True, nogil=True)
def residue_modulation(stiffness, triad, forms, eigenvalues):
    """Return H, A, B (n, 3, 15) on triads (n, 3, 3) from forms (n, 3, 5, 5) and upper eigenvalues (n, 5)."""
    n = triad.shape[0]
    modulation = np.empty((n, 3, N_PACKED))
    adjugate = np.empty((N_PACKED, N_TERMS), np.complex128)
    double = np.empty((3, N_PACKED, N_PACKED))
    nodes, vector = np.empty(2 * N_FIELDS, np.complex128), np.empty(2 * N_FIELDS, np.complex128)
    single_moments, double_moments = np.empty(N_TERMS, np.complex128), np.empty(2 * N_TERMS + 1, np.complex128)
    for point in range(n):
        roots = (1j - eigenvalues[point]) / (1j + eigenvalues[point])
        constant = _adjugate(forms[point], roots, adjugate)
        _moments(roots, roots, 1, vector, single_moments)
        for entry in range(N_PACKED):
            total = 0.0
            for k in range(N_TERMS):
                total += (adjugate[entry, k] * single_moments[k]).real
            modulation[point, 0, entry] = total / constant
        for k in range(N_FIELDS):
            nodes[2 * k] = nodes[2 * k + 1] = roots[k]
        _moments(nodes, roots, 2, vector, double_moments)
        _double_residues(adjugate, double_moments, double)
        _tangents(stiffness, triad[point], double, 1.0 / constant**2, modulation[point])
    return modulation
