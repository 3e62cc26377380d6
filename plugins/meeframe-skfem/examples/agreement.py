"""Print the table of docs/explanation/skfem.md, totals of a conducting sphere by finite and by boundary elements.

Usage: uv run python plugins/meeframe-skfem/examples/agreement.py
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from meeframe_skfem import FiniteElements

import meeframe
from meeframe.elements import ELEMENTS
from meeframe.fields import Array
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.mesh import block_mesh
from meeframe.model.case import Case
from meeframe.solvers import SemismoothNewton

MESHES = (
    ("quad4", 4, 2, 5.0),
    ("quad4", 8, 4, 2.25),
    ("quad4", 16, 7, 1.5),
    ("quad9", 2, 1, 3.0),
    ("quad9", 4, 2, 3.0),
    ("quad8", 4, 2, 3.0),
    ("quad8", 8, 4, 1.73),
)
"""Element, divisions of the zone, rings around it, growth."""


def totals(case: Case) -> Array:
    """Return the normal force [N], charge [C] and magnetic flux [Wb] at the end."""
    result = meeframe.solve_case(case)
    last = result.steps[-1]
    resultants: Array = result.zone.weights @ np.column_stack([last.traction[:, 2], last.fluxes])
    return resultants


def main() -> None:
    """Print one row for each mesh."""
    case = meeframe.load_case(Path(__file__).parent / "conducting_sphere.toml")
    print("| element, divisions | `growth` | force | charge | magnetic flux |\n| --- | --- | --- | --- | --- |")
    for name, divisions, rings, growth in MESHES:
        layers = max(1, min(2, rings))
        mesh = block_mesh(0.05, 0.12, 0.005, divisions, rings, layers, ELEMENTS[name])
        bem, fem = (
            totals(replace(case, mesh=mesh, formulation=formulation, solver=SemismoothNewton()))
            for formulation in (DenseBEM(), FiniteElements(growth=growth))
        )
        cells = " | ".join(f"{100 * difference:.2g} %" for difference in fem / bem - 1)
        print(f"| `{name}`, {divisions} | {growth:g} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
