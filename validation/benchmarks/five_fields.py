"""Measure the cost of magneto-electro-elastic coupling: five fields against one on a half space, one thread."""

import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import half_space
import half_space_friction
import numpy as np
from common import Record, command_line, median_time, prose, table, threads
from half_space_friction import MU, SHARE, dragged, timed

from meeframe.contact.problem import ContactProblem, Solver
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw
from meeframe.material import library_material
from meeframe.solvers import Auto, ProjectedCG, SemismoothNewton, StoppingCriteria, solve
from meeframe.system.capabilities import apply_fields, apply_load
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.half_space import indentation_problem

TITLE = "Five fields against one"
SIZES, QUICK = (64, 128, 256, 512), (64,)
HARDEST = SIZES[:3]
"""Sizes for the other media."""
ALIKE = ("batio3-cofe2o4", (0.0, 0.0))
HARDER = {
    "the same, the indenter at potentials of 5 V and 1 A": ("batio3-cofe2o4", (5.0, 1.0)),
    "orthotropic": ("orthotropic-mee", (0.0, 0.0)),
    "orthotropic, the indenter at potentials of 5 V and 1 A": ("orthotropic-mee", (5.0, 1.0)),
}
TOLERANCE = 1e-8
"""Residual requested from all solvers."""
ONE_FIELD = "one field: pressure"
TURNS = 5
"""Repetitions of all compared problems, which alternate so that other load affects them alike; times are medians."""
MEE_FORCE, MEE_WIDTH = 450.0, 7e-3
"""Force [N] and width of the zone [m] of the magneto-electro-elastic sphere of 0.1 m."""
AS_LARGE = "one field: pressure, contact as large"
AS_LARGE_FORCE = 1040.0
"""Force [N] at which the insulated contact has about as many nodes as the conducting one under MEE_FORCE; conduction
makes the medium softer."""


def conducting(n: int, material: str, potentials: tuple[float, float]) -> Record:
    """Measure products and solutions of an MEE material, conducting and insulated.

    The solver is `auto`, the default.
    """
    radius, contact = half_space.RADIUS, half_space.CONTACT
    system = half_space.reduced(n, library_material(material).stiffness, False)
    height = (system.points[:, :2] ** 2).sum(axis=1) / (2.0 * radius)
    load = np.random.default_rng(0).normal(size=system.offset.shape)
    normal = np.where(np.arange(5) == 2, load, 0.0)
    limits = StoppingCriteria(tolerance=TOLERANCE)

    def whole(kappa: float) -> Any:
        given = potentials if kappa > 0.0 else (0.0, 0.0)
        problem = indentation_problem(system, height, contact**2 / radius, Signorini(), (kappa, kappa), given)
        return solve(problem, Auto(), limits)

    result = {
        "product, one field": lambda: apply_load(system, normal, (2,)),
        "product, five fields": lambda: system.apply(load),
        "auto, one field": lambda: whole(0.0),
        "auto, five fields": lambda: whole(np.inf),
    }
    turns = [
        {
            name: median_time(action, 9 if "product" in name else 1, warm=False)["processor"]
            for name, action in result.items()
        }
        for _ in range(TURNS)
    ]
    record: Record = {name: statistics.median(turn[name] for turn in turns) for name in result}
    ends = whole(0.0), whole(np.inf)
    return record | {"size": n, "iterations": [end.iterations for end in ends], "residuals": [e.residual for e in ends]}


def newton(n: int) -> Record:
    """Measure processor times of products and solutions, from one field without friction to all five."""
    rubs, rests = IsotropicCoulomb(MU), Signorini()

    def sphere(law: ContactLaw, conducting: bool = False, force: float = MEE_FORCE) -> ContactProblem:
        return dragged(_mee_half_space(n), 0.1, force, law, conducting)

    jobs: dict[str, Callable[[], tuple[ContactProblem, Solver]]] = {
        ONE_FIELD: lambda: (sphere(rests), ProjectedCG()),
        AS_LARGE: lambda: (sphere(rests, force=AS_LARGE_FORCE), ProjectedCG()),
        "pressure by Newton": lambda: (sphere(rests), SemismoothNewton()),
        "three fields: friction": lambda: (sphere(rubs), SemismoothNewton()),
        "three fields: fluxes": lambda: (sphere(rests, True), SemismoothNewton()),
        "five fields": lambda: (sphere(rubs, True), SemismoothNewton()),
    }
    turns = [{name: _solved(*job()) for name, job in jobs.items()} for _ in range(TURNS)]
    runs = {name: sorted((turn[name] for turn in turns), key=_processor)[TURNS // 2] for name in jobs}
    system, load = _mee_half_space(n), np.random.default_rng(1).normal(size=(n * n, 5))
    normal = load * [0.0, 0.0, 1.0, 0.0, 0.0]
    one = median_time(lambda: apply_load(system, normal, [2]), 9)["processor"]
    return {"runs": runs, "product_one": one, "product_five": median_time(lambda: system.apply(load), 9)["processor"]}


def _solved(problem: ContactProblem, solver: Solver) -> Record:
    solution, record = timed(problem, solver, TOLERANCE)
    return record | {"contact": int((solution.state.load[:, 2] < 0.0).sum())}


def _processor(run: Record) -> float:
    return float(run["processor"])


def _mee_half_space(n: int) -> ReducedSystem:
    return half_space_friction.reduced(n, library_material("orthotropic-mee").stiffness, MEE_WIDTH, False)


def shared(n: int) -> Record:
    """Measure wall times [ms] of products of one and of five fields by one thread and by two."""
    system = half_space.reduced(n, library_material("orthotropic-mee").stiffness, False)
    load = np.asfortranarray(np.random.default_rng(2).normal(size=system.offset.shape))
    record: Record = {}
    for count in (1, 2):
        with threads(count):
            one = median_time(lambda: apply_fields(system, load[:, 2:3], (2,), (2,)), 9)
            five = median_time(lambda: system.apply(load), 9)
            record[str(count)] = {"one": 1e3 * one["wall"], "five": 1e3 * five["wall"]}
    return record


def measure(quick: bool) -> Record:
    """Measure all comparisons at every size, or at the coarsest only if `quick`."""
    sizes = QUICK if quick else SIZES
    products = {str(n): shared(n) for n in sizes}
    with threads(1):
        half_space_friction.ours(32, False)  # compiled, loaded
        return {
            "products": products,
            "conjugate gradients": {str(n): conducting(n, *ALIKE) for n in sizes},
            "harder": {
                name: {str(n): conducting(n, *given) for n in sizes if n in HARDEST} for name, given in HARDER.items()
            },
            "newton": {str(n): newton(n) for n in sizes},
        }


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return the cost of five fields relative to one, without friction for the most expensive medium of each size."""
    by_auto = [record["conjugate gradients"], *record["harder"].values()]
    ratios = {
        "with friction and conduction": {n: _ratio(row, ONE_FIELD) for n, row in record["newton"].items()},
        "with conduction only": {
            n: max(_by_auto(rows[n]) for rows in by_auto if n in rows) for n in record["conjugate gradients"]
        },
    }
    return [
        (
            f"coupled fields against one field, {what}: ratio of times",
            ", ".join(f"{ratio:.1f} at {n} x {n}" for n, ratio in by_size.items()),
        )
        for what, by_size in ratios.items()
    ]


def section(record: Record, _pictures: Path) -> str:
    """Return the section of the page, all five fields first."""
    alike = {"transversely isotropic": record["conjugate gradients"]} | record["harder"]
    return "\n\n".join(
        [
            prose(
                "A magneto-electro-elastic contact has up to five unknown loads at each node: pressure, two tangential"
                " tractions, two fluxes. The one-field problem has only the pressure: it is frictionless and insulated."
                f" All problems are solved with one thread to a residual of {TOLERANCE:g}; times are medians of"
                f" {TURNS} repetitions."
            ),
            "### Five fields: friction and conduction",
            *_by_newton(record["newton"]),
            "### Three fields: pressure and fluxes, without friction",
            prose(
                "A perfectly conducting sphere is pressed in to a given approach. All problems share one half space"
                " whose entries are computed beforehand. The table shows the times of conducting contact relative to"
                " insulated contact, with the default solver `auto`, which chooses conjugate gradients for the"
                " insulated contact and Newton's method for the conducting one. The column on products compares five"
                " fields with one. Steps are those of the insulated and of the conducting contact."
            ),
            table(
                ["medium", "grid", "product", "`auto`", "steps"],
                [_conducting(name, row) for name, rows in alike.items() for row in rows.values()],
            ),
            "### Products with two threads",
            prose(
                "Wall times of one product with the compliance of the orthotropic medium on a free grid, in double"
                " precision, medians of nine. Small products always use one thread."
            ),
            table(
                ["grid", "fields", "one thread [ms]", "two threads [ms]"],
                [
                    [f"{n} x {n}", name, f"{row['1'][name]:.2f}", f"{row['2'][name]:.2f}"]
                    for n, row in record["products"].items()
                    for name in ("one", "five")
                ],
            ),
        ]
    )


def _conducting(name: str, row: Record) -> list[str]:
    products, auto = row["product, five fields"] / row["product, one field"], _by_auto(row)
    size, times = row["size"], [f"{products:.1f}", f"{auto:.1f}"]
    return [name, f"{size} x {size}", *times, ", ".join(map(str, row["iterations"]))]


def _by_auto(row: Record) -> float:
    """Return the ratio of times of a conducting and an insulated contact."""
    return float(row["auto, five fields"] / row["auto, one field"])


def _by_newton(rows: Record) -> list[str]:
    *_, finest = rows.values()
    products = finest["runs"]["five fields"]["products"] / finest["runs"][ONE_FIELD]["products"]
    return [
        prose(
            "A perfectly conducting sphere of 0.1 m is pressed with"
            f" {MEE_FORCE:g} N against the orthotropic magneto-electro-elastic medium and dragged with {SHARE * MU:g}"
            " of this force. Each solution uses a new half space and computes its entries on demand. As in `auto`,"
            " conjugate gradients solve the one-field problem, and Newton's method the others."
        ),
        table(
            [
                "grid",
                "five fields against one",
                "against one with an equally large contact",
                "against pressure by Newton",
                "against friction, insulated",
                "product",
            ],
            [_compared(n, row) for n, row in rows.items()],
        ),
        prose(
            f"On the finest grid, five fields take {products:.1f} times as many products as one field, each of"
            f" which costs {_product(finest):.1f} times as much on the same nodes: friction and conduction each take"
            " additional steps, and each step takes products for its linear equations. Finer grids have more biactive"
            " nodes at the contact edge, where conduction keeps the contact between open and closed. A conducting"
            " contact is also larger, because the medium is softer; the insulated contact under"
            f" {AS_LARGE_FORCE:g} N has about as many nodes. Relaxation of the start from the coarser"
            " grid finds which nodes at the contact edge are open, and where stick ends"
            " ([Newton's method](../explanation/solvers-newton.md#the-nonsmooth-equation)); without it, five fields"
            " take 9 steps and 74 products on 512 x 512 nodes ([ablation](#ablation-of-the-solvers))."
        ),
        table(
            ["grid", "problem", "solution [s]", "steps", "products", "contact nodes", "residual"],
            [_problem_row(n, name, one) for n, row in rows.items() for name, one in row["runs"].items()],
        ),
    ]


def _compared(n: str, row: Record) -> list[str]:
    against = [_ratio(row, name) for name in (ONE_FIELD, AS_LARGE, "pressure by Newton", "three fields: friction")]
    return [f"{n} x {n}", *(f"{ratio:.1f}" for ratio in (*against, _product(row)))]


def _product(row: Record) -> float:
    """Return the ratio of times of a product of five fields and of one."""
    return float(row["product_five"] / row["product_one"])


def _ratio(row: Record, other: str) -> float:
    return float(row["runs"]["five fields"]["processor"] / row["runs"][other]["processor"])


def _problem_row(n: str, name: str, one: Record) -> list[str]:
    counts = [str(one[name]) for name in ("iterations", "products", "contact")]
    return [f"{n} x {n}", name, f"{one['processor']:.2f}", *counts, f"{one['residual']:.0e}"]


if __name__ == "__main__":
    command_line(__doc__, measure, section)
