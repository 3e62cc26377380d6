"""Files of FCLIB: increments of a case for solvers of others to judge ours, problems of others for our solvers."""

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
from meeframe.results.output import check_place
from meeframe.results.records import StepResult
from meeframe.solvers import StoppingCriteria
from meeframe.study.choices import Choice
from meeframe.system.reduced import Progress, ReducedSystem, silent


def export_increment(
    case: Case, out: Path, number: int | None = None, overwrite: bool = False, progress: Progress = silent
) -> StepResult:
    """Run a case up to an increment and write that one's contact problem as a file of FCLIB; its result.

    number: of the increment, counted through all load steps from 1; the last one if None. The file has our solution
    besides if it converged. Raises CaseError if there is no such increment or FCLIB cannot say the problem (see
    meeframe.results.fclib_contact.local_problem), ResultError if the file exists and overwrite is false, or cannot be
    written.
    """
    wanted = case.n_increments if number is None else number
    if not 1 <= wanted <= case.n_increments:
        raise CaseError(f"--increment {wanted}; allowed: 1 to {case.n_increments}, the increments of the case")
    if out.exists() and not overwrite:
        raise ResultError(f"{out} exists; name another file or pass --overwrite")
    check_place(out)
    friction_coefficient(case.contact_law)  # refused before anything is computed
    system = reduce(case, progress)
    step = next(islice(solve_steps(case, system, progress, boundary=False), wanted - 1, None))
    problem, solution = exchanged(case, system, step)
    write_local(out, problem, solution if step.status is Status.CONVERGED else None)
    return step


@dataclass(frozen=True)
class SolvedFile:
    """Outcome of a file's problem: status of the solver, and a description in words."""

    status: Status
    summary: str


def solve_file(path: Path, solver: str, tolerance: float, overwrite: bool, registry: Registry) -> SolvedFile:
    """Solve the problem of a file; a solution that converges goes into the file if it has none, or if overwrite.

    solver: name or inline table, as in a case file. Raises CaseError, PluginError or ResultError for bad input, before
    anything is computed; a solution of the file that cannot be read is bad input unless overwrite.
    """
    chosen = registry.create(Kind.SOLVER, Choice.read("solver", solver).value)
    limits = StoppingCriteria(tolerance=tolerance)
    problem = read_local(path)
    try:
        before = read_solution(path)
    except ResultError as error:
        if not overwrite:
            raise ResultError(f"{error}; pass --overwrite to replace it") from None
        before = None
    if before is None or overwrite:
        check_place(path)
    solution, found = solve_local(problem, chosen, limits)
    words = [
        f"{len(problem.mu)} contacts",
        f"{found.status} in {found.iterations} iterations: {found.message}",
        f"natural residual {natural_residual(problem, solution.r):.1e}",
    ]
    if before is not None:
        largest = float(np.abs(before.r).max()) or 1.0
        words.append(f"reactions differ from those of the file by {np.abs(solution.r - before.r).max() / largest:.1e}")
    if found.status is Status.CONVERGED and (before is None or overwrite):
        write_solution(path, solution)
        words.append("solution written")
    elif before is not None:
        words.append("the solution of the file stays")
    return SolvedFile(found.status, "; ".join(words))


def exchanged(case: Case, system: ReducedSystem, step: StepResult) -> tuple[LocalProblem, LocalSolution]:
    """Return an increment of a case as a problem of FCLIB, and our solution of it.

    What was free to move, and what conducts, is held where the increment ended. Raises CaseError as `local_problem`.
    """
    problem, state = held_problem(case, system, step), step.state
    described = (
        f"Increment {step.increment} of load step {step.step}, {type(problem.contact_law).__name__}; "
        "u: gap and slip of the increment [m], r: force on the body reversed [N]"
    )
    return local_problem(problem, state, case.title, described), local_solution(problem, state)


def held_problem(case: Case, system: ReducedSystem, step: StepResult) -> ContactProblem:
    """Return the contact problem of an increment with its indenter where it was found: nothing is free."""
    here = step.state
    translation = step.slip + here.displacement[:, :2]
    potentials = np.tile(step.loading.motion[N_RIGID:], (len(translation), 1))
    return ContactProblem(system, case.contact_law, case.channels, step.initial_gap, translation, potentials)
