"""Electric and magnetic conditions of an indenter on a coupled half space: checks that two cases share."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from indentation import OFFSETS, TOTALS, Run, total_checks
from stroh import point_response

from meeframe.core.fields import Array
from meeframe.materials.half_space import axisymmetric_compliance
from meeframe.study.validate import Check, Curve, Item, Plot
from meeframe.testing.closed_forms import FlatPunch

FIELDS = (("electric_potential", "V", 3), ("magnetic_potential", "A", 4))
"""Of the surface, and where they stand in a displacement, negated."""


def response(stiffness: Array, names: tuple[str, ...]) -> Iterator[Check]:
    """Point response by integrals (computed) and by an eigenproblem (reference); names: of the entries compared."""
    integrals, eigenproblem = axisymmetric_compliance(stiffness), point_response(stiffness)
    for name in names:
        place = int(name[-2]) - 1, int(name[-1]) - 1
        yield Check(f"point response {name}, against Stroh", float(integrals[place]), float(eigenproblem[place]), 1e-9)


def conducting(runs: Mapping[str, Run], cells: float, shape: str) -> Iterator[Item]:
    """Totals of insulating and grounded indenters within 1e-3."""
    for name, run in runs.items():
        yield from total_checks(run, cells, 1e-3, f"{shape}, {name}")


def at_potentials(run: Run, cells: float, shape: str, given: str) -> Iterator[Item]:
    """Totals of a charged indenter within 1e-3 of the parts that pressure and potentials have in them.

    Their parts nearly cancel, and the potentials' part is singular at an edge that the grid resolves to cells: for
    sphere and cone the mean over grids is compared.
    """
    electric, magnetic = (None if potential is None else 0.0 for potential in run.potentials)
    exact, grounded = run.exact, replace(run, potentials=(electric, magnetic)).exact
    # the outline of a punch is right on the grid that has as many nodes under it as its area asks, see Run
    offsets = (0.0,) if isinstance(run.shape, FlatPunch) else OFFSETS
    grids = f"{cells:g} cells" if len(offsets) == 1 else f"mean of grids of {cells:g} to {cells + 1:g} cells"
    found = np.mean([run.at(cells + part).totals for part in offsets], axis=0)
    for (total, unit), computed in zip(TOTALS, found, strict=True):
        true, part = getattr(exact, total), getattr(grounded, total)
        if true:
            bound = 1e-3 * (abs(part) + abs(true - part))
            name = f"{shape} at {given}: {total.replace('_', ' ')}, {grids}"
            yield Check(name, float(computed), true, bound, unit, absolute=True)


def fields(insulated: Run, grounded: Run, cells: float) -> Iterator[Item]:
    """Potentials of the surface through the middle, of an insulating and a grounded sphere, over the contact."""
    for field, unit, column in FIELDS:
        curves = []
        for name, run in (("insulating", insulated), ("grounded", grounded)):
            found, exact = run.at(cells), run.exact
            line, x = found.section()
            true = getattr(exact, field)(np.abs(x))
            computed = -found.displacement[line, column]
            if not np.abs(true).max():
                continue
            curves += [Curve(f"{name}, closed form", x * 1e3, true), Curve(name, x * 1e3, computed, points=True)]
            if name == "insulating":
                error = float(np.abs(computed - true).max() / np.abs(true).max())
                words = field.replace("_", " ")
                yield Check(f"sphere, insulating: {words} on the section, {cells} cells", error, 0.0, 5e-3, "", True)
        if curves:
            words = field.replace("_", " ")
            yield Plot(f"sphere: {words} of the surface", "x [mm]", f"{words} [{unit}]", tuple(curves))
