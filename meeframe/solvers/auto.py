"""Solver that needs no choice: the fastest one that accepts the problem first, others where it stops progressing."""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, final

import numpy as np

from meeframe.contact.conduction import conducting
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver
from meeframe.contact.residual import evaluate, law_residual
from meeframe.contact.scales import Scales, problem_scales
from meeframe.solvers.cg.frictionless import accepts
from meeframe.solvers.cg.projected_cg import ProjectedCG
from meeframe.solvers.gradient.accelerated import BarzilaiBorwein, Nesterov
from meeframe.solvers.gradient.uzawa import Uzawa
from meeframe.solvers.newton.method import SemismoothNewton, estimated_residual
from meeframe.system.capabilities import EdgeResolution

PROGRESS_FACTOR: Final = 0.9
"""Factor relative to the smallest residual so far below which a residual counts as progress."""


@dataclass(frozen=True)
class _Stage:
    """Stage of `auto` with one solver.

    steps: number of the solver's steps in one step of `auto`; stall_window: number of steps of `auto` without progress
    after which the next stage takes over; accepts_biactive: whether the stage continues with biactive nodes, which
    otherwise end it.
    """

    solver: Solver
    steps: int
    stall_window: float
    accepts_biactive: bool = True


FRICTIONLESS: Final = _Stage(ProjectedCG(), 1, 8, accepts_biactive=False)
"""First stage where it accepts the problem and there is no matrix to factorise.

It determines pressures and the contact fractions of biactive nodes alternately, Newton's method together.
"""
CONDUCTING: Final = (_Stage(SemismoothNewton(), 1, 10), _Stage(ProjectedCG(), 1, 15))
"""First stages if anything conducts, unless contact edges are resolved.

Where conduction draws nodes into contact several solutions exist; that of conjugate gradients has been the nearer one
to closed forms.
"""
STAGES: Final = (
    _Stage(SemismoothNewton(), 1, 25),
    _Stage(Nesterov(), 25, 60),
    _Stage(BarzilaiBorwein(), 25, 60),
    _Stage(Uzawa(), 25, np.inf),
)


@dataclass(frozen=True, eq=False)
class _Memory:
    """State between steps.

    stages: the current one and those to come; inner: iterate of the current solver; residual, best: smallest residual
    so far and its iterate; idle: steps since; scales: of the problem; tolerance: required residual.
    """

    stages: tuple[_Stage, ...]
    inner: Iterate
    residual: float
    best: Iterate
    scales: Scales
    tolerance: float
    idle: int = 0


@final
@dataclass(frozen=True)
class Auto(Solver):
    """Sequence of solvers that starts with semismooth Newton and continues with gradient iterations.

    If Newton's method makes no progress, gradient iterations follow from its best state: Nesterov's, the most robust
    one under strong friction, then projected Barzilai-Borwein steps, then Uzawa's. Without friction and matrix,
    projected conjugate gradients come before them, until nodes are biactive; if anything conducts and contact edges are
    not resolved, Newton's method and then conjugate gradients come first, with or without biactive nodes.

    Progress is measured by the residual as estimated by the current solver, or else by the independent residual of the
    laws, as in the driver. A step is one of Newton's method or of conjugate gradients, or 25 of a gradient iteration.
    """

    stall_window: ClassVar[int] = 240

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """Return the converged state of the previous load step, or no load at all."""
        return _begin(problem, _stages(problem), start, problem_scales(problem), tolerance)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Take a step of the stage in force; begin the next stage if it has made no progress for too long."""
        memory = _memory(iterate)
        stage, inner = memory.stages[0], memory.inner
        for _ in range(stage.steps):
            inner = stage.solver.step(problem, inner)
        residual = _residual(problem, inner, memory.scales)
        if residual < PROGRESS_FACTOR * memory.residual or not np.isfinite(memory.residual):
            memory = replace(memory, inner=inner, residual=residual, best=inner, idle=0)
        else:
            memory = replace(memory, inner=inner, idle=memory.idle + 1)
        interrupted = not stage.accepts_biactive and bool(
            ((inner.contact_fraction > 0.0) & (inner.contact_fraction < 1.0)).any()
        )
        if interrupted or memory.idle > stage.stall_window:
            best = evaluate(problem, memory.best)
            return _begin(problem, memory.stages[1:], best, memory.scales, memory.tolerance)
        return replace(inner, memory=memory)


def _memory(iterate: Iterate) -> _Memory:
    if not isinstance(iterate.memory, _Memory):
        raise TypeError("the iterate was not made by Auto.init")
    return iterate.memory


def _stages(problem: ContactProblem) -> tuple[_Stage, ...]:
    """Return all stages that may be tried, in this order."""
    if problem.system.dense() is not None or not accepts(problem):
        return STAGES
    if conducting(problem) and not _resolves_edges(problem):
        return (*CONDUCTING, *STAGES)
    return (FRICTIONLESS, *STAGES)


def _resolves_edges(problem: ContactProblem) -> bool:
    """Return whether contact edges lie between nodes, or will after a first solution (edge_resolution)."""
    return problem.area_fraction is not None or problem.system.capability(EdgeResolution) is not None


def _begin(
    problem: ContactProblem, stages: tuple[_Stage, ...], start: ContactState | None, scales: Scales, tolerance: float
) -> Iterate:
    """Begin the first of these stages."""
    inner = stages[0].solver.init(problem, start, tolerance)
    residual = _residual(problem, inner, scales)
    return replace(inner, memory=_Memory(stages, inner, residual, inner, scales, tolerance))


def _residual(problem: ContactProblem, iterate: Iterate, scales: Scales) -> float:
    """Return the residual of the laws, from the solver itself if it estimates it."""
    estimate = iterate.estimate if iterate.estimate is not None else estimated_residual(iterate)
    if estimate is not None:
        return estimate
    return law_residual(problem, evaluate(problem, iterate), scales)
