"""The response to a heat source: closed form, field equations, quadrature over a heated volume, order in the length."""

from dataclasses import dataclass
from itertools import permutations
from typing import final

import numpy as np
import pytest

from meeframe.common.errors import MaterialError
from meeframe.fields import Array
from meeframe.greens import LineIntegral, Tabulated
from meeframe.greens.decoupled import bind_fields
from meeframe.greens.harmonics import OddHarmonics
from meeframe.greens.thermal import HeatSource, ThermalKernel, source_gradient
from meeframe.material import Material, library_material, rotation_about
from meeframe.testing.fundamental import relative_error, unit_vectors
from meeframe.testing.manufactured import ThermalField

CONDUCTIVITY = np.array([[3.0, 0.4, -0.2], [0.4, 2.5, 0.5], [-0.2, 0.5, 4.0]])
TRICLINIC = (
    library_material("orthotropic-mee")
    .with_heat(CONDUCTIVITY, [1.2e-5, 2e-5, 0.8e-5], None, [2e-5, -1e-5, -7e-5], [1e-4, 2e-4, -3e-4], "strain")
    .rotated(rotation_about([1.0, 2.0, 3.0], 0.7))
)


@final
@dataclass(frozen=True, eq=False)
class Scaled:
    """Scaled constants of a material: stiffness of all fields and of the first five, moduli, conductivity."""

    stiffness: Array
    coupled: Array
    moduli: Array
    conductivity: Array
    factors: Array

    @classmethod
    def of(cls, material: Material) -> "Scaled":
        factors = material.scaling.factors
        stiffness = material.scaling.scale_stiffness(material.stiffness)
        moduli = material.thermal_moduli * factors[:5] * factors[5]
        return cls(stiffness, np.ascontiguousarray(stiffness[:, :5, :5]), moduli, -stiffness[:, 5, 5], factors)

    def kernel(self) -> ThermalKernel:
        kernel = bind_fields(Tabulated(), self.stiffness, self.moduli)
        assert isinstance(kernel, ThermalKernel)
        return kernel


@pytest.fixture(scope="module")
def constants() -> Scaled:
    return Scaled.of(TRICLINIC)


@pytest.fixture(scope="module")
def kernel(constants) -> ThermalKernel:
    return constants.kernel()


def second_derivatives(kernel, offset: Array, step: float = 0.02) -> Array:
    """Return derivatives (n, 6, 6, 3, 3) of the gradients of a kernel by differences of fourth order."""
    axes = []
    for axis in step * np.eye(3):
        one = kernel.gradient(offset + axis) - kernel.gradient(offset - axis)
        two = kernel.gradient(offset + 2.0 * axis) - kernel.gradient(offset - 2.0 * axis)
        axes.append((8.0 * one - two) / (12.0 * step))
    return np.stack(axes, axis=-1)


@pytest.mark.full
def test_satisfies_the_equations_of_the_body_and_of_its_adjoint(constants, kernel, random):
    """C_iJKm W_K,mi = beta_iJ theta*,i around the heat source, and k_ij W_P,ij = beta_iJ U_JP,i."""
    offset = unit_vectors(random, 30) * (1.0 + random.random((30, 1)))
    gradient, second = kernel.gradient(offset), second_derivatives(kernel, offset)
    source = second[:, 5, :5]
    forces, heating = np.einsum("iJKm,nKmi->nJ", constants.coupled, source), -gradient[:, 5, 5] @ constants.moduli
    assert relative_error(forces, heating) < 2e-5
    conducted = np.einsum("ij,nPij->nP", constants.conductivity, source)
    coupled = np.einsum("iJ,nJPi->nP", constants.moduli, LineIntegral().bind(constants.coupled).gradient(offset))
    assert relative_error(conducted, coupled) < 2e-5


def test_gradient_and_flux_are_exact_to_the_tolerance(constants, kernel, random):
    offset, normal = random.normal(size=(300, 3)), unit_vectors(random, 300)
    exact = source_gradient(constants.coupled, constants.moduli, constants.conductivity, offset)
    assert relative_error(kernel.gradient(offset)[:, 5, :5], exact) < 1e-8
    u, t = kernel.evaluate(offset, normal)
    assert relative_error(t[:, 5, :5], -np.einsum("ni,ij,nPj->nP", normal, constants.conductivity, exact)) < 1e-8
    # degree 0 and odd
    np.testing.assert_allclose(kernel.evaluate(-3.0 * offset, normal)[0][:, 5, :5], -u[:, 5, :5], atol=1e-14)
    # the change along a path is the integral of the gradient
    nodes, weights = np.polynomial.legendre.leggauss(40)
    start, end = np.array([1.0, 0.2, 0.3]), np.array([-0.3, 0.9, -0.4])
    path = start + 0.5 * (nodes[:, None] + 1.0) * (end - start)
    change = 0.5 * np.einsum("a,aPq,q->P", weights, kernel.gradient(path)[:, 5, :5], end - start)
    first, last = kernel.evaluate(np.array([start, end]), np.eye(3)[:2])[0][:, 5, :5]
    np.testing.assert_allclose(last - first, change, atol=1e-8 * np.abs(first).max())


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("expansion", [1.2e-5, 0.0])
def test_isotropic_source_is_that_of_nowacki(random, expansion):
    """W = alpha (1 + nu) / (1 - nu) x / (8 pi k r), potential p_3 x_3 / (8 pi k epsilon r), in SI units.

    The gradient of the potential vanishes along x_3; temperature and other entries are those of Laplace.
    """
    poisson, conductivity, permittivity, pyroelectric = 0.3, 40.0, 3e-9, -7e-5
    material = Material.isotropic(2e11, poisson, permittivity=permittivity)
    constants = Scaled.of(material.with_heat(conductivity, expansion, None, [0, 0, pyroelectric], None, "strain"))
    offset, normal = random.normal(size=(100, 3)), unit_vectors(random, 100)
    u, t = constants.kernel().evaluate(offset, normal)
    factors, r = constants.factors, np.linalg.norm(offset, axis=1)[:, None]
    strength = expansion * (1.0 + poisson) / (1.0 - poisson) / (8.0 * np.pi * conductivity)
    w = u[:, 5, :5] * factors[:5] * factors[5]
    np.testing.assert_allclose(w[:, :3], strength * offset / r, atol=1e-10 * strength)
    charge = pyroelectric / (8.0 * np.pi * conductivity * permittivity)
    np.testing.assert_allclose(w[:, 3], charge * offset[:, 2] / r[:, 0], atol=1e-10 * abs(charge))
    np.testing.assert_allclose(w[:, 4], 0.0, atol=1e-14)
    slope = t[:, 5, :3] * factors[:3] / factors[5]
    radial = (normal * offset).sum(axis=1, keepdims=True) / r**2
    exact = -conductivity * strength * (normal / r - radial * offset / r)
    np.testing.assert_allclose(slope, exact, atol=1e-9 * np.abs(exact).max())
    np.testing.assert_allclose(u[:, 5, 5] * factors[5] ** 2, -1.0 / (4.0 * np.pi * conductivity * r[:, 0]), rtol=1e-12)
    assert not u[:, :5, 5].any()
    assert not t[:, :5, 5].any()


def test_isotropic_stress_of_a_source_is_that_of_nowacki(random):
    """The stress is -mu alpha (1 + nu) / (4 pi k (1 - nu)) (delta_ij + x_i x_j / r^2) / r."""
    young, poisson, conductivity, expansion = 2e11, 0.3, 40.0, 1.2e-5
    material = Material.isotropic(young, poisson).with_heat(conductivity, expansion, None, None, None, "strain")
    constants = Scaled.of(material)
    kernel, offset = constants.kernel(), random.normal(size=(100, 3))
    r = np.linalg.norm(offset, axis=1)
    temperature = -kernel.evaluate(offset, offset / r[:, None])[0][:, 5, 5]
    stress = np.einsum("iJKm,nKm->nJi", constants.coupled, kernel.gradient(offset)[:, 5, :5])
    stress -= temperature[:, None, None] * constants.moduli.T
    stress = stress[:, :3] * constants.factors[5] / constants.factors[0]
    strength = young * expansion / (8.0 * np.pi * conductivity * (1.0 - poisson))
    direction = offset / r[:, None]
    exact = -strength * (np.eye(3) + direction[:, :, None] * direction[:, None, :]) / r[:, None, None]
    np.testing.assert_allclose(stress, exact, atol=1e-8 * np.abs(exact).max())


def sphere_rule(count: int) -> tuple[Array, Array]:
    """Return unit vectors and weights of Gauss and trapezoidal rules on the sphere."""
    heights, weights = np.polynomial.legendre.leggauss(count)
    azimuth = np.pi * np.arange(2 * count) / count
    radius = np.sqrt(1.0 - heights**2)[:, None]
    vectors = [
        radius * np.cos(azimuth),
        radius * np.sin(azimuth),
        np.broadcast_to(heights[:, None], (count, 2 * count)),
    ]
    return np.stack(vectors, axis=-1).reshape(-1, 3), np.repeat(weights, 2 * count) * np.pi / count


def test_heated_volume_acts_as_temperature_and_flux_on_its_surface(constants, kernel):
    """int_V beta_iJ U_JP,i theta dV = int W_P h + (nu . k grad W_P) theta dS, in a ball with a linear temperature.

    The volume integral, around a point of the ball, has no W in it: it fixes its sign, size and power of length.
    """
    point, level, slope = np.array([-0.1, 0.15, -0.2]), 0.7, np.array([0.5, -1.1, 0.8])
    directions, weights = sphere_rule(32)
    along = directions @ point
    length = np.sqrt(along**2 + 1.0 - point @ point) - along  # to the surface
    heat = level * length + 0.5 * length**2 * (directions @ slope)
    action = np.einsum("iJ,nJPi->nP", constants.moduli, LineIntegral().bind(constants.coupled).gradient(directions))
    volume = np.einsum("n,n,nP->P", weights, heat, action)
    u, t = kernel.evaluate(directions - point, directions)
    temperature = level + (directions - point) @ slope
    flux = -directions @ constants.conductivity @ slope
    surface = np.einsum("n,nP->P", weights * flux, u[:, 5, :5]) - np.einsum(
        "n,nP->P", weights * temperature, t[:, 5, :5]
    )
    np.testing.assert_allclose(surface, volume, atol=1e-7 * np.abs(volume).max())


@pytest.mark.parametrize("count", [24, 32])
def test_boundary_equation_holds_on_the_surface_of_an_ellipsoid(constants, kernel, count):
    """Constants of displacement and potentials are subtracted from T; the temperature in their equations needs no term.

    Seen from a point of the surface, the integrands are smooth functions of the direction.
    """
    axes, rng = np.array([1.0, 0.7, 1.3]), np.random.default_rng(4)
    start = axes * unit_vectors(rng, 1)[0]
    inward = -start / axes**2
    frame = np.linalg.qr(np.column_stack([inward, np.eye(3)[:, :2]]))[0]
    frame[:, 0] *= np.sign(frame[:, 0] @ inward)
    heights, weights = np.polynomial.legendre.leggauss(count)
    heights, weights = 0.5 * (heights + 1.0), 0.5 * weights
    azimuth = np.pi * np.arange(2 * count) / count
    sine = np.sqrt(1.0 - heights**2)[:, None]
    local = np.broadcast_arrays(heights[:, None], sine * np.cos(azimuth), sine * np.sin(azimuth))
    direction = np.stack(local, axis=-1).reshape(-1, 3) @ frame.T
    curvature = (direction**2 / axes**2).sum(axis=1)
    length = 2.0 * direction @ inward / curvature
    points = start + length[:, None] * direction
    normal = points / axes**2
    area = 2.0 * length * np.linalg.norm(normal, axis=1) / curvature * np.repeat(weights, 2 * count) * np.pi / count
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    field = ThermalField(TRICLINIC, 0.7, np.array([0.5, -1.1, 0.8]))
    values, fluxes = field.values(points) / constants.factors, field.fluxes(points, normal) * constants.factors
    here = field.values(start[None])[0] / constants.factors
    u, t = kernel.evaluate(points - start, normal)
    right = np.einsum("n,nJ,nJP->P", area, fluxes, u)
    left = np.einsum("n,nJ,nJP->P", area, values[:, :5] - here[:5], t[:, :5])
    left[:5] += area * values[:, 5] @ t[:, 5, :5]
    left[5] += area * (values[:, 5] - here[5]) @ t[:, 5, 5]
    np.testing.assert_allclose(left, right, atol=1e-8 * np.abs(np.einsum("n,nJ,nJP->JP", area, fluxes, u)).max())


def test_representation_of_a_polynomial_field_inside_an_ellipsoid(constants, kernel, random):
    """A temperature of second and displacements and potentials of third degree, at points far from the surface."""
    axes, count = np.array([1.0, 0.7, 1.3]), 40
    directions, weights = sphere_rule(count)
    points, normal = axes * directions, directions / axes
    area = weights * axes.prod() * np.linalg.norm(normal, axis=1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    # theta = x.Qx without heat sources, u_J = a_Jpqr x_p x_q x_r with C_iJKm u_K,mi = beta_iJ theta,i
    q = random.normal(size=(3, 3))
    q += q.T
    q -= np.eye(3) * (q * constants.conductivity).sum() / np.trace(constants.conductivity)
    symmetric = np.array([np.eye(27).reshape(27, 3, 3, 3).transpose(0, *order) for order in permutations((1, 2, 3))])
    basis = symmetric.sum(axis=0)  # u_K,mi = basis_mir x_r
    equations = np.einsum("iJKm,bmir->JrKb", constants.coupled, basis).reshape(15, -1)
    source = np.einsum("iJ,ir->Jr", constants.moduli, 2.0 * q).ravel()
    a = np.einsum("Kb,bmir->Kmir", np.linalg.lstsq(equations, source)[0].reshape(5, 27), basis) / 6.0

    def values(x: Array) -> Array:
        return np.column_stack([np.einsum("Kpqr,np,nq,nr->nK", a, x, x, x), np.einsum("np,pq,nq->n", x, q, x)])

    gradient = 3.0 * np.einsum("Kmqr,nq,nr->nKm", a, points, points)
    flux = np.einsum("ni,iJKm,nKm->nJ", normal, constants.coupled, gradient)
    flux -= (normal @ constants.moduli) * values(points)[:, 5:]
    heat = -2.0 * np.einsum("ni,ij,jq,nq->n", normal, constants.conductivity, q, points)
    inside = 0.25 * axes * unit_vectors(random, 3)
    for point, exact in zip(inside, values(inside), strict=True):
        u, t = kernel.evaluate(points - point, normal)
        terms = np.einsum("nJ,nJP->nP", np.column_stack([flux, heat]), u)
        terms -= np.einsum("nJ,nJP->nP", values(points), t)
        np.testing.assert_allclose(area @ terms, exact, atol=1e-8 * (area @ np.abs(terms)).max())


def test_harmonics_integrate_over_half_spheres():
    """z_3 gives pi e_3, and a function with all odd degrees the sum of a rule on the half sphere."""

    def density(z: Array) -> Array:
        return np.column_stack([z[:, 2], z @ [0.3, -0.5, 0.8] / (1.3 + z[:, 0] * z[:, 1] + z[:, 2] ** 2)])

    directions = unit_vectors(np.random.default_rng(2), 7)
    values = OddHarmonics.half_sphere_integrals(density, 1e-10).evaluate(directions)
    np.testing.assert_allclose(values[:, 0], np.pi * directions[:, 2], rtol=1e-12)
    heights, weights = np.polynomial.legendre.leggauss(60)
    heights, weights = 0.5 * (heights + 1.0), 0.5 * weights
    angle = 2.0 * np.pi * np.arange(80) / 80
    for direction, value in zip(directions, values[:, 1], strict=True):
        first = np.cross(direction, [1.0, 2.0, 3.0])
        first /= np.linalg.norm(first)
        second = np.cross(direction, first)
        ring = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
        z = heights[:, None, None] * direction + np.sqrt(1.0 - heights**2)[:, None, None] * ring
        exact = np.einsum("a,ab->", weights, density(z.reshape(-1, 3))[:, 1].reshape(60, 80)) * 2.0 * np.pi / 80
        assert value == pytest.approx(exact, abs=1e-9)


def test_harmonics_end_with_the_last_degree_that_matters():
    """A cubic function needs degrees up to three, though more are examined."""
    harmonics = OddHarmonics.half_sphere_integrals(lambda z: z[:, :1] * z[:, 1:2] * z[:, 2:], 1e-10)
    assert harmonics.cosines.shape == harmonics.sines.shape == (4, 4, 1)


def test_sums_over_plane_pieces_are_those_of_points(kernel, random):
    offset, weights = random.normal(size=(60, 3)), random.normal(size=(60, 4))
    starts, normals = np.array([0, 20, 25, 60]), unit_vectors(random, 3)
    sums = kernel.integrate(offset, weights, starts, normals)
    values = kernel.evaluate(offset, np.repeat(normals, np.diff(starts), axis=0))
    for total, each in zip(sums, values, strict=True):
        exact = np.add.reduceat(weights[:, :, None] * each.reshape(60, 1, 36), starts[:-1])
        np.testing.assert_allclose(total, exact, atol=1e-13 * np.abs(exact).max())
    np.testing.assert_array_equal(kernel.weakly_singular(), [30, 31, 32, 33, 34])


@pytest.mark.full
def test_table_is_refined_or_refused(constants, random):
    strong = np.diag([1.0, 1.0, 2.0]) / 2.0
    source = HeatSource.of(constants.coupled, constants.moduli, strong)
    assert source.cells > 16
    offset = unit_vectors(random, 200)
    exact = source_gradient(constants.coupled, constants.moduli, strong, offset)
    assert relative_error(source.gradient(offset), exact) < 1e-8
    with pytest.raises(MaterialError, match="heat source"):
        HeatSource.of(constants.coupled, constants.moduli, np.diag([1.0, 1.0, 1e-6]))
