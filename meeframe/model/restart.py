"""Continuing the converged state of an earlier run."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from meeframe.common.errors import CaseError, ResultError
from meeframe.contact.problem import Status
from meeframe.fields import Array
from meeframe.indenters.base import RIGID_MOTIONS
from meeframe.mesh import ContactZone, FrictionAxes
from meeframe.model.frames import frames_along
from meeframe.results.files import read_result
from meeframe.results.records import StepResult
from meeframe.results.schema import nodal_fields
from meeframe.system.reduced import ReducedSystem

_COINCIDENCE_TOLERANCE: Final = 1e-9
"""Distance below which points coincide, as a fraction of the extent of the contact zone."""
_SAME_AXES: Final = 1e-6
"""Difference of components of unit vectors below which frames coincide."""
_SAME_BODY: Final = 1e-6
"""Allowed relative misfit of a state's displacement in the body that continues it."""


@dataclass(frozen=True, eq=False)
class Restart:
    """Converged increment to continue.

    source: its origin, in words; points: (n, 3) of its zone [m]; frames: (n, 3, 3) there, along the friction axes.
    """

    source: str
    points: Array
    frames: Array
    step: StepResult


def read_restart(folder: Path, source: str = "") -> Restart:
    """Return the last converged increment of a run; source: by default its folder.

    Raises ResultError if there is no result in the folder or if that of the increment is not finite, CaseError if
    nothing in it converged.
    """
    result = read_result(folder)
    converged = [step for step in result.steps if step.status is Status.CONVERGED]
    if not converged:
        raise CaseError(f"no increment of the run in {folder} converged; allowed: a run with a converged increment")
    _check_finite(folder, converged[-1])
    return Restart(source or str(folder), result.zone.points, result.zone.frames, converged[-1])


def _check_finite(folder: Path, step: StepResult) -> None:
    """Raise ResultError if a number that a later run continues from is not finite, as in a damaged file."""
    loading = step.loading
    names = {field.attribute for field in nodal_fields(step.fields)} - {"", "initial_gap"}  # which may be infinite
    continued = {name: getattr(step, name) for name in sorted(names)}
    continued |= {name: getattr(loading, name) for name in RIGID_MOTIONS}
    continued |= {**loading.scalars, **loading.prescribed, "travel": loading.travel}
    for name, values in continued.items():
        if not np.isfinite(values).all():
            raise ResultError(
                f"{folder}: {name} of step {step.step}, increment {step.increment} is not finite; allowed: finite "
                "numbers in an increment to continue"
            )


def check_same_zone(restart: Restart, zone: ContactZone, axes: FrictionAxes | None) -> None:
    """Raise CaseError unless the earlier run had the same contact zone and friction axes."""
    if len(restart.points) != len(zone.points):
        raise CaseError(
            f"the contact zone of that run has {len(restart.points)} points, this one {len(zone.points)}; "
            "allowed: the same contact zone"
        )
    distance = float(np.abs(restart.points - zone.points).max())
    if distance > _COINCIDENCE_TOLERANCE * np.ptp(zone.points, axis=0).max():
        raise CaseError(
            f"the contact zone of that run has points up to {distance:.3g} m away from those here; "
            "allowed: the same contact zone"
        )
    frames = frames_along(zone, axes)
    if np.abs(restart.frames - frames).max() > _SAME_AXES:
        cosines = np.einsum("ni,ni->n", restart.frames[:, 0], frames[:, 0])
        raise CaseError(
            "the local axis e1 of that run differs on the contact zone by up to "
            f"{np.rad2deg(np.arccos(np.clip(cosines.min(), -1.0, 1.0))):.3g} deg; allowed: the same [contact] axes"
        )


def check_same_body(restart: Restart, system: ReducedSystem) -> None:
    """Raise CaseError unless the load of the earlier run's state causes its displacement in this body."""
    state = restart.step.state
    expected = system.offset + system.apply(state.load)
    local_response = np.einsum("nJK,nK->nJ", np.abs(system.diagonal_blocks()), np.abs(state.load))
    size = np.maximum(np.abs(expected), local_response).max(
        axis=0
    )  # local_response: a scale also for a field that is zero but for round-off
    missed, covered = np.abs(state.displacement - expected), restart.step.area_fraction
    if covered is not None and not covered.all():  # nodes at a resolved edge respond more to their own load
        missed = missed[covered == 0.0]
    worst = float((missed.max(axis=0) / np.where(size > 0.0, size, 1.0)).max())
    if not worst <= _SAME_BODY:
        raise CaseError(
            f"{restart.source}: the loads of that run cause other displacements in this body, by {worst:.2g} of their "
            "size; allowed: the same material, mesh, boundary conditions and formulation"
        )
