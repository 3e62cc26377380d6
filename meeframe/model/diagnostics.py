"""Diagnostics, which the message of an increment adds to the reason for the end of its iteration."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from meeframe.contact.conduction import is_partial
from meeframe.contact.problem import Status
from meeframe.contact.residual import limit_jumps, node_blocks
from meeframe.contact.scales import largest
from meeframe.fields import Array, Indices
from meeframe.indenters import longest_side
from meeframe.indenters.base import RIGID_MOTIONS, RIGID_RESULTANTS, IndenterMotions, MotionModes
from meeframe.laws.base import ContactLaw, attraction, augmented_traction, fixed_point_map, has_friction, is_adhesive
from meeframe.mesh.body import Body
from meeframe.mesh.measures import corners
from meeframe.mesh.regular import extreme_points, grid_shape, nodes_of_mixed_cells, outermost_cells
from meeframe.model.heat_diagnostics import heat_diagnostics
from meeframe.model.kinematics import Increment, IndenterKinematics
from meeframe.model.preflight import overlaps_evenly, preflight, unused_potentials
from meeframe.plugin.hookspecs import PROJECT
from meeframe.plugin.sources import BUNDLED_PACKAGES
from meeframe.results.records import Region, StepResult, Zone, join_sentences, zone_of
from meeframe.system.capabilities import diagonal
from meeframe.system.reduced import ReducedSystem

_LARGEST_ANGLE: Final = 0.1
"""Largest rotation [rad] that counts as small; its cosine differs from one by half a per cent."""
_TRACTION_TOLERANCE: Final = 1e-6
"""Relative change of tractions below which they count as equal."""
_RESIDUAL_FACTOR: Final = 10.0
"""Change of tractions, in multiples of the residual, below which they count as equal."""
_ROUND_OFF: Final = 1e-9
"""Motion relative to that of the whole zone that may be round-off of positions."""
_NEGLIGIBLE_MOTION: Final = 1e-6
"""Relative motion of the contact that counts as none."""
_LARGEST_ONSET: Final = 0.25
"""Fraction of the nodes in contact that may come into contact within one increment.

For a sphere, tangential tractions are then accurate to some per cent (docs/reference/case-files.md).
"""
_NEGLIGIBLE_RATIO: Final = 1e-3
"""Ratio of tangential to normal tractions, and of gaps to displacements, below which they count as zero."""
_MAX_AREA_UNCERTAINTY: Final = 0.1
"""Relative uncertainty of the contact area above which a diagnostic is reported."""
_AREA_UNCERTAINTY: Final = 0.5
"""Factor on the fraction of a contact's nodes at its boundary, to the power 3/2, in the error estimate of the area.

It is an upper bound of the error for circles six or more spacings across.
"""
_NOTICED_ATTRACTION: Final = 1e-3
"""Attraction that does not matter, as a fraction of the largest pressure."""
_TRIAL_GAPS: Final = np.concatenate([[0.0], np.logspace(-15, 1, 1601)])
"""Gaps [m] among which the steepest decrease of the attraction is sought."""
_GAPS_PER_REFINEMENT: Final = 100
"""Number of gaps for a refinement in the interval with the steepest decrease and in its neighbours."""
_REFINEMENTS: Final = 3
"""Number of refinements of the steepest decrease."""
_RELATIVE_OFFSET: Final = 1e-3
"""Distance of a point beyond the side of an element, as a fraction of the way from its middle to the side."""


@final
@dataclass(frozen=True, eq=False)
class Diagnostics:
    """Diagnostics of the increments of a case.

    Parameters
    ----------
    kinematics
        Kinematics of the indenter on the reduced system.
    warnings
        Warnings of the formulations of the case, in words.
    """

    kinematics: IndenterKinematics
    warnings: Callable[[], Iterable[str]]

    @cached_property
    def zone(self) -> Zone:
        """Contact zone of the case."""
        return zone_of(self.kinematics.system)

    @cached_property
    def zone_boundary(self) -> Indices:
        """Corners (m, 2) of the sides at the boundary of the zone beyond which the contact would continue."""
        case = self.kinematics.case
        if case.formulation.is_periodic():
            return np.zeros((0, 2), np.int64)
        pointwise = case.indenter.pointwise or (case.surface is not None and case.surface.pointwise)
        return open_sides(self.zone, None if pointwise else self.kinematics.gaps)

    @cached_property
    def _body(self) -> Body:
        """Body of the case, without boundary conditions."""
        case = self.kinematics.case
        return Body.of(case.material, case.mesh, (), case.zone, case.layers)

    def with_diagnostics(
        self, increment: Increment, result: StepResult, onsets: "ContactOnsets", ends: bool, warns: bool
    ) -> StepResult:
        """Return a result with diagnostics in its message, and whether its contact reaches the zone boundary.

        onsets: after the increment; ends: whether it ends a load step; warns: add the warnings of the case.
        """
        kinematics, zone = self.kinematics, self.zone
        case = kinematics.case
        sides = count_sides_in_contact(result, self.zone_boundary) if result.status is Status.CONVERGED else 0
        # contact that reaches the boundary already implies an overlap of the whole zone
        warnings = list(preflight(kinematics)) if warns and not sides else []
        law = increment.problem.contact_law
        sentences = list(diagnostics(zone, result, law, sides, distant=bool(warnings)))
        if self._body.expands:
            sentences += heat_diagnostics(self._body, increment, result, kinematics.system.weights)
        if increment.rolling is not None and (result.touching & increment.rolling.cell_shift.entering).any():
            sentences.append(
                "the contact reaches the border at which material enters its zone, which should be without load: use "
                "a wider zone, or move the indenter against the rolling direction"
            )
        sentences += _failed_onset(result, case.contact_law, onsets)
        if ends:
            sentences += diagnostics_on_end(zone, result, case.contact_law, onsets)
            sentences += snap_in(kinematics.system, case.contact_law, result)
        if warns:
            sentences += [*self.warnings(), *warnings, *unused_potentials(kinematics)]
        return replace(with_message(result, sentences), contact_at_zone_boundary=sides > 0)


def with_message(result: StepResult, sentences: Iterable[str]) -> StepResult:
    """Return the result with further sentences in its message."""
    return replace(result, message=join_sentences(result.message, *sentences))


def diagnostics(zone: Zone, step: StepResult, law: ContactLaw, sides: int = 0, distant: bool = False) -> Iterator[str]:
    """Yield diagnostics of an increment, each in words.

    law: that of the increment; sides: number of sides at the zone boundary that the contact has reached; distant: the
    distance of an indenter without contact is reported elsewhere.

    If the increment did not converge: a reason that lies in the law, and its consequences. Otherwise: nothing touches;
    the contact reaches the boundary of its zone, where it is cut off; the indenter has moved further than the theory of
    small motions permits, by more than the extent of the zone or a tenth of a radian; a prescribed tangential force or
    torque is all that friction can bear, so that the motion is not determined.
    """
    fails = step.status in (Status.CYCLING, Status.STALLED, Status.DIVERGED)
    if fails and type(law).__module__.partition(".")[0] not in {PROJECT, *BUNDLED_PACKAGES}:
        yield "a law that violates its contract can cause this: `meeframe plugins check FILE.py` tests a plugin"
    if step.status is not Status.CONVERGED:
        size = float(np.abs(step.traction).max(initial=0.0)) or 1.0
        if step.status is not Status.DIVERGED and limit_jumps(law, len(step.traction), size):
            yield (
                "the friction limit of the law jumps where contact begins, and nodes that shear lifts may lie between "
                "open and closed: use a limit in proportion to the pressure, such as capped-coulomb"
            )
        yield "the next increment starts from the last one that converged"
        return
    if not step.touching.any() and not distant:
        between = is_partial(step.contact_fraction).any()  # at a potential that takes all pressure away
        yield (
            "no node bears a pressure, but some conduct between open and closed"
            if between
            else "the indenter does not touch the body"
        )
    if sides:
        yield f"the contact reaches the boundary of its zone at {sides} element side{'s' * (sides > 1)}"
    yield from _large(zone, step)
    if _slides(zone, step, law):
        yield (
            "the whole contact slips under the prescribed force or torque: the motion beyond the onset of full slip is "
            "undetermined"
        )


@dataclass(frozen=True, eq=False)
class ContactOnsets:
    """Increments of a load step in which the nodes came into contact.

    gap: returns the gap (n,) in the last converged state [m]; touching: (n,) nodes in contact there; number: (n,) of
    the increment of their onset, from 1, or 0 for nodes that were in contact before the load step or are not in
    contact.
    """

    gap: Callable[[], Array]
    touching: NDArray[np.bool_]
    number: Indices

    @classmethod
    def of(cls, gap: Callable[[], Array], touching: NDArray[np.bool_], increments: int) -> "ContactOnsets":
        """Return the onsets at the beginning of a load step of that many increments."""
        return cls(gap, touching, np.zeros(len(touching), np.min_scalar_type(increments)))

    def after(self, step: StepResult) -> "ContactOnsets":
        """Return the onsets after another increment; the same ones if it did not converge.

        Nodes between which nothing opened do not count as new.
        """
        if step.status is not Status.CONVERGED:
            return self
        apart = self.gap() > _NEGLIGIBLE_RATIO * largest(step.displacement[:, 2])
        number = np.where(self.touching | ~apart, self.number, step.increment)
        return ContactOnsets(lambda: step.gap, step.touching, np.where(step.touching, number, 0))


def diagnostics_on_end(zone: Zone, step: StepResult, law: ContactLaw, onsets: ContactOnsets) -> Iterator[str]:
    """Yield diagnostics at the end of a load step, each in words; onsets: after its last increment.

    They report a large part of the contact that came about within one increment, if friction matters: slip counts from
    the beginning of the increment, before those nodes touched. They also report a contact so few nodes across that its
    area is uncertain.
    """
    if step.status is not Status.CONVERGED or not step.touching.any():
        return
    count, at_edge = int(step.touching.sum()), count_edge_nodes(zone, step)
    new = np.bincount(onsets.number[step.touching], minlength=2)[1:]
    late = onsets.number == 1 + new.argmax()
    shear, pressure = (np.linalg.norm(traction) for traction in (step.traction[late, :2], step.traction[late, 2]))
    # on coarse meshes equidistant nodes come into contact together, whatever the increments
    much = new.max() > max(_LARGEST_ONSET * count, at_edge / 2) and step.loading.rolling is None
    if has_friction(law) and much and shear > _NEGLIGIBLE_RATIO * pressure:
        yield (
            f"{new.max() / count:.0%} of the contact formed in one increment, and its slip includes motion before it "
            "touched: use more `increments`"
        )
    uncertain = _AREA_UNCERTAINTY * (at_edge / count) ** 1.5
    if uncertain > _MAX_AREA_UNCERTAINTY:
        nodes = "one node" if count == 1 else f"{count} nodes, {at_edge} of them at its edge"
        yield f"the contact has {nodes}: its area is uncertain by about {uncertain:.0%} (use more divisions)"


def _failed_onset(step: StepResult, law: ContactLaw, onsets: ContactOnsets) -> Iterator[str]:
    """Yield advice if an increment with friction did not converge in which a large part of the contact was to form.

    onsets: after the increment, so that they end with the last converged state.
    """
    if step.status is Status.CONVERGED or step.loading.rolling is not None or not has_friction(law):
        return
    new = int((step.touching & ~onsets.touching).sum()) / max(1, int(step.touching.sum()))
    if new > _LARGEST_ONSET:
        yield (
            f"{new:.0%} of the contact was to form in this increment, with slip before it touched: more `increments` "
            "may converge, and are more accurate"
        )


def count_edge_nodes(zone: Zone, step: StepResult) -> int:
    """Return the number of nodes in contact that share an element with a node out of contact."""
    return int((step.touching & nodes_of_mixed_cells(zone.cells, step.touching)).sum())


def _large(zone: Zone, step: StepResult) -> Iterator[str]:
    """Yield a diagnostic for each rigid motion that is not small."""
    limits = {"m": float(np.ptp(extreme_points(zone.points), axis=0).max()), "rad": _LARGEST_ANGLE}
    for name in RIGID_MOTIONS if step.loading.rolling is None else ("approach", "tilt"):
        size = float(np.linalg.norm(np.atleast_1d(getattr(step.loading, name))))
        unit = IndenterMotions().units[name]
        if size > limits.get(unit, np.inf):
            yield f"{name} of {size:.3g} {unit}: beyond small motions, {limits[unit]:.3g} {unit}"


def _slides(zone: Zone, step: StepResult, law: ContactLaw) -> bool:
    """Return whether friction resists a free motion in the plane of the contact to the full.

    The tractions then stay unchanged, by the law, when everything slips further along it.
    """
    columns = IndenterMotions().columns
    prescribed = [columns.get(key) for key in step.loading.prescribed]
    free = [key for key in ("tangential_force", "torque") if RIGID_RESULTANTS[key] in prescribed]
    slips = step.region == Region.SLIP
    if not free or not slips.any() or not has_friction(law):
        return False
    numbers = np.concatenate([np.r_[RIGID_RESULTANTS[key]] for key in free])
    every = MotionModes(zone.points, zone.frames, step.loading.axes, step.loading.reference)
    touching = step.touching
    modes = np.stack([_scaled_to_contact(every[number][:, :2], touching) for number in numbers])
    way = np.linalg.norm(step.slip[slips], axis=1)
    along = step.slip[slips] / np.where(way > 0.0, way, 1.0)[:, None]
    # the free motion closest to the slip
    across = np.einsum("knt,nt->nk", modes[:, slips[touching]], along[:, ::-1] * [-1.0, 1.0])
    # by its small triangular factor: singular vectors along the nodes would fill a matrix of all pairs of them
    least = np.linalg.svd(np.linalg.qr(across, mode="r"))[2][-1]
    motion = np.einsum("knt,k->nt", modes, least)
    if largest(motion) < _NEGLIGIBLE_MOTION:
        return True  # a twist about the only node in contact
    motion *= np.copysign(1.0, (motion[slips[touching]] * along).sum()) / largest(motion)
    # far enough to reverse opposite slip
    distance = 2.0 * max(largest(step.slip), largest(step.displacement))
    r = (largest(step.traction) / distance,) * 2
    gaps, changes = np.column_stack([step.slip, step.gap]), []
    gaps[touching, :2] += distance * motion
    for nodes in node_blocks(law, len(touching)):
        traction, gap = step.traction[nodes], gaps[nodes]
        further = fixed_point_map(law, augmented_traction(law, traction, gap, r), gap, r)
        changes.append((further - traction)[touching[nodes]])
    tolerance = max(_TRACTION_TOLERANCE, _RESIDUAL_FACTOR * step.residual)
    return bool(np.linalg.norm(np.concatenate(changes)) <= tolerance * np.linalg.norm(step.traction[touching, :2]))


def _scaled_to_contact(mode: Array, touching: NDArray[np.bool_]) -> Array:
    """Return a mode (n, 2) at the nodes in contact, of norm one, or less if it moves them by round-off alone."""
    in_contact = mode[touching]
    return np.asarray(in_contact / max(float(np.linalg.norm(in_contact)), _ROUND_OFF * largest(mode)))


def steepest_fall(law: ContactLaw) -> float:
    """Return the steepest decrease of the attraction with the gap [Pa/m], >= 0, by successively shorter chords."""
    gaps = _TRIAL_GAPS
    for _ in range(1 + _REFINEMENTS):
        fall = -np.diff(attraction(law, gaps)) / np.diff(gaps)
        index = int(fall.argmax())
        gaps = np.linspace(gaps[max(index - 1, 0)], gaps[min(index + 2, len(gaps) - 1)], _GAPS_PER_REFINEMENT)
    return max(float(fall.max()), 0.0)


def snap_in(system: ReducedSystem, law: ContactLaw, step: StepResult) -> Iterator[str]:
    """Yield a diagnostic if single nodes snap into and out of contact, with the element size that avoids it.

    law: of the case. A single node is unstable where the decrease of the attraction times its response to its own load
    exceeds one; the response grows with the size of elements.
    """
    if not is_adhesive(law) or attraction(law, step.gap).max() <= _NOTICED_ATTRACTION * np.abs(step.traction).max():
        return
    ratio = steepest_fall(law) * float(diagonal(system, (2,)).max())
    if ratio <= 1.0:
        return
    size = longest_side(system.points, system.cells) or float(np.sqrt(system.weights.max()))
    yield (
        f"the attraction decreases {ratio:.3g} times as steeply with the gap as a single node resists: nodes snap into "
        "contact one by one, and forces may be wrong and depend on the loading path. Use elements of at most "
        f"{size / ratio:.2g} m (here {size:.2g} m) or an attraction with a longer range"
    )


def boundary_sides(zone: Zone) -> tuple[Indices, Array]:
    """Return corners (m, 2) of the sides of one cell only, and vectors (m, 3) to them from its middle [m]."""
    sides, ways = [np.zeros((0, 2), np.int64)], [np.zeros((0, 3))]
    inner, shape = np.zeros(len(zone.points), bool), grid_shape(zone.cells, len(zone.points))
    if shape is not None:  # the outermost cells alone
        inner.reshape(shape)[1:-1, 1:-1] = True
    for outline in corners(zone.cells) if shape is None else [outermost_cells(shape)]:
        pairs = np.stack([outline, np.roll(outline, -1, axis=1)], axis=-1)
        middles = zone.points[outline].mean(axis=1)[:, None]
        sides.append(pairs.reshape(-1, 2))
        ways.append((zone.points[pairs].mean(axis=2) - middles).reshape(-1, 3))
    joined, away = np.concatenate(sides), np.concatenate(ways)
    one, other = np.sort(joined, axis=1).T
    _, first, counts = np.unique(one * len(zone.points) + other, return_index=True, return_counts=True)
    border = first[counts == 1]
    border = border[~inner[joined[border]].any(axis=1)]  # not the sides shared with cells further inside
    return joined[border], away[border]


def open_sides(zone: Zone, gaps: Callable[[Array, Array], Array] | None) -> Indices:
    """Return corners (m, 2) of the sides at the boundary of a zone beyond which the indenter continues.

    gaps: returns the gap at points (k, 3) with frames (k, 3, 3), inf beyond the indenter; None if it is unknown.
    """
    sides, away = boundary_sides(zone)
    if gaps is None or not len(sides):
        return sides
    beyond = zone.points[sides].mean(axis=1) + _RELATIVE_OFFSET * away
    on: Indices = sides[np.isfinite(gaps(beyond, zone.frames[sides[:, 0]]))]
    return on


def count_sides_in_contact(step: StepResult, sides: Indices) -> int:
    """Return how many of the sides (m, 2) are in contact.

    It is zero where full contact is intended, as indicated by a uniform gap over the zone.
    """
    count = int(step.touching[sides].all(axis=1).sum())
    return 0 if count and overlaps_evenly(step.initial_gap) else count
