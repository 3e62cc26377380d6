"""Each example case uses the law of its name, converges, and its results satisfy the law."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from meeframe.contact.problem import Status
from meeframe.laws import Insulating
from meeframe.laws.base import augmented_traction, fixed_point_map, for_increment
from meeframe.model.cache import system_key
from meeframe.model.load import load_case
from meeframe.model.solve import reduce, solve_steps
from meeframe.plugin.registry import load
from meeframe.results.records import Region

CASES = {path.stem: path for path in sorted((Path(__file__).parents[1] / "cases").glob("*.toml"))}
LAWS = {entry.record.name: entry.record.factory for entry in load().entries if entry.provider.name == "meeframe-laws"}
SYSTEMS = {}


def test_every_law_has_a_case():
    assert set(CASES) == set(LAWS)


@cache
def solved(name):
    """Return the case, its reduced system, which it shares with other cases of the same body, and its increments."""
    case = load_case(CASES[name])
    key = system_key(case.formulation, case.body)
    if key not in SYSTEMS:
        SYSTEMS[key] = reduce(case)
    return case, SYSTEMS[key], list(solve_steps(case, SYSTEMS[key], boundary=False))


def increments(name):
    """Return the increments with the slip paths (n,) at their beginning, and the largest traction of all [Pa]."""
    steps = solved(name)[2]
    paths = [np.zeros(len(steps[0].traction)), *(step.slip_path for step in steps[:-1])]
    return zip(steps, paths, strict=True), max(np.abs(step.traction).max() for step in steps)


def gap_of(step):
    """Return slip and normal gap, (n, 3) [m]."""
    return np.column_stack([step.slip, step.initial_gap - step.displacement[:, 2]])


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("name", [*reversed(CASES)])  # the longest case comes last
def test_case_converges_with_the_law_of_its_name(name):
    case, system, steps = solved(name)
    assert LAWS[name] in {type(law) for law in (case.contact_law, *case.conductivity.values())}
    assert len(steps) == case.n_increments
    for step in steps:
        assert step.status is Status.CONVERGED, f"{step.step}.{step.increment}: {step.message}"
        assert "snap into contact" not in step.message, "meshes of the cases suit their laws"
        load = np.column_stack([step.traction, step.fluxes])
        computed = np.column_stack([step.displacement, -step.potentials])
        expected = system.offset + system.apply(load)
        assert (np.abs(computed - expected).max(axis=0) <= 1e-9 * np.abs(expected).max(axis=0)).all()
    assert any(step.touching.sum() > 10 for step in steps)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("softer", [0.03, 3.0])
@pytest.mark.parametrize("name", CASES)
def test_traction_is_a_fixed_point_for_any_step_length(name, softer):
    case = solved(name)[0]
    paths, peak = increments(name)
    r = (softer * peak / 4e-5,) * 2  # the approach of the spheres is 40 um
    for step, path in paths:
        law, gap = for_increment(case.contact_law, path, step.loading.duration), gap_of(step)
        trial = augmented_traction(law, step.traction, gap, r)
        assert np.abs(fixed_point_map(law, trial, gap, r) - step.traction).max() <= 1e-8 * peak


def size(t):
    return np.hypot(t[:, 0], t[:, 1])


# Independent friction limits: the used fraction (n,), from law, traction t (n, 2) and pressure p (n,) of the
# contact, slip s and slip path w (n,) at the end of the increment, duration d
LIMITS = {
    "tresca": lambda law, t, p, s, w, d: (size(t), law.limit),
    "capped-coulomb": lambda law, t, p, s, w, d: (size(t), np.minimum(law.mu * p, law.limit)),
    "regularised-coulomb": lambda law, t, p, s, w, d: (size(t), law.mu * p * s / np.hypot(s, law.slip_length)),
    "slip-weakening": lambda law, t, p, s, w, d: (
        size(t),
        p * np.interp(w, [0.0, law.slip_distance], [law.mu_static, law.mu_kinetic]),
    ),
    "rate-and-pressure": lambda law, t, p, s, w, d: (
        size(t),
        (law.mu_kinetic + (law.mu_static - law.mu_kinetic) * np.exp(-s / d / law.reference_speed))
        * (law.reference_pressure * (p / law.reference_pressure) ** law.pressure_exponent),
    ),
    "non-associated-coulomb": lambda law, t, p, s, w, d: (size(t / [law.mu1, law.mu2]), p),
    "superelliptic-coulomb": lambda law, t, p, s, w, d: (
        (np.abs(t / [law.mu1, law.mu2]) ** law.exponent).sum(axis=1) ** (1.0 / law.exponent),
        p,
    ),
    "dmt-coulomb": lambda law, t, p, s, w, d: (size(t), law.mu * (p + law.adhesive_pressure)),
    **dict.fromkeys(
        ("compliant", "dmt", "dugdale", "hardness", "signorini-gap"), lambda law, t, p, s, w, d: (size(t), law.mu * p)
    ),
}
# of surfaces in contact [Pa]
ATTRACTION = {
    "dmt": lambda law: 2.0 * law.work_of_adhesion / law.equilibrium_distance,
    "dugdale": lambda law: law.adhesive_stress,
}


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("name", LIMITS)
def test_friction_reaches_its_limit_exactly_where_nodes_slip(name):
    case = solved(name)[0]
    paths, peak = increments(name)
    slipped = 0
    for step, path in paths:
        touches, slip = step.touching, size(step.slip)
        pressure = -step.traction[:, 2] + ATTRACTION.get(name, lambda law: 0.0)(case.contact_law)
        assert (pressure[touches] > 0.0).all()
        assert np.abs(step.traction[~touches, :2]).max(initial=0.0) == 0.0
        used, limit = LIMITS[name](
            case.contact_law,
            step.traction[touches, :2],
            pressure[touches],
            slip[touches],
            (path + slip)[touches],
            step.loading.duration,
        )
        left, slips = limit - used, step.region[touches] == Region.SLIP
        assert left.min(initial=0.0) >= -1e-8 * peak
        assert np.abs(left[slips]).max(initial=0.0) <= 1e-8 * peak
        assert (np.einsum("nt,nt->n", step.traction[:, :2], step.slip)[touches] >= -1e-9 * peak * slip.max()).all()
        slipped += slips.sum()
    assert slipped > 0


def plates(law, gap):
    return law.gap_constant / (gap + law.residual_gap)


# Independent conductivities, from law, contact pressure p, gap g and drop v, (n,)
CONDUCTIVITIES = {
    "power-law": lambda law, p, g, v: law.reference_conductivity * (p / law.reference_pressure) ** law.exponent,
    "saturating": lambda law, p, g, v: law.largest_conductivity * (1.0 - np.exp(-p / law.saturation_pressure)),
    "thresholded": lambda law, p, g, v: law.contact_conductivity * np.clip((p - law.threshold) / law.ramp, 0.0, 1.0),
    "across-gap": lambda law, p, g, v: np.where(p > 0.0, law.contact_conductivity, 0.0) + plates(law, g),
    "breakdown": lambda law, p, g, v: (
        np.where(p > 0.0, law.contact_conductivity, 0.0)
        + plates(law, g)
        + law.breakdown_conductivity
        * np.maximum(1.0 - law.breakdown_field * (g + law.residual_gap) / np.maximum(np.abs(v), 1e-200), 0.0)
    ),
    "robin": lambda law, p, g, v: np.full_like(p, law.kappa),
}


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("field", ["electric", "magnetic"])
@pytest.mark.parametrize("name", CONDUCTIVITIES)
def test_flux_is_conductivity_times_drop(name, field):
    case, _, steps = solved(name)
    law, column = case.conductivity[field], ["electric", "magnetic"].index(field)
    if isinstance(law, Insulating):
        assert not any(step.fluxes[:, column].any() for step in steps)
        return
    largest = max(np.abs(step.fluxes[:, column]).max() for step in steps)
    assert largest > 0.0
    for step in steps:
        held = getattr(step.loading, f"{field}_potential")
        drop, flux = step.potentials[:, column] - held, step.fluxes[:, column]
        gap = np.maximum(gap_of(step)[:, 2], 0.0)
        kappa = CONDUCTIVITIES[name](law, np.maximum(-step.traction[:, 2], 0.0), gap, drop)
        settled, perfect = (step.contact_fraction == 0.0) | (step.contact_fraction == 1.0), np.isinf(kappa)
        ohmic = settled & ~perfect
        assert np.abs(drop[settled & perfect]).max(initial=0.0) <= 1e-8 * abs(held)
        np.testing.assert_allclose(flux[ohmic], kappa[ohmic] * drop[ohmic], atol=1e-7 * largest)
