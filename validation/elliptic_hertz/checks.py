"""Check Hertz contacts with two radii of curvature, from nearly circular to cylinder-like."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from case_files import totals_of
from half_space import Pressed, on_grid, press
from isotropic import APPROACH, MODULUS, STIFFNESS
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from meeframe.fields import Array
from meeframe.indenters import Paraboloid
from meeframe.study.validate import Check, Curve, Item, Map, Plot

TITLE = "Elliptic Hertz contact, up to cylinder-like"
SOURCE = "Hertz (1882); Johnson, Contact Mechanics (1985), section 4.2."
RADIUS = 0.02
"""Smaller radius of curvature, across x [m]."""
RATIOS = (2.0, 10.0, 100.0)
"""Ratios of the radii."""


@dataclass(frozen=True)
class Ellipse:
    """Elliptic contact: semi-axes a >= b along x and y [m] and peak pressure [Pa]."""

    a: float
    b: float
    peak: float

    @property
    def force(self) -> float:
        """Force 2/3 p_0 pi a b [N]."""
        return 2.0 / 3.0 * np.pi * self.a * self.b * self.peak

    def pressure(self, x: Array, y: Array) -> Array:
        """Return p_0 sqrt(1 - x^2/a^2 - y^2/b^2) [Pa], zero outside."""
        return np.asarray(self.peak * np.sqrt(np.maximum(1.0 - (x / self.a) ** 2 - (y / self.b) ** 2, 0.0)))


def contact(ratio: float) -> Ellipse:
    """Return the contact for radii ratio * RADIUS along x and RADIUS along y.

    With k = b/a and m = 1 - k^2: A = p_0 b (K - E)/(E* m a^2), B = p_0 b (E/k^2 - K)/(E* m a^2), g = p_0 b K/E*.
    """

    def quotient(k: float) -> float:
        m = 1.0 - k**2
        return float((ellipe(m) / k**2 - ellipk(m)) / (ellipk(m) - ellipe(m)))

    k = float(brentq(lambda k: quotient(k) - ratio, 1e-4, 1.0 - 1e-7, xtol=1e-15))
    m = 1.0 - k**2
    a = np.sqrt((ellipk(m) - ellipe(m)) / (m * ellipk(m)) * APPROACH * 2.0 * ratio * RADIUS)
    return Ellipse(float(a), float(k * a), float(MODULUS * APPROACH / (k * a * ellipk(m))))


def pressed(ratio: float, cells: float) -> Pressed:
    """Press with the given number of cells along both axes of the ellipse."""
    exact = contact(ratio)
    height = Paraboloid(ratio * RADIUS, RADIUS).height
    return press(STIFFNESS, height, APPROACH, (2.0 * exact.a, 2.0 * exact.b), cells)


def run(quick: bool) -> Iterator[Item]:
    """Check force, peak and semi-axes on 64 cells along both axes; one ellipse also from its case file."""
    exact = contact(10.0)
    totals = {"force": exact.force, "max_pressure": exact.peak}
    yield from totals_of(Path(__file__).with_name("paraboloid.toml"), totals)
    for ratio in RATIOS[::2] if quick else RATIOS:
        exact, result = contact(ratio), pressed(ratio, 64)
        name = f"radii 1 to {ratio:g}, ellipse 1 to {exact.a / exact.b:.3g}"
        yield Check(f"{name}: force, 64 cells", result.force, exact.force, 1e-3, "N")
        yield Check(f"{name}: largest pressure", float(result.pressure.max()), exact.peak, 1e-3, "Pa")
        yield Check(f"{name}: contact area", result.contact_area, np.pi * exact.a * exact.b, 0.02, "m^2")
        x, y, _ = result.system.points.T
        for axis, other, true, label in ((x, y, exact.a, "a"), (y, x, exact.b, "b")):
            # second moment of the pressure: a^2/5 of the force
            semi = np.sqrt(5.0 * (result.system.weights * result.pressure) @ axis**2 / result.force)
            yield Check(f"{name}: semi-axis {label} of the pressure's moments", float(semi), true, 2e-3, "m")
            yield _section(name, result, exact, (axis, other), label)
    yield _map(result, name)


def _section(name: str, result: Pressed, exact: Ellipse, axes: tuple[Array, Array], label: str) -> Plot:
    along, across = axes
    line = np.flatnonzero(np.abs(across) == np.abs(across).min())
    line = line[np.argsort(along[line])]
    x, y, _ = result.system.points[line].T
    curves = (
        Curve("closed form", along[line] * 1e3, exact.pressure(x, y) / 1e6),
        Curve("nodes", along[line] * 1e3, result.pressure[line] / 1e6, points=True),
    )
    return Plot(f"{name}: pressure along {label}", "distance [mm]", "pressure [MPa]", curves)


def _map(result: Pressed, name: str) -> Map:
    x, y, values = on_grid(result.system.points, result.pressure)
    return Map(f"{name}: pressure", "x [mm]", "y [mm]", "MPa", x * 1e3, y * 1e3, {"": values / 1e6})
