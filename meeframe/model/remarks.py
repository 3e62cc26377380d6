"""What the message of an increment adds to how its iteration ended."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.contact.problem import Status
from meeframe.fields import Array, Indices
from meeframe.indenters.base import RIGID_MOTIONS, RIGID_RESULTANTS, IndenterMotions, motion_modes
from meeframe.laws.base import ContactLaw, augmented_traction, fixed_point_map
from meeframe.results.records import Region, StepResult, Zone

_LARGEST_ANGLE: Final = 0.1
"""Rotations [rad] beyond are not small: their cosine differs from one by half a per cent."""
_SAME: Final = 1e-6
"""Tractions that change by a smaller fraction are the same ..."""
_UNCERTAIN: Final = 10.0
"""... as are those within so many times the residual."""
_LARGEST_ARRIVAL: Final = 0.25
"""Fraction of the nodes in contact that may come into it within one increment: of a sphere tangential tractions are
then within some per cent (docs/case-files.md)."""
_NOTICED: Final = 1e-3
"""Tangential over normal tractions below which there are none, and gaps over displacements."""
_COARSE: Final = 0.1
"""Fraction of the contact area from which on a reader should know that it is uncertain."""
_OF_RIM: Final = 0.5
"""Times the share of a contact's nodes that are at its rim, to the power 3/2: no less than the error in the area of
circles six or more spacings across."""


def remarks(zone: Zone, step: StepResult, law: ContactLaw, sides: int = 0, distant: bool = False) -> Iterator[str]:
    """What a reader should know of an increment, each in words.

    law: that of the increment; sides: how many at the edge of the zone the contact has reached; distant: it is told
    elsewhere that the indenter stays away, and how far.

    What follows if it did not converge. Otherwise: nothing touches; the contact reaches the edge of its zone, where it
    is cut off; the indenter has moved further than the theory of small motions holds, by more than the extent of the
    zone or a tenth of a radian; a prescribed tangential force or torque is all that friction can bear, so that the
    motion is not determined.
    """
    if step.status is not Status.CONVERGED:
        yield "the next increment starts from the last one that converged"
        return
    if not step.touching.any() and not distant:
        yield "the indenter does not touch the body"
    if sides:
        yield f"the contact reaches the edge of its zone at {sides} element side{'s' * (sides > 1)}"
    yield from _large(zone, step)
    if _slides(zone, step, law):
        yield "everything slips under the prescribed force or torque: how far beyond where that began is undetermined"


@dataclass(frozen=True, eq=False)
class Arrivals:
    """Which increment of a load step brought each node into the contact that it is in.

    gap: (n,) in the last converged state [m]; touching: (n,) whether it touches there; number: (n,) of the increment in
    which it came to, from 1, 0 where it touched before the load step or does not.
    """

    gap: Array
    touching: NDArray[np.bool_]
    number: Indices

    @classmethod
    def of(cls, gap: Array, touching: NDArray[np.bool_]) -> "Arrivals":
        """At the beginning of a load step."""
        return cls(gap, touching, np.zeros(len(gap), np.int64))

    def after(self, step: StepResult) -> "Arrivals":
        """After another increment; itself if that did not converge. Nodes between which nothing opened are not new."""
        if step.status is not Status.CONVERGED:
            return self
        apart = self.gap > _NOTICED * np.abs(step.displacement[:, 2]).max()
        number = np.where(self.touching | ~apart, self.number, step.increment)
        return Arrivals(step.gap, step.touching, np.where(step.touching, number, 0))


def remarks_on_end(zone: Zone, step: StepResult, law: ContactLaw, arrivals: Arrivals) -> Iterator[str]:
    """What a reader should know at the end of a load step, each in words; arrivals: after its last increment.

    That much of the contact came about within one increment, if it has friction that matters: slip counts from the
    increment's beginning, before those nodes touched. That the contact is so few nodes across that its area is
    uncertain.
    """
    if step.status is not Status.CONVERGED or not step.touching.any():
        return
    count, rim = int(step.touching.sum()), _rim(zone, step)
    new = np.bincount(arrivals.number, minlength=2)[1:]
    late = arrivals.number == 1 + new.argmax()
    shear, pressure = (np.linalg.norm(part) for part in (step.traction[late, :2], step.traction[late, 2]))
    # on coarse meshes nodes that are equally far come at once, whatever the increments
    much = new.max() > max(_LARGEST_ARRIVAL * count, rim / 2)
    if law.tangential_scaling().any() and much and shear > _NOTICED * pressure:
        yield (
            f"{new.max() / count:.0%} of the contact came about in one increment, and its slip counts from before it "
            "touched: more `increments` follow the history, with less slip"
        )
    uncertain = _OF_RIM * (rim / count) ** 1.5
    if uncertain > _COARSE:
        nodes = "one node" if count == 1 else f"{count} nodes, {rim} of them at its rim"
        yield f"the contact has {nodes}: its area is known to about {uncertain:.0%}, more divisions resolve it"


def _rim(zone: Zone, step: StepResult) -> int:
    """Nodes in contact that share an element with one that is not."""
    beside = np.zeros(len(step.touching), bool)
    for _, nodes in zone.cells:
        beside[nodes[~step.touching[nodes].all(axis=1)]] = True
    return int((step.touching & beside).sum())


def _large(zone: Zone, step: StepResult) -> Iterator[str]:
    """Yield rigid motions that are not small, in words."""
    limits = {"m": float(np.ptp(zone.points, axis=0).max()), "rad": _LARGEST_ANGLE}
    for name in RIGID_MOTIONS:
        size = float(np.linalg.norm(np.atleast_1d(getattr(step.loading, name))))
        unit = IndenterMotions().units[name]
        if size > limits.get(unit, np.inf):
            yield f"{name} of {size:.3g} {unit}: beyond small motions, {limits[unit]:.3g} {unit}"


def _slides(zone: Zone, step: StepResult, law: ContactLaw) -> bool:
    """Whether the friction resists a free motion in the plane of the contact to the full: the tractions stay as they
    are, by the law, when everything slips further along it."""
    columns = IndenterMotions().columns
    prescribed = [columns.get(key) for key in step.loading.prescribed]
    free = [key for key in ("tangential_force", "torque") if RIGID_RESULTANTS[key] in prescribed]
    slips = step.region == Region.SLIP
    if not free or not slips.any() or not law.tangential_scaling().any():
        return False
    numbers = np.concatenate([np.r_[RIGID_RESULTANTS[key]] for key in free])
    modes = motion_modes(zone.points, zone.frames, step.loading.axes, step.loading.reference)[numbers, :, :2]
    modes = modes / np.linalg.norm(modes, axis=(1, 2), keepdims=True)
    way = np.linalg.norm(step.slip, axis=1)
    along = step.slip / np.where(way > 0.0, way, 1.0)[:, None]
    # the free motion that is least across the slip
    across = np.einsum("knt,nt->nk", modes[:, slips], along[slips, ::-1] * [-1.0, 1.0])
    motion = np.einsum("knt,k->nt", modes, np.linalg.svd(across)[2][-1])
    motion *= np.copysign(1.0, (motion * along)[slips].sum()) / np.abs(motion).max()
    # far enough to turn what slips the other way
    distance = 2.0 * max(np.abs(step.slip).max(), np.abs(step.displacement).max())
    r = (float(np.abs(step.traction).max() / distance),) * 2
    gap = np.column_stack([step.slip + distance * motion, step.gap])
    further = fixed_point_map(law, augmented_traction(law, step.traction, gap, r), gap, r)
    change = np.linalg.norm((further - step.traction)[step.touching])
    return bool(change <= max(_SAME, _UNCERTAIN * step.residual) * np.linalg.norm(step.traction[step.touching, :2]))
