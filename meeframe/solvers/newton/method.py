"""Semismooth Newton on the nonsmooth equation of the contact problem, globalised so that it converges from zero."""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, final

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.contact.conduction import Mask, conducting, is_partial
from meeframe.contact.feasibility import beyond_friction
from meeframe.contact.free_motion import balanced_projection, motions, start_load, start_motion
from meeframe.contact.nested import Coarse, coarse_problem, prolonged_start, with_tension
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver, contact_gap, unbalance
from meeframe.contact.residual import evaluate
from meeframe.contact.scales import problem_scales
from meeframe.fields import MECHANICAL, NORMAL, Array
from meeframe.laws.base import is_adhesive
from meeframe.solvers.gradient.accelerated import BarzilaiBorwein
from meeframe.solvers.newton.linear import newton_step
from meeframe.solvers.newton.moves import MAX_FLIPS, improve_start, take_step
from meeframe.solvers.newton.neighbourhood import ContactNeighbourhood, contact_neighbourhood
from meeframe.solvers.newton.residual import ContactResidual, ResidualState
from meeframe.solvers.stopping import StoppingCriteria

STEP_FRACTIONS: Final = (1.0, 0.5, 0.25, 0.125)
"""Fractions of a Newton step, tried in turn."""
MERIT_WINDOW: Final = 2
"""Number of last states whose largest merit bounds that of the next one."""
MAX_MERIT_RATIO: Final = 0.99
"""Largest merit after a step, relative to that bound."""
MAX_TOLERANCE: Final = 0.05
MIN_TOLERANCE: Final = 3e-4
"""Bounds of the tolerance of linear equations without a matrix; round-off of single precision may prevent 1e-4."""
SUFFICIENT_FRACTION: Final = 0.3
"""Fraction of the required residual at which the iteration in a neighbourhood of the contact ends, and which linear
equations may leave."""
COARSE_MERIT: Final = 5e-5
"""Merit at which the iteration on a coarser problem ends, as the two problems differ by more."""
MAX_COARSE_STEPS: Final = 40
"""Largest number of steps on a coarser problem."""
MAX_START_GROWTH: Final = 100.0
"""Largest factor by which the first step from a coarse solution may raise the merit.

A smooth state violates the laws by little, and its short-wave errors are found at once.
"""
FIRST_BURST: Final = 25
"""Number of gradient steps in the first burst, made when no fraction of a Newton step helps; it doubles each time."""
MAX_BURST: Final = 100
BALANCE_TOLERANCE: Final = 1e-6
"""Largest error of the resultants of a start with which its motion is retained."""
MAX_RESTRICTIONS: Final = 2
"""Largest number of times that a matrix-free iteration restricts itself to the neighbourhood of the contact."""
RESTRICTION_MERIT: Final = 0.1
"""Merit below which the iteration does so, unless it starts there."""
STIFFENING_FACTORS: Final = (1.0, 4.0, 16.0)
"""Factors of the step that finds the motion: friction carries more where the same overlap presses more."""


@dataclass(frozen=True, eq=False)
class _Memory:
    """State of the iteration.

    state: residual state at the iterate; merits: of the last states, that of a start being the largest merit allowed;
    flips: (n,) how often each node has opened or closed; fall: ratio of the merit to the one before; burst: number of
    gradient steps of the next burst; neighbourhood: the one of the equation, None for the whole zone;
    restrictions: restrictions that are still allowed; sufficient_residual: violation that is sufficient there.
    """

    state: ResidualState
    merits: tuple[float, ...]
    flips: Array
    fall: float = np.inf
    burst: int = FIRST_BURST
    neighbourhood: ContactNeighbourhood | None = None
    restrictions: int = 0
    sufficient_residual: float = 0.0


@final
@checked_arguments
@dataclass(frozen=True)
class SemismoothNewton(Solver):
    """Newton's method on the residual of eqs. (27)-(29) with generalised Jacobians of the laws.

    A step solves the linearised equations for tractions, fluxes, the contact fractions of biactive nodes and the free
    motions of the indenter together, by factorisation at contact size or, where the compliance is not stored as a
    matrix, by GMRES. Tractions are then made admissible. A step that does not bring the merit (the root mean square of
    the residual, balance included) below that of the last two states is halved, up to three times. If that does not
    help, a burst of projected Barzilai-Borwein steps takes its place, after which Newton's method starts again. Where
    there is no matrix, steps are made on the part of the zone around the contact: see ContactNeighbourhood.

    Source: Christensen et al., Int. J. Numer. Methods Eng. 42 (1998) 145 for frictional contact; Qi and Sun, Math.
    Program. 58 (1993) 353 for the convergence.
    """

    stall_window: ClassVar[int] = 40

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """Return the converged state of the previous load step, that of a coarser system, or one without load."""
        return _begin(problem, start, tolerance)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Make one Newton step, a fraction of it, or a burst of gradient steps; none if no law is violated."""
        memory = _restrict(problem, iterate.memory_as(_Memory))
        state = memory.state
        if state.merit == 0.0:
            return iterate
        direction = newton_step(state.equation, state.linearise(), _tolerance(memory))
        allowed = MAX_MERIT_RATIO * max(memory.merits)
        flips = memory.flips
        for fraction in STEP_FRACTIONS if direction.finite else ():
            flips, candidate = take_step(state, flips, direction, fraction)
            if candidate.merit < allowed:
                merits = (*memory.merits, candidate.merit)[-MERIT_WINDOW:]
                memory = replace(
                    memory, state=candidate, merits=merits, flips=flips, fall=candidate.merit / state.merit
                )
                return _iterate(memory)
        memory = replace(memory, flips=flips)
        if memory.neighbourhood is not None:
            memory = _on_zone(problem, memory, memory.neighbourhood)
        candidate = _gradient_steps(problem, memory.state, memory.flips > MAX_FLIPS, memory.burst)
        burst = min(2 * memory.burst, MAX_BURST)
        return _iterate(replace(_restart(memory, candidate, memory.flips), burst=burst))


def estimated_residual(iterate: Iterate) -> float | None:
    """Return the residual that Newton's equation has at an iterate; None if another solver made the iterate."""
    return iterate.memory.state.law_residual if isinstance(iterate.memory, _Memory) else None


def _begin(
    problem: ContactProblem, start: ContactState | None, tolerance: float = StoppingCriteria.tolerance
) -> Iterate:
    """Return the start of an iteration; see SemismoothNewton.init."""
    n, restrictions = len(problem.gap), MAX_RESTRICTIONS if problem.system.dense() is None else 0
    coarse_solution = _coarse_solution(problem) if start is None and restrictions else None
    prolonged = None if coarse_solution is None else prolonged_start(problem, *coarse_solution)
    start = prolonged or start
    contact_fraction, load = np.zeros(n) if start is None else start.contact_fraction, start_load(problem, start)
    motion = start_motion(problem, start)
    neighbourhood = None if prolonged is None else contact_neighbourhood(problem, np.asarray(load.any(axis=1)))
    if neighbourhood is None:
        equation, nodes = ContactResidual.of(problem), np.arange(n)
    else:
        equation, nodes, restrictions = neighbourhood.equation, neighbourhood.nodes, restrictions - 1
    # an attractive contact may adhere in its present state, so that the indenter is not lifted off first
    keeps_motion = prolonged is not None or (start is not None and is_adhesive(problem.contact_law))
    load, contact_fraction = load[nodes], contact_fraction[nodes]
    del start, prolonged  # arrays of the whole zone
    state = equation.at(load, contact_fraction, is_partial(contact_fraction), motion)
    if not keeps_motion and (np.abs(state.balance) > BALANCE_TOLERANCE).any():
        state = equation.at(state.load, contact_fraction, state.biactive, _balanced_motion(problem, state))
    rise = 1.0
    if coarse_solution is not None:
        coarse, coarse_iterate = coarse_solution
        coarse_memory = coarse_iterate.memory_as(_Memory)
        of_coarse = coarse_memory.neighbourhood
        coarse_nodes = np.arange(len(coarse.problem.gap)) if of_coarse is None else of_coarse.nodes
        state = improve_start(state, nodes, coarse, coarse_memory.state.equation, coarse_nodes)
        rise = MAX_START_GROWTH
    memory = _Memory(
        state,
        (rise * state.merit,),
        flips=np.zeros(len(state.load), np.int16),
        neighbourhood=neighbourhood,
        restrictions=restrictions,
        sufficient_residual=SUFFICIENT_FRACTION * tolerance,
    )
    return _iterate(memory)


def _restart(memory: _Memory, state: ResidualState, flips: Array) -> _Memory:
    """Return the memory that continues from a state without the history of those before."""
    return replace(memory, state=state, merits=(state.merit,), flips=flips, fall=np.inf)


def _restrict(problem: ContactProblem, memory: _Memory) -> _Memory:
    """Return the memory on the neighbourhood of the contact, if any; on the whole zone once that has converged."""
    state, neighbourhood = memory.state, memory.neighbourhood
    if neighbourhood is not None:
        return _on_zone(problem, memory, neighbourhood) if state.law_residual <= memory.sufficient_residual else memory
    if not memory.restrictions or not state.merit < RESTRICTION_MERIT:
        return memory
    neighbourhood = contact_neighbourhood(problem, state.load.any(axis=1) | (state.trial[:, NORMAL] < 0.0))
    if neighbourhood is None:
        return memory
    nodes = neighbourhood.nodes
    values = state.load[nodes], state.relative_displacement[nodes], state.contact_fraction[nodes], state.biactive[nodes]
    new_state = neighbourhood.equation.at_relative_displacement(*values, state.motion)
    flips, restrictions = memory.flips[nodes], memory.restrictions - 1
    return replace(memory, state=new_state, flips=flips, neighbourhood=neighbourhood, restrictions=restrictions)


def _on_zone(problem: ContactProblem, memory: _Memory, neighbourhood: ContactNeighbourhood) -> _Memory:
    """Return the memory on the whole zone, from one on a neighbourhood."""
    state, scatter = memory.state, neighbourhood.scatter
    values = scatter(state.load), scatter(state.contact_fraction), scatter(state.biactive)
    new_state = ContactResidual.of(problem).at(*values, state.motion)
    return replace(_restart(memory, new_state, scatter(memory.flips)), neighbourhood=None)


def _tolerance(memory: _Memory) -> float:
    """Return the fraction of the residual that the linear equations may leave.

    As much as Newton's method itself seems to leave (Eisenstat and Walker, SIAM J. Sci. Comput. 17 (1996) 16, choice
    2), but no less than suffices at the end. Gains of accelerations are in docs/validation/performance.md.
    """
    sufficient = memory.sufficient_residual / (memory.state.law_residual or np.inf)
    return float(np.clip(max(0.9 * memory.fall**1.5, sufficient), MIN_TOLERANCE, MAX_TOLERANCE))


def _coarse_solution(fine_problem: ContactProblem) -> tuple[Coarse, Iterate] | None:
    """Return the problem on a coarser system and its approximate solution.

    None if there is no such system, or a solution is not found or without load.
    """
    coarse = coarse_problem(fine_problem)
    if coarse is None:
        return None
    problem, solver = coarse.problem, SemismoothNewton()
    iterate, steps = _begin(problem, None), 0
    # the merit of a start is small even if its short waves are wrong, which a first step shows
    while steps == 0 or iterate.memory_as(_Memory).state.merit > COARSE_MERIT:
        if steps == MAX_COARSE_STEPS or _is_infeasible(problem, iterate):
            return None
        iterate, steps = solver.step(problem, iterate), steps + 1
    if not iterate.load.any():
        return None
    if conducting(problem):  # where potentials attract the surfaces, the start decides on nodes at the contact edge
        return coarse, iterate
    memory = iterate.memory_as(_Memory)
    gap = memory.state.relative_displacement[:, NORMAL]
    gap = gap if memory.neighbourhood is None else memory.neighbourhood.scatter(gap)
    return coarse, with_tension(problem, iterate, gap)


def _is_infeasible(problem: ContactProblem, iterate: Iterate) -> bool:
    """Return true if bursts have shown that friction cannot carry the prescribed resultants."""
    if iterate.memory_as(_Memory).burst == FIRST_BURST:
        return False
    return beyond_friction(problem, evaluate(problem, iterate), problem_scales(problem)) is not None


def _balanced_motion(problem: ContactProblem, state: ResidualState) -> Array:
    """Return a motion (m,) at which the tractions of one projected step have the prescribed resultants.

    At that motion there is contact.
    """
    numbers, load = motions(problem), state.load.copy()
    displacement = problem.system.offset + problem.system.apply(load)
    gap = contact_gap(problem, displacement, state.motion)
    for stiffening in STIFFENING_FACTORS:
        r = stiffening * state.equation.r
        balanced = balanced_projection(problem, state.load[:, MECHANICAL], gap, (r, r))
        load[:, MECHANICAL] = balanced.traction
        bound = BALANCE_TOLERANCE * state.equation.scales.totals[numbers]
        if (np.abs(unbalance(problem, load)[numbers]) <= bound).all():
            break
    motion = state.motion.copy()
    motion[numbers] += balanced.motion
    return motion


def _iterate(memory: _Memory) -> Iterate:
    """Return the iterate, with the violation of the laws that the equation estimates where products are expensive."""
    state, neighbourhood = memory.state, memory.neighbourhood
    estimate = state.law_residual if state.equation.problem.system.dense() is None else None
    load, contact_fraction = state.load, np.clip(state.contact_fraction, 0.0, 1.0)
    if neighbourhood is not None:
        load, contact_fraction = neighbourhood.scatter(load), neighbourhood.scatter(contact_fraction)
    return Iterate(load, contact_fraction, memory, state.motion, estimate)


def _gradient_steps(problem: ContactProblem, state: ResidualState, biactive: Mask, count: int) -> ResidualState:
    """Return the state after projected Barzilai-Borwein steps; biactive nodes (n,) remain biactive."""
    solver = BarzilaiBorwein()
    contact_fraction = np.clip(state.contact_fraction, 0.0, 1.0)
    iterate = solver.init(problem, ContactState(state.load, np.zeros_like(state.load), contact_fraction, state.motion))
    for _ in range(count):
        iterate = solver.step(problem, iterate)
    return state.equation.at(
        iterate.load, iterate.contact_fraction, biactive | is_partial(iterate.contact_fraction), iterate.motion
    )
