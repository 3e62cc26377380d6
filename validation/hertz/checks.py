"""Check a rigid sphere on an isotropic half space against Hertz."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from case_files import totals_of
from half_space import Pressed
from indentation import Run, convergence, pressure_plot
from isotropic import APPROACH, POISSON, STIFFNESS, YOUNG, elastic_response

from meeframe.study.validate import Check, Item
from meeframe.testing.closed_forms import Sphere
from meeframe.testing.closed_forms_friction import HertzContact

TITLE = "Hertz: sphere on an isotropic half space"
SOURCE = "Hertz, J. reine angew. Math. 92 (1882) 156; Johnson, Contact Mechanics (1985), section 4.2."
EXACT = HertzContact(YOUNG, POISSON, 0.1, APPROACH)


def run(quick: bool) -> Iterator[Item]:
    """Check totals and pressure on 64 cells, also from the case file, then the order of convergence."""
    yield from totals_of(
        Path(__file__).with_name("sphere.toml"), {"force": EXACT.force, "max_pressure": EXACT.peak_pressure}
    )
    case = Run(STIFFNESS, elastic_response(), Sphere(EXACT.radius), APPROACH)
    yield from _on_64_cells(case.at(64))
    yield pressure_plot(case, 32, "sphere")
    yield from convergence(case, (12, 24, 48) if quick else (12, 24, 48, 96), 2.0, 0.3, "sphere")


def _on_64_cells(result: Pressed) -> Iterator[Item]:
    yield Check("force, 64 cells", result.force, EXACT.force, 1e-3, "N")
    yield Check("largest pressure, 64 cells", float(result.pressure.max()), EXACT.peak_pressure, 1e-3, "Pa")
    yield Check("contact radius, 64 cells", np.sqrt(result.contact_area / np.pi), EXACT.contact_radius, 0.01, "m")
    error = np.abs(result.pressure - EXACT.pressure(result.r)) / EXACT.peak_pressure
    # centres of cells on the contact edge are up to a diagonal inside it
    inner = result.r < EXACT.contact_radius - np.sqrt(2.0) * result.spacing
    largest, mean = float(error[inner].max()), float(np.sqrt(np.mean(error[error > 0.0] ** 2)))
    yield Check(
        "pressure, largest error relative to the peak, without cells on the contact edge", largest, 0.0, 0.01, "", True
    )
    yield Check("pressure, r.m.s. error relative to the peak, all cells", mean, 0.0, 0.01, "", True)
