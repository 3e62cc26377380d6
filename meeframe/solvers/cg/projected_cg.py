"""Projected conjugate gradients for frictionless contact, the potentials eliminated at contact size."""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, final

import numpy as np

from meeframe.contact.conduction import conducting, switch
from meeframe.contact.free_motion import start_motion
from meeframe.contact.nested import nested_start, with_signed_gap
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver
from meeframe.contact.scales import Scales, problem_scales
from meeframe.fields import Array, Indices
from meeframe.solvers.cg.frictionless import check_taken
from meeframe.solvers.cg.normal_modes import NORMAL, NormalModes
from meeframe.solvers.cg.normal_response import Conducting, Effect, Insulated, NormalResponse, load_of
from meeframe.solvers.cg.preconditioner import Preconditioner
from meeframe.solvers.gradient.steps import start_load
from meeframe.system.capabilities import apply_fields

RENEWAL: Final = 50
"""Largest number of steps before gap and conduction are computed anew, free of accumulated round-off."""
COARSE, MOST_COARSE = 1e-3, 100
"""Residual at which the coarse problem for the start is stopped, and the largest number of steps on it.

The two problems differ by as much.
"""
SETTLED: Final = 0.3
"""Ratio of the gaps left to pressures to those left to contact fractions at which the conduction is updated.

The gaps that pressures are to close need not become smaller before.
"""
LOOKS: Final = 3
"""Largest number of successive updates of the conduction.

Nodes that an update opened may touch again, and gaps of biactive nodes may be the largest.
"""


@dataclass(frozen=True, eq=False)
class _Memory:
    """State of the iteration.

    response, modes, preconditioner: see their classes, the latter if there is one; weight: (n,) of the inner product;
    pressure: (n,); effect: at the iterate, the indenter at rest; here: modes on the nodes with pressure or overlap,
    which move next; free: (f,) nodes that the last step moved; direction, residual: (f,) of that step; product: of its
    preconditioned residual with the residual; start: violation when gap and conduction were last computed anew; age:
    steps since.
    """

    response: NormalResponse
    modes: NormalModes
    preconditioner: Preconditioner | None
    weight: Array
    pressure: Array
    effect: Effect
    here: NormalModes
    free: Indices
    direction: Array
    residual: Array
    product: float
    start: float
    age: int = 0


@final
@dataclass(frozen=True)
class ProjectedCG(Solver):
    """Conjugate gradients on the pressure with exact line search, projected on compression; frictionless contact only.

    The method minimises the quadratic form of the compliance at fixed conduction on the nodes with pressure or overlap;
    nodes that lose their pressure leave this set, nodes that overlap enter it. Inner products are weighted by the
    nodes' areas, in which a compliance is symmetric by reciprocity; it need not be exactly so, as the directions are
    those of Polak and Ribiere. The conduction is updated when the violation has fallen to a hundredth, or to a third
    with biactive nodes, whose fractions are updated by Broyden's method. Where nothing conducts, gaps change in single
    precision and are computed anew when the violation has fallen to a ten-thousandth.

    If the reduced system has an approximate inverse, its restriction to those nodes is the preconditioner: the number
    of steps then hardly depends on the number of nodes, and is smaller still with a prolongation of displacements from
    the nodes. If the system has a coarser division, the solution there is the start.

    Where resultants of the pressure are prescribed, directions have none, the motions of the indenter remove the mean
    from the gaps, and where pressure was lost it is replaced by the nearest balanced one.

    Source: Polonsky and Keer, Wear 231 (1999) 206; Dostal, Optimal Quadratic Programming Algorithms (2009), chapter 5.
    """

    check_interval: ClassVar[int] = 5

    def check(self, problem: ContactProblem) -> None:
        """Raise CaseError as check_taken."""
        check_taken(problem)

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """Return the converged state of the previous load step, that of a coarser division, or one without load.

        Raises CaseError as check_taken.
        """
        check_taken(problem)
        return _iterate(self._begun(problem, start, problem_scales(problem)))

    def _begun(self, problem: ContactProblem, start: ContactState | None, scales: Scales) -> _Memory:
        # the scales of the problem hold on any division
        start = start or nested_start(problem, lambda coarse: self._coarse_solution(coarse, scales))
        load, motion = start_load(problem, start), start_motion(problem, start)
        if not conducting(problem):
            return _started(Insulated.of(problem, scales), load, motion)
        # contact fractions of a start belong to other nodes: contact after one step is the better guide
        memory = _started(Conducting.of(problem, scales, start), load, motion)
        return replace(memory, start=np.inf)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Make one step along a conjugate direction, and update the conduction when due."""
        return _iterate(_stepped(_memory(iterate)))

    def _coarse_solution(self, problem: ContactProblem, scales: Scales) -> Iterate:
        """Solve a coarse problem until the solver's own estimate of the residual is small enough.

        If nothing conducts, the load has tension where the contact is open.
        """
        memory = self._begun(problem, None, scales)
        for _ in range(MOST_COARSE):
            if _estimate(memory) <= COARSE:
                break
            memory = _stepped(memory)
        iterate = _iterate(memory)
        if isinstance(memory.response, Conducting):
            return iterate
        gap, firm = memory.effect.gap, int(np.argmax(memory.pressure))
        unit = np.zeros((len(gap), 1))
        unit[firm] = 1.0
        own = float(apply_fields(problem.system, unit, (NORMAL,), (NORMAL,))[firm, 0])
        return replace(iterate, load=with_signed_gap(iterate.load, gap, own))


def _started(response: NormalResponse, load: Array, motion: Array) -> _Memory:
    """Return the state at the pressures of a load (n, 5), balanced, and a motion (m,) of the indenter."""
    problem, n = response.problem, len(load)
    modes = NormalModes.of(problem)
    pressure, near = np.maximum(-load[:, NORMAL], 0.0), Effect(np.zeros(n), load[:, NORMAL + 1 :], motion)
    if modes.numbers.size:
        # pressures with the prescribed resultants, which all later directions preserve
        free = np.flatnonzero(pressure > 0.0)
        trial = pressure
        if not free.size:
            free = np.flatnonzero(np.isfinite(problem.gap))
            trial = pressure - response.at(pressure, near).gap / response.scales.normal_compliance
        pressure = _spread(modes.on(free).balanced(trial[free]), free, n)
    weight = problem.system.weights
    weight = weight / weight.max() if (weight > 0.0).all() else np.ones(n)
    mechanics = (response, modes, Preconditioner.of(problem), weight)
    effect = response.at(pressure, near)
    still, nodes = np.zeros(0), np.zeros(0, np.int64)
    memory = _Memory(*mechanics, pressure, effect, modes.on(nodes), nodes, still, still, 0.0, np.inf)
    memory = _placed(memory, pressure, effect)
    return replace(memory, start=_violation(memory))


def _stepped(memory: _Memory) -> _Memory:
    """Return the state after one step along a conjugate direction."""
    memory = _conjugate(memory)
    free, modes, direction = memory.free, memory.here, memory.direction
    effect = memory.response.change(_spread(direction.astype(np.float32), free, len(memory.pressure)))
    # the indenter follows: the curvature counts only the gap that its motions do not remove
    weighted = memory.weight[free] * direction
    curvature = float(weighted @ modes.without(effect.gap[free].astype(float)))
    if curvature <= 0.0:
        return _refreshed(memory)
    length = float(weighted @ memory.residual) / curvature
    moved = memory.pressure[free] - length * direction
    memory = replace(memory, age=memory.age + 1)
    if (moved >= 0.0).all():
        here, parts = memory.effect, ("gap", "flux", "motion")
        there = Effect(*(getattr(here, part) - length * getattr(effect, part) for part in parts))
        memory = _placed(memory, _spread(moved, free, len(memory.pressure)), there)
    else:
        moved = modes.balanced(moved)
        pressure = _spread(moved, free, len(memory.pressure))
        there = memory.response.after(pressure, pressure - memory.pressure, memory.effect)
        memory = _placed(memory, pressure, there)
    violation = _violation(memory)
    due = violation <= memory.response.lasting * memory.start or violation <= SETTLED * _biactive_violation(memory)
    return _refreshed(memory) if due or memory.age >= RENEWAL else memory


def _conjugate(memory: _Memory) -> _Memory:
    """Return the state with the next direction on the nodes that touch: that of Polak and Ribiere, or steepest descent.

    Without a preconditioner nodes that enter restart the conjugation.
    """
    n, modes, free = len(memory.pressure), memory.here, memory.here.nodes
    residual, weight = memory.effect.gap[free], memory.weight[free]
    before, direction = memory.residual, memory.direction
    if free is not memory.free:
        before, direction = (_spread(values, memory.free, n)[free] for values in (before, direction))
    preconditioner, fresh = memory.preconditioner, False
    if preconditioner is None:
        steepest = modes.without(residual)
        fresh = np.setdiff1d(free, memory.free, assume_unique=True).size > 0
    else:
        preconditioner = preconditioner.on(modes)
        steepest = preconditioner.balanced(residual, modes)
    change = residual - before
    share = 0.0 if fresh or memory.product <= 0.0 else max(float((weight * steepest) @ change) / memory.product, 0.0)
    direction = modes.without(steepest + share * direction)
    if float((weight * direction) @ residual) <= 0.0:
        direction = modes.without(residual)
    product = float((weight * steepest) @ residual)
    memory = replace(memory, preconditioner=preconditioner, free=free)
    return replace(memory, direction=direction, residual=residual, product=product)


def _refreshed(memory: _Memory) -> _Memory:
    """Return the state at its pressure, balanced anew, with the conduction that belongs to it."""
    pressure, n, before = memory.pressure, len(memory.pressure), memory.response
    if memory.modes.numbers.size:
        free = np.flatnonzero(pressure > 0.0)
        memory = replace(memory, pressure=_spread(memory.modes.on(free).balanced(pressure[free]), free, n))
    for _ in range(LOOKS):
        response = memory.response.updated(memory.pressure, memory.effect)
        pressure = memory.pressure if response.biactive is None else np.where(response.biactive, 0.0, memory.pressure)
        memory = _renewed(replace(memory, response=response, age=0), pressure)
        again = response.touched_again(memory.effect.gap)
        if not again and _biactive_violation(memory) <= _violation(memory):
            break
    response = memory.response
    kept = response is before or (isinstance(response, Conducting) and response.same_conductors(before))
    if not kept:
        still = np.zeros(len(memory.free))
        memory = replace(memory, residual=still, direction=still, product=0.0)
    return replace(memory, start=_violation(memory))


def _memory(iterate: Iterate) -> _Memory:
    if not isinstance(iterate.memory, _Memory):
        raise TypeError("the iterate was not made by ProjectedCG.init")
    return iterate.memory


def _iterate(memory: _Memory) -> Iterate:
    effect = memory.effect
    contact_fraction, load = memory.response.contact_fraction(memory.pressure), load_of(memory.pressure, effect.flux)
    return Iterate(load, contact_fraction, memory, effect.motion, _estimate(memory))


def _estimate(memory: _Memory) -> float:
    """Return the violation of the contact law on the nodes where there is any."""
    scales, effect, free = memory.response.scales, memory.effect, memory.here.nodes
    wrong = np.abs(np.minimum(memory.pressure[free], effect.gap[free] / scales.normal_compliance))
    estimate = float(wrong.max(initial=0.0)) / scales.pressure
    if not isinstance(memory.response, Conducting):
        return estimate
    contact_fraction = memory.response.contact_fraction(memory.pressure)
    # nodes that conduct without pressure, or bear pressure without conducting
    apart = np.flatnonzero((contact_fraction > 0.0) != (memory.pressure > 0.0))
    trial = effect.gap[apart] / scales.normal_compliance - memory.pressure[apart]
    graph = np.abs(contact_fraction[apart] - switch(contact_fraction[apart], trial, scales.pressure))
    return max(estimate, float(graph.max(initial=0.0)))


def _spread(values: Array, free: Indices, n: int) -> Array:
    """Return values (f,) on the free nodes (f,), zero on the others of n."""
    spread = np.zeros(n, values.dtype)
    spread[free] = values
    return spread


def _renewed(memory: _Memory, pressure: Array) -> _Memory:
    """Return the state at a pressure (n,), without accumulated round-off."""
    return _placed(memory, pressure, memory.response.at(pressure, memory.effect))


def _placed(memory: _Memory, pressure: Array, effect: Effect) -> _Memory:
    """Return the state at a pressure (n,) with its effect, after the indenter has come to rest."""
    gap, motion, here = memory.modes.bring_to_rest(
        pressure, effect.gap, effect.motion, memory.here, memory.response.biactive
    )
    return replace(memory, pressure=pressure, effect=Effect(gap, effect.flux, motion), here=here)


def _violation(memory: _Memory) -> float:
    """Return the norm of the gap where there is pressure or overlap [m]."""
    return _norm(memory, memory.here.nodes)


def _biactive_violation(memory: _Memory) -> float:
    """Return the norm of the gap that contact fractions are to close [m]."""
    held = memory.response.biactive
    return 0.0 if held is None else _norm(memory, np.flatnonzero(held))


def _norm(memory: _Memory, nodes: Indices) -> float:
    return float(np.sqrt(memory.weight[nodes] @ memory.effect.gap[nodes] ** 2))
