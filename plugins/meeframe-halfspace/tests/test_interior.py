"""Test fields inside a half space: closed forms of Hertz, Love and Boussinesq, equilibrium, limit at the surface."""

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.common.errors import CaseError
from meeframe.elements import Quad4
from meeframe.fields import FieldScaling, ScalarField
from meeframe.material import Material, library_material, rotation_about
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.results.interior import PointGrid, interior
from meeframe.system.capabilities import InteriorFields, Multigrid, Restriction
from meeframe.system.rotated import rotate_frames
from meeframe.system.two_body import combine_bodies

NU = 0.3
STEEL = Material.isotropic(210e9, NU).stiffness
COUPLED = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
FACTORS = FieldScaling.of(COUPLED).factors
SIGNS = np.array([1.0, 1.0, 1.0, -1.0, -1.0])


def half_space(stiffness, divisions, spacing, **options):
    options = {"matrix_up_to": 0, **options}
    width = tuple(n * spacing for n in divisions)
    mesh = half_space_mesh(20.0 * max(width), width, divisions, 1, Quad4())
    return HalfSpace(**options).reduce(Body(stiffness, mesh, (), "contact"))


def hertz(cells):
    """Return the system and the load of Hertz's pressure with unit radius and maximum, `cells` wide."""
    system = half_space(STEEL, (cells + 4, cells + 4), 2.0 / cells)
    load = np.zeros((len(system.points), 5))
    load[:, 2] = -np.sqrt(np.maximum(1.0 - (system.points[:, :2] ** 2).sum(axis=1), 0.0))
    return system, load


def noise(system):
    return np.random.default_rng(2).normal(size=system.offset.shape) / FACTORS


def axis(depths):
    return np.stack([np.zeros_like(depths), np.zeros_like(depths), -depths], axis=1)


def test_axis_under_hertz_pressure_converges_with_second_order():
    """Stresses on the axis converge to the closed form (Johnson, Contact Mechanics (1985), eqs. 3.45)."""
    z = np.array([0.15, 0.3, 0.481, 0.8, 1.5, 3.0])
    axial = -1.0 / (1.0 + z**2)
    radial = -(1.0 + NU) * (1.0 - z * np.arctan(1.0 / z)) - axial / 2.0
    errors = []
    for cells in (16, 32):
        stress = interior(*hertz(cells), axis(z)).stress
        errors.append(max(np.abs(stress[:, 2, 2] - axial).max(), np.abs(stress[:, 0, 0] - radial).max()))
        np.testing.assert_allclose(stress[:, 0, 0], stress[:, 1, 1], atol=1e-12)
        np.testing.assert_allclose(stress[:, 0, 2], 0.0, atol=1e-12)
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 3.0


def test_largest_stresses_under_hertz_pressure():
    """For a Poisson ratio of 0.3, the largest shear is 0.310 p0 at the depth 0.481 a, and von Mises is 0.620 p0."""
    system, load = hertz(32)
    depths = np.linspace(0.43, 0.53, 11)
    result = interior(system, load, axis(depths))
    assert result.max_shear.max() == pytest.approx(0.310, abs=1e-3)
    assert depths[result.max_shear.argmax()] == pytest.approx(0.481, abs=0.01)
    assert result.von_mises.max() == pytest.approx(0.620, abs=2e-3)
    shear = next(row for row in result.maxima() if row.name == "max_shear")
    assert (shear.value, shear.unit) == (result.max_shear.max(), "Pa")
    np.testing.assert_allclose(shear.position, [0.0, 0.0, -depths[result.max_shear.argmax()]])


def newmark(x, y, z, a):
    """Return the normal stress under uniform unit pressure on |x|, |y| < a (Love 1929; Newmark 1935)."""
    total = 0.0
    for u, v, sign in ((a - x, a - y, 1), (-a - x, a - y, -1), (a - x, -a - y, -1), (-a - x, -a - y, 1)):
        r = np.sqrt(u * u + v * v + z * z)
        total += sign * (np.arctan(u * v / (z * r)) + u * v * z / r * (1 / (u * u + z * z) + 1 / (v * v + z * z)))
    return -total / (2.0 * np.pi)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("shift", [(0.0, 0.0), (1.0, 1.0), (0.3, -0.7), (2.5, 0.4)])
def test_uniform_pressure_on_a_square(shift):
    """Cells of constant pressure represent the load exactly, so there is no discretisation error."""
    system = half_space(STEEL, (11, 11), 0.25, density="constant")
    x, y, _ = system.points.T
    load = np.zeros((len(x), 5))
    load[(np.abs(x) < 1.0) & (np.abs(y) < 1.0), 2] = -1.0
    assert (load[:, 2] < 0.0).sum() == 64
    z = np.array([0.25, 0.5, 1.0, 2.0, 5.0, 20.0])
    points = axis(z) + np.array([*shift, 0.0])
    stress = interior(system, load, points).stress[:, 2, 2]
    np.testing.assert_allclose(stress, newmark(*shift, z, 1.0), atol=2e-6)


@pytest.mark.parametrize("density", ["bilinear", "constant"])
def test_far_field_depends_on_resultant_only(density):
    """Far below the surface, a loaded node and four loaded nodes around it cause the same fields."""
    system = half_space(COUPLED, (8, 8), 0.25, density=density)
    one, four = np.zeros((2, len(system.points), 5))
    x, y, _ = np.abs(system.points.T)
    one[(x < 0.1) & (y < 0.1)] = 4.0 / FACTORS
    four[(x + y > 0.2) & (x + y < 0.3)] = 1.0 / FACTORS
    assert one.sum() == four.sum() != 0.0
    points = np.array([[0.0, 0.0, -30.0], [5.0, -3.0, -40.0]])
    first, second = (system.capability(InteriorFields).evaluate(load, points) for load in (one, four))
    scale = np.abs(first.fluxes * FACTORS).max()
    np.testing.assert_allclose(second.fluxes * FACTORS, first.fluxes * FACTORS, atol=1e-3 * scale)


def differences(capability, load, point, h):
    """Return the divergence of stress, D and B, and the gradients, by central differences of fourth order."""
    steps, weights = np.array([-2, -1, 1, 2]), np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * h)
    offsets = np.concatenate([h * np.outer(steps, e) for e in np.eye(3)])
    around = capability.evaluate(load, point + offsets)
    fluxes, values = around.fluxes.reshape(3, 4, 3, 5), around.values.reshape(3, 4, 5)
    return np.einsum("isij,s->j", fluxes, weights), np.einsum("qsj,s->jq", values, weights)


def check_equilibrium(system, points, h):
    capability, load = system.capability(InteriorFields), noise(system)
    for point in points:
        divergence, gradients = differences(capability, load, point, h)
        here = capability.evaluate(load, point[None])
        size = np.abs(here.fluxes[0] * FACTORS).max()
        assert np.abs(divergence * FACTORS).max() < 2e-4 * size / abs(point[2])
        scaled = gradients / FACTORS[:, None], here.gradients[0] / FACTORS[:, None]
        np.testing.assert_allclose(scaled[0], scaled[1], atol=2e-4 * np.abs(scaled[1]).max())


@pytest.mark.full
def test_coupled_equilibrium():
    """In a rotated orthotropic medium, div sigma = 0, div D = 0, div B = 0, and gradients are derivatives of the
    values."""
    system = half_space(COUPLED, (12, 10), 0.1)
    check_equilibrium(system, np.array([[0.13, -0.2, -0.4], [0.9, 0.3, -0.7]]), 0.01)


def test_coupled_equilibrium_under_a_periodic_surface():
    system = half_space(COUPLED, (11, 9), 0.1, periodic=True)
    check_equilibrium(system, np.array([[0.13, -0.2, -0.4]]), 0.01)


@pytest.mark.parametrize("options", [{"periodic": True}, {"periodic": True, "density": "trigonometric"}])
def test_surface_of_a_periodic_half_space(options):
    """At depth zero, values equal those of the compliance to round-off, also for an odd number of nodes."""
    system = half_space(COUPLED, (7, 8), 0.1, **options)
    load = noise(system)
    result = system.capability(InteriorFields).evaluate(load, system.points)
    expected = system.recover(load).values
    size = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(result.values / size, expected / size, atol=1e-10)


def test_surface_of_a_free_half_space():
    """At depth zero, values equal those of the compliance and fluxes the load, except for short
    waves of the density."""
    system = half_space(COUPLED, (30, 28), 0.1)
    x, y, _ = system.points.T
    load = np.outer(np.cos(np.pi * x / 3.0) ** 2 * np.cos(np.pi * y / 2.8) ** 2, [0.5, -1.0, 2.0, 1.0, -0.7]) / FACTORS
    nodes = np.arange(3, len(x), 41)
    result = system.capability(InteriorFields).evaluate(load, system.points[nodes])
    expected = system.recover(load)
    size = np.abs(expected.values).max(axis=0)
    np.testing.assert_allclose(result.values / size, expected.values[nodes] / size, atol=5e-6)
    size = np.abs(load * FACTORS).max()
    np.testing.assert_allclose(result.fluxes[:, 2] * FACTORS, expected.fluxes[nodes] * FACTORS, atol=1e-3 * size)


def test_points_in_any_order_and_on_grids():
    """Grids, lines and scattered points use different algorithms and give the same values."""
    system = half_space(COUPLED, (9, 6), 0.1)
    load = noise(system)
    grid = PointGrid.along_global_axes(np.linspace(-0.8, 0.7, 5), np.linspace(-0.4, 0.4, 4), [-0.3, -0.15])
    whole = interior(system, load, grid)
    order = np.random.default_rng(0).permutation(len(grid.points))[:9]
    some = interior(system, load, grid.points[order])
    for name in ("displacement", "potentials", "stress", "flux_densities"):
        computed, expected = getattr(some, name), getattr(whole, name)
        np.testing.assert_allclose(computed, expected[order], atol=1e-6 * np.abs(expected).max())


@pytest.mark.full
def test_composed_systems_forward_interior_fields():
    """Rotated frames, stored matrices and two bodies give the same fields; coarser grids and restrictions have none."""
    system = half_space(COUPLED, (9, 9), 0.1)
    load, points = noise(system), np.array([[0.2, 0.1, -0.25], [0.0, -0.3, -0.5]])
    expected = system.capability(InteriorFields).evaluate(load, points).fluxes * FACTORS
    stored = half_space(COUPLED, (9, 9), 0.1, matrix_up_to=1000)
    assert stored.dense() is not None
    for original in (system, stored):
        rotated = rotate_frames(original, np.tile([1.0, 2.0, 0.0], (len(load), 1)))
        rotated_load = load.copy()
        rotated_load[:, :3] = np.einsum("nai,nbi,nb->na", rotated.frames, system.frames, load[:, :3])
        for one, given in ((original, load), (rotated, rotated_load)):
            computed = one.capability(InteriorFields).evaluate(given, points).fluxes * FACTORS
            np.testing.assert_allclose(computed, expected, atol=1e-10 * np.abs(expected).max())
    pair = combine_bodies(system, half_space(STEEL, (9, 9), 0.1))
    np.testing.assert_array_equal(pair.capability(InteriorFields).evaluate(load, points).fluxes * FACTORS, expected)
    large = half_space(COUPLED, (60, 60), 0.1)
    assert large.capability(Multigrid).coarsen().system.capability(InteriorFields) is None
    assert large.capability(Restriction).restrict(np.arange(12)).system.capability(InteriorFields) is None


def test_points_outside_are_rejected():
    system = half_space(STEEL, (4, 4), 0.25)
    load = np.ones(system.offset.shape)
    for points, message in (
        (np.zeros((0, 3)), "allowed: .m, 3. finite numbers"),
        ([[0.0, 0.0, 0.1]], "outside the half space"),
        ([[50.0, 0.0, -1.0]], "far from the contact zone"),
        ([[0.0, np.nan, -1.0]], "allowed: .m, 3. finite numbers"),
    ):
        with pytest.raises(CaseError, match=message):
            interior(system, load, np.array(points))
    with pytest.raises(CaseError, match="the load has shape"):
        interior(system, load[:3], np.array([[0.0, 0.0, -1.0]]))


def test_no_load_causes_no_fields():
    system = half_space(COUPLED, (4, 4), 0.25)
    result = interior(system, np.zeros(system.offset.shape), np.array([[0.0, 0.0, -0.3]]))
    assert not result.stress.any()
    assert not result.displacement.any()


def test_additional_scalar_field():
    """A heat source on the surface causes the temperature Q / (2 pi k r) and the heat flux Q / (2 pi r^2)."""
    thermal = ScalarField(
        "thermal",
        "temperature",
        "K",
        "heat_flux",
        "W/m^2",
        "heat",
        "W",
        "thermal_conductivity",
        "W/m/K",
        "W/m^2/K",
        "K/m",
    )
    material = library_material("batio3-cofe2o4").with_field(thermal, 2.5)
    mesh = half_space_mesh(20.0, 0.4, 8, 1, Quad4())
    system = HalfSpace(matrix_up_to=0).reduce(Body(material.stiffness, mesh, (), "contact", material.fields))
    load = np.zeros(system.offset.shape)
    load[np.linalg.norm(system.points, axis=1).argmin(), 5] = -1.0 / 0.05**2
    points = np.array([[0.0, 0.0, -1.0], [0.6, 0.0, -0.8]])
    result = interior(system, load, points, material.fields)
    np.testing.assert_allclose(result.potentials[:, 2], 1.0 / (2.0 * np.pi * 2.5), rtol=2e-3)
    np.testing.assert_allclose(result.flux_densities[:, 2], points / (2.0 * np.pi), atol=5e-4)
    assert not result.stress.any()
