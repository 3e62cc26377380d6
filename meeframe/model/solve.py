"""Solution of a case in memory: one reduced system, then one contact problem for each increment."""

import platform
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from importlib import metadata
from typing import Final

import numba
import numpy as np

from meeframe.common.blas import ONE_BLAS_THREAD
from meeframe.common.errors import TooLargeError
from meeframe.common.memory import release_freed_memory
from meeframe.contact.conduction import conducting
from meeframe.contact.problem import ContactProblem, ContactSolution, ContactState, Status, indenter_field
from meeframe.contact.residual import NEGLIGIBLE_PRESSURE, friction_exceeds, law_residual
from meeframe.contact.scales import largest, problem_scales
from meeframe.fields import POTENTIALS, Array, Indices
from meeframe.formulations.base import Formulation, PersistentFormulation, stored_arrays
from meeframe.laws.base import has_memory, is_pure_projection
from meeframe.mesh.body import Body
from meeframe.model.case import Case, warnings_of
from meeframe.model.clock import Clock, peak_memory_mb
from meeframe.model.conduction import check_conduction
from meeframe.model.continuation import LARGE_RATIO, Attempt, solve_persistently
from meeframe.model.diagnostics import ContactOnsets, Diagnostics, with_message
from meeframe.model.history import Controls, ConvergedState, extrapolate, ramp
from meeframe.model.kinematics import Increment, IndenterKinematics, Solution, beginning, regions, slip_of, touching
from meeframe.model.restart import check_same_body
from meeframe.model.rolling import RollingIncrement
from meeframe.model.steady import solve_steady
from meeframe.model.step import Step
from meeframe.model.subdivision import solve_subdivided
from meeframe.model.systems import checked
from meeframe.model.wear import without_wear
from meeframe.model.wear_cycles import WearOfCycles, solve_cycles
from meeframe.plugin import registry as plugins
from meeframe.plugin.sources import faults_of_plugins, local_files
from meeframe.results.balance import unbalance_warning
from meeframe.results.records import (
    Loading,
    Provenance,
    SecondSurface,
    StepResult,
    ZoneFields,
    split_displacement,
    split_load,
    zone_of,
)
from meeframe.results.result import Interrupted, Result
from meeframe.solvers import Auto, StoppingCriteria, resolve_edges, solve, solve_to_edges
from meeframe.system.capabilities import Multigrid, ZoneRecovery
from meeframe.system.dense import DenseSystem, with_matrix
from meeframe.system.reduced import NodalFields, Progress, ReducedSystem, silent
from meeframe.system.rotated import rotate_frames
from meeframe.system.two_body import combine_bodies, second_displacement

_WINDOW_RATIO: Final = 12
"""Divisor of the stall window of an increment for parts of its load, which converge soon or lead nowhere."""
_MAX_STORED: Final = 512
"""Number of nodes up to which a failed increment is solved again with a matrix: as much work as some ten iterations."""
_ROUND_OFF: Final = 1e-12
"""Fraction of the expected magnitude of a potential below which it is zero, as on grounded conductors."""


def solve_case(case: Case, progress: Progress = silent) -> Result:
    """Solve a case in memory and return its result.

    An increment that does not converge raises nothing: its status reports it.

    Parameters
    ----------
    case : Case
        The case.
    progress : callable, optional
        Function that is called with the name of a stage and the fraction of it that is done.

    Returns
    -------
    Result
        Results of all increments.

    Raises
    ------
    Interrupted
        After Ctrl-C while increments are solved, with the result of those that are finished.
    MeeframeError
        As `reduce` and `solve_steps`: if a formulation, a solver or a law does not accept the case, or if matrices
        do not fit into memory.
    """
    clock = Clock(progress)
    system = reduce(case, clock)
    steps: list[StepResult] = []

    def finished() -> Result:
        done, usage = tuple(steps), (clock.timings(), peak_memory_mb())
        return Result(provenance(case), zone_of(system), case.n_increments, done, *usage)

    try:
        for step in solve_steps(case, system, clock):
            steps.append(step)
    except KeyboardInterrupt:
        note = (
            f"{len(steps)} of {case.n_increments} increments are finished and in the attribute `result` of this error"
        )
        raise Interrupted(finished(), note) from None
    return finished()


def reduce(case: Case, progress: Progress = silent) -> ReducedSystem:
    """Return the reduced system of a case: of its body, or of its two bodies in contact.

    Parameters
    ----------
    case : Case
        The case.
    progress : callable, optional
        Function that is called with the name of a stage and the fraction of it that is done.

    Returns
    -------
    ReducedSystem
        The system. With two bodies, the second one retains only what contact needs, see `reduce_for_contact`.

    Raises
    ------
    MeshError, CaseError, MaterialError
        If a formulation does not accept its body.
    TooLargeError
        If its matrices do not fit into memory.
    """
    *second_body, first = bodies_of(case)
    return joined(case, [*(reduce_for_contact(*body, progress) for body in second_body), reduce_body(*first, progress)])


def joined(case: Case, systems: Iterable[ReducedSystem]) -> ReducedSystem:
    """Return the reduced system of a case, in frames along its friction axes.

    Parameters
    ----------
    case : Case
        The case.
    systems : iterable of ReducedSystem
        Systems of the bodies, in the order of `bodies_of`.

    Returns
    -------
    ReducedSystem
        The system of the body, or of both bodies in contact.

    Raises
    ------
    MeshError
        If the contact zones of two bodies do not fit.
    """
    *second_body, first = systems
    with faults_of_plugins():
        if case.axes is not None:
            first = rotate_frames(first, case.axes.directions(first.points))
        return combine_bodies(first, *second_body) if second_body else first


def bodies_of(case: Case) -> tuple[tuple[Formulation, Body], ...]:
    """Return the bodies of a case, each with its formulation, in the order in which they are reduced.

    Parameters
    ----------
    case : Case
        The case.

    Returns
    -------
    tuple of tuple
        Formulation and body, first those of the second body, if there is one. The body comes last as its system may
        hold large matrices, from which its fields are recovered.
    """
    first = (case.formulation, case.body)
    return (first,) if case.second_body is None else ((case.second_body.formulation, case.second_body.body), first)


def reduce_body(formulation: Formulation, body: Body, progress: Progress = silent) -> ReducedSystem:
    """Return the reduced system of one body.

    Parameters
    ----------
    formulation : Formulation
        The formulation.
    body : Body
        The body.
    progress : callable, optional
        Function that is called with the name of a stage and the fraction of it that is done.

    Returns
    -------
    ReducedSystem
        The system.

    Raises
    ------
    MeshError, CaseError, MaterialError, TooLargeError
        As `reduce`.
    """
    try:
        with faults_of_plugins():
            return checked(formulation, formulation.reduce(body, progress), body.fields.size)
    except MemoryError as error:
        raise TooLargeError(
            f"mesh: {body.mesh.n_elements} elements with {len(body.mesh.points)} nodes need more memory than is "
            f"available ({str(error) or 'none left'}); allowed: a coarser mesh"
        ) from None


def reduce_for_contact(formulation: Formulation, body: Body, progress: Progress = silent) -> ReducedSystem:
    """Return the reduced system of one body for contact alone, without data for recovery where possible.

    Parameters
    ----------
    formulation : Formulation
        The formulation.
    body : Body
        The body.
    progress : callable, optional
        Function that is called with the name of a stage and the fraction of it that is done.

    Returns
    -------
    ReducedSystem
        The system. Its `recover` reduces the body again when it is first called; a `DenseSystem` has no
        `InteriorFields` any more.

    Raises
    ------
    MeshError, CaseError, MaterialError, TooLargeError
        As `reduce`.
    """
    system = reduce_body(formulation, body, progress)
    if not isinstance(system, DenseSystem):
        with faults_of_plugins():
            arrays = stored_arrays(formulation, system)
            if arrays is None or not isinstance(formulation, PersistentFormulation):
                return system
            return checked(formulation, formulation.from_arrays(body, arrays), body.fields.size)
    return replace(system, recovery=recovery_of(formulation, body, progress), interior=None)


def recovery_of(formulation: Formulation, body: Body, progress: Progress = silent) -> Callable[[Array], NodalFields]:
    """Return a function that recovers the fields on the whole boundary, from a system that is made at its first call.

    Parameters
    ----------
    formulation : Formulation
        The formulation.
    body : Body
        The body.
    progress : callable, optional
        Function that is called with the name of a stage and the fraction of it that is done.

    Returns
    -------
    callable
        Function that returns the fields for a load (n, f) on the contact zone, as `ReducedSystem.recover`.
    """
    system = lru_cache(maxsize=1)(partial(reduce_body, formulation, body, progress))
    return lambda load: system().recover(load)


def solve_steps(
    case: Case, system: ReducedSystem, clock: Progress = silent, boundary: bool = True
) -> Iterator[StepResult]:
    """Yield the increments of a case's load steps, each computed from the last converged one.

    Slip is measured from that state too (docs/explanation/theory.md, Departures): a single increment, from the
    undeformed body, is the paper's. The controls that a step names vary linearly from the state in which the step
    begins.

    Parameters
    ----------
    case : Case
        The case.
    system : ReducedSystem
        Its reduced system, as of `reduce`.
    clock : callable, optional
        Function that is called with the name of a stage and the fraction of it that is done.
    boundary : bool, optional
        Whether to recover the fields on the whole boundary too, at the end of each step, and to include the warnings of
        the case in the first message; a study of the contact zone does not need the fields and reports the warnings
        itself.

    Yields
    ------
    StepResult
        The next increment.

    Raises
    ------
    CaseError
        If the case continues a run whose state does not belong to this body, or if a solver or a law does not accept
        the case.
    """
    clock("contact", 0.0)
    kinematics = IndenterKinematics(case, system)
    diagnostics = Diagnostics(kinematics, lambda: warnings_of(bodies_of(case)))
    with faults_of_plugins():
        if case.restart is not None:
            check_same_body(case.restart, system)
        here, controls = beginning(kinematics)
    if case.restart is None:
        onsets = ContactOnsets.of(lambda: kinematics.touching_gap, np.zeros(len(system.points), bool), 0)
    else:
        earlier = case.restart.step
        onsets = ContactOnsets.of(lambda: earlier.gap, earlier.touching, 0)
    count = 0
    for number, step in enumerate(case.steps, 1):
        begin, before, last = here, controls, None
        rolling = rolling_increment(kinematics, step)
        prescribed = {**step.prescribed, **(rolling.prescribed(begin, step.increments) if rolling else {})}
        onsets = ContactOnsets.of(onsets.gap, onsets.touching, step.increments)
        for increment in range(1, step.increments + 1):
            ends = increment == step.increments
            controls = ramp(before, begin, prescribed, increment / step.increments)
            share = partial(_share, clock, count, case.n_increments)
            share("contact", 0.0)
            # one thread of BLAS: products with another number of threads round differently, and iterations amplify that
            with faults_of_plugins(), ONE_BLAS_THREAD:
                numbers = number, increment
                subincrement = _Subincrement(kinematics, step, prescribed, before, begin, numbers, last, rolling, share)
                if rolling is not None and rolling.is_steady:
                    planned, end, result = _solve_steady(replace(subincrement, last=None), here, rolling)
                elif step.max_pressure_change is None:
                    planned, end, result = subincrement(0.0, 1.0, here)
                else:
                    bounds = step.max_pressure_change, case.solver.stall_window
                    planned, end, result = solve_subdivided(subincrement, here, system.weights, *bounds)
                last, here = here if end is not here else None, end
                share("diagnostics", 1.0)
                onsets = onsets.after(result)
                warns = boundary and ends and number == 1
                result = diagnostics.with_diagnostics(planned, result, onsets, ends, warns)
                del planned  # arrays of which nobody has a use any more
                release_freed_memory(len(system.points))
            count += 1
            if boundary and ends:
                clock("boundary fields", 0.0)
                try:
                    with faults_of_plugins():
                        recovered = _boundary(system, result)
                    clock("diagnostics", 1.0)
                    result = with_message(
                        replace(result, boundary=recovered), unbalance_warning(recovered, case.fields, result.fluxes)
                    )
                except Exception:
                    yield result  # the increment is solved all the same
                    raise
            yield result


def _solve_steady(subincrement: "_Subincrement", here: ConvergedState, rolling: RollingIncrement) -> Solution:
    """Return an increment of steady rolling as a _Subincrement does, after the cycles in which it wears surfaces."""
    case, step, shift = subincrement.kinematics.case, subincrement.step, rolling.cell_shift

    def steady(state: ConvergedState) -> Solution:
        return solve_steady(partial(subincrement, 0.0, 1.0), state, shift, has_memory(case.contact_law))

    cycles = rolling.rolling.cycles
    if case.wear is None or cycles is None:
        return steady(here)
    tolerance = rolling.rolling.wear_tolerance
    return solve_cycles(steady, here, WearOfCycles(case.wear, shift), cycles / step.increments, tolerance)


def rolling_increment(kinematics: IndenterKinematics, step: Step) -> RollingIncrement | None:
    """Return the rolling by one cell in the increments of a load step.

    Parameters
    ----------
    kinematics : IndenterKinematics
        Kinematics of the indenter of the case.
    step : Step
        The load step.

    Returns
    -------
    RollingIncrement or None
        The rolling; None if the contact stays in place.

    Raises
    ------
    CaseError
        As `Rolling.increment`.
    """
    if step.rolling is None:
        return None
    case, system = kinematics.case, kinematics.system
    return step.rolling.increment(system.points, system.frames, case.placement.base, case.formulation.is_periodic())


def _boundary(system: ReducedSystem, step: StepResult) -> NodalFields | ZoneFields:
    """Return the fields on the whole boundary at the end of an increment."""
    # with a contact edge between nodes, displacements of the zone have a share that `recover` leaves out
    if system.capability(ZoneRecovery) is None or step.area_fraction is not None:
        return system.recover(step.state.load)
    return ZoneFields(zone_of(system), step.displacement, step.potentials, step.traction, step.fluxes)


def _share(clock: Progress, done: int, planned: int, stage: str, fraction: float) -> None:
    """Report the progress of one increment as a share of all increments."""
    clock(stage, (done + fraction) / planned)


def _start(increment: Increment, last: ConvergedState | None, here: ConvergedState) -> ContactState | None:
    """Return the initial guess of an increment: the converged state, or its continuation.

    Where surfaces attract each other or conduct, or friction depends on the slip, several solutions may exist: the one
    near the converged state is sought.

    Parameters
    ----------
    increment
        To be solved.
    last
        Converged state one increment of the same load step before `here`; None if there is none.
    here
        Converged state at the beginning of the increment.
    """
    problem = increment.problem
    if last is not None and is_pure_projection(problem.contact_law) and not conducting(problem):
        predicted = extrapolate(problem.contact_law, last, here)
        if predicted is not None and len(predicted.motion) == len(increment.free):
            return predicted
    # free motions count from the converged state
    return here.state and replace(here.state, motion=np.zeros(len(increment.free)))


@dataclass(frozen=True, eq=False)
class _Subincrement:
    """Solution of an increment or of its subincrements.

    step: load step; prescribed: its quantities; controls, begin: those before it, and the state in which it begins;
    numbers: of the step and the increment; last: converged state one increment of the same load step before, None if
    there is none; rolling: as in Increment.
    """

    kinematics: IndenterKinematics
    step: Step
    prescribed: Controls
    controls: Controls
    begin: ConvergedState
    numbers: tuple[int, int]
    last: ConvergedState | None
    rolling: RollingIncrement | None
    progress: Progress

    def __call__(self, first: float, end: float, here: ConvergedState, stall_window: int | None = None) -> Solution:
        """Return the subincrement between two fractions of the increment, the state after it, and its result.

        stall_window: that of the solver in this subincrement; by default that of the case.
        """
        step, share = self.step, end - first
        duration, sliding = (
            None if total is None else share * total for total in (step.increment_duration, step.increment_sliding)
        )
        stopping = self.kinematics.case.stopping

        def solve_attempt(attempt: Attempt) -> Solution:
            fraction = (self.numbers[1] - 1 + first + attempt.fraction * share) / step.increments
            controls = ramp(self.controls, self.begin, self.prescribed, fraction)
            if attempt.approach is not None:
                controls = ramp(controls, self.begin, {"approach": np.array([attempt.approach])})
            planned = self.kinematics.increment(controls, here, duration, self.rolling, sliding)
            start = _start(planned, self.last, here) if attempt.start is None else attempt.start
            problem = attempt.easing.apply(planned.problem)
            if attempt.stores:
                problem = replace(problem, system=with_matrix(problem.system))
            if attempt.easing.edge_of is not None:
                edge = partial(self.kinematics.indenter_edge, planned)
                problem = resolve_edges(problem, attempt.easing.edge_of, edge) or problem
            planned = replace(planned, problem=problem)
            window = attempt.stall_window
            bounds = stopping if window is None else replace(stopping, stall_window=window)
            resolves = problem.area_fraction is None and not attempt.easing.at_nodes
            return _solve(self.kinematics, planned, here, start, bounds, self.numbers, self.progress, resolves)

        system, is_auto = self.kinematics.system, isinstance(self.kinematics.case.solver, Auto)
        is_steady = self.rolling is not None and self.rolling.is_steady
        if stall_window is not None or not is_auto or is_steady:
            return solve_attempt(Attempt(stall_window=stall_window))
        window = max(1, self.kinematics.case.solver.stall_window // _WINDOW_RATIO)
        stores = system.dense() is None and len(system.points) <= _MAX_STORED
        return solve_persistently(
            solve_attempt, window, self._has_large_friction, stores, stopping.tolerance, here.state
        )

    @property
    def _has_large_friction(self) -> bool:
        """True if friction may be many times the pressure, by a law without wear and memory."""
        case, n = self.kinematics.case, len(self.kinematics.system.points)
        law, is_simple = case.contact_law, case.wear is None and not has_memory(case.contact_law)
        return is_simple and friction_exceeds(law, n, LARGE_RATIO, NEGLIGIBLE_PRESSURE)


def _solve(
    kinematics: IndenterKinematics,
    increment: Increment,
    here: ConvergedState,
    start: ContactState | None,
    stopping: StoppingCriteria,
    numbers: tuple[int, int],
    progress: Progress,
    resolves: bool = True,
) -> Solution:
    """Return an increment as solved, the state after it, or the one before if it does not converge, and its result.

    start: initial guess of the solver; numbers: of the step and the increment; resolves: whether contact edges are to
    be resolved between nodes.
    """
    case, rolling = kinematics.case, increment.rolling
    steady = rolling if rolling is not None and rolling.is_steady else None
    if steady is not None and increment.problem.system.capability(Multigrid) is not None:
        start = None  # a coarser division is closer than the state before
    if case.wear is None and resolves:
        edge = partial(kinematics.indenter_edge, increment)
        solution, problem = solve_to_edges(increment.problem, case.solver, stopping, start, progress, edge)
    else:  # the contact edge lies at nodes, as with wear, or is already resolved
        solution, problem = solve(increment.problem, case.solver, stopping, start, progress), increment.problem
    release_freed_memory(len(problem.gap))
    problem, depth = without_wear(problem, solution.state)
    increment = replace(increment, problem=problem, depth=depth)
    if steady is not None:
        increment, solution = kinematics.repeat_steady(increment, steady, solution)
    solution = check_conduction(increment.problem, solution)
    touches = touching(increment.problem, solution.state)
    if solution.status is Status.CONVERGED and not touches.any():
        solution = replace(solution, state=_without_noise(increment.problem, solution.state))
    solution = replace(solution, state=kinematics.restore_unresisted_motions(increment, solution.state, touches))
    slip = slip_of(increment, solution.state)
    region = regions(increment, solution, slip, touches)
    end = kinematics.converged_state(increment, solution.state, slip, touches)
    release_freed_memory(len(slip))
    result = _step_result(kinematics, increment, end, solution, slip, region, numbers)
    return Solution(increment, end if solution.status is Status.CONVERGED else here, result)


def _without_noise(problem: ContactProblem, state: ContactState) -> ContactState:
    """Return a state in which nothing touches, without its fluxes across gaps if the laws hold without any load."""
    if problem.prescribed_resultants or not state.load.any():
        return state
    load = np.zeros(state.load.shape[::-1]).T
    unloaded = replace(
        state, load=load, displacement=problem.system.offset.copy(), contact_fraction=np.zeros(len(load))
    )
    return unloaded if law_residual(problem, unloaded, problem_scales(problem)) == 0.0 else state


def provenance(case: Case) -> Provenance:
    """Return the provenance of a result computed in the present environment.

    Parameters
    ----------
    case : Case
        The case.

    Returns
    -------
    Provenance
        Text of the case, versions of the software and number of threads.
    """
    providers = {provider.name: provider.version for provider in plugins.load().providers}
    return Provenance(case.title, case.text, _software() | providers | local_files(case), numba.get_num_threads())


@lru_cache(maxsize=1)
def _software() -> dict[str, str]:
    """Return the versions of Python and of the numerical software."""
    libraries = ("numpy", "scipy", "numba", "h5py", "pydantic")
    return {"python": platform.python_version(), **{name: metadata.version(name) for name in libraries}}


def _step_result(
    kinematics: IndenterKinematics,
    increment: Increment,
    end: ConvergedState,
    solution: ContactSolution,
    slip: Array,
    region: Indices,
    numbers: tuple[int, int],
) -> StepResult:
    state = solution.state
    traction, fluxes = split_load(state.load)
    displacement, potentials, second_body = _surfaces(kinematics.system, state)
    scales, offset = problem_scales(increment.problem), increment.problem.system.offset
    caused = scales.compliance[POTENTIALS] @ [largest(values) for values in state.load.T]
    caused += [largest(values) for values in offset.T[POTENTIALS]]
    # less than expected where little of the expected load is left
    expected = np.minimum(scales.displacement[POTENTIALS], caused)
    # fluxes through the contact, and the potentials that they cause, are as accurate as the solution
    accuracy = solution.residual if solution.status is Status.CONVERGED else 0.0
    for column, scale in enumerate(expected):
        error = max(_ROUND_OFF, accuracy) if fluxes[:, column].any() else _ROUND_OFF
        if 0.0 < largest(potentials[:, column]) < error * scale:
            potentials[:, column] = 0.0
    return StepResult(
        loading=Loading.of(
            end.motion,
            increment.prescribed,
            kinematics.reference,
            kinematics.case.placement.base,
            increment.duration,
            kinematics.case.fields,
            None if increment.rolling is None else increment.rolling.motion(increment.start, end),
            end.travel,
        ),
        step=numbers[0],
        increment=numbers[1],
        initial_gap=indenter_field(increment.problem, 2, state.motion),
        traction=traction,
        displacement=displacement,
        potentials=potentials,
        fluxes=fluxes,
        contact_fraction=state.contact_fraction,
        slip=slip,
        total_slip=end.total_slip,
        slip_path=end.slip_path,
        wear=end.wear,
        dissipation=kinematics.dissipation(increment, state, slip, region),
        region=region,
        status=solution.status,
        iterations=solution.iterations,
        residual=solution.residual,
        history=solution.history,
        message=solution.message,
        second_body=second_body,
        area_fraction=increment.problem.area_fraction,
        fields=kinematics.case.fields,
    )


def _surfaces(system: ReducedSystem, state: ContactState) -> tuple[Array, Array, SecondSurface | None]:
    """Return displacement and potentials of the body, and those of the second body if there is one."""
    second_body = second_displacement(system, state.load)
    if second_body is None:
        return *split_displacement(state.displacement), None
    return *split_displacement(state.displacement + second_body), SecondSurface(*split_displacement(second_body))
