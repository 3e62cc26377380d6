"""Compare friction with Siconos, an independent code for nonsmooth mechanics."""

from collections.abc import Iterator

import numpy as np
from siconos_reference import MISSING, SOLVERS, siconos_python
from study import FULL, QUICK, SAME, Comparison, compare

from meeframe.study.validate import Check, Claim, Curve, Item, Plot, Skip

TITLE = "Isotropic friction: the same problems solved by Siconos"
SOURCE = (
    "Acary, Bonnefon, Bremond, Huber, Perignon, Sinclair, An introduction to Siconos, INRIA report RT-0340 (2019); "
    "Acary, Bremond, Koziara, Perignon, FCLIB, INRIA report RT-444 (2014)."
)


def run(quick: bool) -> Iterator[Item]:
    """Compare reactions, gaps and states of all contacts for each increment, with the worse of both solvers."""
    if siconos_python() is None:
        yield Skip("reactions and gaps by Siconos", MISSING)
        return
    rows: list[Comparison] = []
    for row in compare(QUICK if quick else FULL):
        rows.append(row)
        if row.solver == SOLVERS[-1]:
            yield from _increment(rows[-len(SOLVERS) :])
    yield _iterations(rows)


def _increment(rows: list[Comparison]) -> Iterator[Item]:
    one = rows[0]
    name = f"{one.body} {one.divisions} x {one.divisions}, mu = {one.mu:g}, step {one.step}, {one.regime}"
    yield Check(f"{name}: reactions", max(row.reaction for row in rows), 0.0, SAME, "", True)
    yield Check(f"{name}: gaps and slips", max(row.gap for row in rows), 0.0, SAME, "", True)
    yield Claim(
        f"{name}: open, stick and slip",
        f"{one.pressed} of {one.contacts} contacts closed, {one.slipping} of them slip",
        "Siconos converges to the same state at every contact",
        all(row.alike and row.converged for row in rows),
    )


def _iterations(rows: list[Comparison]) -> Plot:
    curves = []
    for solver in SOLVERS:
        contacts, iterations = np.array([(row.contacts, row.iterations) for row in rows if row.solver == solver]).T
        curves.append(Curve(solver, contacts.astype(float), iterations.astype(float), points=True))
    return Plot(
        "Iterations of Siconos's solvers",
        "contacts",
        "iterations",
        tuple(curves),
        log_x=True,
        log_y=True,
        note="NSGS: nonsmooth Gauss-Seidel; NSN_AC: Newton on the function of Alart and Curnier.",
    )
