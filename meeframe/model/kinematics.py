"""How the indenter of a case moves over the contact zone: the contact problem of an increment, and what it leads to."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.contact.problem import (
    ContactProblem,
    ContactSolution,
    ContactState,
    PrescribedResultant,
    contact_gap,
)
from meeframe.contact.scales import problem_scales
from meeframe.fields import MECHANICAL, POTENTIALS, Array, Indices
from meeframe.indenters import find_indenter_edge, initial_gap, longest_side
from meeframe.indenters.base import FORCE_RATIO, N_RIGID, motion_measures, motion_modes
from meeframe.laws.base import attracts, augmented_traction
from meeframe.mesh import ContactZone
from meeframe.model.conduction import watched
from meeframe.model.data import CaseData
from meeframe.model.history import Controls, Converged, at_rest, held
from meeframe.model.laws import gap_of_law, law_of_increment
from meeframe.model.step import resisted
from meeframe.results.records import Region
from meeframe.system.capabilities import IndenterEdge
from meeframe.system.reduced import ReducedSystem

_ACROSS: Final = 1e-9
"""Cosine between a normal and the indenter's axis below which they are across each other."""
_REACH: Final = 2.0
"""Of the rim of the indenter, in the longest sides of cells."""
_FIRM: Final = 1e6
"""Of the tangential step of a law, times the stiffness of a node, at which it gives the traction of a given slip."""
_STUCK: Final = 1e-6
"""Slip that would cause less than this fraction of the characteristic pressure is none ..."""
_UNCERTAIN: Final = 10.0
"""... nor is slip within so many times the residual of the solution."""


@dataclass(frozen=True, eq=False)
class Increment:
    """One increment. problem: of contact; base: (motions,) motions of the indenter from which its freedoms count; free:
    (m,) numbers of those that are free; prescribed, duration: as in Loading."""

    problem: ContactProblem
    base: Array
    free: Indices
    prescribed: Controls
    duration: float | None


@dataclass(frozen=True, eq=False)
class IndenterKinematics:
    """The indenter of a case on the reduced system of its body."""

    case: CaseData
    system: ReducedSystem

    @cached_property
    def reference(self) -> Array:
        """The point about which it turns, (3,) [m]."""
        return self.case.placement.reference(self.system.points)

    @cached_property
    def touching_gap(self) -> Array:
        """Gap (n,) [m] between the undeformed body and the indenter where that just touches.

        If the contact law adds to it, along the normals, the indenter stands so that the lowest gap at a node is zero.
        """
        gap = self.gaps(self.system.points, self.system.frames)
        return self._lowered(gap)

    @cached_property
    def _lowering(self) -> Array:
        """What the contact law and the way that the indenter goes for it add to the gap, (n,) [m]."""
        added = gap_of_law(self.case.contact_law, self.system.points)
        if not added.any():
            return added
        gap = self.gaps(self.system.points, self.system.frames) + added
        nearing = -self.modes[0, :, 2]  # of the gap, for each metre of approach
        # a tilted indenter may lie above nodes whose normals are across its axis: approach never closes their gaps
        closing = np.isfinite(gap) & (nearing > _ACROSS)
        way = (gap[closing] / nearing[closing]).min() if closing.any() else 0.0
        return np.asarray(added - way * nearing)

    def _lowered(self, gap: Array) -> Array:
        """Gaps (n,) of the surfaces alone as the law has them, which lets none overlap if it adds any."""
        return np.maximum(gap + self._lowering, 0.0) if self._lowering.any() else gap

    def gaps(self, points: Array, frames: Array) -> Array:
        """Gap (m,) [m] at points (m, 3) with frames (m, 3, 3), of the indenter where it just touches the zone."""
        cells, place = self.system.cells, self.case.placement
        zone = ContactZone(points, frames, np.ones(len(points)), cells, np.arange(len(points)))
        # it stands level with the highest point of the system's zone, whichever points are asked for
        lowered = place.lowest(points)[2] - place.lowest(self.system.points)[2]
        return initial_gap(self.case.indenter, zone, place, float(lowered))

    @cached_property
    def _touching_rim(self) -> IndenterEdge | None:
        if self.case.indenter.pointwise:
            return None
        reach = _REACH * longest_side(self.system.points, self.system.cells)
        rim = find_indenter_edge(self.gaps, self.system.points, self.system.frames, reach)
        return rim and replace(rim, gap=self._lowered(rim.gap))

    def rim(self, increment: Increment) -> IndenterEdge | None:
        """Where the indenter ends, as the increment has it."""
        rim = self._touching_rim
        return rim and replace(
            rim, gap=rim.gap + np.einsum("k,kn->n", increment.base[:N_RIGID], self.modes[:N_RIGID, :, 2])
        )

    @cached_property
    def modes(self) -> Array:
        """Modes of its motions, (motions, n, fields); see motion_modes."""
        place = self.system.points, self.system.frames, self.case.placement.base, self.reference
        return motion_modes(*place, self.case.fields)

    @cached_property
    def measures(self) -> Array:
        """Measures of the resultants that work on its motions, (motions, n, fields)."""
        return motion_measures(self.modes, self.system.weights)

    @cached_property
    def resists(self) -> NDArray[np.bool_]:
        """Which of its motions anything may resist, (motions,)."""
        return resisted(self.modes, self.case.contact_law, self.case.channels)

    def increment(self, controls: Controls, start: Converged, duration: float | None = None) -> Increment:
        """The increment from a converged state to where the controls are in force, in a duration [s].

        Slip is measured from that state. Motions are small: the gap changes by their part along the normals. Free ones
        count from the converged state, and those that nothing can resist stay there.
        """
        base = start.motion.copy()
        for key in controls.keys() & self.case.motions.motions.keys():
            base[self.case.motions.columns[key]] = controls[key]
        prescribed = {key: value for key, value in controls.items() if key not in self.case.motions.motions}
        prescribed_resultants = self._freedoms(prescribed)
        gap = self.touching_gap + np.einsum("k,kn->n", base[:N_RIGID], self.modes[:N_RIGID, :, 2])
        tangential = np.einsum("k,knt->nt", base[:N_RIGID], self.modes[:N_RIGID, :, :2])
        potentials = np.tile(base[N_RIGID:], (len(gap), 1))
        contact_law = law_of_increment(self.case.contact_law, start.slip_path, duration)
        channels = tuple(replace(channel, law=watched(channel.law)) for channel in self.case.channels)
        translation = tangential - start.total_slip
        problem = ContactProblem(
            self.system, contact_law, channels, gap, translation, potentials, tuple(prescribed_resultants.values())
        )
        return Increment(problem, base, np.array(list(prescribed_resultants), int), prescribed, duration)

    def _freedoms(self, prescribed: Controls) -> dict[int, PrescribedResultant]:
        """Free motions that something may resist, by their number."""
        prescribed_resultants, columns = {}, self.case.motions.columns
        for key, totals in prescribed.items():
            numbers = range(*columns[key].indices(len(self.modes)))
            for number, total in zip(numbers, totals, strict=True):
                measure = self.measures[number]
                if key == FORCE_RATIO:
                    measure, total = measure - total * self.measures[columns["normal_force"]][0], 0.0
                if self.resists[number]:
                    prescribed_resultants[number] = PrescribedResultant(self.modes[number], measure, float(total))
        return dict(sorted(prescribed_resultants.items()))

    def settled(self, increment: Increment, state: ContactState, touches: NDArray[np.bool_]) -> ContactState:
        """The state, in which motions that nothing resists, for lack of nodes (n,) in contact, stay where they were.

        Those are all but the ones along normals, which must not bring the indenter into the body or away from what it
        attracts, and potentials of an indenter that charges reach across the gap.
        """
        if touches.any():
            return state
        modes = self.modes[increment.free]
        felt = modes[:, :, 2].any(axis=1) | (modes * state.load)[:, :, POTENTIALS].any(axis=(1, 2))
        return replace(state, motion=np.where(felt, state.motion, 0.0))

    def reached(
        self, increment: Increment, state: ContactState, touches: NDArray[np.bool_], start: Converged
    ) -> Converged:
        """A state of the contact zone, in which these nodes (n,) touch, as one to go on from."""
        motion = increment.base.copy()
        motion[increment.free] += state.motion
        slip = slip_of(increment, state)
        way = np.where(touches, np.linalg.norm(slip, axis=1), 0.0)
        return Converged(
            self.case.motions, motion, self.resultants(state), start.total_slip + slip, start.slip_path + way, state
        )

    def dissipation(self, increment: Increment, start: Converged, state: ContactState, region: Indices) -> Array:
        """Work of friction in an increment from a converged state, (n,) [J/m^2], where nodes (n,) of `region` slip.

        While a node slips its traction is the one of the law for its slip and the pressure of the moment: the mean of
        that at the end and of what the law has for the same slip under the pressure at the start.
        """
        problem, slip = increment.problem, slip_of(increment, state)
        traction = state.load[:, :2]
        if start.state is not None:
            # of the problem as solved: with an edge between nodes, those beside the indenter have gaps, too
            back = np.einsum("k,kn->n", (start.motion - increment.base)[:N_RIGID], self.modes[:N_RIGID, :, 2])
            gap = np.column_stack([slip, problem.gap + back - start.state.displacement[:, 2]])
            stiffness = 1.0 / problem_scales(problem).normal_compliance
            r = stiffness, _FIRM * stiffness
            pressed = np.column_stack([np.zeros_like(slip), start.state.load[:, 2]])
            law = problem.contact_law
            with np.errstate(all="ignore"):  # the state may be of an iteration that went astray
                traction = traction + law.resolve(augmented_traction(law, pressed, gap, r), gap, r)[:, :2]
        return np.where(region == Region.SLIP, np.einsum("nt,nt->n", traction, slip) / 2.0, 0.0)

    def resultants(self, state: ContactState) -> Array:
        """Return those that work on its motions in a state of the contact zone, (motions,)."""
        totals: Array = np.einsum("kni,ni->k", self.measures, state.load)
        return totals


def beginning(kinematics: IndenterKinematics) -> tuple[Converged, Controls]:
    """The state to start from and what is in force there: the undeformed body, or where an earlier run ended."""
    case = kinematics.case
    if case.restart is None:
        here = at_rest(case.motions, case.potentials, len(kinematics.system.points))
        return here, held(here, {})
    step = case.restart.step
    totals = kinematics.resultants(step.state)
    here = Converged(case.motions, step.loading.motion, totals, step.total_slip, step.slip_path, step.state)
    return here, held(here, step.loading.prescribed)


def slip_of(increment: Increment, state: ContactState) -> Array:
    """Tangential motion of the indenter over the body since the last converged state, (n, 2) [m]."""
    return contact_gap(increment.problem, state.displacement, state.motion)[:, :2]


def touching(problem: ContactProblem, state: ContactState) -> NDArray[np.bool_]:
    """Nodes in contact, (n,): the contact itself bears a pressure there, whatever attraction is on top of it."""
    law = problem.contact_law
    if not attracts(law):
        return np.asarray(state.load[:, 2] < 0.0)
    r = (1.0 / problem_scales(problem).normal_compliance,) * 2
    gap = contact_gap(problem, state.displacement, state.motion)
    with np.errstate(all="ignore"):  # the state may be of an iteration that went astray
        # where surfaces are apart by round-off, traction and attraction differ by that: the law knows which it is
        trial = augmented_traction(law, state.load[:, MECHANICAL], gap, r)
        return np.asarray(law.resolve(trial, gap, r)[:, 2] < 0.0)


def regions(increment: Increment, solution: ContactSolution, touches: NDArray[np.bool_]) -> Indices:
    """Numbers of Region, (n,): a node in contact sticks if it slips by less than the contact law notices.

    Without friction nothing holds it, and it slips wherever it touches.
    """
    scales = problem_scales(increment.problem)
    slip = np.linalg.norm(slip_of(increment, solution.state), axis=1)
    noticed = max(_STUCK, _UNCERTAIN * solution.residual) * scales.pressure * scales.normal_compliance
    slips = (slip > noticed) | (not increment.problem.contact_law.tangential_scaling().any())
    return np.where(touches, np.where(slips, Region.SLIP, Region.STICK), Region.OPEN).astype(np.int64)
