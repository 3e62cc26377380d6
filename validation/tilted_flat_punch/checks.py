"""Check a rigid flat-ended circular punch that is tilted with its whole face in contact."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from case_files import solved
from half_space import Pressed, press
from indentation import OFFSETS
from isotropic import APPROACH, MODULUS, STIFFNESS

from meeframe.fields import Array
from meeframe.study.validate import Check, Curve, Item, Plot

TITLE = "Tilted flat punch on an isotropic half space"
SOURCE = (
    "Gladwell, Contact Problems in the Classical Theory of Elasticity (1980): M = 4/3 E* a^3 theta, "
    "p = E* (g + 2 theta x)/(pi sqrt(a^2 - r^2)) while g > 2 theta a."
)
RADIUS = 2e-3
TILT = APPROACH / (4.0 * RADIUS)
"""Half of the tilt at which the face begins to separate."""


def run(quick: bool) -> Iterator[Item]:
    """Check force, moment and pressure on 64 cells, and means over grids."""
    force, moment = 2.0 * RADIUS * MODULUS * APPROACH, 4.0 / 3.0 * MODULUS * RADIUS**3 * TILT
    result = tilted(64)
    yield Check("force, 64 cells", result.force, force, 1e-3, "N")
    yield Check("moment, 64 cells", moment_of(result), moment, 5e-3, "N m")
    totals = solved(Path(__file__).with_name("punch.toml"))
    yield Check("punch.toml, with meeframe run: force", -float(totals.force[2]), force, 1e-3, "N")
    yield Check("punch.toml, with meeframe run: moment", float(totals.moment[1]), moment, 5e-3, "N m")
    forces, moments = zip(*((one.force, moment_of(one)) for one in map(tilted, 64 + np.array(OFFSETS))), strict=True)
    yield Check("force, mean of four grids of 64 to 65 cells", float(np.mean(forces)), force, 1e-2, "N")
    yield Check("moment, mean of four grids of 64 to 65 cells", float(np.mean(moments)), moment, 1e-2, "N m")
    inner = result.r < 0.8 * RADIUS
    x = result.system.points[:, 0]
    error = np.abs(result.pressure / pressure(x, result.r) - 1.0)[inner].max()
    yield Check("pressure within 0.8 a, largest relative error", float(error), 0.0, 0.02, "", True)
    line, along = result.section()
    fine = np.linspace(-0.999, 0.999, 400) * RADIUS
    curves = (
        Curve("closed form", fine * 1e3, pressure(fine, np.abs(fine)) / 1e6),
        Curve("nodes", along * 1e3, result.pressure[line] / 1e6, points=True),
    )
    yield Plot("tilted punch: pressure through the centre", "x [mm]", "pressure [MPa]", curves)


def tilted(cells: float) -> Pressed:
    """Press the punch rotated about y, on a grid with an odd number of divisions."""

    def height(x: Array, y: Array) -> Array:
        return np.where(np.hypot(x, y) <= RADIUS * (1 + 1e-9), -TILT * x, np.inf)

    return press(STIFFNESS, height, APPROACH, 2.0 * RADIUS, cells, divisions=2 * round(0.6 * cells) + 1)


def moment_of(result: Pressed) -> float:
    """Return the moment of the pressure about y [N m]."""
    return float(result.system.weights @ (result.pressure * result.system.points[:, 0]))


def pressure(x: Array, r: Array) -> Array:
    """Return E* (g + 2 theta x)/(pi sqrt(a^2 - r^2)) [Pa], nan outside."""
    root = np.sqrt(np.where(r < RADIUS, RADIUS**2 - r**2, np.nan))
    return np.asarray(MODULUS / np.pi * (APPROACH + 2.0 * TILT * x) / root)
