"""Solver that needs no choice: the fastest one that accepts the problem first, others where it stops progressing."""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, final

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.contact.generated_heat import thermal_channel
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver
from meeframe.contact.residual import evaluate, law_residual
from meeframe.contact.scales import Scales, problem_scales
from meeframe.solvers.cg.projected_cg import ProjectedCG
from meeframe.solvers.gradient.accelerated import BarzilaiBorwein, Nesterov
from meeframe.solvers.gradient.uzawa import Uzawa
from meeframe.solvers.newton.method import SemismoothNewton, estimated_residual

PROGRESS_FACTOR: Final = 0.9
"""Factor relative to the smallest residual so far below which a residual counts as progress."""


@dataclass(frozen=True)
class _Stage:
    """Stage of `auto` with one solver.

    steps: number of the solver's steps in one step of `auto`; stall_window: number of steps of `auto` without progress
    after which the next stage takes over.
    """

    solver: Solver
    steps: int
    stall_window: float


FRICTIONLESS: Final = ProjectedCG()
"""Solver of the first stage where it accepts the problem and there is no matrix."""
STAGES: Final = (
    _Stage(SemismoothNewton(), 1, 15),
    _Stage(Nesterov(), 25, 30),
    _Stage(BarzilaiBorwein(), 25, 30),
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
@checked_arguments
@dataclass(frozen=True)
class Auto(Solver):
    """Sequence of solvers that starts with semismooth Newton and continues with gradient iterations.

    If Newton's method makes no progress, gradient iterations follow from its best state: Nesterov's, the most robust
    one under strong friction, then projected Barzilai-Borwein steps, then Uzawa's. Without friction, conduction and
    matrix, projected conjugate gradients come before them.

    Progress is measured by the residual as estimated by the current solver, or else by the independent residual of the
    laws, as in the driver. A step is one of Newton's method or of conjugate gradients, or 25 of a gradient iteration.
    """

    stall_window: ClassVar[int] = 120

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """Return the converged state of the previous load step, or no load at all."""
        return _begin(problem, _stages(problem), start, problem_scales(problem), tolerance)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Take a step of the stage in force; begin the next stage if it has made no progress for too long."""
        memory = iterate.memory_as(_Memory)
        stage, inner = memory.stages[0], memory.inner
        for _ in range(stage.steps):
            inner = stage.solver.step(problem, inner)
        residual = _residual(problem, inner, memory.scales)
        if residual < PROGRESS_FACTOR * memory.residual or not np.isfinite(memory.residual):
            memory = replace(memory, inner=inner, residual=residual, best=replace(inner, memory=None), idle=0)
        else:
            memory = replace(memory, inner=inner, idle=memory.idle + 1)
        if memory.idle > stage.stall_window and len(memory.stages) > 1:
            best = evaluate(problem, memory.best)
            return _begin(problem, memory.stages[1:], best, memory.scales, memory.tolerance)
        return replace(inner, memory=memory)


def _stages(problem: ContactProblem) -> tuple[_Stage, ...]:
    """Return all stages that may be tried, in this order."""
    if problem.system.dense() is None and FRICTIONLESS.accepts(problem):
        return (_Stage(FRICTIONLESS, 1, 8), *STAGES)
    return STAGES if thermal_channel(problem) is None else STAGES[:1]


def _begin(
    problem: ContactProblem, stages: tuple[_Stage, ...], start: ContactState | None, scales: Scales, tolerance: float
) -> Iterate:
    """Begin the first of these stages."""
    inner = stages[0].solver.init(problem, start, tolerance)
    residual = _residual(problem, inner, scales)
    best = replace(inner, memory=None)
    return replace(inner, memory=_Memory(stages, inner, residual, best, scales, tolerance))


def _residual(problem: ContactProblem, iterate: Iterate, scales: Scales) -> float:
    """Return the residual of the laws, from the solver itself if it estimates it."""
    estimate = iterate.estimate if iterate.estimate is not None else estimated_residual(iterate)
    if estimate is not None:
        return estimate
    return law_residual(problem, evaluate(problem, iterate), scales)
