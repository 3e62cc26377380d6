"""Driver loop around every solver."""

import warnings

import numpy as np
from scipy.linalg import LinAlgWarning

from meeframe.common.blas import ONE_BLAS_THREAD
from meeframe.common.memory import keep_freed_memory
from meeframe.contact.problem import ContactProblem, ContactSolution, ContactState, Solver
from meeframe.solvers.monitor import ConvergenceMonitor
from meeframe.solvers.stopping import StoppingCriteria
from meeframe.system.reduced import Progress, silent


def solve(
    problem: ContactProblem,
    solver: Solver,
    criteria: StoppingCriteria | None = None,
    start: ContactState | None = None,
    progress: Progress = silent,
) -> ContactSolution:
    """Iterate until the stopping criteria are met or something goes wrong.

    Parameters
    ----------
    problem : ContactProblem
        Problem to solve.
    solver : Solver
        Solver that iterates.
    criteria : StoppingCriteria, optional
        Criteria that end the iteration.
    start : ContactState, optional
        Converged state of the previous load step.
    progress : callable, optional
        Called whenever the driver evaluates an iterate, every `solver.check_interval` steps and at the last one, with
        the fraction, in decades, of the way to the tolerance.

    Returns
    -------
    ContactSolution
        The last state with its status and the reason in words. An iteration that fails raises nothing.
    """
    keep_freed_memory()
    criteria = criteria or StoppingCriteria()
    # one thread: products of contact size are too small to share, and synchronisation costs far more
    with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore", category=LinAlgWarning), ONE_BLAS_THREAD:
        monitor = ConvergenceMonitor(problem, solver, criteria)
        tolerances = (criteria.tolerance,) if criteria.by_residual else ()
        iterate = solver.init(problem, start, *tolerances)
        monitor.begin(iterate)
        while monitor.outcome is None:
            iterate = solver.step(problem, iterate)
            if monitor.observe(iterate):
                progress("contact", monitor.fraction)
        return monitor.conclude(iterate)
