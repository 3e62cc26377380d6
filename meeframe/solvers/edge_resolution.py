"""Contact whose edge lies between the nodes: solved with the edge along nodes, then once more with it where it is."""

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
    """As `solve`; where the system resolves edges and a load is singular there, the solution with the edge between the
    nodes, and the problem that it is the solution of.

    rim: gives where the indenter ends. A first solution that did not converge is handed over as it is.
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
    """The problem with the edge of the contact as a state of it has it; None if its system does not resolve edges.

    Nor is there anything to resolve where no load is singular at the edge: smooth indenters, and laws that conduct
    nothing without pressure; nor, if nobody knows where the indenter ends, where the contact ends with it.
    rim: gives where the indenter ends; asked for only if the system resolves edges.
    """
    pressure = np.maximum(-state.load[:, 2], 0.0)
    resolution = problem.system.capability(EdgeResolution)
    if resolution is None:
        return None
    smooth, end = resolution.edge_correction(pressure), rim()
    edges = smooth if end is None else resolution.edge_correction(pressure, end)
    # a rim counts if it changes the edge: one somewhere in the zone, which the contact does not reach, is none
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
    """Whether a law conducts where the pressure fades."""
    least = np.array([TOUCHING])
    return any(
        channel.conducts and not channel.law.across_gap and bool((contact_conductivity(channel.law, least) > 0.0).any())
        for channel in problem.channels
    )
