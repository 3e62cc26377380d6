"""Schema of the study of a rough surface, and its cases; documented in docs/howto/rough.md."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field, PlainValidator, Strict, ValidationError, model_validator

from meeframe.common.errors import CaseError, TooLargeError, listed
from meeframe.common.memory import usable_memory
from meeframe.contact.feasibility import largest_pressures
from meeframe.fields import ELECTRIC, NORMAL, Array
from meeframe.fields.units import Quantity
from meeframe.indenters.base import Indenter
from meeframe.indenters.heights import SampledHeights
from meeframe.indenters.topography import HeightMap, SurfaceStatistics, detrend, resample, topography_of
from meeframe.indenters.topography.preparation import check_full
from meeframe.laws import StepConductivity
from meeframe.material.half_space import mean_compliance
from meeframe.material.material import Material
from meeframe.mesh.generators import BYTES_PER_NODE
from meeframe.model.case import Case
from meeframe.model.load import case_from_tables
from meeframe.plugin.registry import Kind, Registry
from meeframe.plugin.validation import Problem, TableError, problems_of
from meeframe.study.declare import Table, Text
from meeframe.study.rough.pressures import Choice, mean_pressures, read_choice

FORMULATION: Final = "half-space"
"""Formulation of rough contact, of the package meeframe-halfspace."""
MAX_PLAUSIBLE_SLOPE: Final = 0.5
"""Root mean square slope above which heights probably have another unit; theories and half spaces need small ones."""
MAX_BORDER_RATIO: Final = 3.0
"""Largest jump at the border of a period, relative to the largest difference of neighbours, without a warning."""
_ROUND_OFF: Final = 100 * np.finfo(float).eps
"""Round-off of heights without their mean plane, relative to the largest height."""


class RoughTable(Table):
    """Study of a rough surface.

    Attributes
    ----------
    title
        Title of results and figures.
    surface
        The surface, with the keys of [indenter] in a case file.
    material, contact, conductivity, formulation, solver
        Tables as in a case file; the formulation is half-space.
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
    stiffness: Annotated[bool, Strict()] = True

    @model_validator(mode="after")
    def _check_formulation(self) -> "RoughTable":
        if "name" in self.formulation and self.formulation["name"] != FORMULATION:
            raise ValueError(f"formulation.name = {self.formulation['name']!r}; allowed: {FORMULATION}")
        if "periodic" in self.formulation:
            raise ValueError("formulation.periodic: allowed: the key periodic of the study in its place")
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

    @property
    def conducts_perfectly(self) -> bool:
        """True if currents and charges pass the contact without a film, wherever the surfaces touch."""
        law = self.case.conductivity["electric"]
        return "electric" not in self.table.conductivity or law == StepConductivity(math.inf)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Properties of the surface that are hardly plausible, in words."""
        return tuple(_doubts(self.surface, self.slope))


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
        surface = _surface(table, replace(registry, folder=folder))
        return _study(table, surface, registry, folder)
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


def _surface(table: RoughTable, registry: Registry) -> HeightMap:
    """Return the full surface at the nodes of the contact."""
    try:
        if table.samples is not None:
            _check_memory((table.samples, 2), "samples")
        surface = table.surface if isinstance(table.surface, HeightMap) else _map_of(table, registry)
        if table.periodic is not None:
            surface = replace(surface, is_periodic=table.periodic)
        if table.samples is not None and table.samples != surface.shape[0]:
            shape = table.samples, max(2, round(table.samples * surface.shape[1] / surface.shape[0]))
            _check_memory(shape, "samples")
            surface = resample(surface, shape)
        _check_memory(surface.shape, "surface")
        _ = surface.spacing
        check_full(surface, "heights")
        return surface
    except TableError as error:
        raise TableError(*(problem.inside("surface") for problem in error.problems)) from error.__cause__
    except TooLargeError:
        raise
    except CaseError as error:
        raise TableError(Problem(("surface",), str(error))) from error.__cause__


def _check_memory(shape: tuple[int, int], key: str) -> None:
    """Raise TooLargeError if a run on a grid needs more memory than the machine has."""
    required, available = shape[0] * shape[1] * BYTES_PER_NODE, usable_memory()
    if required > available:
        most = math.isqrt(available // BYTES_PER_NODE)
        raise TooLargeError(
            f"{key} = {shape[0]}: a run with at least {shape[0]} x {shape[1]} nodes needs at least "
            f"{required // 10**9} GB; this machine has {available / 1e9:.3g} GB; allowed: about {most} x {most} nodes"
        )


def _map_of(table: RoughTable, registry: Registry) -> HeightMap:
    indenter: Indenter = registry.create(Kind.INDENTER, table.surface)
    shape = getattr(indenter, "grid_shape", None)
    if shape is not None:
        _check_memory(shape, "surface.samples")
    surface = topography_of(indenter)
    if surface is None:
        raise CaseError(
            f"{type(indenter).__name__} is not known as heights on a grid; allowed: height-map or self-affine"
        )
    return surface


def _study(table: RoughTable, surface: HeightMap, registry: Registry, folder: Path) -> RoughStudy:
    statistics = SurfaceStatistics.of(surface)
    slope = statistics.rms_slope_spectrum if surface.is_periodic else detrend(surface).rms_slope
    # a plane has no waves but round-off
    if not slope > _ROUND_OFF * float(np.abs(surface.heights).max()) / min(surface.spacing):
        raise TableError(Problem(("surface",), "is flat: its heights are those of a plane; allowed: a rough surface"))
    first = _case(table, surface, (1.0,), registry, folder)
    modulus, _ = mean_response(first.material)
    bound = float(largest_pressures(first.contact_law, surface.heights.size).mean())
    pressures = mean_pressures(table.pressures, modulus * slope, bound)
    area = float(np.prod(surface.size if surface.is_periodic else _extents(surface)))
    step = first.steps[0]
    steps = tuple(replace(step, normal_force=pressure * area) for pressure in pressures)
    coupled = bool(np.any(first.material.piezoelectric) or np.any(first.material.magnetoelectric))
    case = replace(first, steps=steps)
    return RoughStudy(table, surface, statistics, case, np.array(pressures), slope, modulus, bound, coupled)


def _doubts(surface: HeightMap, slope: float) -> Iterator[str]:
    if slope > MAX_PLAUSIBLE_SLOPE:
        yield (
            f"the root mean square slope of the surface is {slope:.3g}, more than {MAX_PLAUSIBLE_SLOPE}, where half "
            "spaces do not apply; probably its heights, or its coordinates, have another unit (surface.unit)"
        )
    if not surface.is_periodic:
        return
    for axis, name in enumerate("xy"):
        heights = np.moveaxis(surface.heights, axis, 0)
        jump, inner = (float(np.abs(step).max()) for step in (heights[0] - heights[-1], np.diff(heights, axis=0)))
        if jump > MAX_BORDER_RATIO * inner:
            yield (
                f"the periodic surface jumps by up to {jump:.3g} m at its border along {name}, and by {inner:.3g} m "
                "between neighbours; level it (surface.levelled), or set periodic = false"
            )


def _extents(surface: HeightMap) -> tuple[float, float]:
    return float(np.ptp(surface.x)), float(np.ptp(surface.y))


def _case(
    table: RoughTable, surface: HeightMap, pressures: tuple[float, ...], registry: Registry, folder: Path
) -> Case:
    """Return the case with loads of these forces [N]."""
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
        "steps": [{"normal_force": pressure} for pressure in pressures],
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
