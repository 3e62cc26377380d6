"""Response of half spaces to heat: Dundurs's distortivity, an ordered Schur form, spectral integrals, capabilities."""

import numpy as np
import pytest
import scipy
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.thermal import ThermalResponse, scaled_thermal_response
from meeframe_halfspace.thermal_cells import PointHeat, heat_table

from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.half_space import surface_compliance
from meeframe.material.thermal_half_space import thermal_response
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.testing.capabilities import check_capabilities
from meeframe.testing.closed_forms_layers import collocated_compliance

EXPANSION = np.array([[1.2e-5, 0.2e-5, -0.1e-5], [0.2e-5, 2e-5, 0.3e-5], [-0.1e-5, 0.3e-5, 0.8e-5]])
CONDUCTIVITY = np.array([[3.0, 0.4, -0.2], [0.4, 2.5, 0.5], [-0.2, 0.5, 4.0]])
TRICLINIC = (
    library_material("orthotropic-mee")
    .with_heat(CONDUCTIVITY, EXPANSION, None, [2e-5, -1e-5, -7e-5], [1e-4, 2e-4, -3e-4], "strain")
    .rotated(rotation_about([1.0, 2.0, 3.0], 0.7))
)
TABLE_1 = library_material("batio3-cofe2o4").with_heat(
    [2.8, 2.8, 3.1], [12.9e-6, 12.9e-6, 7.5e-6], None, [0, 0, -7e-5], [0, 0, -3e-4], "strain"
)
ANGLES = np.linspace(0.0, 6.0, 7)
DIRECTIONS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros_like(ANGLES)])
NORMAL = np.array([0.0, 0.0, 1.0])


def response_of(material: Material, directions: Array = DIRECTIONS) -> tuple[Array, Array]:
    stiffness, conductivity = material.stiffness[:, :5, :5], material.decoupled[0][1]
    return thermal_response(stiffness, material.thermal_moduli, conductivity, NORMAL, directions)


@pytest.mark.parametrize("change", [0.0, 1e-3, 1e-9])
def test_distortivity_of_isotropic_bodies(change: float) -> None:
    """The response is alpha (1 + nu) / k (Dundurs), also where the decay of heat is near the triple eigenvalue."""
    conductivity = np.diag([40.0, 40.0, 40.0 * (1.0 + change)])
    material = Material.isotropic(2e11, 0.3).with_heat(conductivity, 1.2e-5)
    y, kappa = response_of(material)
    delta = 1.2e-5 * 1.3 / 40.0
    expected = delta * np.column_stack([1j * DIRECTIONS[:, :2], -np.ones(7), np.zeros((7, 2))])
    np.testing.assert_allclose(y, expected, rtol=0.0, atol=(2.0 * change + 1e-14) * delta)
    np.testing.assert_allclose(kappa, 40.0 * np.sqrt(1.0 + change), rtol=1e-14)


def test_composite_of_the_reference_paper() -> None:
    """Six digits that an independent program computed."""
    y, kappa = response_of(TABLE_1)
    np.testing.assert_allclose(-y[:, 2:].real, np.tile([4.70120e-6, 125.275, 12.7229], (7, 1)), rtol=3e-6)
    np.testing.assert_allclose(kappa, 2.946184, rtol=2e-7)


@pytest.mark.parametrize("material", [TRICLINIC, TABLE_1], ids=["triclinic", "table 1"])
def test_response_is_that_of_an_ordered_schur_form(material: Material) -> None:
    """The decaying solutions of the ordinary differential equations in the depth, without any integral.

    With (u, t/k, theta/k, h/k) as functions of k times the height, those that decay into the depth are an invariant
    subspace, and the surface is free of traction.
    """
    scaling, thermal = material.scaling, np.abs(material.decoupled[0][1]).max() ** -0.5
    stiffness = material.scaling.scale_stiffness(material.stiffness)
    factors = scaling.factors
    moduli = material.thermal_moduli * factors[:5] * thermal
    y, kappa = response_of(material)
    scaled = y / (factors[:5] * thermal)
    for direction, expected, heat in zip(DIRECTIONS, scaled, kappa, strict=True):
        q, r, t = (
            np.einsum("i,iJKm,m->JK", one, stiffness, other)
            for one, other in ((direction, direction), (direction, NORMAL), (NORMAL, NORMAL))
        )
        # t = T u' + i R^T u - beta_n theta and t' = Q u - i R u' + i beta_m theta, in units of k
        inverse, n = np.linalg.inv(t), 6
        extended = np.zeros((2, 6))  # moduli along the direction and the normal; none on the temperature itself
        extended[:, :5] = np.array([direction, NORMAL]) @ moduli
        coupling = np.zeros((2, n, n))
        coupling[:, :, 5] = extended
        upper = np.hstack([inverse @ (-1j * r.T + coupling[1]), inverse])
        lower = np.hstack([q - 1j * r @ upper[:, :n] + 1j * coupling[0], -1j * r @ upper[:, n:]])
        state = np.vstack([upper, lower]).astype(complex)
        _, vectors, count = scipy.linalg.schur(state, output="complex", sort=lambda value: value.real > 0.0)
        assert count == n
        compliance = vectors[:n, :n] @ np.linalg.inv(vectors[n:, :n])
        np.testing.assert_allclose(compliance[:5, 5], expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
        assert compliance[5, 5] == pytest.approx(-1.0 / (heat * thermal**2), rel=1e-12)
        assert np.abs(compliance[5, :5]).max() < 1e-12
        alone = surface_compliance(material.stiffness[:, :5, :5], NORMAL, [direction])[0]
        alone /= np.outer(factors[:5], factors[:5])
        np.testing.assert_allclose(compliance[:5, :5], alone, rtol=0.0, atol=1e-11 * np.abs(alone).max())


@pytest.mark.parametrize("material", [TRICLINIC, TABLE_1], ids=["triclinic", "table 1"])
def test_response_is_that_of_a_deep_slab(material: Material) -> None:
    """The differential equations in the depth by collocation, in a slab in which all waves decay to round-off."""
    scaling = material.scaling
    stiffness, factors = scaling.scale_stiffness(material.stiffness), scaling.factors
    moduli, depths = material.thermal_moduli * factors[:5] * factors[5], (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
    count = len(depths)
    joints = [np.zeros(6)] * (count - 1), [False] * (count - 1)
    y, kappa = response_of(material, DIRECTIONS[:3])
    for direction, heat, conductivity in zip(DIRECTIONS[:3], y, kappa, strict=True):
        slab = collocated_compliance([stiffness] * count, depths, *joints, direction[:2], 18, [moduli] * count)
        expected = slab * np.outer(factors, factors)
        np.testing.assert_allclose(heat, expected[:5, 5], rtol=0.0, atol=1e-9 * np.abs(expected[:5, 5]).max())
        assert -1.0 / conductivity == pytest.approx(expected[5, 5], rel=1e-9)


def test_response_of_opposite_waves_is_conjugate() -> None:
    np.testing.assert_allclose(response_of(TRICLINIC, -DIRECTIONS)[0], response_of(TRICLINIC)[0].conj(), rtol=1e-11)


def test_point_response_is_the_integral_over_directions() -> None:
    """The difference of two offsets is the mean of y_h(m) times that of -ln|m.d|, or of the sign, without a series.

    The integrals over k are those of Gel'fand and Shilov: of cos(k p)/k it is -ln|p|, of sin(k p)/k it is pi/2 sign p.
    """
    frame = np.eye(3)
    response = ThermalResponse.of(TRICLINIC.stiffness, TRICLINIC.thermal_moduli, 5, frame)
    offsets, count = np.array([[3e-3, 1e-3], [-2e-3, 5e-3]]), 150
    computed = np.zeros((2, 5))
    for number in range(10):
        computed[:, number % 5] += PointHeat(*response.point_entry(number), 1e-2).values(*offsets.T)
    expected = np.zeros((2, 5))
    for row, offset in enumerate(offsets):
        across = np.arctan2(offset[1], offset[0]) + np.pi / 2.0  # where m.d changes its sign
        nodes, weights = np.polynomial.legendre.leggauss(count)
        for first in (across, across + np.pi):
            # the logarithm at both ends needs points that crowd there
            u = (nodes + 1.0) / 2.0
            share = u**2 * (3.0 - 2.0 * u)
            angles, steps = first + np.pi * share, np.pi * 6.0 * u * (1.0 - u) * weights / 2.0
            y = scaled_thermal_response(TRICLINIC.stiffness, TRICLINIC.thermal_moduli, 5, frame, angles)
            p = np.cos(angles) * offset[0] + np.sin(angles) * offset[1]
            terms = -np.log(np.abs(p))[:, None] * y.real - np.pi / 2.0 * np.sign(p)[:, None] * y.imag
            expected[row] += steps @ terms / (4.0 * np.pi**2)
    np.testing.assert_allclose(
        computed[1] - computed[0], expected[1] - expected[0], rtol=0.0, atol=1e-7 * np.abs(computed).max()
    )


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("shape", ["bilinear", "constant"])
@pytest.mark.parametrize("number", [2, 7])
def test_cells_are_integrated_to_round_off(shape: str, number: int) -> None:
    """Tables near, at middle distance and far, against graded Gauss rules on the quarters of the cell."""
    response = ThermalResponse.of(TRICLINIC.stiffness, TRICLINIC.thermal_moduli, 5, np.eye(3))
    spacing, radius = (1e-3, 1.3e-3), 0.01
    table = heat_table(response, number, spacing, shape, (40, 40), radius)
    coefficients, is_odd = response.point_entry(number)
    nodes, weights = np.polynomial.legendre.leggauss(50)
    u, end = (nodes + 1.0) / 2.0, 1.0 if shape == "bilinear" else 0.5

    def quarter(sign: float) -> tuple[Array, Array]:
        graded, step = u**8, 8.0 * u**7 * weights / 2.0 * end / 2.0
        return sign * end * np.concatenate([graded / 2.0, 1.0 - graded / 2.0]), np.concatenate([step, step])

    for i, j in ((0, 0), (1, 0), (0, 1), (2, -1), (6, 0), (20, 7), (30, -3), (31, 5), (39, 39)):
        total = 0.0
        for sign_x, sign_y in np.ndindex(2, 2):
            (x, wx), (y, wy) = quarter(2.0 * sign_x - 1.0), quarter(2.0 * sign_y - 1.0)
            density = np.outer(1.0 - np.abs(x), 1.0 - np.abs(y)) if shape == "bilinear" else 1.0
            dx, dy = (i - x)[:, None] * spacing[0], (j - y)[None, :] * spacing[1]
            values = density * PointHeat(coefficients, is_odd, radius).values(dx, dy)
            total += wx @ values @ wy * spacing[0] * spacing[1]
        assert table[i, j + 39] == pytest.approx(total, abs=1e-11 * np.abs(table).max())


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("material", "periodic"), [(TABLE_1, False), (TRICLINIC, False), (TABLE_1, True), (TRICLINIC, True)]
)
def test_capabilities_and_action_of_heat(material: Material, periodic: bool) -> None:
    """Heat acts on the other fields without reaction, and all capabilities agree with `apply`."""
    mesh = half_space_mesh(2.0, (1.0, 0.8), (30, 26), 1, Quad4())
    body = Body.of(material, mesh, (), "contact")
    system = HalfSpace(matrix_up_to=0, periodic=periodic).reduce(body)
    check_capabilities(system)
    load = np.random.default_rng(1).normal(size=system.offset.shape)
    load[:, 5] = 0.0
    assert not system.apply(load)[:, 5].any()
    without = HalfSpace(matrix_up_to=0, periodic=periodic).reduce(
        Body(material.stiffness, mesh, (), "contact", material.fields)
    )
    np.testing.assert_array_equal(system.apply(load), without.apply(load))
    heat = np.zeros_like(load)
    heat[:, 5] = np.random.default_rng(2).normal(size=len(load))
    acting = system.apply(heat)
    np.testing.assert_allclose(acting[:, 5], without.apply(heat)[:, 5], rtol=1e-12)
    assert (np.abs(acting[:, 2:5]).max(axis=0) > 0.0).all()


def test_matrix_and_grid_agree() -> None:
    mesh = half_space_mesh(2.0, (1.0, 0.8), (7, 5), 1, Quad4())
    body = Body.of(TRICLINIC, mesh, (), "contact")
    matrix, grid = (HalfSpace(matrix_up_to=count).reduce(body) for count in (10_000, 0))
    load = np.random.default_rng(1).normal(size=grid.offset.shape)
    for column in range(6):
        alone = np.zeros_like(load)
        alone[:, column] = load[:, column]
        one, other = matrix.apply(alone), grid.apply(alone)
        assert (np.abs(one - other) <= 1e-12 * np.abs(other).max(axis=0)).all()


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("material", [TABLE_1, TRICLINIC], ids=["table 1", "triclinic"])
def test_free_and_periodic_grids_agree_without_net_heat(material: Material) -> None:
    """On a long period the response to heat that sums up to zero is that of the free surface, but for its mean.

    Images of a dipole of strength M at the distance L act like M / L^2, or with a gradient like 1/L for odd functions.
    """
    errors = []
    for count in (32, 64):
        mesh = half_space_mesh(4.0 * count / 32, (count / 32, count / 32), (count - 1, count - 1), 1, Quad4())
        body = Body.of(material, mesh, (), "contact")
        free, periodic = (HalfSpace(matrix_up_to=0, periodic=flag).reduce(body) for flag in (False, True))
        x, y = free.points[:, :2].T
        load = np.zeros_like(free.offset)
        rings = (np.exp(-(x**2 + y**2) / (2.0 * width**2)) / width**2 for width in (0.06, 0.08))
        load[:, 5] = np.subtract(*rings)
        load[:, 5] -= load[:, 5] @ free.weights / free.weights.sum()
        inner = np.hypot(x, y) < 0.25
        one, other = (system.apply(load)[inner, 2] for system in (free, periodic))
        change = (one - one.mean()) - (other - other.mean())
        errors.append(np.abs(change).max() / np.abs(one).max())
    assert errors[1] < 2e-3
    assert errors[1] < errors[0]
