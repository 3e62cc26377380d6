"""Projected conjugate gradients for frictionless contact without conduction."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar, Final, cast, final

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import CaseError
from meeframe.common.memory import release_freed_memory
from meeframe.contact.conduction import conducting
from meeframe.contact.feasibility import frictionless_bound
from meeframe.contact.free_motion import start_load, start_motion
from meeframe.contact.nested import nested_start, with_tension
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver
from meeframe.contact.scales import Scales, problem_scales
from meeframe.fields import NORMAL, Array, Indices
from meeframe.solvers.cg.normal_modes import NormalModes
from meeframe.system.capabilities import ApproximateInverse, Prolongation, apply_fields

MAX_STEPS_BETWEEN_RENEWALS: Final = 50
"""Largest number of steps before the gap is recomputed, free of accumulated round-off."""
RENEWAL_DECREASE: Final = 1e-3
"""Decrease of the residual after which the gap is recomputed if changes of it are computed in single precision."""
MAX_CUT: Final = 0.2
"""Largest relative change of a step by the projection that does not restart the conjugation. Gain: up to 1.6."""
COARSE_TOLERANCE, MAX_COARSE_STEPS = 1e-3, 100
"""Residual of the coarse problem for the start, by which the two problems differ anyway, and most steps on it."""


@dataclass(frozen=True, eq=False)
class _Memory:
    """State of the iteration.

    problem, scales: of the contact; modes: normal free motions on all nodes; inverse: approximate inverse of the normal
    compliance, (n, 1) from (n, 1), if the system has one; weight: (n,) of the inner product; load: (n, fields); gap:
    (n,) with the indenter at rest; motion: (m,); active_modes: modes on the free nodes, which move next; free: (f,)
    nodes that the last step moved; restricted: approximate inverse of the normal compliance restricted to these, (f,)
    from (f,), or None; direction, residual: (f,) of that step; product: of its preconditioned residual with the
    residual; estimate: of the residual; age: steps since the gap was computed; renewed: estimate then.
    """

    problem: ContactProblem
    scales: Scales
    modes: NormalModes
    inverse: Callable[[Array], Array] | None
    weight: Array
    load: Array
    gap: Array
    motion: Array
    active_modes: NormalModes
    free: Indices
    restricted: Callable[[Array], Array] | None
    direction: Array
    residual: Array
    product: float = 0.0
    estimate: float = np.inf
    age: int = 0
    renewed: float = np.inf


@final
@checked_arguments
@dataclass(frozen=True)
class ProjectedCG(Solver):
    """Conjugate gradients on the pressure with exact line search, projected on compression up to the bound of the law.

    The method minimises the quadratic form of the normal compliance on the free nodes. Nodes that lose their pressure
    leave them, and so do those that reach the largest pressure of the law; nodes that overlap enter them, and so do
    those that open under the largest pressure. Inner products are weighted by the nodes' areas, in which a compliance
    is symmetric by reciprocity; it need not be exactly so, as the directions are those of Polak and Ribiere.

    If the reduced system has an approximate inverse, its restriction to those nodes is the preconditioner: the number
    of steps then hardly depends on the number of nodes, and is smaller still with a prolongation of displacements from
    these nodes. If the system has a coarser division, the solution there is the start.

    Where resultants of the pressure are prescribed, directions have none, the motions of the indenter remove the mean
    from the gaps, and where the projection changes pressures they are replaced by the nearest balanced ones.

    Notes
    -----
    The contact must be frictionless, unilateral and insulating, and the largest pressure is the same at all nodes.

    References
    ----------
    Polonsky and Keer, Wear 231 (1999) 206; Dostal, Optimal Quadratic Programming Algorithms (2009), chapter 5.
    """

    check_interval: ClassVar[int] = 5

    def check(self, problem: ContactProblem) -> None:
        """Raise CaseError unless the contact is frictionless, unilateral and insulating, or as NormalModes.of."""
        _modes(problem)

    def accepts(self, problem: ContactProblem) -> bool:
        """Return true if `check` raises nothing.

        Parameters
        ----------
        problem : ContactProblem
            Problem to check.
        """
        try:
            self.check(problem)
        except CaseError:
            return False
        return True

    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """Return the last converged state, that of a coarser division or none. Raises CaseError as `check`."""
        return _iterate(_begin(problem, start, problem_scales(problem)))

    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Make one step along a conjugate direction."""
        return _iterate(_take_step(iterate.memory_as(_Memory)))


def _begin(problem: ContactProblem, start: ContactState | None, scales: Scales) -> _Memory:
    """Return the state at the balanced pressures of a start, or of the solution on a coarser division."""
    modes, n = _modes(problem), len(problem.gap)
    start = start or nested_start(problem, lambda coarse: _coarse_solution(coarse, scales))
    motion, traction = start_motion(problem, start), start_load(problem, start)[:, NORMAL]
    free = np.flatnonzero(traction < 0.0)
    pressure = -traction[free]
    if modes.numbers.size and (not free.size or np.isfinite(modes.bound)):  # loaded nodes may not bear the resultants
        free = np.flatnonzero(np.isfinite(problem.gap))
        pressure = -(traction + _gap(problem, traction, motion) / scales.normal_compliance)[free]
    pressure = modes.restrict(free).balance(pressure, modes.totals)  # all later directions preserve the resultants
    weight = problem.system.weights if (problem.system.weights > 0.0).all() else np.ones(n)
    none, zeros = np.zeros(0, np.int64), np.zeros(0)
    approximate = problem.system.capability(ApproximateInverse)
    inverse = None if approximate is None else approximate.approximate_inverse((NORMAL,))
    arrays = (problem, scales, modes, inverse, weight, _load(problem, np.zeros(n), pressure, free))
    return _renew(_Memory(*arrays, zeros, motion, modes.restrict(none), none, None, zeros, zeros))


def _coarse_solution(problem: ContactProblem, scales: Scales) -> Iterate:
    """Return an approximate solution of a coarse problem; scales: of the finer one, which hold on any division."""
    memory = _begin(problem, None, scales)
    for _ in range(MAX_COARSE_STEPS):
        if memory.estimate <= COARSE_TOLERANCE:
            break
        memory = _take_step(memory)
    return with_tension(problem, _iterate(memory), memory.gap)


def _take_step(memory: _Memory) -> _Memory:
    """Return the state after one step along a conjugate direction, whose product may be in single precision."""
    return _renew(_bring_to_rest(*_advance(memory)), where_due=True)


def _advance(memory: _Memory) -> tuple[_Memory, Array]:
    """Return the state with the load after a step, and the gap there while the indenter stays where it is."""
    memory = _conjugate(memory)
    free, modes, direction = memory.free, memory.active_modes, memory.direction
    opening = _change_of_gap(memory, direction)
    # the indenter follows: the curvature counts only the gap that its motions do not remove
    weighted = memory.weight[free] * direction
    curvature = float(weighted @ modes.remove_resultants(opening[free]))
    if curvature <= 0.0:
        return replace(memory, age=MAX_STEPS_BETWEEN_RENEWALS), memory.gap.copy()
    length = float(weighted @ memory.residual) / curvature
    before = -memory.load[free, NORMAL]
    values = trial = before - length * direction
    if ((trial >= 0.0) & (trial <= modes.bound)).all():
        opening *= -length
    else:
        values = modes.balance(trial, modes.measure @ before)
        change = values - before
        opening = _change_of_gap(memory, change)
        weighted = memory.weight[free] * change
        slope, curvature = float(weighted @ memory.residual), float(weighted @ opening[free])
        if 0.0 < -slope < 0.5 * curvature:
            # the energy would rise: on grids that hardly resolve a rough surface, steps would cycle
            fraction = -slope / curvature
            values, opening = before + fraction * change, fraction * opening
        # later directions are not conjugate to a step of which the projection has left little
        if np.linalg.norm(values - trial) > MAX_CUT * np.linalg.norm(length * direction):
            memory = replace(memory, product=0.0)
    load = _load(memory.problem, memory.load[:, NORMAL], values, free)
    return replace(memory, load=load, age=memory.age + 1), memory.gap + opening


def _conjugate(memory: _Memory) -> _Memory:
    """Return the state with the next direction on the free nodes: that of Polak and Ribiere, or steepest descent.

    Without a preconditioner nodes that enter restart the conjugation.
    """
    n, modes, free = len(memory.load), memory.active_modes, memory.active_modes.nodes
    residual, weight = memory.gap[free], memory.weight[free]
    previous, direction, restricted = memory.residual, memory.direction, memory.restricted
    if free is not memory.free:
        previous, direction = (_scatter(values, memory.free, n)[free] for values in (previous, direction))
        restricted = _restrict_inverse(memory, free)
    restarts = memory.product <= 0.0
    if restricted is None:
        steepest = residual
        restarts |= np.setdiff1d(free, memory.free, assume_unique=True).size > 0
    else:
        steepest = restricted(residual)
    steepest = modes.remove_resultants(steepest)  # the residual has none either: the preconditioner remains symmetric
    weighted = weight * steepest
    coefficient = 0.0 if restarts else max(float(weighted @ (residual - previous)) / memory.product, 0.0)
    direction = modes.remove_resultants(steepest + coefficient * direction)
    if float((weight * direction) @ residual) <= 0.0:
        direction = modes.remove_resultants(residual)
    product = float(weighted @ residual)
    return replace(memory, free=free, restricted=restricted, direction=direction, residual=residual, product=product)


def _restrict_inverse(memory: _Memory, free: Indices) -> Callable[[Array], Array] | None:
    """Return the approximate inverse of the compliance restricted to the free nodes (f,), if the system has one.

    Displacements are prolonged by zeros unless the system does it better. Gain of the half space's prolongation, in
    whole runs: 1.30 for a surface with 8 nodes in its shortest wave on 1024 x 1024, less than 1.1 for smooth ones.
    """
    inverse, approximate = memory.inverse, memory.problem.system.capability(ApproximateInverse)
    if inverse is None or approximate is None:
        return None
    by_zeros = Prolongation(partial(_scatter, free=free, n=len(memory.load)), lambda values: values[free])
    prolongation = approximate.prolongation(free) or by_zeros

    def restricted(opening: Array) -> Array:
        displacement = prolongation.prolong(opening.astype(np.float32))
        return prolongation.restrict(inverse(displacement[:, None])[:, 0]).astype(float)

    return restricted


def _renew(memory: _Memory, where_due: bool = False) -> _Memory:
    """Return the state at its pressure, balanced again, without accumulated round-off of the gap."""
    is_due = memory.estimate <= RENEWAL_DECREASE * memory.renewed or memory.age >= MAX_STEPS_BETWEEN_RENEWALS
    if where_due and not is_due:
        return memory
    memory = replace(memory, age=0, gap=np.zeros(0))  # the former gap takes memory
    release_freed_memory(len(memory.load))  # of steps in single precision
    modes, traction = memory.modes, memory.load[:, NORMAL]
    if modes.numbers.size:
        yielded = np.flatnonzero(traction <= -modes.bound)
        rest = modes.totals + modes.restrict(yielded).measure @ traction[yielded]
        free = np.flatnonzero((traction < 0.0) & (traction > -modes.bound))
        balanced = modes.restrict(free).balance(-traction[free], rest)
        memory = replace(memory, load=_load(memory.problem, traction, balanced, free))
    memory = _bring_to_rest(memory, _gap(memory.problem, memory.load[:, NORMAL], memory.motion))
    return replace(memory, renewed=memory.estimate)


def _bring_to_rest(memory: _Memory, gap: Array) -> _Memory:
    """Return the state after the motions of the indenter that follow from a gap (n,), to which they are added.

    Its estimate is the violation of the contact law on the nodes where there is any.
    """
    traction, scales = memory.load[:, NORMAL], memory.scales
    motion, modes = memory.modes.bring_to_rest(traction, gap, memory.motion, memory.active_modes)
    pressure = -traction[modes.nodes]
    violation = np.abs(pressure - np.clip(pressure - gap[modes.nodes] / scales.normal_compliance, 0.0, modes.bound))
    estimate = float(violation.max(initial=0.0)) / scales.pressure
    return replace(memory, gap=gap, motion=motion, active_modes=modes, estimate=estimate)


def _gap(problem: ContactProblem, traction: Array, motion: Array) -> Array:
    """Return the normal gap (n,) of a normal traction (n,) at free motions (m,)."""
    gap = apply_fields(problem.system, traction[:, None], (NORMAL,), (NORMAL,))[:, 0]
    np.subtract(problem.gap, gap, out=gap)
    gap -= problem.system.offset[:, NORMAL]
    for resultant, amount in zip(problem.prescribed_resultants, motion, strict=True):
        gap += amount * resultant.mode[:, NORMAL]
    return gap


def _change_of_gap(memory: _Memory, pressure: Array) -> Array:
    """Return the gap opening (n,) of a change of pressure (f,) of free nodes, in single precision if preconditioned.

    Gain of single precision, in whole runs: 1.15 for a rough surface on 1024 x 1024 nodes, less than 1.1 on 512 x 512.
    """
    precision = np.float64 if memory.inverse is None else np.float32
    change = _scatter(pressure.astype(precision), memory.free, len(memory.load))
    return apply_fields(memory.problem.system, change[:, None], (NORMAL,), (NORMAL,))[:, 0]


def _iterate(memory: _Memory) -> Iterate:
    flags = cast(Array, memory.load[:, NORMAL] < 0.0)  # an eighth of the memory
    return Iterate(memory.load, flags, memory, memory.motion, memory.estimate)


def _load(problem: ContactProblem, traction: Array, pressure: Array, free: Indices) -> Array:
    """Return the load (n, fields) of pressures (f,) on the free nodes (f,), normal tractions (n,) elsewhere."""
    load = np.zeros((problem.fields.size, len(problem.gap))).T  # columns of zeros are never written
    load[:, NORMAL] = traction
    load[free, NORMAL] = -pressure
    return load


def _scatter(values: Array, free: Indices, n: int) -> Array:
    """Return values (f,) on the free nodes (f,), zero on the others of n."""
    scattered = np.zeros(n, values.dtype)
    scattered[free] = values
    return scattered


def _modes(problem: ContactProblem) -> NormalModes:
    """Return the normal modes of a problem. Raises CaseError unless it has frictionless, insulating contact."""
    bound = frictionless_bound(problem.contact_law, len(problem.gap))
    if bound is None:
        raise CaseError(
            "solver 'projected-cg' takes frictionless contact only, rigid and without attraction, not "
            f"{type(problem.contact_law).__name__}; allowed contact law: signorini, hardness or friction, with mu = 0. "
            "Use 'newton', 'uzawa-bb', 'uzawa-nesterov', 'uzawa' or 'auto' for others"
        )
    if conducting(problem):
        raise CaseError(
            "solver 'projected-cg' solves insulating contact only, but a conductivity law conducts. Use 'newton', "
            "'uzawa-bb', 'uzawa-nesterov', 'uzawa' or 'auto' for conducting contact"
        )
    return NormalModes.of(problem, bound)
