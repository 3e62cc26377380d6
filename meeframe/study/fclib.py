"""Exchange of contact problems in FCLIB files: export of increments, and solution of other problems."""

from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from meeframe.common.errors import CaseError, ResultError
from meeframe.contact.problem import ContactProblem, Status
from meeframe.indenters.base import N_RIGID
from meeframe.model.case import Case
from meeframe.model.solve import reduce, solve_steps
from meeframe.plugin.registry import Kind, Registry
from meeframe.results.fclib import (
    LocalProblem,
    LocalSolution,
    natural_residual,
    read_local,
    read_solution,
    write_local,
    write_solution,
)
from meeframe.results.fclib_contact import friction_coefficient, local_problem, local_solution, solve_local
from meeframe.results.output import check_writable
from meeframe.results.records import StepResult
from meeframe.solvers import StoppingCriteria
from meeframe.study.choices import Choice
from meeframe.system.reduced import Progress, ReducedSystem, silent


def export_increment(
    case: Case, out: Path, number: int | None = None, overwrite: bool = False, progress: Progress = silent
) -> StepResult:
    """Run a case up to an increment and write the contact problem of that increment as an FCLIB file.

    The file contains the solution if the increment converged.

    Parameters
    ----------
    case
        The case.
    out
        The file to write.
    number
        Number of the increment, counted through all load steps from 1; by default the last one.
    overwrite
        Whether an existing file is replaced.
    progress
        Called with the stage and the fraction of it that is done.

    Returns
    -------
    StepResult
        Result of the increment.

    Raises
    ------
    CaseError
        If there is no such increment or FCLIB cannot represent the problem, see
        `meeframe.results.fclib_contact.local_problem`.
    ResultError
        If the file exists and overwrite is false, or if it cannot be written.
    """
    increment = case.n_increments if number is None else number
    if not 1 <= increment <= case.n_increments:
        raise CaseError(f"--increment {increment}; allowed: 1 to {case.n_increments}, the increments of the case")
    if out.exists() and not overwrite:
        raise ResultError(f"{out} exists; name another file or pass --overwrite")
    check_writable(out)
    friction_coefficient(case.contact_law)  # raises before anything is computed
    system = reduce(case, progress)
    step = next(islice(solve_steps(case, system, progress, boundary=False), increment - 1, None))
    problem, solution = exchange_increment(case, system, step)
    write_local(out, problem, solution if step.status is Status.CONVERGED else None)
    return step


@dataclass(frozen=True)
class SolvedFile:
    """Outcome of the problem of a file.

    Attributes
    ----------
    status
        Status of the solver.
    summary
        Description in words.
    """

    status: Status
    summary: str


def solve_file(path: Path, solver: str, tolerance: float, overwrite: bool, registry: Registry) -> SolvedFile:
    """Solve the problem of a file.

    A converged solution is stored in the file if it has none or if overwrite is true.

    Parameters
    ----------
    path
        The FCLIB file.
    solver
        Name or inline table, as in a case file.
    tolerance
        Tolerance of the residual.
    overwrite
        Whether an existing solution is replaced. Otherwise a solution that cannot be read is an error.
    registry
        Registry of plugins.

    Raises
    ------
    CaseError, PluginError, ResultError
        Before anything is computed, for invalid input.
    """
    chosen = registry.create(Kind.SOLVER, Choice.read("solver", solver).value)
    stopping = StoppingCriteria(tolerance=tolerance)
    problem = read_local(path)
    try:
        previous = read_solution(path)
    except ResultError as error:
        if not overwrite:
            raise ResultError(f"{error}; pass --overwrite to replace it") from None
        previous = None
    if previous is None or overwrite:
        check_writable(path)
    solution, outcome = solve_local(problem, chosen, stopping)
    messages = [
        f"{len(problem.mu)} contacts",
        f"{outcome.status} in {outcome.iterations} iterations: {outcome.message}",
        f"natural residual {natural_residual(problem, solution.r):.1e}",
    ]
    if previous is not None:
        largest = float(np.abs(previous.r).max()) or 1.0
        messages.append(
            f"reactions differ from those in the file by {np.abs(solution.r - previous.r).max() / largest:.1e}"
        )
    if outcome.status is Status.CONVERGED and (previous is None or overwrite):
        write_solution(path, solution)
        messages.append("solution written")
    elif previous is not None:
        messages.append("the solution in the file is unchanged")
    return SolvedFile(outcome.status, "; ".join(messages))


def exchange_increment(case: Case, system: ReducedSystem, step: StepResult) -> tuple[LocalProblem, LocalSolution]:
    """Return an increment of a case as an FCLIB problem and its solution.

    Free motions and potentials are fixed at their values at the end of the increment. Raises CaseError as
    `local_problem`.
    """
    problem, state = held_problem(case, system, step), step.state
    description = (
        f"Increment {step.increment} of load step {step.step}, {type(problem.contact_law).__name__}; "
        "u: gap and slip of the increment [m], r: force on the body reversed [N]"
    )
    return local_problem(problem, state, case.title, description), local_solution(problem, state)


def held_problem(case: Case, system: ReducedSystem, step: StepResult) -> ContactProblem:
    """Return the contact problem of an increment with the indenter fixed at its final position."""
    state = step.state
    translation = step.slip + state.displacement[:, :2]
    potentials = np.tile(step.loading.motion[N_RIGID:], (len(translation), 1))
    return ContactProblem(system, case.contact_law, case.channels, step.initial_gap, translation, potentials)
