"""Conductance and stiffness of a rough contact on a fine grid are one function of its spots, by Barber's identity."""

import numpy as np

from meeframe.plugin.registry import load
from meeframe.study.rough.declare import declare
from meeframe.study.rough.run import solve_rough

YOUNG, POISSON, SIGMA = 120e9, 0.34, 5.8e7


def test_barber_on_256_nodes():
    study = declare(
        {
            "surface": {
                "name": "self-affine",
                "period": 1e-3,
                "shortest": 1e-3 / 32,
                "roll_off": 0.25e-3,
                "hurst": 0.8,
                "rms_slope": 0.05,
                "samples": 256,
            },
            "material": {"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": POISSON},
            "pressures": ["0.3 GPa"],
            "electrical_conductivity": SIGMA,
        },
        load(),
    )
    result = solve_rough(study)
    assert result.is_converged
    barber = 2.0 * SIGMA / (YOUNG / (1.0 - POISSON**2)) * result.values["stiffness"]
    np.testing.assert_allclose(result.values["conductance"], barber, rtol=1e-3)
