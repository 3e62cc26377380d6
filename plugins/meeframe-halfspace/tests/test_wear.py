"""Wear of half spaces on grids, against closed forms of running-in, wear scars and fretting."""

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from scipy.linalg import expm

import meeframe
from meeframe.fields import Array
from meeframe.model.solve import reduce
from meeframe.results.records import Region, StepResult, Zone
from meeframe.testing.closed_forms_wear import flat_punch_decay, fretting_force, scar_radius

YOUNG, POISSON, COEFFICIENT, FORCE = 200e9, 0.3, 1e-13, 100.0
MODULUS = YOUNG / (1.0 - POISSON**2)
RADIUS = 1e-3
"""Radius of the flat punch [m]."""


def case(indenter: object, steps: list[meeframe.Step], width: float, cells: int, **changes: object) -> meeframe.Case:
    """Return a case of an elastic half space on a square grid."""
    arguments = {
        "material": {"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": POISSON},
        "contact": meeframe.Contact(wear=meeframe.Archard(COEFFICIENT)),
        "formulation": HalfSpace(),
        **changes,
    }
    return meeframe.Case(
        mesh=meeframe.mesh.half_space(width, divisions=cells), indenter=indenter, steps=steps, **arguments
    )


def solved(*arguments: object, **changes: object) -> meeframe.Result:
    result = case(*arguments, **changes).solve()
    assert str(result.status) == "converged"
    return result


def punch(cells: int, increment: float, increments: int) -> meeframe.Case:
    """Return a flat punch under a held force; increment: in lengths of slip of the slowest decay."""
    length = 1.0 / flat_punch_decay(COEFFICIENT, MODULUS, RADIUS)
    steps = [
        meeframe.Step(normal_force=FORCE, sliding=0.0),
        meeframe.Step(sliding=increment * length * increments, increments=increments),
    ]
    return case(meeframe.FlatPunch(RADIUS), steps, 2.0 * RADIUS * cells / (cells - 2), cells)


def excess(zone: Zone, step: StepResult) -> Array:
    """Return the pressure (n,) [Pa] above its mean in the contact."""
    pressure = -step.traction[:, 2]
    return np.where(pressure > 0.0, pressure - FORCE / zone.weights[pressure > 0.0].sum(), 0.0)


def test_flat_punch_runs_in_to_uniform_pressure():
    """The slowest mode decays by 1 + lambda ds in each increment; V = k P s; the approach grows by k P / A."""
    result = punch(32, 0.5, 18).solve()
    zone, (*_, before, last) = result.zone, result.steps
    excesses = [np.sqrt(zone.weights @ excess(zone, step) ** 2) for step in (before, last)]
    assert np.log(excesses[0] / excesses[1]) == pytest.approx(np.log(1.5), rel=5e-3)
    assert np.abs(excess(zone, last)).max() < 2e-3 * FORCE / (np.pi * RADIUS**2)
    slip = 9.0 / flat_punch_decay(COEFFICIENT, MODULUS, RADIUS)
    totals = meeframe.resultants(zone, last)
    assert totals.worn_volume == pytest.approx(COEFFICIENT * FORCE * slip, rel=1e-8)
    assert totals.normal_force == pytest.approx(FORCE, rel=1e-8)
    rate = (last.loading.approach - before.loading.approach) / (slip / 18)
    assert rate == pytest.approx(COEFFICIENT * FORCE / totals.contact_area, rel=1e-3)


@pytest.mark.full
def test_running_in_on_the_nodes_is_of_first_order():
    """Nodes in contact obey d(C p)/ds = -k p + const with the force held, a system of equations that expm solves."""
    errors, slip = [], 1.0 / flat_punch_decay(COEFFICIENT, MODULUS, RADIUS)
    system = reduce(punch(11, 1.0, 1).checked)
    compliance = system.dense()[:, 2, :, 2]
    for increments in (8, 16, 32):
        result = punch(11, 1.0 / increments, increments).solve()
        pressures = [-step.traction[:, 2] for step in (result.steps[0], result.steps[-1])]
        touching = pressures[0] > 0.0
        n, weights = touching.sum(), result.zone.weights[touching]
        held = np.zeros((n + 1, n + 1))
        held[:n, :n], held[:n, n], held[n, :n] = compliance[np.ix_(touching, touching)], -1.0, weights
        inverse = np.linalg.inv(held)[:n, :n]
        exact = expm(-COEFFICIENT * slip * inverse) @ pressures[0][touching]
        errors.append(np.abs(pressures[1][touching] - exact).max() / exact.mean())
    assert errors[-1] < 0.02
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 1.0, atol=0.15)


def test_spinning_disc_runs_in_to_pressure_over_radius():
    """Uniform wear needs p r = P / (2 pi a) at all radii; the mean of p r on the grid differs by the centre."""
    length = 1.0 / flat_punch_decay(1e-9, MODULUS, RADIUS)
    turn = 40.0 * length / RADIUS
    steps = [meeframe.Step(normal_force=FORCE, sliding=0.0), meeframe.Step(twist=turn, increments=8)]
    wears = meeframe.Contact(wear=meeframe.Archard(1e-9))
    result = solved(meeframe.FlatPunch(RADIUS), steps, 2.0 * RADIUS * 23 / 21, 23, contact=wears)
    zone, step = result.zone, result.steps[-1]
    pressure, radius = -step.traction[:, 2], np.hypot(*zone.points.T[:2])
    inside = pressure > 0.0
    product = (pressure * radius)[inside]
    assert np.ptp(product) < 0.01 * product.mean()
    assert product.mean() == pytest.approx(FORCE / (zone.weights[inside] @ (1.0 / radius[inside])), rel=2e-3)
    assert product.mean() == pytest.approx(FORCE / (2.0 * np.pi * RADIUS), rel=0.05)


def test_deep_wear_scar_of_a_sphere():
    """A scar much deeper than the elastic approach has a^4 = 4 k P R s / pi and a nearly uniform pressure."""
    radius, force = 10e-3, 10.0
    hertz = (3.0 * force * radius / (4.0 * MODULUS)) ** (1 / 3)
    scar = np.sqrt(20.0) * hertz  # worn by ten times the elastic approach
    slip = np.pi * scar**4 / (4.0 * COEFFICIENT * force * radius)
    assert scar_radius(COEFFICIENT, force, radius, slip) == pytest.approx(scar)
    steps = [meeframe.Step(normal_force=force, sliding=0.0)]
    steps += [
        meeframe.Step(sliding=slip * share, increments=2)
        for share in (1 / 64, 1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2)
    ]
    result = solved(meeframe.Sphere(radius), steps, 2.4 * scar, 40)
    totals = meeframe.resultants(result.zone, result.steps[-1])
    assert totals.worn_volume == pytest.approx(COEFFICIENT * force * slip, rel=1e-8)
    assert totals.contact_area == pytest.approx(np.pi * scar**2, rel=0.02)
    assert result.steps[-1].wear.max() == pytest.approx(scar**2 / (2.0 * radius), rel=0.02)
    inside = np.hypot(*result.zone.points.T[:2]) < 0.8 * scar
    pressure = -result.steps[-1].traction[inside, 2] * np.pi * scar**2 / force
    np.testing.assert_allclose(pressure, 1.0, atol=0.1)


@pytest.mark.full
def test_fretting_of_two_bodies_ends_with_pressure_on_the_stick_zone_alone():
    """The slip annulus wears until it bears nothing; the stick zone keeps mu E* (g - f(c)) = G* u0 (Popov 2014)."""
    radius, depth, mu, stick = 10e-3, 1e-6, 0.3, 0.7
    a = np.sqrt(radius * depth)
    motion = mu * depth * (1.0 - stick**2)  # E* = G* for equal bodies without Poisson effect, uncoupled
    modulus = YOUNG / 2.0
    coefficient = 2.0 * depth / (2.0 * motion * 2.0 * modulus / np.pi * np.sqrt(depth / radius))
    steps = [meeframe.Step(approach=depth, sliding=0.0)]
    steps += [meeframe.Step(translation=[sign * motion, 0.0], increments=2) for sign in (1, -1) * 2]
    material = {"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": 0.0}
    mesh = meeframe.mesh.half_space(2.6 * a, divisions=24)
    result = solved(
        meeframe.Sphere(radius),
        steps,
        2.6 * a,
        24,
        material=material,
        contact=meeframe.Contact(meeframe.IsotropicCoulomb(mu), wear=meeframe.Archard(coefficient)),
        second_body=meeframe.SecondBody(material, mesh, formulation=HalfSpace()),
    )
    zone, step = result.zone, result.steps[-1]
    sticks = step.region == Region.STICK
    assert np.sqrt(zone.weights @ sticks / np.pi) == pytest.approx(stick * a, abs=0.5 * 2.6 * a / 24)
    assert step.wear[sticks].max() < 1e-6 * depth
    first, force = (meeframe.resultants(zone, each).normal_force for each in (result.steps[0], step))
    limit = fretting_force(modulus, radius, depth, stick * a)
    assert force == pytest.approx(limit, rel=0.04)
    assert zone.weights[sticks] @ -step.traction[sticks, 2] > 0.98 * force
    assert first == pytest.approx(4.0 / 3.0 * modulus * depth * a, rel=0.01)


def test_solvers_agree_and_conduction_goes_along():
    """Gradient iterations find the worn surface of Newton's method; charge flows where worn surfaces touch."""
    conducting = {"electric": meeframe.StepConductivity(1e-3)}
    steps = [meeframe.Step(normal_force=FORCE), meeframe.Step(translation=[0.1, 0.0], increments=2)]
    friction = meeframe.Contact(meeframe.IsotropicCoulomb(0.2), wear=meeframe.Archard(COEFFICIENT))
    results = [
        solved(
            meeframe.Sphere(10e-3),
            steps,
            1.2e-3,
            11,
            material="batio3-cofe2o4",
            contact=friction,
            conductivity=conducting,
            potentials={"electric_potential": 10.0},
            solver=solver,
        )
        for solver in (meeframe.SemismoothNewton(), meeframe.Nesterov())
    ]
    for name in ("traction", "wear", "fluxes"):
        ours, theirs = (getattr(result.steps[-1], name) for result in results)
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-7 * np.abs(ours).max())
    totals = [meeframe.resultants(results[0].zone, step) for step in results[0].steps]
    assert totals[2].worn_volume == pytest.approx(COEFFICIENT * FORCE * 0.1, rel=1e-4), "slip less elastic motion"
    assert totals[2].tangential_force[0] == pytest.approx(0.2 * FORCE, rel=1e-6)
    assert totals[2].contact_area > 2.0 * totals[0].contact_area
    step = results[0].steps[-1]
    flux = np.where(step.touching, 1e-3 * (step.potentials[:, 0] - 10.0), 0.0)
    np.testing.assert_allclose(step.fluxes[:, 0], flux, rtol=0.0, atol=1e-8 * np.abs(flux).max())
