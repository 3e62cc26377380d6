"""Case: everything that determines a result, as objects."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.contact.channels import FluxChannel, field_set
from meeframe.formulations.base import Formulation, check_body
from meeframe.indenters import Placement, initial_gap
from meeframe.indenters.base import Indenter, MotionModes
from meeframe.laws.base import ContactLaw
from meeframe.mesh import ContactZone, FrictionAxes, check_contact_zone, find_contact_zone
from meeframe.mesh.body import Body
from meeframe.mesh.regular import shares_frame
from meeframe.mesh.surface import SurfaceMesh
from meeframe.model.data import CaseData
from meeframe.model.data import Output as Output
from meeframe.model.frames import frames_along
from meeframe.model.heat import check_friction_heat, check_joule_heat, check_levels, unused_friction_heat
from meeframe.model.laws import check_conductivity, check_tractions, gap_of_law, law_of_increment
from meeframe.model.memory import check_memory, check_memory_of_surface, memory_warning
from meeframe.model.preflight import check_solver, other_period, preflight, undeformed, unused_potentials
from meeframe.model.restart import check_same_zone
from meeframe.model.rolling_steps import check_profiles, check_rolling, check_surface, divide_steps
from meeframe.model.second_body import check_alike, check_fields, check_match, coarse_zone
from meeframe.model.step import (
    check_duration,
    check_first,
    check_names,
    check_pull,
    check_resisted,
    check_size,
    resisted,
)
from meeframe.model.wear import check_sliding, check_wear
from meeframe.plugin.sources import faults_of_plugins
from meeframe.plugin.validation import choices

_SAMPLE_NODES: Final = 1_000
"""Number of nodes above which part of an indenter is first sought."""
Warn = Callable[[str], None]
"""Type of functions that receive a warning in words."""


@dataclass(frozen=True, eq=False)
class Case(CaseData):
    """Contact problem with its load steps, checked when it is created.

    Parameters
    ----------
    material : Material
        Material of the body.
    mesh : SurfaceMesh
        Surface mesh of the body.
    conditions : tuple of BoundaryCondition
        Boundary conditions, none of them on the contact zone.
    indenter : Indenter
        Shape of the rigid indenter, or the distance between two deformable bodies.
    steps : tuple of Step
        Load steps in their order. Those that roll are divided into one increment for each cell.
    placement : Placement, optional
        Position and axis of the indenter.
    potentials : mapping of str to float, optional
        Initial potentials of the indenter by name, such as {"electric_potential": 5.0} [V]; zero if not given.
    surface : Indenter, optional
        Heights of the surface that moves with the material, as the distance from a plane on its highest point, which
        adds to the height of the indenter; by default a plane.
    restart : Restart, optional
        State to continue, with its own potentials, in place of the undeformed body.
    zone : str, optional
        Name of the face group that may come into contact.
    contact_law : ContactLaw, optional
        Law of the tractions.
    axes : FrictionAxes, optional
        Direction of the local axis e1, from which a contact law measures its angle; by default that of local_frames.
    friction_heat : float, optional
        Fraction of the work of friction that flows into the body as heat, from 0 (by default) to 1; the rest heats the
        indenter. Load steps without a duration are infinitely slow and generate none.
    joule_heat : float, optional
        Fraction of the electric power in the contact that flows into the body as heat, from 0 (by default) to 1; the
        rest heats the indenter. The electric flux is then a current, and the permittivity the electric conductivity.
    wear : WearLaw, optional
        Law of the depth that slip wears off the surfaces together, which opens the gap; none by default.
    conductivity : mapping of str to ConductivityLaw, optional
        Conductivity laws of the contact by the name of their scalar field; a field without one is insulated.
    formulation : Formulation, optional
        Discretisation of the body.
    solver : Solver, optional
        Contact solver.
    stopping : StoppingCriteria, optional
        Criteria that end an iteration.
    output : Output, optional
        Files and fields that a run writes.
    second_body : SecondBody, optional
        Second of two deformable bodies, whose supports and grounds move as the indenter, and whose distance from the
        first is the indenter's shape.
    layers : LayerStack, optional
        Layers on the body, and its rigid base.
    title : str, optional
        Title of the case.
    text : str, optional
        The case file, verbatim, stored with the result.

    Raises
    ------
    MeshError, CaseError
        If the parts do not fit together. The message names the problem: a face group that does not exist; a condition
        on the contact zone; a body that the formulation refuses (a rigid motion or a potential that nothing fixes); an
        indenter that is nowhere above the zone; a grid that needs too much memory; a contact law whose
        initial gap is not finite or that has not one traction for each node; a conductivity law likewise; a surface
        that does not cover the zone; a second body whose zone does not match; a first step that neither moves nor
        presses the indenter; a step without the duration that the contact law needs; a step that rolls where material
        cannot move; a resultant that the laws cannot resist; a solver that does not accept the contact law or the
        prescribed quantities; an earlier run with another contact zone or other axes.
    """

    def __post_init__(self) -> None:
        with faults_of_plugins():
            self._check()

    def _check(self) -> None:
        check_title(self.title)
        _check_keys("conductivity", self.conductivity, self.fields.names)
        _check_keys("potentials", self.potentials, [scalar.value_name for scalar in self.fields.scalars])
        check_contact_zone(self.mesh, self.zone)
        check_body(self.formulation, self.body)
        check_memory(self.mesh, self.contact_law, self.channels)
        check_memory_of_surface(self.indenter)
        self.formulation.check(self.body)
        if not self.steps:
            raise CaseError("steps: at least one load step is needed")
        check_indenter(self.indenter, self.placement, self.mesh, self.zone)
        contact_zone = find_contact_zone(self.mesh, self.zone)
        gap_of_law(self.contact_law, contact_zone.points)
        check_tractions(self.contact_law, len(contact_zone.points))
        for channel in self.channels:
            check_conductivity(channel.law, len(contact_zone.points))
        check_fields(self.second_body, self.fields)
        check_friction_heat(self.friction_heat, self.fields, self.second_body is not None)
        check_joule_heat(self.joule_heat, self.body, self.channels, self.second_body is not None)
        generated = max(self.friction_heat, self.joule_heat)
        check_levels(self.steps, self.channels, generated, self._undetermined_levels)
        check_wear(self.wear, self.contact_law)
        if self.restart is None:
            check_first(self.steps[0])
        else:
            check_same_zone(self.restart, contact_zone, self.axes)
        check_alike(self.second_body, self.formulation)
        check_rolling(self.steps, self.indenter, self.formulations, self.contact_law, generated)
        check_surface(self.surface, self.steps, contact_zone, self.placement, self.restart)
        check_profiles(self.steps, self.wear, contact_zone, self.placement, self.restart)
        steps = divide_steps(self.steps, contact_zone, self.placement, self.formulation.is_periodic())
        object.__setattr__(self, "steps", steps)  # as frozen dataclasses set fields that follow from others
        check_match(self.second_body, self.mesh, self.zone)
        resists = resistance(self.placement, self.mesh, self.zone, self.axes, self.contact_law, self.channels)
        for number, step in enumerate(self.steps, 1):
            check_names(step, self.motions)
            check_duration(step, number, self.contact_law)
            check_sliding(step, number, self.contact_law, self.wear)
            check_pull(step, self.contact_law)
            check_size(step, contact_zone.points)
            check_resisted(step, self.motions, resists)
        law_of_increment(self.contact_law, np.zeros(len(contact_zone.points)), self.steps[0].increment_duration)
        check_solver(self, self.solver)

    def check_memory_of_run(self) -> None:
        """Raise TooLargeError if a run that writes the files of the case needs more memory than the process may use."""
        check_memory(self.mesh, self.contact_law, self.channels, self.output.has_reports)

    @property
    def _undetermined_levels(self) -> set[int]:
        """Fields of either body whose level heat flow leaves undetermined."""
        second_body = () if self.second_body is None else ((self.second_body.formulation, self.second_body.body),)
        bodies = ((self.formulation, self.body), *second_body)
        return {field for formulation, body in bodies for field in formulation.undetermined_levels(body)}

    @property
    def body(self) -> Body:
        """Boundary value problem for the formulation."""
        return Body.of(self.material, self.mesh, self.conditions, self.zone, self.layers)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the case, in words, none of which stops a run.

        They come from the formulations, or report an indenter that touches nothing, or input that has no effect.
        """
        second_body = () if self.second_body is None else ((self.second_body.formulation, self.second_body.body),)
        return (*warnings_of(((self.formulation, self.body), *second_body)), *self.preflight)

    @property
    def preflight(self) -> tuple[str, ...]:
        """Warnings that do not come from formulations, in words."""
        with faults_of_plugins():
            kinematics = undeformed(self)
            return (
                *preflight(kinematics),
                *other_period(kinematics),
                *unused_potentials(kinematics),
                *memory_warning(self.mesh, self.contact_law, self.channels),
                *coarse_zone(self.second_body, self.mesh, self.zone),
                *unused_friction_heat(self.friction_heat, self.steps),
            )

    @property
    def n_increments(self) -> int:
        """Number of increments of all load steps together."""
        return sum(step.increments for step in self.steps)


def warnings_of(bodies: Iterable[tuple[Formulation, Body]]) -> tuple[str, ...]:
    """Return the distinct warnings of formulations about their bodies, in words."""
    with faults_of_plugins():
        return tuple(dict.fromkeys(text for formulation, body in bodies for text in formulation.warnings(body)))


def ignore(text: str) -> None:
    """Ignore a warning."""


def _check_keys(what: str, keys: Iterable[str], allowed: Sequence[str]) -> None:
    for key in keys:
        if key not in allowed:
            raise CaseError(f"{what}: unknown name {key!r}; {choices(key, allowed)}")


def check_title(title: str) -> None:
    """Raise CaseError for a title that no result file can hold."""
    if "\0" in title:
        raise CaseError("holds the character NUL; allowed: any other in a title")


def check_indenter(indenter: Indenter, placement: Placement, mesh: SurfaceMesh, zone: str) -> None:
    """Raise CaseError unless a part of the indenter lies above the contact zone."""
    contact_zone = find_contact_zone(mesh, zone)
    if shares_frame(contact_zone.frames):  # a few nodes of a large grid may suffice
        nodes = slice(None, None, max(1, len(contact_zone.points) // _SAMPLE_NODES))
        arrays = contact_zone.points, contact_zone.frames, contact_zone.weights
        points, frames, weights = (array[nodes] for array in arrays)
        few = ContactZone(points, frames, weights, (), contact_zone.numbers[nodes])
        if np.isfinite(initial_gap(indenter, few, placement)).any():
            return
    if not np.isfinite(initial_gap(indenter, contact_zone, placement)).any():
        raise CaseError(f"no part of the indenter lies above the contact zone {zone!r}")


def resistance(
    placement: Placement,
    mesh: SurfaceMesh,
    zone: str,
    axes: FrictionAxes | None,
    law: ContactLaw,
    channels: tuple[FluxChannel, ...],
) -> NDArray[np.bool_]:
    """Return which of the indenter's motions the law and the channels of the contact may resist, (motions,)."""
    contact_zone = find_contact_zone(mesh, zone)
    frames, reference = frames_along(contact_zone, axes), placement.reference(contact_zone.points)
    modes = MotionModes(contact_zone.points, frames, placement.base, reference, field_set(channels))
    return resisted(modes.at_extremes(), law, channels)
