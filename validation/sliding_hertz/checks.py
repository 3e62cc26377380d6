"""Check a sliding Hertz contact: tractions are mu p everywhere, displacements have a closed form."""

from collections.abc import Iterator

import numpy as np

from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb
from meeframe.study.validate import Check, Curve, Item, Plot
from meeframe.testing.closed_forms_friction import HertzContact, PartialSlip, shear_modulus
from meeframe.testing.elastic_half_space import elastic_half_space
from meeframe.testing.load_path import Position, follow

TITLE = "Hertz contact in full slip"
SOURCE = (
    "Johnson, Contact Mechanics (1985), section 3.9 (displacements under a Hertz distribution of tangential tractions) "
    "and section 7.2 (onset of sliding), with Goodman's approximation."
)
HERTZ = HertzContact(200e9, 0.3, 0.1, 5e-5)
FRICTION, ZONE = 0.5, 2.1


def run(quick: bool) -> Iterator[Item]:
    """Check states just before and well after the onset of sliding."""
    cells = 24 if quick else 32
    exact, a = PartialSlip(HERTZ, FRICTION), HERTZ.contact_radius
    system = elastic_half_space(HERTZ.young, HERTZ.poisson, ZONE * a, cells, goodman=True)
    x, y, _ = system.points.T
    gap = (x**2 + y**2) / (2.0 * HERTZ.radius) - HERTZ.approach
    places = np.array([0.0, 0.9, 1.5]) * exact.limit_displacement
    path = [Position(gap, np.tile([place, 0.0], (len(gap), 1))) for place in places]
    _, before, after = follow(system, IsotropicCoulomb(FRICTION), path)
    yield Check("force at 0.9 of the limit", before.force[0], exact.force(places[1]), 5e-3, "N")
    yield Check("force in full slip", after.force[0], exact.limit_force, 5e-3, "N")
    load, moved = after.state.load, after.state.displacement
    pressed = load[:, 2] < 0.0
    ratio = -load[pressed, 0] / load[pressed, 2]
    yield Check("ratio of traction along the motion and pressure, smallest", float(ratio.min()), FRICTION, 0.01)
    sticking = np.hypot(*load[:, :2].T) < (1.0 - 1e-9) * FRICTION * np.maximum(-load[:, 2], 0.0)
    yield Check("cells that stick in full slip", float(sticking.sum()), 0.0, 0.5, "", True)
    along, across = displacement(x, y)
    inner = np.hypot(x, y) < a
    for name, result, true in (("along", moved[:, 0], along), ("across", moved[:, 1], across)):
        # the displacement along the motion contains the rigid motion: both errors are relative to its largest value
        error = float(np.abs(result - true)[inner].max() / np.abs(along).max())
        yield Check(f"surface displacement {name} the motion, largest error", error, 0.0, 5e-3, "", True)
    yield _plot(x, y, moved[:, 0], a)


def displacement(x: Array, y: Array) -> tuple[Array, Array]:
    """Return displacements along and across the traction mu p_0 sqrt(1 - r^2/a^2) for r < a, (n,) [m] each."""
    a, nu = HERTZ.contact_radius, HERTZ.poisson
    unit = np.pi * FRICTION * HERTZ.peak_pressure / (32.0 * shear_modulus(HERTZ.young, nu) * a)
    along = unit * (4.0 * (2.0 - nu) * a**2 - (4.0 - 3.0 * nu) * x**2 - (4.0 - nu) * y**2)
    return along, unit * 2.0 * nu * x * y


def _plot(x: Array, y: Array, result: Array, a: float) -> Plot:
    curves = []
    for name, coordinate, other in (("x", x, y), ("y", y, x)):
        line = np.flatnonzero((np.abs(other) == np.abs(other).min()) & (other > 0.0) & (np.abs(coordinate) < a))
        line = line[np.argsort(coordinate[line])]
        exact, _ = displacement(x[line], y[line])
        curves += [
            Curve(f"closed form along {name}", coordinate[line] * 1e3, exact * 1e6),
            Curve(f"cells along {name}", coordinate[line] * 1e3, result[line] * 1e6, points=True),
        ]
    return Plot("Full slip: displacement along the motion", "x or y [mm]", "u_x [µm]", tuple(curves))
