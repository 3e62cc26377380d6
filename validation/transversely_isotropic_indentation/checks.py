"""Check section 7.1 on the paper's mesh: four conditions and the sweep of the conductivity."""

from collections.abc import Iterator

import numpy as np
from study import (
    CONDITIONS,
    Solved,
    Sweep,
    closed_form,
    exact_totals,
    load,
    refinements,
    section_differences,
    solve,
    sweep,
    totals,
)

from meeframe.model.case import Case
from meeframe.study.validate import Check, Curve, Item, Plot
from meeframe.testing.closed_forms import Indentation

TITLE = "Section 7.1: sphere on a transversely isotropic block, boundary elements"
SOURCE = (
    "Reference paper, section 7.1, 1088 elements, against closed forms of the half space (docs/explanation/theory.md); "
    "the bonded block of finite size is expected within 1.5 % of them, the section within 3 %."
)
UNITS = {"force": "N", "charge": "C", "magnetic_flux": "Wb"}


def run(quick: bool) -> Iterator[Item]:
    """Check the four conditions; if not `quick`, also a meshed half space, and plot the sweep of Fig. 3."""
    case = load("EMII")
    system = case.formulation.reduce(case.body)
    insulated = closed_form(case, "EMII")
    for condition in CONDITIONS:
        solved, exact = solve(load(condition), system), closed_form(case, condition)
        yield from _totals(f"{condition}, block", totals(solved), exact, 0.015)
        for name, value in section_differences(solved, exact, insulated).items():
            yield Check(f"{condition}, block: {name} on the section", value, 0.0, 0.03, "", absolute=True)
        yield from _section(condition, solved, exact)
    if not quick:
        for condition in ("ECMII", "EIMCI"):
            yield _sweep(case, sweep(case, system, condition, np.logspace(-3, 3, 9)))
        (half_space,) = refinements(case, [(np.inf, 24)])
        for condition, result in half_space.totals.items():
            yield from _totals(
                f"{condition}, half space of 24 x 24 elements", result, closed_form(case, condition), 3e-3
            )


def _totals(name: str, result: dict[str, float], exact: Indentation, tolerance: float) -> Iterator[Check]:
    for total, true in exact_totals(exact).items():
        if true:
            yield Check(f"{name}: {total.replace('_', ' ')}", result[total], true, tolerance, UNITS[total])


def _section(condition: str, solved: Solved, exact: Indentation) -> Iterator[Plot]:
    x, pressure, potentials = solved.section()
    fine = np.linspace(x.min(), x.max(), 401)
    fields = {
        "pressure [MPa]": (pressure / 1e6, exact.pressure(np.abs(fine)) / 1e6),
        "electric potential [V]": (potentials[:, 0], exact.electric_potential(np.abs(fine))),
        "magnetic potential [A]": (potentials[:, 1], exact.magnetic_potential(np.abs(fine))),
    }
    for label, (computed, true) in fields.items():
        curves = (Curve("half space", fine * 1e3, true), Curve("block, nodes", x * 1e3, computed, points=True))
        yield Plot(f"{condition}: {label.split(' [')[0]} along x", "x [mm]", label, curves)


def _sweep(case: Case, result: Sweep) -> Plot:
    """Plot Fig. 3: from insulating to conducting."""
    insulated = closed_form(case, "EMII").force
    flux = "charge" if result.condition == "ECMII" else "magnetic_flux"
    force = np.array([-solved.totals.force[2] for solved in result.solved]) / insulated
    total = np.array([totals(solved)[flux] for solved in result.solved]) / exact_totals(result.limit)[flux]
    ends = result.kappa[[0, -1]]
    curves = (
        Curve("force relative to insulating", result.kappa, force, points=True),
        Curve(f"{flux.replace('_', ' ')} relative to conducting", result.kappa, total, points=True),
        Curve("half space, conducting: force", ends, np.full(2, result.limit.force / insulated)),
    )
    return Plot(f"Fig. 3: {result.condition}", "conductivity, times |xi_cc| a", "relative", curves, log_x=True)
