"""Largest tension and shear on the interfaces of a layered body, which delamination depends on."""

from typing import Final, NamedTuple

import numpy as np

from meeframe.common.literal import LiteralTable
from meeframe.fields import Array
from meeframe.results.interior import Body, Maximum, contact_extent, interior
from meeframe.results.records import StepResult, Zone
from meeframe.system.reduced import Progress, ReducedSystem, silent

_DEPTHS_AROUND: Final = 2.0
"""Width of the sampled area around the contact, in depths of the interface: stresses of a point load peak at half of
one."""
_MAX_ZONE_WIDTHS: Final = 3.9
"""Half width of that area, in widths of the zone: fields inside a half space are limited to four."""
_SAMPLES_PER_DEPTH: Final = 3.0
_ROUND_OFF: Final = 1e-9
"""Coordinates this small relative to the depth are printed as zero."""
_MIN_SAMPLES, _MAX_SAMPLES = 17, 129
_REFINED: Final = 12
"""Samples per spacing around the largest values."""


class InterfaceMaxima(NamedTuple):
    """Largest tractions on an interface of a layered body.

    Attributes
    ----------
    number
        Number of the layer above the interface, from 1 at the surface.
    depth
        Depth of the interface below the surface [m].
    tension
        Largest normal traction [Pa]; not positive if the interface is compressed everywhere.
    shear
        Largest tangential traction [Pa].
    """

    number: int
    depth: float
    tension: Maximum
    shear: Maximum


def interface_maxima(
    system: ReducedSystem,
    zone: Zone,
    step: StepResult,
    depths: Array,
    extent: Array,
    *,
    body: Body = "first",
    progress: Progress = silent,
) -> list[InterfaceMaxima]:
    """Return the largest tension and shear on interfaces after an increment.

    Tractions are sampled on a grid, on an area wider than the contact by twice the depth of the interface on each side,
    but not farther from the zone than four of its widths, and then on finer grids around the largest values.

    Parameters
    ----------
    system
        The reduced system.
    zone
        Its contact zone.
    step
        The increment.
    depths
        Depths of the interfaces below the surface, (i,) [m].
    extent
        Points of the body, (n, 3) [m], among which samples lie along the surface.
    body
        "first" or "second" of two bodies in contact, see `meeframe.results.interior.interior`.
    progress
        Function that receives a stage and the fraction done.

    Raises
    ------
    ResultError
        If no node is in contact.
    CaseError
        As `meeframe.results.interior.interior`.
    """
    centre, frame, half_width, spacing = contact_extent(zone, step)
    along = (extent - centre) @ frame[:2].T
    nodes = (zone.points - centre) @ frame[:2].T
    middle, widest = (nodes.max(axis=0) + nodes.min(axis=0)) / 2.0, _MAX_ZONE_WIDTHS * np.ptp(nodes, axis=0).max()
    low, high = np.maximum(along.min(axis=0), middle - widest), np.minimum(along.max(axis=0), middle + widest)
    inwards = frame[2] if body == "second" else -frame[2]

    def tractions(positions: Array, depth: float) -> Array:
        """Return tension and shear (2, m) at positions (m, 2) along the surface."""
        points = centre + positions @ frame[:2] + depth * inwards
        traction = interior(system, step, points, body=body, progress=progress).stress @ frame[2]
        tension = traction @ frame[2]
        return np.stack([tension, np.linalg.norm(traction - tension[:, None] * frame[2], axis=1)])

    maxima, offsets = [], np.arange(-_REFINED, _REFINED + 1) / _REFINED
    for number, depth in enumerate(depths.tolist(), 1):
        extent = half_width + _DEPTHS_AROUND * depth
        first, last = np.maximum(low, -extent), np.minimum(high, extent)
        finest = max(depth / _SAMPLES_PER_DEPTH, 0.5 * spacing)
        counts = np.clip(np.ceil((last - first) / finest) + 1.0, _MIN_SAMPLES, _MAX_SAMPLES).astype(int)
        steps = (last - first) / (counts - 1)
        positions = _grid(*(np.linspace(*ends) for ends in zip(first, last, counts, strict=True)))
        values = tractions(positions, depth)
        best = positions[values.argmax(axis=1)]
        around = np.clip(best[:, None] + steps * _grid(offsets, offsets), first, last)
        values = tractions(around.reshape(-1, 2), depth).reshape(2, 2, -1)[[0, 1], [0, 1]]
        best, largest = around[[0, 1], values.argmax(axis=1)], values.max(axis=1)
        points = centre + best @ frame[:2] + depth * inwards
        named = zip(("tension", "shear"), largest.tolist(), points, strict=True)
        maxima.append(
            InterfaceMaxima(number, depth, *(Maximum(name, value, "Pa", point) for name, value, point in named))
        )
    return maxima


def interfaces_table(interfaces: list[InterfaceMaxima]) -> LiteralTable:
    """Return a table for the terminal with the largest tension and shear on each interface, and their positions."""
    table = LiteralTable("largest tractions on interfaces")
    for header in ("below layer", "depth [m]", "", "unit", "value", "x [m]", "y [m]", "z [m]"):
        table.add_column(header)
    for number, depth, *maxima in interfaces:
        for name, value, unit, position in maxima:
            numbers = (f"{0.0 if abs(x) < _ROUND_OFF * depth else x:.4g}" for x in position.tolist())
            table.add_row(str(number), f"{depth:.4g}", name, unit, f"{value:.6g}", *numbers)
    return table


def _grid(x: Array, y: Array) -> Array:
    """Return the points (n, 2) of a rectangular grid."""
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
