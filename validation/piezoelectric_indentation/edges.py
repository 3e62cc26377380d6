"""Print the tables of docs/explanation/halfspace.md: errors of totals with contact edges between the nodes and along
them.

Usage: uv run python validation/piezoelectric_indentation/edges.py
"""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from half_space import EdgeOption, observed_order
from indentation import OFFSETS, Run

from meeframe.fields import Array
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.testing.closed_forms import Cone, FlatPunch, Sphere

APPROACH, POTENTIAL = 5e-5, -2e4
STIFFNESS = library_material("pzt-4").stiffness
SHAPES = {"sphere": Sphere(0.1), "cone": Cone(0.02), "punch": FlatPunch(2e-3)}
GRIDS = (16, 32, 64, 128)
ON_GRIDS = np.linspace(64.0, 65.2, 7)
"""Numbers of cells under an insulated punch."""


def run_of(name: str, edges: EdgeOption, potential: float | None = POTENTIAL) -> Run:
    """Return a shape on PZT-4 at the potential, insulating if it is None."""
    return Run(STIFFNESS, axisymmetric_compliance(STIFFNESS), SHAPES[name], APPROACH, (potential, None), edges)


def errors(run: Run, grids: Sequence[float]) -> Array:
    """Return the relative errors of force and charge, (n, 2)."""
    exact = run.exact
    return np.array([run.at(cells).totals[:2] for cells in grids]) / [exact.force, exact.charge or np.inf] - 1.0


def row(head: str, result: Sequence[Array]) -> str:
    """Return a row of largest errors: sphere P and Q, cone P and Q, and punch, whose P and Q are equal."""
    sphere, cone, punch = (np.abs(of_grids).max(axis=0) for of_grids in result)
    return f"| {head} | {' | '.join(f'{error:.1e}' for error in (*sphere, *cone, punch.max()))} |"


def tables() -> Iterator[str]:
    """Yield rows as they are computed."""
    kinds: tuple[EdgeOption, ...] = ("resolved", "nodes")
    yield f"| cells, edges | sphere: P | sphere: Q | cone: P | cone: Q | punch: P = Q |\n{'| --- ' * 6}|"
    for edges in kinds:
        sizes = []
        for cells in GRIDS:
            result = [errors(run_of(name, edges), [cells + part for part in OFFSETS]) for name in SHAPES]
            sizes.append([np.sqrt((of_grids**2).mean(axis=0)) for of_grids in result])
            yield row(f"{cells}, {edges}", result)
        orders = [
            f"{name} {' and '.join(f'{observed_order(list(GRIDS), list(total)):.1f}' for total in of_shape)}"
            for name, of_shape in zip(SHAPES, np.transpose(sizes, (1, 2, 0)), strict=True)
        ]
        yield f"observed orders of P and Q, edges {edges}, by root mean squares: {', '.join(orders)}"
    for edges in kinds:
        result = errors(run_of("punch", edges, None), ON_GRIDS)[:, 0]
        message = ", ".join(f"{error:+.1e} ({cells:.1f})" for cells, error in zip(ON_GRIDS, result, strict=True))
        yield f"insulated punch, error of P by cells under it, edges {edges}: {message}"


if __name__ == "__main__":
    for line in tables():
        print(line, flush=True)
