"""Conductivity laws agree with closed forms: one node, capacitors, films, limited fields, prescribed potentials."""

import math

import numpy as np
import pytest
from meeframe_laws.conductivity import AcrossGap, Breakdown, Robin, Saturating, Thresholded

from meeframe.contact.channels import flux_channels
from meeframe.contact.conduction import potential_diagonal
from meeframe.contact.problem import ContactProblem, Status
from meeframe.laws import Insulating, Signorini, StepConductivity
from meeframe.material import library_material
from meeframe.model.load import load_case
from meeframe.model.solve import solve_case
from meeframe.solvers import Auto, SemismoothNewton, solve
from meeframe.testing.contact_cases import SphereCase
from meeframe.testing.force_control import TIGHT_CRITERIA
from meeframe.testing.half_space import half_space_system

VOLTAGE, DISTANCE = 3e3, 2e-5
AIR = 8.8541878128e-12
XI = np.array([[2.0e-12, 1.8e-3, 0.0], [1.8e-3, -2.4e7, 0.0], [0.0, 0.0, -1e3]])
"""Point response of a half space over (u3, phi, psi), close to that of BaTiO3-CoFe2O4."""


def solve_problem(problem, solver=None):
    solution = solve(problem, solver or Auto(), TIGHT_CRITERIA)
    assert solution.status is Status.CONVERGED, solution.message
    return solution.state


def plates(
    electric, xi=XI, cells: int = 1, side: float = 1e-3, voltage: float = VOLTAGE, gap=DISTANCE
) -> ContactProblem:
    """Return a problem of a flat punch at a potential above an insulated half space."""
    system = half_space_system(xi, side, cells)
    n = len(system.points)
    potentials = np.tile([voltage, 0.0], (n, 1))
    return ContactProblem(
        system,
        Signorini(),
        flux_channels(electric, Insulating()),
        np.broadcast_to(gap, n).copy(),
        np.zeros((n, 2)),
        potentials,
    )


def one_node(problem):
    """Return flux density, gap and drop at the only node."""
    state = solve_problem(problem)
    gap = problem.gap[0] - state.displacement[0, 2]
    drop = -state.displacement[0, 3] - problem.potentials[0, 0]
    return state.load[0, 3], gap, drop


@pytest.mark.parametrize("residual_gap", [0.0, 5e-6])
@pytest.mark.parametrize("part", [0.2, -0.5])
def test_one_node_across_the_gap(residual_gap, part) -> None:
    """The flux deforms the surface by a fraction of the gap; the potential drives it across the remaining gap."""
    law = AcrossGap(300.0 * AIR, math.inf, residual_gap)
    block = plates(law).system.diagonal_blocks()[0]
    expected = part * DISTANCE / block[2, 3]
    left = (1.0 - part) * DISTANCE
    voltage = -expected * ((left + residual_gap) / law.gap_constant + block[3, 3])
    flux, gap, drop = one_node(plates(law, voltage=voltage))
    assert (flux, gap) == pytest.approx((expected, left), rel=1e-10)
    assert flux == pytest.approx(law.gap_constant / (gap + residual_gap) * drop, rel=1e-10)


@pytest.mark.parametrize("voltage", [50.0, 200.0, -3e3])
def test_breakdown_at_one_node(voltage) -> None:
    """Without deformation v = |V| - c q, with q = eps v / g below E g and an additional k (v - E g) above."""
    field, discharge = 5e6, 2e-6
    flat = np.diag(np.diag(XI))
    problem = plates(Breakdown(AIR, field, discharge), flat, voltage=voltage)
    flux, _, drop = one_node(problem)
    node_compliance = potential_diagonal(problem)[0, 0]
    most, capacitor = field * DISTANCE, AIR / DISTANCE
    expected = abs(voltage) / (1.0 + node_compliance * capacitor)
    if expected > most:
        expected = (abs(voltage) + node_compliance * discharge * most) / (
            1.0 + node_compliance * (capacitor + discharge)
        )
        assert expected > most
    assert drop == pytest.approx(-math.copysign(expected, voltage), rel=1e-10)
    expected = math.copysign(capacitor * expected + discharge * max(expected - most, 0.0), drop)
    assert flux == pytest.approx(expected, rel=1e-10)
    assert np.sign(drop) == np.sign(flux)


def test_lifted_punch_is_a_plate_capacitor() -> None:
    """Above a nearly perfect conductor, Q = eps A V / g; the deviation is proportional to the
    compliance of the body."""
    cells, side = 9, 1e-3
    charges = []
    for part in (1e-2, 1e-4):
        problem = plates(AcrossGap(AIR), part * np.diag(np.diag(XI)), cells, side)
        # a round punch: there is no indenter above the corners
        beside = np.hypot(*problem.system.points[:, :2].T) > 0.5 * side
        problem.gap[beside] = np.inf
        state = solve_problem(problem)
        assert not state.load[beside].any()
        charges.append(problem.system.weights @ state.load[:, 3])
    area = problem.system.weights[~beside].sum()
    capacitor = -AIR * area * VOLTAGE / DISTANCE
    assert charges[1] == pytest.approx(capacitor, rel=1e-5)
    assert abs(charges[0] / capacitor - 1.0) == pytest.approx(1e2 * abs(charges[1] / capacitor - 1.0), rel=1e-2)


def test_flat_gap_over_a_half_space() -> None:
    """The fluxes solve (C + (g + r) / eps) q = -V on all cells, for gaps that vary from cell to cell."""
    residual_gap, cells = 4e-6, 8
    gap = DISTANCE * np.random.default_rng(2).uniform(0.2, 2.0, cells**2)
    problem = plates(AcrossGap(AIR, 1.0, residual_gap), np.diag(np.diag(XI)), cells, gap=gap)
    compliance = problem.system.matrix[:, 3, :, 3]
    expected = np.linalg.solve(compliance + np.diag((gap + residual_gap) / AIR), np.full(cells**2, -VOLTAGE))
    np.testing.assert_allclose(solve_problem(problem).load[:, 3], expected, rtol=1e-9)


def test_discharge_limits_the_field_in_the_gap() -> None:
    """Discharge never increases the field; the excess over the limit is inversely proportional to the conductivity."""
    field, residual_gap = 3e6, 1e-6
    medium = library_material("batio3-cofe2o4")
    insulating = Insulating()

    def sphere(law):
        return SphereCase(medium, Signorini(), law, insulating, 10, 0.0, potentials=(1e4, 0.0)).problem()

    def fields(law):
        """Return field, gap and flux (n,) at open nodes."""
        problem = sphere(law)
        state = solve_problem(problem, SemismoothNewton())
        gap = problem.gap - state.displacement[:, 2] + residual_gap
        drop = -state.displacement[:, 3] - problem.potentials[:, 0]
        return np.where(state.load[:, 2] == 0.0, np.abs(drop) / gap, 0.0), gap, np.abs(state.load[:, 3])

    node_compliance = potential_diagonal(sphere(insulating))[0, 0]
    capacitor = fields(AcrossGap(AIR, 1.0, residual_gap))[0]
    np.testing.assert_array_equal(fields(Breakdown(AIR, field, 0.0, 1.0, residual_gap))[0], capacitor)
    highest, most = [], capacitor
    for kappa in np.array([1e-2, 1.0, 10.0, 100.0]) / node_compliance:
        computed, gap, flux = fields(Breakdown(AIR, field, kappa, 1.0, residual_gap))
        excess = np.maximum(computed - field, 0.0)
        separated = computed > 0.0
        np.testing.assert_allclose(
            flux[separated], (AIR * computed + kappa * excess * gap)[separated], atol=1e-9 * flux.max()
        )
        assert (computed <= most * (1.0 + 1e-9)).all()
        highest.append(excess.max())
        most = computed
    assert 0.0 < highest[-1] < 0.1 * field
    assert capacitor.max() > 10.0 * field
    assert highest[-2] / highest[-1] == pytest.approx(10.0, rel=0.25)


def sphere(electric, magnetic=None):
    """Return a problem of a sphere at 20 kV and -15 A on an orthotropic medium."""
    medium = library_material("orthotropic-mee")
    laws = (electric, magnetic or Insulating())
    return SphereCase(medium, Signorini(), *laws, 10, 0.0, potentials=(2e4, -15.0)).problem()


def test_robin_prescribes_potentials_on_the_zone() -> None:
    """The potentials at all nodes tend to those of the indenter for large kappa, with an error of 1 / kappa."""
    perfect = solve_problem(sphere(Robin(math.inf), Robin(math.inf)))
    np.testing.assert_allclose(-perfect.displacement[:, 3], 2e4, rtol=1e-9)
    np.testing.assert_allclose(-perfect.displacement[:, 4], -15.0, rtol=1e-9)
    assert (perfect.load[:, 2] == 0.0).any()
    node_compliance = potential_diagonal(sphere(Insulating()))[0, 0]
    errors = [
        np.abs(solve_problem(sphere(Robin(k / node_compliance))).displacement[:, 3] + 2e4).max() for k in (1e3, 1e4)
    ]
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)


def test_charge_grows_with_the_permittivity_of_the_gap() -> None:
    """The charge grows from that of the contact alone to that of a prescribed potential on the whole zone."""
    node_compliance = potential_diagonal(sphere(Insulating()))[0, 0]
    weights = sphere(Insulating()).system.weights
    laws = [
        StepConductivity(math.inf),
        *(AcrossGap(k * 1e-6 / node_compliance) for k in (1e-3, 1e-1, 1e1, 1e3)),
        Robin(math.inf),
    ]
    charges = np.array([abs(weights @ solve_problem(sphere(law)).load[:, 3]) for law in laws])
    assert (np.diff(charges) > 0.0).all()
    assert charges[1] == pytest.approx(charges[0], rel=0.02)
    assert charges[-2] == pytest.approx(charges[-1], rel=0.02)


def test_film_between_threshold_and_ramp() -> None:
    node_compliance = potential_diagonal(sphere(Insulating()))[0, 0]
    threshold, ramp, kappa = 2e7, 5e6, 2.0 / node_compliance
    problem = sphere(Thresholded(kappa, threshold, ramp))
    state = solve_problem(problem)
    pressure, flux = -state.load[:, 2], state.load[:, 3]
    drop = -state.displacement[:, 3] - problem.potentials[:, 0]
    whole, broken = pressure <= threshold, pressure >= threshold + ramp
    assert (whole & (pressure > 0.0)).any()
    assert broken.any()
    assert np.abs(flux[whole]).max() <= 1e-10 * np.abs(flux).max()
    np.testing.assert_allclose(flux[broken], kappa * drop[broken], rtol=1e-9)


def test_saturation_matches_coverage_by_random_spots() -> None:
    """Randomly placed discs of a given total area cover the fraction 1 - exp(-total) of a surface."""
    random = np.random.default_rng(5)
    points = random.uniform(size=(20_000, 2))
    radius, total = 0.02, 0.7
    count = round(total / (math.pi * radius**2))
    spots = random.uniform(-0.1, 1.1, (round(count * 1.44), 2))
    area_fraction = np.zeros(len(points), bool)
    for spot in spots:
        area_fraction |= np.hypot(*(points - spot).T) < radius
    kappa = Saturating(1.0, 1.0).conductivity(np.array([-total]), np.zeros(1), np.zeros(1))[0]
    assert area_fraction.mean() == pytest.approx(kappa, abs=0.02)


WITHDRAWN = """
material = { name = "batio3-cofe2o4" }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 8 }
formulation = { name = "half-space" }
indenter = { name = "sphere", radius = "100 mm" }
conductivity = { electric = { name = "across-gap", gap_constant = 1e-10, residual_gap = 1e-8 } }
output = { figures = false, vtu = false }
steps = [{ approach = 1e-5 }, { approach = -1e-6, increments = 2 }]
"""


def test_withdrawal_leaves_no_flux(tmp_path) -> None:
    file = tmp_path / "case.toml"
    file.write_text(WITHDRAWN, encoding="utf-8")
    pressed, *_, withdrawn = solve_case(load_case(file)).steps
    assert np.abs(pressed.fluxes).max() > 0.0
    assert not withdrawn.touching.any()
    assert not withdrawn.fluxes.any()
    assert not withdrawn.potentials.any()
