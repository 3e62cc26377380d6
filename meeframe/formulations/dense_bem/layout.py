"""Degrees of freedom: numbers of unknown values and fluxes and of contact loads, and prescribed data.

Every unknown has a collocation equation of the same number, see collocation.py. Data are in units of the system, with
lengths relative to a unit of length and fields scaled by FieldScaling.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import ELECTRIC, Array, FieldSet, Indices
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
class Joint:
    """An interface between two regions.

    Attributes
    ----------
    group : str
        Face group of the interface.
    potential : float or None
        Potential of an electrode at the interface [V], NaN for a floating one; None without electrode.
    """

    group: str
    potential: float | None = None

    @property
    def floats(self) -> bool:
        """True for a floating electrode."""
        return self.potential is not None and bool(np.isnan(self.potential))


@dataclass(frozen=True, eq=False)
class Joints:
    """The interfaces of a region with those above and below it; the one above is its contact zone.

    Attributes
    ----------
    above, below : Joint or None
        The interfaces; None at the surface of the body.
    """

    above: Joint | None = None
    below: Joint | None = None

    @property
    def floats_above(self) -> bool:
        """True for a floating electrode above."""
        return self.above is not None and self.above.floats

    @property
    def floats_below(self) -> bool:
        """True for a floating electrode below."""
        return self.below is not None and self.below.floats

    def supports(self, fields: FieldSet) -> tuple[BoundaryCondition, ...]:
        """Return conditions on the values that the interfaces determine, with any data."""
        held = [] if self.below is None else [(self.below.group, field) for field in range(fields.size)]
        if self.above is not None and self.above.potential is not None:
            held.append((self.above.group, ELECTRIC))
        return tuple(BoundaryCondition(group, field, "value") for group, field in held)


BODY: Final = Joints()
"""A body that is one region."""


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
        Size of the system, with `n_added` unknowns, which come last and have no collocation equation.
    joints : Joints
        Interfaces with other regions. Values that these determine have the columns from `first_joined` on.
    zone_patches, lower_patches : Indices
        Flux nodes of the zone and of the interface below, (m,) each, in the order of their points.
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
    joints: Joints
    zone_patches: Indices
    lower_patches: Indices
    independent: int | None = None

    @property
    def n_fields(self) -> int:
        """Number of fields."""
        return int(self.value_column.shape[1])

    @property
    def n_independent(self) -> int:
        """Number of unknowns of the independent field."""
        if self.independent is None:
            return 0
        columns = np.concatenate([self.value_column[:, self.independent], self.flux_column[:, self.independent]])
        return int(((columns != NONE) & (columns < self.n_unknowns)).sum())

    @property
    def n_added(self) -> int:
        """Number of unknowns of floating electrodes: the potential of that below, the charge of that above."""
        return self.joints.floats_below + self.joints.floats_above

    @property
    def n_loads(self) -> int:
        """Number of loads: fluxes on the zone, and the potential of a floating electrode there."""
        return self.n_fields * len(self.zone) + self.joints.floats_above

    @property
    def n_last(self) -> int:
        """Number of unknowns that `number_first` leaves last: values of the zone, and those that are added."""
        columns = np.delete(self.value_column[self.zone], [] if self.independent is None else self.independent, axis=1)
        return int(((columns != NONE) & (columns < self.n_unknowns)).sum()) + self.n_added

    @property
    def first_joined(self) -> int:
        """First column after unknowns, loads and prescribed data, of the values that interfaces determine."""
        return self.n_unknowns + self.n_loads + 1

    @property
    def n_joined(self) -> int:
        """Number of columns for values that interfaces determine."""
        return self.n_fields * len(self.lower_patches) + self.joints.floats_above * len(self.zone)


def number_first(layout: Layout, field: int) -> Layout:
    """Return the layout with the unknowns of one field before all others, each in the same order as before."""
    is_first = np.zeros(layout.n_unknowns, bool)
    for columns in (layout.value_column[:, field], layout.flux_column[:, field]):
        is_first[columns[(columns != NONE) & (columns < layout.n_unknowns)]] = True
    number = np.arange(layout.first_joined + layout.n_joined)
    number[np.argsort(~is_first, kind="stable")] = np.arange(layout.n_unknowns)
    value_column, flux_column = (
        np.where(columns == NONE, NONE, number[columns]) for columns in (layout.value_column, layout.flux_column)
    )
    return replace(layout, value_column=value_column, flux_column=flux_column, independent=field)


def lay_out(body: Body, patches: Patches, units: Units, joints: Joints = BODY) -> Layout:
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
    joints : Joints, optional
        Interfaces, if the body is a region of a layered one.

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
    check_supports(replace(body, conditions=body.conditions + joints.supports(body.fields)))
    for condition in body.conditions:
        _apply(condition, body, patches, values, fluxes, flux_unknown)
    zone_patches = _patches_of(body, patches, body.contact_group)
    lower_patches = _patches_of(body, patches, None if joints.below is None else joints.below.group)
    zone = np.unique(patches.point[zone_patches])
    if joints.above is None:
        _check_zone(body, values, zone)
    if body.mesh.semi_infinite:
        border = np.unique(boundary_polygon(body.mesh))
        values[border] = np.where(np.isnan(values[border]), 0.0, values[border])
        flux_unknown[np.isin(patches.point, border)] = False
    n_fields = body.fields.size
    load_column = np.full(fluxes.shape, NONE)
    position = np.searchsorted(zone, patches.point[zone_patches])
    load_column[zone_patches] = n_fields * position[:, None] + np.arange(n_fields)
    flux_unknown[lower_patches] = True
    for joint, at in ((joints.above, zone_patches), (joints.below, lower_patches)):
        if joint is not None and joint.potential is not None:
            flux_unknown[at, ELECTRIC], load_column[at, ELECTRIC] = True, NONE
            if not joint.floats:
                values[patches.point[at], ELECTRIC] = joint.potential
    joined = _joined(joints, values, zone, patches.point[lower_patches])

    unknown_value = np.isnan(values) & (joined == NONE)
    in_zone = np.zeros(unknown_value.shape, bool)
    in_zone[zone] = unknown_value[zone]
    n_collocated = int(unknown_value.sum() + flux_unknown.sum())
    value_column = _number(unknown_value & ~in_zone, 0)
    flux_column = _number(flux_unknown, int((unknown_value & ~in_zone).sum()))
    value_column[in_zone] = np.arange(n_collocated - in_zone.sum(), n_collocated)
    layout = Layout(
        patches,
        value_column,
        units.values(np.nan_to_num(values)),
        flux_column,
        units.fluxes(np.where(flux_unknown, 0.0, fluxes)),
        load_column,
        zone,
        n_collocated + joints.floats_above + joints.floats_below,
        joints,
        zone_patches,
        lower_patches,
    )
    value_column[joined != NONE] = layout.first_joined + joined[joined != NONE]
    return layout


def _joined(joints: Joints, values: Array, zone: Indices, lower: Indices) -> Indices:
    """Return the numbers of values that interfaces determine, among those of points (p, fields), or NONE.

    They are the unknown ones on the interface below and, above, the potentials of a floating electrode.
    """
    n_fields = values.shape[1]
    joined = np.full(values.shape, NONE)
    joined[lower] = np.where(np.isnan(values[lower]), np.arange(n_fields * len(lower)).reshape(-1, n_fields), NONE)
    if joints.floats_above:
        joined[zone, ELECTRIC] = n_fields * len(lower) + np.arange(len(zone))
    return joined


def _patches_of(body: Body, patches: Patches, group: str | None) -> Indices:
    """Return the flux nodes of a face group, in the order of their points."""
    if group is None:
        return np.empty(0, np.int64)
    members = np.flatnonzero(patches.group == body.mesh.group(group))
    return members[np.argsort(patches.point[members], kind="stable")]


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
        Entries of the columns of values and of fluxes, (u,) each or more, in units of the system.
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
