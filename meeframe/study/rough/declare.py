"""Schema of the study of a rough surface, and its cases; documented in docs/howto/rough.md."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field, PlainValidator, Strict, ValidationError, model_validator

from meeframe.common.errors import CaseError, TooLargeError, listed
from meeframe.common.renamed import now_called
from meeframe.contact.feasibility import largest_pressures
from meeframe.fields import ELECTRIC, NORMAL, Array
from meeframe.fields.units import Quantity
from meeframe.indenters.heights import SampledHeights
from meeframe.indenters.topography import HeightMap, SurfaceStatistics
from meeframe.laws import StepConductivity
from meeframe.laws.base import ConductivityLaw
from meeframe.material.half_space import mean_compliance
from meeframe.material.material import Material
from meeframe.model.case import Case
from meeframe.model.load import case_from_tables
from meeframe.plugin.registry import Kind, Registry
from meeframe.plugin.validation import Problem, TableError, problems_of
from meeframe.study.declare import Table, Text
from meeframe.study.rough.pressures import Choice, mean_pressures, read_choice
from meeframe.study.rough.surface import diagnostics, prepare_surface, theory_slope

FORMULATION: Final = "half-space"
"""Formulation of rough contact, of the package meeframe-halfspace."""
PERFECT: Final = StepConductivity(math.inf)
"""Law of an interface without a film, which charges and currents pass wherever the surfaces touch."""
MAX_PLAUSIBLE_RATIO: Final = 2.0
"""Ratio of the smallest pressure to E* h' above which a study shows full contact alone."""
_CONDUCTANCE: Final = Quantity("S/m^2", ge=0)
_CURRENT_UNITS: Final = "S/m^2 S/m V/m"
"""Units of laws of currents."""


class RoughTable(Table):
    """Study of a rough surface.

    Attributes
    ----------
    title
        Title of results and figures.
    surface
        The surface, with the keys of [indenter] in a case file.
    material, contact, conductivity, formulation, solver
        Tables as in a case file; the formulation is half-space, and laws of the conductivity are those of charges.
    pressures
        Mean pressures that increase, their range, or a single one.
    periodic
        Whether the surface is one period; by default if its indenter is periodic.
    samples
        Number of nodes along x, to which the surface is resampled; by default that of its heights.
    electric_potential
        Potential of the surface; the charge is then computed.
    electrical_conductivity
        Conductivity of the body [S/m]; the contact conductance is then computed.
    contact_conductance
        Law of the interface for currents, or its conductance where the surfaces touch [S/m^2]; by default inf.
    stiffness
        Whether the incremental stiffness is computed, by two further loads for each pressure.
    """

    title: Text = "Rough contact"
    surface: Any
    material: dict[str, Any]
    contact: dict[str, Any] = Field(default_factory=dict)
    conductivity: dict[str, Any] = Field(default_factory=dict)
    formulation: dict[str, Any] = Field(default_factory=dict)
    solver: dict[str, Any] = Field(default_factory=dict)
    pressures: Annotated[Choice, PlainValidator(read_choice)] = None
    periodic: Annotated[bool, Strict()] | None = None
    samples: Annotated[int, Strict(), Field(ge=4)] | None = None
    electric_potential: Annotated[float, Quantity("V", gt=-float("inf"), lt=float("inf"))] | None = None
    electrical_conductivity: Annotated[float, Quantity("S/m", gt=0, lt=float("inf"))] | None = None
    contact_conductance: Any = None
    stiffness: Annotated[bool, Strict()] = True

    @model_validator(mode="after")
    def _check_formulation(self) -> "RoughTable":
        if "name" in self.formulation and self.formulation["name"] != FORMULATION:
            raise ValueError(f"formulation.name = {self.formulation['name']!r}; allowed: {FORMULATION}")
        if "periodic" in self.formulation:
            raise ValueError("formulation.periodic: allowed: the key periodic of the study in its place")
        return self

    @model_validator(mode="after")
    def _check_currents(self) -> "RoughTable":
        has_currents, has_law = self.electrical_conductivity is not None, self.contact_conductance is not None
        if has_law and not has_currents:
            raise ValueError("contact_conductance: needs electrical_conductivity, the conductivity of the body")
        if has_currents and "electric" in self.conductivity and not has_law:
            raise ValueError(
                f"conductivity.electric: for currents {now_called('contact_conductance')} [S/m^2]; allowed with "
                "electrical_conductivity: both, conductivity.electric for charges [F/m^2], or contact_conductance alone"
            )
        return self


@dataclass(frozen=True, eq=False)
class RoughStudy:
    """A checked study: the surface on its grid, the case of its pressures, and properties of both.

    Attributes
    ----------
    table : RoughTable
        The study as declared.
    surface : HeightMap
        Surface on the grid of the contact, peaks up.
    statistics : SurfaceStatistics
        Its statistics.
    case : Case
        The case with one load step for each pressure, at the potential of the study.
    pressures : Array
        Mean pressures, (m,) [Pa].
    slope : float
        Root mean square slope of theories: by the spectrum if the surface is periodic, by differences of neighbours
        about the mean plane if not, because a window changes the slope.
    modulus : float
        Contact modulus E* of the insulated surface, averaged over directions [Pa].
    bound : float
        Largest pressure that the contact law bears [Pa].
    is_coupled : bool
        Whether mechanical and electric fields are coupled.
    current_law : ConductivityLaw
        Law of the interface for currents.
    """

    table: RoughTable
    surface: HeightMap
    statistics: SurfaceStatistics
    case: Case
    pressures: Array
    slope: float
    modulus: float
    bound: float
    is_coupled: bool
    current_law: ConductivityLaw

    @property
    def pressure_scale(self) -> float:
        """Pressure E* h' of theories [Pa]."""
        return self.modulus * self.slope

    @property
    def warnings(self) -> tuple[str, ...]:
        """Properties of the surface and its pressures that are hardly plausible, in words."""
        texts, least, scale = list(diagnostics(self.surface, self.slope)), self.pressures.min(), self.pressure_scale
        if least > MAX_PLAUSIBLE_RATIO * scale:
            texts.append(
                f"the smallest pressure, {least:.3g} Pa, is {least / scale:.3g} times E* h' ({scale:.3g} Pa), at which "
                "nearly the whole surface is in contact; probably heights or coordinates have another unit "
                "(surface.unit, surface.lateral_unit)"
            )
        return tuple(texts)


def declare(tables: Mapping[str, Any], registry: Registry, folder: Path = Path(), origin: str = "") -> RoughStudy:
    """Return the checked study of its tables.

    Parameters
    ----------
    tables : mapping
        Keys of RoughTable; `surface` may also be a HeightMap or an Indenter.
    registry : Registry
        Registry in which names are looked up.
    folder : Path, optional
        Folder in which relative paths start.
    origin : str, optional
        Beginning of each message, such as the name of the file and a colon.

    Returns
    -------
    RoughStudy
        The study.

    Raises
    ------
    CaseError
        With a line for each problem: key, value and what is allowed.
    """
    try:
        table = _table(tables)
        local = replace(registry, folder=folder)
        law = _current_law(table.contact_conductance, local)
        surface = prepare_surface(table.surface, table.periodic, table.samples, local)
        return _study(table, surface, law, registry, folder)
    except TableError as error:
        raise CaseError(listed(f"{origin}{problem}" for problem in error.problems)) from error.__cause__
    except TooLargeError as error:
        raise TooLargeError(f"{origin}{error}") from None


def _table(tables: Mapping[str, Any]) -> RoughTable:
    try:
        return RoughTable.model_validate(dict(tables))
    except ValidationError as error:
        problems = problems_of(error, RoughTable)
        raise TableError(
            *(problem if problem.location else Problem((), problem.text) for problem in problems)
        ) from None


def _study(table: RoughTable, surface: HeightMap, law: ConductivityLaw, registry: Registry, folder: Path) -> RoughStudy:
    statistics = SurfaceStatistics.of(surface)
    slope = theory_slope(surface, statistics)
    first = _case(table, surface, registry, folder)
    modulus, _ = mean_response(first.material)
    bound = float(largest_pressures(first.contact_law, surface.heights.size).mean())
    pressures = mean_pressures(table.pressures, modulus * slope, bound)
    area = float(np.prod(surface.size if surface.is_periodic else _extents(surface)))
    step = first.steps[0]
    steps = tuple(replace(step, normal_force=pressure * area) for pressure in pressures)
    coupled = bool(np.any(first.material.piezoelectric) or np.any(first.material.magnetoelectric))
    case = replace(first, steps=steps)
    return RoughStudy(table, surface, statistics, case, np.array(pressures), slope, modulus, bound, coupled, law)


def _current_law(value: Any, registry: Registry) -> ConductivityLaw:
    """Return the law of the key contact_conductance: a conductance [S/m^2], the name or table of a law, or a law."""
    if value is None:
        return PERFECT
    try:
        if isinstance(value, Mapping | ConductivityLaw) or value in registry.names(Kind.CONDUCTIVITY_LAW):
            law: ConductivityLaw = replace(registry, unit=_CURRENT_UNITS).create(Kind.CONDUCTIVITY_LAW, value)
            return law
        return StepConductivity(_CONDUCTANCE.check(value))
    except TableError as error:
        problems = (problem.inside("contact_conductance") for problem in error.problems)
        raise TableError(*problems) from error.__cause__
    except ValueError as error:
        raise TableError(Problem(("contact_conductance",), f"{error}, or a conductivity law", value)) from None


def _extents(surface: HeightMap) -> tuple[float, float]:
    return float(np.ptp(surface.x)), float(np.ptp(surface.y))


def _case(table: RoughTable, surface: HeightMap, registry: Registry, folder: Path) -> Case:
    """Return the case with a force of 1 N."""
    potential = {} if table.electric_potential is None else {"electric_potential": table.electric_potential}
    conductivity = dict(table.conductivity)
    if potential:
        conductivity.setdefault("electric", {"name": "step", "kappa": float("inf")})
    x, y = ((axis - (axis[0] + axis[-1]) / 2.0) for axis in (surface.x, surface.y))
    tables = {
        "title": table.title,
        "material": table.material,
        "mesh": {
            "type": "half-space",
            "contact_width": list(_extents(surface)),
            "divisions": [count - 1 for count in surface.shape],
            "rings": 1,
        },
        # peaks up touch first: the surface of the indenter is lowest there
        "indenter": {"name": SampledHeights.on_grid(x, y, -surface.heights), **potential},
        "contact": table.contact,
        "conductivity": conductivity,
        "formulation": {"name": FORMULATION, "periodic": surface.is_periodic, **table.formulation},
        "solver": table.solver,
        "steps": [{"normal_force": 1.0}],
    }
    return case_from_tables({key: value for key, value in tables.items() if value != {}}, registry, folder)


def mean_response(material: Material) -> tuple[float, float]:
    """Return the moduli of a half space with normal x3, averaged over directions.

    Parameters
    ----------
    material : Material
        Material of the half space.

    Returns
    -------
    tuple of float
        Contact modulus E* [Pa], of the insulated surface, and permittivity [F/m], of the free one: a wave q of
        pressure p displaces the surface by 2 p / (E* q), a wave of charge s changes its potential by s / (eps q).
        The modulus is E / (1 - nu^2) of an isotropic material (Vlassak and Nix, Philos. Mag. A 67 (1993) 1045).
    """
    mean = mean_compliance(material.stiffness)
    return float(2.0 / mean[NORMAL, NORMAL]), float(1.0 / abs(mean[ELECTRIC, ELECTRIC]))


def conductor(material: Material, conductivity: float) -> Material:
    """Return the material in which electric fields represent steady currents.

    Parameters
    ----------
    material : Material
        Material with the elastic constants.
    conductivity : float
        Electrical conductivity [S/m], which takes the place of the permittivity.

    Returns
    -------
    Material
        Material without coupling, whose charges are currents.
    """
    return replace(
        material,
        piezoelectric=np.zeros((3, 3, 3)),
        magnetoelectric=np.zeros((3, 3)),
        permittivity=conductivity * np.eye(3),
    )
