"""Frozen records of a result: what is written to and read from the result file, and all that reports ever see."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from meeframe.core.contact import Status
from meeframe.core.fields import ELECTRIC, MAGNETIC, Array
from meeframe.core.formulation import NodalFields
from meeframe.core.mesh import Indices


class RunStatus(StrEnum):
    """How a run as a whole stands."""

    CONVERGED = "converged"
    NOT_CONVERGED = "not-converged"
    UNFINISHED = "unfinished"


@dataclass(frozen=True, eq=False)
class Zone:
    """The contact zone: points (n, 3) [m], frames (n, 3, 3), weights (n,) [m^2] and cells as in ReducedSystem."""

    points: Array
    frames: Array
    weights: Array
    cells: tuple[tuple[str, Indices], ...]


@dataclass(frozen=True)
class Loading:
    """What one load step prescribes to the indenter.

    approach: along its axis into the body [m]; translation: in the plane across its axis [m];
    electric_potential [V], magnetic_potential [A]: of its surface, where the laws conduct.
    """

    approach: float
    translation: tuple[float, float] = (0.0, 0.0)
    electric_potential: float = 0.0
    magnetic_potential: float = 0.0


@dataclass(frozen=True, eq=False)
class StepResult:
    """One load step.

    initial_gap: (n,) gap between the undeformed body and the indenter in its position at this step [m], inf where there
    is none above; traction: (n, 3) along e1, e2, nu [Pa], the last <= 0 in compression; displacement: (n, 3) along e1,
    e2, nu [m]; potentials: (n, 2) electric [V] and magnetic [A]; fluxes: (n, 2) electric [C/m^2] and magnetic [Wb/m^2],
    outward; closed: (n,) as in ContactState; iterations, residual, history, message as in ContactSolution; boundary:
    fields on the whole boundary.
    """

    loading: Loading
    initial_gap: Array
    traction: Array
    displacement: Array
    potentials: Array
    fluxes: Array
    closed: Array
    status: Status
    iterations: int
    residual: float
    history: Array
    message: str
    boundary: NodalFields | None = None

    @property
    def gap(self) -> Array:
        """Gap between the deformed body and the indenter, (n,) [m] (eq. 10)."""
        gap: Array = self.initial_gap - self.displacement[:, 2]
        return gap


@dataclass(frozen=True, eq=False)
class Resultants:
    """Numbers that sum a step up; see `resultants`."""

    force: Array
    charge: float
    magnetic_flux: float
    contact_area: float
    max_pressure: float
    max_abs_electric_potential: float
    max_abs_magnetic_potential: float


def resultants(zone: Zone, step: StepResult) -> Resultants:
    """Resultants and maxima over the contact zone.

    force: (3,) on the body, global axes [N]; charge [C] and magnetic_flux [Wb]: integrals of the outward fluxes;
    contact_area: sum over the elements of their area times the share of their nodes in compression [m^2] (the weights
    of nodes will not do: those of quad8's corners are negative, those of tri6's zero); max_pressure [Pa]; largest
    absolute potentials of the body's surface in the contact zone [V], [A].
    """
    pressure = 0.0 - step.traction[:, 2]  # and not a mere sign change, which would make -0.0 of 0.0
    electric, magnetic = (np.abs(step.potentials[:, i]) for i in range(2))
    return Resultants(
        force=zone.weights @ np.einsum("na,nai->ni", step.traction, zone.frames),
        charge=float(zone.weights @ step.fluxes[:, 0]),
        magnetic_flux=float(zone.weights @ step.fluxes[:, 1]),
        contact_area=_contact_area(zone, pressure > 0.0),
        max_pressure=float(pressure.max()),
        max_abs_electric_potential=float(electric.max()),
        max_abs_magnetic_potential=float(magnetic.max()),
    )


def corners(cells: tuple[tuple[str, Indices], ...]) -> list[Indices]:
    """Corner nodes of cells (meshio's types, as in Zone), (e, 3 or 4) for each block."""
    return [nodes[:, : 3 if name.startswith("triangle") else 4] for name, nodes in cells]


def _contact_area(zone: Zone, compressed: NDArray[np.bool_]) -> float:
    areas, shares = [], []
    for (_, nodes), outline in zip(zone.cells, corners(zone.cells), strict=True):
        points = zone.points[outline]
        centred = points - points.mean(axis=1, keepdims=True)
        areas.append(np.linalg.norm(np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1), axis=1) / 2)
        shares.append(compressed[nodes].mean(axis=1))
    area = np.concatenate(areas)
    # straight sides miss a little of curved elements: the whole zone in contact has its whole area
    return float(area @ np.concatenate(shares) * (zone.weights.sum() / area.sum()))


@dataclass(frozen=True)
class Provenance:
    """What made a result: title and verbatim text of the case, versions of the software by name, threads used."""

    title: str
    case_text: str
    versions: Mapping[str, str]
    threads: int


@dataclass(frozen=True, eq=False)
class Result:
    """A run: its zone and its finished steps.

    planned_steps: how many steps the case asks for; timings: seconds by stage; peak_memory_mb: of the process.
    """

    provenance: Provenance
    zone: Zone
    planned_steps: int
    steps: tuple[StepResult, ...] = ()
    timings: Mapping[str, float] = field(default_factory=dict)
    peak_memory_mb: float = 0.0

    @property
    def status(self) -> RunStatus:
        """CONVERGED only if every planned step did."""
        if any(step.status is not Status.CONVERGED for step in self.steps):
            return RunStatus.NOT_CONVERGED
        return RunStatus.CONVERGED if len(self.steps) == self.planned_steps else RunStatus.UNFINISHED


def split_load(load: Array) -> tuple[Array, Array]:
    """Tractions (n, 3) and outward fluxes (n, 2) of a load (n, 5)."""
    return load[:, :3], load[:, [ELECTRIC, MAGNETIC]]


def split_displacement(displacement: Array) -> tuple[Array, Array]:
    """Displacements (n, 3) and potentials (n, 2), in their physical sign, of a reduced system's displacement (n, 5)."""
    return displacement[:, :3], -displacement[:, [ELECTRIC, MAGNETIC]]
