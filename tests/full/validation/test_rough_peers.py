"""Rough contact agrees with Tamaas, ContactMechanics and ASPHER on the same surface: pressures, and area to the node.

Each test is skipped if its code is not installed (groups references, benchmarks and aspher of pyproject.toml).
"""

import numpy as np
import pytest

from meeframe.plugin.registry import load
from meeframe.study.rough.declare import declare
from meeframe.study.rough.run import solve_rough

YOUNG, POISSON, PERIOD, N = 200e9, 0.3, 1e-3, 64
MODULUS = YOUNG / (1 - POISSON**2)
SLOPE = 0.1
HARDNESS = 0.25 * MODULUS * SLOPE
LOADS = (0.02, 0.15)
"""Mean pressures relative to E* times the root mean square slope."""


def study(load_share, hardness=None):
    """Solve with waves as densities, which the other codes use; return heights, peaks up, and pressures, (N, N)."""
    keys = {} if hardness is None else {"contact": {"law": {"name": "hardness", "hardness": hardness}}}
    checked = declare(
        {
            "surface": {
                "name": "self-affine",
                "period": PERIOD,
                "shortest": PERIOD / 8,
                "roll_off": PERIOD / 2,
                "hurst": 0.8,
                "rms_slope": SLOPE,
                "samples": N,
                "seed": 11,
            },
            "material": {"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": POISSON},
            "pressures": [load_share * MODULUS * SLOPE],
            "formulation": {"density": "trigonometric"},
            "solver": {"tolerance": 1e-11},
            "stiffness": False,
            **keys,
        },
        load(),
    )
    result = solve_rough(checked)
    assert result.is_converged
    return checked.surface.heights, result.nodal_pressure


def check_alike(pressure, reference):
    """Check pressures to 1e-6 of the largest one, and the contact node by node."""
    peak = reference.max()
    np.testing.assert_allclose(pressure, reference, atol=1e-6 * peak)
    # a node that just touches bears less pressure than either solution is accurate to
    np.testing.assert_array_equal(pressure > 1e-7 * peak, reference > 1e-7 * peak)
    assert (pressure > 0.0).sum() == (reference > 1e-7 * peak).sum()


def tamaas_model(tamaas):
    """Return a model in units of the period and of E*, since some tolerances of Tamaas are absolute numbers."""
    tamaas.set_log_level(tamaas.LogLevel.error)
    model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [1.0, 1.0], [N, N])
    model.E, model.nu = YOUNG / MODULUS, POISSON
    return model


@pytest.mark.parametrize("share", LOADS)
def test_tamaas(share):
    tamaas = pytest.importorskip("tamaas")
    heights, pressure = study(share)
    model = tamaas_model(tamaas)
    kind = tamaas.PolonskyKeerRey.pressure
    solver = tamaas.PolonskyKeerRey(model, np.ascontiguousarray(heights / PERIOD), 1e-14, kind, kind)
    solver.max_iter = 20_000
    solver.solve(share * SLOPE)
    check_alike(pressure, MODULUS * np.array(model.traction).reshape(N, N))


@pytest.mark.parametrize("share", [0.05, 0.15])
def test_saturated_contact_of_tamaas(share):
    """The solver of Stanley and Kato with pressures up to a limit."""
    tamaas = pytest.importorskip("tamaas")
    heights, pressure = study(share, HARDNESS)
    model = tamaas_model(tamaas)
    solver = tamaas.KatoSaturated(model, np.ascontiguousarray(heights / PERIOD), 1e-11, HARDNESS / MODULUS)
    solver.max_iter = 10_000
    solver.solve(share * SLOPE)
    reference = MODULUS * np.array(model.traction).reshape(N, N)
    assert (pressure >= HARDNESS * (1 - 1e-12)).sum() > 50
    check_alike(pressure, reference)


@pytest.mark.parametrize("share", LOADS)
def test_contact_mechanics(share):
    pytest.importorskip("ContactMechanics")
    from ContactMechanics import PeriodicFFTElasticHalfSpace
    from ContactMechanics.Systems import NonSmoothContactSystem
    from SurfaceTopography import Topography

    heights, pressure = study(share)
    substrate = PeriodicFFTElasticHalfSpace((N, N), MODULUS, (PERIOD, PERIOD))
    system = NonSmoothContactSystem(substrate, Topography(heights, physical_sizes=(PERIOD, PERIOD)))
    force = share * MODULUS * SLOPE * PERIOD**2
    result = system.minimize_proxy(external_force=force, pentol=1e-13 * np.ptp(heights), maxiter=20_000)
    check_alike(pressure, np.asarray(result.jac)[:N, :N] / (PERIOD / N) ** 2)


@pytest.mark.parametrize("share", LOADS)
def test_aspher(share):
    aspher = pytest.importorskip("aspher")
    heights, pressure = study(share)
    result = aspher.solve_nested(
        grid_size=N,
        gap=(heights.max() - heights).ravel(),
        p_nominal=share * MODULUS * SLOPE,
        domain_size=PERIOD,
        E_star=MODULUS,
        tol=1e-12,
        coarsest=64,
        backend="periodic",
    )
    assert result.converged
    check_alike(pressure, result.pressure.reshape(N, N))
