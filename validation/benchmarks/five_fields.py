"""What magneto-electro-elastic coupling costs: contact on a half space with five fields against one, one thread."""

import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import half_space
import half_space_friction
import numpy as np
from common import Record, command_line, median_time, prose, table, threads, verdict
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
"""Of the media where conjugate gradients alone would take minutes on the finest."""
ALIKE = ("batio3-cofe2o4", (0.0, 0.0))
HARDER = {
    "the same, the indenter at potentials of 5 V and 1 A": ("batio3-cofe2o4", (5.0, 1.0)),
    "orthotropic": ("orthotropic-mee", (0.0, 0.0)),
    "orthotropic, the indenter at potentials of 5 V and 1 A": ("orthotropic-mee", (5.0, 1.0)),
}
TIMES_ONE_FIELD = 8.0
TOLERANCE = 1e-8
"""Residual asked for everywhere: what a user gets who asks for nothing."""
ONE_FIELD = "one field: pressure"
TURNS = 5
"""Of all problems that are compared, one after the other, so that the machine's unrest meets them alike; times are
medians."""
MEE_FORCE, MEE_WIDTH = 450.0, 7e-3
"""Of the magneto-electro-elastic sphere of 0.1 m [N], [m]."""
AS_LARGE = "one field: pressure, contact as large"
AS_LARGE_FORCE = 1040.0
"""At which the insulated contact has about as many nodes as the conducting one under MEE_FORCE [N]: conduction makes
the medium softer."""


def conducting(n: int, material: str, potentials: tuple[float, float]) -> Record:
    """Products and whole solutions of five fields against one: an MEE material, conducting and insulated.

    By `auto`, as a user gets them, and by conjugate gradients alone.
    """
    radius, contact = half_space.RADIUS, half_space.CONTACT
    system = half_space.reduced(n, library_material(material).stiffness, False)
    height = (system.points[:, :2] ** 2).sum(axis=1) / (2.0 * radius)
    load = np.random.default_rng(0).normal(size=system.offset.shape)
    normal = np.where(np.arange(5) == 2, load, 0.0)
    limits = StoppingCriteria(tolerance=TOLERANCE)

    def whole(kappa: float, solver: Solver) -> Any:
        given = potentials if kappa > 0.0 else (0.0, 0.0)
        problem = indentation_problem(system, height, contact**2 / radius, Signorini(), (kappa, kappa), given)
        return solve(problem, solver, limits)

    found = {
        "one product": lambda: apply_load(system, normal, (2,)),
        "five products": lambda: system.apply(load),
        "one whole": lambda: whole(0.0, ProjectedCG()),
        "five whole": lambda: whole(np.inf, ProjectedCG()),
        "one by auto": lambda: whole(0.0, Auto()),
        "five by auto": lambda: whole(np.inf, Auto()),
    }
    turns = [
        {
            name: median_time(action, 9 if "product" in name else 1, warm=False)["processor"]
            for name, action in found.items()
        }
        for _ in range(TURNS)
    ]
    record: Record = {name: statistics.median(turn[name] for turn in turns) for name in found}
    ends = whole(0.0, ProjectedCG()), whole(np.inf, ProjectedCG()), whole(np.inf, Auto())
    return record | {"size": n, "iterations": [end.iterations for end in ends], "residuals": [e.residual for e in ends]}


def newton(n: int) -> Record:
    """One field without friction, five with all couplings: products and whole solutions, processor seconds."""
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
    """Products of one and of five fields by one thread and by two, milliseconds by the clock."""
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
    """All comparisons at every size, the coarsest alone if `quick`."""
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


def verdicts(record: Record) -> list[tuple[str, str, bool]]:
    """Five fields against one with friction; without it the dearest medium of each size."""
    by_auto = [record["conjugate gradients"], *record["harder"].values()]
    ratios = {
        "with friction and conduction": {n: _ratio(row, ONE_FIELD) for n, row in record["newton"].items()},
        "with conduction alone": {
            n: max(_by_auto(rows[n]) for rows in by_auto if n in rows) for n in record["conjugate gradients"]
        },
    }
    return [
        (
            f"five fields at most {TIMES_ONE_FIELD:g} times one field, {what}",
            ", ".join(f"{ratio:.1f} at {n} x {n}" for n, ratio in by_size.items()),
            max(by_size.values()) <= TIMES_ONE_FIELD,
        )
        for what, by_size in ratios.items()
    ]


def section(record: Record, _pictures: Path) -> str:
    """What both comparisons say: all five fields first."""
    alike = {"alike in all directions": record["conjugate gradients"]} | record["harder"]
    return "\n\n".join(
        [
            prose(
                "A magneto-electro-elastic contact has up to five unknown loads at a node: pressure, two tangential"
                " tractions, two fluxes. The one-field problem is pressure alone, without friction and insulated. All"
                f" by one thread to a residual of {TOLERANCE:g}; medians of {TURNS} turns. Asked: at most"
                f" {TIMES_ONE_FIELD:g} times as long."
            ),
            "### Five fields: friction and conduction",
            *_by_newton(record["newton"]),
            "### Three fields: pressure and fluxes, without friction",
            prose(
                "A sphere pressed on at a given approach, the indenter a perfect conductor; one half space for all, its"
                " entries made before. `auto` is what a user gets: conjugate gradients for the insulated contact,"
                " Newton's method for the conducting one. Beside it both by `projected-cg` alone, which is no"
                " choice of ours for conduction where media differ by direction. A product: five fields against one."
                " Steps: of the insulated contact and the conducting one by `projected-cg`, and of the latter by"
                " `auto`."
            ),
            table(
                ["medium", "grid", "a product", "`auto`", f"at most {TIMES_ONE_FIELD:g}", "`projected-cg`", "steps"],
                [_conducting(name, row) for name, rows in alike.items() for row in rows.values()],
            ),
            "### Products by two threads",
            prose(
                "One product with the compliance of the orthotropic medium on a free grid, in double precision, by the"
                " clock, medians of nine. Small products are left to one thread, whatever there is."
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
    products, auto = row["five products"] / row["one product"], _by_auto(row)
    alone, size = row["five whole"] / row["one whole"], row["size"]
    times = [f"{products:.1f}", f"{auto:.1f}", verdict(auto <= TIMES_ONE_FIELD), f"{alone:.1f}"]
    return [name, f"{size} x {size}", *times, ", ".join(map(str, row["iterations"]))]


def _by_auto(row: Record) -> float:
    """A conducting contact against an insulated one."""
    return float(row["five by auto"] / row["one by auto"])


def _by_newton(rows: Record) -> list[str]:
    *_, finest = rows.values()
    products = finest["runs"]["five fields"]["products"] / finest["runs"][ONE_FIELD]["products"]
    return [
        prose(
            "The orthotropic magneto-electro-elastic medium, a sphere of 0.1 m pressed on"
            f" with {MEE_FORCE:g} N and dragged with {SHARE * MU:g} of it, conducting perfectly; each solution on a"
            " half space of its own, whose entries it makes as it needs them. Pressure alone is solved by conjugate"
            " gradients, the others by Newton's method, as `auto` does."
        ),
        table(
            [
                "grid",
                "five fields against one",
                f"at most {TIMES_ONE_FIELD:g}",
                "against one with a contact as large",
                "against pressure by Newton",
                "against friction, insulated",
                "a product",
            ],
            [_compared(n, row) for n, row in rows.items()],
        ),
        prose(
            f"On the finest grid five fields take {products:.1f} times the products of pressure alone, each of which"
            f" costs {_product(finest):.1f} times as much on the same nodes: friction and conduction each ask for steps"
            " of their own, and each step for products of its linear equations. Finer grids have more nodes at the edge"
            " whose conduction holds the contact between open and closed. And a conducting contact is larger, as the"
            f" medium is softer: beside it stands the insulated one under {AS_LARGE_FORCE:g} N, which has about as many"
            " nodes."
        ),
        table(
            ["grid", "problem", "solution [s]", "steps", "products", "contact nodes", "residual"],
            [_problem_row(n, name, one) for n, row in rows.items() for name, one in row["runs"].items()],
        ),
    ]


def _compared(n: str, row: Record) -> list[str]:
    against = [_ratio(row, name) for name in (ONE_FIELD, AS_LARGE, "pressure by Newton", "three fields: friction")]
    met = verdict(against[0] <= TIMES_ONE_FIELD)
    return [f"{n} x {n}", f"{against[0]:.1f}", met, *(f"{one:.1f}" for one in (*against[1:], _product(row)))]


def _product(row: Record) -> float:
    """Of five fields against one."""
    return float(row["product_five"] / row["product_one"])


def _ratio(row: Record, other: str) -> float:
    return float(row["runs"]["five fields"]["processor"] / row["runs"][other]["processor"])


def _problem_row(n: str, name: str, one: Record) -> list[str]:
    counts = [str(one[name]) for name in ("iterations", "products", "contact")]
    return [f"{n} x {n}", name, f"{one['processor']:.2f}", *counts, f"{one['residual']:.0e}"]


if __name__ == "__main__":
    command_line(__doc__, measure, section)
