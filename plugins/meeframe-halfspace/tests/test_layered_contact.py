"""Contact on layers: nearly degenerate materials, and isolated against periodic contacts."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

import meeframe
from meeframe.material import Material, library_material, rotation_about

UM = 1e-6
GLASS = Material.isotropic(7e10, 0.2)


def detuned(change: float) -> Material:
    """Return a transversely isotropic material close to an isotropic one, whose Stroh eigenvalues all are i."""
    exact = Material.isotropic(2e11, 0.3)
    elastic = exact.elastic.copy()
    elastic[2, 2, 2, 2] *= 1.0 + change
    elastic[:2, :2, 2, 2] *= 1.0 - 0.4 * change
    elastic[2, 2, :2, :2] *= 1.0 - 0.4 * change
    return replace(exact, elastic=elastic)


def pressed(layers: Any, step: Any, width: float, divisions: int, material: Any = GLASS, **keys: Any) -> Any:
    """Return the result under a sphere of 10 um after a load step, or after several."""
    formulation = keys.pop("formulation", HalfSpace(matrix_up_to=0))
    steps = step if isinstance(step, list) else [step]
    mesh = meeframe.mesh.half_space(width, divisions)
    indenter = meeframe.Sphere(10 * UM)
    case = meeframe.Case(
        material=material, layers=layers, mesh=mesh, formulation=formulation, indenter=indenter, steps=steps, **keys
    )
    result = case.solve(progress=False)
    assert result.status == "converged"
    return result


def force_of(result: Any) -> float:
    return float(-meeframe.resultants(result.zone, result[-1]).force[2])


def test_nearly_degenerate_layers() -> None:
    """The force on a film changes in proportion to the change of its constants, down to round-off."""

    def force(change: float) -> float:
        layers = [meeframe.Layer(detuned(change), 0.5 * UM)]
        return force_of(pressed(layers, meeframe.Step(approach=40e-9), 1.6 * UM, 12))

    exact = force(0.0)
    slope = (force(1e-3) - exact) / 1e-3
    assert abs(slope) > 1e-3 * exact
    assert force(1e-6) - exact == pytest.approx(slope * 1e-6, rel=2e-2)
    assert force(1e-10) == pytest.approx(exact, rel=1e-9)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("periodic", [False, True])
def test_contact_on_layers_of_the_substrate(periodic: bool) -> None:
    """With friction and conduction, a rotated stack of one material has the contact history of a half space."""
    perfect = meeframe.StepConductivity(np.inf)
    keys = {
        "contact": meeframe.IsotropicCoulomb(0.3),
        "conductivity": {"electric": perfect, "magnetic": perfect},
        "formulation": HalfSpace(matrix_up_to=0, periodic=periodic),
    }
    steps = [
        meeframe.Step(approach=40e-9),
        meeframe.Step(translation=[8e-9, 0.0], electric_potential=1.0),
        meeframe.Step(approach=30e-9, translation=[2e-9, 3e-9]),
    ]
    material = library_material("batio3-cofe2o4").rotated(rotation_about([1, 2, 3], np.radians(40.0)))
    layers = [meeframe.Layer(material, thickness * UM) for thickness in (0.3, 0.5)]
    one, other = (pressed(stack, steps, 1.6 * UM, 16, material, **keys) for stack in ([], layers))
    for name in ("traction", "fluxes"):
        for first, second in zip(one, other, strict=True):
            expected = getattr(first, name)
            np.testing.assert_allclose(getattr(second, name), expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_isolated_and_periodic_contact_on_a_rigid_base() -> None:
    """On a rigid base the response decays within some thicknesses, and other contacts are without effect.

    Waves that the periodic grid leaves out change the pressure at single nodes near the contact edge.
    """
    base, step = meeframe.Base(0.4 * UM), meeframe.Step(approach=20e-9)
    free, other = (
        pressed([], step, 4.8 * UM, 96, "pzt-4", base=base, formulation=HalfSpace(matrix_up_to=0, periodic=flag))
        for flag in (False, True)
    )
    assert force_of(other) == pytest.approx(force_of(free), rel=2e-3)
    one, two = (result[-1].traction[:, 2] for result in (free, other))
    inner = np.hypot(*free.zone.points[:, :2].T) < 0.5 * np.sqrt(20e-9 * 10 * UM)
    np.testing.assert_allclose(two[inner], one[inner], rtol=0.0, atol=5e-3 * np.abs(one).max())


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("interface", "jumps"),
    [
        ({"normal_stiffness": 2e17}, [1.0 / 2e17, 0.0]),
        ({"electric_conductance": 0.02}, [0.0, -1.0 / 0.02]),
        ({"normal_stiffness": 3e17, "tangential_stiffness": 1e17, "electric_conductance": 0.05}, [1 / 3e17, -1 / 0.05]),
    ],
    ids=["spring", "weak conductor", "both"],
)
def test_thin_film_on_an_interface(interface: dict[str, float], jumps: list[float]) -> None:
    """A film on a rigid grounded base below the interface is a bed of columns, whose jumps add to its compliance.

    The tip is grounded. Force and charge differ by the order (h / a)^2, and are extrapolated.
    """
    film, thickness, radius = library_material("pzt-5h"), 0.8 * UM, 0.02
    stiff = Material.isotropic(1e16, 0.3, 1e-3, 1.0)
    column = film.stiffness[2, [2, 3]][:, [2, 3], 2]
    matrix = np.linalg.inv(thickness * np.linalg.inv(column) + np.diag(jumps))
    ratios = []
    for width in (10.0, 20.0):  # of the contact radius over the thickness
        a = width * thickness
        approach = a**2 / (2.0 * radius)
        result = meeframe.Case(
            material=stiff,
            layers=[meeframe.Layer(film, thickness, interface=meeframe.Interface(**interface))],
            base=meeframe.Base(0.02 * UM),
            mesh=meeframe.mesh.half_space(2.4 * a, 76),
            formulation=HalfSpace(matrix_up_to=0),
            indenter=meeframe.Sphere(radius),
            conductivity={"electric": meeframe.StepConductivity(np.inf)},
            steps=[meeframe.Step(approach=approach)],
        ).solve(progress=False)
        totals = meeframe.resultants(result.zone, result[-1])
        expected = np.pi * radius * approach**2 * matrix[:, 0] * [1.0, -1.0]
        ratios.append([totals.normal_force, totals.charge] / expected)
    np.testing.assert_allclose((4.0 * ratios[1] - ratios[0]) / 3.0, 1.0, rtol=3e-3)


@pytest.mark.full
def test_isolated_and_periodic_contact_on_a_half_space() -> None:
    """Under the same force the pressure of a contact far from its images is that of an isolated one.

    Images of a force act like gradients of their displacement, with the square of their distance by symmetry, or more.
    """
    layers, step, errors = [meeframe.Layer("batio3", 0.3 * UM)], meeframe.Step(normal_force=1e-3), []
    for count in (24, 48, 96):
        free, periodic = (
            pressed(
                layers,
                step,
                1.2 * UM * count / 24,
                count,
                "cofe2o4",
                formulation=HalfSpace(matrix_up_to=0, periodic=flag),
            )
            for flag in (False, True)
        )
        one, two = (result[-1].traction[:, 2] for result in (free, periodic))
        centre = np.hypot(*free.zone.points[:, :2].T) < 0.12 * UM
        errors.append(abs(two[centre].mean() / one[centre].mean() - 1.0))
    assert errors[2] < errors[1] / 4.0 < errors[0] / 16.0
    assert errors[2] < 1e-3
