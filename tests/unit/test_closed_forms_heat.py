"""Closed forms of hot indentation: their fluxes, integrated over the contact, give the fields of the surface."""

import numpy as np
import pytest

from meeframe.fields import Array
from meeframe.material import Material, library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.material.thermal_half_space import thermal_response
from meeframe.testing.closed_forms import FlatPunch, Shape, Sphere
from meeframe.testing.closed_forms_heat import HotIndentation

A, TEMPERATURE, REFERENCE_RADIUS = 1e-3, 300.0, 2e-3
STEEL = Material.isotropic(2e11, 0.3).with_heat(40.0, 1.2e-5)
COMPOSITE = library_material("batio3-cofe2o4").with_heat(
    [2.8, 2.8, 3.1], [12.9e-6, 12.9e-6, 7.5e-6], None, [0, 0, -7e-5], [0, 0, -3e-4], "strain"
)


def surface(material: Material) -> tuple[Array, Array, float]:
    """Return xi, delta and kappa of a material that is axisymmetric about x3."""
    coupled = material.stiffness[:, :5, :5]
    y, kappa = thermal_response(coupled, material.thermal_moduli, material.decoupled[0][1], (0, 0, 1), [[1.0, 0, 0]])
    return axisymmetric_compliance(coupled), -y[0, 2:].real, float(kappa[0])


def integration_rule(x: float, count: int = 60, step: float = 0.07) -> tuple[Array, Array, Array]:
    """Return radii, distances from a point at x < A, and weights of a rule on the disc of radius A.

    It is polar around the point, so that 1/distance is no singularity, and doubly exponential along each chord.
    """
    azimuth = np.pi * (np.arange(count) + 0.5) / count
    t = step * np.arange(-55, 56)
    share = 1.0 / (1.0 + np.exp(-np.pi * np.sinh(t)))
    slope = np.pi * np.cosh(t) * share * (1.0 / (1.0 + np.exp(np.pi * np.sinh(t)))) * step
    half_chord = np.sqrt(A**2 - (x * np.sin(azimuth)) ** 2)
    length = half_chord - x * np.cos(azimuth)
    distance = np.outer(length, share)
    to_boundary = np.outer(length, share[::-1]) * (distance + (half_chord + x * np.cos(azimuth))[:, None])
    weights = 2.0 * np.pi / count * distance * np.outer(length, slope)
    return np.sqrt(A**2 - to_boundary).ravel(), distance.ravel(), weights.ravel()


@pytest.mark.full(except_for=7)
@pytest.mark.parametrize("x", [0.3, 0.6, 0.95])
@pytest.mark.parametrize(
    ("material", "shape", "approach", "potentials"),
    [
        (STEEL, Sphere(0.1), None, (None, None)),
        (COMPOSITE, Sphere(0.1), None, (None, None)),
        (COMPOSITE, Sphere(0.1), None, (2e3, None)),
        (COMPOSITE, Sphere(0.1), None, (0.0, 5.0)),
        (COMPOSITE, FlatPunch(A), 2e-5, (2e3, -5.0)),
    ],
)
def test_fluxes_cause_the_prescribed_fields(
    material: Material, shape: Shape, approach: float | None, potentials: tuple[float | None, float | None], x: float
) -> None:
    """Height, potentials and temperature of the indenter, and of the surface, at a point of the contact."""
    xi, distortivity, kappa = surface(material)
    exact = HotIndentation(xi, distortivity, kappa, shape, A, TEMPERATURE, potentials, REFERENCE_RADIUS, approach)
    radius, distance, weights = integration_rule(x * A)
    inside = radius < A * (1.0 - 1e-15)
    radius, distance, weights = radius[inside], distance[inside], weights[inside]
    potential = xi @ (exact.tractions(radius) @ (weights / distance))
    heat = 2.0 * exact.conductivity * TEMPERATURE / np.pi / np.sqrt(A**2 - radius**2)
    thermal = -distortivity / (2.0 * np.pi) * float(weights * heat @ np.log(distance / REFERENCE_RADIUS))
    temperature = float(weights @ (heat / distance)) / (2.0 * np.pi * exact.conductivity)
    assert temperature == pytest.approx(TEMPERATURE, rel=1e-7)
    position = shape.flat_approach(A) - float(shape.potential(np.array([x * A]), A)[0]) - exact.solved_approach
    prescribed = [position, *potentials]
    sizes, values = np.abs(potential) + np.abs(thermal), exact.values(np.array([x * A]))[:, 0]
    for field, value in enumerate(prescribed):
        assert abs(potential[field] + thermal[field] - values[field]) <= 1e-7 * sizes[field]
        if value is not None:
            assert abs(values[field] - value) < 1e-12 * sizes[field]


@pytest.mark.parametrize("x", [1.01, 1.1, 2.0, 5.0])
def test_gap_opens_outside_the_contact(x: float) -> None:
    """A hot sphere in perfect contact does not overlap the surface beside it, which expands as well."""
    xi, distortivity, kappa = surface(STEEL)
    exact = HotIndentation(xi, distortivity, kappa, Sphere(0.1), A, TEMPERATURE, (None, None), REFERENCE_RADIUS)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    angle, azimuth = np.pi / 4.0 * (nodes + 1.0), 2.0 * np.pi * np.arange(2000) / 2000
    r = A * np.sin(angle)  # without the singularity of the heat at the edge
    distance = np.sqrt((x * A) ** 2 + r[:, None] ** 2 - 2.0 * x * A * r[:, None] * np.cos(azimuth))
    area = np.pi / 4.0 * weights * A * np.cos(angle) * r * 2.0 * np.pi
    pressed = xi[0] @ (exact.tractions(r) @ (area * (1.0 / distance).mean(axis=1)))
    heat = area * 2.0 * kappa * TEMPERATURE / np.pi / np.sqrt(A**2 - r**2)
    bulge = -distortivity[0] / (2.0 * np.pi) * heat @ np.log(distance / REFERENCE_RADIUS).mean(axis=1)
    gap = (x * A) ** 2 / 0.2 - exact.solved_approach - pressed - bulge
    assert gap > 1e-4 * (x - 1.0) ** 1.5 * exact.solved_approach
