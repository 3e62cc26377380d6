"""Loading of a case file into a case; every problem of the file is reported before anything is computed."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar
from weakref import WeakValueDictionary

from pydantic import ValidationError

from meeframe.common.errors import CaseError, MeeframeError, listed
from meeframe.common.toml import check_values, read_toml
from meeframe.contact.problem import Solver
from meeframe.fields import FieldSet
from meeframe.material import Material, material_from_table
from meeframe.material.layers import Interface, Layer, LayerStack
from meeframe.material.tables import rotate_by_table
from meeframe.mesh import Grading, block_mesh, half_space_mesh, read_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.surface import SurfaceMesh
from meeframe.model.body_tables import BlockTable, BoundaryTable, FileTable, HalfSpaceTable, MeshTable, SecondBodyTable
from meeframe.model.case import Case
from meeframe.model.data import Output
from meeframe.model.layer_tables import GradingTable, LayerTable
from meeframe.model.locate import locate, locate_in_second_body
from meeframe.model.restart import Restart, read_restart
from meeframe.model.schema import CaseTable, RestartTable
from meeframe.model.second_body import SecondBody
from meeframe.plugin import registry as plugins
from meeframe.plugin.registry import Kind, Registry
from meeframe.plugin.validation import Problem, TableError, problems_of

T = TypeVar("T")

_MESHES: Final[WeakValueDictionary[BlockTable | HalfSpaceTable, SurfaceMesh]] = WeakValueDictionary()
"""Generated meshes of the cases that exist: the points of a sweep share one, with its checks and its contact zone."""


def load_case(path: str | Path, registry: Registry | None = None) -> Case:
    """Return the checked case of a case file.

    Parameters
    ----------
    path : str or Path
        The case file.
    registry : Registry, optional
        Registry in which names are looked up; by default the built-ins and the installed plugins.

    Returns
    -------
    Case
        The case, whose keys and values are all checked.

    Raises
    ------
    CaseError
        If the file cannot be read or is not valid, with one line for each problem: file, key, value and what is
        allowed. `__cause__` is the original exception if the code of a plugin failed.
    """
    file = Path(path)
    text, tables = read_toml(file)
    if "case" in tables and "material" not in tables:
        raise CaseError(
            f"{file}: is a study of the case file {tables['case']!r}: run it by `meeframe sweep` or `reproduce`"
        )
    try:
        return case_from_tables(tables, registry, file.parent, text, str(file))
    except TableError as error:
        raise CaseError(listed(f"{file}: {problem}" for problem in error.problems)) from error.__cause__


def case_from_tables(
    tables: Mapping[str, Any], registry: Registry | None = None, folder: Path = Path(), text: str = "", file: str = ""
) -> Case:
    """Return the checked case of the tables of a case file.

    Parameters
    ----------
    tables : dict of str to object
        Tables of the file.
    registry : Registry, optional
        Registry of plugins; by default everything that is installed.
    folder : Path, optional
        Folder at which relative paths in the tables start.
    text : str, optional
        Text of the file, which the result stores.
    file : str, optional
        Name of the file.

    Returns
    -------
    Case
        The case.

    Raises
    ------
    TableError
        If the tables are not valid: a CaseError with all problems found.
    """
    try:
        check_values(tables)
    except ValueError as error:
        raise TableError(Problem((), str(error))) from None
    registry = replace(registry or plugins.load(), folder=folder)
    problems: list[Problem] = []
    material = _material([], tables, registry, folder)
    fields = registry.fields if material is None else material.fields
    checked = _attempt(problems, lambda: _validate(tables, registry, fields))
    material = _material(problems, tables, registry, folder)
    other_material = _material(problems, tables.get("second_body"), registry, folder, "second_body")
    if checked is None:
        raise TableError(*problems)
    mesh = _attempt(problems, lambda: _mesh(checked.mesh, registry, folder), "mesh")
    other, second_body = checked.second_body, None
    if other is not None and other_material is not None:
        second_body = _attempt(problems, lambda: _second_body(other, other_material, registry, folder), "second_body")
    restart = _attempt(problems, lambda: _restart(checked.restart, folder, file))
    layers = _attempt(problems, lambda: _layers(checked, registry, folder))
    if material is None or mesh is None or layers is None or problems:
        raise TableError(*problems)
    assemble = partial(_assemble, checked, material, mesh, layers, second_body, restart, text)
    try:
        return assemble(checked.solver.named)
    except MeeframeError as error:
        body = Body.of(material, mesh, (), checked.contact.zone, layers)
        problem = locate(error, checked, body, second_body, restart, assemble)
        raise TableError(problem.quoting(tables)) from error.__cause__
    except MemoryError as error:
        raise TableError(_no_memory(error, "mesh")) from None


def _attempt(problems: list[Problem], make: Callable[[], T], *location: str | int) -> T | None:
    """Return the result of make(), or None with its problems added to the list.

    A single run thus reports all problems.
    """
    try:
        return make()
    except TableError as error:
        problems += [problem.inside(*location) for problem in error.problems]
    except MeeframeError as error:
        problems.append(Problem(location, str(error), cause=error.__cause__))
    except MemoryError as error:
        problems.append(_no_memory(error, *location))
    return None


def _material(problems: list[Problem], table: Any, registry: Registry, folder: Path, *location: str) -> Material | None:
    """Return the material in the table of a body, or None; a missing material is reported by the validation."""
    if not isinstance(table, Mapping) or not isinstance(table.get("material"), Mapping):
        return None
    make = partial(material_from_table, table["material"], folder, registry.scalar_fields)
    return _attempt(problems, make, *location, "material")


def _second_body(table: SecondBodyTable, material: Material, registry: Registry, folder: Path) -> SecondBody:
    problems: list[Problem] = []
    mesh = _attempt(problems, lambda: _mesh(table.mesh, registry, folder), "mesh")
    layers = _attempt(problems, lambda: _layers(table, registry, folder))
    if mesh is None or layers is None:
        raise TableError(*problems)
    try:
        return SecondBody(material, mesh, _conditions(table.boundary), table.zone, table.formulation, layers)
    except MeeframeError as error:
        body = Body.of(material, mesh, (), table.zone, layers)
        raise TableError(locate_in_second_body(error, table, body)) from error.__cause__
    except MemoryError as error:
        raise TableError(_no_memory(error, "mesh")) from None


def _layers(table: CaseTable | SecondBodyTable, registry: Registry, folder: Path) -> LayerStack:
    problems: list[Problem] = []
    layers: list[Layer] = []
    for number, layer in enumerate(table.layers):
        make = partial(_layer, layer, registry, folder)
        layers += _attempt(problems, make, "layers", number) or ()
    if problems:
        raise TableError(*problems)
    return LayerStack(tuple(layers), None if table.base is None else table.base.base())


def _layer(table: LayerTable, registry: Registry, folder: Path) -> tuple[Layer, ...]:
    """Return a layer, or the sublayers of a graded one."""
    problems: list[Problem] = []

    def make_material(value: Mapping[str, Any], *location: str) -> Material | None:
        make = partial(material_from_table, value, folder, registry.scalar_fields)
        material = _attempt(problems, make, *location, "material")
        if material is None or table.rotation is None:
            return material
        return _attempt(problems, partial(rotate_by_table, material, {"rotation": table.rotation}), "rotation")

    material = make_material(table.material)
    interface = _attempt(problems, table.interface.interface, "interface")
    graded = table.grading
    other = None if graded is None or graded.material is None else make_material(graded.material, "grading")
    if material is None or interface is None or problems:
        raise TableError(*problems)
    if graded is None:
        return (Layer(material, table.thickness, interface),)
    divide = partial(_sublayers, graded, other, material, table.thickness, interface)
    sublayers = _attempt(problems, divide, "grading")
    if sublayers is None:
        raise TableError(*problems)
    return sublayers


def _sublayers(
    table: GradingTable, other: Material | None, material: Material, thickness: float, interface: Interface
) -> tuple[Layer, ...]:
    return table.grading(other).sublayers(material, thickness, interface)


def _conditions(boundary: tuple[BoundaryTable, ...]) -> tuple[BoundaryCondition, ...]:
    return tuple(condition for table in boundary for condition in table.conditions())


def _no_memory(error: MemoryError, *location: str | int) -> Problem:
    return Problem(location, f"needs more memory than is available: {str(error) or 'none left'}")


def _assemble(
    table: CaseTable,
    material: Material,
    mesh: SurfaceMesh,
    layers: LayerStack,
    second_body: SecondBody | None,
    restart: Restart | None,
    text: str,
    solver: Solver,
) -> Case:
    return Case(
        material=material,
        mesh=mesh,
        conditions=_conditions(table.boundary),
        indenter=table.indenter.named,
        restart=restart,
        steps=tuple(step.step() for step in table.steps),
        placement=table.indenter.record,
        potentials=table.indenter.potentials,
        zone=table.contact.zone,
        contact_law=table.contact.law,
        axes=table.contact.axes,
        friction_heat=table.contact.friction_heat,
        joule_heat=table.contact.joule_heat,
        wear=table.contact.wear,
        surface=table.contact.surface,
        conductivity=table.conductivity.laws,
        formulation=table.formulation,
        solver=solver,
        stopping=table.solver.record,
        output=Output(table.output.figures, table.output.vtu, table.output.fields, table.output.step),
        second_body=second_body,
        layers=layers,
        title=table.title,
        text=text,
    )


def _validate(tables: Mapping[str, Any], registry: Registry, fields: FieldSet) -> CaseTable:
    model = CaseTable.of(fields)
    try:
        return model.model_validate(dict(tables), context=registry)
    except ValidationError as error:
        raise TableError(*problems_of(error, model)) from None


def _restart(table: RestartTable | None, folder: Path, file: str) -> Restart | None:
    if table is None:
        return None
    problem = Problem(("restart", "from"), "", table.folder)
    try:
        return read_restart(folder / table.folder, f"{file}: {problem}".lstrip(": ").rstrip(": "))
    except MeeframeError as error:
        raise TableError(replace(problem, text=str(error))) from None


def _mesh(table: MeshTable, registry: Registry, folder: Path) -> SurfaceMesh:
    if isinstance(table, SurfaceMesh):
        return table
    if isinstance(table, FileTable):
        return read_mesh(
            folder / table.file,
            [registry.create(Kind.ELEMENT, name) for name in registry.names(Kind.ELEMENT)],
            length_unit=table.scale,
            merge_tolerance=table.merge_tolerance,
            group_data=table.group_data,
            reorient=table.reorient,
        )
    mesh = _MESHES.get(table)
    if mesh is None:
        mesh = _MESHES[table] = _generated_mesh(table)
    return mesh


def _generated_mesh(table: BlockTable | HalfSpaceTable) -> SurfaceMesh:
    if isinstance(table, HalfSpaceTable):
        return half_space_mesh(
            table.half_widths,
            table.contact_width,
            table.divisions,
            table.rings,
            table.element,
            Grading(table.first_ring),
        )
    return block_mesh(
        table.half_width,
        table.height,
        table.contact_width,
        table.divisions,
        table.rings,
        table.layers,
        table.element,
        Grading(table.first_ring, table.layer_growth),
    )
