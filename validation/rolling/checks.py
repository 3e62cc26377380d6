"""Check rolling: Carter, Bufler, Kalker's creep coefficients, examples of CONTACT, limits, symmetries, work."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from bodies import hertz_radii, roll, steady
from creep_coefficients import COARSEST, FINEST, GRIDS, NAMES, limits, measure
from scipy.optimize import brentq

import meeframe
from meeframe.fields import Array
from meeframe.results.records import Region
from meeframe.results.schema import rolling_totals
from meeframe.study.validate import Check, Curve, Item, Plot

TITLE = "Rolling: Carter, Kalker's coefficients, and CONTACT"
SOURCE = (
    "Carter, Proc. R. Soc. A 112 (1926) 151; Kalker, Three-Dimensional Elastic Bodies in Rolling Contact (1990), table "
    "E.3; Bufler, Ing.-Arch. 27 (1959) 137; Vollebregt, User guide for CONTACT, sections 5.3, 5.5 and 5.8 (printed "
    "results of the open version)."
)
SHEAR, POISSON, FRICTION, HALF_WIDTH, RADIUS = 1e9, 0.3, 0.3, 1e-3, 1.0
FRACTIONS = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
"""Creepages over that at which the whole contact slips."""
PERIOD = 15
"""Period of the surface in widths of the contact; it changes the forces by about 1e-3 of the limit."""
SPHERE, FORCE = 0.1, 1.0
"""Radius [m] of spheres of the distance of equal bodies; normal force [N]."""
CONTACT = float((3.0 * FORCE * SPHERE * (1.0 - POISSON) / (4.0 * SHEAR)) ** (1.0 / 3.0))
"""Radius [m] of their contact."""
KALKER = (4.12, 3.67, 1.47, 1.47, 1.19)
"""C11, C22, C23, C32 and C33 of the circle, nu = 0.25."""
STEEL, ALUMINIUM = (82e9, 0.28), (23e9, 0.31)
"""Shear moduli [Pa] and Poisson's ratios of unlike cylinders, below and above."""
LINE_FORCE, LINE_RADIUS = 16201.9, 25e-3
"""Their normal force per length [N/m], and radius of their distance [m]."""


def carter(fraction: Array) -> Array:
    """Return the force over the limit at a fraction of the creepage of full slip."""
    return np.asarray(1.0 - (1.0 - np.minimum(fraction, 1.0)) ** 2)


def cylinders(across: int) -> tuple[Array, list[float]]:
    """Return forces over the limit and half lengths of the stick zone over that of the contact, for FRACTIONS."""
    spacing, rows = 2.0 * HALF_WIDTH / across, 2
    force = np.pi * SHEAR / (1.0 - POISSON) * HALF_WIDTH**2 / (4.0 * RADIUS) * rows * spacing
    full = FRICTION * HALF_WIDTH / RADIUS
    steps = [meeframe.Step(normal_force=force), *(steady((fraction * full, 0.0)) for fraction in FRACTIONS)]
    nodes = PERIOD * across, rows
    result = roll(SHEAR, POISSON, (spacing, spacing), nodes, (RADIUS, 1e9), FRICTION, steps, periodic=True)
    forces = [meeframe.resultants(result.zone, step).tangential_force[0] for step in result[1:]]
    sticks = [float((step.region == Region.STICK).sum() / step.touching.sum()) for step in result[1:]]
    return np.array(forces) / (FRICTION * force), sticks


def from_cattaneo() -> Iterator[Item]:
    """Check example catt_to_cart of CONTACT: a tangential force at rest, then rolling under it."""
    spacing, friction, force, radius = 0.25e-3, 0.4013, 0.4705, 1.0 / (2.0 * 2.963)
    steps = [
        meeframe.Step(normal_force=force),
        meeframe.Step(tangential_force=[0.657 * friction * force, 0.0]),
        meeframe.Step(rolling={"distance": spacing}),
        steady(),
    ]
    result = roll(1e6, 0.28, (spacing, spacing), (34, 33), (radius, radius), friction, steps, -0.5 * spacing)
    _, shift, first, end = result
    words = "constant force, 34 x 33 nodes as in CONTACT"
    yield Check(f"{words}: shift at rest [mm]", 1e3 * shift.loading.translation[0], 1.774e-2, 3e-4)
    for step, reference, when in ((first, 1.824e-3, "after one cell"), (end, 3.101e-3, "in the steady state")):
        creepage = rolling_totals(result.zone, step)["creepage"][0]
        yield Check(f"{words}: creepage {when}", float(creepage), reference, 3e-4)
    for step, reference, when in ((shift, 305, "at rest"), (first, 422, "after one cell"), (end, 346, "steady")):
        sticking = int((step.region == Region.STICK).sum())
        yield Check(f"{words}: sticking nodes {when}", float(sticking), float(reference), 0.5, absolute=True)


def ellipse() -> Iterator[Item]:
    """Check example tractcurv of CONTACT: the creep curve of an ellipse 1 : 2, and the balance of work on it."""
    shear, poisson, friction, force, radius_x = 82e9, 0.28, 0.33, 106.7e3, 0.625
    radii = partial(hertz_radii, force=force, shear_modulus=shear, poisson_ratio=poisson)
    a = float(brentq(lambda half_axis: radii((half_axis, 2.0 * half_axis))[0] - radius_x, 1e-3, 1e-2))
    printed = {8e-4: 0.4742, 1.6e-3: 0.7831, 2.4e-3: 0.9467}
    creepages = [*printed, 4e-3, 1e-2]
    steps = [meeframe.Step(normal_force=force), *(steady((creepage, 0.0)) for creepage in creepages)]
    spacing = 2.2 * a / 48, 4.4 * a / 44
    result = roll(shear, poisson, spacing, (48, 44), radii((a, 2.0 * a)), friction, steps)
    numbers = [rolling_totals(result.zone, step) for step in result[1:]]
    forces = np.array([each["creep_force"][0] for each in numbers]) / (friction * force)
    words = "ellipse 1 : 2, 48 x 44 nodes as in CONTACT"
    for (creepage, reference), computed in zip(printed.items(), forces, strict=False):
        yield Check(f"{words}: F / mu N at xi = {creepage:g}", float(computed), reference, 1e-4, absolute=True)
    yield Check(f"{words}: F / mu N at xi = {creepages[-1]:g}", float(forces[-1]), 1.0, 1e-3)
    balance = max(abs(each["friction_work"] / each["creep_work"] - 1.0) for each in numbers)
    yield Check(f"{words}: work of friction over force times creepage - 1", balance, 0.0, 1e-9, absolute=True)
    curve = Curve("computed", np.array(creepages), forces, points=True)
    contact = Curve("CONTACT", np.array(list(printed)), np.array(list(printed.values())), points=True)
    yield Plot("Creep curve of an ellipse 1 : 2", "creepage", "F / (mu N)", (curve, contact))


def unlike_cylinders(friction: float, spacing: float, nodes: int) -> tuple[float, float]:
    """Return the creepage and the largest pressure [Pa] of unlike cylinders that roll without a tangential force.

    They touch along 1 m, which two rows of nodes at its ends share, so that strains are plane.
    """
    steps = [meeframe.Step(normal_force=LINE_FORCE), meeframe.Step(tangential_force=[0.0, 0.0]), steady()]
    radii = LINE_RADIUS, 1e9
    result = roll(*STEEL, (spacing, 1.0), (nodes, 2), radii, friction, steps, other=ALUMINIUM)
    creepage = rolling_totals(result.zone, result[-1])["creepage"][0]
    return float(creepage), -float(result[-1].traction[:, 2].min())


def free_rolling(quick: bool) -> Iterator[Item]:
    """Check example bentall of CONTACT, and Bufler's solution without slip, of which the creepage is a closed form.

    Both tractions, p + i q, then solve one singular integral equation with Dundurs' constant beta, and are bounded at
    both ends of the contact: they are p0 cosh(pi eps) (1 - x)^(1/2 + i eps) (1 + x)^(1/2 - i eps) in half widths a,
    with tanh(pi eps) = beta and p0 = E* a / 2 R. The force is pi a p0 (1 + 4 eps^2) / 2, the creepage 2 eps a / R.
    """
    words = "unlike cylinders without tangential force, 200 nodes across as in CONTACT"
    values = (1e-4, 5.260e-4, 103.1), (0.05, 4.294e-4, 103.6), (10.0, 3.591e-4, 103.8)
    for friction, printed, peak in values[2:] if quick else values:
        creepage, pressure = unlike_cylinders(friction, 1e-6, 216)
        yield Check(f"{words}, friction coefficient {friction:g}: creepage", creepage, -printed, 2e-4)
        yield Check(f"{words}, friction coefficient {friction:g}: largest pressure [MPa]", pressure / 1e6, peak, 1e-3)
    modulus = 2.0 / sum((1.0 - poisson) / shear for shear, poisson in (STEEL, ALUMINIUM))
    below, above = ((1.0 - 2.0 * poisson) / shear for shear, poisson in (STEEL, ALUMINIUM))
    dundurs = (above - below) * modulus / 4.0
    exponent = np.arctanh(dundurs) / np.pi
    half_width = np.sqrt(4.0 * LINE_FORCE * LINE_RADIUS / (np.pi * modulus * (1.0 + 4.0 * exponent**2)))
    grids = (25, 50) if quick else (100, 200)
    creepages, pressures = zip(
        *(unlike_cylinders(10.0, 2.0 * half_width / across, across + 8) for across in grids), strict=True
    )
    coarse, fine = (np.log(across) / across for across in grids)  # errors of a spacing h decrease as h log h
    limit = (coarse * creepages[1] - fine * creepages[0]) / (coarse - fine)
    words = f"unlike cylinders without slip, {grids[0]} and {grids[1]} nodes across"
    yield Check(f"{words}, extrapolated: creepage", limit, -2.0 * exponent * half_width / LINE_RADIUS, 3e-3)
    peak = modulus * half_width / (2.0 * LINE_RADIUS) / np.sqrt(1.0 - dundurs**2)
    yield Check(f"{words}: largest pressure on the finer grid", pressures[1], peak, 1e-3, "Pa")


def spheres(across: int, steps: Sequence[meeframe.Step]) -> meeframe.Result:
    """Return the result of equal spheres whose contact is so many nodes across, half of the zone."""
    spacing, nodes = (2.0 * CONTACT / across,) * 2, (2 * across,) * 2
    return roll(SHEAR, POISSON, spacing, nodes, (SPHERE, SPHERE), FRICTION, [meeframe.Step(normal_force=FORCE), *steps])


def limits_of_creepage() -> Iterator[Item]:
    """Check that forces grow with creepages to full slip, and the limit of large spin, which has no force."""
    across, largest = 20, FRICTION * CONTACT / SPHERE
    fractions = np.array([0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 5.0, 20.0])
    for axis, name in enumerate(("longitudinal", "lateral")):
        creepages = np.eye(2)[axis] * largest * fractions[:, None]
        result = spheres(across, [steady(tuple(each)) for each in creepages])
        forces = np.array([meeframe.resultants(result.zone, step).tangential_force[axis] for step in result[1:]])
        words = f"spheres, {across} nodes across, {len(fractions)} {name} creepages"
        falls = np.count_nonzero(np.diff(forces) <= 0.0)
        yield Check(f"{words}: pairs at which the force does not grow", float(falls), 0.0, 0.5, absolute=True)
        yield Check(f"{words}: F / mu N at the largest", float(forces[-1]) / (FRICTION * FORCE), 1.0, 1e-3)
    grids, numbers = (across, 2 * across), []
    for each in grids:
        result = spheres(each, [steady((0.0, 0.0), spin=spin) for spin in (1.0 / SPHERE, 1e3 / SPHERE)])
        numbers.append([meeframe.resultants(result.zone, step) for step in result[1:]])
    words = f"spheres, pure spin, {grids[0]} and {grids[1]} nodes across, extrapolated"
    forces = 2.0 * numbers[1][1].tangential_force - numbers[0][1].tangential_force
    lateral = float(forces[1]) / (FRICTION * FORCE)
    yield Check(f"{words}: lateral F / mu N at large spin", lateral, 0.0, 0.01, absolute=True)
    torque = 3.0 * np.pi / 16.0 * FRICTION * FORCE * CONTACT
    extrapolated = 2.0 * numbers[1][1].torque - numbers[0][1].torque
    yield Check(f"{words}: torque at large spin", extrapolated, torque, 0.02, "N m")
    along = float(numbers[1][0].tangential_force[0]) / (FRICTION * FORCE)
    words = f"spheres, pure spin, {grids[1]} nodes across, phi R = 1: F / mu N along the direction"
    yield Check(words, along, 0.0, 1e-8, absolute=True)


def steady_limits() -> Iterator[Item]:
    """Check that steady rolling is the limit of transient cells, and its symmetries."""
    across = 12
    largest, cells = FRICTION * CONTACT / SPHERE, 10 * across
    creepage, spin = np.array([0.5, 0.3]) * largest, 0.5 * largest / CONTACT
    spacing = 2.0 * CONTACT / across
    rolls = {"creepage": list(creepage), "spin": spin}
    *_, last = spheres(across, [meeframe.Step(rolling={"distance": cells * spacing, **rolls})])
    result = spheres(across, [steady(list(creepage), spin)])
    limit, shape = result[-1].traction, (2 * across, 2 * across, 3)
    scale = float(np.abs(limit[:, :2]).max())
    words = f"spheres, creepages and spin, {across} nodes across"
    error = float(np.abs(last.traction - limit).max()) / scale
    yield Check(f"{words}: steady state, largest difference from {cells} cells", error, 0.0, 1e-6, absolute=True)
    order = np.lexsort((result.zone.points[:, 1].round(12), result.zone.points[:, 0].round(12)))
    field = limit[order].reshape(shape)
    backward = meeframe.Step(rolling={"steady": True, "direction": [-1.0, 0.0], **rolls})
    opposite = spheres(across, [backward])[-1].traction[order].reshape(shape)[::-1, ::-1] * [-1.0, -1.0, 1.0]
    error = float(np.abs(opposite - field).max()) / scale
    yield Check(f"{words}: reversed direction, difference after half a turn", error, 0.0, 1e-7, absolute=True)
    mirrored = spheres(across, [steady(list(creepage * [1.0, -1.0]), -spin)])[-1].traction[order].reshape(shape)
    error = float(np.abs(mirrored[:, ::-1] * [1.0, -1.0, 1.0] - field).max()) / scale
    yield Check(f"{words}: mirrored creepage and spin, difference of the image", error, 0.0, 1e-7, absolute=True)


def run(quick: bool) -> Iterator[Item]:
    """Check forces and stick zones of cylinders, coefficients of a circle, examples of CONTACT; limits if not `quick`.

    Forces of given creepages are accurate to first order in the spacing, and extrapolated from two grids.
    """
    across = (16, 32) if quick else (40, 80)
    (coarse, _), (fine, sticks) = map(cylinders, across)
    exact, words = carter(np.array(FRACTIONS)), f"cylinders, {across[0]} and {across[1]} nodes across"
    for fraction, computed, reference in zip(FRACTIONS, 2.0 * fine - coarse, exact, strict=True):
        name = f"{words}, extrapolated: F / mu N at {fraction:g} of full slip"
        yield Check(name, float(computed), float(reference), 0.005, absolute=True)
    for fraction, stick in zip(FRACTIONS[:-2], sticks, strict=False):
        name = f"cylinders, {across[1]} nodes across: part of the contact that sticks at {fraction:g} of full slip"
        yield Check(name, stick, 1.0 - fraction, 1.0 / across[1], absolute=True)
    curves = (
        Curve("Carter", np.linspace(0.0, FRACTIONS[-1], 100), carter(np.linspace(0.0, FRACTIONS[-1], 100))),
        Curve("computed", np.array(FRACTIONS), fine, points=True),
    )
    yield Plot(f"Creep curve of cylinders, {across[1]} nodes across", "creepage of full slip", "F / (mu N)", curves)
    grids, finest = (10, 64.0) if quick else (GRIDS, FINEST)
    values, _ = limits(measure(1.0, 0.25, grids, finest=finest))
    for name, computed, reference in zip(NAMES, values, KALKER, strict=True):
        words = f"circle, nu = 0.25: {name}, extrapolated from {grids} grids, {COARSEST:g} to {finest:g} nodes across"
        yield Check(words, float(computed), reference, 0.01)
    yield from from_cattaneo()
    yield from ellipse()
    yield from free_rolling(quick)
    if not quick:
        yield from limits_of_creepage()
        yield from steady_limits()
