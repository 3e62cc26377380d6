"""Uzawa's method on an exact half space agrees with the closed forms of docs/explanation/theory.md."""

import numpy as np
import pytest

from meeframe.contact.problem import ContactProblem, ContactSolution, Status, resultant
from meeframe.fields import Array
from meeframe.laws import Signorini
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.solvers import Uzawa, solve
from meeframe.testing.closed_forms import CONDITIONS, Cone, FlatPunch, Indentation, Shape, Sphere, indent
from meeframe.testing.half_space import half_space_system, indentation_problem, inverse_distance_integral

XI = axisymmetric_compliance(library_material("batio3-cofe2o4").stiffness)
RADIUS, APPROACH, SIDE = 0.1, 5e-5, 5e-3
NO_FIELD = (None, None)


def height(shape: Shape, r: Array) -> Array:
    match shape:
        case Sphere(radius):
            return r**2 / (2.0 * radius)
        case Cone(angle):
            return r * np.tan(angle)
        case FlatPunch(radius):
            return np.where(r < radius, 0.0, np.inf)
    raise AssertionError(shape)


def problem(
    cells: int,
    fields: tuple[float | None, float | None] = NO_FIELD,
    shape: Shape | None = None,
    kappa: tuple[float, float] | None = None,
    side: float = SIDE,
) -> ContactProblem:
    """Return an indentation problem with prescribed potentials; None insulates. `kappa` replaces inf where there is
    a potential."""
    system = half_space_system(XI, side, cells)
    r = np.hypot(system.points[:, 0], system.points[:, 1])
    perfect = tuple(0.0 if value is None else np.inf for value in fields)
    potentials = tuple(value or 0.0 for value in fields)
    return indentation_problem(
        system, height(shape or Sphere(RADIUS), r), APPROACH, Signorini(), kappa or perfect, potentials
    )


def solve_problem(case: ContactProblem) -> ContactSolution:
    solution = solve(case, Uzawa())
    assert solution.status is Status.CONVERGED, solution.message
    return solution


def totals(case: ContactProblem, solution: ContactSolution) -> tuple[float, float, float]:
    force, (charge, flux) = resultant(case.system, solution.state.load)
    return -float(force[2]), charge, flux


def test_cell_integral_against_quadrature() -> None:
    half, x, y = 0.5, np.array([0.0, 0.3, 0.5, 1.7]), np.array([0.0, -0.2, 0.5, 0.4])
    # the midpoint rule on 2000^2 points, whose error is about the size of the singular cell
    grid = (np.arange(2000) + 0.5) / 2000 - half
    points = np.meshgrid(grid, grid)
    sums = [np.sum(1.0 / np.hypot(a - points[0], b - points[1])) / 2000**2 for a, b in zip(x, y, strict=True)]
    assert inverse_distance_integral(x, y, half) == pytest.approx(np.array(sums), rel=1e-3)
    assert inverse_distance_integral(np.zeros(1), np.zeros(1), half)[0] == pytest.approx(4.0 * np.arcsinh(1.0))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("condition", list(CONDITIONS))
def test_sphere_under_the_four_conditions(condition: str) -> None:
    fields = CONDITIONS[condition]
    case = problem(24, fields)
    solution = solve_problem(case)
    exact = indent(XI, Sphere(RADIUS), APPROACH, *fields)
    force, charge, flux = totals(case, solution)
    assert force == pytest.approx(exact.force, rel=1.5e-3)
    assert charge == pytest.approx(exact.charge, rel=1.5e-3, abs=0.0)
    assert flux == pytest.approx(exact.magnetic_flux, rel=1.5e-3, abs=0.0)
    check_distributions(case, solution, exact)


def check_distributions(case: ContactProblem, solution: ContactSolution, exact: Indentation) -> None:
    r = np.hypot(case.system.points[:, 0], case.system.points[:, 1])
    inside = r < 0.9 * exact.contact_radius
    pressure = -solution.state.load[inside, 2]
    assert np.abs(pressure - exact.pressure(r[inside])).max() < 0.01 * exact.pressure(np.zeros(1))[0]
    for column, values in ((3, exact.electric_potential(r)), (4, exact.magnetic_potential(r))):
        error = np.abs(-solution.state.displacement[:, column] - values).max()
        insulated = abs(XI[0, column - 2] / XI[0, 0]) * APPROACH  # where it conducts, the potential is zero
        assert error < 0.01 * insulated


def test_insulated_fields_follow_the_surface_and_conducting_flux_the_pressure() -> None:
    """This is exact for the discrete problem, too, because all fields have the same kernel 1/r."""
    state = solve_problem(problem(12)).state
    for column, j in ((3, 1), (4, 2)):
        expected = -(XI[0, j] / XI[0, 0]) * state.displacement[:, 2]
        assert state.displacement[:, column] == pytest.approx(expected, rel=1e-12)
    case = problem(12, (0.0, None))
    solution = solve_problem(case)
    force, charge, flux = totals(case, solution)
    scale = np.abs(solution.state.load[:, 3]).max()
    assert solution.state.load[:, 3] == pytest.approx(
        -XI[0, 1] / XI[1, 1] * solution.state.load[:, 2], abs=1e-9 * scale
    )
    assert charge == pytest.approx(XI[0, 1] / XI[1, 1] * force, rel=1e-9)
    assert flux == 0.0


@pytest.mark.full
@pytest.mark.parametrize("fields", [(2e4, None), (None, -20.0), (-1.5e4, 30.0)])
def test_prescribed_potentials(fields: tuple[float | None, float | None]) -> None:
    """Fluxes are singular at the edge, which a grid resolves to first order only."""
    case = problem(24, fields)
    solution = solve_problem(case)
    exact = indent(XI, Sphere(RADIUS), APPROACH, *fields)
    force, charge, flux = totals(case, solution)
    assert force == pytest.approx(exact.force, rel=2e-3)
    for computed, expected, held in ((charge, exact.charge, fields[0]), (flux, exact.magnetic_flux, fields[1])):
        assert computed == pytest.approx(expected, rel=0.03) if held is not None else computed == 0.0


@pytest.mark.full
def test_cone() -> None:
    exact = indent(XI, Cone(0.02), APPROACH, 0.0, 0.0)
    case = problem(28, (0.0, 0.0), Cone(0.02), side=2.4 * exact.contact_radius)
    assert totals(case, solve_problem(case))[0] == pytest.approx(exact.force, rel=5e-3)


@pytest.mark.full
def test_flat_punch_converges_at_first_order() -> None:
    """The pressure is singular at the edge. The number of cells in a circle scatters more than the force converges,
    so the exact force is that of a circle with the area of the cells."""
    errors = []
    for group in ((9, 10, 11, 12), (21, 22, 23, 24)):
        for cells in group:
            case = problem(cells, shape=FlatPunch(2e-3), side=4.2e-3)
            area = case.system.weights[np.isfinite(case.gap)].sum()
            exact = indent(XI, FlatPunch(float(np.sqrt(area / np.pi))), APPROACH)
            errors.append(totals(case, solve_problem(case))[0] / exact.force - 1.0)
    coarse, fine = np.abs(errors[:4]).mean(), np.abs(errors[4:]).mean()
    assert np.log(coarse / fine) / np.log(22.5 / 10.5) > 1.0 - 0.3
    assert fine < 0.012


@pytest.mark.full
def test_sphere_converges_at_least_at_first_order() -> None:
    exact = indent(XI, Sphere(RADIUS), APPROACH).force
    groups = ((6, 7, 8, 9, 10), (18, 21, 24, 27, 30))
    errors = [[totals(case := problem(n), solve_problem(case))[0] / exact - 1.0 for n in group] for group in groups]
    coarse, fine = (np.sqrt(np.mean(np.square(group))) for group in errors)
    assert np.log(coarse / fine) / np.log(3.0) > 1.0 - 0.3
    assert fine < 2e-3


@pytest.mark.full
@pytest.mark.parametrize("field", [0, 1])
def test_force_and_flux_are_monotone_in_conductivity(field: int) -> None:
    """docs/explanation/theory.md, Contact: q = +kappa (phi - phi_o) with outward normal."""
    characteristic = 1.0 / (abs(XI[field + 1, field + 1]) * np.sqrt(RADIUS * APPROACH))

    def at(kappa: float) -> tuple[float, float]:
        pair = (kappa, 0.0) if field == 0 else (0.0, kappa)
        case = problem(12, kappa=pair)
        force, *fluxes = totals(case, solve_problem(case))
        return force, fluxes[field]

    sweep = np.array([at(factor * characteristic) for factor in np.logspace(-3, 3, 7)])
    insulated, perfect, large = at(0.0), at(np.inf), at(1e8 * characteristic)
    forces, fluxes = np.vstack([insulated, sweep, perfect]).T
    assert (np.diff(forces) < 0.0).all()
    assert (np.diff(fluxes) < 0.0).all()
    assert large == pytest.approx(perfect, rel=1e-6)
    assert at(1e-9 * characteristic)[0] == pytest.approx(insulated[0], rel=1e-6)
    exact = indent(XI, Sphere(RADIUS), APPROACH, *((0.0, None) if field == 0 else (None, 0.0)))
    assert perfect[0] == pytest.approx(exact.force, rel=5e-3)


def test_zero_conductivity_is_bitwise_insulation() -> None:
    zero, insulated = solve(problem(10, kappa=(0.0, 0.0)), Uzawa()), solve(problem(10), Uzawa())
    assert np.array_equal(zero.state.load, insulated.state.load)
    assert not insulated.state.load[:, 3:].any()
