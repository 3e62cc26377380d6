"""The elastic half space on cells agrees with integrals of point solutions and with the compliance in wave numbers."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from meeframe.common.errors import MeeframeError
from meeframe.material import Material
from meeframe.material.half_space import axisymmetric_compliance, surface_compliance
from meeframe.testing.elastic_half_space import cell_response, elastic_half_space
from meeframe.testing.half_space import half_space_system

YOUNG = 3.0
SIGNS = np.array([1.0, 1.0, 1.0, -1.0, -1.0])


def point_response(poisson: float, x: float, y: float) -> np.ndarray:
    """Return Johnson (1985), eqs. (3.18) and (3.75), for P and Q on a half space x3 > 0, mirrored to x3 < 0."""
    r, shear = np.hypot(x, y), YOUNG / (2 * (1 + poisson))
    inward = np.empty((3, 3))
    away = np.array([x, y])
    inward[:2, :2] = (1 - poisson) * np.eye(2) / r + poisson * np.outer(away, away) / r**3
    inward[:2, 2] = -(1 - 2 * poisson) / 2 * away / r**2
    inward[2, :2] = (1 - 2 * poisson) / 2 * away / r**2
    inward[2, 2] = (1 - poisson) / r
    mirror = np.diag([1.0, 1.0, -1.0])
    return mirror @ inward @ mirror / (2 * np.pi * shear)


@pytest.mark.parametrize("position", [(1.3, 0.2), (-0.9, 2.4), (0.7, -0.7)])
def test_cell_matches_integral_of_point_loads(position: tuple[float, float]) -> None:
    computed = cell_response(YOUNG, 0.2, np.array(position[0]), np.array(position[1]), 0.5)[:3, :3]
    for field, load in np.ndindex(3, 3):

        def integrand(b: float, a: float, field: int = field, load: int = load) -> float:
            return float(point_response(0.2, position[0] - a, position[1] - b)[field, load])

        expected, _ = dblquad(integrand, -0.5, 0.5, -0.5, 0.5, epsabs=1e-9, epsrel=1e-9)
        assert computed[field, load] == pytest.approx(expected, rel=1e-7, abs=1e-9)


def test_response_of_a_cell_to_its_load() -> None:
    """int f(angle)/r over a square is the integral over angles of f times the distance to the side."""
    angle = (np.arange(4000) + 0.5) * (2 * np.pi / 4000)
    reach = 0.5 / np.maximum(np.abs(np.cos(angle)), np.abs(np.sin(angle)))
    point = np.array([point_response(0.3, np.cos(t), np.sin(t)) for t in angle])
    expected = np.mean(point * reach[:, None, None], axis=0) * 2 * np.pi
    expected[2, :2] = expected[:2, 2] = 0.0  # odd: principal value
    computed = cell_response(YOUNG, 0.3, np.zeros(()), np.zeros(()), 0.5)[:3, :3]
    np.testing.assert_allclose(computed, expected, rtol=1e-6, atol=1e-12)


def test_smooth_loads_match_the_compliance_in_wave_numbers() -> None:
    """The compliance of Barnett and Lothe is integrated over wave numbers for a Gaussian load of any direction."""
    poisson, width, h = 0.3, 1.0, 0.125
    angle, k = np.arange(96) * (2 * np.pi / 96), (np.arange(400) + 0.5) * (9.0 / 400)
    directions = np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    compliance = surface_compliance(Material.isotropic(YOUNG, poisson).stiffness, (0.0, 0.0, 1.0), directions)
    centres = (np.arange(-48, 48) + 0.5) * h
    x, y = (grid.ravel() for grid in np.meshgrid(centres, centres))
    load = np.exp(-(x**2 + y**2) / (2 * width**2))
    for position in ((0.0625, 0.0625), (0.8125, -1.4375)):
        response = cell_response(YOUNG, poisson, position[0] - x, position[1] - y, h / 2)
        computed = np.einsum("n,nJK->JK", load, response)
        phase = (
            np.exp(1j * np.outer(directions[:, :2] @ position, k))
            * np.exp(-((k * width) ** 2) / 2)
            * width**2
            * 9.0
            / 400
        )
        spectrum = np.einsum("aJK,a->JK", compliance, phase.sum(axis=1)) / len(angle)
        expected = spectrum.real * SIGNS[:, None]
        scale = np.sqrt(np.abs(np.outer(np.diag(expected), np.diag(expected))))
        np.testing.assert_allclose(computed / scale, expected / scale, atol=1e-3)


def test_signs_of_the_coupling() -> None:
    ahead = cell_response(YOUNG, 0.3, np.array(2.0), np.array(0.0), 0.5)
    assert (ahead @ [0.0, 0.0, -1.0, 0.0, 0.0])[0] < 0
    assert (ahead @ [1.0, 0.0, 0.0, 0.0, 0.0])[2] < 0


@pytest.mark.parametrize("poisson", [-0.3, 0.0, 0.3, 0.5])
def test_reciprocity_and_energy(poisson: float) -> None:
    matrix = elastic_half_space(YOUNG, poisson, 2.0, 6).matrix
    mechanical = matrix[:, :3, :, :3].reshape(108, 108)
    np.testing.assert_allclose(mechanical, mechanical.T, rtol=0, atol=1e-15)
    assert np.linalg.eigvalsh(mechanical).min() > 0
    assert np.linalg.eigvalsh(matrix[:, 3, :, 3]).min() > 0
    assert np.linalg.eigvalsh(matrix[:, 4, :, 4]).min() > 0


def test_nodes_match_the_order_of_the_matrix() -> None:
    system = elastic_half_space(YOUNG, 0.3, 2.0, 4)
    for node, source in ((0, 0), (3, 12), (14, 5)):
        x, y, _ = system.points[node] - system.points[source]
        np.testing.assert_array_equal(
            system.matrix[node, :, source, :], cell_response(YOUNG, 0.3, np.array(x), np.array(y), 0.25)
        )
    assert system.weights.sum() == pytest.approx(4.0)


def test_normal_loads_and_potentials_match_other_half_space() -> None:
    xi = axisymmetric_compliance(Material.isotropic(YOUNG, 0.3).stiffness)
    other = half_space_system(xi, 2.0, 6)
    system = elastic_half_space(YOUNG, 0.3, 2.0, 6, goodman=True)
    np.testing.assert_array_equal(system.points, other.points)
    scale = np.abs(np.diag(xi))[:, None]
    for field in (2, 3, 4):
        np.testing.assert_allclose(
            system.matrix[:, field] / scale[field - 2], other.matrix[:, field] / scale[field - 2], rtol=0, atol=1e-11
        )


@pytest.mark.parametrize(("poisson", "goodman"), [(0.5, False), (0.3, True)])
def test_uncoupled_normal_and_tangential_loads(poisson: float, goodman: bool) -> None:
    matrix = elastic_half_space(YOUNG, poisson, 2.0, 4, goodman).matrix
    assert not matrix[:, 2, :, :2].any()
    assert not matrix[:, :2, :, 2].any()
    assert matrix[:, 0, :, 1].any()


@pytest.mark.parametrize(("young", "poisson"), [(0.0, 0.3), (np.inf, 0.3), (1.0, -1.0), (1.0, 0.51), (1.0, np.nan)])
def test_constants_out_of_bounds_are_rejected(young: float, poisson: float) -> None:
    with pytest.raises(MeeframeError, match="allowed: young > 0, -1 < poisson"):
        elastic_half_space(young, poisson, 1.0, 2)
