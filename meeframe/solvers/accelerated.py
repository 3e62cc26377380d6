"""Uzawa's method accelerated: projected Barzilai-Borwein steps and restarted Nesterov extrapolation."""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, final

import numpy as np

from meeframe.core.contact import ContactProblem, ContactState, Iterate, Solver, augmented_traction
from meeframe.core.fields import Array
from meeframe.solvers.gradient import Conduction, Ground, start_load, traction_of
from meeframe.solvers.spectrum import Spectrum

NESTEROV_STEP: Final = 1.0
"""The step of the extrapolated iteration times the largest eigenvalue."""
CAUTIOUS_STEP: Final = 1.6
"""A plain step times the largest eigenvalue; the limit of stability is 2."""
WINDOW: Final = 12
"""Over so many steps back may the violation of the contact law rise."""
CAUTION: Final = 12
"""So many plain steps follow when it rose further."""
STRETCH: Final = 30.0
"""Longest step in units of the last that was stable for every load."""


@dataclass(frozen=True, eq=False)
class _Memory:
    """ground: of the problem; conduction, conductors, spectrum: of the last step; slope: (n, 3) -S gap and traction
    (n, 3) of the last step; violations: of the contact law at the last steps; plain: plain steps still to be made;
    turn: number of the step; reference: (n, 3) extrapolated traction and weight of the next extrapolation (Nesterov)."""

    ground: Ground
    conduction: Conduction
    conductors: object = None
    spectrum: Spectrum | None = None
    gap: Array | None = None
    traction: Array | None = None
    violations: tuple[float, ...] = ()
    plain: int = 0
    turn: int = 0
    momentum: float = 1.0
    ahead: Array | None = None


@final
@dataclass(frozen=True)
class BarzilaiBorwein(Solver):
    """x"""

    stride: ClassVar[int] = 10

    def init(self, problem: ContactProblem, start: ContactState | None) -> Iterate:
        return _init(problem, start)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        memory: _Memory = iterate.memory
        ground, law = memory.ground, problem.contact_law
        traction = traction_of(iterate.load)
        conductors = ground.conductors(traction, iterate.closed, memory.conductors)
        slope = ground.slope(traction, conductors, iterate.load[:, 3:])
        touching = (traction[:, 2] < 0.0) | (slope.gap[:, 2] < 0.0)
        spectrum = ground.spectrum(touching, conductors, memory.spectrum)
        safe = CAUTIOUS_STEP / spectrum.largest if spectrum.largest > 0.0 else 1.0
        violation = _violation(ground, traction, slope.gap, safe)
        plain = memory.plain
        if memory.violations and violation > 2.0 * max(memory.violations):
            plain = CAUTION
        r = safe
        if plain == 0 and memory.gap is not None:
            r = _bb(law.tangential_scaling(), traction - memory.traction, memory.gap - slope.gap, memory.turn, safe)
        trial = augmented_traction(law, traction, slope.gap, r, r)
        new = law.project(trial)
        conduction = memory.conduction.next(traction[:, 2], new[:, 2], trial[:, 2], ground.scales)
        memory = replace(memory, conduction=conduction, conductors=conductors, spectrum=spectrum, gap=slope.gap,
            traction=traction, violations=(*memory.violations, violation)[-WINDOW:], plain=max(plain - 1, 0), turn=memory.turn + 1)
        return Iterate(np.concatenate([new, slope.flux], axis=1), conduction.closed, memory)


@final
@dataclass(frozen=True)
class Nesterov(Solver):
    """x"""

    stride: ClassVar[int] = 10

    def init(self, problem: ContactProblem, start: ContactState | None) -> Iterate:
        return _init(problem, start)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        memory: _Memory = iterate.memory
        ground, law = memory.ground, problem.contact_law
        traction = traction_of(iterate.load)
        ahead = traction if memory.ahead is None else memory.ahead
        conductors = ground.conductors(traction, iterate.closed, memory.conductors)
        slope = ground.slope(ahead, conductors, iterate.load[:, 3:])
        touching = (traction[:, 2] < 0.0) | (slope.gap[:, 2] < 0.0)
        spectrum = ground.spectrum(touching, conductors, memory.spectrum)
        r = NESTEROV_STEP / spectrum.largest if spectrum.largest > 0.0 else 1.0
        trial = augmented_traction(law, ahead, slope.gap, r, r)
        new = law.project(trial)
        if ((ahead - new) * (new - traction)).sum() > 0.0:
            momentum, weight = 1.0, 0.0
        else:
            momentum = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * memory.momentum**2))
            weight = (memory.momentum - 1.0) / momentum
        conduction = memory.conduction.next(traction[:, 2], new[:, 2], trial[:, 2], ground.scales)
        memory = replace(memory, conduction=conduction, conductors=conductors, spectrum=spectrum, momentum=momentum, ahead=new + weight * (new - traction))
        return Iterate(np.concatenate([new, slope.flux], axis=1), conduction.closed, memory)


def _init(problem: ContactProblem, start: ContactState | None) -> Iterate:
    n = len(problem.gap)
    conduction = Conduction.of(start, n)
    return Iterate(start_load(start, n), conduction.closed, _Memory(Ground.of(problem), conduction))


def _violation(ground: Ground, traction: Array, gap: Array, r: float) -> float:
    law = ground.problem.contact_law
    return float(np.linalg.norm(traction - law.project(augmented_traction(law, traction, gap, r, r))))


def _bb(scaling: Array, s: Array, y: Array, turn: int, safe: float) -> float:
    """y = C s"""
    moved = s.any(axis=1)
    inverse = np.eye(3)
    inverse[:2, :2] = np.linalg.pinv(scaling)
    root = np.eye(3)
    root[:2, :2] = scaling
    y = np.where(moved[:, None], y, 0.0)
    sy = float((s * y).sum())
    if sy <= 0.0:
        return safe
    long = float((s * (s @ inverse)).sum()) / sy
    short = sy / float((y * (y @ root)).sum())
    r = short if turn % 2 and short > 0 else long
    return float(np.clip(r, 0.3*safe, 1e3 * safe))
