"""Check two deformable bodies: Hertz, joined half spaces in closed form, exchanged roles."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from study import CONDITIONS, TURN, Solved, closed_form, conducting, hertz, load, roles, second_body, solve

from meeframe.elements import Quad4
from meeframe.mesh import block_mesh, half_space_mesh
from meeframe.model.case import Case
from meeframe.model.solve import reduce
from meeframe.study.reports.study import middle_line
from meeframe.study.validate import Check, Curve, Item, Plot
from meeframe.testing.closed_forms import Indentation

TITLE = "Two deformable bodies, boundary elements"
SOURCE = (
    "Hertz (1882); closed forms of the half space with xi = xi_A + D xi_B D (docs/explanation/theory.md). Case files "
    "of the folder; quick: coarser meshes. All numbers: docs/validation/two_bodies.md."
)


def run(quick: bool) -> Iterator[Item]:
    """Check elastic bodies against Hertz, poled bodies against joined half spaces, and exchanged roles."""
    if not quick:
        for name in ("equal", "unlike_elastic"):
            result = hertz(name)
            yield Check(f"{result.title}: force", result.force, result.exact, 0.015, "N")
            yield Check(
                f"{result.title}: pressure, largest error relative to the peak", result.pressure, 0.0, 0.03, "", True
            )
    yield from _opposite(quick)
    yield from _exchanged(quick)


def _opposite(quick: bool) -> Iterator[Item]:
    """Check bodies poled in the same direction in space: one body is the other rotated by 180 degrees."""
    case = load("poled")
    other = second_body(case)
    mesh = half_space_mesh(0.1, 0.005, 10, 5, Quad4()) if quick else case.mesh
    opposite = replace(other, mesh=mesh if quick else other.mesh, material=other.material.rotated(TURN))
    case = replace(case, mesh=mesh, second_body=opposite)
    system = reduce(case)
    for condition in ("EMII", "EMCI") if quick else CONDITIONS:
        variant = conducting(case, condition)
        solved, exact = solve(variant, system), closed_form(case, condition)
        result = solved.totals
        pairs = (
            ("force", "N", -float(result.force[2]), exact.force),
            ("charge", "C", result.charge, exact.charge),
            ("magnetic flux", "Wb", result.magnetic_flux, exact.magnetic_flux),
        )
        for name, unit, computed, true in pairs:
            if true:
                yield Check(f"poled the same way in space, {condition}: {name}", computed, true, 0.015, unit)
        yield _section(condition, solved, exact)


def _section(condition: str, solved: Solved, exact: Indentation) -> Plot:
    nodes, x = middle_line(solved.zone)
    fine = np.linspace(x.min(), x.max(), 401)
    curves = (
        Curve("joined half spaces", fine * 1e3, exact.pressure(np.abs(fine)) / 1e6),
        Curve("nodes", x * 1e3, -solved.step.traction[nodes, 2] / 1e6, points=True),
    )
    return Plot(f"{condition}: pressure between the bodies", "x [mm]", "pressure [MPa]", curves)


def _exchanged(quick: bool) -> Iterator[Check]:
    result = roles(_coarse(load("roles")) if quick else load("roles"))
    largest = float(result.differences.max())
    yield Check("exchanged roles: load, largest difference relative to its largest value", largest, 0.0, 1e-8, "", True)
    one, two = result.totals
    forces = float(np.abs(two.force - one.force * [-1, 1, 1]).max() / np.abs(one.force).max())
    yield Check("exchanged roles: forces, largest difference", forces, 0.0, 1e-8, "", True)
    yield Check("exchanged roles: same stick and slip at all nodes (1: yes)", float(result.alike), 1.0, 0.0)


def _coarse(case: Case) -> Case:
    half, block = half_space_mesh(0.1, 0.005, 8, 4, Quad4()), block_mesh(0.05, 0.12, 0.005, 8, 3, 2, Quad4())
    return replace(case, mesh=half, second_body=replace(second_body(case), mesh=block))
