"""Prints the tables of docs/laws-interface.md: errors of forces with `dugdale` against the theory of Maugis, and cells
that soft bodies need.

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
"""Over the width of a square that is 1.2 times as wide as the largest outer radius of attraction asks."""
CONTACTS = (1.2, 1.4, 1.6, 1.8)
"""Contact radii in units of (pi w R^2 / K)^(1/3)."""
SOFT = (1.0, 3.0, 5.0)
PARAMETERS, TRANSITIONS = (0.1, 0.3, 0.5, 1.0), (0.4, 0.2, 1.0)


def error(parameter: float, transition: float, cells: int) -> float:
    """Return the root mean square error of the force over CONTACTS, in units of pi w R.

    Raises RuntimeError if the iteration does not converge.
    """
    unit = Maugis(RADIUS, MODULUS, WORK, 1.0)
    theory = replace(unit, stress=parameter / unit.transition)
    law = Dugdale(WORK, theory.stress, transition)
    system = quarter_half_space(MODULUS, 1.2 * theory.at(CONTACTS[-1] * theory.contact_unit)[0], cells // 2)
    off = []
    for contact in CONTACTS:
        _, force, approach = theory.at(contact * theory.contact_unit)
        solution = solve(indentation_problem(system, paraboloid(system, RADIUS), approach, law), Auto())
        if solution.status is not Status.CONVERGED:
            raise RuntimeError(f"{parameter}, {transition}, {cells}: {solution.message}")
        off.append(-float(system.weights @ solution.state.load[:, 2]) - force)
    return float(np.sqrt(np.mean(np.square(off)))) / theory.force_unit


def least_cells(parameter: float, transition: float) -> int:
    """Return the cells from which on none snaps into contact on its own, over the width that `error` takes."""
    unit = Maugis(RADIUS, MODULUS, WORK, 1.0)
    theory = replace(unit, stress=parameter / unit.transition)
    width = 2.4 * theory.at(CONTACTS[-1] * theory.contact_unit)[0]
    own = 4.0 * np.log(1.0 + np.sqrt(2.0)) / np.pi * width / MODULUS  # of one square cell as wide as all of them
    return int(np.ceil(own * steepest_fall(Dugdale(WORK, theory.stress, transition))))


def table() -> Iterator[str]:
    """Rows as they are found."""
    yield f"| `transition` | lambda | {' | '.join(f'n = {cells}' for cells in CELLS)} |\n{'| --- ' * (2 + len(CELLS))}|"
    for transition in TRANSITIONS:
        for parameter in PARAMETERS:
            found = (f"{error(parameter, transition, cells):.2g}" for cells in CELLS)
            yield f"| {transition:g} | {parameter:g} | {' | '.join(found)} |"
    yield f"\n| `transition` | {' | '.join(f'lambda = {value:g}' for value in SOFT)} |\n{'| --- ' * (1 + len(SOFT))}|"
    for transition in TRANSITIONS:
        yield f"| {transition:g} | {' | '.join(f'n = {least_cells(value, transition)}' for value in SOFT)} |"


if __name__ == "__main__":
    for line in table():
        print(line, flush=True)
