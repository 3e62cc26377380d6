"""A case: everything that determines a result, as objects."""

from dataclasses import dataclass, field

import numpy as np

from meeframe.core.body import Body, BoundaryCondition
from meeframe.core.contact import ConductivityLaw, ContactLaw, Solver
from meeframe.core.errors import CaseError
from meeframe.core.fields import ELECTRIC, FLUX_NAMES, MAGNETIC, VALUE_NAMES, Array
from meeframe.core.formulation import Formulation
from meeframe.core.indenter import Indenter
from meeframe.core.mesh import SurfaceMesh
from meeframe.core.result import Loading
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.geometry import Placement, check_contact_zone, initial_gap, zone_frames
from meeframe.laws import Insulating, Signorini
from meeframe.materials import Material
from meeframe.solvers import Limits, Uzawa


@dataclass(frozen=True)
class Output:
    """What is written beside result.h5 and summary.json: PNG figures, fields.vtu."""

    figures: bool = True
    vtu: bool = True


@dataclass(frozen=True, eq=False)
class Case:
    """One contact problem with its load steps, checked when it is made.

    conditions: boundary conditions, none of them on the contact zone; zone: name of the face group that may come into
    contact; steps: load steps, each a state of the indenter; text: the case file, verbatim, kept with the result.

    Raises MeshError or CaseError, naming what is wrong, if the parts do not fit together: a face group that does not
    exist, a condition on the contact zone, a rigid motion or a potential that nothing fixes, an indenter that is
    nowhere above the zone.
    """

    material: Material
    mesh: SurfaceMesh
    conditions: tuple[BoundaryCondition, ...]
    indenter: Indenter
    steps: tuple[Loading, ...]
    placement: Placement = field(default_factory=Placement)
    zone: str = "contact"
    contact_law: ContactLaw = field(default_factory=Signorini)
    electric_law: ConductivityLaw = field(default_factory=Insulating)
    magnetic_law: ConductivityLaw = field(default_factory=Insulating)
    formulation: Formulation = field(default_factory=DenseBEM)
    solver: Solver = field(default_factory=Uzawa)
    limits: Limits = field(default_factory=Limits)
    output: Output = field(default_factory=Output)
    title: str = ""
    text: str = ""

    def __post_init__(self) -> None:
        check_contact_zone(self.mesh, self.zone)
        _check_conditions(self)
        _check_supports(self)
        if not self.steps:
            raise CaseError("steps: at least one load step is needed")
        if not np.isfinite(initial_gap(self.indenter, zone_frames(self.mesh, self.zone), self.placement)).any():
            raise CaseError(f"indenter: no part of it lies above the contact zone {self.zone!r}")

    @property
    def body(self) -> Body:
        """The boundary value problem for the formulation."""
        return Body(self.material.stiffness, self.mesh, self.conditions, self.zone)


def _check_conditions(case: Case) -> None:
    seen: set[tuple[str, int]] = set()
    for condition in case.conditions:
        case.mesh.group(condition.group)
        if condition.group == case.zone:
            raise CaseError(
                f"boundary condition on {condition.group!r}: it is the contact zone, whose tractions and fluxes follow "
                f"from contact; name one of {', '.join(name for name in case.mesh.group_names if name != case.zone)}"
            )
        if not np.isfinite(condition.data).all():
            raise CaseError(f"boundary condition on {condition.group!r}: its data must be finite numbers")
        key = (condition.group, condition.field)
        if key in seen:
            name = f"{VALUE_NAMES[condition.field]} or {FLUX_NAMES[condition.field]}"
            raise CaseError(f"boundary conditions on {condition.group!r} prescribe {name} twice")
        seen.add(key)


def _check_supports(case: Case) -> None:
    """Every rigid motion and the constant of each potential must be fixed by a prescribed value."""
    prescribed = [condition for condition in case.conditions if condition.kind == "value"]
    for number, key in ((ELECTRIC, "electric_potential"), (MAGNETIC, "magnetic_potential")):
        if all(condition.field != number for condition in prescribed):
            raise CaseError(f"no boundary condition prescribes {key}, so that its constant is undetermined")
    rows = [_rigid_rows(case.mesh, c) for c in prescribed if c.field < ELECTRIC]
    free = 6 - (np.linalg.matrix_rank(np.concatenate(rows), tol=1e-6) if rows else 0)
    if free:
        raise CaseError(
            f"the boundary conditions leave {free} of the 6 rigid motions free; prescribe more of the displacement"
        )


def _rigid_rows(mesh: SurfaceMesh, condition: BoundaryCondition) -> Array:
    """The prescribed component of the six rigid motions a + w x (x - centre) / size at the group's points, (p, 6)."""
    size = np.ptp(mesh.points, axis=0).max()
    points = (mesh.points[mesh.group_points(condition.group)] - mesh.points.mean(axis=0)) / size
    axis = np.eye(3)[condition.field]
    return np.concatenate([np.tile(axis, (len(points), 1)), np.cross(points, axis)], axis=1)
