"""Write the page on friction against closed forms from rows of numbers."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from elements import PUNCH_POISSON, SPHERE_POISSON, DragRow
from study import FRICTION, ZONE, BondedRow, Loop, Pressed, SlipRow

from meeframe.testing.closed_forms_friction import FullStick, bonding_factor

_STATE: Final = ("stick radius", "traction", "everywhere", "r.m.s.")


@dataclass(frozen=True)
class LoopRow:
    """A loop up to a displacement relative to the limit, with relative differences of force, area and dissipation."""

    poisson: float
    goodman: bool
    cells: int
    turning: float
    curve: float
    area: float
    dissipation: float


def loop_row(loop: Loop) -> LoopRow:
    """Return the numbers of a loop."""
    turning = float(loop.displacement[0])
    area, dissipation = loop.area - 1.0, loop.dissipation - 1.0
    return LoopRow(loop.poisson, loop.goodman, loop.cells, turning, loop.curve, area, dissipation)


@dataclass(frozen=True)
class StickRow:
    """Sphere or cone pressed in under full stick.

    Relative differences of force and stiffness; exact ratios of the force at the same approach, and of the stiffness at
    the same contact radius, to those without friction.
    """

    shape: str
    poisson: float
    cells: int
    force: float
    stiffness: float
    force_ratio: float
    stiffness_ratio: float


def stick_row(pressed: Pressed) -> StickRow:
    """Return the numbers of a path; friction has no effect at nu = 1/2."""
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
    """Relative difference of the torsional stiffness without slip."""

    cells: int
    stiffness: float


def write(name: str, rows: dict[str, list[Any]]) -> str:
    """Return the page; rows has the keys of regenerate.py."""
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

This page compares contact of a rigid indenter and an isotropic elastic half space with closed forms. The reduced system
is exact for densities that are constant on square cells (`meeframe.testing.elastic_half_space`, Boussinesq and Cerruti
with all couplings), or it comes from boundary elements (last section). Contact laws and solver are those of every case;
the closed forms are in `meeframe.testing.closed_forms_friction`. All differences are relative, in per cent, computed
minus exact. To regenerate the numbers and figures, run `uv run python validation/{name}/regenerate.py`.

Goodman's approximation neglects the coupling of normal and tangential directions. With it, or with ν = 1/2, where this
coupling vanishes, normal force and contact radius do not change under tangential loads, as the closed forms of partial
slip assume. They also assume slip along the load everywhere, which is exact for ν = 0 only.
"""


def _partial_slip(name: str, rows: list[SlipRow]) -> Iterator[str]:
    finest = max(row.cells for row in rows)
    yield f"""## Cattaneo and Mindlin: partial slip

A sphere under a constant normal force P, with μ = {FRICTION:g}, is moved to the displacement that corresponds to Q.
The square of cells is {ZONE:g} a wide, where a is the contact radius. The stick radius c is computed in two ways. *By
area*, it is the radius of the circle with the area of the sticking cells; whole cells are counted, so small discs are
resolved only to a fraction of a cell. *By margin*, it follows from the margin to the friction limit: in the closed
form, μp - |t| is proportional to the square root of c² - r², so the mean of r² weighted with it is 2/5 c². Cells are
weighted with their margin, which resolves less than a cell. Tractions are compared at the centres of cells, relative
to the largest exact one, in three ways: the largest difference except within one cell of contact and stick radius,
where the exact traction has vertical tangents; the largest difference everywhere; and the root mean square over the
contact.

![Tractions and stick radius]({name}_partial_slip.png)

Dots: all cells; lines: closed form; numbers: Q / μP.
"""
    shown = [row for row in rows if row.cells == finest or row.share == 0.6]
    header = ("half space", "cells", "Q / μP", "Q", "stick radius by margin", "by area", *_STATE[1:])
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
The largest differences over all loads with {_grid(finest)} cells are: stick radius {stick} % by margin and {area} % by
area, force {load} %, traction {traction} % except within one cell of the two radii, {everywhere} % everywhere, {rms} %
r.m.s. In the cells at the two radii, the traction differs by more than 3 % of its maximum, increasingly so for thinner
slipping annuli: a density that is constant on a cell cannot represent a vertical tangent.
"""


def _loops(name: str, rows: list[LoopRow]) -> Iterator[str]:
    yield f"""## A full reversal and its dissipation

The displacement increases to {rows[0].turning:.2f} of the sliding limit, reverses to the opposite value and returns,
in steps. *Area* is the work of the indenter in the loop. *Dissipation* is the work of the tractions at the end of
each step on its slip; it is of first order in the steps if the pressure changes, which it hardly does here. Both are
compared with Mindlin and Deresiewicz. *Q* is the largest difference of the force in the loop, relative to its largest
value.

![The loop and the convergence of its work]({name}_loop.png)
"""
    header = ("half space", "cells", "Q", "area", "dissipation")
    yield from _table(
        header,
        ((_body(r), _grid(r.cells), f"{100 * r.curve:.2f}", _percent(r.area), _percent(r.dissipation)) for r in rows),
    )
    yield """
Area and dissipation differ by the integration over the steps of the loop. Both contain the error of the grid, which
jumps when circles of cells join or leave the stick zone.
"""


def _punch(name: str, rows: list[BondedRow]) -> Iterator[str]:
    yield f"""## Full stick: flat punch

With μ = ∞ and all couplings, the load is c = (1 - ν) ln(3 - 4ν)/(1 - 2ν) times the frictionless load. Both are computed
on the same cells, so the error of the outline (cells under a circle) cancels. The remaining error is proportional to
the cell size; the extrapolation from the two finest grids assumes this.

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
    yield """## Full stick: sphere and cone pressed in incrementally

Points stick where they first touch. The contact radius grows in as many steps as there are cells along a side. The
table compares the contact stiffness dP/dg = 2 c E* a (Mossakovskii, Spence), averaged over the second half of the path,
and the force at its end. The exact contact radius follows from the surface beside a bonded punch (`FullStick`). Ratios
are exact values relative to the same indenter without friction: of the stiffness at the same radius, which is c, and of
the force at the same approach.
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

The sphere is first pressed in, then rotated about its axis until the stick radius is c (Lubkin); ν = 1/2.

![Tractions, and torque over twist]({name}_torsion.png)
"""
    shown = [row for row in rows if row.cells == finest or row.share == 0.6]
    header = ("cells", "c / a", "torque", *_STATE)
    yield from _table(header, ((_grid(r.cells), f"{r.share:g}", _percent(r.load), *_state(r)) for r in shown))
    yield """
Without slip (μ = ∞), the torsional stiffness is 16 G a³/3. The tractions are then singular at the contact edge, and the
radius of the outline of cells enters with its third power:
"""
    yield from _table(("cells", "torsional stiffness"), ((_grid(r.cells), _percent(r.stiffness)) for r in stiffness))
    yield ""


def _elements(drags: list[DragRow], twists: list[SlipRow], punches: list[BondedRow]) -> Iterator[str]:
    yield f"""## The same on boundary elements

These are complete runs from case files (`sphere.toml`, `torsion.toml`, `punch.toml`), with bilinear elements on the
plane that bounds the half space and all couplings, with ν = {SPHERE_POISSON:g} (nearly incompressible) under the
spheres and {PUNCH_POISSON:g} under the bonded punch. The forces on the first sphere are prescribed, in one step each:
P, then Q = 0.6 μP, its opposite, and Q again. The table compares approach, displacement, displacement at -Q, and
dissipation in the loop.
"""
    header = ("elements in a", "approach", "displacement", "at -Q", "dissipation", *_STATE)
    table = []
    for d in drags:
        loads = (d.approach, d.row.load, d.second_reversal, d.dissipation)
        table.append((f"{d.per_radius:.1f}", *map(_percent, loads), *_state(d.row)))
    yield from _table(header, table)
    tractions = [100 * d.row.traction for d in drags]
    everywhere = [100 * d.row.traction_everywhere for d in drags]
    rms = [100 * d.row.traction_rms for d in drags]
    yield f"""
**Nodal tractions have larger errors** than on cells: {_range(everywhere)} % everywhere, {_range(tractions)} % except
within one element of the two radii, and {_range(rms)} % in the root mean square, which decreases with the element size.
Forces and displacements agree much better. Nodal values of a bilinear interpolation oscillate about the peak at the
stick radius and at the contact edge. The oscillation does not decrease with the element size, but its fraction of the
area does. The slipping annulus is two to three elements wide, and its dissipation jumps by one or two per cent when
circles of nodes join it, as it does on cells.
"""
    yield "Torsion with prescribed twist compares the torque. The last table shows the bonded punch.\n"
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
