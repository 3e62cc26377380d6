"""Check wear by Archard's law: flat punches that run in, worn volumes, scars, fretting, sliding and rolling."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from isotropic import MODULUS, POISSON, YOUNG

import meeframe
from meeframe.fields import Array
from meeframe.results.records import Region, StepResult, Zone
from meeframe.study.validate import Check, Curve, Item, Plot
from meeframe.testing.closed_forms_wear import flat_punch_decay, fretting_force, scar_radius

TITLE = "Wear: flat punches, scars, fretting, sliding and rolling"
SOURCE = (
    "Archard, J. Appl. Phys. 24 (1953) 981; Galin, J. Appl. Math. Mech. 40 (1976) 981; Goryacheva, Contact Mechanics "
    "in Tribology (1998), chapters 6 and 7; Popov, Sci. Rep. 4 (2014) 3749."
)
COEFFICIENT, RADIUS, FORCE = 1e-13, 1e-3, 100.0
"""Wear coefficient over hardness [1/Pa]; radius [m] and force [N] of the flat punch."""
SPHERE, SPHERE_FORCE, FRICTION, STICK = 10e-3, 10.0, 0.3, 0.7
"""Radius [m] and force [N] of the sphere; friction coefficient and stick radius over contact radius of fretting."""
DEPTHS = (1.0, 3.0, 10.0)
"""Worn depths of the sphere in elastic approaches."""


def worn(
    indenter: Any, steps: Sequence[meeframe.Step], width: float, cells: int, poisson: float = POISSON, **arguments: Any
) -> meeframe.Result:
    """Return the result of an indenter on an elastic half space that wears."""
    case = meeframe.Case(
        material={"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": poisson},
        mesh=meeframe.mesh.half_space(width, divisions=cells),
        indenter=indenter,
        formulation=meeframe.formulation("half-space"),
        steps=list(steps),
        **{"contact": meeframe.Contact(wear=meeframe.Archard(COEFFICIENT)), **arguments},
    )
    result = case.solve(progress=False)
    if result.status != "converged":
        raise RuntimeError(result[-1].message)
    return result


def pressure(step: StepResult) -> Array:
    """Return the contact pressure (n,) [Pa]."""
    return 0.0 - step.traction[:, 2]


def radial_means(zone: Zone, step: StepResult, edges: Array) -> Array:
    """Return the mean pressure [Pa] in rings between distances from the axis (k + 1,) [m], (k,)."""
    ring = np.digitize(np.hypot(*zone.points.T[:2]), edges)
    return np.array([pressure(step)[ring == number].mean() for number in range(1, len(edges))])


def flat_punch(quick: bool) -> Iterator[Item]:
    """Check the decay of the pressure towards the mean, the approach and the volume under a held force."""
    cells = 32 if quick else 64
    length = 1.0 / flat_punch_decay(COEFFICIENT, MODULUS, RADIUS)
    slip, increments = 9.0 * length, 18
    steps = [
        meeframe.Step(normal_force=FORCE, sliding=0.0),
        meeframe.Step(sliding=slip, increments=increments),
    ]
    result = worn(meeframe.FlatPunch(RADIUS), steps, 2.0 * RADIUS * cells / (cells - 2), cells)
    zone, (first, *_, before, last) = result.zone, result.steps
    area = float(zone.weights @ last.touching)
    excesses = [np.where(step.touching, pressure(step) - FORCE / area, 0.0) for step in (before, last)]
    norms = [float(np.sqrt(zone.weights @ excess**2)) for excess in excesses]
    decay, words = float(np.log(norms[0] / norms[1])), f"flat punch, {cells} cells"
    yield Check(f"{words}: decay of the slowest mode in an increment of half a length", decay, float(np.log(1.5)), 5e-3)
    variation = float(np.abs(excesses[1]).max()) / (FORCE / area)
    yield Check(f"{words}: largest deviation from the mean pressure after 9 lengths", variation, 0.0, 5e-3, "", True)
    totals = meeframe.resultants(zone, last)
    yield Check(f"{words}: worn volume", totals.worn_volume, COEFFICIENT * FORCE * slip, 1e-6, "m^3")
    rate = (last.loading.approach - before.loading.approach) / (slip / increments)
    yield Check(f"{words}: approach per sliding distance", rate, COEFFICIENT * FORCE / area, 1e-3)
    edges = np.linspace(0.0, 0.95 * RADIUS, 13)
    places, mean = 0.5 * (edges[1:] + edges[:-1]) * 1e3, FORCE / (np.pi * RADIUS**2)
    radii = np.linspace(0.0, 0.98, 100)
    curves = [Curve("unworn, closed form", radii * RADIUS * 1e3, 0.5 / np.sqrt(1.0 - radii**2))]
    for step, name in ((first, "unworn"), (result.steps[2], "after 1 length"), (last, "after 9 lengths")):
        curves.append(Curve(name, places, radial_means(zone, step, edges) / mean, points=True))
    yield Plot("Flat punch that runs in", "distance from the axis [mm]", "pressure over mean pressure", tuple(curves))


def spinning_punch(quick: bool) -> Iterator[Item]:
    """Check that pressure times distance from the axis becomes uniform under a spinning punch."""
    cells = 23 if quick else 47
    turn = 120.0 / (flat_punch_decay(1e-9, MODULUS, RADIUS) * RADIUS)  # the middle, which slips least, is the last
    steps = [meeframe.Step(normal_force=FORCE, sliding=0.0), meeframe.Step(twist=turn, increments=16)]
    contact = meeframe.Contact(wear=meeframe.Archard(1e-9))
    result = worn(meeframe.FlatPunch(RADIUS), steps, 2.0 * RADIUS * cells / (cells - 2), cells, contact=contact)
    zone, step = result.zone, result[-1]
    product = (pressure(step) * np.hypot(*zone.points.T[:2]))[step.touching]
    words = f"spinning flat punch, {cells} cells: pressure times distance from the axis"
    yield Check(f"{words}, range over mean", float(np.ptp(product) / product.mean()), 0.0, 1e-3, "", True)
    inverse = zone.weights[step.touching] @ (1.0 / np.hypot(*zone.points[step.touching].T[:2]))
    yield Check(f"{words}, mean", float(product.mean()), FORCE / float(inverse), 1e-3, "N/m")


def scar(quick: bool) -> Iterator[Item]:
    """Check radius, depth and volume of the scar of a sphere that wears ever deeper."""
    hertz = float((3.0 * SPHERE_FORCE * SPHERE / (4.0 * MODULUS)) ** (1 / 3))
    # a scar of the radius a is a^2 / 2 R deep, the elastic approach hertz^2 / R
    radii = np.sqrt(2.0 * np.array(DEPTHS)) * hertz
    slips = np.pi * radii**4 / (4.0 * COEFFICIENT * SPHERE_FORCE * SPHERE)
    shares = np.diff(slips, prepend=0.0)
    steps = [meeframe.Step(normal_force=SPHERE_FORCE, sliding=0.0)]
    steps += [meeframe.Step(sliding=share, max_pressure_change=0.2) for share in shares]
    cells = 48 if quick else 96
    result = worn(meeframe.Sphere(SPHERE), steps, 2.6 * radii[-1], cells)
    areas = []
    for depth, slip, step in zip(DEPTHS, slips, result.steps[1:], strict=True):
        totals, words = meeframe.resultants(result.zone, step), f"sphere, worn by {depth:g} elastic approaches"
        volume = COEFFICIENT * SPHERE_FORCE * slip
        yield Check(f"{words}: volume", totals.worn_volume, volume, 1e-6, "m^3")
        areas.append(float(np.sqrt(totals.contact_area / np.pi)))
    deep = scar_radius(COEFFICIENT, SPHERE_FORCE, SPHERE, slips[-1])
    words = f"sphere, worn by {DEPTHS[-1]:g} elastic approaches, {cells} cells"
    yield Check(f"{words}: radius of the scar", areas[-1], deep, 0.01, "m")
    yield Check(f"{words}: deepest point", float(result[-1].wear.max()), deep**2 / (2.0 * SPHERE), 0.02, "m")
    grid = np.geomspace(slips[0], slips[-1], 50)
    exact = np.array([scar_radius(COEFFICIENT, SPHERE_FORCE, SPHERE, slip) for slip in grid])
    volumes = COEFFICIENT * SPHERE_FORCE * np.array([*grid])
    curves = (
        Curve("deep wear: a^4 = 4 R V / pi", volumes * 1e9, exact * 1e3),
        Curve("computed", COEFFICIENT * SPHERE_FORCE * slips * 1e9, np.array(areas) * 1e3, points=True),
    )
    yield Plot("Scar of a sphere", "worn volume [mm³]", "radius of the scar [mm]", curves)


def fretting(quick: bool) -> Iterator[Item]:
    """Check the limit in which the slip annulus of equal bodies without Poisson effect bears nothing."""
    depth, cells = 1e-6, 24 if quick else 40
    radius = float(np.sqrt(SPHERE * depth))
    motion = FRICTION * depth * (1.0 - STICK**2)  # E* = G* without Poisson effect
    coefficient = 2.0 * depth / (2.0 * motion * 2.0 * (YOUNG / 2.0) / np.pi * np.sqrt(depth / SPHERE))
    steps = [meeframe.Step(approach=depth, sliding=0.0)]
    # each half cycle nears the limit, which finer grids resolve; where slip wears off the pressure within an increment,
    # nodes that could stick slip, the more the longer the increment is
    halves, increments = (2, 2) if quick else (4, 4)
    steps += [meeframe.Step(translation=[sign * motion, 0.0], increments=increments) for sign in (1, -1) * halves]
    mesh, formulation = meeframe.mesh.half_space(2.6 * radius, divisions=cells), meeframe.formulation("half-space")
    material = {"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": 0.0}
    result = worn(
        meeframe.Sphere(SPHERE),
        steps,
        2.6 * radius,
        cells,
        0.0,
        contact=meeframe.Contact(meeframe.IsotropicCoulomb(FRICTION), wear=meeframe.Archard(coefficient)),
        second_body=meeframe.SecondBody(material, mesh, formulation=formulation),
    )
    zone, step = result.zone, result[-1]
    sticks, words = step.region == Region.STICK, f"fretting at a constant approach, {cells} cells"
    stick = float(np.sqrt(zone.weights @ sticks / np.pi))
    yield Check(f"{words}: stick radius", stick, STICK * radius, 0.5 * 2.6 * radius / cells, "m", True)
    limit = fretting_force(YOUNG / 2.0, SPHERE, depth, stick)
    yield Check(f"{words}: force, of this radius", meeframe.resultants(zone, step).normal_force, limit, 0.01, "N")
    yield Check(f"{words}: largest worn depth that sticks", float(step.wear[sticks].max()), 0.0, 1e-12, "m", True)
    annulus = step.touching & ~sticks
    share = float(zone.weights[annulus] @ pressure(step)[annulus]) / limit
    yield Check(f"{words}: part of the force that the annulus bears", share, 0.0, 0.02, "", True)


def groove(quick: bool) -> Iterator[Item]:
    """Check the groove of a slider in one passage: k times the integral of the pressure of Hertz along its way."""
    hertz = float((3.0 * SPHERE_FORCE * SPHERE / (4.0 * MODULUS)) ** (1 / 3))
    cells, width = 24 if quick else 48, 3.0 * hertz
    steps = [
        meeframe.Step(normal_force=SPHERE_FORCE, sliding=0.0),
        meeframe.Step(rolling={"distance": 2.6 * hertz, "creepage": [1.0, 0.0]}),
    ]
    contact = meeframe.Contact(meeframe.IsotropicCoulomb(0.01), wear=meeframe.Archard(COEFFICIENT))
    result = worn(meeframe.Sphere(SPHERE), steps, width, cells, contact=contact)
    x, y = result.zone.points.T[:2]
    behind = np.isclose(x, np.unique(x.round(12))[2])
    depth = result[-1].wear[behind]
    peak = 1.5 * SPHERE_FORCE / (np.pi * hertz**2)
    exact = COEFFICIENT * peak * np.pi / (2.0 * hertz) * np.maximum(hertz**2 - y[behind] ** 2, 0.0)
    error = float(np.abs(depth - exact).max() / exact.max())
    words = f"groove of a slider, {cells} cells"
    yield Check(f"{words}: depth, largest error over the depth", error, 0.0, 0.02, "", True)
    section = float(depth.sum()) * width / cells
    yield Check(f"{words}: cross-section", section, COEFFICIENT * SPHERE_FORCE, 0.01, "m^2")
    curves = (
        Curve("closed form", y[behind] * 1e6, exact * 1e12),
        Curve("computed", y[behind] * 1e6, depth * 1e12, points=True),
    )
    yield Plot("Groove of a slider in one passage", "y [µm]", "depth [pm]", curves)


def roller() -> Iterator[Item]:
    """Check a roller in full slip whose scar, over many cycles, becomes deeper than its elastic approach.

    All lines along the rolling direction then bear the same load, b^3 = 3 k P xi N R / 2 for the half width b.
    """
    hertz = float((3.0 * SPHERE_FORCE * SPHERE / (4.0 * MODULUS)) ** (1 / 3))
    depth, creepage, cells = 3.0 * hertz**2 / SPHERE, 0.5, (16, 32)
    half_width = float(np.sqrt(2.0 * depth * SPHERE))
    cycles = half_width**3 / (1.5 * COEFFICIENT * SPHERE_FORCE * creepage * SPHERE)
    steps = [
        meeframe.Step(normal_force=SPHERE_FORCE, sliding=0.0),
        meeframe.Step(rolling={"steady": True, "creepage": [creepage, 0.0], "cycles": cycles}),
    ]
    contact = meeframe.Contact(meeframe.IsotropicCoulomb(0.2), wear=meeframe.Archard(COEFFICIENT))
    width = (2.2 * hertz, 2.4 * half_width)
    result = worn(meeframe.Sphere(SPHERE), steps, width, cells, contact=contact)
    x, y = result.zone.points.T[:2]
    profile = result[-1].wear[np.isclose(x, x.min())]
    words = f"roller in full slip, worn by 3 elastic approaches, {cells[0]} x {cells[1]} cells"
    section = float(profile.sum()) * width[1] / cells[1]
    yield Check(f"{words}: cross-section", section, COEFFICIENT * SPHERE_FORCE * creepage * cycles, 0.01, "m^2")
    yield Check(f"{words}: deepest point", float(profile.max()), depth, 0.03, "m")
    loads = [float(pressure(result[-1])[np.isclose(y, line)].sum()) for line in np.unique(y.round(12))]
    inner = np.array(loads)[np.abs(np.unique(y.round(12))) < 0.5 * half_width]
    spread = float(np.ptp(inner) / inner.mean())
    yield Check(f"{words}: range of the loads of lines over their mean", spread, 0.0, 0.05, "", True)


def run(quick: bool) -> Iterator[Item]:
    """Check running-in of flat punches, scars of a sphere, the limit of fretting, a groove; a roller if not `quick`."""
    yield from flat_punch(quick)
    yield from spinning_punch(quick)
    yield from scar(quick)
    yield from fretting(quick)
    yield from groove(quick)
    if not quick:
        yield from roller()
