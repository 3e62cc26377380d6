"""The second of two deformable bodies: what a case says of it."""

from dataclasses import dataclass, field
from typing import Final

from meeframe.core.body import Body, BoundaryCondition
from meeframe.core.errors import CaseError
from meeframe.core.formulation import Formulation
from meeframe.core.mesh import SurfaceMesh
from meeframe.core.pair import match_nodes
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.geometry import check_contact_zone, zone_frames
from meeframe.materials import Material
from meeframe.plugin.sources import faults_of_plugins

_BODIES: Final = ("first body", "counter body")


@dataclass(frozen=True, eq=False)
class CounterBody:
    """The counter body of a case, in its own coordinates, in which its contact zone lies up (see meeframe.core.pair).

    Fields as those of a case. Raises MeshError or CaseError as a case does.
    """

    material: Material
    mesh: SurfaceMesh
    conditions: tuple[BoundaryCondition, ...] = ()
    zone: str = "contact"
    formulation: Formulation = field(default_factory=DenseBEM)

    def __post_init__(self) -> None:
        check_contact_zone(self.mesh, self.zone)
        with faults_of_plugins():
            self.formulation.check(self.body)

    @property
    def body(self) -> Body:
        """The boundary value problem for the formulation."""
        return Body(self.material.stiffness, self.mesh, self.conditions, self.zone)


def check_match(counter: CounterBody | None, mesh: SurfaceMesh, zone: str) -> None:
    """Raises MeshError unless the contact zone of the counter body, if there is one, fits that of the first body."""
    if counter is not None:
        match_nodes(zone_frames(mesh, zone), zone_frames(counter.mesh, counter.zone))


def check_alike(counter: CounterBody | None, formulation: Formulation) -> None:
    """Raises CaseError if of two bodies one alone has an endless surface or resolves edges, as formulations say."""
    if counter is None:
        return
    theirs = counter.formulation
    if theirs.endless() != formulation.endless():
        one, other = _BODIES if formulation.endless() else _BODIES[::-1]
        raise CaseError(
            f"the surface of the {one} goes on for ever, that of the {other} does not; allowed: both or neither "
            "(half-space: periodic)"
        )
    if theirs.resolves_edges() != formulation.resolves_edges():
        one, other = _BODIES if formulation.resolves_edges() else _BODIES[::-1]
        raise CaseError(
            f"the formulation of the {one} resolves the edges of the contact between the nodes, that of the {other} "
            "does not; allowed: both or neither (half-space: edges)"
        )
