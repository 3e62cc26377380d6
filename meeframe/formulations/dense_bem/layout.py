"""Degrees of freedom: numbers of unknown values and fluxes and of contact loads, and prescribed data.

Every unknown has a collocation equation of the same number, see collocation.py. Data are in units of the system, with
lengths relative to a unit of length and fields scaled by FieldScaling.
"""

from dataclasses import dataclass, replace

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import Array, Indices
from meeframe.formulations.dense_bem.patches import Patches
from meeframe.formulations.dense_bem.units import Units
from meeframe.mesh.body import Body, BoundaryCondition, check_conditions
from meeframe.mesh.supports import check_supports
from meeframe.mesh.surface import SurfaceMesh
from meeframe.mesh.topology import boundary_polygon
from meeframe.system.reduced import NodalFields

NONE = -1
"""Index of a row or column that does not exist, because the field is known there."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Columns of unknowns and contact loads (NONE where there is none), and known data in units of the system.

    The values of the contact zone, all of them unknown, are numbered last and in the order of the zone.

    Attributes
    ----------
    patches : Patches
        Flux nodes.
    value_column, value_data : Indices, Array
        Column of each unknown value, and known values (zero where unknown), (p, fields).
    flux_column, flux_data : Indices, Array
        Column of each unknown flux, and known fluxes (zero where unknown), (m, fields).
    load_column : Indices
        Column of each contact load, (m, fields).
    zone : Indices
        Points of the contact zone, (n,).
    n_unknowns : int
        Size of the system.
    independent : int or None
        Field whose equations contain no other one, and whose unknowns come first.
    """

    patches: Patches
    value_column: Indices
    value_data: Array
    flux_column: Indices
    flux_data: Array
    load_column: Indices
    zone: Indices
    n_unknowns: int
    independent: int | None = None

    @property
    def n_independent(self) -> int:
        """Number of unknowns of the independent field."""
        columns = (self.value_column, self.flux_column)
        return 0 if self.independent is None else sum(int((c[:, self.independent] != NONE).sum()) for c in columns)


def number_first(layout: Layout, field: int) -> Layout:
    """Return the layout with the unknowns of one field before all others, each in the same order as before."""
    is_first = np.zeros(layout.n_unknowns, bool)
    for columns in (layout.value_column, layout.flux_column):
        is_first[columns[columns[:, field] != NONE, field]] = True
    number = np.empty(layout.n_unknowns, np.int64)
    number[is_first], number[~is_first] = np.split(np.arange(layout.n_unknowns), [is_first.sum()])
    value_column, flux_column = (
        np.where(columns == NONE, NONE, number[columns]) for columns in (layout.value_column, layout.flux_column)
    )
    return replace(layout, value_column=value_column, flux_column=flux_column, independent=field)


def lay_out(body: Body, patches: Patches, units: Units) -> Layout:
    """Assign numbers to the unknowns of a body.

    At the outer border of the mesh of a semi-infinite body all fields are taken as zero.

    Parameters
    ----------
    body : Body
        The body.
    patches : Patches
        Flux nodes of its mesh.
    units : Units
        Units of the system.

    Returns
    -------
    Layout
        Numbers and known data of all values, fluxes and loads.

    Raises
    ------
    MeshError
        For an unknown face group.
    CaseError
        If conditions contradict each other, touch the contact zone, or leave a field undetermined.
    """
    values = np.full((len(body.mesh.points), body.fields.size), np.nan)
    fluxes = np.zeros((len(patches.point), body.fields.size))
    flux_unknown = np.zeros(fluxes.shape, bool)
    check_conditions(body)
    check_supports(body)
    for condition in body.conditions:
        _apply(condition, body, patches, values, fluxes, flux_unknown)
    contact = np.zeros(len(patches.point), bool)
    if body.contact_group is not None:
        contact = patches.group == body.mesh.group(body.contact_group)
    _check_zone(body, values, patches.point[contact])
    if body.mesh.semi_infinite:
        border = np.unique(boundary_polygon(body.mesh))
        values[border] = np.where(np.isnan(values[border]), 0.0, values[border])
        flux_unknown[np.isin(patches.point, border)] = False

    unknown_value = np.isnan(values)
    zone = np.unique(patches.point[contact])
    in_zone = np.zeros(unknown_value.shape, bool)
    in_zone[zone] = unknown_value[zone]
    n_unknowns = int(unknown_value.sum() + flux_unknown.sum())
    value_column = _number(unknown_value & ~in_zone, 0)
    flux_column = _number(flux_unknown, int((unknown_value & ~in_zone).sum()))
    value_column[in_zone] = np.arange(n_unknowns - in_zone.sum(), n_unknowns)
    load_column = np.full(fluxes.shape, NONE)
    n_fields = body.fields.size
    load_column[contact] = n_fields * np.searchsorted(zone, patches.point[contact])[:, None] + np.arange(n_fields)
    return Layout(
        patches,
        value_column,
        units.values(np.where(unknown_value, 0.0, values)),
        flux_column,
        units.fluxes(np.where(flux_unknown, 0.0, fluxes)),
        load_column,
        zone,
        n_unknowns,
    )


def boundary_fields(
    layout: Layout, units: Units, mesh: SurfaceMesh, values: Array, fluxes: Array, loads: Array
) -> NodalFields:
    """Return the fields on the boundary at the nodes of each patch, in SI units and global axes.

    Parameters
    ----------
    layout : Layout
        Numbers of the unknowns.
    units : Units
        Units of the system.
    mesh : SurfaceMesh
        The mesh [m].
    values, fluxes : Array
        The unknowns, (u,) each, in units of values and of fluxes of the system.
    loads : Array
        Loads on the zone, (f n,), in units of fluxes of the system.

    Returns
    -------
    NodalFields
        Values and fluxes at the nodes of all patches.
    """
    all_values = _fill(layout.value_data, layout.value_column, values)
    all_fluxes = _fill(layout.flux_data, layout.flux_column, fluxes)
    all_fluxes = _fill(all_fluxes, layout.load_column, loads)
    points = layout.patches.point
    cells = tuple(
        (block.element.meshio_type, connectivity)
        for block, connectivity in zip(mesh.blocks, layout.patches.connectivity, strict=True)
    )
    return NodalFields(mesh.points[points], cells, units.values_si(all_values)[points], units.fluxes_si(all_fluxes))


def _fill(data: Array, columns: Indices, entries: Array) -> Array:
    result = data.copy()
    mask = columns != NONE
    result[mask] = entries[columns[mask]]
    return result


def _number(mask: np.ndarray[tuple[int, ...], np.dtype[np.bool_]], start: int) -> Indices:
    columns = np.full(mask.shape, NONE)
    columns[mask] = start + np.arange(mask.sum())
    return columns


def _apply(
    condition: BoundaryCondition,
    body: Body,
    patches: Patches,
    values: Array,
    fluxes: Array,
    flux_unknown: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
) -> None:
    """Enter one condition into values (p, fields), fluxes (m, fields) and flux_unknown (m, fields), in SI units."""
    field = condition.field
    points = body.mesh.group_points(condition.group)
    data = np.broadcast_to(np.asarray(condition.data, float), points.shape)
    members = patches.group == body.mesh.group(condition.group)
    if condition.kind == "flux":
        fluxes[members, field] = data[np.searchsorted(points, patches.point[members])]
        return
    old = values[points, field]
    tolerance = 1e-9 * np.abs(data).max(initial=0.0)
    conflict = ~np.isnan(old) & (np.abs(old - data) > tolerance)
    if conflict.any():
        raise CaseError(
            f"{body.fields.value_names[field]} on {condition.group!r} contradicts another face at "
            f"{int(conflict.sum())} shared points: {data[conflict][0]:g} and {old[conflict][0]:g}"
        )
    values[points, field] = data
    flux_unknown[members, field] = True


def _check_zone(body: Body, values: Array, contact_points: Indices) -> None:
    """Raise CaseError for a field in the contact zone that is prescribed on a neighbouring face."""
    prescribed = np.atleast_1d((~np.isnan(values[contact_points])).any(axis=0))
    if prescribed.any():
        names = ", ".join(name for name, hit in zip(body.fields.value_names, prescribed, strict=True) if hit)
        raise CaseError(f"{names} is prescribed on a face that touches the contact zone {body.contact_group!r}")
