"""Checks of electric and magnetic conditions of an indenter on a coupled half space, shared by two cases."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from indentation import OFFSETS, Run, total_checks
from stroh import point_response

from meeframe.fields import Array
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.study.validate import Check, Curve, Item, Plot

FIELDS = (("electric_potential", "V", 3), ("magnetic_potential", "A", 4))
"""Surface potentials, their units, and their columns in a displacement, where they are negated."""


def response(stiffness: Array, names: tuple[str, ...]) -> Iterator[Check]:
    """Check the point response by integrals against an eigenproblem; names: entries to compare."""
    integrals, eigenproblem = axisymmetric_compliance(stiffness), point_response(stiffness)
    for name in names:
        place = int(name[-2]) - 1, int(name[-1]) - 1
        yield Check(f"point response {name}, against Stroh", float(integrals[place]), float(eigenproblem[place]), 1e-9)


def conducting(runs: Mapping[str, Run], cells: float, shape: str) -> Iterator[Item]:
    """Check totals of insulating and grounded indenters to 1e-3."""
    for name, run in runs.items():
        yield from total_checks(run, cells, 1e-3, f"{shape}, {name}")


def at_potentials(run: Run, cells: float, shape: str, given: str, quick: bool) -> Iterator[Item]:
    """Check totals of a charged indenter to 1e-3 on single grids with different positions of the contact edge.

    The contributions of pressure and potentials nearly cancel, and those of the potentials are singular at the
    contact edge, which is resolved between the nodes. `quick`: one grid only.
    """
    resolved = replace(run, edges="resolved")
    for part in OFFSETS[:1] if quick else OFFSETS:
        yield from total_checks(resolved, cells + part, 1e-3, f"{shape} at {given}")


def fields(insulated: Run, grounded: Run, cells: float) -> Iterator[Item]:
    """Check and plot surface potentials through the centre of an insulating and a grounded sphere."""
    for field, unit, column in FIELDS:
        curves = []
        for name, run in (("insulating", insulated), ("grounded", grounded)):
            result, exact = run.at(cells), run.exact
            line, x = result.section()
            true = getattr(exact, field)(np.abs(x))
            computed = -result.displacement[line, column]
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
