"""Kinematics of the indenter over the contact zone: the contact problem of an increment, and its evaluation."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meeframe.common.memory import stack_columns
from meeframe.contact.conduction import potential_diagonal, resistances
from meeframe.contact.problem import (
    ContactProblem,
    ContactSolution,
    ContactState,
    PrescribedResultant,
    Status,
    contact_gap,
    indenter_field,
    indenter_position,
)
from meeframe.contact.scales import problem_scales
from meeframe.fields import MECHANICAL, POTENTIALS, Array, Indices
from meeframe.indenters import find_indenter_edge, initial_gap, longest_side
from meeframe.indenters.base import FORCE_RATIO, N_RIGID, MotionModes, motion_density, total_resultants
from meeframe.laws.base import augmented_traction, has_friction, is_adhesive, resolve
from meeframe.laws.wear import WearingContact
from meeframe.mesh import ContactZone
from meeframe.model.conduction import watched
from meeframe.model.data import CaseData
from meeframe.model.history import Controls, ConvergedState, at_rest, hold_motions
from meeframe.model.laws import gap_of_law, law_of_increment
from meeframe.model.rolling import RollingIncrement, friction_work
from meeframe.model.step import resisted
from meeframe.results.records import Region, StepResult, join_sentences
from meeframe.system.capabilities import IndenterEdge
from meeframe.system.reduced import ReducedSystem
from meeframe.system.rolling import SteadyRollingSystem

_MAX_PERPENDICULAR_COSINE: Final = 1e-9
"""Cosine between a normal and the indenter's axis below which they count as perpendicular."""
_RELATIVE_SEARCH_DISTANCE: Final = 2.0
"""Distance around the edge of the indenter that is considered, in the longest sides of cells."""
_TANGENTIAL_STEP: Final = 1e6
"""Tangential step of a law, in stiffnesses of a node, at which it returns the traction of a given slip."""
_MAX_STICK_SLIP: Final = 1e-6
"""Largest slip of a sticking node, as a fraction of that due to the characteristic pressure."""
_MAX_STICK_SLIP_RATIO: Final = 10.0
"""Largest slip of a sticking node, in multiples of the residual of the solution."""


@dataclass(frozen=True, eq=False)
class Increment:
    """Increment of a load step.

    problem: contact problem; base: (motions,) motions of the indenter from which its free motions count; free: (m,)
    numbers of those that are free; prescribed, duration: as in Loading; start: state from which slip is measured;
    rolling: by one cell, None if the contact stays in place; sliding: distance that the indenter slides in it [m], None
    where surfaces wear by the slip of the solution; depth: (n,) worn off in it, None before it is solved.
    """

    problem: ContactProblem
    base: Array
    free: Indices
    prescribed: Controls
    duration: float | None
    start: ConvergedState
    rolling: RollingIncrement | None = None
    sliding: float | None = None
    depth: Array | None = None


class Solution(NamedTuple):
    """Increment as it was solved, the state at its end, or at its beginning without convergence, and its result."""

    increment: Increment
    end: ConvergedState
    result: StepResult

    @property
    def is_converged(self) -> bool:
        """True if the increment converged."""
        return self.result.status is Status.CONVERGED

    def with_sentences(self, *sentences: str) -> "Solution":
        """Return the solution with further sentences in its message."""
        return self.with_result(message=join_sentences(self.result.message, *sentences))

    def with_result(self, **changes: Any) -> "Solution":
        """Return the solution with other values of attributes of its result."""
        return self._replace(result=replace(self.result, **changes))


@dataclass(frozen=True, eq=False)
class IndenterKinematics:
    """Kinematics of the indenter of a case on the reduced system of its body."""

    case: CaseData
    system: ReducedSystem

    @cached_property
    def reference(self) -> Array:
        """Centre of rotation, (3,) [m]."""
        return self.case.placement.reference(self.system.points)

    @cached_property
    def touching_gap(self) -> Array:
        """Gap (n,) [m] between the undeformed body and the indenter that just touches it.

        If the contact law adds to it, along the normals, the indenter stands so that the lowest gap at a node is zero.
        """
        gap = self.gaps(self.system.points, self.system.frames)
        return self._with_law_gap(gap)

    @cached_property
    def _lowering(self) -> Array:
        """Change of the gap by the contact law and the corresponding motion of the indenter, (n,) [m]."""
        added = gap_of_law(self.case.contact_law, self.system.points)
        if not added.any():
            return np.broadcast_to(0.0, added.shape)
        gap = self.gaps(self.system.points, self.system.frames) + added
        nearing = -self.modes[0][:, 2]  # change of the gap per metre of approach
        # a tilted indenter may lie above nodes whose normals are across its axis: approach never closes their gaps
        closing = np.isfinite(gap) & (nearing > _MAX_PERPENDICULAR_COSINE)
        way = (gap[closing] / nearing[closing]).min() if closing.any() else 0.0
        return np.asarray(added - way * nearing)

    def _with_law_gap(self, gap: Array) -> Array:
        """Return gaps (n,) of the surfaces changed as by the contact law, without overlap if the law adds to them."""
        return np.maximum(gap + self._lowering, 0.0) if self._lowering.any() else gap

    def gaps(self, points: Array, frames: Array) -> Array:
        """Return the gap (m,) [m] at points (m, 3) with frames (m, 3, 3), of the indenter just touching the zone."""
        return self._gaps_after(np.zeros(2), points, frames)

    def _gaps_after(self, travel: Array, points: Array, frames: Array) -> Array:
        """Return the gaps where the contact has moved by `travel` (2,) [m] over the material."""
        gap = self._gaps_of_indenter(points, frames)
        if self.case.surface is None:
            return gap
        return gap + self._distance_to_surface(travel, points) - self._lowest_sum

    def _distance_to_surface(self, travel: Array, points: Array) -> Array:
        """Return the distance (m,) [m] of the surface that moves with the material from a plane on its top."""
        surface, (x, y) = self.case.surface, (points @ self.case.placement.base[:2].T + travel).T
        return np.zeros(len(points)) if surface is None else surface.height(x, y)

    @cached_property
    def _lowest_sum(self) -> float:
        """Distance that indenter and surface may approach each other at the beginning until they touch at a node."""
        gap = self._gaps_of_indenter(self.system.points, self.system.frames)
        return float((gap + self._distance_to_surface(np.zeros(2), self.system.points)).min())

    def _gaps_of_indenter(self, points: Array, frames: Array) -> Array:
        """Return the gaps without heights of the surface."""
        cells, placement = self.system.cells, self.case.placement
        zone = ContactZone(points, frames, np.ones(len(points)), cells, np.arange(len(points)))
        # its height refers to the highest point of the system's zone, whichever points are evaluated
        height_difference = placement.lowest(points)[2] - placement.lowest(self.system.points)[2]
        return initial_gap(self.case.indenter, zone, placement, float(height_difference))

    @cached_property
    def _touching_edge(self) -> IndenterEdge | None:
        if self.case.indenter.pointwise:
            return None
        search_distance = _RELATIVE_SEARCH_DISTANCE * longest_side(self.system.points, self.system.cells)
        edge = find_indenter_edge(self.gaps, self.system.points, self.system.frames, search_distance)
        return edge and replace(edge, gap=self._with_law_gap(edge.gap))

    def indenter_edge(self, increment: Increment) -> IndenterEdge | None:
        """Return the edge of the indenter in an increment."""
        edge = self._touching_edge
        return edge and replace(edge, gap=edge.gap + self._mode_displacement(increment.base, 2))

    @cached_property
    def modes(self) -> MotionModes:
        """Modes of the indenter's motions."""
        geometry = self.system.points, self.system.frames, self.case.placement.base, self.reference
        return MotionModes(*geometry, self.case.fields)

    def _mode_displacement(self, motion: Array, column: int) -> Array:
        """Return a local component (n,) [m] of the indenter's rigid motion, for motions (motions,)."""
        displacement = np.zeros(len(self.system.points))
        for number in np.flatnonzero(motion[:N_RIGID]):
            mode = self.modes[number][:, column]
            if mode.any():
                displacement += motion[number] * mode
        return displacement

    @cached_property
    def resists(self) -> NDArray[np.bool_]:
        """Mask of the motions that anything may resist, (motions,)."""
        return resisted(self.modes.at_extremes(), self.case.contact_law, self.case.channels)

    def base(self, controls: Controls, start: ConvergedState) -> Array:
        """Return the motions (motions,) of the indenter from which its free motions count, for given controls."""
        base = start.motion.copy()
        for key in controls.keys() & self.case.motions.motions.keys():
            base[self.case.motions.columns[key]] = controls[key]
        return base

    def moves_freely(self, controls: Controls) -> bool:
        """Return whether a rigid motion that something may resist follows from a prescribed force or moment."""
        motions = self.case.motions
        resultants = [motions.columns[key] for key in controls if key not in motions.motions]
        return any(bool(self.resists[columns].any()) for columns in resultants if columns.start < N_RIGID)

    def increment(
        self,
        controls: Controls,
        start: ConvergedState,
        duration: float | None = None,
        rolling: RollingIncrement | None = None,
        sliding: float | None = None,
    ) -> Increment:
        """Return the increment from a converged state to the given controls, in a duration [s], sliding a distance [m].

        Slip is measured from that state, in rolling with the material moved by one cell. Motions are small: the gap
        changes by their part along the normals. Free motions count from the converged state, and those that nothing can
        resist stay there.
        """
        base, system = self.base(controls, start), self.system
        if rolling is not None and rolling.is_steady:  # the state before is that of the solution
            start = self._transport(rolling, replace(start, state=None), base, np.zeros_like(system.offset))
            system = SteadyRollingSystem.of(system, rolling.cell_shift)
        elif rolling is not None:
            displacement = system.offset if start.state is None else start.state.displacement
            start = self._transport(rolling, start, base, displacement)
        prescribed = {key: value for key, value in controls.items() if key not in self.case.motions.motions}
        prescribed_resultants = self._prescribed_resultants(prescribed)
        shift = self._mode_displacement(base, 2)
        gap = self.touching_gap
        if self.case.surface is not None and start.travel.any():
            gap = self._gaps_after(start.travel, system.points, system.frames) + self._lowering
        if shift.any():
            gap = gap + shift
        if start.wear.any():
            gap = gap + start.wear
        shifts = (self._mode_displacement(base, column) - start.total_slip[:, column] for column in range(2))
        translation = stack_columns(shifts, (len(gap), 2))
        potentials = np.broadcast_to(base[N_RIGID:], (len(gap), len(base) - N_RIGID))
        contact_law = law_of_increment(self.case.contact_law, start.slip_path, duration)
        if self.case.wear is not None and not (rolling is not None and rolling.is_steady):
            contact_law = WearingContact(contact_law, self.case.wear, start.wear, sliding, duration)
        channels = tuple(replace(channel, law=watched(channel.law)) for channel in self.case.channels)
        problem = ContactProblem(
            system,
            contact_law,
            channels,
            gap,
            translation,
            potentials,
            tuple(prescribed_resultants.values()),
            friction_heat=0.0 if duration is None else self.case.friction_heat / duration,
            joule_heat=self.case.joule_heat,
        )
        free = np.array(list(prescribed_resultants), int)
        return Increment(problem, base, free, prescribed, duration, start, rolling, sliding)

    def _transport(
        self, rolling: RollingIncrement, start: ConvergedState, motion: Array, displacement: Array
    ) -> ConvergedState:
        """Return a state after transport by one cell; see `RollingIncrement.transport`."""
        rigid = np.column_stack([self._mode_displacement(start.motion, column) for column in range(2)])
        return rolling.transport(start, displacement, rigid, motion)

    def repeat_steady(
        self, increment: Increment, rolling: RollingIncrement, solution: ContactSolution
    ) -> tuple[Increment, ContactSolution]:
        """Return an increment of steady rolling and its solution as a transient one that starts from the same state."""
        displacement = self.system.offset + self.system.apply(solution.state.load)
        state = replace(solution.state, displacement=displacement)
        start = self._transport(rolling, replace(increment.start, state=state), increment.base, displacement)
        translation = increment.problem.translation + rolling.cell_shift.tangential(displacement[:, :2])
        problem = replace(increment.problem, system=self.system, translation=translation)
        return replace(increment, problem=problem, start=start), replace(solution, state=state)

    def _prescribed_resultants(self, prescribed: Controls) -> dict[int, PrescribedResultant]:
        """Return the prescribed resultants of free motions that something may resist, by number."""
        prescribed_resultants, columns = {}, self.case.motions.columns
        for key, totals in prescribed.items():
            numbers = range(*columns[key].indices(len(self.modes)))
            for number, total in zip(numbers, totals, strict=True):
                if not self.resists[number]:
                    continue
                mode, density = self.modes[number], motion_density(self.modes[number], number)
                if key == FORCE_RATIO:
                    (normal,) = range(*columns["normal_force"].indices(len(self.modes)))
                    density, total = density - total * motion_density(self.modes[normal], normal), 0.0
                prescribed_resultants[number] = PrescribedResultant(mode, density, self.system.weights, float(total))
        return dict(sorted(prescribed_resultants.items()))

    def restore_unresisted_motions(
        self, increment: Increment, state: ContactState, touches: NDArray[np.bool_]
    ) -> ContactState:
        """Return the state with motions that nothing resists, for lack of nodes (n,) in contact, left unchanged.

        Exceptions are motions along normals, which must not bring the indenter into the body or away from what it
        attracts, and potentials of an indenter that conducts across the gap.
        """
        if touches.any():
            return state
        problem, modes = increment.problem, [self.modes[number] for number in increment.free]
        position = indenter_position(problem, state.motion) - state.displacement
        normal_traction, self_compliance = np.zeros(len(touches)), potential_diagonal(problem)
        resistance = resistances(problem, normal_traction, state.contact_fraction, self_compliance, position)
        is_resisted = [mode[:, 2].any() or mode[:, POTENTIALS][np.isfinite(resistance)].any() for mode in modes]
        return replace(state, motion=np.where(is_resisted, state.motion, 0.0))

    def converged_state(
        self, increment: Increment, state: ContactState, slip: Array, touches: NDArray[np.bool_]
    ) -> ConvergedState:
        """Return the converged state to continue from, for a state of the contact zone.

        slip: (n, 2) in the increment [m]; touches: (n,) nodes in contact.
        """
        start, motion = increment.start, increment.base.copy()
        motion[increment.free] += state.motion
        total_slip = start.total_slip + slip if start.total_slip.any() else slip
        path = np.zeros(len(touches))
        np.copyto(path, start.slip_path, where=start.slip_path != 0.0)  # pages of zeros take no memory
        path[touches] += path_length(increment, slip[touches])
        return replace(
            start,
            motion=motion,
            resultants=self.resultants(state),
            total_slip=total_slip,
            slip_path=path,
            wear=start.wear if increment.depth is None else start.wear + increment.depth,
            state=state,
        )

    def dissipation(self, increment: Increment, state: ContactState, slip: Array, region: Indices) -> Array:
        """Return the work of friction in an increment with slips (n, 2) [m], (n,) [J/m^2].

        It is zero except where nodes (n,) of `region` slip. While a node slips its traction is the one of the law for
        its slip and the present pressure: the mean of that at the end and of the law's for the same slip under the
        initial pressure. In rolling it is the mean of the tractions of the material at both ends of its path.
        """
        problem, start = increment.problem, increment.start
        if increment.rolling is not None:
            before = np.zeros_like(slip) if start.state is None else start.state.load[:, :2]
            return friction_work(before, state.load[:, :2], slip)
        traction = state.load[:, :2]
        if start.state is not None:
            # of the problem as solved: with a contact edge between nodes, those near the indenter have gaps, too
            back = self._mode_displacement(start.motion - increment.base, 2)
            worn = 0.0 if increment.depth is None else increment.depth
            gap = np.column_stack([slip, problem.gap - worn + back - start.state.displacement[:, 2]])
            stiffness = 1.0 / problem_scales(problem).normal_compliance
            r = stiffness, _TANGENTIAL_STEP * stiffness
            pressed = np.column_stack([np.zeros_like(slip), start.state.load[:, 2]])
            law = problem.contact_law
            with np.errstate(all="ignore"):  # the state may come from a diverged iteration
                traction = traction + resolve(law, augmented_traction(law, pressed, gap, r), gap, r)[:, :2]
        work, slips = np.zeros(len(region)), region == Region.SLIP
        if traction.any():
            work[slips] = np.einsum("nt,nt->n", traction[slips], slip[slips]) / 2.0
        return work

    def resultants(self, state: ContactState) -> Array:
        """Return the resultants conjugate to the motions in a state of the contact zone, (motions,)."""
        return total_resultants(self.modes, self.system.weights, state.load)


def beginning(kinematics: IndenterKinematics) -> tuple[ConvergedState, Controls]:
    """Return the initial state and its controls: the undeformed body, or the end of an earlier run."""
    case = kinematics.case
    if case.restart is None:
        here = at_rest(case.motions, case.potentials, len(kinematics.system.points))
        return here, hold_motions(here, {})
    step = case.restart.step
    totals = kinematics.resultants(step.state)
    rolled = step.loading.rolling
    distances = (0.0, step.loading.travel) if rolled is None else (rolled.distance, step.loading.travel, rolled.cycles)
    memory = step.total_slip, step.slip_path, step.wear
    here = ConvergedState(case.motions, step.loading.motion, totals, *memory, step.state, *distances)
    return here, hold_motions(here, step.loading.prescribed)


def slip_of(increment: Increment, state: ContactState) -> Array:
    """Return the tangential motion of the indenter over the body since the last converged state, (n, 2) [m]."""
    slip = np.empty((2, len(state.displacement))).T  # field by field
    for column in range(2):
        shift = indenter_field(increment.problem, column, state.motion)
        np.subtract(shift, state.displacement[:, column], out=slip[:, column])
    return slip


def path_length(increment: Increment, slip: Array) -> Array:
    """Return the length of the path that nodes slip in an increment with slips (n, 2) [m], (n,) [m]."""
    return np.linalg.norm(slip, axis=1) if increment.sliding is None else np.full(len(slip), increment.sliding)


def touching(problem: ContactProblem, state: ContactState) -> NDArray[np.bool_]:
    """Return the nodes in contact, (n,): the contact itself bears a pressure there, apart from any attraction."""
    law = problem.contact_law
    if not is_adhesive(law):
        return np.asarray(state.load[:, 2] < 0.0)
    r = (1.0 / problem_scales(problem).normal_compliance,) * 2
    gap = contact_gap(problem, state.displacement, state.motion)
    with np.errstate(all="ignore"):  # the state may come from a diverged iteration
        # where surfaces are apart by round-off, traction and attraction differ by that: the law knows which it is
        trial = augmented_traction(law, state.load[:, MECHANICAL], gap, r)
        return np.asarray(resolve(law, trial, gap, r)[:, 2] < 0.0)


def regions(increment: Increment, solution: ContactSolution, slip: Array, touches: NDArray[np.bool_]) -> Indices:
    """Return numbers of Region, (n,): a node in contact sticks if its slip is below the resolution of the law.

    slip: (n, 2) in the increment [m]; touches: (n,) nodes in contact. Without friction nothing holds a node, and it
    slips wherever it touches.
    """
    scales = problem_scales(increment.problem)
    resolution = (
        max(_MAX_STICK_SLIP, _MAX_STICK_SLIP_RATIO * solution.residual) * scales.pressure * scales.normal_compliance
    )
    region = np.where(touches, np.int8(Region.SLIP), np.int8(Region.OPEN))
    if has_friction(increment.problem.contact_law):
        region[touches & ~(np.linalg.norm(slip, axis=1) > resolution)] = Region.STICK
    return region
