"""Heat of a current through the contact: a film that conducts poorly in closed form, energy, and refused cases."""

from typing import Any

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_laws.conductivity import PowerLaw, Robin

from meeframe import solve_case
from meeframe.common.errors import CaseError
from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, ContactSolution, PrescribedResultant, Status
from meeframe.elements import Quad4
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ConductivityLaw
from meeframe.material import Material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import Auto, SemismoothNewton, StoppingCriteria, Uzawa, solve

CONDUCTIVITY, SIGMA, A, R, VOLTAGE = 40.0, 6e6, 1e-3, 0.1, 0.05
STEEL = Material.isotropic(2e11, 0.3, permittivity=SIGMA).with_heat(CONDUCTIVITY, 1.2e-5)


def problem(
    height: Any, cells: int, laws: tuple[ConductivityLaw, ...], voltage: float, **options: Any
) -> ContactProblem:
    """Return the indentation of a half space of steel by 2 kN, with `cells` in the radius A."""
    n = 2 * round(1.2 * cells) + 1
    mesh = half_space_mesh(0.1, n * A / cells, (n, n), 1, Quad4())
    system = HalfSpace(matrix_up_to=0).reduce(Body.of(STEEL, mesh, (), "contact"))
    mode = np.zeros_like(system.offset)
    mode[:, 2] = -1.0
    return ContactProblem(
        system,
        options.pop("law", Signorini()),
        flux_channels(*laws, fields=STEEL.fields),
        height(np.hypot(*system.points[:, :2].T)),
        np.tile([options.pop("translation", 0.0), 0.0], (len(mode), 1)),
        np.tile([voltage, 0.0, 20.0], (len(mode), 1)),
        (PrescribedResultant(mode, mode, system.weights, 2e3),),
        **options,
    )


def solved(given: ContactProblem, tolerance: float = 1e-11) -> ContactSolution:
    solution = solve(given, Auto(), StoppingCriteria(tolerance=tolerance))
    assert solution.status is Status.CONVERGED, solution.message
    return solution


def test_film_on_a_disc_heats_the_body_as_a_uniform_source() -> None:
    """With Biot number 1e-3 the current is uniform: power kappa V^2, and q a / k at the centre of the heated disc."""
    film, share, cells = 1e-3 * SIGMA / A, 0.4, 16
    laws = (Robin(film), Insulating(), Insulating())
    disc = problem(lambda r: np.where(r <= A, 0.0, np.inf), cells, laws, VOLTAGE, joule_heat=share)
    state, weights = solved(disc).state, disc.system.weights
    area = weights @ (state.load[:, 2] < 0.0)
    heat = share * film * VOLTAGE**2
    assert -weights @ state.load[:, 5] == pytest.approx(heat * area, rel=3e-3)
    assert -state.displacement[:, 5].min() == pytest.approx(heat * np.sqrt(area / np.pi) / CONDUCTIVITY, rel=5e-3)
    # twice the voltage, four times the heat
    double = solved(problem(lambda r: disc.gap, cells, laws, 2.0 * VOLTAGE, joule_heat=share)).state
    assert weights @ double.load[:, 5] == pytest.approx(4.0 * weights @ state.load[:, 5], rel=1e-6)


def test_heat_of_current_and_friction_adds_to_conduction() -> None:
    """At each node heat flux = conductance * difference - share * power, with laws that depend on the pressure."""
    share, duration = 0.3, 1e-3
    laws = (PowerLaw(1e9, 1e9), Insulating(), StepConductivity(2e5))
    given = problem(
        lambda r: r**2 / (2.0 * R),
        12,
        laws,
        VOLTAGE,
        law=IsotropicCoulomb(0.3),
        translation=3e-6,
        joule_heat=share,
        friction_heat=0.5 / duration,
    )
    state = solved(given).state
    closed = state.load[:, 2] < 0.0
    drop = -state.displacement[:, 3] - VOLTAGE
    current = state.load[:, 3]
    expected = np.where(closed, 1e9 * (np.maximum(-state.load[:, 2], 0.0) / 1e9) ** 0.95 * drop, 0.0)
    np.testing.assert_allclose(current, expected, rtol=0.0, atol=1e-7 * np.abs(current).max())
    slip = given.translation - state.displacement[:, :2]
    friction = 0.5 / duration * (state.load[:, :2] * slip).sum(axis=1)
    joule = share * current * drop
    assert joule.min() >= 0.0
    assert joule.max() > 0.1 * np.abs(state.load[:, 5]).max()
    assert friction.max() > 0.01 * np.abs(state.load[:, 5]).max()
    conducted = np.where(closed, 2e5 * (-state.displacement[:, 5] - 20.0), 0.0)
    heat = conducted - joule - friction
    np.testing.assert_allclose(state.load[:, 5], heat, rtol=0.0, atol=1e-7 * np.abs(heat).max())
    # the full derivative: few iterations
    assert solve(given, SemismoothNewton(), StoppingCriteria(tolerance=1e-11)).iterations < 25
    with pytest.raises(CaseError, match="joule_heat: 'newton' or 'auto'"):
        Uzawa().check(given)


CASE = """
formulation = "half-space"
[material]
name = "isotropic"
young_modulus = "200 GPa"
poisson_ratio = 0.3
permittivity = 6e6
thermal_conductivity = 40
thermal_expansion = 1.2e-5
[mesh]
type = "half-space"
contact_width = "2.4 mm"
divisions = 15
[contact]
joule_heat = 0.5
[conductivity]
electric = {name = "power-law", reference_conductivity = 1e9, reference_pressure = "1 GPa"}
[indenter]
name = "sphere"
radius = "100 mm"
[[steps]]
normal_force = "1 kN"
charge = -200
"""


def test_case_with_a_prescribed_current(load_changed: Any) -> None:
    """All heat is half of the electric power, the rest heats the indenter; thermally the contact insulates."""
    result = solve_case(load_changed(CASE))
    (step,) = result.steps
    assert step.status is Status.CONVERGED
    weights, current = result.zone.weights, step.fluxes[:, 0]
    assert weights @ current == pytest.approx(-200.0, rel=1e-8)
    drop = step.potentials[:, 0] - step.loading.electric_potential
    assert -weights @ step.fluxes[:, 2] == pytest.approx(0.5 * weights @ (current * drop), rel=1e-6)
    assert step.potentials[:, 2].max() > 1.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([("joule_heat = 0.5", "joule_heat = 1.5")], r"contact.joule_heat = 1.5: must be >= 0 and <= 1"),
        ([("thermal_conductivity = 40\nthermal_expansion = 1.2e-5\n", "")], "needs a body with a temperature"),
        ([("electric = {", "magnetic = {"), ("charge = -200", "")], "needs a current through the contact"),
        ([("thermal_expansion", "pyro_constraint = 'strain'\npyroelectric = [0, 0, 1e-5]\nthermal_expansion")], "pyro"),
        ([("charge = -200", "electric_potential = 1\napproach = '1 um'"), ('normal_force = "1 kN"', "")], "level"),
    ],
)
def test_invalid_cases(load_changed: Any, changes: list[tuple[str, str]], message: str) -> None:
    with pytest.raises(CaseError, match=message):
        load_changed(CASE, *changes)
