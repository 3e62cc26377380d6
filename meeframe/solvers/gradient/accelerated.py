"""Uzawa's method accelerated: projected Barzilai-Borwein steps and restarted Nesterov extrapolation.

Both are gradient steps on the gap with the potentials eliminated, projected by the contact law, as in Uzawa's method,
at one product with the compliance per step. They have no parameters: step lengths follow from the tractions and gaps
encountered, and from the largest eigenvalue of the compliance where there is contact.

Friction does not derive from a potential, so that neither need descend. Both monitor the violation of the contact law;
where it rises beyond its level over a window of steps, plain steps of Uzawa's method follow, shorter each time.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, final

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.contact.free_motion import start_load, start_motion
from meeframe.contact.generated_heat import check_no_generated_heat
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver
from meeframe.fields import MECHANICAL, POTENTIALS, Array
from meeframe.solvers.conduction.elimination import Conductors
from meeframe.solvers.gradient.steps import Conduction, GradientStepper, Slope, Spectrum

PLAIN_STEP: Final = 1.6
"""Plain step times the largest eigenvalue; the limit of stability is 2."""
WINDOW: Final = 12
MAX_RISE: Final = 2.0
"""Largest allowed growth of the violation over its largest value in the window."""
PLAIN_STEPS: Final = 12
"""Number of plain steps after a larger growth."""
MAX_IDLE_STEPS: Final = 200
"""Number of steps without a decrease of the violation after which plain steps follow, three times as many each time."""
SHORTENING_FACTOR: Final = 0.8
MIN_SHORTENING: Final = 0.1
STEP_LIMITS: Final = (0.2, 1e3)
"""Limits of Barzilai-Borwein steps in units of the plain one; each is the inverse of some mean eigenvalue."""


@dataclass(frozen=True, eq=False)
class _Guard:
    """Monitor of the violation of the contact law.

    violations: violations at the last steps; best, idle: the smallest one so far and the number of steps since;
    plain_steps: plain steps still to be made; plain_rounds: their number the next time, in units of PLAIN_STEPS;
    lengthens_on_rise: whether a rise of the violation increases it too; shortening: factor on their length, at first 1.
    """

    violations: tuple[float, ...] = ()
    best: float = np.inf
    idle: int = 0
    plain_steps: int = 0
    plain_rounds: int = 1
    lengthens_on_rise: bool = False
    shortening: float = 1.0

    def next(self, violation: float) -> "_Guard":
        """Return the monitor after a further violation."""
        shorter, best = max(SHORTENING_FACTOR * self.shortening, MIN_SHORTENING), min(violation, self.best)
        steps, rounds = PLAIN_STEPS * self.plain_rounds, self.plain_rounds
        if self.idle >= MAX_IDLE_STEPS:
            return _Guard((violation,), best, 0, steps, 3 * rounds, self.lengthens_on_rise, shorter)
        if self.violations and violation > MAX_RISE * max(self.violations):
            steps, rounds = (steps, 2 * rounds) if self.lengthens_on_rise else (PLAIN_STEPS, rounds)
            return _Guard((violation,), best, self.idle, steps, rounds, self.lengthens_on_rise, shorter)
        return replace(
            self,
            violations=(*self.violations, violation)[-WINDOW:],
            best=best,
            idle=0 if violation < self.best or self.plain_steps else self.idle + 1,
            plain_steps=max(self.plain_steps - 1, 0),
        )


@dataclass(frozen=True, eq=False)
class _Memory:
    """State of both iterations between steps.

    stepper, conduction, guard: see their classes; conductors, spectrum: of the last step; base: (n, 3) tractions from
    which the last step was made (with extrapolation, from which the next will be made), gap: (n, 3) the gap there;
    momentum: of the extrapolation; iteration: number of the step.
    """

    stepper: GradientStepper
    conduction: Conduction
    base: Array
    conductors: Conductors | None = None
    spectrum: Spectrum | None = None
    guard: _Guard = _Guard()
    gap: Array | None = None
    momentum: float = 1.0
    iteration: int = 0


@final
@checked_arguments
@dataclass(frozen=True)
class BarzilaiBorwein(Solver):
    """Projected Barzilai-Borwein steps for Uzawa's method.

    Source: Barzilai and Borwein, IMA J. Numer. Anal. 8 (1988) 141; Dai and Fletcher, Numer. Math. 100 (2005) 21, for
    projected and alternating steps. Inner products are those of the contact law's metric.
    """

    check_interval: ClassVar[int] = 10

    def check(self, problem: ContactProblem) -> None:
        """Raise CaseError if friction or a current heats the body."""
        check_no_generated_heat(problem, "uzawa-bb")

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """Return the converged state of the previous load step, or no load at all."""
        return _init(problem, start, lengthens_on_rise=False)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Take one projected step; its length is the ratio of the last changes of tractions and gap."""
        memory, traction = iterate.memory_as(_Memory), iterate.load[:, MECHANICAL]
        memory, slope, plain_step, violation = _evaluate(memory, iterate, traction)
        guard = memory.guard.next(violation)
        r = plain_step * guard.shortening
        if guard.plain_steps == 0 and memory.gap is not None:
            change = traction - memory.base, memory.gap - slope.gap
            r = _secant_step(problem.contact_law.tangential_scaling(), *change, memory.iteration % 2 == 1, r)
        memory = replace(memory, guard=guard, base=traction, gap=slope.gap, iteration=memory.iteration + 1)
        return _take_step(memory, traction, traction, slope, r)


@final
@checked_arguments
@dataclass(frozen=True)
class Nesterov(Solver):
    """Nesterov's extrapolation for Uzawa's method, restarted when it overshoots.

    Source: Nesterov, Sov. Math. Dokl. 27 (1983) 372; restarts: O'Donoghue & Candes, Found. Comput. Math. 15 (2015) 715.
    """

    check_interval: ClassVar[int] = 10

    def check(self, problem: ContactProblem) -> None:
        """Raise CaseError if friction or a current heats the body."""
        check_no_generated_heat(problem, "uzawa-nesterov")

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """Return the converged state of the previous load step, or no load at all."""
        return _init(problem, start, lengthens_on_rise=True)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Take one projected step from the extrapolated tractions."""
        memory, traction = iterate.memory_as(_Memory), iterate.load[:, MECHANICAL]
        extrapolated = memory.base
        memory, slope, plain_step, violation = _evaluate(memory, iterate, extrapolated)
        rises = bool(memory.guard.violations) and violation > memory.guard.violations[-1]
        guard = memory.guard.next(violation)
        r = guard.shortening * plain_step / PLAIN_STEP
        next_iterate = _take_step(replace(memory, guard=guard), traction, extrapolated, slope, r)
        next_traction = next_iterate.load[:, MECHANICAL]
        momentum, weight = 1.0, 0.0
        overshoots = float(((extrapolated - next_traction) * (next_traction - traction)).sum()) > 0.0
        if guard.plain_steps == 0 and not overshoots and not rises:
            momentum = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * memory.momentum**2))
            weight = (memory.momentum - 1.0) / momentum
        extrapolated = next_traction + weight * (next_traction - traction)
        return replace(
            next_iterate, memory=replace(next_iterate.memory_as(_Memory), momentum=momentum, base=extrapolated)
        )


def _init(problem: ContactProblem, start: ContactState | None, lengthens_on_rise: bool) -> Iterate:
    n = len(problem.gap)
    conduction, load = Conduction.of(start, n), start_load(problem, start)
    memory = _Memory(
        GradientStepper.of(problem), conduction, load[:, MECHANICAL], guard=_Guard(lengthens_on_rise=lengthens_on_rise)
    )
    return Iterate(load, conduction.contact_fraction, memory, start_motion(problem, start))


def _evaluate(memory: _Memory, iterate: Iterate, traction: Array) -> tuple[_Memory, Slope, float, float]:
    """Return the state for the present contact, the slope at tractions (n, 3), the plain step and the violation.

    The slope includes the motions of a plain step, whose size [Pa] is the violation. Changes of gaps are then those of
    the compliance without free motions: with them, a secant would be that of a body that the indenter cannot follow.
    """
    stepper = memory.stepper
    conduction, conductors = stepper.conductors(iterate, memory.conduction, memory.conductors)
    slope = stepper.slope(traction, conductors, iterate.load[:, POTENTIALS], iterate.motion)
    spectrum = stepper.spectrum(stepper.touching(traction, slope.gap), conductors, memory.spectrum)
    plain_step = PLAIN_STEP / stepper.largest(spectrum)
    step = stepper.project(traction, slope, (plain_step, plain_step))
    violation = float(np.linalg.norm(traction - step.traction))
    memory = replace(memory, conduction=conduction, conductors=conductors, spectrum=spectrum)
    return memory, step.slope, plain_step, violation


def _take_step(memory: _Memory, traction: Array, base: Array, slope: Slope, r: float) -> Iterate:
    """Return the iterate after a step of length r from tractions (n, 3) by way of a base (n, 3) with its slope."""
    iterate, conduction = memory.stepper.take_step(traction, base, slope, (r, r), memory.conduction)
    return replace(iterate, memory=replace(memory, conduction=conduction))


def _secant_step(scaling: Array, change: Array, response: Array, short: bool, plain_step: float) -> float:
    """Return the long or short Barzilai-Borwein step [Pa/m].

    change: (n, 3) of the tractions; response: (n, 3) to it [m]; scaling: (2, 2) the law's tangential scaling S. The
    long step is <s, S^-1 s>/<s, y>, the short one <s, y>/<y, S y>, y on nodes that changed: the law holds others.
    """
    changed = change.any(axis=1)
    change, response = change[changed], response[changed]
    product = float((change * response).sum())
    if product <= 0.0:
        return plain_step
    metric = np.eye(3)
    metric[:2, :2] = scaling if short else np.linalg.pinv(scaling)
    if short:
        numerator, denominator = product, float((response * (response @ metric)).sum())
    else:
        numerator, denominator = float((change * (change @ metric)).sum()), product
    if denominator == 0.0:  # squares of round-off vanish first
        return plain_step
    return float(np.clip(numerator / denominator, STEP_LIMITS[0] * plain_step, STEP_LIMITS[1] * plain_step))
