"""From a case to its result in memory: one reduced system, then one contact problem for each load step."""

import platform
from collections.abc import Iterator
from dataclasses import replace
from importlib import metadata

import numba
import numpy as np

from meeframe.case.case import Case
from meeframe.case.clock import Clock, peak_memory_mb
from meeframe.core.contact import ContactProblem, ContactSolution, Status
from meeframe.core.errors import CaseError
from meeframe.core.fields import Array
from meeframe.core.formulation import Progress, ReducedSystem, silent
from meeframe.core.mesh import Indices
from meeframe.core.result import Loading, Provenance, Result, StepResult, Zone, corners, split_displacement, split_load
from meeframe.geometry import ContactZone, initial_gap
from meeframe.plugin import registry as plugins
from meeframe.solvers import solve


def solve_case(case: Case, progress: Progress = silent) -> Result:
    """The result of a case, in memory.

    Raises as `reduce`. A step that does not converge raises nothing: its status says so.
    """
    clock = Clock(progress)
    system = reduce(case, clock)
    steps = tuple(solve_steps(case, system, clock))
    return Result(provenance(case), zone_of(system), len(case.steps), steps, clock.timings(), peak_memory_mb())


def reduce(case: Case, progress: Progress = silent) -> ReducedSystem:
    """The reduced system of a case.

    Raises MeshError, CaseError or MaterialError if the formulation does not take the body, CaseError if its matrices do
    not fit into memory.
    """
    try:
        return case.formulation.reduce(case.body, progress)
    except MemoryError as error:
        raise CaseError(
            f"mesh: {case.mesh.n_elements} elements with {len(case.mesh.points)} nodes need more memory than there is "
            f"({str(error) or 'none left'}); allowed: a coarser mesh"
        ) from None


def solve_steps(
    case: Case, system: ReducedSystem, clock: Progress = silent, boundary: bool = True
) -> Iterator[StepResult]:
    """The load steps of a case one after the other, each started from the last one that converged.

    Slip is measured from that state too (notes, section 7): the first step, from the undeformed body, is the paper's.
    boundary: recover the fields on the whole boundary too, which a study of the contact zone does not need.
    """
    start, slipped = None, np.zeros((len(system.points), 2))
    for number, loading in enumerate(case.steps):
        problem = _problem(case, system, loading, slipped)

        def show(stage: str, fraction: float, number: int = number) -> None:
            clock(stage, (number + fraction) / len(case.steps))

        show("contact", 0.0)
        solution = solve(problem, case.solver, case.limits, start, show)
        if solution.status is Status.CONVERGED:
            start = solution.state
            slipped = slipped + problem.translation - start.displacement[:, :2]
        result = _step_result(system, problem, loading, solution)
        if boundary:
            clock("boundary fields", 0.0)
            result = replace(result, boundary=system.recover(solution.state.load))
        yield result


def zone_of(system: ReducedSystem) -> Zone:
    """The contact zone of a reduced system."""
    return Zone(system.points, system.frames, system.weights, system.cells)


def provenance(case: Case) -> Provenance:
    """What makes a result of this case, here and now."""
    libraries = ("numpy", "scipy", "numba", "h5py", "pydantic")
    versions = {"python": platform.python_version(), **{name: metadata.version(name) for name in libraries}}
    versions |= {provider.name: provider.version for provider in plugins.load().providers}
    return Provenance(case.title, case.text, versions, numba.get_num_threads())


def _problem(case: Case, system: ReducedSystem, loading: Loading, slipped: Array) -> ContactProblem:
    """The contact problem of a load step; slipped: (n, 2) how far the indenter has slipped over the body before [m]."""
    zone = ContactZone(system.points, system.frames, system.weights, system.cells, np.arange(len(system.points)))
    translation = system.frames @ (np.array(loading.translation) @ case.placement.base[:2])
    # where the zone is not parallel to the plane of translation the indenter also moves along the normal
    gap = initial_gap(case.indenter, zone, case.placement, loading.approach) + translation[:, 2]
    potentials = np.tile([loading.electric_potential, loading.magnetic_potential], (len(gap), 1))
    laws = case.contact_law, case.electric_law, case.magnetic_law
    return ContactProblem(system, *laws, gap, translation[:, :2] - slipped, potentials)


def _step_result(
    system: ReducedSystem, problem: ContactProblem, loading: Loading, solution: ContactSolution
) -> StepResult:
    state = solution.state
    traction, fluxes = split_load(state.load)
    displacement, potentials = split_displacement(state.displacement)
    return StepResult(
        loading=loading,
        initial_gap=problem.gap,
        traction=traction,
        displacement=displacement,
        potentials=potentials,
        fluxes=fluxes,
        closed=state.closed,
        status=solution.status,
        iterations=solution.iterations,
        residual=solution.residual,
        history=solution.history,
        message=solution.message + _remark(system, solution),
    )


def _remark(system: ReducedSystem, solution: ContactSolution) -> str:
    """A remark if nothing touches or if the contact reaches the edge of its zone, where it is cut off; else ""."""
    touching = solution.state.load[:, 2] < 0
    if solution.status is Status.CONVERGED and not touching.any():
        return "; the indenter does not touch the body"
    count = int(touching[_border_sides(system.cells)].all(axis=1).sum())
    return f"; the contact reaches the edge of its zone at {count} element sides" if count else ""


def _border_sides(cells: tuple[tuple[str, Indices], ...]) -> Indices:
    """Corners (m, 2) of the sides that belong to one cell only."""
    sides = [np.stack([c, np.roll(c, -1, axis=1)], axis=-1).reshape(-1, 2) for c in corners(cells)]
    unique, counts = np.unique(np.sort(np.concatenate(sides), axis=1), axis=0, return_counts=True)
    border: Indices = unique[counts == 1]
    return border
