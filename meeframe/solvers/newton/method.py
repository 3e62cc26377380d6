"""Semismooth Newton on the nonsmooth equation of the contact problem, globalised so that it converges from zero."""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, final

import numpy as np

from meeframe.contact.conduction import Mask, conducting
from meeframe.contact.feasibility import beyond_friction
from meeframe.contact.free_motion import balanced_projection, motions, start_motion
from meeframe.contact.nested import coarse_problem, nested_start, with_signed_gap
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver, contact_gap, unbalance
from meeframe.contact.residual import evaluate
from meeframe.contact.scales import problem_scales
from meeframe.fields import MECHANICAL, Array
from meeframe.laws.base import is_adhesive
from meeframe.solvers.gradient.accelerated import BarzilaiBorwein
from meeframe.solvers.gradient.steps import start_load
from meeframe.solvers.newton.coarse_start import improved_start
from meeframe.solvers.newton.globalization import newton_step
from meeframe.solvers.newton.linear import Inverse
from meeframe.solvers.newton.moves import FLIPS, held_where_it_grazes, take_step
from meeframe.solvers.newton.neighbourhood import ContactNeighbourhood, has_parts, inset, neighbourhood_nodes
from meeframe.solvers.newton.residual import ContactResidual, ResidualState
from meeframe.solvers.stopping import StoppingCriteria
from meeframe.system.capabilities import diagonal

FRACTIONS: Final = (1.0, 0.5, 0.25, 0.125)
"""Fractions of a Newton step, tried in turn."""
PATIENCE: Final = 2
"""Number of last states whose largest merit bounds that of the next one."""
FALL: Final = 0.99
"""Largest merit after a step, relative to that bound."""
LOOSEST: Final = 0.03
TIGHTEST: Final = 1e-4
"""Largest (LOOSEST) and smallest (TIGHTEST) tolerance of the linear equations where there is no matrix."""
LINEAR_FRACTION: Final = 0.3
"""Fraction of the required residual below which linear equations need not reduce the violation of the laws."""
PEAK: Final = 60.0
"""Largest ratio assumed between the largest component and the merit of what linear equations leave of a residual."""
COARSE: Final = 5e-4
"""Merit at which the iteration on a coarser problem ends, as the two problems differ by more."""
COARSE_STEPS: Final = 40
"""Largest number of steps on a coarser problem."""
ROUGHENING: Final = 100.0
"""Largest factor by which the first step from a coarse solution may raise the merit.

A smooth state violates the laws by little, and its short-wave errors are found at once.
"""
LEAPS: Final = 4
"""Largest number of full steps made in place of a burst where there is no matrix.

Such a step costs less than a burst, and often does as well.
"""
FARTHEST_LEAP: Final = 0.1
"""Largest merit after such a step; a state without load has a merit of one."""
BURST: Final = 25
"""Number of gradient steps in the first burst, made when no fraction of a Newton step helps; it doubles each time."""
LONGEST_BURST: Final = 400
BALANCED: Final = 1e-6
"""Largest error of the resultants of a start with which its motion is retained."""
INSETS: Final = 2
"""Largest number of times that a matrix-free iteration restricts itself to the neighbourhood of the contact."""
NEAR: Final = 0.1
"""Merit below which the iteration does so, unless it starts there."""
STIFFENING: Final = (1.0, 4.0, 16.0)
"""Factors of the step that finds the motion: friction carries more where the same overlap presses more."""


@dataclass(frozen=True, eq=False)
class _Memory:
    """State of the iteration.

    point: the equation at the iterate; merits: of the last states, that of a start being the largest merit allowed;
    flips: (n,) how often each node has opened or closed; fall: ratio of the merit to the one before; burst: number of
    gradient steps of the next burst; leaps: full steps that may still take the place of a burst; inverse: of the last
    step; inset: the neighbourhood whose equation it is, None if it is that of the whole zone; unseen: true if the rest
    of the zone has not been tested for contact; insets: restrictions that are still allowed; enough: violation of the
    laws that is sufficient.
    """

    point: ResidualState
    merits: tuple[float, ...]
    flips: Array
    fall: float = np.inf
    burst: int = BURST
    leaps: int = 0
    inverse: Inverse | None = None
    inset: ContactNeighbourhood | None = None
    unseen: bool = True
    insets: int = 0
    enough: float = LINEAR_FRACTION * StoppingCriteria().tolerance


@final
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
        iterate = _begun(problem, start, 0.0)
        return replace(iterate, memory=replace(_memory(iterate), enough=LINEAR_FRACTION * tolerance))

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Make one Newton step, a fraction of it, or a burst of gradient steps; none if no law is violated."""
        memory = _placed(problem, _memory(iterate))
        point = memory.point
        if point.merit == 0.0:
            return iterate
        left = memory.enough / min(point.law_residual, PEAK * point.merit)
        tolerance = _tolerance(memory.fall, left)
        direction = newton_step(point.equation, point.linearise(), tolerance, memory.inverse)
        allowed = FALL * max(memory.merits)
        flips = memory.flips
        if direction.finite:
            for fraction in FRACTIONS:
                flips, moved = take_step(point, flips, direction, fraction)
                if not moved.merit < allowed:
                    moved = held_where_it_grazes(point, moved)
                if moved.merit < allowed:
                    merits = (*memory.merits, moved.merit)[-PATIENCE:]
                    fall, inverse = moved.merit / point.merit, direction.inverse
                    after = replace(memory, point=moved, merits=merits, flips=flips, fall=fall, inverse=inverse)
                    return _iterate(_looked_beside(problem, after))
            if memory.leaps:
                _, moved = take_step(point, np.zeros_like(flips), direction, 1.0)
                if moved.merit < FARTHEST_LEAP:
                    leapt = replace(_anew(memory, moved, flips), leaps=memory.leaps - 1)
                    return _iterate(_looked_beside(problem, leapt))
        memory = replace(memory, flips=flips)
        if memory.inset is not None:
            memory = _on_whole(problem, memory, memory.inset)
        moved = _gradient_steps(problem, memory.point, memory.flips > FLIPS, memory.burst)
        burst = min(2 * memory.burst, LONGEST_BURST)
        return _iterate(replace(_anew(memory, moved, memory.flips), burst=burst))


def estimated_residual(iterate: Iterate) -> float | None:
    """Return the residual that Newton's equation has at an iterate; None if another solver made the iterate."""
    return iterate.memory.point.law_residual if isinstance(iterate.memory, _Memory) else None


def _begun(problem: ContactProblem, start: ContactState | None, aim: float) -> Iterate:
    """Return the start of an iteration to the merit `aim`; see SemismoothNewton.init."""
    n, insets, leaps = len(problem.gap), *((INSETS, LEAPS) if _matrixless(problem) else (0, 0))
    coarse = coarse_problem(problem) if start is None and insets else None
    below = None if coarse is None else _coarse_solution(coarse.problem)
    prolonged = None if below is None else nested_start(problem, lambda _: below)
    start = start if prolonged is None else prolonged
    contact_fraction, load = np.zeros(n) if start is None else start.contact_fraction, start_load(problem, start)
    motion = start_motion(problem, start)
    part = None if prolonged is None else inset(problem, np.asarray(load.any(axis=1)))
    if part is not None:
        point = part.equation.at(
            load[part.nodes], contact_fraction[part.nodes], _between(contact_fraction[part.nodes]), motion, aim
        )
        insets -= 1
    else:
        point = ContactResidual.of(problem).at(load, contact_fraction, _between(contact_fraction), motion, aim)
    # an attractive contact may adhere as it is: it is not lifted off to find the contact anew
    held = prolonged is not None or (start is not None and is_adhesive(problem.contact_law))
    if not held and (np.abs(point.balance) > BALANCED).any():
        point = point.equation.at(point.load, contact_fraction, point.grazing, _moved_indenter(problem, point), aim)
    flips, rise = np.zeros(len(point.load)), 1.0
    if coarse is not None and below is not None:
        known = _memory(below)
        on_coarse = known.point.equation, neighbourhood_nodes(coarse.problem, known.inset)
        point, rise = improved_start(point, neighbourhood_nodes(problem, part), coarse, *on_coarse), ROUGHENING
    memory = _Memory(point, (rise * point.merit,), flips, leaps=leaps, inset=part, insets=insets)
    return _iterate(replace(memory, unseen=prolonged is None))


def _anew(memory: _Memory, point: ResidualState, flips: Array) -> _Memory:
    """Return the state that continues from a point without the history of those before."""
    return replace(memory, point=point, merits=(point.merit,), flips=flips, fall=np.inf, inverse=None)


def _placed(problem: ContactProblem, memory: _Memory) -> _Memory:
    """Return the state on the neighbourhood of the contact, if any; on the whole zone once that has converged."""
    point, part = memory.point, memory.inset
    if part is not None:
        return _on_whole(problem, memory, part) if point.law_residual <= memory.enough else memory
    if not memory.insets or not point.merit < NEAR:
        return memory
    part = inset(problem, point.load.any(axis=1) | (point.trial[:, 2] < 0.0))
    if part is None:
        return memory if has_parts(problem) else replace(memory, insets=0)
    kept = part.nodes
    nodes = (point.load[kept], point.ahead[kept], point.contact_fraction[kept], point.grazing[kept])
    within = replace(part.equation.beside(*nodes, point.motion), rounded=point.rounded)
    flips = memory.flips[kept]
    return replace(memory, point=within, flips=flips, inverse=None, inset=part, unseen=True, insets=memory.insets - 1)


def _on_whole(problem: ContactProblem, memory: _Memory, part: ContactNeighbourhood) -> _Memory:
    """Return the state on the whole zone, from one on a neighbourhood."""
    point, spread = memory.point, part.spread
    nodes = spread(point.load), spread(point.contact_fraction), spread(point.grazing)
    whole = ContactResidual.of(problem).at(*nodes, point.motion)
    return replace(_anew(memory, whole, spread(memory.flips)), inset=None)


def _looked_beside(problem: ContactProblem, memory: _Memory) -> _Memory:
    """Return the state on the whole zone if there is contact outside the neighbourhood.

    That is tested once, when the contact is known, unless a coarser grid did so: contact that begins later is found
    when the neighbourhood has converged.
    """
    part, point = memory.inset, memory.point
    if part is None or not (memory.unseen and point.merit < COARSE):
        return memory
    return _on_whole(problem, memory, part) if part.has_contact_outside(point) else replace(memory, unseen=False)


def _tolerance(fall: float, left: float) -> float:
    """Return the fraction of the residual that the linear equations may leave.

    fall: ratio of the merits of the last step; left: fraction that is sufficient. Eisenstat and Walker, SIAM J. Sci.
    Comput. 17 (1996) 16, choice 2: as much as Newton's method itself seems to leave.
    """
    return float(np.clip(max(0.9 * fall**1.5, left), TIGHTEST, LOOSEST))


def _matrixless(problem: ContactProblem) -> bool:
    return problem.system.dense() is None


def _coarse_solution(problem: ContactProblem) -> Iterate | None:
    """Return an approximate solution on a coarser system as a start; None if it is not found, or without load.

    If nothing conducts, the load has tension where the contact is open: it would keep apart what conduction pulls
    together.
    """
    solver = SemismoothNewton()
    iterate, steps = _begun(problem, None, COARSE), 0
    while _memory(iterate).point.merit > COARSE:
        if steps == COARSE_STEPS or _hopeless(problem, iterate):
            return None
        iterate, steps = solver.step(problem, iterate), steps + 1
    if not iterate.load.any():
        return None
    if conducting(problem):
        return iterate
    point, part = _memory(iterate).point, _memory(iterate).inset
    gap = point.ahead[:, 2]
    if part is not None:
        around, gap = gap, np.full(len(problem.gap), np.inf)
        gap[part.nodes] = around
    return replace(iterate, load=with_signed_gap(iterate.load, gap, diagonal(problem.system, (2,))[:, 0]))


def _hopeless(problem: ContactProblem, iterate: Iterate) -> bool:
    """Return true if bursts have shown that friction cannot carry the prescribed resultants."""
    if _memory(iterate).burst == BURST:
        return False
    return beyond_friction(problem, evaluate(problem, iterate), problem_scales(problem)) is not None


def _moved_indenter(problem: ContactProblem, point: ResidualState) -> Array:
    """Return a motion (m,) at which the tractions of one projected step have the prescribed resultants.

    At that motion there is contact.
    """
    moving, load = motions(problem), point.load.copy()
    displacement = problem.system.offset + problem.system.apply(load)
    gap = contact_gap(problem, displacement, point.motion)
    for stiffening in STIFFENING:
        r = stiffening * point.equation.r
        balanced = balanced_projection(problem, point.load[:, MECHANICAL], gap, (r, r))
        load[:, MECHANICAL] = balanced.traction
        if (np.abs(unbalance(problem, load)[moving]) <= BALANCED * point.equation.scales.totals[moving]).all():
            break
    motion = point.motion.copy()
    motion[moving] += balanced.motion
    return motion


def _memory(iterate: Iterate) -> _Memory:
    if not isinstance(iterate.memory, _Memory):
        raise TypeError("the iterate was not made by SemismoothNewton.init")
    return iterate.memory


def _iterate(memory: _Memory) -> Iterate:
    """Return the iterate, with the violation of the laws that the equation estimates where products are expensive."""
    point, part = memory.point, memory.inset
    estimate = point.law_residual if _matrixless(point.equation.problem) else None
    load, contact_fraction = point.load, np.clip(point.contact_fraction, 0.0, 1.0)
    if part is not None:
        load, contact_fraction = part.spread(load), part.spread(contact_fraction)
    return Iterate(load, contact_fraction, memory, point.motion, estimate)


def _between(contact_fraction: Array) -> Mask:
    return (contact_fraction > 0.0) & (contact_fraction < 1.0)


def _gradient_steps(problem: ContactProblem, point: ResidualState, grazing: Mask, count: int) -> ResidualState:
    """Return the point after projected Barzilai-Borwein steps; biactive nodes (n,) remain biactive."""
    solver = BarzilaiBorwein()
    contact_fraction = np.clip(point.contact_fraction, 0.0, 1.0)
    iterate = solver.init(problem, ContactState(point.load, np.zeros_like(point.load), contact_fraction, point.motion))
    for _ in range(count):
        iterate = solver.step(problem, iterate)
    return point.equation.at(
        iterate.load, iterate.contact_fraction, grazing | _between(iterate.contact_fraction), iterate.motion
    )
