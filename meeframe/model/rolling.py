"""Rolling of a contact over the surface: its keys in a load step, and the history of one increment."""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.indenters.base import RIGID_MOTIONS
from meeframe.model.history import Controls, ConvergedState
from meeframe.results.records import RollingMotion
from meeframe.system.rolling import CellShift

MAX_CELLS: Final = 10_000
"""Largest number of cells over which one load step rolls."""
SLIDING: Final = (1.0, 0.0)
"""Creepages of an indenter that moves over the body as far as the contact."""
_MAX_NORMAL_COMPONENT: Final = 1e-9
"""Largest component across the zone of a direction in it."""
_MAX_CYCLES: Final = 1e15
"""Largest number of cycles of wear, beyond any lifetime."""
_FINITE: Final = {"gt": -math.inf, "lt": math.inf}
Number = Annotated[float, Quantity("", **_FINITE)]


def is_normal_to(frames: Array, base: Array) -> bool:
    """Return whether the axis of an indenter, with axes (3, 3), is normal to a zone with local frames (n, 3, 3)."""
    return bool(np.abs(frames @ base[2] - [0.0, 0.0, 1.0]).max() <= _MAX_NORMAL_COMPONENT)


@dataclass(frozen=True)
class Rolling:
    """Rolling of the contact over the surface in a load step.

    Attributes
    ----------
    direction : tuple of float
        Direction in which the contact moves relative to the material, along e1 and e2 of the indenter's axes. It is
        along an axis of the grid; its length does not matter.
    distance : float, optional
        Rolled distance [m], rounded to whole cells; needed unless the state is steady.
    creepage : tuple of float, optional
        Longitudinal and lateral creepage: rigid slip of the indenter over the body per rolled distance, along the
        direction and across it, to the left as seen against the indenter's axis. By default the tangential force or the
        translation of the indenter remain prescribed as before.
    spin : float, optional
        Rotation of the indenter relative to the body per rolled distance, right-handed about its axis [1/m].
    speed : float, optional
        Rolling speed [m/s], in place of the duration of the load step.
    steady : bool, optional
        True for the state that repeats from cell to cell.
    cycles : float, optional
        Number of times, at most 1e15, that every particle of the surfaces passes through the steady contact, which
        wears them in each passage. By default nothing wears in steady rolling.
    wear_tolerance : float, optional
        Largest estimated error in the extrapolation of wear over many cycles, as a fraction of the worn depth.

    Raises
    ------
    CaseError
        If a number is not finite, the direction is zero, not exactly one of distance and steady is given, or
        cycles are given without steady.
    """

    direction: tuple[Number, Number] = (1.0, 0.0)
    distance: Annotated[float, Quantity("m", gt=0, lt=math.inf)] | None = None
    creepage: tuple[Number, Number] | None = None
    spin: Annotated[float, Quantity("1/m", **_FINITE)] = 0.0
    speed: Annotated[float, Quantity("m/s", gt=0, lt=math.inf)] | None = None
    steady: bool = False
    cycles: Annotated[float, Quantity("", gt=0, le=_MAX_CYCLES)] | None = None
    wear_tolerance: Annotated[float, Quantity("", gt=0, lt=1)] = 0.05

    def __post_init__(self) -> None:
        check_quantities(self)
        for name in ("direction", "creepage"):
            pair = getattr(self, name)
            if pair is not None and (len(pair) != 2 or not np.isfinite(pair).all()):
                raise CaseError(f"{name} = {pair!r}; allowed: two finite numbers")
        if not any(self.direction):
            raise CaseError(f"direction = {self.direction!r}; allowed: a direction that is not zero")
        if not isinstance(self.steady, bool):
            raise CaseError(f"steady = {self.steady!r}; allowed: true or false")
        if self.steady and self.distance is not None:
            raise CaseError("distance and steady are both given; allowed: one of them, steady rolling has no length")
        if self.cycles is not None and not self.steady:
            raise CaseError(f"cycles = {self.cycles:g} without steady = true; allowed: cycles of steady rolling")
        if not self.steady and self.distance is None:
            raise CaseError("distance is missing; allowed: a distance > 0 [m], or steady = true")

    @property
    def axes(self) -> Array:
        """Longitudinal and lateral direction, rows (2, 2) along e1 and e2 of the indenter's axes."""
        along = np.array(self.direction) / math.hypot(*self.direction)
        return np.array([along, [-along[1], along[0]]])

    @property
    def is_sliding(self) -> bool:
        """True if the indenter moves over the body as far as the contact, without spin."""
        return self.creepage == SLIDING and self.spin == 0.0

    def increment(self, points: Array, frames: Array, base: Array, is_periodic: bool) -> "RollingIncrement":
        """Return the rolling by one cell on a contact zone.

        Parameters
        ----------
        points, frames : (n, 3) and (n, 3, 3) arrays
            Nodes [m] and their local frames.
        base : (3, 3) array
            Axes of the indenter.
        is_periodic : bool
            True if the zone is one period of an infinite surface.

        Raises
        ------
        CaseError
            If the zone is no grid with an axis along the direction, or the axis of the indenter is not normal to it.
        """
        if not is_normal_to(frames, base):
            raise CaseError("the axis of the indenter is not normal to the contact zone; allowed: a flat zone below it")
        try:
            shift = CellShift.of(points, frames, self.axes[0] @ base[:2], is_periodic)
        except CaseError as error:
            raise CaseError(f"direction = {self.direction!r}: {error}") from None
        return RollingIncrement(self, shift, base)

    def cells(self, length: float) -> int:
        """Return the number of cells of a length [m] over which the step rolls; raise CaseError if there are too many.

        The distance is rounded to whole cells, at least one.
        """
        if self.distance is None:
            return 1
        count = max(round(self.distance / length), 1)
        if count > MAX_CELLS:
            raise CaseError(
                f"distance = {self.distance:g} m: {count} cells of {length:.3g} m; allowed: at most {MAX_CELLS} in one "
                "load step"
            )
        return count


@dataclass(frozen=True, eq=False)
class RollingIncrement:
    """Rolling by one cell: what the material brings along, and what the contact has done when it is over.

    Attributes
    ----------
    rolling
        Rolling of the load step.
    cell_shift
        Shift by one cell.
    base
        Axes of the indenter, (3, 3).
    """

    rolling: Rolling
    cell_shift: CellShift
    base: Array

    @property
    def is_steady(self) -> bool:
        """True for the state that repeats from cell to cell."""
        return self.rolling.steady

    def prescribed(self, start: ConvergedState, cells: int) -> Controls:
        """Return the motions of the indenter after a number of cells from a converged state, by key."""
        distance = cells * self.cell_shift.length
        controls = {"twist": start.value("twist") + distance * self.rolling.spin}
        if self.rolling.creepage is not None:
            way = distance * np.array(self.rolling.creepage) @ self.rolling.axes
            controls["translation"] = start.value("translation") + way
        return controls

    def transport(self, start: ConvergedState, displacement: Array, rigid: Array, motion: Array) -> ConvergedState:
        """Return the state in which the material that is at each node now was one cell before.

        Its total slip is such that the slip of the increment counts from there.

        Parameters
        ----------
        start : ConvergedState
            State before the increment.
        displacement : (n, fields) array
            Displacement in that state, at the nodes [m].
        rigid : (n, 2) array
            Displacement of the indenter in that state, along e1 and e2 [m].
        motion : (motions,) array
            Motions of the indenter after the increment, as far as they are prescribed.
        """
        shift, state = self.cell_shift, start.state
        turn = (motion - start.motion)[RIGID_MOTIONS["twist"]]
        lateral = shift.frames[:, :2] @ (self.rolling.axes[1] @ self.base[:2])
        # the rigid slip of spin is that at the middle of the path, half a cell ahead
        slip = rigid - shift.tangential(displacement[:, :2]) - 0.5 * shift.length * turn * lateral
        if state is not None:
            shifted = shift.values(state.displacement)
            shifted[:, :2] = shift.tangential(state.displacement[:, :2])
            state = replace(state, load=shift.load(state.load), displacement=shifted)
        if self.is_steady:
            return replace(start, total_slip=slip, state=state)
        path = np.where(shift.entering, 0.0, shift.values(start.slip_path))
        return replace(
            start,
            total_slip=slip,
            slip_path=path,
            wear=shift.values(start.wear),
            state=state,
            rolled=start.rolled + shift.length,
            travel=start.travel + shift.length * self.rolling.axes[0],
        )

    def motion(self, start: ConvergedState, end: ConvergedState) -> RollingMotion:
        """Return the rolling of an increment between two states."""
        length, change = self.cell_shift.length, end.motion - start.motion
        return RollingMotion(
            direction=self.rolling.axes[0] @ self.base[:2],
            creepage=self.rolling.axes @ change[RIGID_MOTIONS["translation"]] / length,
            spin=float(change[RIGID_MOTIONS["twist"]][0]) / length,
            cell=length,
            distance=end.rolled,
            cycles=end.cycles,
        )


def friction_work(start: Array, end: Array, slip: Array) -> Array:
    """Return the work of friction (n,) of tractions (n, 2) that change from start to end in a slip (n, 2) [J/m^2]."""
    return np.asarray(0.5 * np.einsum("nt,nt->n", start + end, slip))
