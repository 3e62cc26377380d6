"""Fields inside a body from the shape functions of its finite elements."""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from meeframe.plugin import (
    INTERIOR_STAGE,
    MECHANICAL,
    THERMAL_FIELD,
    Array,
    CaseError,
    Indices,
    InteriorFields,
    PointFields,
    Progress,
    silent,
)
from meeframe_skfem.elements import VolumeElement, tabulate
from meeframe_skfem.layers import interface_depths, plane_normal
from meeframe_skfem.system import FiniteElementSolution
from meeframe_skfem.volume import VolumeMesh

MAX_ITERATIONS: Final = 30
MAX_CHANGE: Final = 1e-13
"""Change of reference coordinates at which the iteration ends."""
MAX_COORDINATE: Final = 3.0
"""Bound of reference coordinates during the iteration."""
OUTSIDE: Final = 1e-6
"""Reference coordinate by which a point may be outside of an element, for round-off of points on its faces."""
_MARGIN: Final = 0.1
"""Margin of the bounding boxes of elements, in their sizes, since curved sides bulge beyond their nodes."""
_ON_INTERFACE: Final = 1e-9
"""Distance of a point from an interface to be on it, relative to the depth of the interface."""
_BESIDE_INTERFACE: Final = 1e-3
"""Distance from an interface, in thicknesses of the thinnest layer, at which a point is in an element beside it."""
_LINEAR, _QUADRATIC = 0.5, 0.5 - np.sqrt(3.0) / 6.0
"""Distance of the points where gradients are most accurate from the sides of elements, in their widths."""
_BATCH: Final = 10_000_000
"""Points times elements of one batch."""


@final
@dataclass(frozen=True, eq=False)
class FiniteElementInterior(InteriorFields):
    """Values and gradients of the shape functions in the element that contains a point.

    Gradients jump between elements; on a common side, those of one element are returned. So do fluxes along interfaces
    between layers, and values where interfaces are not bonded. Tractions on interfaces are interpolated between the
    elements above and below.

    Attributes
    ----------
    solution
        The factorised system.
    """

    solution: FiniteElementSolution

    def evaluate(self, load: Array, points: Array, progress: Progress = silent) -> PointFields:
        """Return the fields at points (m, 3) in the body, its surface included, for a load (n, fields).

        Raises
        ------
        CaseError
            If a point is outside the body.
        """
        matched = self.solution.matched
        points = np.asarray(points, float)
        progress(INTERIOR_STAGE, 0.0)
        cells, xi = locate(matched.volume, points)
        outside = np.flatnonzero(cells < 0)
        if outside.size:
            raise CaseError(
                f"{outside.size} of {len(points)} points are outside the body, the first one at {points[outside[0]]} "
                "[m]; allowed: points in its finite elements"
            )
        tractions = load.copy()
        tractions[:, MECHANICAL] = np.einsum("nai,na->ni", matched.zone.frames, load[:, MECHANICAL])
        solved = self.solution.values(tractions)
        fields = self._in_cells(solved, points, cells, xi)
        if matched.body.layers.layers:
            fields = self._with_tractions_of_both_sides(solved, fields)
        progress(INTERIOR_STAGE, 1.0)
        return fields

    def _in_cells(self, solved: Array, points: Array, cells: Indices, xi: Array) -> PointFields:
        """Return the fields of the solution (p, fields) at reference coordinates (m, 3) in cells (m,)."""
        matched, mesh = self.solution.matched, self.solution.matched.volume
        layered = matched.layered
        nodal = solved[layered.mesh.cells[cells]]
        shapes, slopes = tabulate(mesh.element, xi)
        maps = np.einsum("mnk,mnx->mkx", slopes, mesh.points[mesh.cells[cells]])
        derivatives = np.einsum("mxk,mnk->mnx", np.linalg.inv(maps), slopes)
        values = np.einsum("mn,mnj->mj", shapes, nodal)
        gradients = np.einsum("mnx,mnj->mjx", derivatives, nodal)
        fluxes = np.empty_like(gradients.transpose(0, 2, 1))
        for region, stiffness in enumerate(layered.stiffnesses):
            members = layered.regions[cells] == region
            fields = PointFields.of(points[members], values[members], gradients[members], stiffness)
            moduli = matched.body.all_moduli[region]
            if moduli is not None:
                fields = fields.with_heat(moduli, matched.body.fields.index(THERMAL_FIELD.name))
            fluxes[members] = fields.fluxes
        return PointFields(points, values, gradients, fluxes)

    def _with_tractions_of_both_sides(self, solved: Array, fields: PointFields) -> PointFields:
        """Return the fields with tractions on interfaces interpolated between the elements above and below.

        Tractions on interfaces are continuous. Gradients are least accurate on the sides of elements and most accurate
        at points inside them (Barlow, Int. J. Numer. Methods Eng. 10 (1976) 243), between which tractions are linear.
        """
        matched = self.solution.matched
        mesh, depths, normal = matched.volume, interface_depths(matched.body), plane_normal(matched.zone)
        below = (matched.zone.points[0] - fields.points) @ normal
        on = np.flatnonzero((np.abs(below[:, None] - depths) < _ON_INTERFACE * depths).any(axis=1))
        beside = _BESIDE_INTERFACE * np.diff(depths, prepend=0.0).min()
        distance = _LINEAR if len(mesh.element.nodes) == mesh.element.n_corners else _QUADRATIC
        tractions, distances, has_cells = [], [], np.ones(len(on), bool)
        for side in (normal, -normal):
            cells, _ = locate(mesh, fields.points[on] + beside * side)
            away = distance * np.ptp(mesh.points[mesh.cells[cells]] @ normal, axis=1)
            points = fields.points[on] + away[:, None] * side
            cells, xi = locate(mesh, points)
            has_cells &= cells >= 0  # bodies with oblique sides may have no element there
            tractions.append(self._in_cells(solved, points, cells, xi).fluxes[:, :, MECHANICAL] @ normal)
            distances.append(away[:, None])
        (above, under), (up, down) = tractions, distances
        fluxes = fields.fluxes.copy()
        stress = fluxes[on][:, :, MECHANICAL]
        change = ((down * above + up * under) / (up + down) - stress @ normal)[:, :, None] * normal
        across = np.einsum("i,mij,j->m", normal, change, normal)[:, None, None] * np.outer(normal, normal)
        fluxes[on[has_cells], :, MECHANICAL] = (stress + change + change.transpose(0, 2, 1) - across)[has_cells]
        return replace(fields, fluxes=fluxes)


def locate(mesh: VolumeMesh, points: Array) -> tuple[Indices, Array]:
    """Return the cell that contains each point, and the reference coordinates there.

    Parameters
    ----------
    mesh : VolumeMesh
        The volume mesh.
    points : Array
        Positions, (m, 3), in the unit of the mesh.

    Returns
    -------
    Indices
        Cells, (m,), -1 for a point outside of all of them.
    Array
        Reference coordinates, (m, 3).
    """
    corners = mesh.points[mesh.cells]
    low, high = corners.min(axis=1), corners.max(axis=1)
    margin = _MARGIN * (high - low).max(axis=1, keepdims=True)
    cells, coordinates = np.full(len(points), -1), np.zeros((len(points), 3))
    excess = np.full(len(points), OUTSIDE)
    step = max(1, _BATCH // len(corners))
    for start in range(0, len(points), step):
        batch = points[start : start + step, None]
        point, cell = np.nonzero(((batch >= low - margin) & (batch <= high + margin)).all(axis=-1))
        point += start
        xi = _reference_coordinates(mesh.element, corners[cell], points[point])
        distances = _distance_outside(mesh.element, xi)
        # of all candidates the one that contains the point best comes first
        order = np.lexsort((distances, point))
        first = order[np.unique(point[order], return_index=True)[1]]
        inside = first[distances[first] <= excess[point[first]]]
        cells[point[inside]], coordinates[point[inside]] = cell[inside], xi[inside]
    return cells, coordinates


def _reference_coordinates(element: VolumeElement, nodes: Array, points: Array) -> Array:
    """Return reference coordinates (m, 3) of points (m, 3) in elements with nodes (m, n, 3) by Newton's method."""
    xi = np.tile(element.nodes.mean(axis=0), (len(points), 1))
    for _ in range(MAX_ITERATIONS):
        shapes, slopes = tabulate(element, xi)
        residual = points - np.einsum("mn,mnx->mx", shapes, nodes)
        maps = np.einsum("mnk,mnx->mxk", slopes, nodes)
        change = np.linalg.solve(maps, residual[..., None])[..., 0]
        updated = np.clip(xi + change, -MAX_COORDINATE, MAX_COORDINATE)
        largest, xi = np.abs(updated - xi).max(initial=0.0), updated
        if largest < MAX_CHANGE:
            break
    return xi


def _distance_outside(element: VolumeElement, xi: Array) -> Array:
    """Return by how much reference coordinates (m, 3) are outside the reference domain, (m,); <= 0 inside."""
    beyond = np.maximum(-xi.min(axis=1), 0.0)
    upper = xi.max(axis=1) if element.surface.reference == "quadrilateral" else xi.sum(axis=1)
    distance: Array = np.maximum(beyond, upper - 1.0)
    return distance
