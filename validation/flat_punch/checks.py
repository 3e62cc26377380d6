"""Check a rigid flat-ended circular punch on an isotropic half space against Boussinesq."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from case_files import totals_of
from indentation import Run, convergence, force_errors, pressure_plot
from isotropic import APPROACH, MODULUS, STIFFNESS, elastic_response

from meeframe.study.validate import Check, Item
from meeframe.testing.closed_forms import FlatPunch

TITLE = "Flat punch on an isotropic half space"
SOURCE = "Boussinesq (1885); Johnson, Contact Mechanics (1985), section 3.8: P = 2 a E* g."
RADIUS = 2e-3


def run(quick: bool) -> Iterator[Item]:
    """Check the force on grids 64 cells wide, the pressure away from the singular edge, and first order."""
    case = Run(STIFFNESS, elastic_response(), FlatPunch(RADIUS), APPROACH)
    exact = 2.0 * RADIUS * MODULUS * APPROACH
    result = case.at(64)
    yield Check("force, 64 cells", result.force, exact, 1e-3, "N")
    yield from totals_of(Path(__file__).with_name("punch.toml"), {"force": exact})
    mean = exact * (1.0 + float(np.mean(force_errors(case, 64))))
    yield Check("force, mean of four grids of 64 to 65 cells", mean, exact, 1e-2, "N")
    resolved = replace(case, edges="resolved")
    worst = float(np.abs(force_errors(resolved, 64)).max())
    yield Check(
        "contact edge between the nodes: force, largest error on four grids of 64 to 65 cells",
        worst,
        0.0,
        1e-3,
        "",
        True,
    )
    inner = result.r < 0.8 * RADIUS
    true = exact / (2.0 * np.pi * RADIUS * np.sqrt(RADIUS**2 - result.r[inner] ** 2))
    error = float(np.abs(result.pressure[inner] / true - 1.0).max())
    yield Check("pressure within 0.8 a, largest relative error", error, 0.0, 0.02, "", True)
    yield pressure_plot(case, 32, "flat punch")
    yield from convergence(case, (12, 24, 48) if quick else (12, 24, 48, 96), 1.0, 0.5, "flat punch")
