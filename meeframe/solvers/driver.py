"""Driver loop around every solver, and the second solution that resolves contact edges between nodes."""

import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.linalg import LinAlgWarning

from meeframe.common.blas import ONE_BLAS_THREAD
from meeframe.common.memory import keep_freed_memory
from meeframe.contact.conduction import MIN_PRESSURE, MIN_TRACTION, is_partial
from meeframe.contact.free_motion import start_below_indenter
from meeframe.contact.generated_heat import heat_moves_surface
from meeframe.contact.problem import ContactProblem, ContactSolution, ContactState, Solver, Status
from meeframe.fields import NORMAL
from meeframe.laws.base import contact_conductivity
from meeframe.solvers.stopping import ConvergenceMonitor, StoppingCriteria
from meeframe.system.capabilities import EdgeResolution, IndenterEdge
from meeframe.system.edge_correction import correct_edge
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
        iterate = solver.init(problem, start_below_indenter(problem, start), *tolerances)
        monitor.begin(iterate)
        while monitor.outcome is None:
            iterate = solver.step(problem, iterate)
            if monitor.observe(iterate):
                progress("contact", monitor.fraction)
        return monitor.conclude(iterate)


def solve_to_edges(
    problem: ContactProblem,
    solver: Solver,
    criteria: StoppingCriteria | None = None,
    start: ContactState | None = None,
    progress: Progress = silent,
    indenter_edge: Callable[[], IndenterEdge | None] = lambda: None,
) -> tuple[ContactSolution, ContactProblem]:
    """Solve a problem, then once more with the contact edge between nodes if the system resolves edges.

    The second solution is computed where a load is singular at the edge. Heat through the contact that moves the
    surface also moves the edge, which is then located and the problem solved once more.

    Parameters
    ----------
    problem, solver, criteria, start, progress
        As in `solve`; the criteria end each of the iterations.
    indenter_edge : callable, optional
        Returns the edge of the indenter, or None if it has none; called only if the system resolves edges.

    Returns
    -------
    ContactSolution
        Last solution; a first solution that did not converge is returned as it is.
    ContactProblem
        Problem that it solves.
    """
    solution, last = solve(problem, solver, criteria, start, progress), problem
    for _ in range(2 if heat_moves_surface(problem) else 1):
        resolved = (
            resolve_edges(problem, solution.state, indenter_edge) if solution.status is Status.CONVERGED else None
        )
        if resolved is None:
            break
        solution, last = solve(resolved, solver, criteria, solution.state, progress), resolved
    return solution, last


def resolve_edges(
    problem: ContactProblem, state: ContactState, indenter_edge: Callable[[], IndenterEdge | None] = lambda: None
) -> ContactProblem | None:
    """Return the problem with the contact edge of a state between nodes.

    Parameters
    ----------
    problem, state : ContactProblem and ContactState
        Contact problem, and its solution with the contact edge at nodes.
    indenter_edge : callable, optional
        Function that returns the edge of the indenter; called only if the system resolves edges.

    Returns
    -------
    ContactProblem or None
        None if the system does not resolve edges; where no load is singular at the edge, as for smooth indenters with
        laws that conduct nothing without pressure; and where the contact ends with the indenter of unknown edge.
    """
    resolution = problem.system.capability(EdgeResolution)
    if resolution is None:
        return None
    pressure = np.maximum(-state.load[:, NORMAL], 0.0)
    # round-off at biactive nodes would move the edge
    pressure[is_partial(state.contact_fraction) | (pressure < MIN_PRESSURE * pressure.max(initial=0.0))] = 0.0
    smooth, edge = resolution.edge_correction(pressure), indenter_edge()
    correction = smooth if edge is None else resolution.edge_correction(pressure, edge)
    # the indenter's edge counts only if it changes the contact edge: the contact may not reach it
    is_indenter_edge = edge is not None and not np.array_equal(correction.extra_compliance, smooth.extra_compliance)
    if not (is_indenter_edge or _conducts_at_edge(problem)):
        return None
    gap = problem.gap
    if edge is not None:
        gap = np.where(correction.area_fraction > 0.0, np.minimum(gap, edge.gap), gap)
    elif (np.isinf(gap) & (correction.area_fraction > 0.0)).any():
        return None
    area_fraction = np.where(np.isfinite(gap), correction.area_fraction, 0.0)
    return replace(
        problem, system=correct_edge(problem.system, correction.extra_compliance), gap=gap, area_fraction=area_fraction
    )


def _conducts_at_edge(problem: ContactProblem) -> bool:
    """Return whether a law conducts in the limit of vanishing pressure."""
    touching = np.array([MIN_TRACTION])
    return any(
        channel.is_conducting
        and not channel.law.across_gap
        and bool((contact_conductivity(channel.law, touching) > 0.0).any())
        for channel in problem.channels
    )
