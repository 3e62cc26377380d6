"""Solution of the study of a rough surface: one reduced system for all mean pressures."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from meeframe.contact.problem import Status
from meeframe.fields import Array
from meeframe.laws.base import ConductivityLaw
from meeframe.model.case import Case
from meeframe.model.solve import reduce, solve_steps
from meeframe.results.records import StepResult, zone_of
from meeframe.results.result import Interrupted
from meeframe.study.rough.declare import PERFECT, RoughStudy, conductor
from meeframe.study.rough.quantities import QUANTITIES, Contact, is_full, per_drop, stiffness
from meeframe.study.rough.theory import bush_gibson_thomas_area, persson_area
from meeframe.system.reduced import Progress, ReducedSystem, silent

MIN_DIFFERENCE: Final = 1e-4
"""Half the relative difference of the two pressures between which the stiffness is computed, if they are accurate."""
MIN_YIELDING_NODES: Final = 20
"""Half that difference, in nodes at the largest pressure that a contact law bears.

Where a load that a few nodes bear closes none of them, the stiffness of a discrete surface jumps from node to node.
"""
MAX_DIFFERENCE: Final = 0.1
"""Largest half difference of the pressures, with which the stiffness is accurate to about a per cent."""


@dataclass(frozen=True, eq=False)
class RoughResult:
    """Result of the study of a rough surface.

    Attributes
    ----------
    study : RoughStudy
        The study.
    values : dict of str to Array
        Quantities by name, one value for each finished pressure, nan where the increments that they follow from did not
        converge; those that the study does not ask for are absent.
    status : tuple of str
        Status of each finished pressure: of the first of its increments that did not converge.
    message : tuple of str
        Message of that increment, "" if all converged.
    nodal_pressure : Array
        Pressure at the nodes (nx, ny) at the last finished pressure [Pa], empty if there is none, nan if it did not
        converge.
    """

    study: RoughStudy
    values: dict[str, Array]
    status: tuple[str, ...]
    message: tuple[str, ...]
    nodal_pressure: Array = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def pressures(self) -> Array:
        """Mean pressures that are finished, (m,) [Pa]."""
        return self.study.pressures[: len(self.status)]

    @property
    def is_converged(self) -> bool:
        """True if all pressures are finished and converged."""
        return len(self.status) == len(self.study.pressures) and set(self.status) == {Status.CONVERGED.value}


@dataclass(frozen=True, eq=False)
class _Point:
    """Quantities at one pressure, with the first increment that did not converge, and nodal pressures."""

    values: dict[str, float]
    failed: StepResult | None
    nodal_pressure: Array


def solve_rough(
    study: RoughStudy, progress: Progress = silent, finished: Callable[[RoughResult], None] = lambda _result: None
) -> RoughResult:
    """Solve a study in memory.

    Parameters
    ----------
    study : RoughStudy
        The study.
    progress : callable, optional
        Function that is called with the name of a stage and the fraction of it that is done.
    finished : callable, optional
        Function that is called after each pressure but the last, with the result so far.

    Returns
    -------
    RoughResult
        Quantities of all pressures. An increment that does not converge raises nothing.

    Raises
    ------
    Interrupted
        After Ctrl-C while pressures are solved, with those that are finished.
    MeeframeError
        If the formulation, the solver or a law does not accept the case.
    """
    points: list[_Point] = []
    solution = _Solution(study, progress)
    try:
        for point in solution.points():
            points.append(point)
            if len(points) < len(study.pressures):
                finished(_collect(study, points))
    except KeyboardInterrupt:
        raise Interrupted(_collect(study, points)) from None
    return _collect(study, points)


class _Solution:
    """The increments of a study: of the pressures, of currents, without potential, and of pressures close by."""

    def __init__(self, study: RoughStudy, progress: Progress) -> None:
        self._study, self._progress = study, progress
        self._periodic = study.surface.is_periodic
        self._height = float(np.abs(study.surface.heights - study.surface.heights.mean()).max())
        self._system = reduce(study.case, progress)
        self._zone = zone_of(self._system)
        self._done, table = 0, study.table
        self._has_charge = table.electric_potential is not None or (study.is_coupled and bool(table.conductivity))
        self._has_reference = bool(table.electric_potential) and study.is_coupled
        self._has_current = table.electrical_conductivity is not None
        per_pressure = 1 + self._has_reference + self._has_current + 2 * table.stiffness
        self._planned = per_pressure * len(study.pressures)

    def points(self) -> Iterator[_Point]:
        """Yield the quantities of one pressure after the other."""
        study, case = self._study, self._study.case
        charged = _at_potential(case, study.table.electric_potential or 0.0)
        # without a potential, fluxes are zero unless the pressure causes them
        insulated = replace(case, conductivity={}, potentials={})
        main = self._steps(charged if self._has_charge else insulated, self._system)
        reference = self._steps(_at_potential(case, 0.0), self._system) if self._has_reference else None
        current = self._currents(self._current_case()) if self._has_current else None
        nearby = self._steps(self._nearby(), self._system) if study.table.stiffness else None
        for pressure in study.pressures:
            steps = {"main": next(main)}
            contact = self._contact(steps["main"])
            values = self._mechanical(contact, pressure)
            if self._has_charge:
                values["charge_density"] = contact.charge_density
            if reference is not None:
                steps["reference"] = next(reference)
            if study.table.electric_potential:
                unloaded = self._contact(steps["reference"]) if reference else None
                values["capacitance"] = per_drop(
                    contact, unloaded, self._has_drop(contact, case.conductivity["electric"])
                )
            if current is not None:
                steps["current"] = next(current)
                conducting = self._contact(steps["current"])
                values["conductance"] = per_drop(conducting, has_drop=self._has_drop(conducting, study.current_law))
            if nearby is not None:
                steps |= {"below": next(nearby), "above": next(nearby)}
                pair = self._contact(steps["below"]), self._contact(steps["above"])
                values["stiffness"] = stiffness(*pair, self._periodic, self._height)
            failed = next((step for step in steps.values() if step.status is not Status.CONVERGED), None)
            main_pressure = -steps["main"].traction[:, 2]
            is_known = steps["main"].status is Status.CONVERGED
            yield _Point(values, failed, main_pressure if is_known else np.full_like(main_pressure, np.nan))

    def _mechanical(self, contact: Contact, pressure: float) -> dict[str, float]:
        """Return the quantities that every study has, with the theories of the area."""
        relative = np.array(pressure / self._study.pressure_scale)
        return {
            "area_fraction": contact.area_fraction,
            "mean_gap": contact.mean_gap,
            "separation": contact.separation,
            "approach": contact.approach,
            "max_pressure": contact.max_pressure,
            "persson_area": float(persson_area(relative)),
            "bush_gibson_thomas_area": float(bush_gibson_thomas_area(relative)),
        }

    def _has_drop(self, contact: Contact, law: ConductivityLaw) -> bool:
        """Return whether potentials differ across the contact, as they do but in perfect contact of a whole period."""
        return not (self._periodic and law == PERFECT and is_full(contact, self._height))

    def _contact(self, step: StepResult) -> Contact:
        return Contact.of(self._zone, step, self._periodic)

    def _steps(self, case: Case, system: ReducedSystem) -> Iterator[StepResult]:
        """Yield the increments of a case, each when it is asked for."""
        self._progress("pressures", 0.0)
        for step in solve_steps(case, system, silent, boundary=False):
            self._done += 1
            self._progress("pressures", self._done / self._planned)
            yield step

    def _current_case(self) -> Case:
        """Return the case at one volt of a body in which electric fields represent currents."""
        study = self._study
        assert study.table.electrical_conductivity is not None
        material = conductor(study.case.material, study.table.electrical_conductivity)
        laws = {"electric": study.current_law}
        return _at_potential(replace(study.case, material=material, conductivity=laws), 1.0)

    def _currents(self, case: Case) -> Iterator[StepResult]:
        """Yield the increments of currents, whose system is reduced when the first one is asked for."""
        yield from self._steps(case, reduce(case))

    def _nearby(self) -> Case:
        """Return the case of pressures just below and above those of the study; insulated unless charges matter.

        Where the contact law cannot bear the pressure above, that of the study takes its place.
        """
        case = self._study.case
        charged = self._has_charge and self._study.is_coupled
        steps = [
            replace(step, normal_force=step.normal_force * factor)
            for pressure, step in zip(self._study.pressures, case.steps, strict=True)
            if step.normal_force is not None
            for factor in self._factors(float(pressure))
        ]
        if charged:
            return _at_potential(replace(case, steps=tuple(steps)), self._study.table.electric_potential or 0.0)
        return replace(case, steps=tuple(steps), conductivity={}, potentials={})

    def _factors(self, pressure: float) -> tuple[float, float]:
        """Return the ratios to a mean pressure of the pressures just below and above it."""
        bound, accurate = self._study.bound, math.sqrt(self._study.case.stopping.tolerance)
        yielding = MIN_YIELDING_NODES * bound / (pressure * self._study.surface.heights.size) if bound < np.inf else 0.0
        difference = max(MIN_DIFFERENCE, accurate, min(yielding, MAX_DIFFERENCE))
        return 1.0 - difference, 1.0 + difference if pressure * (1.0 + difference) < bound else 1.0


def _at_potential(case: Case, potential: float) -> Case:
    """Return the case with this potential of the surface."""
    return replace(case, potentials={**case.potentials, "electric_potential": potential})


def _collect(study: RoughStudy, points: list[_Point]) -> RoughResult:
    names = [name for name in QUANTITIES if points and name in points[0].values]
    values = {name: np.array([point.values[name] for point in points]) for name in names}
    failed = [point.failed for point in points]
    status = tuple(Status.CONVERGED.value if step is None else step.status.value for step in failed)
    message = tuple("" if step is None else step.message for step in failed)
    last = points[-1].nodal_pressure if points else np.empty(0)
    nodal = last.reshape(study.surface.shape) if points else np.empty((0, 0))
    return RoughResult(study, values, status, message, nodal)
