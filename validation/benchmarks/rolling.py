"""Measure rolling: a steady state directly, and many transient increments, on grids of increasing fineness, one thread.

Contact alone is timed on an existing reduced system.
"""

from typing import Any

from common import Record, command_line, figures, prose, solved, table, threads

from meeframe.model.case import Case
from meeframe.model.load import case_from_tables
from meeframe.model.solve import reduce, solve_steps
from meeframe.testing.operation_counter import OperationCounter

TITLE = "Rolling"
SIZES, QUICK, FINEST = (16, 32, 64, 128, 256), (16, 32), 3
"""Nodes along a side of the grids, and number of the finest ones on which other creepages are counted."""
TRANSIENT = 64
"""Nodes along a side of the grid of transient rolling."""
CELLS, QUICK_CELLS = 500, 5
WIDTH = 3e-3
"""Side of the zone [m]; the contact is two thirds of it across."""
CREEP = {"creepage": [1e-3, 5e-4], "spin": 0.5}
MOTIONS = {
    "along the rolling direction": {"creepage": [1e-3, 0.0], "spin": 0.0},
    "across it": {"creepage": [0.0, 1e-3], "spin": 0.0},
    "spin alone": {"creepage": [0.0, 0.0], "spin": 1.0},
    "a fifth of both and of the spin": {"creepage": [2e-4, 1e-4], "spin": 0.1},
}
"""Other creepages, with which the work is counted on the finest grids."""


def rolled(nodes: int, rolling: dict[str, Any]) -> Case:
    """Return a sphere that rolls on steel, by default with creepages and spin at which part of the contact slips."""
    return case_from_tables(
        {
            "formulation": {"name": "half-space", "matrix_up_to": 0},
            "material": {"name": "isotropic", "young_modulus": "200 GPa", "poisson_ratio": 0.3},
            "mesh": {"type": "half-space", "contact_width": WIDTH, "divisions": nodes - 1},
            "contact": {"law": {"name": "isotropic-coulomb", "mu": 0.3}},
            "indenter": {"name": "sphere", "radius": "100 mm"},
            "steps": [{"normal_force": "2.93 kN"}, {"rolling": CREEP | rolling}],
        }
    )


def timed(nodes: int, rolling: dict[str, Any]) -> Record:
    """Return seconds, iterations and products of the increments that roll, and their parts that stick and slip."""
    case = rolled(nodes, rolling)
    counted = OperationCounter.of(reduce(case))
    steps = solve_steps(case, counted, boundary=False)
    next(steps)
    products = len(counted.products)
    done, record = solved(steps)
    return record | {"products": len(counted.products) - products, "contact": int(done[-1].touching.sum())}


def measure(quick: bool) -> Record:
    """Measure all grids, or two coarse ones and few cells if `quick`."""
    sizes, cells = (QUICK, QUICK_CELLS) if quick else (SIZES, CELLS)
    nodes = QUICK[-1] if quick else TRANSIENT
    with threads(1):
        timed(QUICK[0], {"steady": True})  # compiled, loaded
        steady = {str(size): timed(size, {"steady": True}) for size in sizes}
        motions = {
            name: {str(size): timed(size, {"steady": True} | motion) for size in sizes[-FINEST:]}
            for name, motion in MOTIONS.items()
        }
        transient = timed(nodes, {"distance": cells * WIDTH / (nodes - 1)})
    return {"steady": steady, "motions": motions, "transient": transient | {"nodes": nodes}}


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return times, and how the work grows with the grid."""
    steady, transient = record["steady"], record["transient"]
    grids = ", ".join(steady)
    return [
        (
            f"rolling: steady states on {grids} nodes along a side",
            ", ".join(f"{row['seconds']:.2f}" for row in steady.values()) + " s",
        ),
        (
            "rolling: Newton steps of steady states on these grids",
            ", ".join(str(row["iterations"]) for row in steady.values()),
        ),
        (
            "rolling: products with the compliance of steady states on these grids",
            ", ".join(str(row["products"]) for row in steady.values()),
        ),
        (
            f"rolling: {transient['increments']} transient increments, {transient['nodes']} x {transient['nodes']}",
            f"{transient['seconds']:.0f} s",
        ),
    ]


def section(record: Record, _pictures: object) -> str:
    """Return the text and tables of steady and transient rolling."""
    rows = [(f"steady, {size} x {size}", row) for size, row in record["steady"].items()]
    nodes = record["transient"]["nodes"]
    rows.append((f"transient, {nodes} x {nodes}", record["transient"]))
    cells = [
        [
            name,
            str(row["increments"]),
            f"{row['seconds']:.2f}",
            f"{row['iterations'] / row['increments']:.1f}",
            f"{row['products'] / row['increments']:.1f}",
            str(row["contact"]),
            f"{row['residual']:.0e}",
        ]
        for name, row in rows
    ]
    heads = ["rolling", "increments", "contact [s]", "iterations", "products", "nodes in contact", "largest residual"]
    sizes = list(next(iter(record["motions"].values())))
    works = [
        [name, *(f"{grids[size]['iterations']} / {grids[size]['products']}" for size in sizes)]
        for name, grids in record["motions"].items()
    ]
    return "\n\n".join(
        [
            prose(
                "A rigid sphere rolls on steel with two creepages and spin (friction coefficient 0.3); its contact is"
                " two thirds of the zone across, and part of it slips. Steady states are solved for directly,"
                " starting from coarser grids; transient increments begin with the sphere at rest. Times are those of"
                " the contact stage with one thread; iterations and products with the compliance are per increment."
            ),
            figures(highlights(record)),
            table(heads, cells),
            prose("Newton steps and products of steady states with other creepages, by nodes along a side:"),
            table(["creepage", *sizes], works),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
