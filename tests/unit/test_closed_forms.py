"""Closed forms agree with docs/explanation/theory.md and with integrals of their boundary values."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ellipkm1

from meeframe.common.errors import MeeframeError
from meeframe.material import Material, library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.testing.closed_forms import CONDITIONS, Cone, FlatPunch, Indentation, Shape, Sphere, indent

APPROACH = 5e-5
SHAPES = {"sphere": Sphere(0.1), "punch": FlatPunch(2e-3), "cone": Cone(0.02)}
# potentials of the magnitude that occurs in insulated contact: 4e4 V and 50 A
POTENTIALS = [(None, None), (0.0, None), (None, 0.0), (0.0, 0.0), (2e4, None), (None, -20.0), (-1.5e4, 30.0)]


@pytest.fixture(scope="module")
def xi() -> np.ndarray:
    return axisymmetric_compliance(library_material("batio3-cofe2o4").stiffness)


def height(shape: Shape, r: np.ndarray) -> np.ndarray:
    match shape:
        case Sphere(radius):
            return r**2 / (2 * radius)
        case Cone(angle):
            return r * np.tan(angle)
    return np.zeros_like(r)


def newton_potential(solution: Indentation, field: int, r: float) -> float:
    """Return the integral of a flux density over the contact, divided by distance, by rings and the complete
    elliptic integral."""
    a = solution.contact_radius
    density = (lambda s: -solution.pressure(s), solution.electric_flux, solution.magnetic_flux_density)[field]

    def ring(theta: float) -> float:  # s = a sin(theta) removes the square-root singularity
        s = a * np.sin(theta)
        log = ellipkm1(((r - s) / (r + s)) ** 2)
        return 4.0 * s / (r + s) * log * density(np.array([s]))[0] * a * np.cos(theta)

    kink = np.arcsin(r / a) if r < a else np.pi / 4
    parts = [quad(ring, *ends, epsabs=0, epsrel=1e-9, limit=200)[0] for ends in ((0.0, kink), (kink, np.pi / 2))]
    return float(sum(parts))


@pytest.mark.parametrize(
    ("condition", "force"), [("EMII", 23330.6), ("ECMII", 21896.1), ("EIMCI", 23287.8), ("EMCI", 21849.6)]
)
def test_forces_of_the_theory_page(xi: np.ndarray, condition: str, force: float) -> None:
    solution = indent(xi, Sphere(0.1), APPROACH, *CONDITIONS[condition])
    assert solution.force == pytest.approx(force, abs=0.05)
    assert solution.contact_radius == pytest.approx(np.sqrt(0.1 * APPROACH))


def test_insulated_centre_potentials_of_the_theory_page(xi: np.ndarray) -> None:
    solution = indent(xi, Sphere(0.1), APPROACH)
    centre = np.zeros(1)
    assert solution.electric_potential(centre)[0] == pytest.approx(-4.3584e4, rel=1e-5)
    assert solution.magnetic_potential(centre)[0] == pytest.approx(-47.644, rel=1e-5)
    raised = indent(xi, Sphere(0.1), APPROACH, *CONDITIONS["ECMII"]).magnetic_potential(centre)[0]
    assert raised / solution.magnetic_potential(centre)[0] - 1 == pytest.approx(0.042, abs=5e-4)


def test_conducting_flux_follows_pressure(xi: np.ndarray) -> None:
    solution = indent(xi, Sphere(0.1), APPROACH, *CONDITIONS["ECMII"])
    assert solution.charge == pytest.approx(xi[0, 1] / xi[1, 1] * solution.force, rel=1e-12)
    r = np.linspace(0, 0.99, 20) * solution.contact_radius
    np.testing.assert_allclose(solution.electric_flux(r), xi[0, 1] / xi[1, 1] * solution.pressure(r), rtol=1e-12)
    assert solution.charge < 0
    assert solution.magnetic_flux == 0


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("potentials", POTENTIALS)
def test_fluxes_integrate_to_totals(
    xi: np.ndarray, shape: Shape, potentials: tuple[float | None, float | None]
) -> None:
    solution = indent(xi, shape, APPROACH, *potentials)
    a = solution.contact_radius
    for density, total in (
        (solution.pressure, solution.force),
        (solution.electric_flux, solution.charge),
        (solution.magnetic_flux_density, solution.magnetic_flux),
    ):
        integral = quad(
            lambda theta, density=density: (
                2 * np.pi * a**2 * np.sin(theta) * np.cos(theta) * density(np.array([a * np.sin(theta)]))[0]
            ),
            0,
            np.pi / 2,
            epsabs=0,
            epsrel=1e-10,
        )[0] if total else 0.0  # fmt: skip
        assert integral == pytest.approx(total, rel=1e-7)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("potentials", POTENTIALS)
def test_surface_fields_are_potentials_of_the_fluxes(
    xi: np.ndarray, shape: Shape, potentials: tuple[float | None, float | None]
) -> None:
    solution = indent(xi, shape, APPROACH, *potentials)
    for fraction in (0.31, 0.83, 1.27, 4.0):
        r = fraction * solution.contact_radius
        sources = np.array([newton_potential(solution, field, r) for field in range(3)])
        at = np.array([r])
        computed = [
            solution.displacement(at)[0],
            solution.electric_potential(at)[0],
            solution.magnetic_potential(at)[0],
        ]
        sizes = np.abs(xi) @ np.abs(sources)
        np.testing.assert_allclose(computed / sizes, xi @ sources / sizes, atol=1e-6)


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("potentials", POTENTIALS)
def test_boundary_conditions_hold(xi: np.ndarray, shape: Shape, potentials: tuple[float | None, float | None]) -> None:
    solution = indent(xi, shape, APPROACH, *potentials)
    a = solution.contact_radius
    inside, outside = np.linspace(0.01, 0.999, 30) * a, np.geomspace(1.001, 20.0, 30) * a
    np.testing.assert_allclose(solution.displacement(inside), height(shape, inside) - APPROACH, atol=1e-10 * APPROACH)
    for value, field, flux, scale in (
        (potentials[0], solution.electric_potential, solution.electric_flux, 4e4),
        (potentials[1], solution.magnetic_potential, solution.magnetic_flux_density, 50.0),
    ):
        if value is None:
            assert not flux(inside).any()
        else:
            np.testing.assert_allclose(field(inside), value, atol=1e-10 * scale)
    assert not solution.pressure(outside).any()
    if not isinstance(shape, FlatPunch):
        gap = height(shape, outside) - APPROACH - solution.displacement(outside)
        # for a negative shift, the surface rises through the indenter just outside the contact, as documented
        assert (gap.min() > 0) == (solution.shift >= 0)
        assert solution.pressure(inside).min() > 0
        # no edge singularity: the pressure vanishes at the edge
        assert solution.pressure(np.array([a * (1 - 1e-10)]))[0] < 1e-4 * solution.pressure(np.array([a / 2]))[0]


def test_insulated_potentials_follow_the_surface(xi: np.ndarray) -> None:
    for shape in SHAPES.values():
        solution = indent(xi, shape, APPROACH)
        r = np.linspace(0, 5, 23) * solution.contact_radius
        u3 = solution.displacement(r)
        np.testing.assert_allclose(solution.electric_potential(r), xi[0, 1] / xi[0, 0] * u3, rtol=1e-12)
        np.testing.assert_allclose(solution.magnetic_potential(r), xi[0, 2] / xi[0, 0] * u3, rtol=1e-12)


def test_far_field_matches_point_sources(xi: np.ndarray) -> None:
    solution = indent(xi, Sphere(0.1), APPROACH, -1.5e4, 30.0)
    r = 1e4 * solution.contact_radius
    expected = xi @ np.array([-solution.force, solution.charge, solution.magnetic_flux]) / r
    at = np.array([r])
    computed = [solution.displacement(at)[0], solution.electric_potential(at)[0], solution.magnetic_potential(at)[0]]
    np.testing.assert_allclose(computed, expected, rtol=1e-6)


def test_isotropic_hertz_sneddon_and_punch() -> None:
    young, poisson = 100e9, 0.25
    xi = axisymmetric_compliance(Material.isotropic(young, poisson).stiffness)
    modulus = young / (1 - poisson**2)
    assert indent(xi, Sphere(0.1), APPROACH).force == pytest.approx(4 / 3 * modulus * np.sqrt(0.1 * APPROACH**3))
    assert indent(xi, FlatPunch(2e-3), APPROACH).force == pytest.approx(2 * modulus * 2e-3 * APPROACH)
    cone = indent(xi, Cone(0.02), APPROACH)
    assert cone.force == pytest.approx(2 / np.pi * modulus * APPROACH**2 / np.tan(0.02))
    assert cone.contact_radius == pytest.approx(2 * APPROACH / (np.pi * np.tan(0.02)))


def test_prescribed_potentials_move_the_contact_radius(xi: np.ndarray) -> None:
    # eq. (34) and the corrected eq. (36), with opposite signs of the potentials in the frame of the source
    phi, psi = -1.5e4, 30.0
    electric = indent(xi, Sphere(0.1), APPROACH, phi)
    assert electric.contact_radius**2 == pytest.approx(0.1 * (APPROACH + xi[0, 1] * phi / xi[1, 1]), rel=1e-12)
    both = indent(xi, Sphere(0.1), APPROACH, phi, psi)
    eta = np.array([np.linalg.det(np.delete(np.delete(xi, j, 0), 0, 1)) * (-1) ** j for j in range(3)])
    shift = -(eta[1] * phi + eta[2] * psi) / eta[0]
    assert both.contact_radius == pytest.approx(np.sqrt(0.1 * (APPROACH + shift)), rel=1e-9)
    force = 4 * both.contact_radius / (3 * np.pi * np.linalg.det(xi)) * eta[0] * (APPROACH + shift)
    assert both.force == pytest.approx(force, rel=1e-9)


def test_potentials_that_open_the_contact_are_rejected(xi: np.ndarray) -> None:
    lift = 2 * APPROACH * xi[1, 1] / xi[0, 1]
    with pytest.raises(MeeframeError, match="no contact"):
        indent(xi, Sphere(0.1), APPROACH, -lift)
    with pytest.raises(MeeframeError, match="no contact: approach -1e-05"):
        indent(xi, Sphere(0.1), -1e-5)
