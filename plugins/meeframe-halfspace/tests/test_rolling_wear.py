"""Wear of surfaces that roll and slide through the contact, against closed forms and balances."""

from itertools import pairwise

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

import meeframe
from meeframe.common.errors import CaseError

YOUNG, POISSON = 200e9, 0.3
MODULUS = YOUNG / (1.0 - POISSON**2)
RADIUS, FORCE, COEFFICIENT = 10e-3, 10.0, 1e-13
"""Radius [m] and force [N] of the sphere; wear coefficient over hardness [1/Pa]."""
HERTZ = (3.0 * FORCE * RADIUS / (4.0 * MODULUS)) ** (1.0 / 3.0)
MATERIAL = {"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": POISSON}
PRESS = meeframe.Step(normal_force=FORCE, sliding=0.0)
FILES = meeframe.Output(figures=False, vtu=False)


def case(steps, width, cells, mu=0.2, coefficient=COEFFICIENT, indenter=None, **arguments):
    """Return the case of a sphere on a half space that rolls along x."""
    wear = None if coefficient is None else meeframe.Archard(coefficient)
    return meeframe.Case(
        **{"material": MATERIAL, "formulation": HalfSpace(matrix_up_to=0), **arguments},
        mesh=meeframe.mesh.half_space(width, divisions=cells),
        indenter=indenter or meeframe.Sphere(RADIUS),
        contact=meeframe.Contact(meeframe.IsotropicCoulomb(mu), wear=wear),
        steps=steps,
    )


def solved(*arguments, **changes):
    result = case(*arguments, **changes).solve(progress=False)
    assert result.status == "converged", [step.message for step in result]
    return result


def lines(zone, values):
    """Return the positions y (ny,) and values (nx, ny) of a field on lines along x."""
    shape = zone.cells.shape
    order = np.lexsort((zone.points[:, 1].round(12), zone.points[:, 0].round(12)))
    return zone.points[order[: shape[1]], 1], np.asarray(values)[order].reshape(shape)


@pytest.mark.full
def test_groove_of_a_slider():
    """A slider wears k times the integral of the pressure along its way, which is that of Hertz on each line.

    The depth of every passage moves with the material and is conserved: what leaves the zone and what stays is what
    has worn off.
    """
    cells, width = 24, 3.0 * HERTZ
    spacing = width / cells
    slide = meeframe.Step(rolling={"distance": 2.6 * HERTZ, "creepage": [1.0, 0.0]})
    result = solved([PRESS, slide], width, cells, mu=0.01)
    zone, left, worn = result.zone, 0.0, 0.0
    areas = zone.weights.max()
    for before, step in pairwise(result):
        left += areas * lines(zone, before.wear)[1][0].sum()
        worn += areas * COEFFICIENT * float(-step.traction[:, 2] @ np.linalg.norm(step.slip, axis=1))
    y, wear = lines(zone, result[-1].wear)
    assert left + areas * wear.sum() == pytest.approx(worn, rel=1e-9)
    peak = 1.5 * FORCE / (np.pi * HERTZ**2)
    exact = COEFFICIENT * peak * np.pi / (2.0 * HERTZ) * np.maximum(HERTZ**2 - y**2, 0.0)
    assert wear[2] == pytest.approx(exact, abs=0.02 * exact.max())
    assert spacing * wear[2].sum() == pytest.approx(COEFFICIENT * FORCE, rel=0.01)


def carter(across, cycles):
    """Return the worn depth per cycle of equal cylinders over that of k F xi / mu at a creepage of partial slip."""
    shear, poisson, mu, half_width, radius, rows = 1e9, 0.3, 0.3, 1e-3, 1.0, 2
    spacing = 2.0 * half_width / across
    force = np.pi * shear / (1.0 - poisson) * half_width**2 / (4.0 * radius) * rows * spacing
    creepage = 0.4 * mu * half_width / radius
    material = {"name": "isotropic", "young_modulus": 2.0 * shear * (1.0 + poisson), "poisson_ratio": poisson}
    width, divisions = ((10 * across - 1) * spacing, (rows - 1) * spacing), (10 * across - 1, rows - 1)
    mesh = meeframe.mesh.half_space(width, divisions)
    formulation = HalfSpace(density="constant", matrix_up_to=0, periodic=True)
    result = solved(
        [
            meeframe.Step(normal_force=force, sliding=0.0),
            meeframe.Step(rolling={"steady": True, "creepage": [creepage, 0.0], "cycles": cycles}),
        ],
        width,
        divisions,
        mu,
        1e-12,
        meeframe.Paraboloid(radius, 1e9),
        material=material,
        formulation=formulation,
        second_body=meeframe.SecondBody(material, mesh, formulation=formulation),
    )
    step = result[-1]
    assert np.ptp(step.wear) == 0.0
    per_length = mu * force / (rows * spacing) * (1.0 - (1.0 - 0.4) ** 2)
    return step.wear[0] / (cycles * 1e-12 / mu * per_length * creepage)


@pytest.mark.full
def test_cylinders_in_partial_slip():
    """By Carter one cycle wears k F xi / mu, many of them in proportion; the force has an error of order one."""
    coarse, fine = carter(10, 1e3), carter(20, 1e6)
    assert fine == pytest.approx(1.0, rel=0.03)
    assert 2.0 * fine - coarse == pytest.approx(1.0, rel=0.01)


@pytest.mark.full
def test_wear_of_few_cycles_is_that_of_a_steady_state():
    """Spin and creepage with partial slip: the depth is the sum along each line of k p s, computed without wear.

    Its integral is the work of friction times k / mu, of which the balance of forces and creepages is another measure.
    """
    rolls = {"steady": True, "creepage": [1e-3, 5e-4], "spin": 5.0}
    arguments = 3.0 * HERTZ, 16
    unworn = solved([PRESS, meeframe.Step(rolling=rolls)], *arguments, coefficient=None)[-1]
    result = solved([PRESS, meeframe.Step(rolling={**rolls, "cycles": 2.0})], *arguments)
    _, pressure = lines(result.zone, -unworn.traction[:, 2])
    _, slip = lines(result.zone, np.linalg.norm(unworn.slip, axis=1))
    exact = COEFFICIENT * 0.5 * (pressure[:-1] + pressure[1:]) * slip[:-1]
    y, wear = lines(result.zone, result[-1].wear)
    assert wear == pytest.approx(np.tile(2.0 * exact.sum(axis=0), (len(wear), 1)), rel=1e-4)
    section, work = (y[1] - y[0]) * wear[0].sum(), result.to_dataframe()["friction_work"].iloc[-1]
    assert section == pytest.approx(2.0 * COEFFICIENT / 0.2 * work, rel=0.02)
    assert "worn in 2 cycles by 1 steps" in result[-1].message
    assert result[-1].loading.rolling.cycles == 2.0
    assert result.to_dataframe()["cycles"].iloc[-1] == 2.0


@pytest.mark.full
def test_deep_scar_of_a_roller():
    """In full slip a scar far deeper than the approach has the same load on all lines: b^3 = 3 k P xi N R / 2."""
    depth, creepage = 3.0 * HERTZ**2 / RADIUS, 0.5
    half_width = np.sqrt(2.0 * depth * RADIUS)
    cycles = half_width**3 / (1.5 * COEFFICIENT * FORCE * creepage * RADIUS)
    rolls = {"steady": True, "creepage": [creepage, 0.0], "cycles": cycles}
    steps = [PRESS, meeframe.Step(rolling=rolls, increments=2)]
    result = solved(steps, (2.2 * HERTZ, 2.4 * half_width), (12, 24))
    zone, step = result.zone, result[-1]
    y, wear = lines(zone, step.wear)
    spacing = y[1] - y[0]
    assert spacing * wear[0].sum() == pytest.approx(COEFFICIENT * FORCE * creepage * cycles, rel=5e-3)
    assert wear[0].max() == pytest.approx(depth, rel=0.02)
    _, pressure = lines(zone, -step.traction[:, 2])
    load = pressure.sum(axis=0)[np.abs(y) < 0.5 * half_width]
    assert np.ptp(load) < 0.05 * load.mean()
    assert result[1].loading.rolling.cycles == pytest.approx(0.5 * cycles)
    assert step.loading.rolling.cycles == pytest.approx(cycles)


@pytest.mark.full
def test_run_continues_with_worn_profiles(tmp_path):
    rolls = {"steady": True, "creepage": [0.1, 0.0], "cycles": 5.0}
    steps, arguments = [PRESS, meeframe.Step(rolling=rolls), meeframe.Step(rolling=rolls)], (2.6 * HERTZ, 8)
    whole = solved(steps, *arguments)
    case(steps[:2], *arguments, output=FILES).solve(tmp_path / "first", progress=False)
    (again,) = solved(steps[2:], *arguments, restart=tmp_path / "first")
    assert again.wear == pytest.approx(whole[-1].wear, rel=1e-6)
    assert again.loading.rolling.cycles == 10.0
    lateral = meeframe.Step(rolling={**rolls, "direction": [0.0, 1.0]})
    with pytest.raises(CaseError, match="worn depth varies along them: the earlier run wore them in place"):
        case([lateral], *arguments, restart=tmp_path / "first").solve(progress=False)


CYCLES = {"steady": True, "creepage": [0.1, 0.0], "cycles": 10.0}
REFUSED = {
    "cycles = 10 without steady = true": [PRESS, {"distance": 1e-4, "cycles": 10.0}],
    "cycles = 1e+18: must be > 0 and <= 1e+15": [PRESS, {**CYCLES, "cycles": 1e18}],
    "wear_tolerance = 2": [PRESS, {**CYCLES, "wear_tolerance": 2.0}],
    "load step 1 wears them in place or in one passage; allowed: before it": [
        meeframe.Step(normal_force=FORCE),
        CYCLES,
    ],
    "a direction across that of earlier cycles": [PRESS, CYCLES, {**CYCLES, "direction": [0.0, 1.0]}],
}


@pytest.mark.parametrize("message", REFUSED)
def test_refused_steps(message):
    steps = REFUSED[message]
    with pytest.raises(CaseError) as error:
        case([each if isinstance(each, meeframe.Step) else meeframe.Step(rolling=each) for each in steps], HERTZ, 8)
    assert message in str(error.value)


def test_refused_extents():
    with pytest.raises(CaseError, match="load step 2 has a number of cycles, which concerns wear alone"):
        case([meeframe.Step(normal_force=FORCE), meeframe.Step(rolling=CYCLES)], HERTZ, 8, coefficient=None)
    with pytest.raises(CaseError, match="load step 2 has a sliding distance and rolls; allowed: one of both"):
        case([PRESS, meeframe.Step(rolling={"distance": 1e-4}, sliding=1.0)], HERTZ, 8)
