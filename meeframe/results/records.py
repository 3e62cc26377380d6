"""Frozen records of a result, which are written to and read from the result file and used by all reports."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.memoize import memoize_by_identity
from meeframe.contact.problem import ContactState, Status
from meeframe.contact.scales import largest
from meeframe.fields import MECHANICAL, MEE, POTENTIALS, Array, FieldSet, Indices
from meeframe.indenters.base import N_RIGID, RIGID_MOTIONS
from meeframe.mesh.measures import corners, vector_areas
from meeframe.mesh.regular import Cells, GridCells, global_components
from meeframe.system.reduced import NodalFields, ReducedSystem

_BLOCK: Final = 2**16
"""Number of nodes whose forces are summed at once."""
_WEIGHT_ROUND_OFF: Final = 1e-12
"""Difference of nodal weights that counts as round-off, as a fraction of the largest weight."""


class RunStatus(StrEnum):
    """Status of a run as a whole."""

    CONVERGED = "converged"
    NOT_CONVERGED = "not-converged"
    UNFINISHED = "unfinished"


@dataclass(frozen=True, eq=False)
class Zone:
    """Contact zone: points (n, 3) [m], frames (n, 3, 3), weights (n,) [m^2] and cells as in ReducedSystem."""

    points: Array
    frames: Array
    weights: Array
    cells: Cells

    def __repr__(self) -> str:
        """Return words instead of long arrays."""
        return f"Zone({len(self.points)} nodes)"


def zone_of(system: ReducedSystem) -> Zone:
    """Return the contact zone of a reduced system."""
    return Zone(system.points, system.frames, system.weights, system.cells)


@final
@dataclass(frozen=True, eq=False)
class ZoneFields:
    """Fields on a boundary that is the contact zone alone: as NodalFields, computed from those of the zone when read.

    Attributes
    ----------
    zone : Zone
        Contact zone.
    displacement, traction : Array
        (n, 3), along e1, e2, nu of the zone's frames.
    potentials, scalar_fluxes : Array
        (n, scalars), as in StepResult.
    """

    zone: Zone
    displacement: Array
    potentials: Array
    traction: Array
    scalar_fluxes: Array

    @property
    def points(self) -> Array:
        """Points of the zone, (n, 3) [m]."""
        return self.zone.points

    @property
    def cells(self) -> Cells:
        """Cells of the zone."""
        return self.zone.cells

    @property
    def values(self) -> Array:
        """Extended displacement in global axes, (n, fields)."""
        return np.concatenate([global_components(self.zone.frames, self.displacement), self.potentials], axis=1)

    @property
    def fluxes(self) -> Array:
        """Extended traction in global axes, (n, fields)."""
        return np.concatenate([global_components(self.zone.frames, self.traction), self.scalar_fluxes], axis=1)


class Region(IntEnum):
    """Region of a node of the contact zone."""

    OPEN = 0
    SLIP = 1
    STICK = 2


@dataclass(frozen=True, eq=False)
class RollingMotion:
    """Rolling of the contact over the surface in one increment.

    direction: unit vector in global axes, (3,), along which the contact moves relative to the material; creepage: (2,)
    longitudinal and lateral; spin: [1/m]; cell: rolled distance of the increment [m]; distance: that of all increments
    since the beginning [m]; cycles: of steady rolling since the beginning, in which the surfaces have worn.
    """

    direction: Array
    creepage: Array
    spin: float
    cell: float
    distance: float
    cycles: float = 0.0


@dataclass(frozen=True, eq=False)
class Loading:
    """Position of the indenter in one increment, with the resultants that were prescribed.

    approach: along its axis into the body [m]; translation: (2,) across its axis, along e1 and e2 of its axes [m];
    tilt: (2,) about e1 and e2, twist: about the axis, right-handed [rad]; scalars: the potentials of its surface by
    name, where the laws conduct, such as "electric_potential" [V]; each is an attribute by this name, too. All are
    measured from where the indenter just touched, and are results of the computation where they were free.
    prescribed: by its key in case files, each resultant that was prescribed instead of a motion, (1,) or (2,), SI.
    reference: its lowest point where it just touched, about which it rotates, (3,) in global axes [m]; axes: rows e1,
    e2, axis of the indenter, (3, 3); duration: of the increment, None if its load step names none [s]; rolling: that of
    the increment, None if the contact stays in place; travel: (2,) way of the contact over the material since the
    beginning, along e1 and e2 [m].
    """

    approach: float
    translation: Array = field(default_factory=lambda: np.zeros(2))
    tilt: Array = field(default_factory=lambda: np.zeros(2))
    twist: float = 0.0
    scalars: Mapping[str, float] = field(default_factory=lambda: {scalar.value_name: 0.0 for scalar in MEE.scalars})
    prescribed: Mapping[str, Array] = field(default_factory=dict)
    reference: Array = field(default_factory=lambda: np.zeros(3))
    axes: Array = field(default_factory=lambda: np.eye(3))
    duration: float | None = None
    rolling: RollingMotion | None = None
    travel: Array = field(default_factory=lambda: np.zeros(2))

    @classmethod
    def of(
        cls,
        motion: Array,
        prescribed: Mapping[str, Array],
        reference: Array,
        axes: Array,
        duration: float | None = None,
        fields: FieldSet = MEE,
        rolling: RollingMotion | None = None,
        travel: Array | None = None,
    ) -> "Loading":
        """Return the loading of all motions of an indenter, (motions,), in the order of IndenterMotions."""
        approach, translation, tilt, twist = (motion[columns] for columns in RIGID_MOTIONS.values())
        potentials = zip(fields.scalars, motion[N_RIGID:].tolist(), strict=True)
        scalars = {scalar.value_name: value for scalar, value in potentials}
        rigid = float(approach[0]), translation, tilt, float(twist[0])
        travel = np.zeros(2) if travel is None else travel
        return cls(*rigid, scalars, prescribed, reference, axes, duration, rolling, travel)

    def __getattr__(self, name: str) -> float:
        return _named_scalar(self, name)

    @property
    def motion(self) -> Array:
        """Motions of the indenter, (motions,), in the order of IndenterMotions."""
        rigid = (np.atleast_1d(getattr(self, name)) for name in RIGID_MOTIONS)
        return np.concatenate([*rigid, list(self.scalars.values())])


def _named_scalar(record: "Loading | Resultants", name: str) -> float:
    """Return the value of a scalar field in a record by name; raise AttributeError if there is none."""
    scalars: Mapping[str, float] = record.__dict__.get("scalars", {})
    if name not in scalars:
        raise AttributeError(f"{type(record).__name__} has no attribute {name!r}")
    return scalars[name]


@dataclass(frozen=True, eq=False)
class SecondSurface:
    """Surface of the second body at the nodes of the contact zone, along e1, e2, nu of the zone's frames.

    Both fields are relative to the supports and grounds of the second body, wherever the loading has moved these.

    Attributes
    ----------
    displacement : Array
        Displacement, (n, 3) [m].
    potentials : Array
        Potentials, (n, scalars), SI units.
    """

    displacement: Array
    potentials: Array


@dataclass(frozen=True, eq=False)
class StepResult:
    """Result of one increment of a load step.

    All fields are those of the body unless stated otherwise; n is the number of nodes of the contact zone.

    Parameters
    ----------
    loading : Loading
        Position of the indenter.
    step, increment : int
        Numbers of the load step and of the increment, from 1.
    initial_gap : Array
        (n,), gap between the undeformed, worn body and the indenter in its position at this increment [m], inf where
        there is none above.
    traction : Array
        (n, 3), along e1, e2, nu [Pa]; the last component is <= 0 in compression, > 0 where surfaces attract each other.
    displacement : Array
        (n, 3), along e1, e2, nu [m].
    potentials : Array
        (n, scalars), such as electric [V].
    fluxes : Array
        (n, scalars), outward, such as electric [C/m^2].
    contact_fraction : Array
        (n,), as in ContactState.
    slip, total_slip : Array
        (n, 2), tangential motion of the indenter over the body along e1, e2 since the last converged increment, and
        since the beginning; both also where the contact is open [m].
    slip_path : Array
        (n,), length of the path slipped in contact, the sum of the moduli of the slips of those increments at whose end
        the node touches [m].
    wear : Array
        (n,), depth that both surfaces together have lost to wear since the beginning [m], which the gap includes.
    dissipation : Array
        (n,), work of friction in this increment [J/m^2], see docs/reference/results.md.
    region : Indices
        (n,), numbers of Region.
    status, iterations, residual, history, message
        As in ContactSolution.
    boundary : NodalFields or ZoneFields, optional
        Fields on the whole boundary.
    second_body : SecondSurface, optional
        Surface of the second body, if there is one instead of a rigid indenter.
    area_fraction : Array, optional
        (n,), fraction of each node's area that is in contact if it touches, where the contact edge is resolved between
        the nodes (EdgeCorrection); None where it is resolved to nodes.
    contact_at_zone_boundary : bool, optional
        True if the boundary of the zone cuts the contact off.
    fields : FieldSet, optional
        Field set whose scalar fields are the columns of potentials and fluxes.
    """

    loading: Loading
    step: int
    increment: int
    initial_gap: Array
    traction: Array
    displacement: Array
    potentials: Array
    fluxes: Array
    contact_fraction: Array
    slip: Array
    total_slip: Array
    slip_path: Array
    wear: Array
    dissipation: Array
    region: Indices
    status: Status
    iterations: int
    residual: float
    history: Array
    message: str
    boundary: NodalFields | ZoneFields | None = None
    second_body: SecondSurface | None = None
    area_fraction: Array | None = None
    contact_at_zone_boundary: bool = False
    fields: FieldSet = MEE

    def __repr__(self) -> str:
        """Return words instead of long arrays."""
        touching = f"{self.touching.sum()} of {len(self.region)} nodes in contact"
        location = f"step {self.step}, increment {self.increment}, approach {self.loading.approach:.6g} m"
        return f"StepResult({location}: {self.status}, {touching})"

    @property
    def touching(self) -> NDArray[np.bool_]:
        """Mask of the nodes in contact, (n,); an attraction across the gap is no contact."""
        return np.asarray(self.region != Region.OPEN)

    @property
    def gap(self) -> Array:
        """Gap between the deformed body and the indenter, or the deformed second body, (n,) [m] (eq. 10)."""
        gap: Array = self.initial_gap - self.displacement[:, 2]
        if self.second_body is not None:
            gap += self.second_body.displacement[:, 2]
        return gap

    @property
    def state(self) -> ContactState:
        """State of the contact zone, for an indenter that stays where it is.

        Its displacement is that of the reduced system: of the body, less that of the second body if there is one.
        """
        load = np.concatenate([self.traction, self.fluxes], axis=1)
        displacement = np.concatenate([self.displacement, -self.potentials], axis=1)
        if self.second_body is not None:
            displacement -= np.concatenate([self.second_body.displacement, -self.second_body.potentials], axis=1)
        return ContactState(load, displacement, self.contact_fraction)


@dataclass(frozen=True, eq=False)
class Resultants:
    """Resultants and maxima of an increment over the contact zone.

    The total fluxes and the largest absolute potentials are also attributes by their names, such as `charge` [C],
    `magnetic_flux` [Wb] and `max_abs_electric_potential` [V].

    Attributes
    ----------
    force : Array
        Force of the indenter on the body in global axes, (3,) [N].
    normal_force : float
        Force against the axis of the indenter, positive in compression [N].
    tangential_force : Array
        Force along the axes e1 and e2 of the indenter, (2,) [N].
    moment : Array
        Moment about e1 and e2 through the reference point of the indenter, (2,) [N m].
    torque : float
        Moment about the axis of the indenter [N m].
    scalars : dict of str to float
        Integrals of the outward fluxes and largest absolute potentials of the body, by name.
    dissipated_energy : float
        Work of friction in the increment [J].
    worn_volume : float
        Volume that both surfaces together have lost to wear since the beginning [m^3].
    contact_area, stick_area, slip_area : float
        Sums over the elements of their area times the fraction of their nodes in contact, in stick or in slip
        [m^2].
    max_pressure, max_tension : float
        Largest compressive and tensile normal traction, >= 0 [Pa].
    """

    force: Array
    normal_force: float
    tangential_force: Array
    moment: Array
    torque: float
    scalars: Mapping[str, float]
    dissipated_energy: float
    worn_volume: float
    contact_area: float
    stick_area: float
    slip_area: float
    max_pressure: float
    max_tension: float

    def __getattr__(self, name: str) -> float:
        return _named_scalar(self, name)


def resultants(zone: Zone, step: StepResult) -> Resultants:
    """Return the resultants and maxima over the contact zone.

    Areas are summed over elements, because the weights of nodes are not areas: those of the corners of quad8 are
    negative, those of tri6 zero. Nodes at a resolved contact edge count with their area fraction.

    Parameters
    ----------
    zone : Zone
        Nodes of the contact zone.
    step : StepResult
        An increment.

    Returns
    -------
    Resultants
        Forces, moments, total fluxes, areas and maxima.
    """
    return _resultants(step, zone)


@memoize_by_identity
def _resultants(step: StepResult, zone: Zone) -> Resultants:
    normal = step.traction[:, 2]
    scalars, potentials = step.fields.scalars, [largest(potential) for potential in step.potentials.T]
    total, products = np.zeros(3), np.zeros((3, 3))
    for first in range(0, len(normal), _BLOCK):  # blocks of nodes take little memory
        nodes = slice(first, first + _BLOCK)
        # one memory layout, on which last digits depend, whether the step is solved or read
        traction = np.ascontiguousarray(step.traction[nodes])
        forces = zone.weights[nodes, None] * global_components(zone.frames[nodes], traction)
        total += forces.sum(axis=0)
        products += (zone.points[nodes] - step.loading.reference).T @ forces
    # products of all components: the moment is their antisymmetric part
    moment = np.array(
        [products[1, 2] - products[2, 1], products[2, 0] - products[0, 2], products[0, 1] - products[1, 0]]
    )
    # no -0.0
    force, about = (step.loading.axes @ each + 0.0 for each in (total, moment))
    totals = [float(zone.weights @ np.ascontiguousarray(flux) + 0.0) for flux in step.fluxes.T]
    return Resultants(
        force=total,
        normal_force=float(0.0 - force[2]),
        tangential_force=force[:2],
        moment=about[:2],
        torque=float(about[2]),
        scalars={scalar.resultant: total for scalar, total in zip(scalars, totals, strict=True)}
        | {f"max_abs_{scalar.value_name}": value for scalar, value in zip(scalars, potentials, strict=True)},
        dissipated_energy=float(zone.weights @ step.dissipation),
        worn_volume=float(zone.weights @ step.wear),
        contact_area=_area(zone, step, step.touching),
        stick_area=_area(zone, step, step.region == Region.STICK),
        slip_area=_area(zone, step, step.region == Region.SLIP),
        max_pressure=float(np.maximum(-normal, 0.0).max() + 0.0),
        max_tension=float(np.maximum(normal, 0.0).max() + 0.0),
    )


def _area(zone: Zone, step: StepResult, chosen: NDArray[np.bool_]) -> float:
    fractions = chosen.astype(float) if step.area_fraction is None else np.where(chosen, step.area_fraction, 0.0)
    return float(_areas(zone) @ fractions)


@memoize_by_identity
def _areas(zone: Zone) -> Array:
    """Return the areas of the elements, distributed evenly over their nodes, (n,) [m^2]."""
    # rectangles share their areas evenly
    # nodes alone for test systems and plugins, and for a periodic surface, whose elements lack the last row and column
    if (
        not zone.cells
        or isinstance(zone.cells, GridCells)
        or np.ptp(zone.weights) <= _WEIGHT_ROUND_OFF * np.max(zone.weights)
    ):
        return zone.weights
    areas = np.zeros(len(zone.points))
    for (_, nodes), outline in zip(zone.cells, corners(zone.cells), strict=True):
        element_areas = np.linalg.norm(vector_areas(zone.points[outline]), axis=1)
        shares = np.repeat(element_areas / nodes.shape[1], nodes.shape[1])
        areas += np.bincount(nodes.ravel(), shares, len(areas))
    # straight sides miss a little of curved elements: all of them together have the area of the zone
    areas *= zone.weights.sum() / areas.sum()
    return areas


@dataclass(frozen=True)
class Provenance:
    """Provenance of a result.

    Attributes
    ----------
    title : str
        Title of the case.
    case_text : str
        Text of the case file, verbatim.
    versions : dict of str to str
        Versions of the software by name.
    threads : int
        Number of threads.
    """

    title: str
    case_text: str
    versions: Mapping[str, str]
    threads: int


@dataclass(frozen=True, eq=False)
class Result:
    """Result of a run: its zone and the finished increments of its load steps.

    Attributes
    ----------
    provenance : Provenance
        Title and text of the case, versions of the software and number of threads.
    zone : Zone
        Nodes of the contact zone.
    planned_steps : int
        Number of increments of the case.
    steps : tuple of StepResult
        Finished increments, in order.
    timings : dict of str to float
        Seconds by stage.
    peak_memory_mb : float
        Largest resident memory of the process [10^6 bytes].
    """

    provenance: Provenance
    zone: Zone
    planned_steps: int
    steps: tuple[StepResult, ...] = ()
    timings: Mapping[str, float] = field(default_factory=dict)
    peak_memory_mb: float = 0.0

    def __repr__(self) -> str:
        """Return words instead of long arrays."""
        increments = f"{len(self.steps)} of {self.planned_steps} increments"
        return f"Result({self.provenance.title!r}: {self.status}, {increments}, {len(self.zone.points)} nodes)"

    @property
    def status(self) -> RunStatus:
        """Status of the run, CONVERGED only if every planned increment converged."""
        if any(step.status is not Status.CONVERGED for step in self.steps):
            return RunStatus.NOT_CONVERGED
        return RunStatus.CONVERGED if len(self.steps) == self.planned_steps else RunStatus.UNFINISHED


def split_load(load: Array) -> tuple[Array, Array]:
    """Return tractions (n, 3) and outward fluxes (n, scalars) of a load (n, fields)."""
    return load[:, MECHANICAL], load[:, POTENTIALS]


def split_displacement(displacement: Array) -> tuple[Array, Array]:
    """Return displacements (n, 3) and potentials (n, scalars), in their physical sign.

    displacement: (n, fields) of a reduced system, whose potentials are negated.
    """
    scalars = displacement[:, POTENTIALS]
    potentials = np.zeros(scalars.shape[::-1]).T  # columns of zeros are never written, and take no memory
    for column, values in enumerate(scalars.T):
        if values.any():
            np.negative(values, out=potentials[:, column])
    return displacement[:, MECHANICAL], potentials
