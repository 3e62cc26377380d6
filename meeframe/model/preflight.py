"""Preflight checks: problems of a case that can be found before any matrix is assembled."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from meeframe.contact.problem import Solver, check_accepted, is_selective
from meeframe.fields import Array
from meeframe.indenters.base import RIGID_MOTIONS
from meeframe.indenters.topography.height_map import topography_of
from meeframe.laws.base import is_adhesive
from meeframe.mesh import find_contact_zone
from meeframe.mesh.regular import extreme_points, grid_shape
from meeframe.model.data import CaseData
from meeframe.model.frames import frames_along
from meeframe.model.history import Controls, ConvergedState, ramp
from meeframe.model.kinematics import Increment, IndenterKinematics, beginning
from meeframe.system.reduced import NodalFields, ReducedSystem

_PERIOD_TOLERANCE: Final = 1e-4
"""Relative difference of periods up to which they count as equal."""
_OVERLAP_TOLERANCE: Final = 1e-6
"""Relative difference of overlaps up to which they count as equal."""


@final
@dataclass(frozen=True, eq=False)
class RigidSystem(ReducedSystem):
    """Reduced system of a rigid body: the contact zone, which is known before the body is reduced."""

    def apply(self, load: Array) -> Array:
        """Return no displacement, (n, fields) for load (n, fields)."""
        return np.zeros_like(load)

    def diagonal_blocks(self) -> Array:
        """Return no response of a node to its own load, (n, fields, fields)."""
        return np.zeros((len(self.points), self.n_fields, self.n_fields))

    def dense(self) -> Array | None:
        """Return None: there is no matrix."""
        return None

    def recover(self, load: Array) -> NodalFields:
        """Return the load (n, fields), and no displacement, on the contact zone alone."""
        return NodalFields(self.points, self.cells, self.apply(load), load)


def undeformed(case: CaseData) -> IndenterKinematics:
    """Return the indenter of a case on its undeformed body."""
    zone = find_contact_zone(case.mesh, case.zone)
    frames, offset = frames_along(zone, case.axes), np.zeros((len(zone.points), case.fields.size))
    return IndenterKinematics(case, RigidSystem(zone.points, frames, zone.weights, zone.cells, offset))


def _plan(kinematics: IndenterKinematics) -> Iterator[tuple[Controls, ConvergedState, float | None]]:
    """Yield controls, initial state and duration of an increment to the end of each load step.

    Motions that are not prescribed keep their initial values.
    """
    here, controls = beginning(kinematics)
    for step in kinematics.case.steps:
        controls = ramp(controls, here, step.prescribed)
        yield controls, here, step.increment_duration


def planned(kinematics: IndenterKinematics) -> Iterator[Increment]:
    """Yield the increment to the end of each load step, see `_plan`."""
    return (kinematics.increment(*plan) for plan in _plan(kinematics))


def check_solver(case: CaseData, solver: Solver) -> None:
    """Raise CaseError if the solver does not accept the contact problem of a load step."""
    if not is_selective(solver):
        return
    for increment in planned(undeformed(case)):
        check_accepted(solver, increment.problem)


def preflight(kinematics: IndenterKinematics) -> Iterator[str]:
    """Yield a warning if the indenter touches nothing, or overlaps the whole zone, on the undeformed body.

    There is no warning where the indenter moves freely until it touches, or where the case continues an earlier run. An
    overlap of the whole zone is not reported where full contact is intended, as with flat punches and periodic
    surfaces, nor is a missing contact where the laws act across the gap.
    """
    case = kinematics.case
    if case.restart is not None:
        return
    held = [kinematics.increment(*plan) for plan in _plan(kinematics) if not kinematics.moves_freely(plan[0])]
    for increment in held:
        gap = increment.problem.gap
        if gap.max() < 0.0 and not overlaps_evenly(gap) and not case.formulation.is_periodic():
            yield (
                f"the indenter overlaps the undeformed body on the whole contact zone {case.zone!r}, by "
                f"{-gap.max():.3g} to {-gap.min():.3g} m, at an approach of {_approach(increment):.3g} m: the contact "
                "will reach the boundary of the zone. Unless full contact is intended, the zone is too small or the "
                "approach too large"
            )
            return
    across = any(channel.law.across_gap and channel.is_conducting for channel in case.channels)
    if across or is_adhesive(case.contact_law) or len(held) < len(case.steps):
        return
    nearer = min(held, key=lambda increment: float(increment.problem.gap.min()))
    nearest, deepest = float(nearer.problem.gap.min()), _approach(nearer)
    if nearest < 0.0:
        return
    if nearest == 0.0:
        yield f"at an approach of {deepest:.3g} m the indenter only touches the undeformed body, without pressure"
        return
    yield (
        f"the indenter does not touch the undeformed body: at an approach of {deepest:.3g} m it stays {nearest:.3g} m "
        f"or more from the nodes of the contact zone {case.zone!r}{_outside_zone(case)}"
    )


def other_period(kinematics: IndenterKinematics) -> Iterator[str]:
    """Yield a warning if the period of a surface, or the size of a height map, is not that of the periodic zone."""
    case, system = kinematics.case, kinematics.system
    shape = grid_shape(system.cells, len(system.points))
    is_aligned = case.placement.rotation == 0.0 and np.array_equal(case.placement.base, np.eye(3))
    if not case.formulation.is_periodic() or shape is None or not is_aligned:
        return
    surface = topography_of(case.indenter)
    if surface is None:
        return
    nodes = np.ptp(extreme_points(system.points)[:, :2], axis=0)
    beyond = (np.array([axis[0] + 1.5 * np.ptp(axis)]) for axis in (surface.x, surface.y))
    repeats = surface.is_periodic and bool(np.isfinite(case.indenter.height(*beyond)).all())
    for name, extent, count, axis in zip("xy", nodes, shape, (surface.x, surface.y), strict=True):
        period, length = float(extent * count / (count - 1)), float(np.ptp(axis))
        size = length * len(axis) / (len(axis) - 1)
        # the last points of a measured period may repeat the first ones
        smallest = size if surface.is_periodic else length
        number = max(round(period / size), 1) if repeats else 1
        if not (1.0 - _PERIOD_TOLERANCE) * number * smallest <= period <= (1.0 + _PERIOD_TOLERANCE) * number * size:
            what = "period of the surface" if surface.is_periodic else "size of the height map"
            yield (
                f"the {what} along {name} is {size:.6g} m, but the period of the contact zone {case.zone!r} is "
                f"{period:.6g} m, {count} spacings of its nodes: the surface jumps, or is missing, at the border"
            )


def unused_potentials(kinematics: IndenterKinematics) -> Iterator[str]:
    """Yield a warning for each potential of the indenter that has no effect because the contact insulates."""
    bases = [kinematics.base(controls, here) for controls, here, _ in _plan(kinematics)]
    for channel in kinematics.case.channels:
        if channel.is_conducting:
            continue
        field = channel.field
        potential = kinematics.case.motions.columns[field.value_name]
        largest = max(float(np.abs(base[potential]).max()) for base in bases)
        if largest > 0.0:
            yield (
                f"{field.value_name} of {largest:.3g} {field.value_unit} has no effect: the contact insulates "
                f"unless [conductivity.{field.name}] names a conducting law"
            )


def _approach(increment: Increment) -> float:
    return float(increment.base[RIGID_MOTIONS["approach"]][0])


def _outside_zone(case: CaseData) -> str:
    """Return words stating that the lowest point of the indenter lies outside the contact zone, '' if it does not."""
    points = find_contact_zone(case.mesh, case.zone).points
    x, y, _ = case.placement.lowest(points)
    (least_x, least_y), (most_x, most_y) = (end(points @ case.placement.base[:2].T, axis=0) for end in (np.min, np.max))
    if least_x <= x <= most_x and least_y <= y <= most_y:
        return ""
    return (
        f". Its lowest point, at x = {x:.3g} m and y = {y:.3g} m, lies outside that zone, which extends from "
        f"x = {least_x:.3g} to {most_x:.3g} m and from y = {least_y:.3g} to {most_y:.3g} m"
    )


def overlaps_evenly(gap: Array) -> bool:
    """Return whether the overlap is the same at all nodes, as in intended full contact; gap: (n,) [m]."""
    return bool(np.ptp(gap) <= _OVERLAP_TOLERANCE * -gap.min())
