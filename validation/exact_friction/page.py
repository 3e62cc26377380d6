"""The page of the exact checks with friction, from rows of numbers."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from elements import PUNCH_POISSON, SPHERE_POISSON, DragRow
from study import FRICTION, ZONE, BondedRow, Loop, Pressed, SlipRow

from meeframe.testing.closed_forms_friction import FullStick, bonding_factor

_STATE: Final = ("stick radius", "traction", "everywhere", "r.m.s.")


@dataclass(frozen=True)
class LoopRow:
    """A loop up to a displacement over the limit: differences, relative, of force, area and dissipation."""

    poisson: float
    goodman: bool
    cells: int
    turning: float
    curve: float
    area: float
    dissipation: float


def loop_row(loop: Loop) -> LoopRow:
    """The numbers of a loop."""
    turning = float(loop.displacement[0])
    area, dissipation = loop.area - 1.0, loop.dissipation - 1.0
    return LoopRow(loop.poisson, loop.goodman, loop.cells, turning, loop.curve, area, dissipation)


@dataclass(frozen=True)
class StickRow:
    """Sphere or cone pressed in under full stick: differences, relative, of force and stiffness; exact ratios of force
    at the same approach, and of stiffness over contact radius, to those without friction."""

    shape: str
    poisson: float
    cells: int
    force: float
    stiffness: float
    force_ratio: float
    stiffness_ratio: float


def stick_row(pressed: Pressed) -> StickRow:
    """The numbers of a path; at nu = 1/2 there is nothing for friction to do."""
    exact, last = pressed.exact, float(pressed.approach[-1])
    # the same modulus without coupling: E* of nu = 1/2 is 4/3 E
    free = FullStick(0.75 * exact.young / (1.0 - exact.poisson**2), 0.5, exact.power, exact.coefficient)
    return StickRow(
        "sphere" if exact.power == 2 else "cone",
        exact.poisson,
        pressed.cells,
        pressed.force_difference,
        pressed.stiffness_difference,
        exact.force(last) / free.force(last),
        bonding_factor(exact.poisson),
    )


@dataclass(frozen=True)
class TwistRow:
    """Torque over twist without slip, relative difference."""

    cells: int
    stiffness: float


def write(name: str, rows: dict[str, list[Any]]) -> str:
    """The page; keys of rows as in regenerate.py."""
    parts = (
        _head(name),
        _partial_slip(name, rows["partial_slip"]),
        _loops(name, rows["loops"]),
        _punch(name, rows["bonded_punch"]),
        _pressed(rows["full_stick"]),
        _torsion(name, rows["torsion"], rows["twist_stiffness"]),
        _elements(rows["drag_on_elements"], rows["torsion_on_elements"], rows["punch_on_elements"]),
    )
    return "\n".join(line for part in parts for line in part) + "\n"


def _head(name: str) -> Iterator[str]:
    yield f"""# Friction against closed forms

A rigid indenter on an isotropic elastic half space. The reduced system is exact up to its densities, which are constant
on square cells (`meeframe.testing.elastic_half_space`, Boussinesq and Cerruti with all couplings), or comes from
boundary elements (last section). Contact laws and solver are those of every case; the closed forms are in
`meeframe.testing.closed_forms_friction`. All differences are relative, in per cent, computed minus exact. All numbers
and pictures of this page: `uv run python validation/{name}/regenerate.py`.

Goodman's approximation drops the coupling of normal and tangential directions. With it, or with ν = 1/2, where there is
no such coupling, normal force and contact radius do not change under tangential loads, as the closed forms of partial
slip assume. They also assume slip along the load everywhere, which is exact for ν = 0 only.
"""


def _partial_slip(name: str, rows: list[SlipRow]) -> Iterator[str]:
    finest = max(row.cells for row in rows)
    yield f"""## Cattaneo and Mindlin: partial slip

A sphere under a constant normal force P, μ = {FRICTION:g}, moved to the displacement that belongs to Q; the square of
cells is {ZONE:g} a wide, a: contact radius. The stick radius c is found in two ways. By area: that of the circle with
the area of the sticking cells, which counts whole cells, so that small discs are known to a part of a cell only. By
reserve: the closed form leaves μp - |t| in proportion to the root of c² - r², whose mean of r² is 2/5 c²; cells enter
with what they carry, and the measure is finer than they are. Tractions are compared at the cells' centres, relative to
the largest exact one: the largest difference without one cell either side of contact and stick radius, where the exact
traction has vertical tangents, the largest one everywhere, and the root mean square over the contact.

![Tractions and stick radius]({name}_partial_slip.png)

Dots: all cells; lines: closed form; numbers: Q / μP.
"""
    shown = [row for row in rows if row.cells == finest or row.share == 0.6]
    header = ("half space", "cells", "Q / μP", "Q", "stick radius by reserve", "by area", *_STATE[1:])
    yield from _table(
        header,
        (
            (_body(r), _grid(r.cells), f"{r.share:g}", _percent(r.load), _percent(r.stick_moment or 0.0), *_state(r))
            for r in shown
        ),
    )
    fine = [row for row in rows if row.cells == finest]
    fields = ("stick_moment", "stick_radius", "traction", "load", "traction_everywhere", "traction_rms")
    stick, area, traction, load, everywhere, rms = (_worst(fine, field) for field in fields)
    yield f"""
Largest of all loads with {_grid(finest)} cells: stick radius {stick} % by reserve and {area} % by area, force {load} %,
traction {traction} % without one cell either side of the two radii, {everywhere} % everywhere, {rms} % r.m.s. Asked for
at 32 x 32: stick radius within 2 %, traction within 3 % of its maximum. **The 3 % is met without the cells at the two
radii only.** In those cells the traction differs by more, the more so the thinner the slipping ring: a density that is
constant on a cell cannot follow a vertical tangent.
"""


def _loops(name: str, rows: list[LoopRow]) -> Iterator[str]:
    yield f"""## A full reversal and its dissipation

The displacement goes up to {rows[0].turning:.2f} of the limit of sliding, to the opposite value and back in steps.
Area: work of the indenter in the loop; dissipation: work of the tractions at the end of each step on its slip, which
is of first order in the steps while the pressure changes, and here it does not or hardly; both against Mindlin and
Deresiewicz. Q: largest difference in the loop over its largest value.

![The loop and the convergence of its work]({name}_loop.png)
"""
    header = ("half space", "cells", "Q", "area", "dissipation")
    yield from _table(
        header,
        ((_body(r), _grid(r.cells), f"{100 * r.curve:.2f}", _percent(r.area), _percent(r.dissipation)) for r in rows),
    )
    yield """
Area and dissipation differ from each other by the integration over the steps of the loop. Both carry the error of the
grid, which jumps as circles of cells join or leave the stick zone.
"""


def _punch(name: str, rows: list[BondedRow]) -> Iterator[str]:
    yield f"""## Full stick: flat punch

μ = ∞, all couplings: the load is c = (1 - ν) ln(3 - 4ν)/(1 - 2ν) times the frictionless one. Both are computed on the
same cells, so that the error of the outline, cells under a circle, drops out; the rest falls with the size of the
cells, and is extrapolated from the two finest grids on that assumption.

![Contact stiffness, and the flat punch's factor]({name}_full_stick.png)
"""
    yield from _table(("ν", "cells", "bonded / frictionless", "c", "difference"), _punch_rows(rows))
    yield ""


def _punch_rows(rows: list[BondedRow]) -> Iterator[tuple[str, ...]]:
    for poisson in sorted({row.poisson for row in rows}):
        own = sorted((row for row in rows if row.poisson == poisson), key=lambda row: row.cells)
        for row in own:
            yield (f"{poisson:g}", _grid(row.cells), f"{row.ratio:.5f}", f"{row.factor:.5f}", _percent(row.difference))
        first, second = own[-2:]
        limit = (second.cells * second.ratio - first.cells * first.ratio) / (second.cells - first.cells)
        yield (
            f"{poisson:g}",
            "extrapolated",
            f"{limit:.5f}",
            f"{second.factor:.5f}",
            _percent(limit / second.factor - 1),
        )


def _pressed(rows: list[StickRow]) -> Iterator[str]:
    yield """## Full stick: sphere and cone pressed in little by little

Points stick where they touch; the contact radius grows in as many steps as there are cells along a side. Contact
stiffness dP/dg = 2 c E* a (Mossakovskii, Spence), averaged over the second half of the path, and force at its end.
The exact contact radius follows from the surface beside a bonded punch (`FullStick`); ratios are exact ones, to the
same indenter without friction: of the stiffness at the same radius, c, and of the force at the same approach.
"""
    header = ("indenter", "ν", "cells", "dP/dg", "ratio", "P", "ratio")
    table = []
    for r in rows:
        stiffness, force = (
            (_percent(r.stiffness), f"{r.stiffness_ratio:.4f}"),
            (_percent(r.force), f"{r.force_ratio:.4f}"),
        )
        table.append((r.shape, f"{r.poisson:g}", _grid(r.cells), *stiffness, *force))
    yield from _table(header, table)
    yield ""


def _torsion(name: str, rows: list[SlipRow], stiffness: list[TwistRow]) -> Iterator[str]:
    finest = max(row.cells for row in rows)
    yield f"""## Torsion of a sphere

The sphere is pressed in first, then turned about its axis until c/a of the radius sticks (Lubkin); ν = 1/2.

![Tractions, and torque over twist]({name}_torsion.png)
"""
    shown = [row for row in rows if row.cells == finest or row.share == 0.6]
    header = ("cells", "c / a", "torque", *_STATE)
    yield from _table(header, ((_grid(r.cells), f"{r.share:g}", _percent(r.load), *_state(r)) for r in shown))
    yield """
Without slip (μ = ∞) torque over twist is 16 G a³/3. The tractions are then singular at the edge, and the outline of
the cells, which are in contact or are not, enters with its third power:
"""
    yield from _table(("cells", "torque / twist"), ((_grid(r.cells), _percent(r.stiffness)) for r in stiffness))
    yield ""


def _elements(drags: list[DragRow], twists: list[SlipRow], punches: list[BondedRow]) -> Iterator[str]:
    yield f"""## The same on boundary elements

The whole chain from case files (`sphere.toml`, `torsion.toml`, `punch.toml`): bilinear elements on the plane that
bounds the half space, all couplings in force, ν = {SPHERE_POISSON:g} (nearly incompressible) under the spheres and
{PUNCH_POISSON:g} under the bonded punch. Forces on the first sphere are prescribed, in one step each: P, then
Q = 0.6 μP, its opposite, and Q again. What is compared are approach, displacement, displacement at -Q, and dissipation
in the loop.
"""
    header = ("elements in a", "approach", "displacement", "at -Q", "dissipation", *_STATE)
    table = []
    for d in drags:
        loads = (d.approach, d.row.load, d.turned, d.dissipation)
        table.append((f"{d.per_radius:.1f}", *map(_percent, loads), *_state(d.row)))
    yield from _table(header, table)
    tractions = [100 * d.row.traction for d in drags]
    everywhere = [100 * d.row.traction_everywhere for d in drags]
    rms = [100 * d.row.traction_rms for d in drags]
    yield f"""
**Nodal tractions do not come within 3 % here**, neither everywhere ({_range(everywhere)} %) nor without one
element either side of the two radii ({_range(tractions)} %); nor does their root mean square ({_range(rms)} %), but it
falls with the size of the elements. Forces and displacements agree far better: nodal values of a bilinear
interpolation swing about the peak at the stick radius and the edge of the contact. That does not fade as the elements
shrink, its share of the area does. The slipping ring is two to three elements wide, and its dissipation jumps by a
per cent or two as circles of nodes join it; on cells it does the same.
"""
    yield "Torsion: the twist is prescribed, the torque compared. Then the bonded punch.\n"
    header = ("elements in a side", "c / a", "torque", *_STATE)
    yield from _table(header, ((f"{t.cells}", f"{t.share:.2f}", _percent(t.load), *_state(t)) for t in twists))
    yield ""
    header = ("elements in a side", "bonded / frictionless", "c", "difference", "frictionless load")
    yield from _table(
        header,
        (
            (f"{p.cells}", f"{p.ratio:.5f}", f"{p.factor:.5f}", _percent(p.difference), _percent(p.frictionless))
            for p in punches
        ),
    )


def _table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    yield "| " + " | ".join(header) + " |"
    yield "| --- " * len(header) + "|"
    for row in rows:
        yield "| " + " | ".join(row) + " |"


def _state(row: SlipRow) -> tuple[str, ...]:
    tractions = (row.traction, row.traction_everywhere, row.traction_rms)
    return _percent(row.stick_radius), *(f"{100 * value:.2f}" for value in tractions)


def _range(values: list[float]) -> str:
    return f"{min(values):.1f} to {max(values):.1f}"


def _body(row: SlipRow | LoopRow) -> str:
    return f"ν = {row.poisson:g}" + (", Goodman" if row.goodman else "")


def _grid(cells: int) -> str:
    return f"{cells} x {cells}"


def _percent(value: float) -> str:
    return f"{100 * value:+.2f}"


def _worst(rows: list[SlipRow], name: str) -> str:
    return f"{100 * max(abs(getattr(row, name)) for row in rows):.2f}"
