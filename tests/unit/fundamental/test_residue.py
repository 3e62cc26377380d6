"""The residue form agrees with the line integral at distinct, nearly equal and equal Stroh eigenvalues."""

import numpy as np
import pytest

from meeframe.greens import LineIntegral, Residue
from meeframe.greens._kernels.modulation import PACKED, triads
from meeframe.greens._kernels.residue import characteristic_forms
from meeframe.material.stroh import stroh_eigenvalues
from meeframe.testing.fundamental import relative_error, unit_vectors

DISTINCT, DEGENERATE = 1e-10, 1e-8
GAPS = [*10.0 ** -np.arange(1.0, 15.0), 0.0]


def assert_equals_line_integral(stiffness, offset, normal, tolerance):
    exact = LineIntegral().bind(stiffness).evaluate(offset, normal)
    u, t = Residue().bind(stiffness).evaluate(offset, normal)
    assert relative_error(u, exact[0]) < tolerance
    assert relative_error(t, exact[1]) < tolerance


def sums_of_residues(stiffness, triad):
    """Return H of eq. 43 and the factor of 1 / (4 pi r^2) in eq. 48 by eqs. 49-52, for one triad with distinct
    eigenvalues.

    Each residue is the mean over a circle around its eigenvalue with half the distance to the nearest other one.
    """
    n, m, e = triad
    q, rr, tt = forms = characteristic_forms(stiffness, triad[None])[0]
    upper = stroh_eigenvalues(forms[None])[0]
    roots = np.concatenate([upper, upper.conj()])
    circle = np.exp(2j * np.pi * np.arange(128) / 128)
    h, double = np.zeros((5, 5), complex), np.zeros((3, 3, 5, 5, 5, 5), complex)
    for root in upper:
        gap = np.sort(np.abs(roots - root))[1]
        p = root + 0.5 * gap * circle
        weight = 0.5 * gap * circle / len(circle)
        inverse = np.linalg.inv(q + rr * p[:, None, None] + tt * (p * p)[:, None, None])
        z = n + p[:, None] * m
        h += 2j * np.einsum("s,sjk->jk", weight, inverse)
        double += 2j * np.pi * np.einsum("s,si,sj,spk,smn->ijpkmn", weight, z, z, inverse, inverse, optimize=True)
    m_s, m_r = (np.einsum(f"rkms,q{x}pkmj,{y}->pjq", stiffness, double, e) for x, y in (("s", "r"), ("r", "s")))
    return h.real, (-np.einsum("q,pj->pjq", e, h) + (m_s + m_r) / np.pi).real


def test_equations_43_to_52_term_by_term(orthotropic, random):
    offset = unit_vectors(random, 10)
    _, triad = triads(offset)
    kernel = Residue().bind(orthotropic)
    u, gradient = kernel.evaluate(offset, offset)[0], kernel.gradient(offset)
    for point in range(10):
        h, tangent = sums_of_residues(orthotropic, triad[point])
        assert relative_error(4 * np.pi * u[point][None], h[None]) < DISTINCT
        assert relative_error(4 * np.pi * gradient[point][None], tangent[None]) < DISTINCT


def test_eigenvalues_are_roots_of_the_determinant(orthotropic, random):
    forms = characteristic_forms(orthotropic, triads(unit_vectors(random, 30))[1])
    p = stroh_eigenvalues(forms)
    assert (p.imag > 0.0).all()
    gamma = forms[:, None, 0] + p[..., None, None] * forms[:, None, 1] + (p * p)[..., None, None] * forms[:, None, 2]
    smallest = np.linalg.svd(gamma, compute_uv=False)[..., -1]
    assert smallest.max() < 1e-12


def test_distinct_eigenvalues(stiffness, random):
    offset = random.normal(size=(500, 3))
    assert_equals_line_integral(stiffness, offset, unit_vectors(random, 500), DISTINCT)


@pytest.mark.parametrize("gap", GAPS)
def test_electric_eigenvalue_close_to_the_others(gap, isotropic, random):
    """With eps_33 = eps (1 + gap)^2 of an isotropic body, along x1 one eigenvalue is i / (1 + gap) and four are i."""
    stiffness = isotropic.copy()
    stiffness[2, 3, 3, 2] *= (1.0 + gap) ** 2
    offset = random.normal(size=(60, 3))
    offset[0] = [1.0, 0.0, 0.0]
    offset[1:20, 2] = 0.0
    assert_equals_line_integral(stiffness, offset, unit_vectors(random, 60), DEGENERATE)


@pytest.mark.parametrize("gap", GAPS)
def test_close_to_the_axis_of_transverse_isotropy(gap, transversely_isotropic, random):
    """All five eigenvalues coincide on the axis; their distance grows with the square of the angle to it."""
    tilt = np.sqrt(gap)
    azimuth = random.uniform(0.0, 2.0 * np.pi, 30)
    offset = np.stack(
        [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.full(30, np.cos(tilt))], axis=1
    )
    assert_equals_line_integral(transversely_isotropic, offset, unit_vectors(random, 30), DEGENERATE)


@pytest.mark.parametrize("gap", GAPS)
def test_vanishing_anisotropy_and_coupling(gap, isotropic, orthotropic, random):
    stiffness = (1.0 - gap) * isotropic + gap * orthotropic
    assert_equals_line_integral(stiffness, random.normal(size=(60, 3)), unit_vectors(random, 60), DEGENERATE)


@pytest.mark.parametrize("gap", GAPS)
def test_nearly_isotropic_solid_with_coupling(gap, transversely_isotropic, random):
    """Elasticity and potentials are isotropic, fully coupled, with a small deviation of c_1313 = c_2323."""
    stiffness = transversely_isotropic.copy()
    delta = np.eye(3)
    stiffness[:, :3, :3, :] = 0.3 * np.einsum("ij,km->ijkm", delta, delta) + 0.3 * (
        np.einsum("ik,jm->ijkm", delta, delta) + np.einsum("im,jk->ijkm", delta, delta)
    )
    for i, j in ((0, 2), (2, 0), (1, 2), (2, 1)):
        stiffness[i, j, i, j] += 0.3 * gap
        stiffness[i, j, j, i] += 0.3 * gap
    stiffness[:, 3, 3, :] = stiffness[:, 4, 4, :] = -delta
    offset = np.vstack([np.eye(3), random.normal(size=(60, 3))])
    assert_equals_line_integral(stiffness, offset, unit_vectors(random, 63), DEGENERATE)


def test_formula_for_distinct_eigenvalues_fails_where_they_are_close(transversely_isotropic):
    """The cases above are hard: division by differences of eigenvalues fails for them."""
    tilt = 1e-4
    offset = np.array([[np.sin(tilt), 0.0, np.cos(tilt)]])
    _, triad = triads(offset)
    forms = characteristic_forms(transversely_isotropic, triad)
    p = stroh_eigenvalues(forms)[0]
    q, rr, tt = forms[0]
    h = np.zeros((5, 5), complex)
    for k in range(5):
        gamma = q + rr * p[k] + tt * p[k] ** 2
        left, values, right = np.linalg.svd(gamma)
        rest = np.array([np.prod(np.delete(values, j)) for j in range(5)])
        adjugate = np.linalg.det(left) * np.linalg.det(right) * (right.conj().T * rest) @ left.conj().T
        others = np.delete(p, k)
        h += adjugate / ((p[k] - p[k].conj()) * np.prod((p[k] - others) * (p[k] - others.conj())))
    h = (2j / np.linalg.det(tt) * h).real
    exact = 4.0 * np.pi * LineIntegral().bind(transversely_isotropic).evaluate(offset, offset)[0]
    assert relative_error(h[None], exact) > 1e-4
    assert_equals_line_integral(transversely_isotropic, offset, offset, DEGENERATE)


def test_packing_covers_the_upper_triangle_once():
    assert sorted(PACKED[np.triu_indices(5)]) == list(range(15))
    assert (PACKED == PACKED.T).all()
