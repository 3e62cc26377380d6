"""Projected conjugate gradients for frictionless contact, the potentials eliminated at contact size."""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, final

import numpy as np

from meeframe.core.contact import ContactProblem, ContactState, Iterate, Solver
from meeframe.core.errors import CaseError
from meeframe.core.fields import Array
from meeframe.core.law import ContactLaw, attracts
from meeframe.solvers.conduction import Mask
from meeframe.solvers.elimination import Conductors
from meeframe.solvers.free_motion import start_motion
from meeframe.solvers.gradient import Conduction, Ground, start_load
from meeframe.solvers.normal_modes import NormalModes

REFRESH: Final = 0.1
"""The conduction is brought up to date when the violation has fallen to this fraction since the last time."""
RENEWAL: Final = 50
"""And after so many steps in any case; the gap is then computed anew, free of accumulated round-off."""


@dataclass(frozen=True, eq=False)
class _Memory:
    """What the iteration remembers.

    ground, modes, conduction: see there; conductors: in force, held while the iteration minimises; weight: (n,) of the
    inner product; gap: (n,) normal gap, flux: (n, 2) and motion: (m,) at the iterate, the indenter at rest; direction,
    residual: (n,) of the last step; free: (n,) nodes that it moved; start: violation when the conduction was brought up
    to date; age: steps since.
    """

    ground: Ground
    modes: NormalModes
    conduction: Conduction
    conductors: Conductors
    weight: Array
    gap: Array
    flux: Array
    motion: Array
    direction: Array
    residual: Array
    free: Mask
    start: float
    age: int = 0


@final
@dataclass(frozen=True)
class ProjectedCG(Solver):
    """Conjugate gradients on the pressure with exact line search, projected on compression; frictionless contact only.

    Minimises the quadratic form of the compliance for the conduction as it is, on the nodes with pressure or overlap;
    nodes that lose their pressure leave, nodes that overlap come in and restart the conjugation. Inner products are
    weighted by the nodes' areas, in which a compliance by reciprocity is symmetric; it need not be exactly so, as the
    directions are those of Polak and Ribiere. When the violation has fallen to a tenth the conduction follows.

    Where resultants of the pressure are prescribed, directions have none, the motions of the indenter take the mean out
    of the gaps, and where pressure was lost the nearest balanced one is found.

    Source: Polonsky and Keer, Wear 231 (1999) 206; Dostal, Optimal Quadratic Programming Algorithms (2009), chapter 5.
    """

    stride: ClassVar[int] = 5

    def init(self, problem: ContactProblem, start: ContactState | None) -> Iterate:
        """The converged state of the previous load step, or no load at all.

        Raises CaseError if the contact law is not that of frictionless unilateral contact, or as NormalModes.of.
        """
        ground, modes = Ground.of(problem), NormalModes.of(problem)
        _check(problem.contact_law, ground.scales.pressure)
        n = len(problem.gap)
        load, conduction = start_load(start, n), Conduction.of(start, n)
        motion = start_motion(problem, start)
        conduction, conductors = ground.conductors(Iterate(load, conduction.closed, motion=motion), conduction, None)
        slope = ground.slope(load[:, :3], conductors, load[:, 3:], motion)
        if modes.numbers.size:
            # the tractions of one step bear the resultants; from there on every direction keeps them
            r = 1.0 / ground.scales.normal_compliance
            step = ground.projected(load[:, :3], slope, (r, r))
            slope = ground.slope(step.traction, conductors, slope.flux, step.slope.motion)
            load = np.concatenate([step.traction, slope.flux], axis=1)
        weight = problem.system.weights
        weight = weight / weight.max() if (weight > 0.0).all() else np.ones(n)
        still = np.zeros(n)
        gap, motion = modes.rested(-load[:, 2], slope.gap[:, 2], slope.motion)
        mechanics = (ground, modes, conduction, conductors, weight)
        memory = _Memory(*mechanics, gap, slope.flux, motion, still, still, np.zeros(n, bool), np.inf)
        return Iterate(load, conduction.closed, memory, motion)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """One step along a conjugate direction; before it, if it is time, the conduction is brought up to date."""
        memory = _memory(iterate)
        pressure = -iterate.load[:, 2]
        free = (pressure > 0.0) | (memory.gap < 0.0)
        residual = np.where(free, memory.gap, 0.0)
        memory = self._conjugate(memory, residual, free)
        response = _response(memory, memory.direction)
        # the indenter follows, so that only what it cannot follow resists
        curvature = float(memory.weight @ (memory.direction * memory.modes.without(response.gap, free)))
        if curvature <= 0.0:
            return self._refreshed(memory, pressure)
        length = float(memory.weight @ (residual * memory.direction)) / curvature
        moved = pressure - length * memory.direction
        memory = replace(memory, age=memory.age + 1)
        if (moved >= 0.0).all():
            change = (length * response.gap, length * response.flux, length * response.motion)
            memory = _placed(memory, moved, memory.gap - change[0], memory.flux - change[1], memory.motion - change[2])
        else:
            moved = memory.modes.balanced(moved, free)
            memory = _renewed(memory, moved)
        violation = _violation(memory, moved)
        if violation <= REFRESH * memory.start or memory.age >= RENEWAL:
            return self._refreshed(memory, moved)
        return _iterate(memory, moved)

    def _conjugate(self, memory: _Memory, residual: Array, free: Mask) -> _Memory:
        """Memory with the next direction: steepest descent if nodes came in, else that of Polak and Ribiere."""
        norm = float(memory.weight @ memory.residual**2)
        share = 0.0
        if norm > 0.0 and not (free & ~memory.free).any():
            share = max(float(memory.weight @ (residual * (residual - memory.residual))) / norm, 0.0)
        direction = memory.modes.without(residual + share * memory.direction, free)
        if float(memory.weight @ (direction * residual)) <= 0.0:
            direction = memory.modes.without(residual, free)
        return replace(memory, direction=direction, residual=residual, free=free)

    def _refreshed(self, memory: _Memory, pressure: Array) -> Iterate:
        """Iterate at a pressure (n,), balanced anew, with the conduction that belongs to it."""
        ground = memory.ground
        if memory.modes.numbers.size:
            pressure = memory.modes.balanced(pressure, pressure > 0.0)
        r = 1.0 / ground.scales.normal_compliance
        trial = -pressure + r * memory.gap
        touched = np.where(memory.conduction.closed > 0.0, -1.0, 0.0)
        conduction = memory.conduction.next(touched, -pressure, trial, ground.scales)
        load = np.concatenate([_traction(pressure), memory.flux], axis=1)
        iterate = Iterate(load, conduction.closed, motion=memory.motion)
        conduction, conductors = ground.conductors(iterate, conduction, memory.conductors)
        same = conductors is memory.conductors
        memory = _renewed(replace(memory, conduction=conduction, conductors=conductors, age=0), pressure)
        if not same:
            memory = replace(memory, residual=np.zeros_like(pressure), direction=np.zeros_like(pressure))
        return _iterate(replace(memory, start=_violation(memory, pressure)), pressure)


def _check(law: ContactLaw, pressure: float) -> None:
    """Raises CaseError unless the law is p_nu = min(0, p_nu*) without friction."""
    trial = pressure * np.array([[0.5, 0.5, -1.0], [0.0, 0.0, -1e-3], [0.5, 0.0, 1.0], [0.0, 0.0, 1e-3]])
    expected = np.zeros_like(trial)
    expected[:2, 2] = trial[:2, 2]
    plain = type(law).resolve is ContactLaw.resolve and not attracts(law) and not law.tangential_scaling().any()
    if not plain or not np.allclose(law.project(trial), expected, rtol=1e-12, atol=0.0):
        raise CaseError(
            f"solver 'projected-cg' takes frictionless contact only, rigid and without attraction, not "
            f"{type(law).__name__}; allowed contact law: signorini, or friction with mu = 0. Use 'newton', 'uzawa-bb', "
            "'uzawa-nesterov', 'uzawa' or 'auto' for others"
        )


def _memory(iterate: Iterate) -> _Memory:
    if not isinstance(iterate.memory, _Memory):
        raise TypeError("the iterate was not made by ProjectedCG.init")
    return iterate.memory


def _iterate(memory: _Memory, pressure: Array) -> Iterate:
    load = np.concatenate([_traction(pressure), memory.flux], axis=1)
    return Iterate(load, memory.conduction.closed, memory, memory.motion)


def _traction(pressure: Array) -> Array:
    """Tractions (n, 3) of a pressure (n,)."""
    traction = np.zeros((len(pressure), 3))
    traction[:, 2] = -pressure
    return traction


@dataclass(frozen=True, eq=False)
class _Response:
    """What a pressure alone causes: opening (n,) of the gap, flux (n, 2), change of the motion (m,)."""

    gap: Array
    flux: Array
    motion: Array


def _response(memory: _Memory, pressure: Array) -> _Response:
    response = memory.ground.elimination.respond(_traction(pressure), memory.conductors, np.zeros_like(memory.flux))
    motion = np.zeros_like(memory.motion)
    motion[memory.conductors.floating.numbers] = response.potential
    return _Response(-response.displacement[:, 2], response.flux, motion)


def _renewed(memory: _Memory, pressure: Array) -> _Memory:
    """Memory at a pressure (n,), without accumulated round-off."""
    slope = memory.ground.slope(_traction(pressure), memory.conductors, memory.flux, memory.motion)
    return _placed(memory, pressure, slope.gap[:, 2], slope.flux, slope.motion)


def _placed(memory: _Memory, pressure: Array, gap: Array, flux: Array, motion: Array) -> _Memory:
    """Memory at a pressure (n,) with its gap (n,), flux (n, 2) and motion (m,), after the indenter has come to rest."""
    gap, motion = memory.modes.rested(pressure, gap, motion)
    return replace(memory, gap=gap, flux=flux, motion=motion)


def _violation(memory: _Memory, pressure: Array) -> float:
    """Norm of the gap where there is pressure or overlap [m]."""
    wrong = np.where((pressure > 0.0) | (memory.gap < 0.0), memory.gap, 0.0)
    return float(np.sqrt(memory.weight @ wrong**2))
