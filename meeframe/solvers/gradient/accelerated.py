"""Uzawa's method accelerated: projected Barzilai-Borwein steps and restarted Nesterov extrapolation.

Both are gradient steps on the gap with the potentials eliminated, projected by the contact law, as in Uzawa's method,
at one product with the compliance a step. They have nothing to choose: lengths follow from the tractions and gaps that
they meet, and from the largest eigenvalue of the compliance where there is contact.

Friction is no gradient of anything, so that neither need descend. Both watch the violation of the contact law; where it
rises beyond what it was over a window of steps, plain steps of Uzawa's method follow, shorter each time.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, final

import numpy as np

from meeframe.contact.free_motion import start_motion
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver
from meeframe.fields import POTENTIALS, Array
from meeframe.solvers.conduction.elimination import Conductors
from meeframe.solvers.gradient.spectrum import Spectrum
from meeframe.solvers.gradient.steps import Conduction, Ground, Slope, start_load, traction_of

PLAIN_STEP: Final = 1.6
"""A plain step times the largest eigenvalue; the limit of stability is 2."""
WINDOW: Final = 12
RISE: Final = 2.0
"""The violation may rise to so many times its largest value over the window."""
CAUTION: Final = 12
"""So many plain steps follow when it rose further."""
IDLE: Final = 200
"""As many, and three times as many each further time, follow when it has not fallen for so many steps."""
SHORTENING: Final = 0.8
SHORTEST: Final = 0.1
STEP_LIMITS: Final = (0.2, 1e3)
"""Of Barzilai-Borwein steps, in units of the plain one: they are the inverse of some mean eigenvalue."""


@dataclass(frozen=True, eq=False)
class _Guard:
    """Watches the violation of the contact law.

    seen: violations at the last steps; best, idle: the smallest one so far and how many steps ago it was met; plain:
    plain steps still to be made; dose: of plain steps, in units of CAUTION, the next time; wary: whether a rise of the
    violation increases it too; shortening: of the plain steps, 1 at first.
    """

    seen: tuple[float, ...] = ()
    best: float = np.inf
    idle: int = 0
    plain: int = 0
    dose: int = 1
    wary: bool = False
    shortening: float = 1.0

    def next(self, violation: float) -> "_Guard":
        """After a violation was measured."""
        shorter = max(SHORTENING * self.shortening, SHORTEST)
        best = min(violation, self.best)
        if self.idle >= IDLE:
            return _Guard((violation,), best, 0, CAUTION * self.dose, 3 * self.dose, self.wary, shorter)
        if self.seen and violation > RISE * max(self.seen):
            dose = 2 * self.dose if self.wary else self.dose
            plain = CAUTION * self.dose if self.wary else CAUTION
            return replace(self, seen=(violation,), best=best, plain=plain, dose=dose, shortening=shorter)
        better = violation < self.best
        return replace(
            self,
            seen=(*self.seen, violation)[-WINDOW:],
            best=best,
            idle=0 if better or self.plain else self.idle + 1,
            plain=max(self.plain - 1, 0),
        )


@dataclass(frozen=True, eq=False)
class _Memory:
    """What both iterations remember.

    ground, conduction, guard: see there; conductors, spectrum: of the last step; base: (n, 3) tractions from which the
    last step was made (or, extrapolating, the next will be), gap: (n, 3) the gap there; momentum: of the extrapolation;
    turn: number of the step.
    """

    ground: Ground
    conduction: Conduction
    base: Array
    conductors: Conductors | None = None
    spectrum: Spectrum | None = None
    guard: _Guard = _Guard()
    gap: Array | None = None
    momentum: float = 1.0
    turn: int = 0


@final
@dataclass(frozen=True)
class BarzilaiBorwein(Solver):
    """Uzawa's method with projected Barzilai-Borwein steps.

    Source: Barzilai and Borwein, IMA J. Numer. Anal. 8 (1988) 141; Dai and Fletcher, Numer. Math. 100 (2005) 21, for
    projected and alternating steps. Inner products are those of the contact law's metric.
    """

    check_interval: ClassVar[int] = 10

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """The converged state of the previous load step, or no load at all."""
        return _init(problem, start, wary=False)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """One projected step; its length is that of the last change of tractions over that of the gap."""
        memory, traction = _memory(iterate), traction_of(iterate.load)
        memory, slope, plain, violation = _measured(memory, iterate, traction)
        guard = memory.guard.next(violation)
        r = plain * guard.shortening
        if guard.plain == 0 and memory.gap is not None:
            change = traction - memory.base, memory.gap - slope.gap
            r = _secant_step(problem.contact_law.tangential_scaling(), *change, memory.turn % 2 == 1, r)
        memory = replace(memory, guard=guard, base=traction, gap=slope.gap, turn=memory.turn + 1)
        return _stepped(memory, traction, traction, slope, r)[0]


@final
@dataclass(frozen=True)
class Nesterov(Solver):
    """Uzawa's method with Nesterov's extrapolation, restarted when it overshoots.

    Source: Nesterov, Soviet Math. Dokl. 27 (1983) 372; restarts: O'Donoghue and Candes, Found. Comput. Math. 15 (2015)
    715.
    """

    check_interval: ClassVar[int] = 10

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """The converged state of the previous load step, or no load at all."""
        return _init(problem, start, wary=True)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """One projected step from the extrapolated tractions."""
        memory, traction = _memory(iterate), traction_of(iterate.load)
        ahead = memory.base
        memory, slope, plain, violation = _measured(memory, iterate, ahead)
        rises = bool(memory.guard.seen) and violation > memory.guard.seen[-1]
        guard = memory.guard.next(violation)
        r = guard.shortening * plain / PLAIN_STEP
        stepped, moved = _stepped(replace(memory, guard=guard), traction, ahead, slope, r)
        momentum, weight = 1.0, 0.0
        overshoots = float(((ahead - moved) * (moved - traction)).sum()) > 0.0
        if guard.plain == 0 and not overshoots and not rises:
            momentum = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * memory.momentum**2))
            weight = (memory.momentum - 1.0) / momentum
        ahead = moved + weight * (moved - traction)
        return replace(stepped, memory=replace(_memory(stepped), momentum=momentum, base=ahead))


def _init(problem: ContactProblem, start: ContactState | None, wary: bool) -> Iterate:
    n = len(problem.gap)
    conduction, load = Conduction.of(start, n), start_load(problem, start)
    memory = _Memory(Ground.of(problem), conduction, traction_of(load), guard=_Guard(wary=wary))
    return Iterate(load, conduction.contact_fraction, memory, start_motion(problem, start))


def _memory(iterate: Iterate) -> _Memory:
    if not isinstance(iterate.memory, _Memory):
        raise TypeError("the iterate was not made by the init of this solver")
    return iterate.memory


def _measured(memory: _Memory, iterate: Iterate, traction: Array) -> tuple[_Memory, Slope, float, float]:
    """Memory with what belongs to the present contact; slope at tractions (n, 3); plain step; violation there.

    The slope is that with the motions of a plain step. Changes of gaps are then those of the compliance less their part
    that is a free motion: with it, a secant would be that of a body that the indenter cannot follow. The violation is
    the size of the plain step [Pa].
    """
    ground = memory.ground
    conduction, conductors = ground.conductors(iterate, memory.conduction, memory.conductors)
    slope = ground.slope(traction, conductors, iterate.load[:, POTENTIALS], iterate.motion)
    spectrum = ground.spectrum(ground.touching(traction, slope.gap), conductors, memory.spectrum)
    plain = PLAIN_STEP / ground.largest(spectrum)
    step = ground.projected(traction, slope, (plain, plain))
    violation = float(np.linalg.norm(traction - step.traction))
    memory = replace(memory, conduction=conduction, conductors=conductors, spectrum=spectrum)
    return memory, step.slope, plain, violation


def _stepped(memory: _Memory, traction: Array, base: Array, slope: Slope, r: float) -> tuple[Iterate, Array]:
    """The iterate after a step of length r from a base (n, 3) with its slope, and its tractions (n, 3)."""
    step = memory.ground.projected(base, slope, (r, r))
    moved = step.traction
    conduction = memory.ground.conducted(memory.conduction, traction, slope, step)
    load = np.concatenate([moved, slope.flux], axis=1)
    iterate = Iterate(load, conduction.contact_fraction, replace(memory, conduction=conduction), step.slope.motion)
    return iterate, moved


def _secant_step(scaling: Array, change: Array, response: Array, short: bool, plain: float) -> float:
    """Long or short Barzilai-Borwein step [Pa/m] of a change (n, 3) of tractions and the response (n, 3) to it [m].

    scaling: (2, 2) the law's tangential scaling S; the long step is <s, S^-1 s>/<s, y>, the short one <s, y>/<y, S y>,
    y on the nodes that moved: the others are held by the law.
    """
    moved = change.any(axis=1)
    change, response = change[moved], response[moved]
    product = float((change * response).sum())
    if product <= 0.0:
        return plain
    metric = np.eye(3)
    metric[:2, :2] = scaling if short else np.linalg.pinv(scaling)
    if short:
        r = product / float((response * (response @ metric)).sum())
    else:
        r = float((change * (change @ metric)).sum()) / product
    return float(np.clip(r, STEP_LIMITS[0] * plain, STEP_LIMITS[1] * plain))
