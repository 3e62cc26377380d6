import numpy as np
import pytest

from meeframe.common.errors import CaseError, MaterialError
from meeframe.greens import LineIntegral
from meeframe.greens._kernels.line_integral import line_integrals
from meeframe.greens._kernels.modulation import triads
from meeframe.greens.directions import spread_directions
from meeframe.testing.fundamental import relative_error, unit_vectors


def test_matches_mean_over_half_circle(stiffness, random):
    """The reference is Gauss quadrature over the angle, which does not use periodicity."""
    offset = unit_vectors(random, 20)
    _, triad = triads(offset)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    angle = 0.5 * np.pi * (nodes + 1.0)
    z = np.cos(angle)[:, None] * triad[:, None, 0] + np.sin(angle)[:, None] * triad[:, None, 1]
    inverse = np.linalg.inv(np.einsum("nai,ijkm,nam->najk", z, stiffness, z))
    expected = 0.5 * np.einsum("a,najk->njk", weights, inverse) / (4.0 * np.pi)
    u, _ = LineIntegral().bind(stiffness).evaluate(offset, offset)
    assert relative_error(u, expected) < 1e-12


@pytest.mark.parametrize("name", ["transversely_isotropic", "orthotropic"])
def test_trapezoidal_rule_converges_geometrically(name, random, request):
    """Each 4 points reduce the error by a factor of 50 or more, down to 2e-12 (docs/explanation/theory.md)."""
    stiffness, offset = request.getfixturevalue(name), unit_vectors(random, 200)
    _, triad = triads(offset)
    expected, _ = LineIntegral().bind(stiffness).evaluate(offset, offset)
    errors = []
    for points in (16, 20, 24):
        angle = np.arange(points) * np.pi / points
        z = np.cos(angle)[:, None] * triad[:, None, 0] + np.sin(angle)[:, None] * triad[:, None, 1]
        mean = np.linalg.inv(np.einsum("nai,ijkm,nam->najk", z, stiffness, z)).mean(axis=1)
        errors.append(relative_error(mean / (4.0 * np.pi), expected))
    assert errors[0] > 50.0 * errors[1] > 2500.0 * errors[2]
    assert errors[2] < 2e-12


@pytest.mark.parametrize("points", [4, 18, 256])
def test_independent_of_initial_number_of_points(points, stiffness, random):
    offset, normal = random.normal(size=(50, 3)), unit_vectors(random, 50)
    u, t = LineIntegral().bind(stiffness).evaluate(offset, normal)
    u_other, t_other = LineIntegral(points).bind(stiffness).evaluate(offset, normal)
    assert relative_error(u_other, u) < 1e-13
    assert relative_error(t_other, t) < 1e-12


def test_adds_points_for_extreme_anisotropy(isotropic, random):
    stiffness = isotropic.copy()
    stiffness[2, 3, 3, 2] *= 1e-4
    offset = unit_vectors(random, 100)
    u, _ = LineIntegral().bind(stiffness).evaluate(offset, offset)
    a, c = stiffness[0, 3, 3, 0], stiffness[2, 3, 3, 2]
    # Laplace's equation in stretched coordinates
    stretched = np.sqrt(a * a * offset[:, 2] ** 2 + a * c * (offset[:, 0] ** 2 + offset[:, 1] ** 2))
    np.testing.assert_allclose(u[:, 3, 3], -1.0 / (4.0 * np.pi * stretched), rtol=1e-11)


def test_accidentally_small_change_does_not_end_refinement(isotropic):
    """The integrand of a decoupled anisotropic potential has one harmonic, whose change vanishes in some directions."""
    permittivity = np.array([[3.0, 0.4, 0.0], [0.4, 2.0, 0.3], [0.0, 0.3, 5.0]])
    stiffness = isotropic.copy()
    stiffness[:, 3, 3, :] = -permittivity
    stiffness.setflags(write=False)  # as in the kernel, or another version would be compiled
    _, triad = triads(spread_directions(1_000))
    # directions in which n nodes, n = 4, 8 or 16, show no change: the phase of the harmonic is a quarter of a period
    form = np.einsum("nai,ij,nbj->nab", triad[:, :2], permittivity, triad[:, :2])
    phase = np.arctan2(2.0 * form[:, 0, 1], form[:, 0, 0] - form[:, 1, 1])
    angles = np.concatenate([0.5 * phase - np.pi / (4 * count) for count in (4, 8, 16)])
    triad = np.tile(triad, (3, 1, 1))
    n, m = triad[:, 0].copy(), triad[:, 1].copy()
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    triad[:, 0], triad[:, 1] = cosine * n + sine * m, cosine * m - sine * n
    modulation, converged = line_integrals(stiffness, triad, 16, 1 << 14, 1e-8, False)
    stretched = np.einsum("ni,ij,nj->n", triad[:, 2], np.linalg.inv(permittivity), triad[:, 2])
    assert converged
    np.testing.assert_allclose(
        modulation[:, 0, 12], -1.0 / np.sqrt(np.linalg.det(permittivity) * stretched), rtol=1e-12
    )


@pytest.mark.parametrize("points", [0, 2, 7, -4, 1 << 20])
def test_invalid_points_are_rejected(points):
    with pytest.raises(CaseError, match="even numbers"):
        LineIntegral(points)


def test_invalid_stiffness_is_rejected(isotropic):
    with pytest.raises(MaterialError, match="shape"):
        LineIntegral().bind(isotropic[:2])
    wrong = isotropic.copy()
    wrong[0, 3, 3, 0] = np.nan
    with pytest.raises(MaterialError, match="not finite"):
        LineIntegral().bind(wrong)
    wrong = isotropic.copy()
    wrong[0, 1, 3, 0] += 0.1
    with pytest.raises(MaterialError, match="C_iJKm = C_mKJi"):
        LineIntegral().bind(wrong)
    wrong = isotropic.copy()
    wrong[2, 4, 4, 2] *= -1.0
    with pytest.raises(MaterialError, match="electromagnetic block"):
        LineIntegral().bind(wrong)
    wrong = isotropic.copy()
    wrong[:, :3, :3, :] *= -1.0
    with pytest.raises(MaterialError, match="mechanical block"):
        LineIntegral().bind(wrong)


@pytest.mark.parametrize("entries", [[], [(0, 0), (1, 1), (2, 2)]])
def test_singular_stiffness_is_reported(entries, random):
    """Stiffnesses without inverse: zero, and without electromagnetic block."""
    stiffness = np.zeros((3, 5, 5, 3))
    for j, k in entries:
        stiffness[:, j, k, :] = np.eye(3)
    stiffness.setflags(write=False)
    _, triad = triads(unit_vectors(random, 40))
    for with_tangents in (False, True):
        assert not line_integrals(stiffness, triad, 16, 256, 1e-8, with_tangents)[1]
