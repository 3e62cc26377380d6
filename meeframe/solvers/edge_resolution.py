"""Resolution of contact edges between nodes: one solution with the edge along nodes, then one with its position."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meeframe.contact.conduction import TOUCHING
from meeframe.contact.problem import ContactProblem, ContactSolution, ContactState, Solver, Status
from meeframe.laws.base import contact_conductivity
from meeframe.solvers.driver import solve
from meeframe.solvers.stopping import StoppingCriteria
from meeframe.system.capabilities import EdgeResolution, IndenterEdge
from meeframe.system.edge_correction import correct_edge
from meeframe.system.reduced import Progress, silent


def solve_to_edges(
    problem: ContactProblem,
    solver: Solver,
    limits: StoppingCriteria | None = None,
    start: ContactState | None = None,
    progress: Progress = silent,
    rim: Callable[[], IndenterEdge | None] = lambda: None,
) -> tuple[ContactSolution, ContactProblem]:
    """Solve a problem, then once more with the contact edge between nodes if the system resolves edges.

    Returns the solution and the problem that it solves. The second solution is computed where a load is singular at the
    edge. The other arguments are those of `solve`; rim: returns the edge of the indenter. A first solution that did not
    converge is returned as it is.
    """
    solution = solve(problem, solver, limits, start, progress)
    if solution.status is not Status.CONVERGED:
        return solution, problem
    finer = resolved(problem, solution.state, rim)
    if finer is None:
        return solution, problem
    return solve(finer, solver, limits, solution.state, progress), finer


def resolved(
    problem: ContactProblem, state: ContactState, rim: Callable[[], IndenterEdge | None] = lambda: None
) -> ContactProblem | None:
    """Return the problem with the contact edge of a state; None if its system does not resolve edges.

    None is also returned where no load is singular at the edge: for smooth indenters with laws that conduct nothing
    without pressure; and where the contact ends with the indenter, but the edge of the indenter is unknown.
    rim: returns the edge of the indenter; called only if the system resolves edges.
    """
    pressure = np.maximum(-state.load[:, 2], 0.0)
    resolution = problem.system.capability(EdgeResolution)
    if resolution is None:
        return None
    smooth, end = resolution.edge_correction(pressure), rim()
    edges = smooth if end is None else resolution.edge_correction(pressure, end)
    # the indenter's edge counts only if it changes the contact edge: the contact may not reach it
    ends = end is not None and not np.array_equal(edges.extra_compliance, smooth.extra_compliance)
    if not (ends or _charged_edge(problem)):
        return None
    gap = problem.gap
    if end is not None:
        gap = np.where(edges.area_fraction > 0.0, np.minimum(gap, end.gap), gap)
    elif (np.isinf(gap) & (edges.area_fraction > 0.0)).any():
        return None
    area_fraction = np.where(np.isfinite(gap), edges.area_fraction, 0.0)
    return replace(
        problem, system=correct_edge(problem.system, edges.extra_compliance), gap=gap, area_fraction=area_fraction
    )


def _charged_edge(problem: ContactProblem) -> bool:
    """Return whether a law conducts in the limit of vanishing pressure."""
    least = np.array([TOUCHING])
    return any(
        channel.is_conducting
        and not channel.law.across_gap
        and bool((contact_conductivity(channel.law, least) > 0.0).any())
        for channel in problem.channels
    )
