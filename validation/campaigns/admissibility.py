"""Statements of the laws of contact and conduction, written from their formulas in the documentation alone.

Nothing is imported from meeframe. Every function takes the keys of a law as they stand in a case file. A statement is
a pair of conditions on the friction in a node: the traction lies in a set, and it is the one of this set that does the
most work on the slip; or traction and slip obey an explicit formula. Solvers know neither.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Keys = Mapping[str, Any]

MARGIN: Final = 1e-8
"""Uncertainty of pressures, gaps and drops, relative to their units, within which limits are evaluated."""


@dataclass(frozen=True)
class Nodes:
    """State of m nodes: contact pressure, without attraction, and gap, with their units; friction, slip and slip path.

    path: slipped before the increment; duration: of the increment [s].
    """

    pressure: Array
    gap: Array
    friction: Array
    slip: Array
    path: Array
    pressure_unit: float
    length_unit: float
    duration: float | None


def attraction(law: Keys, gap: Array) -> Array:
    """Return the attraction across gaps (m,)."""
    opened = np.maximum(gap, 0.0)
    if law["name"] == "dmt":
        distance = law["equilibrium_distance"]
        return np.asarray(2 * law["work_of_adhesion"] / distance * (1 + opened / distance) ** -3.0)
    if law["name"] == "dugdale":
        stress, width = law["adhesive_stress"], law.get("transition", 0.2)
        reach = law["work_of_adhesion"] / stress
        share = np.interp(opened, [reach * (1 - width / 2), reach * (1 + width / 2)], [0.0, 1.0])
        return np.asarray(stress * (1 - 3 * share**2 + 2 * share**3))
    return np.zeros_like(gap)


def normal_violations(law: Keys, nodes: Nodes) -> dict[str, Array]:
    """Return violations of the normal law, in units of pressure and length, (m,) each."""
    pressure, gap = nodes.pressure / nodes.pressure_unit, nodes.gap / nodes.length_unit
    if law["name"] == "compliant":
        exponent, closure = law.get("exponent", 2.0), law["reference_closure"]
        expected = law["reference_pressure"] * (np.maximum(-nodes.gap, 0.0) / closure) ** exponent
        overlap = closure * (np.maximum(nodes.pressure, 0.0) / law["reference_pressure"]) ** (1 / exponent)
        by_pressure = np.abs(nodes.pressure - expected) / nodes.pressure_unit
        by_gap = np.abs(np.minimum(nodes.gap, 0.0) + overlap) / nodes.length_unit
        return {"tension": np.maximum(-pressure, 0.0), "closure": np.minimum(by_pressure, by_gap)}
    return {
        "tension": np.maximum(-pressure, 0.0),
        "overlap": np.maximum(-gap, 0.0),
        "complementarity": np.minimum(np.abs(pressure), np.abs(gap)),
    }


def friction_violations(law: Keys, nodes: Nodes) -> dict[str, Array]:
    """Return violations of the friction law, in units of pressure, (m,) each.

    Slips shorter than a violation in units of length are no violation: the node sticks to this accuracy.
    """
    name, unit = law["name"], nodes.pressure_unit
    low = np.maximum(nodes.pressure - MARGIN * unit, 0.0)
    high = np.maximum(nodes.pressure, 0.0) + MARGIN * unit
    size = np.hypot(*nodes.friction.T)
    way = np.hypot(*nodes.slip.T)
    if name == "regularised-coulomb":
        return {"friction formula": _regularised(law, nodes, low, high)}
    if name == "non-associated-coulomb":
        return _non_associated(law, nodes, low, high)
    gauge, least, most = _gauge(law, nodes, high), _radius(law, nodes, low), _radius(law, nodes, high)
    outside = np.maximum(gauge - most, 0.0) / unit
    # where the limit jumps, friction of any size up to it must still oppose the slip
    resisted = _support(law, nodes, np.clip(gauge, least, most))
    work = (nodes.friction * nodes.slip).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        lost = np.where(way > 0.0, (resisted - work) / way, 0.0) / unit
    return {
        "friction beyond its limit": np.where(nodes.pressure > -MARGIN * unit, outside, size / unit),
        "friction of an open node": np.where(nodes.pressure <= 0.0, np.minimum(size, _excess(nodes, size)) / unit, 0.0),
        "dissipation": np.minimum(np.maximum(lost, 0.0), way / nodes.length_unit),
    }


def _excess(nodes: Nodes, size: Array) -> Array:
    """Return friction that remains where the pressure is zero within its uncertainty, and jumps are excluded."""
    return np.where(nodes.gap > MARGIN * nodes.length_unit, size, 0.0)


def _coefficient(law: Keys, nodes: Nodes) -> Array | float:
    way = np.hypot(*nodes.slip.T)
    if law["name"] == "slip-weakening":
        weakened = np.clip((nodes.path + way) / law["slip_distance"], 0.0, 1.0)
        return np.asarray(law["mu_static"] + (law["mu_kinetic"] - law["mu_static"]) * weakened)
    if law["name"] == "rate-and-pressure":
        assert nodes.duration is not None
        ratio = (way / nodes.duration / law["reference_speed"]) ** law.get("speed_exponent", 1.0)
        return np.asarray(law["mu_kinetic"] + (law["mu_static"] - law["mu_kinetic"]) * np.exp(-ratio))
    return float(law.get("mu", 0.0))


def _radius(law: Keys, nodes: Nodes, pressure: Array) -> Array:
    """Return the limit (m,) of the gauge of the friction under pressures (m,)."""
    name = law["name"]
    if name == "tresca":
        return np.where(pressure > 0.0, law["limit"], 0.0)
    if name in ("orthotropic-coulomb", "superelliptic-coulomb"):
        return pressure
    mu = _coefficient(law, nodes)
    with np.errstate(invalid="ignore"):
        limit = np.where(pressure > 0.0, mu * pressure, 0.0)
    if name == "rate-and-pressure":
        unit, n = law.get("reference_pressure", 1e6), law.get("pressure_exponent", 1.0)
        return np.asarray(mu * unit * (pressure / unit) ** n)
    if name == "capped-coulomb":
        return np.minimum(limit, law["limit"])
    if name == "dmt-coulomb":
        return np.where(pressure > 0.0, limit + law["mu"] * law["adhesive_pressure"], 0.0)
    return limit


def _gauge(law: Keys, nodes: Nodes, pressure: Array) -> Array:
    """Return the size (m,) of the friction that must not exceed the radius."""
    if law["name"] not in ("orthotropic-coulomb", "superelliptic-coulomb"):
        return np.hypot(*nodes.friction.T)
    along = np.abs(_turned(law, nodes.friction))
    exponent = law.get("exponent", 2.0)
    ratios = along / np.array([law["mu1"], law["mu2"]])
    largest = ratios.max(axis=1)
    shares = np.divide(ratios, largest[:, None], out=np.zeros_like(ratios), where=largest[:, None] > 0.0)
    return np.asarray(largest * np.where(largest > 0.0, (shares**exponent).sum(axis=1), 1.0) ** (1 / exponent))


def _support(law: Keys, nodes: Nodes, radius: Array) -> Array:
    """Return the most work (m,) per area that friction with a gauge up to a radius (m,) does on the slip."""
    if law["name"] not in ("orthotropic-coulomb", "superelliptic-coulomb"):
        way = np.hypot(*nodes.slip.T)
        return np.multiply(radius, way, out=np.zeros_like(way), where=way > 0.0)
    work = np.abs(_turned(law, nodes.slip)) * np.array([law["mu1"], law["mu2"]])
    exponent = law.get("exponent", 2.0)
    largest = work.max(axis=1)
    if exponent == 1.0:
        return np.asarray(radius * largest)
    dual = exponent / (exponent - 1)
    shares = np.divide(work, largest[:, None], out=np.zeros_like(work), where=largest[:, None] > 0.0)
    return np.asarray(radius * largest * np.where(largest > 0.0, (shares**dual).sum(axis=1), 1.0) ** (1 / dual))


def _turned(law: Keys, vectors: Array, key: str = "angle") -> Array:
    angle = law.get(key, 0.0)
    first = np.array([math.cos(angle), math.sin(angle)])
    return np.column_stack([vectors @ first, vectors @ np.array([-first[1], first[0]])])


def _regularised(law: Keys, nodes: Nodes, low: Array, high: Array) -> Array:
    way, unit = np.hypot(*nodes.slip.T), law["slip_length"]
    direction = nodes.slip / np.hypot(way, unit)[:, None]
    errors = []
    for pressure in (low, np.maximum(nodes.pressure, 0.0), high):
        limit = law["mu"] * pressure
        error = np.linalg.norm(nodes.friction - limit[:, None] * direction, axis=1) / nodes.pressure_unit
        # by the slip that belongs to the friction, where the formula is steep
        share = nodes.friction / np.maximum(limit, 1e-300)[:, None]
        rest = 1.0 - (share**2).sum(axis=1)
        slip = unit * share / np.sqrt(np.where(rest > 0.0, rest, np.nan))[:, None]
        by_slip = np.linalg.norm(slip - nodes.slip, axis=1) / nodes.length_unit
        errors.append(np.fmin(error, np.where((rest > 0.0) & (limit > 0.0), by_slip, np.inf)))
    return np.asarray(np.min(errors, axis=0))


def _non_associated(law: Keys, nodes: Nodes, low: Array, high: Array) -> dict[str, Array]:
    way, unit = np.hypot(*nodes.slip.T), nodes.pressure_unit
    half_axes = np.array([law["mu1"], law["mu2"]])
    gauge = np.linalg.norm(_turned(law, nodes.friction) / half_axes, axis=1)
    # friction in slip is along K^2 g: g is normal to an ellipse of half axes 1, slip_ratio there
    axes = np.array([1.0, law.get("slip_ratio", 1.0)])
    direction = _along(law, nodes.slip, axes**2)
    size = np.linalg.norm(_turned(law, direction) / half_axes, axis=1)
    unit_direction = np.divide(direction, size[:, None], out=np.zeros_like(direction), where=size[:, None] > 0.0)
    error = np.linalg.norm(nodes.friction - np.maximum(nodes.pressure, 0.0)[:, None] * unit_direction, axis=1) / unit
    # short slips have uncertain directions: by the slip that belongs to the friction, if that is at its limit
    expected = _along(law, nodes.friction, axes**-2)
    length = np.hypot(*expected.T)
    expected = np.divide(expected, length[:, None], out=np.zeros_like(expected), where=length[:, None] > 0.0)
    slipped = np.maximum((nodes.slip * expected).sum(axis=1), 0.0)
    by_slip = np.linalg.norm(nodes.slip - slipped[:, None] * expected, axis=1) / nodes.length_unit
    below_limit = np.maximum(low - gauge, 0.0) * half_axes.min() / unit
    error = np.minimum(error, np.maximum(by_slip, below_limit))
    return {
        "friction beyond its limit": np.maximum(gauge - high, 0.0) * half_axes.min() / unit,
        "direction of slip": np.where(way > 0.0, np.minimum(error, way / nodes.length_unit), 0.0),
    }


def _along(law: Keys, vectors: Array, factors: Array) -> Array:
    """Return vectors (m, 2) with components along the axes of the slip times factors (2,)."""
    first, second = (_turned(law, vectors, "slip_angle") * factors).T[:, :, None]
    angle = law.get("slip_angle", 0.0)
    return np.asarray(first * [math.cos(angle), math.sin(angle)] + second * [-math.sin(angle), math.cos(angle)])


def conductivity(law: Keys, pressure: Array, touches: NDArray[np.bool_], gap: Array, drop: Array) -> Array:
    """Return kappa (m,) of nodes with pressures, in contact or not, gaps >= 0 and drops, (m,) each."""
    name, p = law["name"], np.maximum(pressure, 0.0)
    if name == "robin":
        return np.full_like(p, law["kappa"])
    if name == "step":
        return np.where(touches, law["kappa"], 0.0)
    if name == "power-law":
        return np.asarray(law["reference_conductivity"] * (p / law["reference_pressure"]) ** law.get("exponent", 0.95))
    if name == "saturating":
        return np.asarray(law["largest_conductivity"] * (1 - np.exp(-p / law["saturation_pressure"])))
    if name == "thresholded":
        return np.asarray(law["contact_conductivity"] * np.clip((p - law["threshold"]) / law["ramp"], 0, 1))
    distance = np.where(touches, 0.0, gap) + law.get("residual_gap", 0.0)
    with np.errstate(divide="ignore"):
        kappa = law["gap_constant"] / distance if law["gap_constant"] > 0.0 else np.zeros_like(distance)
    kappa = kappa + np.where(touches, law.get("contact_conductivity", math.inf), 0.0)
    if name == "breakdown":
        size = np.abs(drop)
        excess = np.maximum(size - law["breakdown_field"] * distance, 0.0)
        kappa = kappa + law["breakdown_conductivity"] * excess / np.where(size > 0.0, size, 1.0)
    return np.asarray(kappa)


def flux_violation(
    law: Keys | None, nodes: Nodes, drop: Array, flux: Array, units: tuple[float, float], share: Array
) -> Array:
    """Return the violation of a conductivity law, in units of drop or of flux, (m,).

    The flux must lie between those of the least and the largest conductivity within the uncertainty of pressures, gaps
    and drops. A node without pressure and gap conducts any fraction of what it does in contact.

    law: None insulates; units: of drops and fluxes; share: fraction (m,) of each node's area that is in contact.
    """
    if law is None or law["name"] == "insulating":
        return np.abs(flux) / units[1]
    margin, length = MARGIN * nodes.pressure_unit, MARGIN * nodes.length_unit
    under = np.isfinite(nodes.gap)
    opened = np.where(under, np.maximum(nodes.gap, 0.0), 0.0)
    presses, closed = nodes.pressure > margin, opened <= length
    change = MARGIN * units[0]
    if law["name"] == "step":
        # the covered part of a node beside the contact edge conducts, even if the node itself is open
        partial = (share > 0.0) & (share < 1.0)
        presses, closed = presses | partial, closed | partial
    least_drop, most_drop = np.maximum(np.abs(drop) - change, 0.0), np.abs(drop) + change
    least = conductivity(law, nodes.pressure - margin, presses, opened + length, least_drop)
    touches = presses | closed
    most = conductivity(law, nodes.pressure + margin, touches, np.maximum(opened - length, 0.0), most_drop)
    if law["name"] == "step":
        # only the covered part of a node conducts without pressure
        least, most = (np.multiply(kappa, share, out=np.zeros_like(kappa), where=share > 0) for kappa in (least, most))
    elif law["name"] == "robin":
        least = np.multiply(least, share, out=np.zeros_like(least), where=share > 0)
    with np.errstate(invalid="ignore"):
        lowest = np.where(under & (least > 0.0), least * least_drop, 0.0)
        highest = np.where(under & (most > 0.0) & (most_drop > 0.0), most * most_drop, 0.0)
    along = flux * np.sign(drop)
    scale = np.maximum(units[1], np.nan_to_num(np.abs(flux)))
    too_little = np.where(np.isinf(lowest), np.abs(drop) / units[0], np.maximum(lowest - along, 0.0) / scale)
    # in terms of the drop, for good conductors
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(least > 0.0, along / least, np.inf)
        by_drop_little = np.where(np.isfinite(needed), np.maximum(np.abs(drop) - needed, 0.0) / units[0], np.inf)
        allowed = np.where(most > 0.0, np.abs(flux) / most, np.inf)
        by_drop_much = np.where(np.isfinite(allowed), np.maximum(allowed - np.abs(drop), 0.0) / units[0], np.inf)
    too_much = np.maximum(along - highest, 0.0) / scale
    against = np.where(np.abs(drop) > change, np.minimum(np.maximum(-along, 0.0) / scale, np.abs(drop) / units[0]), 0.0)
    worst = np.maximum(np.fmin(too_little, by_drop_little), np.fmin(too_much, by_drop_much))
    return np.asarray(np.where(under, np.maximum(worst, against), np.abs(flux) / units[1]))
