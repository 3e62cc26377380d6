"""Print the tables of docs/reference/laws-interface.md about `dugdale`.

They give the errors of forces with respect to the theory of Maugis, and the cells that soft bodies require.

Usage: uv run python plugins/meeframe-laws/pictures/maugis.py
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from interface import paraboloid
from meeframe_laws.interface import Dugdale

from meeframe.contact.problem import Status
from meeframe.model.diagnostics import steepest_fall
from meeframe.solvers import Auto, solve
from meeframe.testing.closed_forms_adhesion import Maugis, quarter_half_space
from meeframe.testing.half_space import indentation_problem

WORK, RADIUS, MODULUS = 0.05, 1e-6, 4e9
CELLS = (16, 32, 48, 64)
"""Numbers of cells over the width of a square of 1.2 times the largest outer radius of the attraction."""
CONTACTS = (1.2, 1.4, 1.6, 1.8)
"""Contact radii in units of (pi w R^2 / K)^(1/3)."""
SOFT = (1.0, 3.0, 5.0)
PARAMETERS, TRANSITIONS = (0.1, 0.3, 0.5, 1.0), (0.4, 0.2, 1.0)


def error(parameter: float, transition: float, cells: int) -> float:
    """Return the root mean square error of the force over CONTACTS, in units of pi w R.

    Raises
    ------
    RuntimeError
        If the iteration does not converge.
    """
    unit = Maugis(RADIUS, MODULUS, WORK, 1.0)
    theory = replace(unit, stress=parameter / unit.transition)
    law = Dugdale(WORK, theory.stress, transition)
    system = quarter_half_space(MODULUS, 1.2 * theory.at(CONTACTS[-1] * theory.contact_unit)[0], cells // 2)
    deviations = []
    for contact in CONTACTS:
        _, force, approach = theory.at(contact * theory.contact_unit)
        solution = solve(indentation_problem(system, paraboloid(system, RADIUS), approach, law), Auto())
        if solution.status is not Status.CONVERGED:
            raise RuntimeError(f"{parameter}, {transition}, {cells}: {solution.message}")
        deviations.append(-float(system.weights @ solution.state.load[:, 2]) - force)
    return float(np.sqrt(np.mean(np.square(deviations)))) / theory.force_unit


def least_cells(parameter: float, transition: float) -> int:
    """Return the number of cells, over the width in `error`, from which on no single cell snaps into contact."""
    unit = Maugis(RADIUS, MODULUS, WORK, 1.0)
    theory = replace(unit, stress=parameter / unit.transition)
    width = 2.4 * theory.at(CONTACTS[-1] * theory.contact_unit)[0]
    compliance = (
        4.0 * np.log(1.0 + np.sqrt(2.0)) / np.pi * width / MODULUS
    )  # the compliance of one square cell of the total width
    return int(np.ceil(compliance * steepest_fall(Dugdale(WORK, theory.stress, transition))))


def table() -> Iterator[str]:
    """Yield the lines of the table as they are computed."""
    yield f"| `transition` | lambda | {' | '.join(f'n = {cells}' for cells in CELLS)} |\n{'| --- ' * (2 + len(CELLS))}|"
    for transition in TRANSITIONS:
        for parameter in PARAMETERS:
            errors = (f"{error(parameter, transition, cells):.2g}" for cells in CELLS)
            yield f"| {transition:g} | {parameter:g} | {' | '.join(errors)} |"
    yield f"\n| `transition` | {' | '.join(f'lambda = {value:g}' for value in SOFT)} |\n{'| --- ' * (1 + len(SOFT))}|"
    for transition in TRANSITIONS:
        yield f"| {transition:g} | {' | '.join(f'n = {least_cells(value, transition)}' for value in SOFT)} |"


if __name__ == "__main__":
    for line in table():
        print(line, flush=True)
