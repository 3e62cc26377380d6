"""Semismooth Newton on the nonsmooth equation of the contact problem, globalised so that it converges from zero."""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, final

import numpy as np

from meeframe.core.contact import ContactProblem, ContactState, Iterate, Solver, contact_gap, unbalance
from meeframe.core.fields import MECHANICAL, N_FIELDS, Array
from meeframe.core.law import attraction, attracts
from meeframe.solvers.accelerated import BarzilaiBorwein
from meeframe.solvers.conduction import Mask
from meeframe.solvers.driver import Limits
from meeframe.solvers.free_motion import balanced_projection, motions, start_motion
from meeframe.solvers.gradient import start_load
from meeframe.solvers.nested import nested_start, tensed
from meeframe.solvers.newton_krylov import Inverse
from meeframe.solvers.newton_steps import Step, newton_step
from meeframe.solvers.nonsmooth import CLOSED, Equation, Point

FRACTIONS: Final = (1.0, 0.5, 0.25, 0.125)
"""Of a Newton step, tried in turn."""
PATIENCE: Final = 2
"""A step must come below the largest merit of so many states."""
FALL: Final = 0.99
"""So far below, as a fraction."""
FLIPS: Final = 1
"""A node may open and close so many times before it is taken to graze: that does it no harm if it need not."""
ROUND_OFF: Final = 1e-14
"""A normal traction below this fraction of the characteristic one is none."""
LOOSEST: Final = 0.03
TIGHTEST: Final = 1e-4
"""Tolerances of the linear equations where there is no matrix."""
ENOUGH: Final = 0.2 * Limits().tolerance
"""Violation of the laws that linear equations need not leave less of: who asks for more has another step."""
COARSE: Final = 1e-3
"""Merit at which a coarser problem is left: the two differ by more."""
COARSE_STEPS: Final = 1, 40
"""At least and at most."""
ROUGHENING: Final = 100.0
"""The first step from there may raise the merit so much: a smooth state violates the laws by little, and what is short
in it is found at once."""
LEAPS: Final = 4
"""So often a full step is made in place of a burst where there is no matrix: it costs less, and often does as well."""
FARTHEST_LEAP: Final = 0.1
"""Merit at which that may end; one is that of no load at all."""
BURST: Final = 25
"""Gradient steps, the first time that no fraction of a Newton step does; twice as many each further time."""
LONGEST_BURST: Final = 400
BALANCED: Final = 1e-6
"""Resultants of a start that miss the prescribed ones by less need no other motion to begin with."""
STIFFENING: Final = (1.0, 4.0, 16.0)
"""Of the step that finds it: friction bears more where the same overlap presses more."""


@dataclass(frozen=True, eq=False)
class _Memory:
    """point: the equation at the iterate; merits: of the last states, that of a start as high as it may rise; flips:
    (n,) how often each node has opened or closed; fall: its merit over that before; burst: how many gradient steps are
    made the next time; leaps: full steps that may still take their place."""

    point: Point
    merits: tuple[float, ...]
    flips: Array
    fall: float = np.inf
    burst: int = BURST
    leaps: int = 0
    inverse: Inverse | None = None


@final
@dataclass(frozen=True)
class SemismoothNewton(Solver):
    """Newton's method on the residual of eqs. (27)-(29) with generalised Jacobians of the laws.

    A step solves the linearised equations for tractions, fluxes, the closed fractions of grazing nodes and the free
    motions of the indenter together, by factorisation at contact size or, where the compliance is not held as a matrix,
    by GMRES. Tractions are then made admissible. A step that does not bring the merit (the root mean square of the
    residual, balance included) below that of the last two states is halved, up to three times. If that does not help,
    a burst of projected Barzilai-Borwein steps takes its place, from where Newton's method starts again.

    Source: Christensen et al., Int. J. Numer. Methods Eng. 42 (1998) 145 for frictional contact; Qi and Sun, Math.
    Program. 58 (1993) 353 for the convergence.
    """

    patience: ClassVar[int] = 40

    def init(self, problem: ContactProblem, start: ContactState | None) -> Iterate:
        """The converged state of the previous load step, the solution on a coarser system, or no load at all."""
        n = len(problem.gap)
        prolonged = nested_start(problem, _coarse_solution) if start is None and _matrixless(problem) else None
        start = start if prolonged is None else prolonged
        closed = np.zeros(n) if start is None else start.closed
        equation = Equation.of(problem)
        motion = start_motion(problem, start)
        point = equation.at(start_load(start, n), closed, _between(closed), motion)
        # what attracts may hold where it is, so that it is not lifted off to find the contact anew
        held = prolonged is not None or (start is not None and attracts(problem.contact_law))
        if not held and (np.abs(point.balance) > BALANCED).any():
            point = equation.at(point.load, closed, point.grazing, _moved_indenter(problem, point))
        rise = 1.0 if prolonged is None else ROUGHENING
        return _iterate(_Memory(point, (rise * point.merit,), np.zeros(n), leaps=LEAPS if _matrixless(problem) else 0))

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """One Newton step, a fraction of it, or a burst of gradient steps; none from where no law is violated."""
        memory = _memory(iterate)
        point = memory.point
        if point.merit == 0.0:
            return iterate
        tolerance = _tolerance(memory.fall, point.violation)
        direction = newton_step(point.equation, point.linearise(), tolerance, memory.inverse)
        allowed = FALL * max(memory.merits)
        flips = memory.flips
        if direction.finite:
            for fraction in FRACTIONS:
                flips, moved = _moved(point, flips, direction, fraction)
                if not moved.merit < allowed:
                    moved = _held(point, moved)
                if moved.merit < allowed:
                    merits = (*memory.merits, moved.merit)[-PATIENCE:]
                    fall, inverse = moved.merit / point.merit, direction.inverse
                    return _iterate(_Memory(moved, merits, flips, fall, memory.burst, memory.leaps, inverse))
            if memory.leaps:
                _, moved = _moved(point, np.zeros_like(flips), direction, 1.0)
                if moved.merit < FARTHEST_LEAP:
                    return _iterate(_Memory(moved, (moved.merit,), flips, burst=memory.burst, leaps=memory.leaps - 1))
        moved = _gradient_steps(problem, point, flips > FLIPS, memory.burst)
        burst = min(2 * memory.burst, LONGEST_BURST)
        return _iterate(_Memory(moved, (moved.merit,), flips, burst=burst, leaps=memory.leaps))


def _tolerance(fall: float, violation: float) -> float:
    """Fraction of the residual that may be left of the linear equations, by the fall of the merit in the last step and
    what is left to be done.

    Eisenstat and Walker, SIAM J. Sci. Comput. 17 (1996) 16, choice 2: as much as Newton's method itself seems to leave.
    """
    return float(np.clip(max(0.5 * fall**1.5, ENOUGH / violation), TIGHTEST, LOOSEST))


def _matrixless(problem: ContactProblem) -> bool:
    return problem.system.dense() is None


def _coarse_solution(problem: ContactProblem) -> Iterate | None:
    """Roughly that of a problem on a coarser system, from which to start, with tension where the contact is open; None
    if it is not found, or without load."""
    solver, (least, most) = SemismoothNewton(), COARSE_STEPS
    iterate, steps = solver.init(problem, None), 0
    while steps < least or _memory(iterate).point.merit > COARSE:
        if steps == most:
            return None
        iterate, steps = solver.step(problem, iterate), steps + 1
    if not iterate.load.any():
        return None
    gap = _memory(iterate).point.ahead[:, 2]
    return replace(iterate, load=tensed(iterate.load, gap, problem.system.diagonal_blocks()[:, 2, 2]))


def _moved_indenter(problem: ContactProblem, point: Point) -> Array:
    """Motion (m,) at which the tractions of one projected step bear the prescribed resultants: something is touched."""
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
    """The iterate; where products are dear, with the violation of the laws that the equation knows of."""
    point = memory.point
    estimate = point.violation if _matrixless(point.equation.problem) else None
    return Iterate(point.load, np.clip(point.closed, 0.0, 1.0), memory, point.motion, estimate)


def _between(closed: Array) -> Mask:
    return (closed > 0.0) & (closed < 1.0)


def _moved(point: Point, flips: Array, step: Step, fraction: float) -> tuple[Array, Point]:
    """Flips (n,) and point after a fraction of a step. Nodes whose conduction keeps changing are taken to graze.

    They begin between open and closed, where their own switching would take their trial to zero: from one of the ends
    the first step goes too far, since the drive changes along with the fraction.
    """
    equation = point.equation
    motion = point.motion + fraction * step.motion
    load = point.load + fraction * step.local[:, :N_FIELDS]
    load[:, MECHANICAL] = _admissible(equation.problem, load, motion)
    # what is left of a traction that the step took away
    load[np.abs(load[:, 2]) < ROUND_OFF * equation.scales.pressure, MECHANICAL] = 0.0
    moved = equation.at(load, point.closed + fraction * step.local[:, CLOSED], point.grazing, motion)
    changed = (moved.closed > 0.0) != (point.closed > 0.0)
    flips = flips + (changed & moved.jump.any(axis=1))
    fresh = (flips > FLIPS) & ~moved.grazing
    if not fresh.any():
        return flips, moved
    closed, lift = moved.closed.copy(), moved.lift
    within = np.flatnonzero(fresh & (np.abs(moved.trial[:, 2]) < lift))
    closed[within] = np.clip(point.closed[within] - moved.trial[within, 2] / lift[within], 0.0, 1.0)
    return flips, equation.beside(load, moved.ahead, closed, moved.grazing | fresh, motion)


def _held(point: Point, moved: Point) -> Point:
    """A moved point, or the same with nodes that graze where it opened or closed them, if that violates the laws less.

    Their conduction stays for the time being: it would jump, and the fluxes with it. Only nodes whose trial is as near
    to zero as their own switching moves it can graze.
    """
    switched = ((moved.closed > 0.0) != (point.closed > 0.0)) & moved.jump.any(axis=1) & ~moved.grazing
    near = switched & (np.abs(moved.trial[:, 2]) < moved.sigma)
    if not near.any():
        return moved
    closed = np.where(near, point.closed, moved.closed)
    held = moved.equation.beside(moved.load, moved.ahead, closed, moved.grazing | near, moved.motion)
    return held if held.merit < moved.merit else moved


def _admissible(problem: ContactProblem, load: Array, motion: Array) -> Array:
    """Tractions (n, 3) of a load (n, 5) at a motion (m,), the contact's part of them projected by the law."""
    law, traction = problem.contact_law, load[:, MECHANICAL].copy()
    pull = np.zeros(len(load))
    if attracts(law):
        displacement = problem.system.offset + problem.system.apply(load)
        pull = attraction(law, contact_gap(problem, displacement, motion)[:, 2])
    traction[:, 2] -= pull
    traction = law.project(traction)
    traction[:, 2] += pull
    return traction


def _gradient_steps(problem: ContactProblem, point: Point, grazing: Mask, count: int) -> Point:
    """The point that projected Barzilai-Borwein steps reach; nodes (n,) that graze go on grazing."""
    solver = BarzilaiBorwein()
    closed = np.clip(point.closed, 0.0, 1.0)
    iterate = solver.init(problem, ContactState(point.load, np.zeros_like(point.load), closed, point.motion))
    for _ in range(count):
        iterate = solver.step(problem, iterate)
    return point.equation.at(iterate.load, iterate.closed, grazing | _between(iterate.closed), iterate.motion)
