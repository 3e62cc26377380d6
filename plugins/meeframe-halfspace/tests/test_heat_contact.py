"""Contact with heat on half spaces: closed forms, energy balance, solvers, and case files."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_laws.conductivity import PowerLaw, Robin

import meeframe
from meeframe import solve_case
from meeframe.common.errors import CaseError
from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, ContactSolution, PrescribedResultant, Solver, Status
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.indenters.base import Indenter
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.material import Material, library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.material.thermal_half_space import thermal_response
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.model.heat_diagnostics import CRITICAL
from meeframe.results.records import StepResult, Zone
from meeframe.results.resultants import Resultants, resultants
from meeframe.solvers import Auto, BarzilaiBorwein, SemismoothNewton, StoppingCriteria, Uzawa, solve_to_edges
from meeframe.system.capabilities import EdgeResolution
from meeframe.system.two_body import combine_bodies
from meeframe.testing.closed_forms import FlatPunch, Sphere
from meeframe.testing.closed_forms_heat import HotIndentation, hot_punch_force

COMPOSITE = library_material("batio3-cofe2o4").with_heat(
    [2.8, 2.8, 3.1], [12.9e-6, 12.9e-6, 7.5e-6], None, [0, 0, -7e-5], [0, 0, -3e-4], "strain"
)
YOUNG, POISSON, EXPANSION, CONDUCTIVITY = 2e11, 0.3, 1.2e-5, 40.0
STEEL = Material.isotropic(YOUNG, POISSON).with_heat(CONDUCTIVITY, EXPANSION)
MODULUS, DISTORTIVITY = YOUNG / (1.0 - POISSON**2), EXPANSION * (1.0 + POISSON) / CONDUCTIVITY
A, R, REFERENCE_RADIUS, TEMPERATURE = 1e-3, 0.1, 2e-3, 300.0
PERFECT = StepConductivity(np.inf)
Potentials = tuple[float | None, float | None]


def surface(material: Material) -> tuple[Array, Array, float]:
    """Return xi, delta and kappa of a material that is axisymmetric about x3."""
    coupled = material.stiffness[:, :5, :5]
    xi = axisymmetric_compliance(coupled)
    y, kappa = thermal_response(coupled, material.thermal_moduli, material.decoupled[0][1], (0, 0, 1), [[1.0, 0, 0]])
    return xi, -y[0, 2:].real, float(kappa[0])


def hot_problem(
    material: Material,
    height: Any,
    approach: float,
    cells: int,
    laws: tuple[ConductivityLaw, ...],
    potentials: tuple[float, float, float],
    edges: Any = "nodes",
    law: ContactLaw | None = None,
    force: float | None = None,
    reference_radius: float | None = REFERENCE_RADIUS,
    **options: Any,
) -> ContactProblem:
    """Return the indentation with `cells` in the radius A; with a force, the approach is free."""
    spacing, n = A / cells, 2 * round(1.2 * cells) + (height is flat)
    mesh = half_space_mesh(0.1, n * spacing, (n, n), 1, Quad4())
    formulation = HalfSpace(edges=edges, reference_radius=reference_radius, matrix_up_to=0)
    system = formulation.reduce(Body.of(material, mesh, (), "contact"))
    x, y = system.points[:, :2].T
    gap = height(np.hypot(x, y)) - approach
    mode = np.zeros_like(system.offset)
    mode[:, 2] = -1.0
    prescribed = () if force is None else (PrescribedResultant(mode, mode, system.weights, force),)
    drag = options.pop("translation", 0.0)
    return ContactProblem(
        system,
        law or Signorini(),
        flux_channels(*laws, fields=material.fields),
        gap,
        np.tile([drag, 0.0], (len(gap), 1)),
        np.tile(potentials, (len(gap), 1)),
        prescribed,
        **options,
    )


def sphere(r: Array) -> Array:
    return np.asarray(r**2 / (2.0 * R))


def flat(r: Array) -> Array:
    return np.where(r <= A, 0.0, np.inf)


def solved(problem: ContactProblem, solver: Solver | None = None, tolerance: float = 1e-9) -> ContactSolution:
    solution, _ = solve_to_edges(problem, solver or Auto(), StoppingCriteria(tolerance=tolerance))
    assert solution.status is Status.CONVERGED, solution.message
    return solution


def totals(problem: ContactProblem, solution: ContactSolution) -> Array:
    return np.asarray(problem.system.weights @ solution.state.load)


def close(values: Array, expected: Array, tolerance: float) -> None:
    """Require that columns agree relative to their largest entries."""
    assert (np.abs(values - expected) <= tolerance * np.abs(expected).max(axis=0)).all()


def conduction(potentials: Potentials) -> tuple[ConductivityLaw, ...]:
    return (*(Insulating() if value is None else PERFECT for value in potentials), PERFECT)


FLUXES = {"electric_potential": "charge", "magnetic_potential": "magnetic_flux"}


def indented(
    exact: HotIndentation, material: Material, indenter: Indenter, cells: int, floating: bool = False
) -> tuple[Zone, StepResult, Resultants]:
    """Return the result of the case of a closed form with `cells` in the radius A, by the potentials or by no flux."""
    given = {name: value for name, value in zip(FLUXES, exact.potentials, strict=True) if value is not None}
    held = {FLUXES[name]: 0.0 for name in given} if floating else given
    divisions = 2 * round(1.2 * cells) + isinstance(exact.shape, FlatPunch)
    case = meeframe.Case(
        material=material,
        mesh=meeframe.mesh.half_space(divisions * A / cells, divisions=divisions),
        formulation=meeframe.formulation("half-space", edges="resolved", reference_radius=REFERENCE_RADIUS),
        indenter=indenter,
        conductivity=dict.fromkeys([*(name.removesuffix("_potential") for name in given), "thermal"], PERFECT),
        steps=[meeframe.Step(approach=exact.solved_approach, temperature=TEMPERATURE, **held)],
    )
    result = case.solve(progress=False)
    assert result[0].status is Status.CONVERGED
    return result.zone, result[0], resultants(result.zone, result[0])


SPHERES: tuple[tuple[Material, Potentials, bool], ...] = (
    (STEEL, (None, None), False),
    (COMPOSITE, (None, None), False),
    (COMPOSITE, (0.0, None), False),
    (COMPOSITE, (None, 0.0), False),
    (COMPOSITE, (0.0, 0.0), False),
    (COMPOSITE, (0.0, None), True),
    (COMPOSITE, (None, 0.0), True),
    (COMPOSITE, (0.0, 0.0), True),
)


@pytest.mark.parametrize(
    ("material", "potentials", "floating", "cells"),
    [
        *((*each, 20) for each in SPHERES[1:5:3]),
        *(pytest.param(*each, 24, marks=pytest.mark.full) for each in SPHERES),
        pytest.param(*SPHERES[-1], 64, marks=pytest.mark.full),
    ],
)
def test_hot_sphere_in_closed_form(material: Material, potentials: Potentials, floating: bool, cells: int) -> None:
    """Contact radius, force, heat, charge, magnetic flux and potentials at the approach of a contact radius.

    Tips that float have the potentials at which no charge or flux flows. The heat flux is singular at the contact edge,
    whose position is uncertain by a fraction of a spacing; the force has no such part, and its error is smaller. The
    magnetic flux is the difference of a part of the shape, three times as large, and one of the heat, so that its error
    is larger.
    """
    exact = HotIndentation(*surface(material), Sphere(R), A, TEMPERATURE, potentials, REFERENCE_RADIUS)
    insulating, earthed = replace(exact, potentials=(None, None)), exact.totals
    if floating:
        exact = without_fluxes(exact)
    zone, step, total = indented(exact, material, meeframe.Sphere(R), cells, floating)
    tolerance = 0.032 / cells  # 5e-4 at 64 cells
    assert np.sqrt(total.contact_area / np.pi) == pytest.approx(A, rel=tolerance)
    assert total.normal_force == pytest.approx(exact.force, rel=tolerance / 8.0)
    assert total.heat == pytest.approx(exact.heat, rel=tolerance)
    # charge and flux of a floating tip are zero
    assert abs(total.charge - exact.totals[1]) <= tolerance / 8.0 * abs(earthed[1])
    assert abs(total.magnetic_flux - exact.totals[2]) <= 2.0 * tolerance * abs(earthed[2])
    if floating:
        for name, value in zip(FLUXES, exact.potentials, strict=True):
            assert value is None or step.loading.scalars[name] == pytest.approx(value, rel=tolerance)
    r = np.hypot(*zone.points[:, :2].T)
    inside = r < 0.9 * A
    assert np.abs(step.potentials[inside, 2] - TEMPERATURE).max() <= 1e-7 * TEMPERATURE
    computed = np.column_stack([step.displacement[:, 2], step.potentials[:, :2]])[inside]
    size = np.abs(insulating.values(r[inside])).max(axis=1)
    assert (np.abs(computed - exact.values(r[inside]).T) <= tolerance * size).all()


def without_fluxes(exact: HotIndentation) -> HotIndentation:
    """Return the indentation at the potentials of the fields that conduct for which no charge or flux flows."""
    fields = [field for field, value in enumerate(exact.potentials) if value is not None]

    def at(values: Array) -> HotIndentation:
        potentials: list[float | None] = [None, None]
        for field, value in zip(fields, values.tolist(), strict=True):
            potentials[field] = value
        return replace(exact, potentials=(potentials[0], potentials[1]))

    rows = [1 + field for field in fields]
    none = at(np.zeros(len(fields))).totals[rows]
    slopes = [at(unit).totals[rows] - none for unit in np.eye(len(fields))]
    return at(-np.linalg.solve(np.transpose(slopes), none))


@pytest.mark.parametrize("cells", [16, pytest.param(64, marks=pytest.mark.full)])
def test_hot_sphere_under_force_control(cells: int) -> None:
    """Isotropic: pressure at the centre and contact radius do not depend on the reference radius."""
    exact = HotIndentation(*surface(STEEL), Sphere(R), A, TEMPERATURE)
    thermal = MODULUS * EXPANSION * (1.0 + POISSON) * TEMPERATURE
    hertz = 4.0 * MODULUS * A**3 / (3.0 * R)
    assert exact.force == pytest.approx(hertz + 2.0 / np.pi * thermal * A**2, rel=1e-10)
    centre = exact.pressure(np.array([0.0]))[0]
    assert centre == pytest.approx(2.0 * MODULUS * A / (np.pi * R) + thermal / 4.0, rel=1e-9)
    states = []
    for radius in (None, 5e-2):
        laws = (Insulating(), Insulating(), PERFECT)
        problem = hot_problem(
            STEEL, sphere, A**2 / R, cells, laws, (0.0, 0.0, TEMPERATURE), force=exact.force, reference_radius=radius
        )
        solution = solved(problem)
        states.append(solution.state)
        assert solution.state.load[:, 2].min() == pytest.approx(-centre, rel=0.05 / cells)
        assert totals(problem, solution)[5] == pytest.approx(exact.heat, rel=0.12 / cells)
        area = problem.system.weights @ (solution.state.load[:, 2] < 0.0)
        assert np.sqrt(area / np.pi) == pytest.approx(A, rel=0.2 / cells)
    close(states[1].load, states[0].load, 1e-6)
    # the approach changes by the level alone: y_0 H / (2 pi) ln(R' / R)
    own = np.sqrt(problem.system.weights.sum() / np.pi)
    heat = problem.system.weights @ states[0].load[:, 5]
    change = -DISTORTIVITY * heat / (2.0 * np.pi) * np.log(5e-2 / own)
    assert states[0].motion[0] - states[1].motion[0] == pytest.approx(change, rel=1e-5)


def second_half_space(material: Material, problem: ContactProblem, reference_radius: float) -> ContactProblem:
    """Return the problem with a second body of a material on the same grid."""
    n = round(np.sqrt(len(problem.gap))) - 1
    mesh = half_space_mesh(0.1, float(np.ptp(problem.system.points[:, 0])), (n, n), 1, Quad4())
    body = Body.of(material, mesh, (), "contact")
    other = HalfSpace(reference_radius=reference_radius, matrix_up_to=0).reduce(body)
    return replace(problem, system=combine_bodies(problem.system, other))


def test_heat_between_two_spheres() -> None:
    """Equal bodies are not distorted by heat and have the resistance 1 / (2 a k); others bulge by the difference."""
    aluminium = Material.isotropic(7e10, 0.33).with_heat(200.0, 2.3e-5)
    for material, young, poisson, conductivity, expansion in (
        (STEEL, YOUNG, POISSON, CONDUCTIVITY, EXPANSION),
        (aluminium, 7e10, 0.33, 200.0, 2.3e-5),
    ):
        modulus = 1.0 / (1.0 / MODULUS + (1.0 - poisson**2) / young)
        kappa = 1.0 / (1.0 / CONDUCTIVITY + 1.0 / conductivity)
        difference = DISTORTIVITY - expansion * (1.0 + poisson) / conductivity
        force = 4.0 * modulus * A**3 / (3.0 * R) + 2.0 / np.pi * modulus * difference * kappa * TEMPERATURE * A**2
        laws = (Insulating(), Insulating(), PERFECT)
        alone = hot_problem(STEEL, sphere, A**2 / R, 20, laws, (0.0, 0.0, TEMPERATURE), force=force)
        problem = second_half_space(material, alone, REFERENCE_RADIUS)
        solution = solved(problem)
        assert -totals(problem, solution)[5] == pytest.approx(4.0 * A * kappa * TEMPERATURE, rel=6e-3)
        centre = 2.0 * modulus * A / (np.pi * R) + modulus * difference * kappa * TEMPERATURE / 4.0
        assert -solution.state.load[:, 2].min() == pytest.approx(centre, rel=2.5e-3)


def test_hot_flat_punch() -> None:
    """Force and heat of full contact; below the least force the corners separate."""
    least = hot_punch_force(MODULUS, DISTORTIVITY, CONDUCTIVITY, A, TEMPERATURE)
    for approach, full in ((2e-6, True), (-1e-6, False)):
        exact = HotIndentation(*surface(STEEL), FlatPunch(A), A, TEMPERATURE, (None, None), REFERENCE_RADIUS, approach)
        closed = 2.0 * MODULUS * A * approach + 2.0 / np.pi * MODULUS * EXPANSION * (
            1.0 + POISSON
        ) * TEMPERATURE * A**2 * (3.0 - 4.0 * np.log(2.0) + 2.0 * np.log(REFERENCE_RADIUS / A))
        assert exact.force == pytest.approx(closed, rel=1e-12)
        assert (exact.force > least) == full
        problem = hot_problem(STEEL, flat, approach, 24, (Insulating(), Insulating(), PERFECT), (0.0, 0.0, TEMPERATURE))
        solution = solved(problem)
        touching = solution.state.load[:, 2] < 0.0
        under = np.isfinite(problem.gap)
        assert bool((touching == under).all()) == full
        if full:
            assert -totals(problem, solution)[2] == pytest.approx(exact.force, rel=3e-3)
            assert totals(problem, solution)[5] == pytest.approx(exact.heat, rel=5e-3)


@pytest.mark.full
@pytest.mark.parametrize(
    ("material", "potentials"),
    [(STEEL, (None, None)), (COMPOSITE, (2e3, -5.0)), (COMPOSITE, (None, -5.0))],
)
def test_hot_flat_punch_with_resolved_edge(material: Material, potentials: Potentials) -> None:
    """Totals, area and surface under an isotropic and a conducting punch, on 64 cells in the radius."""
    approach = 2e-5
    exact = HotIndentation(*surface(material), FlatPunch(A), A, TEMPERATURE, potentials, REFERENCE_RADIUS, approach)
    zone, step, total = indented(exact, material, meeframe.FlatPunch(A), 64)
    assert total.normal_force == pytest.approx(exact.force, rel=1e-5)
    np.testing.assert_allclose([total.charge, total.magnetic_flux], exact.totals[1:], rtol=1e-4)
    assert total.heat == pytest.approx(exact.heat, rel=3e-5)
    assert np.sqrt(total.contact_area / np.pi) == pytest.approx(A, rel=5e-4)
    r = np.hypot(*zone.points[:, :2].T)
    inside = r < 0.9 * A
    np.testing.assert_allclose(step.potentials[inside, 2], TEMPERATURE, rtol=1e-7)
    computed = np.column_stack([step.displacement[:, 2], step.potentials[:, :2]])[inside]
    close(computed, exact.values(r[inside]).T, 5e-4)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("biot", "share"), [(0.1, 0.072401), (1.0, 0.426680), (10.0, 0.858672), (np.inf, 1.0)])
def test_constriction_resistance(biot: float, share: float) -> None:
    """Heat through a disc in units of 4 a kappa theta, with a uniform conductance under the indenter."""
    laws = (Insulating(), Insulating(), Robin(biot * CONDUCTIVITY / A))
    problem = hot_problem(STEEL, flat, 1e-5, 32, laws, (0.0, 0.0, 1.0))
    heat = -totals(problem, solved(problem))[5]
    assert heat / (4.0 * A * CONDUCTIVITY) == pytest.approx(share, rel=4e-3)


@pytest.mark.full
@pytest.mark.parametrize(
    "law", [StepConductivity(2e5), PowerLaw(2e5, 1e9), Robin(1e5)], ids=["constant", "of pressure", "everywhere"]
)
def test_gradient_solvers_solve_for_heat_first(law: ConductivityLaw) -> None:
    """Solvers that eliminate the fluxes at given tractions reach the solution of Newton's method."""
    laws = (Insulating(), PERFECT, law)
    problem = hot_problem(COMPOSITE, sphere, 1e-5, 8, laws, (0.0, 0.0, TEMPERATURE))
    expected = solved(problem, SemismoothNewton(), 1e-10).state
    for solver in (BarzilaiBorwein(), Uzawa()):
        state = solved(problem, solver, 1e-9).state
        close(state.load, expected.load, 1e-5)


FRICTION = 1e-4
FACTORS = {0.1: 1.177437, 0.3: 1.841996, 0.5: 4.403257}


def heating_operator() -> tuple[Array, Array, Array]:
    """Return nodes and weights of a rule on (0, 1), and the matrix of integral of G(y) ln|(x + y) / (x - y)| dy.

    The singularity is subtracted.
    """
    nodes, weights = np.polynomial.legendre.leggauss(400)
    x, w = (nodes + 1.0) / 2.0, weights / 2.0
    same = np.eye(len(x), dtype=bool)
    kernel = np.where(same, 0.0, np.log((x[:, None] + x) / np.where(same, 1.0, np.abs(x[:, None] - x))))
    whole = (1.0 + x) * np.log(1.0 + x) - (1.0 - x) * np.log(1.0 - x) - 2.0 * x * np.log(x)
    return x, w, kernel * w + np.diag(whole - kernel @ w)


def sliding_sphere(heating: float) -> tuple[float, float, float]:
    """Return force, central pressure and approach of a sliding sphere in units of Hertz's, by the integral equation.

    G(x) = 2 x + heating integral of G(y) ln|(x + y) / (x - y)| dy. The approach is the depth to which pressure moves
    the centre, less the bulge by heat there, whose level belongs to REFERENCE_RADIUS.
    """
    x, w, operator = heating_operator()
    g = np.linalg.solve(np.eye(len(x)) - heating * operator, 2.0 * x)
    bulge = 2.0 * heating * w @ (x * g * (1.0 - np.log(2.0 * x * A / REFERENCE_RADIUS)))
    return float(1.5 * w @ (x * g)), float(0.5 * w @ (g / x)), float(w @ g - bulge)


def test_critical_frictional_heat() -> None:
    """Beyond the inverse of the largest eigenvalue of the integral equation there is no solution."""
    assert 1.0 / np.abs(np.linalg.eigvals(heating_operator()[2])).max() == pytest.approx(CRITICAL, rel=1e-8)


def edge_radius(problem: ContactProblem, solution: ContactSolution) -> float:
    """Return the radius of the area inside the contact edge between the nodes."""
    resolution = problem.system.capability(EdgeResolution)
    assert resolution is not None
    fraction = resolution.edge_correction(np.maximum(-solution.state.load[:, 2], 0.0)).area_fraction
    return float(np.sqrt(problem.system.weights @ fraction / np.pi))


@pytest.mark.parametrize(
    ("heating", "cells", "by_force"),
    [
        (0.3, 20, False),
        (0.635, 20, True),
        *(
            pytest.param(*each, marks=pytest.mark.full)
            for each in ((0.1, 64, True), (0.1, 64, False), (0.3, 20, True), (0.5, 20, True), (0.5, 20, False))
        ),
    ],
)
def test_frictional_heating_of_a_sliding_sphere(heating: float, cells: int, by_force: bool) -> None:
    """Contact radius, force and central pressure by the integral equation, at its force or approach; all heat enters.

    Friction is weak and sliding fast, so that tangential tractions do not matter. At 0.635, so near the critical value,
    the force is 168 times that of Hertz, and the approach so negative that separation is a solution, too.
    """
    factor, central, depth = sliding_sphere(heating)
    assert factor == pytest.approx(FACTORS.get(heating, factor), rel=1e-5)
    speed = heating * 2.0 * np.pi / (DISTORTIVITY * FRICTION * MODULUS * A)
    hertz = 4.0 * MODULUS * A**3 / (3.0 * R)
    problem = hot_problem(
        STEEL,
        sphere,
        A**2 / R * (1.0 if by_force else depth),
        cells,
        (Insulating(),) * 3,
        (0.0, 0.0, 0.0),
        edges="resolved",  # offers the edge, and corrects nothing where no load is singular
        law=IsotropicCoulomb(FRICTION),
        force=hertz * factor if by_force else None,
        reference_radius=None if by_force else REFERENCE_RADIUS,
        translation=1.0,
        friction_heat=speed,
    )
    solution = solved(problem, tolerance=1e-8)
    result = totals(problem, solution)
    force = -result[2]
    assert force == pytest.approx(hertz * factor, rel=0.15 / cells**2)
    assert result[5] == pytest.approx(-FRICTION * speed * force, rel=1e-6)
    accuracy = 1e-4 if cells == 64 else 1e-3
    assert -solution.state.load[:, 2].min() == pytest.approx(central * 2.0 * MODULUS * A / (np.pi * R), rel=accuracy)
    radius = edge_radius(problem, solution)
    assert radius == pytest.approx(A, rel=2.5e-4)
    # the factor of computed quantities alone
    assert force * 3.0 * R / (4.0 * MODULUS * radius**3) == pytest.approx(factor, rel=1e-3)
    with pytest.raises(CaseError, match="cannot include the heat of friction"):
        Uzawa().check(problem)


def test_frictional_heat_limits_the_contact_radius() -> None:
    """A flat punch with 1.4 times the critical lambda touches the body out to the critical radius alone."""
    heating, cells = 0.9, 20
    problem = hot_problem(
        STEEL,
        flat,
        A**2 / R,
        cells,
        (Insulating(),) * 3,
        (0.0, 0.0, 0.0),
        edges="resolved",
        law=IsotropicCoulomb(FRICTION),
        force=1e3,
        reference_radius=None,
        translation=1.0,
        friction_heat=heating * 2.0 * np.pi / (DISTORTIVITY * FRICTION * MODULUS * A),
    )
    radius = edge_radius(problem, solved(problem, tolerance=1e-8))
    assert radius == pytest.approx(A * CRITICAL / heating, rel=5e-4)


def test_heat_of_friction_is_shared_and_conducted() -> None:
    """At each node heat flux = conductance * drop - share * power of friction up to round-off, in stick and in slip."""
    share, duration = 0.3, 1e-3
    laws = (Insulating(), Insulating(), StepConductivity(2e5))
    problem = hot_problem(
        STEEL,
        sphere,
        A**2 / R,
        16,
        laws,
        (0.0, 0.0, 20.0),
        law=IsotropicCoulomb(0.3),
        translation=3e-6,
        friction_heat=share / duration,
    )
    state = solved(problem, SemismoothNewton(), 1e-13).state
    slip = problem.translation - state.displacement[:, :2]
    power = (state.load[:, :2] * slip).sum(axis=1) / duration
    stuck = (np.hypot(*slip.T) < 1e-12) & (state.load[:, 2] < 0.0)
    slipping = (power > 1e-6 * power.max()) & ~stuck
    assert stuck.sum() > 20
    assert slipping.sum() > 20
    assert power.min() > -1e-6 * power.max()
    drop = -state.displacement[:, 5] - 20.0
    expected = np.where(state.load[:, 2] < 0.0, 2e5 * drop, 0.0) - share * power
    np.testing.assert_allclose(state.load[:, 5], expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    assert share * power.max() > 0.01 * np.abs(expected).max()


CASE = """
formulation = "half-space"
[material]
name = "batio3-cofe2o4"
thermal = true
[mesh]
type = "half-space"
contact_width = "2.4 mm"
divisions = 15
[contact]
law = {name = "isotropic-coulomb", mu = 0.2}
friction_heat = 0.5
[conductivity]
thermal = {name = "power-law", reference_conductivity = "5000 W/m^2/K", reference_pressure = "100 MPa"}
[indenter]
name = "sphere"
radius = "100 mm"
temperature = "100 K"
[[steps]]
normal_force = "1 kN"
[[steps]]
translation = ["1 mm", 0]
duration = "0.1 s"
"""


def test_case_with_heat(load_changed: Any) -> None:
    """Friction reduces the heat that leaves the indenter by conduction and adds its share; names are in the result."""
    result = solve_case(load_changed(CASE))
    still, sliding = result.steps
    assert (still.status, sliding.status) == (Status.CONVERGED, Status.CONVERGED)
    assert resultants(result.zone, still).heat < -0.1
    drop = sliding.potentials[:, 2] - 100.0
    pressure = np.maximum(-sliding.traction[:, 2], 0.0)
    conducted = 5000.0 * (pressure / 1e8) ** 0.95 * drop
    work = (sliding.traction[:, :2] * sliding.slip).sum(axis=1)
    flux = conducted - 0.5 * work / 0.1
    np.testing.assert_allclose(sliding.fluxes[:, 2], flux, rtol=0.0, atol=1e-6 * np.abs(flux).max())


def test_messages_state_frictional_heat_and_reference_radius(load_changed: Any) -> None:
    """lambda = delta share mu V E* a / (2 pi), of the radius of the contact area."""
    steel = (
        'name = "batio3-cofe2o4"\nthermal = true',
        f'name = "isotropic"\nyoung_modulus = {YOUNG}\npoisson_ratio = {POISSON}\n'
        f"thermal_conductivity = {CONDUCTIVITY}\nthermal_expansion = {EXPANSION}",
    )
    radius = ('formulation = "half-space"', 'formulation = {name = "half-space", reference_radius = "2 mm"}')
    given = load_changed(CASE, steel, radius, ("1 mm", "20 mm"))
    assert any("reference_radius = 0.002 m" in text for text in given.warnings)
    result = solve_case(given)
    last = result.steps[-1]
    a = np.sqrt(result.zone.weights @ last.touching / np.pi)
    expected = DISTORTIVITY * 0.5 * 0.2 * 0.2 * MODULUS * a / (2.0 * np.pi)
    (text,) = (part for part in last.message.split("; ") if part.startswith("frictional heat"))
    assert float(text.split("lambda = ")[1].split(",")[0]) == pytest.approx(expected, rel=1e-2)


def test_warns_of_friction_heat_without_duration(load_changed: Any) -> None:
    assert not any("friction_heat" in text for text in load_changed(CASE).warnings)
    still = load_changed(CASE, ('duration = "0.1 s"', ""))
    assert any("friction_heat = 0.5 has no effect: no load step has a duration" in text for text in still.warnings)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([('temperature = "100 K"', 'temperature = "100 degC"')], "indenter.temperature = '100 degC': names a scale"),
        ([('normal_force = "1 kN"', 'approach = "5 um"')], r"steps\[1\]: prescribes approach, whose level"),
        ([("[conductivity]", "[conductivity]\nelectric = 'step'")], "kappa"),
        (
            [("[conductivity]", "[conductivity]\nelectric = {name = 'step', kappa = 1}")],
            r"steps\[1\]: prescribes electric_potential, whose level .* allowed: charge in its place",
        ),
        ([("friction_heat = 0.5", "friction_heat = 2")], r"contact.friction_heat = 2: must be >= 0 and <= 1"),
        (
            [
                ("thermal = true\n", ""),
                ("thermal = {", "electric = {"),
                ("W/m^2/K", "F/m^2"),
                ('temperature = "100 K"', ""),
            ],
            r"contact.friction_heat = 0.5: .*needs a body with a temperature",
        ),
        ([('formulation = "half-space"', 'formulation = "hmatrix-bem"')], "semi-infinite body cannot end"),
        ([('formulation = "half-space"', 'formulation = "dense-bem"')], "semi-infinite body cannot end"),
        (
            [('formulation = "half-space"', 'formulation = {name = "half-space", reference_radius = "-1 m"}')],
            "reference_radius",
        ),
    ],
)
def test_invalid_cases(load_changed: Any, changes: list[tuple[str, str]], message: str) -> None:
    with pytest.raises(CaseError, match=message):
        load_changed(CASE, *changes)


def test_approach_with_reference_radius_or_without_heat(load_changed: Any) -> None:
    radius = ('formulation = "half-space"', 'formulation = {name = "half-space", reference_radius = "2 mm"}')
    assert (
        load_changed(CASE, radius, ('normal_force = "1 kN"', 'approach = "5 um"')).formulation.reference_radius == 2e-3
    )
    load_changed(CASE, ('normal_force = "1 kN"', 'approach = "5 um"\nheat = 0'))


ON_STEEL = [
    (
        'name = "batio3-cofe2o4"\nthermal = true',
        f'name = "isotropic"\nyoung_modulus = {YOUNG}\npoisson_ratio = {POISSON}\n'
        f"thermal_conductivity = {CONDUCTIVITY}\nthermal_expansion = {EXPANSION}",
    ),
    ('law = {name = "isotropic-coulomb", mu = 0.2}\nfriction_heat = 0.5', ""),
    ("divisions = 15", "divisions = 9"),
]
POWER_LAW = '{name = "power-law", reference_conductivity = "5000 W/m^2/K", reference_pressure = "100 MPa"}'
SLIDING = '[[steps]]\ntranslation = ["1 mm", 0]\nduration = "0.1 s"\n'


@pytest.mark.parametrize(
    ("law", "temperature", "partial"),
    [
        ('{name = "step", kappa = inf}', -300.0, True),
        ('{name = "step", kappa = inf}', 300.0, False),
        ('{name = "step", kappa = "1e5 W/m^2/K"}', -300.0, False),
        (POWER_LAW, -300.0, False),
    ],
    ids=["cold and perfect", "hot and perfect", "cold and poor", "cold and rough"],
)
def test_perfect_contact_with_a_cold_indenter_is_reported(
    load_changed: Any, law: str, temperature: float, partial: bool
) -> None:
    """Neither open nor closed next to the contact edge: nodes without pressure and gap conduct in part (Barber)."""
    cold = ('temperature = "100 K"', f"temperature = {temperature}")
    result = solve_case(load_changed(CASE, *ON_STEEL, (POWER_LAW, law), cold, (SLIDING, "")))
    (step,) = result.steps
    assert step.status is Status.CONVERGED
    between = (step.contact_fraction > 0.0) & (step.contact_fraction < 1.0)
    assert between.any() == partial
    assert ("conduct heat in part: neither contact nor separation is possible there" in step.message) == partial
    assert ("neither contact nor separation" in step.message) == partial
    if partial:
        assert f"{between.sum()} nodes with zero pressure and zero gap" in step.message
        assert "next to the edge of contact with a colder indenter" in step.message
        assert np.abs(step.traction[between]).max() == 0.0
        drop = step.potentials[between, 2] - temperature
        assert (drop > 0.0).all()  # a resistance remains in contact that is perfect elsewhere
        assert (step.fluxes[between, 2] > 0.0).all()


@pytest.mark.parametrize("divisions", [9, 11, 14])
def test_perfect_contact_with_a_cold_indenter_is_reported_on_any_grid(load_changed: Any, divisions: int) -> None:
    """The ring that conducts in part is narrower than the spacing of the nodes on some grids."""
    *steel, _ = ON_STEEL
    perfect, cold = (POWER_LAW, '{name = "step", kappa = inf}'), ('temperature = "100 K"', "temperature = -300.0")
    grid = ("divisions = 15", f"divisions = {divisions}")
    (step,) = solve_case(load_changed(CASE, *steel, grid, perfect, cold, (SLIDING, ""))).steps
    assert step.status is Status.CONVERGED
    assert "neither contact nor separation is possible" in step.message


def test_several_solutions_are_reported(load_changed: Any) -> None:
    """A hot sphere above the surface: no contact, or contact with the bulge that its heat causes, if it was closed."""
    perfect, hot = (POWER_LAW, '{name = "step", kappa = inf}'), ('temperature = "100 K"', 'temperature = "200 K"')
    radius = ('formulation = "half-space"', 'formulation = {name = "half-space", reference_radius = "50 mm"}')
    options = *ON_STEEL, perfect, hot, radius
    descent = 'approach = "5 um"\n[[steps]]\napproach = "-0.8 um"\nincrements = 4'
    withdrawn = solve_case(load_changed(CASE, *options, ('normal_force = "1 kN"', descent), (SLIDING, "")))
    first, *_, last = withdrawn.steps
    assert all(step.status is Status.CONVERGED for step in withdrawn.steps)
    assert last.traction[:, 2].min() < -1e9
    assert "several solutions: only the heat or other fluxes through the contact cause it" in last.message
    assert "separation is a solution as well" in last.message
    assert "several solutions" not in first.message
    direct = ('normal_force = "1 kN"', 'approach = "-0.8 um"')
    (approached,) = solve_case(load_changed(CASE, *options, direct, (SLIDING, ""))).steps
    assert approached.status is Status.CONVERGED
    assert not approached.touching.any()
    assert "several solutions" not in approached.message
