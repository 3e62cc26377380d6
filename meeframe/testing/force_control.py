"""Contact under prescribed forces and charges: prescribed resultants, problems, and checks of their solutions."""

from dataclasses import replace
from typing import Final

import numpy as np

from meeframe.contact.conduction import potential_diagonal
from meeframe.contact.problem import (
    ContactProblem,
    ContactSolution,
    ContactState,
    PrescribedResultant,
    Solver,
    Status,
    resultant,
    unbalance,
)
from meeframe.fields import ELECTRIC, MAGNETIC, Array
from meeframe.laws import Insulating, StepConductivity
from meeframe.laws.base import ContactLaw
from meeframe.material import library_material
from meeframe.solvers import StoppingCriteria, residual, solve
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.contact_cases import APPROACH, SphereCase
from meeframe.testing.requirements import require

PRESS: Final = np.array([0.0, 0.0, -1.0, 0.0, 0.0])
SLIDE: Final = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
SLIDE_2: Final = np.array([0.0, 1.0, 0.0, 0.0, 0.0])
VOLTAGE, MAGNETOMOTIVE = -np.eye(5)[[ELECTRIC, MAGNETIC]]
TIGHT_CRITERIA: Final = StoppingCriteria(tolerance=1e-11, max_iterations=5000)
BALANCE_TOLERANCE: Final = 1e-11
LOAD_TOLERANCE: Final = 1e-8


def prescribe_resultant(
    system: ReducedSystem, mode: Array, total: float, density: Array | None = None
) -> PrescribedResultant:
    """Return a prescribed resultant, positive outwards for charges and fluxes.

    Parameters
    ----------
    system
        The reduced system.
    mode
        Motion (5,) of every node or (n, 5), which the resultant works on.
    total
        Force, moment, charge or flux [N, N m, C, Wb].
    density
        Density of the resultant, like `mode`; by default the mode.
    """
    outward = -1.0 if mode[..., 3:].any() else 1.0
    modes = np.broadcast_to(mode, system.offset.shape)
    density = outward * (mode if density is None else density)
    return PrescribedResultant(modes, np.broadcast_to(density, modes.shape), system.weights, float(total))


def conducting_sphere(
    law: ContactLaw,
    kappa: tuple[float, float] = (0.0, 0.0),
    drag: float = 0.0,
    cells: int = 8,
    potentials: tuple[float, float] = (2e4, -15.0),
) -> ContactProblem:
    """Return the sphere of SphereCase on the orthotropic medium.

    Parameters
    ----------
    law
        Contact law.
    kappa
        Electric and magnetic conductivity in units of the inverse diagonal response of a node.
    drag
        Tangential displacement in approaches.
    cells
        Number of cells along a side of the contact zone.
    potentials
        Electric [V] and magnetic [A] potential of the indenter.
    """
    medium = library_material("orthotropic-mee")
    case = SphereCase(medium, law, Insulating(), Insulating(), cells, drag, potentials=potentials)
    scales = potential_diagonal(case.problem())[0]
    electric, magnetic = (StepConductivity(float(k / o)) for k, o in zip(kappa, scales, strict=True))
    return replace(case, electric=electric, magnetic=magnetic).problem()


def released(problem: ContactProblem, state: ContactState, *prescribed: str) -> tuple[ContactProblem, Array]:
    """Return a problem of SphereCase with the resultants of its solution as data, and the motions to be found.

    Parameters
    ----------
    problem
        A problem of SphereCase.
    state
        Its solution.
    *prescribed
        Motions that become unknown, of 'approach', 'translation' and 'potentials'.
    """
    system, zero = problem.system, np.zeros_like(problem.potentials)
    force, (charge, flux) = resultant(system, state.load)
    prescribed_resultants: list[PrescribedResultant] = []
    motions: list[float] = []
    if "approach" in prescribed:
        prescribed_resultants += [prescribe_resultant(system, PRESS, -force[2])]
        motions += [APPROACH]
        problem = replace(problem, gap=problem.gap + APPROACH)
    if "translation" in prescribed:
        prescribed_resultants += [
            prescribe_resultant(system, SLIDE, force[0]),
            prescribe_resultant(system, SLIDE_2, force[1]),
        ]
        motions += [*problem.translation[0]]
        problem = replace(problem, translation=zero)
    if "potentials" in prescribed:
        prescribed_resultants += [
            prescribe_resultant(system, VOLTAGE, charge),
            prescribe_resultant(system, MAGNETOMOTIVE, flux),
        ]
        motions += [*problem.potentials[0]]
        problem = replace(problem, potentials=zero)
    return replace(problem, prescribed_resultants=tuple(prescribed_resultants)), np.array(motions)


def balanced_solution(
    problem: ContactProblem,
    solver: Solver,
    stopping: StoppingCriteria = TIGHT_CRITERIA,
    start: ContactState | None = None,
) -> ContactSolution:
    """Return the solution of a problem. Raises AssertionError unless it converged to the prescribed resultants."""
    solution = solve(problem, solver, stopping, start)
    state = solution.state
    require(solution.status is Status.CONVERGED, f"{solver}: {solution.message}", solution.residual)
    value = residual(problem, state)
    require(value <= 2.0 * stopping.tolerance, f"{solver}: residual of the state handed over", value)
    require(
        len(state.motion) == len(problem.prescribed_resultants),
        f"{solver}: one motion for each prescribed resultant",
        state.motion,
    )
    for error, free in zip(unbalance(problem, state.load), problem.prescribed_resultants, strict=True):
        size = max(abs(free.total), float(np.abs(free.measure * state.load).sum()))
        require(abs(error) <= BALANCE_TOLERANCE * size, f"{solver}: resultant off by", error)
    return solution


def check_same(state: ContactState, expected: ContactState) -> None:
    """Raise AssertionError unless tractions and fluxes agree to 1e-8 of the largest."""
    error = np.abs(state.load - expected.load).max(axis=0)
    require(
        (error <= LOAD_TOLERANCE * np.abs(expected.load).max(axis=0)).all(), "tractions and fluxes differ by", error
    )
