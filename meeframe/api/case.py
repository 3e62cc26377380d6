"""Cases built in Python: the same tables, checks and messages as those of case files."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from meeframe.api.named import described, keys_of, relative
from meeframe.api.progress import Show, shown
from meeframe.api.tables import (
    Amount,
    Base,
    Boundary,
    Contact,
    Interface,
    Layer,
    SecondBody,
    Step,
    check_types,
    entries,
    from_zero,
)
from meeframe.common.arguments import checked_arguments
from meeframe.common.errors import CaseError
from meeframe.common.toml import read_toml, toml_tables, toml_text
from meeframe.contact.problem import Solver
from meeframe.fields import THERMAL_FIELD
from meeframe.formulations.base import Formulation
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.indenters import Placement
from meeframe.indenters.base import Indenter
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.material import Material
from meeframe.material.tables import material_table
from meeframe.mesh import MeshRecipe
from meeframe.mesh.surface import SurfaceMesh
from meeframe.model.case import Case as CheckedCase
from meeframe.model.data import Output
from meeframe.model.load import case_from_tables
from meeframe.model.solve import solve_case
from meeframe.plugin import registry as plugins
from meeframe.plugin.registry import Registry
from meeframe.plugin.validation import Problem, TableError
from meeframe.results.result import Result
from meeframe.solvers import Auto, StoppingCriteria
from meeframe.study import run as study

_PATHS: Final = (("mesh", "file"), ("material", "file"), ("restart", "from"))
_PLACEMENT: Final = tuple(Placement.__dataclass_fields__)
_STOPPING: Final = tuple(StoppingCriteria.__dataclass_fields__)


@checked_arguments
@dataclass(frozen=True, eq=False, repr=False)
class Case:
    """Contact problem with its load steps, checked when it is created.

    Quantities are numbers in SI units or texts with units, such as "5 mm". Paths are relative to the working directory.

    Parameters
    ----------
    material : str, mapping or Material
        Name of a material of the library, table as in a case file, or material.
    mesh : MeshRecipe or SurfaceMesh
        Mesh of the body, from `meeframe.mesh.block`, `meeframe.mesh.half_space` or `meeframe.mesh.file`, or the mesh
        itself, which no case file can hold.
    indenter : Indenter
        Shape of the rigid indenter, such as `meeframe.Sphere`, or the distance between two deformable bodies.
    steps : sequence of Step
        Load steps in their order.
    boundary : sequence of Boundary, optional
        Boundary conditions.
    contact : ContactLaw or Contact, optional
        Contact law, such as `meeframe.IsotropicCoulomb`, or the law with its zone and axes; frictionless by default.
    conductivity : mapping of str to ConductivityLaw, optional
        Conductivity laws of the contact, such as {"electric": meeframe.StepConductivity(float("inf"))}; insulating by
        default.
    placement : Placement, optional
        Position and axis of the indenter.
    potentials : mapping of str to float or str, optional
        Initial potentials of the indenter, such as {"electric_potential": "5 V"}; zero by default.
    formulation : Formulation, optional
        Discretisation of the body.
    solver : Solver, optional
        Contact solver.
    stopping : StoppingCriteria, optional
        Criteria that end an iteration.
    layers : sequence of Layer, optional
        Layers on the body, from the surface down.
    base : Base, optional
        Rigid base below the material of a half space.
    second_body : SecondBody, optional
        Second of two deformable bodies.
    restart : str or Path, optional
        Folder of a run to continue.
    output : Output, optional
        Files and fields that `solve` writes into a folder.
    title : str, optional
        Title of the case.
    plugins : sequence of str or Path, optional
        Local plugin files whose names a case file may use.

    Attributes
    ----------
    checked : Case
        Case as all parts of meeframe take it, with material, mesh, laws and steps as objects in SI units.

    Raises
    ------
    MeeframeError
        If the case is not valid, with one line for each problem: argument, value and what is allowed.
    """

    material: str | Mapping[str, Any] | Material
    mesh: MeshRecipe | SurfaceMesh
    indenter: Indenter
    steps: Sequence[Step]
    boundary: Sequence[Boundary] = ()
    contact: ContactLaw | Contact = field(default_factory=Contact)
    conductivity: Mapping[str, ConductivityLaw] = field(default_factory=dict)
    placement: Placement = field(default_factory=Placement)
    potentials: Mapping[str, Amount] = field(default_factory=dict)
    formulation: Formulation = field(default_factory=DenseBEM)
    solver: Solver = field(default_factory=Auto)
    stopping: StoppingCriteria = field(default_factory=StoppingCriteria)
    second_body: SecondBody | None = None
    restart: str | Path | None = None
    output: Output = field(default_factory=Output)
    title: str = ""
    plugins: Sequence[str | Path] = ()
    layers: Sequence[Layer] = ()
    base: Base | None = None
    checked: CheckedCase = field(init=False)

    def __post_init__(self) -> None:
        check_types(self)
        try:
            checked = case_from_tables(_texts(self._tables()), self._registry)
        except TableError as error:
            raise CaseError("\n".join(map(_in_python, error.problems))) from error.__cause__
        with suppress(CaseError):  # an object without a name in case files
            checked = replace(checked, text=self.to_toml())
        object.__setattr__(self, "checked", checked)  # as frozen dataclasses set fields that follow from others

    def __repr__(self) -> str:
        """Return a line instead of all parts, which `to_toml` shows."""
        case = self.checked
        counts = f"{case.mesh.n_elements} elements, {len(case.steps)} load steps, {case.n_increments} increments"
        return f"Case({self.title!r}: {case.material.name or 'material without a name'}, {counts})"

    def __eq__(self, other: object) -> bool:
        """Return whether two cases have the same case file; those that no case file can hold equal only themselves."""
        if not isinstance(other, Case):
            return NotImplemented
        try:
            return self is other or self.to_toml() == other.to_toml()
        except CaseError:
            return False

    def __hash__(self) -> int:
        """Return a hash that agrees with equality."""
        return hash((self.title, len(self.steps)))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the case, in words, none of which prevents its solution."""
        return self.checked.warnings

    def solve(self, out: str | Path | None = None, *, overwrite: bool = False, progress: Show = None) -> Result:
        """Solve the case.

        Parameters
        ----------
        out : str or Path, optional
            Folder for result.h5, summary.json, figures and fields.vtu; without it nothing is written.
        overwrite : bool, optional
            True to replace results of an earlier run in the folder.
        progress : bool or callable, optional
            True to show progress bars, by default in terminals and notebooks; or a function that is called with the
            stage and the fraction of it that is done.

        Returns
        -------
        Result
            Results of all increments. An increment that does not converge raises nothing: its status reports it.

        Raises
        ------
        Interrupted
            After Ctrl-C or an interruption of the notebook's kernel. Its attribute `result` holds the increments that
            are finished, which are also in the folder; in a notebook it is `sys.last_value.result`.
        MeeframeError
            If the folder cannot be written, or a formulation refuses the body.
        """
        with shown(progress) as report:
            if out is None:
                return solve_case(self.checked, report)
            return study.run(self.checked, out, overwrite, report)

    def to_toml(self, file: str | Path | None = None) -> str:
        """Return the text of the case file, and write it if a file is given.

        Paths in it are relative to the folder of the file, or to the working directory.

        Parameters
        ----------
        file : str or Path, optional
            File to write.

        Returns
        -------
        str
            Text of the case file.

        Raises
        ------
        CaseError
            If an object has no name in case files, or the file cannot be written.
        """
        folder = Path() if file is None else Path(file).parent
        text = toml_text(relative(described(self._tables(), self._registry), folder))
        if file is not None:
            try:
                Path(file).write_text(text, encoding="utf-8")
            except OSError as error:
                raise CaseError(f"{file}: cannot be written: {error.strerror or error}") from None
        return text

    @classmethod
    def from_toml(cls, source: str | Path, *, plugins: Sequence[str | Path] = ()) -> "Case":
        """Return the case of a case file, or of the text of one, which has several lines.

        Parameters
        ----------
        source : str or Path
            Path of the file, or its text.
        plugins : sequence of str or Path, optional
            Local plugin files whose names it uses.

        Returns
        -------
        Case
            The case.

        Raises
        ------
        MeeframeError
            If it is not valid, with one line for each problem: file, key, value and what is allowed.
        """
        if isinstance(source, str) and "\n" in source:
            file, tables = "", _read(source)
        else:
            file, tables = f"{source}: ", read_toml(Path(source))[1]
        folder = Path() if not file else Path(source).parent
        registry = _registry(plugins)
        try:
            checked = case_from_tables(tables, registry, folder)
        except TableError as error:
            raise CaseError("\n".join(f"{file}{problem}" for problem in error.problems)) from error.__cause__
        return _from_tables(_placed(tables, folder), checked, plugins)

    @property
    def _registry(self) -> Registry:
        return _registry(self.plugins)

    def _tables(self) -> dict[str, Any]:
        """Return the tables of the case file, with objects and paths as they are."""
        contact = self.contact if isinstance(self.contact, Contact) else Contact(self.contact)
        registry = self._registry
        tables: dict[str, Any] = {
            "title": self.title,
            "material": _material(self.material),
            "mesh": _mesh(self.mesh),
            "boundary": [entries(record) for record in self.boundary],
            **_layers(self),
            "contact": {key: _named(value) if key == "law" else value for key, value in entries(contact).items()},
            "conductivity": {name: _named(law) for name, law in self.conductivity.items()},
            "indenter": {"name": self.indenter, **keys_of(self.placement, registry), **self.potentials},
            "formulation": _named(self.formulation),
            "solver": {"name": self.solver, **keys_of(self.stopping, registry)},
            "steps": [entries(record) for record in self.steps],
            "output": keys_of(self.output, registry),
        }
        if self.restart is not None:
            tables["restart"] = {"from": Path(self.restart)}
        if self.second_body is not None:
            other = self.second_body
            tables["second_body"] = {
                "material": _material(other.material),
                "mesh": _mesh(other.mesh),
                "boundary": [entries(record) for record in other.boundary],
                **_layers(other),
                "zone": other.zone,
                "formulation": _named(other.formulation),
            }
        return {key: value for key, value in tables.items() if key == "steps" or not _is_empty(value)}


def _named(value: Any) -> Any:
    """Return a name alone, which case files allow in place of an object, as its table: both are the same case."""
    return {"name": value} if isinstance(value, str) else value


def _is_empty(value: Any) -> bool:
    return isinstance(value, str | Mapping | list) and not value


def run(
    case: Case | CheckedCase | str | Path, out: str | Path, overwrite: bool = False, progress: Show = False
) -> Result:
    """Solve a case, or a case file, and write its results into a folder.

    Parameters
    ----------
    case : Case, str or Path
        Case, or path of a case file.
    out, overwrite, progress
        As for `Case.solve`.

    Returns
    -------
    Result
        Results of all increments.

    Raises
    ------
    Interrupted, MeeframeError
        As `Case.solve`.
    """
    with shown(progress) as report:
        return study.run(case.checked if isinstance(case, Case) else case, out, overwrite, report)


def _registry(files: Sequence[str | Path]) -> Registry:
    return plugins.load(*map(Path, files))


def _read(text: str) -> dict[str, Any]:
    try:
        return toml_tables(text)
    except (ValueError, RecursionError) as error:
        raise CaseError(f"the text is not a case file: {error}") from None


def _material(material: str | Mapping[str, Any] | Material) -> Any:
    """Return the [material] table of a material."""
    if isinstance(material, str):
        return {"name": material}
    if not isinstance(material, Material):
        return material
    table = material_table(material)  # which has the conductivity for heat among its components
    further = {
        scalar.coefficient: np.asarray(value).tolist()
        for scalar, value in material.decoupled
        if scalar != THERMAL_FIELD
    }
    return table | further


def _layers(body: Case | SecondBody) -> dict[str, Any]:
    """Return the tables of the layers and the base of a body."""
    layers = [
        {
            **entries(layer),
            "material": _material(layer.material),
            "interface": entries(layer.interface) if isinstance(layer.interface, Interface) else layer.interface,
        }
        for layer in body.layers
    ]
    base = {} if body.base is None else {"base": entries(body.base)}
    return base | ({"layers": layers} if layers else {})


def _mesh(mesh: MeshRecipe | SurfaceMesh) -> Any:
    return dict(mesh.table) if isinstance(mesh, MeshRecipe) else mesh


def _texts(value: Any) -> Any:
    """Return entries with paths as texts."""
    if isinstance(value, Mapping):
        return {key: _texts(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_texts(entry) for entry in value]
    return str(value) if isinstance(value, Path) else value


def _placed(tables: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return tables of a case file with paths relative to the working directory."""
    for name, key in _PATHS:
        if isinstance(tables.get(name), Mapping) and key in tables[name]:
            tables = {**tables, name: {**tables[name], key: folder / tables[name][key]}}
    if "grading" in tables:
        tables = {**tables, "grading": _placed(tables["grading"], folder)}
    if "layers" in tables:
        tables = {**tables, "layers": [_placed(layer, folder) for layer in tables["layers"]]}
    if "second_body" in tables:
        tables = {**tables, "second_body": _placed(tables["second_body"], folder)}
    return tables


def _from_tables(tables: Mapping[str, Any], checked: CheckedCase, files: Sequence[str | Path]) -> Case:
    """Return the case of checked tables: steps, boundary, potentials and mesh as there, all else as checked objects."""
    other = None
    if checked.second_body is not None:
        table, second_body = tables["second_body"], checked.second_body
        other = SecondBody(
            table["material"],
            MeshRecipe(table["mesh"]),
            _boundary(table),
            second_body.zone,
            second_body.formulation,
            *_layers_of(table),
        )
    layers, base = _layers_of(tables)
    return Case(
        material=tables["material"],
        mesh=MeshRecipe(tables["mesh"]),
        indenter=checked.indenter,
        steps=tuple(Step(**_with_scalars(table, Step)) for table in tables["steps"]),
        boundary=_boundary(tables),
        contact=Contact(
            checked.contact_law,
            checked.zone,
            checked.axes,
            checked.friction_heat,
            checked.joule_heat,
            checked.wear,
            checked.surface,
        ),
        conductivity={name: law for name, law in checked.conductivity.items() if name in tables["conductivity"]}
        if "conductivity" in tables
        else {},
        placement=checked.placement,
        potentials={name: tables["indenter"][name] for name in checked.potentials if name in tables["indenter"]},
        formulation=checked.formulation,
        solver=checked.solver,
        stopping=checked.stopping,
        second_body=other,
        restart=tables["restart"]["from"] if "restart" in tables else None,
        output=checked.output,
        title=checked.title,
        plugins=tuple(files),
        layers=layers,
        base=base,
    )


def _layers_of(tables: Mapping[str, Any]) -> tuple[tuple[Layer, ...], Base | None]:
    """Return the layers and the base in the tables of a body."""
    layers = []
    for table in tables.get("layers", ()):
        interface = table.get("interface", "bonded")
        if isinstance(interface, Mapping):
            interface = Interface(**_with_scalars(interface, Interface))
        layers.append(Layer(**{**table, "interface": interface}))
    base = tables.get("base")
    return tuple(layers), None if base is None else Base(**_with_scalars(base, Base))


def _boundary(tables: Mapping[str, Any]) -> tuple[Boundary, ...]:
    return tuple(Boundary(**_with_scalars(table, Boundary)) for table in tables.get("boundary", ()))


def _with_scalars(table: Mapping[str, Any], record: type[Step | Boundary | Interface | Base]) -> dict[str, Any]:
    """Return the arguments of a record: keys of fields that plugins add go into `scalars`."""
    known = {key: value for key, value in table.items() if key in record.__dataclass_fields__}
    return {**known, "scalars": {key: value for key, value in table.items() if key not in known}}


def _in_python(problem: Problem) -> str:
    """Return a problem of the tables with the names of the arguments, and entries of lists counted from zero."""
    match problem.location:
        case ("contact", "law", *rest):
            location: tuple[str | int, ...] = ("contact", *rest)
        case ("indenter" | "solver" as owner, "name"):
            location = (owner,)
        case ("indenter", str(key), *rest):
            location = ("placement" if key in _PLACEMENT else "potentials", key, *rest)
        case ("solver", str(key), *rest) if key in _STOPPING:
            location = ("stopping", key, *rest)
        case ("restart", "from"):
            location = ("restart",)
        case rest:
            location = rest
    return f"Case: {from_zero(replace(problem, location=location))}"
