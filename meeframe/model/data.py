"""Data of a case without checks, on which its checks and its solution work."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import CaseError
from meeframe.contact.channels import FluxChannel
from meeframe.contact.problem import Solver
from meeframe.fields import FieldSet
from meeframe.formulations.base import Formulation
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.indenters import Placement
from meeframe.indenters.base import Indenter, IndenterMotions
from meeframe.laws import Insulating, Signorini
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.laws.wear import WearLaw
from meeframe.material import Material
from meeframe.material.layers import LayerStack
from meeframe.mesh import FrictionAxes
from meeframe.mesh.body import BoundaryCondition
from meeframe.mesh.surface import SurfaceMesh
from meeframe.model.restart import Restart
from meeframe.model.second_body import SecondBody
from meeframe.model.step import Step
from meeframe.plugin.validation import field_choices
from meeframe.results.schema import optional_fields
from meeframe.results.selection import ALLOWED, NAMED, step_numbers
from meeframe.solvers import Auto, StoppingCriteria


@checked_arguments
@dataclass(frozen=True)
class Output:
    """Files and fields that a run writes.

    Parameters
    ----------
    figures, vtu : bool
        Whether PNG figures and fields.vtu are written in addition to result.h5 and summary.json.
    fields : tuple of str or None
        Names of optional fields in result.h5 (docs/reference/results.md); None: those that the case loads.
    step : str
        Increment that the figures show: "peak" for that of the peak load, "last", the number of a load step, such as
        "2", for its last increment, or "2.5" for increment 5 of load step 2. Figures of a run that ends before this
        increment show the peak load.

    Raises
    ------
    CaseError
        For other names of fields and other texts of the step.
    """

    figures: bool = True
    vtu: bool = True
    fields: tuple[str, ...] | None = None
    step: str = "peak"

    @property
    def has_reports(self) -> bool:
        """True if figures or fields for ParaView are written."""
        return self.figures or self.vtu

    def __post_init__(self) -> None:
        allowed = optional_fields()
        for name in self.fields or ():
            if name not in allowed:
                raise CaseError(f"fields: {name!r} is not an optional field; {field_choices(name, allowed)}")
        if self.step not in NAMED and not step_numbers(self.step):
            raise CaseError(f"step: {self.step!r} is not an increment; {ALLOWED}")


@dataclass(frozen=True, eq=False)
class CaseData:
    """All data that determine the result of a contact problem; `Case` documents and checks them."""

    material: Material
    mesh: SurfaceMesh
    conditions: tuple[BoundaryCondition, ...]
    indenter: Indenter
    steps: tuple[Step, ...]
    placement: Placement = field(default_factory=Placement)
    potentials: Mapping[str, float] = field(default_factory=dict)
    surface: Indenter | None = None
    restart: Restart | None = None
    zone: str = "contact"
    contact_law: ContactLaw = field(default_factory=Signorini)
    axes: FrictionAxes | None = None
    friction_heat: float = 0.0
    joule_heat: float = 0.0
    wear: WearLaw | None = None
    conductivity: Mapping[str, ConductivityLaw] = field(default_factory=dict)
    formulation: Formulation = field(default_factory=DenseBEM)
    solver: Solver = field(default_factory=Auto)
    stopping: StoppingCriteria = field(default_factory=StoppingCriteria)
    output: Output = field(default_factory=Output)
    second_body: SecondBody | None = None
    layers: LayerStack = field(default_factory=LayerStack)
    title: str = ""
    text: str = ""

    @property
    def fields(self) -> FieldSet:
        """Field set of the material."""
        return self.material.fields

    @property
    def formulations(self) -> tuple[Formulation, ...]:
        """Formulations of the body, and of the second one if there is one."""
        return (self.formulation,) if self.second_body is None else (self.formulation, self.second_body.formulation)

    @cached_property
    def motions(self) -> IndenterMotions:
        """Names and indices of the motions of the indenter."""
        return IndenterMotions(self.fields)

    @cached_property
    def channels(self) -> tuple[FluxChannel, ...]:
        """Flux channels of the contact, one for each scalar field."""
        insulating = Insulating()
        return tuple(FluxChannel(one, self.conductivity.get(one.name, insulating)) for one in self.fields.scalars)
