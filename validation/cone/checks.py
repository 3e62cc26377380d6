"""Check a rigid cone on an isotropic half space against Love and Sneddon."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from case_files import totals_of
from indentation import Run, convergence, pressure_plot
from isotropic import APPROACH, MODULUS, STIFFNESS, elastic_response

from meeframe.study.validate import Check, Item
from meeframe.testing.closed_forms import Cone

TITLE = "Cone on an isotropic half space"
SOURCE = "Love, Quart. J. Math. 10 (1939) 161; Sneddon, Int. J. Eng. Sci. 3 (1965) 47: P = 2 E* g^2/(pi tan alpha)."
ANGLE = 0.02


def run(quick: bool) -> Iterator[Item]:
    """Check force and contact radius on 64 cells, then the order of convergence."""
    case = Run(STIFFNESS, elastic_response(), Cone(ANGLE), APPROACH)
    result = case.at(64)
    exact = 2.0 / np.pi * MODULUS * APPROACH**2 / np.tan(ANGLE)
    radius = 2.0 * APPROACH / (np.pi * np.tan(ANGLE))
    yield Check("force, 64 cells", result.force, exact, 1e-3, "N")
    yield Check("contact radius, 64 cells", np.sqrt(result.contact_area / np.pi), radius, 0.01, "m")
    yield from totals_of(Path(__file__).with_name("cone.toml"), {"force": exact})
    yield pressure_plot(case, 32, "cone")
    yield from convergence(case, (12, 24, 48) if quick else (12, 24, 48, 96), 2.0, 0.4, "cone")
