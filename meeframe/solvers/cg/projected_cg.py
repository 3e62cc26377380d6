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
from meeframe.solvers.cg.frictionless import check_accepted
from meeframe.solvers.cg.normal_modes import NORMAL, NormalModes
from meeframe.solvers.cg.normal_response import Conducting, Effect, Insulated, NormalResponse, load_of
from meeframe.solvers.cg.preconditioner import Preconditioner
from meeframe.solvers.gradient.steps import start_load
from meeframe.system.capabilities import apply_fields

MAX_STEPS_BETWEEN_RENEWALS: Final = 50
"""Largest number of steps before gap and conduction are computed anew, free of accumulated round-off."""
COARSE_TOLERANCE, MAX_COARSE_STEPS = 1e-3, 100
"""Residual at which the coarse problem for the start is stopped, and the largest number of steps on it.

The two problems differ by as much.
"""
MAX_GAP_RATIO: Final = 0.3
"""Ratio of the gaps left to pressures to those left to contact fractions at which the conduction is updated.

The gaps that pressures are to close need not become smaller before.
"""
MAX_CONDUCTION_UPDATES: Final = 3
"""Largest number of successive updates of the conduction.

Nodes that an update opened may touch again, and gaps of biactive nodes may be the largest.
"""


@dataclass(frozen=True, eq=False)
class _Memory:
    """State of the iteration.

    response, modes, preconditioner: see their classes, the latter if there is one; weight: (n,) of the inner product;
    pressure: (n,); effect: at the iterate, the indenter at rest; active_modes: modes on the nodes with pressure or
    overlap, which move next; free: (f,) nodes that the last step moved; direction, residual: (f,) of that step;
    product: of its preconditioned residual with the residual; start_violation: violation when gap and conduction were
    last computed anew; age: steps since.
    """

    response: NormalResponse
    modes: NormalModes
    preconditioner: Preconditioner | None
    weight: Array
    pressure: Array
    effect: Effect
    active_modes: NormalModes
    free: Indices
    direction: Array
    residual: Array
    product: float
    start_violation: float
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
        """Raise CaseError as check_accepted."""
        check_accepted(problem)

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """Return the converged state of the previous load step, that of a coarser division, or one without load.

        Raises CaseError as check_accepted.
        """
        check_accepted(problem)
        return _iterate(self._begin(problem, start, problem_scales(problem)))

    def _begin(self, problem: ContactProblem, start: ContactState | None, scales: Scales) -> _Memory:
        # the scales of the problem hold on any division
        start = start or nested_start(problem, lambda coarse: self._coarse_solution(coarse, scales))
        load, motion = start_load(problem, start), start_motion(problem, start)
        if not conducting(problem):
            return _start(Insulated.of(problem, scales), load, motion)
        # contact fractions of a start belong to other nodes: contact after one step is the better guide
        memory = _start(Conducting.of(problem, scales, start), load, motion)
        return replace(memory, start_violation=np.inf)

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Make one step along a conjugate direction, and update the conduction when due."""
        return _iterate(_take_step(_memory(iterate)))

    def _coarse_solution(self, problem: ContactProblem, scales: Scales) -> Iterate:
        """Solve a coarse problem until the solver's own estimate of the residual is small enough.

        If nothing conducts, the load has tension where the contact is open.
        """
        memory = self._begin(problem, None, scales)
        for _ in range(MAX_COARSE_STEPS):
            if _estimate(memory) <= COARSE_TOLERANCE:
                break
            memory = _take_step(memory)
        iterate = _iterate(memory)
        if isinstance(memory.response, Conducting):
            return iterate
        gap, pressed_node = memory.effect.gap, int(np.argmax(memory.pressure))
        load = np.zeros((len(gap), 1))
        load[pressed_node] = 1.0
        self_compliance = float(apply_fields(problem.system, load, (NORMAL,), (NORMAL,))[pressed_node, 0])
        return replace(iterate, load=with_signed_gap(iterate.load, gap, self_compliance))


def _start(response: NormalResponse, load: Array, motion: Array) -> _Memory:
    """Return the state at the pressures of a load (n, 5), balanced, and a motion (m,) of the indenter."""
    problem, n = response.problem, len(load)
    modes = NormalModes.of(problem)
    pressure, guess = np.maximum(-load[:, NORMAL], 0.0), Effect(np.zeros(n), load[:, NORMAL + 1 :], motion)
    if modes.numbers.size:
        # pressures with the prescribed resultants, which all later directions preserve
        free = np.flatnonzero(pressure > 0.0)
        trial = pressure
        if not free.size:
            free = np.flatnonzero(np.isfinite(problem.gap))
            trial = pressure - response.at(pressure, guess).gap / response.scales.normal_compliance
        pressure = _scatter(modes.restrict(free).balance(trial[free]), free, n)
    weight = problem.system.weights
    weight = weight / weight.max() if (weight > 0.0).all() else np.ones(n)
    mechanics = (response, modes, Preconditioner.of(problem), weight)
    effect = response.at(pressure, guess)
    zeros, nodes = np.zeros(0), np.zeros(0, np.int64)
    memory = _Memory(*mechanics, pressure, effect, modes.restrict(nodes), nodes, zeros, zeros, 0.0, np.inf)
    memory = _with_pressure(memory, pressure, effect)
    return replace(memory, start_violation=_violation(memory))


def _take_step(memory: _Memory) -> _Memory:
    """Return the state after one step along a conjugate direction."""
    memory = _conjugate(memory)
    free, modes, direction = memory.free, memory.active_modes, memory.direction
    effect = memory.response.change(_scatter(direction.astype(np.float32), free, len(memory.pressure)))
    # the indenter follows: the curvature counts only the gap that its motions do not remove
    weighted = memory.weight[free] * direction
    curvature = float(weighted @ modes.remove_resultants(effect.gap[free].astype(float)))
    if curvature <= 0.0:
        return _refresh(memory)
    length = float(weighted @ memory.residual) / curvature
    next_pressure = memory.pressure[free] - length * direction
    memory = replace(memory, age=memory.age + 1)
    if (next_pressure >= 0.0).all():
        before, names = memory.effect, ("gap", "flux", "motion")
        after = Effect(*(getattr(before, name) - length * getattr(effect, name) for name in names))
        memory = _with_pressure(memory, _scatter(next_pressure, free, len(memory.pressure)), after)
    else:
        next_pressure = modes.balance(next_pressure)
        pressure = _scatter(next_pressure, free, len(memory.pressure))
        after = memory.response.after_change(pressure, pressure - memory.pressure, memory.effect)
        memory = _with_pressure(memory, pressure, after)
    violation = _violation(memory)
    is_due = (
        violation <= memory.response.update_reduction * memory.start_violation
        or violation <= MAX_GAP_RATIO * _biactive_violation(memory)
    )
    return _refresh(memory) if is_due or memory.age >= MAX_STEPS_BETWEEN_RENEWALS else memory


def _conjugate(memory: _Memory) -> _Memory:
    """Return the state with the next direction on the nodes that touch: that of Polak and Ribiere, or steepest descent.

    Without a preconditioner nodes that enter restart the conjugation.
    """
    n, modes, free = len(memory.pressure), memory.active_modes, memory.active_modes.nodes
    residual, weight = memory.effect.gap[free], memory.weight[free]
    previous, direction = memory.residual, memory.direction
    if free is not memory.free:
        previous, direction = (_scatter(values, memory.free, n)[free] for values in (previous, direction))
    preconditioner, restarts = memory.preconditioner, False
    if preconditioner is None:
        steepest = modes.remove_resultants(residual)
        restarts = np.setdiff1d(free, memory.free, assume_unique=True).size > 0
    else:
        preconditioner = preconditioner.restrict(modes)
        steepest = preconditioner.balance(residual, modes)
    change = residual - previous
    coefficient = (
        0.0 if restarts or memory.product <= 0.0 else max(float((weight * steepest) @ change) / memory.product, 0.0)
    )
    direction = modes.remove_resultants(steepest + coefficient * direction)
    if float((weight * direction) @ residual) <= 0.0:
        direction = modes.remove_resultants(residual)
    product = float((weight * steepest) @ residual)
    memory = replace(memory, preconditioner=preconditioner, free=free)
    return replace(memory, direction=direction, residual=residual, product=product)


def _refresh(memory: _Memory) -> _Memory:
    """Return the state at its pressure, balanced anew, with the conduction that belongs to it."""
    pressure, n, before = memory.pressure, len(memory.pressure), memory.response
    if memory.modes.numbers.size:
        free = np.flatnonzero(pressure > 0.0)
        memory = replace(memory, pressure=_scatter(memory.modes.restrict(free).balance(pressure[free]), free, n))
    for _ in range(MAX_CONDUCTION_UPDATES):
        response = memory.response.update_conduction(memory.pressure, memory.effect)
        pressure = memory.pressure if response.biactive is None else np.where(response.biactive, 0.0, memory.pressure)
        memory = _renew(replace(memory, response=response, age=0), pressure)
        overlaps = response.has_new_overlap(memory.effect.gap)
        if not overlaps and _biactive_violation(memory) <= _violation(memory):
            break
    response = memory.response
    is_unchanged = response is before or (isinstance(response, Conducting) and response.has_same_conductors(before))
    if not is_unchanged:
        zeros = np.zeros(len(memory.free))
        memory = replace(memory, residual=zeros, direction=zeros, product=0.0)
    return replace(memory, start_violation=_violation(memory))


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
    scales, effect, free = memory.response.scales, memory.effect, memory.active_modes.nodes
    complementarity = np.abs(np.minimum(memory.pressure[free], effect.gap[free] / scales.normal_compliance))
    estimate = float(complementarity.max(initial=0.0)) / scales.pressure
    if not isinstance(memory.response, Conducting):
        return estimate
    contact_fraction = memory.response.contact_fraction(memory.pressure)
    # nodes that conduct without pressure, or bear pressure without conducting
    inconsistent = np.flatnonzero((contact_fraction > 0.0) != (memory.pressure > 0.0))
    trial = effect.gap[inconsistent] / scales.normal_compliance - memory.pressure[inconsistent]
    graph = np.abs(contact_fraction[inconsistent] - switch(contact_fraction[inconsistent], trial, scales.pressure))
    return max(estimate, float(graph.max(initial=0.0)))


def _scatter(values: Array, free: Indices, n: int) -> Array:
    """Return values (f,) on the free nodes (f,), zero on the others of n."""
    scattered = np.zeros(n, values.dtype)
    scattered[free] = values
    return scattered


def _renew(memory: _Memory, pressure: Array) -> _Memory:
    """Return the state at a pressure (n,), without accumulated round-off."""
    return _with_pressure(memory, pressure, memory.response.at(pressure, memory.effect))


def _with_pressure(memory: _Memory, pressure: Array, effect: Effect) -> _Memory:
    """Return the state at a pressure (n,) with its effect, after the indenter has come to rest."""
    gap, motion, active_modes = memory.modes.bring_to_rest(
        pressure, effect.gap, effect.motion, memory.active_modes, memory.response.biactive
    )
    return replace(memory, pressure=pressure, effect=Effect(gap, effect.flux, motion), active_modes=active_modes)


def _violation(memory: _Memory) -> float:
    """Return the norm of the gap where there is pressure or overlap [m]."""
    return _norm(memory, memory.active_modes.nodes)


def _biactive_violation(memory: _Memory) -> float:
    """Return the norm of the gap that contact fractions are to close [m]."""
    held = memory.response.biactive
    return 0.0 if held is None else _norm(memory, np.flatnonzero(held))


def _norm(memory: _Memory, nodes: Indices) -> float:
    return float(np.sqrt(memory.weight[nodes] @ memory.effect.gap[nodes] ** 2))
