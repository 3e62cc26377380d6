"""Tables of a case built in Python, each with the keys of the table in a case file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final, Literal

from pydantic import ValidationError

from meeframe.common.arguments import checked_arguments, python_numbers
from meeframe.common.errors import CaseError
from meeframe.fields import MEE, OPTIONAL_FIELDS, FieldSet
from meeframe.formulations.base import Formulation
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.indenters import Placement
from meeframe.indenters.base import Indenter
from meeframe.laws import Signorini
from meeframe.laws.base import ContactLaw
from meeframe.laws.wear import WearLaw
from meeframe.material import Material
from meeframe.mesh import FrictionAxes, MeshRecipe
from meeframe.mesh.surface import SurfaceMesh
from meeframe.model.body_tables import BoundaryTable
from meeframe.model.data import Output
from meeframe.model.layer_tables import BaseTable, InterfaceTable
from meeframe.model.schema import StepTable
from meeframe.model.values import Table
from meeframe.plugin.validation import Problem, problems_of
from meeframe.solvers import StoppingCriteria

Amount = float | str
"""Number in SI units, or text with a unit such as '5 mm'."""
BUILT_IN: Final = FieldSet((*MEE.scalars, *OPTIONAL_FIELDS))
"""Scalar fields whose keys are arguments; those of fields that plugins add go into `scalars`."""


def entries(record: Any) -> dict[str, Any]:
    """Return the entries of a table: the fields of its record that differ from their defaults."""
    values = {entry.name: python_numbers(getattr(record, entry.name), arrays=True) for entry in fields(record)}
    scalars = values.pop("scalars", {})
    defaults = {entry.name: entry.default for entry in fields(record)}
    non_default = {key: value for key, value in values.items() if value is not None and not _same(value, defaults[key])}
    return non_default | dict(scalars)


def _same(value: Any, default: Any) -> bool:
    return type(value) is type(default) and bool(value == default)


def _check(record: "Step | Boundary | Interface | Base", model: type[Table]) -> None:
    """Raise CaseError unless the entries of a table are valid; fields that plugins add are checked by the case."""
    table = {key: value for key, value in entries(record).items() if key not in record.scalars}
    try:
        model.model_validate(table)
    except ValidationError as error:
        lines = (f"{type(record).__name__}: {from_zero(problem)}" for problem in problems_of(error, model))
        raise CaseError("\n".join(lines)) from None


def from_zero(problem: Problem) -> Problem:
    """Return a problem whose text counts the entries of lists from zero, as Python does."""
    return replace(problem, location=tuple(key - 1 if isinstance(key, int) else key for key in problem.location))


def _brief(record: Any) -> str:
    return f"{type(record).__name__}({', '.join(f'{key}={value!r}' for key, value in entries(record).items())})"


@checked_arguments
@dataclass(frozen=True, kw_only=True)
class Step:
    """Load step; quantities that it does not name keep their values of the previous step.

    For each motion of the indenter either the motion, measured from first contact, or the conjugate resultant is given.

    Parameters
    ----------
    approach, normal_force : float or str, optional
        Approach [m], or normal force [N], >= 0 in compression.
    translation, tangential_force, force_ratio : pair of float or str, optional
        Translation [m], tangential force [N], or tangential over normal force, along e1 and e2; one number together
        with `direction`.
    direction : float or str, optional
        Angle from e1 of those quantities that are one number [rad].
    tilt, moment : pair of float or str, optional
        Tilt [rad] or moment [N m] about e1 and e2.
    twist, torque : float or str, optional
        Twist [rad] or torque [N m] about the axis.
    electric_potential, charge : float or str, optional
        Potential of the indenter [V], or charge [C].
    magnetic_potential, magnetic_flux : float or str, optional
        Potential of the indenter [A], or magnetic flux [Wb].
    temperature, heat : float or str, optional
        Temperature of the indenter above the reference [K], or heat out of the body [W], of a body with heat.
    sliding : float or str, optional
        Distance that the indenter slides in the whole step while the contact zone stays, which wears surfaces [m].
    max_pressure_change : float or str, optional
        Largest change of the pressure over the contact, as a fraction, for which increments with wear are divided.
    duration : float or str, optional
        Time of the whole step [s], for laws that need it.
    rolling : mapping, optional
        Rolling of the contact over the surface, with the keys of a case file: {"direction": [1, 0], "distance": "2 mm",
        "creepage": [1e-3, 0]}.
    increments : int, optional
        Number of equal increments.
    scalars : mapping of str to float or str, optional
        Potentials or total fluxes of scalar fields that plugins add, by name.

    Raises
    ------
    CaseError
        If a value is not allowed or two of them determine the same motion.
    """

    approach: Amount | None = None
    normal_force: Amount | None = None
    translation: Amount | Sequence[Amount] | None = None
    tangential_force: Amount | Sequence[Amount] | None = None
    force_ratio: Amount | Sequence[Amount] | None = None
    direction: Amount | None = None
    tilt: Sequence[Amount] | None = None
    moment: Sequence[Amount] | None = None
    twist: Amount | None = None
    torque: Amount | None = None
    electric_potential: Amount | None = None
    charge: Amount | None = None
    magnetic_potential: Amount | None = None
    magnetic_flux: Amount | None = None
    temperature: Amount | None = None
    heat: Amount | None = None
    sliding: Amount | None = None
    max_pressure_change: Amount | None = None
    duration: Amount | None = None
    rolling: Mapping[str, Any] | None = None
    increments: int = 1
    scalars: Mapping[str, Amount] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check(self, StepTable.of(BUILT_IN))

    def __repr__(self) -> str:
        """Return the prescribed quantities alone."""
        return _brief(self)


@checked_arguments
@dataclass(frozen=True)
class Boundary:
    """Boundary conditions on face groups; what is not prescribed has zero flux.

    Parameters
    ----------
    group : str or sequence of str
        Names of the face groups.
    displacement, traction : sequence of float or str, optional
        Three components each in global axes, 'free' where nothing is prescribed [m], [Pa].
    electric_potential, electric_flux : float or str, optional
        Potential [V], or outward flux D.nu [C/m^2].
    magnetic_potential, magnetic_flux : float or str, optional
        Potential [A], or outward flux B.nu [Wb/m^2].
    temperature, heat_flux : float or str, optional
        Temperature above the reference [K], or outward heat flux [W/m^2], of a body with heat.
    scalars : mapping of str to float or str, optional
        Potentials or fluxes of scalar fields that plugins add, by name.

    Raises
    ------
    CaseError
        If a value is not allowed.
    """

    group: str | Sequence[str]
    displacement: Sequence[Amount] | None = None
    traction: Sequence[Amount] | None = None
    electric_potential: Amount | None = None
    electric_flux: Amount | None = None
    magnetic_potential: Amount | None = None
    magnetic_flux: Amount | None = None
    temperature: Amount | None = None
    heat_flux: Amount | None = None
    scalars: Mapping[str, Amount] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check(self, BoundaryTable.of(BUILT_IN))

    def __repr__(self) -> str:
        """Return the prescribed quantities alone."""
        return _brief(self)


@checked_arguments
@dataclass(frozen=True)
class Contact:
    """Contact zone with its law.

    Parameters
    ----------
    law : ContactLaw, optional
        Law of the tractions; frictionless by default.
    zone : str, optional
        Name of the face group that may come into contact.
    axes : FrictionAxes, optional
        Direction of the local axis e1, from which laws measure their angles.
    friction_heat : float, optional
        Fraction of the work of friction that flows into the body as heat, in load steps with a duration.
    joule_heat : float, optional
        Fraction of the electric power in the contact that flows into the body as heat.
    wear : WearLaw, optional
        Law of the depth that slip wears off, such as `meeframe.Archard`; none by default.
    surface : Indenter, optional
        Heights of the surface that moves with the material, as the distance from a plane on its highest point; by
        default a plane.
    """

    law: ContactLaw = field(default_factory=Signorini)
    zone: str = "contact"
    axes: FrictionAxes | None = None
    friction_heat: float = 0.0
    joule_heat: float = 0.0
    wear: WearLaw | None = None
    surface: Indenter | None = None


@checked_arguments
@dataclass(frozen=True)
class Interface:
    """Interface below a layer, bonded in each field unless a key says otherwise.

    Parameters
    ----------
    normal_stiffness, tangential_stiffness : float or str, optional
        Traction per jump of the displacement [N/m^3].
    electric_conductance, magnetic_conductance : float or str, optional
        Flux per jump of the potential: capacitance [F/m^2] and permeance [H/m^2] per area.
    thermal_conductance : float or str, optional
        Heat flux per jump of the temperature [W/(m^2 K)], of a body with heat.
    electrode : {'grounded', 'floating'}, optional
        Thin electrode at the interface, at the potential zero, or at one at which its total charge is zero.
    scalars : mapping of str to float or str, optional
        Conductances of scalar fields that plugins add, by their keys in case files.

    Raises
    ------
    CaseError
        If a value is not allowed.
    """

    normal_stiffness: Amount | None = None
    tangential_stiffness: Amount | None = None
    electric_conductance: Amount | None = None
    magnetic_conductance: Amount | None = None
    thermal_conductance: Amount | None = None
    electrode: Literal["grounded", "floating"] | None = None
    scalars: Mapping[str, Amount] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check(self, InterfaceTable.of(BUILT_IN))


@checked_arguments
@dataclass(frozen=True)
class Layer:
    """Plane layer on a body.

    Parameters
    ----------
    material : str, mapping or Material
        Name of a material of the library, table as in a case file, or material.
    thickness : float or str
        Thickness [m].
    rotation : mapping, optional
        Rotation of the material's axes, as in `[material]` of a case file: {"axis": [0, 0, 1], "angle": "30 deg"}.
    interface : 'bonded' or Interface, optional
        Interface below the layer.
    grading : mapping, optional
        Profile of the constants over the depth, as in a case file: {"law": "exponential", "ratio": 4}.
    """

    material: str | Mapping[str, Any] | Material
    thickness: Amount
    rotation: Mapping[str, Any] | None = None
    interface: Interface | Literal["bonded"] = "bonded"
    grading: Mapping[str, Any] | None = None


@checked_arguments
@dataclass(frozen=True)
class Base:
    """Rigid base below the material of a half space, which then is a layer of finite thickness.

    Parameters
    ----------
    thickness : float or str
        Thickness of the body's material on the base [m].
    electric, magnetic : {'grounded', 'insulating'}, optional
        Whether the potential of the base, or the flux into it, is zero.
    thermal : {'grounded', 'insulating'}, optional
        Whether the temperature of the base, or the heat flux into it, is zero, of a body with heat.
    scalars : mapping of str to str, optional
        The same for scalar fields that plugins add, by their names.

    Raises
    ------
    CaseError
        If a value is not allowed.
    """

    thickness: Amount
    electric: Literal["grounded", "insulating"] = "grounded"
    magnetic: Literal["grounded", "insulating"] = "grounded"
    thermal: Literal["grounded", "insulating"] = "grounded"
    scalars: Mapping[str, Literal["grounded", "insulating"]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check(self, BaseTable.of(BUILT_IN))


@checked_arguments
@dataclass(frozen=True)
class SecondBody:
    """Second of two deformable bodies in its own coordinates, in which its contact zone faces up.

    Parameters
    ----------
    material, mesh, boundary, formulation, layers, base
        As for `Case`.
    zone : str, optional
        Name of the face group that may come into contact.
    """

    material: str | Mapping[str, Any] | Material
    mesh: MeshRecipe | SurfaceMesh
    boundary: Sequence[Boundary] = ()
    zone: str = "contact"
    formulation: Formulation = field(default_factory=DenseBEM)
    layers: Sequence[Layer] = ()
    base: Base | None = None

    def __post_init__(self) -> None:
        check_types(self)


_TYPES: Final[Mapping[str, tuple[tuple[type, ...], str]]] = {
    "material": ((str, Mapping, Material), "a name, a dictionary or a meeframe.Material"),
    "mesh": ((MeshRecipe, SurfaceMesh), "a mesh, from meeframe.mesh.block, half_space or file"),
    "indenter": ((Indenter,), "an indenter, such as meeframe.Sphere"),
    "conductivity": ((Mapping,), "a dictionary of laws by field, such as {'electric': meeframe.StepConductivity(1)}"),
    "potentials": ((Mapping,), "a dictionary, such as {'electric_potential': '5 V'}"),
    "placement": ((Placement,), "a meeframe.Placement"),
    "stopping": ((StoppingCriteria,), "meeframe.StoppingCriteria"),
    "output": ((Output,), "a meeframe.Output"),
    "second_body": ((SecondBody,), "a meeframe.SecondBody"),
    "base": ((Base,), "a meeframe.Base"),
}
"""Types of arguments, and their description in messages."""
_LISTS: Final[Mapping[str, type]] = {"steps": Step, "boundary": Boundary, "layers": Layer}
"""Types of the entries of arguments that are lists."""


def check_types(record: Any) -> None:
    """Raise CaseError if an argument of a case or of its second body has another type; None is left to the tables."""
    for name, value in vars(record).items():
        types, words = _TYPES.get(name, ((object,), ""))
        if name in _LISTS:
            words = f"a list of meeframe.{_LISTS[name].__name__}"
            valid = isinstance(value, Sequence) and all(isinstance(entry, _LISTS[name]) for entry in value)
        else:
            valid = value is None or isinstance(value, types)
        if not valid:
            raise CaseError(f"{type(record).__name__}: {name} = {value!r:.60}: should be {words}")
