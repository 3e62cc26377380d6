"""Frozen records of a result, which are written to and read from the result file and used by all reports."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import TYPE_CHECKING, Final, Never, final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.renamed import renaming
from meeframe.contact.problem import ContactState, Status
from meeframe.fields import MECHANICAL, MEE, N_MECHANICAL, POTENTIALS, Array, FieldSet, Indices
from meeframe.indenters.base import N_RIGID, RIGID_MOTIONS
from meeframe.mesh.regular import Cells, global_components
from meeframe.system.reduced import NodalFields, ReducedSystem


class RunStatus(StrEnum):
    """Status of a run as a whole."""

    CONVERGED = "converged"
    NOT_CONVERGED = "not-converged"
    UNFINISHED = "unfinished"


_SENTENCE_SEPARATOR: Final = "; "


def join_sentences(message: str, *sentences: str) -> str:
    """Return a message with further sentences.

    Parameters
    ----------
    message : str
        The message.
    *sentences : str
        Further sentences. Their semicolons become commas, since semicolons separate the sentences of a message.

    Returns
    -------
    str
        The longer message.
    """
    return _SENTENCE_SEPARATOR.join([message, *(text.replace(_SENTENCE_SEPARATOR, ", ") for text in sentences)])


def sentences_of(message: str) -> list[str]:
    """Return the sentences of a message.

    Parameters
    ----------
    message : str
        Message as of `join_sentences`.

    Returns
    -------
    list of str
        The sentences.
    """
    return message.split(_SENTENCE_SEPARATOR)


@dataclass(frozen=True, eq=False)
class Zone:
    """Contact zone of n nodes.

    Attributes
    ----------
    points : Array
        Positions of the nodes, (n, 3) [m].
    frames : Array
        Local frames, (n, 3, 3), rows e1, e2, nu, nu outward.
    weights : Array
        Integration weights, (n,) [m^2].
    cells : Cells
        Pairs of a meshio cell type and its connectivity, numbers into `points`.
    """

    points: Array
    frames: Array
    weights: Array
    cells: Cells

    def __repr__(self) -> str:
        """Return words instead of long arrays."""
        return f"Zone({len(self.points)} nodes)"


def zone_of(system: ReducedSystem) -> Zone:
    """Return the contact zone of a reduced system.

    Parameters
    ----------
    system : ReducedSystem
        The system.

    Returns
    -------
    Zone
        The zone.
    """
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
        return np.concatenate([self.columns("values", MECHANICAL), self.potentials], axis=1)

    @property
    def fluxes(self) -> Array:
        """Extended traction in global axes, (n, fields)."""
        return np.concatenate([self.columns("fluxes", MECHANICAL), self.scalar_fluxes], axis=1)

    def columns(self, source: str, columns: slice) -> Array:
        """Return the vectors or scalars in some columns of `values` or `fluxes`, whose other columns are not made.

        Parameters
        ----------
        source : str
            Attribute, "values" or "fluxes".
        columns : slice
            Columns: those of the vectors, or some of the others.

        Returns
        -------
        Array
            Values, (n, k), SI units.
        """
        of_values = source == "values"
        if columns == MECHANICAL:
            return global_components(self.zone.frames, self.displacement if of_values else self.traction)
        scalars = self.potentials if of_values else self.scalar_fluxes
        return scalars[:, columns.start - N_MECHANICAL : columns.stop - N_MECHANICAL]


class Region(IntEnum):
    """Region of a node of the contact zone."""

    OPEN = 0
    SLIP = 1
    STICK = 2


@dataclass(frozen=True, eq=False)
class RollingMotion:
    """Rolling of the contact over the surface in one increment.

    Attributes
    ----------
    direction : Array
        Unit vector in global axes, (3,), along which the contact moves relative to the material.
    creepage : Array
        Longitudinal and lateral creepage, (2,).
    spin : float
        Spin [1/m].
    cell : float
        Rolled distance of the increment [m].
    distance : float
        Rolled distance of all increments since the beginning [m].
    cycles : float
        Cycles of steady rolling since the beginning, in which the surfaces have worn.
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

    Motions and potentials are measured from where the indenter just touched, and are results of the computation where
    they were free.

    Attributes
    ----------
    approach : float
        Approach along the axis of the indenter into the body [m].
    translation : Array
        Translation across the axis, along e1 and e2 of `axes`, (2,) [m].
    tilt : Array
        Right-handed rotations about e1 and e2, (2,) [rad].
    twist : float
        Right-handed rotation about the axis [rad].
    scalars : dict of str to float
        Potentials of the surface of the indenter by name, where the laws conduct, such as "electric_potential" [V];
        each is an attribute by this name, too.
    prescribed : dict of str to Array
        Each resultant that was prescribed instead of a motion, (1,) or (2,), by its key in case files, SI units.
    reference : Array
        Lowest point of the indenter where it just touched, about which it rotates, (3,) in global axes [m].
    axes : Array
        Rows e1, e2 and axis of the indenter, (3, 3).
    duration : float or None
        Duration of the increment [s]; None if its load step has none.
    rolling : RollingMotion or None
        Rolling in the increment; None if the contact stays in place.
    travel : Array
        Way of the contact over the material since the beginning, along e1 and e2, (2,) [m].
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
        """Return the loading of all motions of an indenter.

        Parameters
        ----------
        motion : Array
            Motions and potentials, (motions,), in the order of IndenterMotions, SI units.
        prescribed, reference, axes
            As the attributes.
        duration : float, optional
            Duration of the increment [s].
        fields : FieldSet, optional
            Field set of the body.
        rolling : RollingMotion, optional
            Rolling in the increment.
        travel : Array, optional
            Way of the contact over the material, (2,) [m]; zero by default.

        Returns
        -------
        Loading
            The loading.
        """
        approach, translation, tilt, twist = (motion[columns] for columns in RIGID_MOTIONS.values())
        potentials = zip(fields.scalars, motion[N_RIGID:].tolist(), strict=True)
        scalars = {scalar.value_name: value for scalar, value in potentials}
        rigid = float(approach[0]), translation, tilt, float(twist[0])
        travel = np.zeros(2) if travel is None else travel
        return cls(*rigid, scalars, prescribed, reference, axes, duration, rolling, travel)

    def __getattr__(self, name: str) -> float:
        return named_scalar(self, name)

    @property
    def motion(self) -> Array:
        """Motions of the indenter, (motions,), in the order of IndenterMotions."""
        rigid = (np.atleast_1d(getattr(self, name)) for name in RIGID_MOTIONS)
        return np.concatenate([*rigid, list(self.scalars.values())])


def named_scalar(record: object, name: str) -> float:
    """Return the value of a scalar field in a record by name.

    Parameters
    ----------
    record : object
        Record with an attribute `scalars`.
    name : str
        Name of the value, such as "electric_potential".

    Returns
    -------
    float
        The value, SI units.

    Raises
    ------
    AttributeError
        If there is no scalar field of this name.
    """
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
        (n,), fraction of each node's area inside the contact edge, where that is resolved between the nodes
        (EdgeCorrection), also of nodes without pressure; None where it is resolved to nodes.
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

    if not TYPE_CHECKING:  # type checkers know that other attributes do not exist

        def __getattr__(self, name: str) -> Never:
            if hasattr(type(self), name):  # a property failed; its error is the cause
                object.__getattribute__(self, name)
            hint = renaming(name)
            raise AttributeError(f"StepResult has no attribute {name!r}{'; ' * bool(hint)}{hint}", name=name, obj=self)

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
    steps : sequence of StepResult
        Finished increments, in order: a tuple, or StoredSteps of meeframe.results.overview.
    timings : dict of str to float
        Seconds by stage.
    peak_memory_mb : float
        Largest resident memory of the process [10^6 bytes].
    """

    provenance: Provenance
    zone: Zone
    planned_steps: int
    steps: Sequence[StepResult] = ()
    timings: Mapping[str, float] = field(default_factory=dict)
    peak_memory_mb: float = 0.0

    def __repr__(self) -> str:
        """Return words instead of long arrays."""
        increments = f"{len(self.steps)} of {self.planned_steps} increments"
        return f"Result({self.provenance.title!r}: {self.status}, {increments}, {len(self.zone.points)} nodes)"

    @property
    def status(self) -> RunStatus:
        """Status of the run, CONVERGED only if every planned increment converged."""
        # overviews are in memory even where the increments are not
        if any(step.status is not Status.CONVERGED for step in getattr(self.steps, "overviews", self.steps)):
            return RunStatus.NOT_CONVERGED
        return RunStatus.CONVERGED if len(self.steps) == self.planned_steps else RunStatus.UNFINISHED


def split_load(load: Array) -> tuple[Array, Array]:
    """Return tractions and fluxes of a load.

    Parameters
    ----------
    load : Array
        Load of a reduced system, (n, fields).

    Returns
    -------
    Array
        Tractions, (n, 3) [Pa], along e1, e2, nu.
    Array
        Outward fluxes, (n, scalars), SI units.
    """
    return load[:, MECHANICAL], load[:, POTENTIALS]


def split_displacement(displacement: Array) -> tuple[Array, Array]:
    """Return displacements and potentials of an extended displacement.

    Parameters
    ----------
    displacement : Array
        Displacement of a reduced system, (n, fields), whose potentials are negated.

    Returns
    -------
    Array
        Displacements, (n, 3) [m], along e1, e2, nu.
    Array
        Potentials in their physical sign, (n, scalars), SI units.
    """
    scalars = displacement[:, POTENTIALS]
    potentials = np.zeros(scalars.shape[::-1]).T  # columns of zeros are never written, and take no memory
    for column, values in enumerate(scalars.T):
        if values.any():
            np.negative(values, out=potentials[:, column])
    return displacement[:, MECHANICAL], potentials
