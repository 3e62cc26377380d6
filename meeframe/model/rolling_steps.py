"""Load steps in which the contact rolls: what a case must not have, and their division into cells."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.formulations.base import Formulation
from meeframe.indenters import Placement
from meeframe.indenters.base import Indenter
from meeframe.indenters.topography.height_map import has_topography
from meeframe.laws.base import ContactLaw, has_memory
from meeframe.laws.wear import WearLaw
from meeframe.mesh import ContactZone
from meeframe.model.restart import Restart
from meeframe.model.rolling import Rolling, is_normal_to
from meeframe.model.step import Step
from meeframe.plugin.validation import Problem, TableError

_DEPTH_TOLERANCE: Final = 1e-9
"""Difference of worn depths that counts as none, as a fraction of the largest."""


def check_rolling(
    steps: Sequence[Step],
    indenter: Indenter,
    formulations: Sequence[Formulation],
    law: ContactLaw,
    generated: float,
) -> None:
    """Raise TableError if a case with load steps that roll has a part that does not move with the material.

    Parameters
    ----------
    steps : sequence of Step
        Load steps.
    indenter : Indenter
        Indenter of the case.
    formulations : sequence of Formulation
        Formulations of its body, and of the second one if there is one.
    law : ContactLaw
        Contact law.
    generated : float
        Largest fraction of the work of friction or of a current that heats the body.
    """
    for number, step in enumerate(steps):
        rolling = step.rolling
        for problem in () if rolling is None else _problems(rolling, indenter, formulations, law, generated):
            raise TableError(Problem(("steps", number, "rolling"), problem))


def _problems(
    rolling: Rolling,
    indenter: Indenter,
    formulations: Sequence[Formulation],
    law: ContactLaw,
    generated: float,
) -> Iterator[str]:
    """Yield the problems of rolling in a case, each in words."""
    for formulation in formulations:
        if not formulation.supports_rolling():
            yield (
                f"material cannot move through the contact zone of the formulation {type(formulation).__name__}; "
                "allowed: half spaces on a regular grid with contact edges at the nodes, such as half-space"
            )
        if rolling.spin and formulation.is_periodic():
            yield f"spin = {rolling.spin:g} 1/m on a periodic surface; allowed: 0, as the slip of spin is not periodic"
        if rolling.steady and formulation.is_periodic() and has_memory(law) and not law.needs_duration:
            yield (
                f"steady rolling on a periodic surface with the contact law {type(law).__name__}, which depends on the "
                "path slipped before: it grows in each period; allowed: a distance"
            )
    if has_topography(indenter) and not (rolling.is_sliding and len(formulations) == 1):
        yield (
            f"the heights of the indenter {type(indenter).__name__} do not move with a body that rolls; allowed: a "
            "smooth indenter, or one that slides over a single body, with creepage = [1, 0]"
        )
    if generated:
        yield (
            f"friction_heat or joule_heat = {generated:g} with rolling: heat that material carries through the contact "
            "is not supported; allowed: 0"
        )


def check_surface(
    surface: Indenter | None,
    steps: Sequence[Step],
    zone: ContactZone,
    placement: Placement,
    restart: Restart | None = None,
) -> None:
    """Raise CaseError unless heights that move with the material cover the zone, which is flat, during all steps.

    Parameters
    ----------
    surface : Indenter or None
        Heights; None for a plane.
    steps : sequence of Step
        Load steps.
    zone : ContactZone
        Contact zone.
    placement : Placement
        Placement of the indenter.
    restart : Restart, optional
        State to continue, with the way of the contact over the material.
    """
    if surface is None:
        return
    base = placement.base
    if not is_normal_to(zone.frames, base):
        raise CaseError(
            "heights on a zone that is not flat and normal to the axis of the indenter; allowed: a flat zone"
        )
    at = zone.points @ base[:2].T
    travel = np.zeros(2) if restart is None else restart.step.loading.travel
    corners = np.array(list(product(*zip(at.min(axis=0), at.max(axis=0), strict=True))))
    for number, step in enumerate(steps, 1):
        if step.rolling is not None:
            if step.rolling.steady:
                raise CaseError(
                    f"load step {number} rolls steadily over a surface with heights, which is never steady; allowed: a "
                    "distance"
                )
            travel = travel + (step.rolling.distance or 0.0) * step.rolling.axes[0]
        positions = (at if number == 1 else corners) + travel
        missing = ~np.isfinite(surface.height(*positions.T))
        if missing.any():
            x, y = positions[missing][0]
            raise CaseError(
                f"no height at x = {x:.6g} m, y = {y:.6g} m, which is in the contact zone in load step {number}; "
                "allowed: heights below the whole zone along its way"
            )


def check_profiles(
    steps: Sequence[Step], wear: WearLaw | None, zone: ContactZone, placement: Placement, restart: Restart | None = None
) -> None:
    """Raise TableError if surfaces that wear roll steadily with a depth that varies along the rolling direction.

    Parameters
    ----------
    steps : sequence of Step
        Load steps.
    wear : WearLaw or None
        Wear law.
    zone : ContactZone
        Contact zone.
    placement : Placement
        Placement of the indenter.
    restart : Restart, optional
        State to continue, with the depth worn before.
    """
    if wear is None:
        return
    varying, axes = "", None
    start = np.zeros(len(zone.points)) if restart is None else restart.step.wear
    for number, step in enumerate(steps):
        rolling = step.rolling
        if rolling is None or not rolling.steady:
            if step.sliding != 0.0:
                varying = varying or f"load step {number + 1} wears them in place or in one passage"
            continue
        location = "steps", number, "rolling"
        if start.any() and not varying:
            grid = rolling.increment(zone.points, zone.frames, placement.base, False).cell_shift.grid
            if np.ptp(start[grid], axis=0).max() > _DEPTH_TOLERANCE * start.max():
                varying = "the earlier run wore them in place or in one passage"
        if varying:
            problem = (
                f"steady rolling of surfaces whose worn depth varies along them: {varying}; allowed: before it, steps "
                "with sliding = 0 and steady rolling alone"
            )
            raise TableError(Problem(location, problem))
        if axes is not None and abs(rolling.axes[0] @ axes[0]) < 0.5:
            raise TableError(Problem(location, "a direction across that of earlier cycles; allowed: the same axis"))
        if rolling.cycles is not None:
            axes = rolling.axes


def divide_steps(steps: Sequence[Step], zone: ContactZone, placement: Placement, is_periodic: bool) -> tuple[Step, ...]:
    """Return load steps, those that roll with one increment for each cell.

    Parameters
    ----------
    steps : sequence of Step
        Load steps.
    zone : ContactZone
        Contact zone.
    placement : Placement
        Placement of the indenter.
    is_periodic : bool
        True if the zone is one period of an infinite surface.

    Returns
    -------
    tuple of Step
        The steps; a speed of rolling is the duration of its step.

    Raises
    ------
    TableError
        If a step rolls on a zone, or in a direction, in which material cannot move by cells.
    """
    return tuple(
        step if step.rolling is None else _divide(number, step, step.rolling, zone, placement, is_periodic)
        for number, step in enumerate(steps)
    )


def _divide(
    number: int, step: Step, rolling: Rolling, zone: ContactZone, placement: Placement, is_periodic: bool
) -> Step:
    try:
        length = rolling.increment(zone.points, zone.frames, placement.base, is_periodic).cell_shift.length
        count = rolling.cells(length) if rolling.cycles is None else step.increments
    except CaseError as error:
        raise TableError(Problem(("steps", number, "rolling"), str(error))) from None
    duration = step.duration if rolling.speed is None else count * length / rolling.speed
    return replace(step, increments=count, duration=duration, rolling=replace(rolling, speed=None))
